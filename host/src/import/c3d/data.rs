//! The samples themselves.

use super::bytes::ByteOrder;
use super::bytes::Bytes;
use super::layout::Layout;
use crate::import::take::{MISSING, RawTake};
use crate::import::text::MAX_MAGNITUDE;

/// Reads all points of `layout` into `take`, whose labels are set; `scale` is one step of an
/// integer coordinate and of a residual.
///
/// Linear in the samples; allocates what the samples in the file need.
pub(super) fn read(
    bytes: Bytes<'_>,
    order: ByteOrder,
    layout: &Layout,
    scale: f64,
    take: &mut RawTake,
) {
    let word = layout.word();
    let samples = layout.points * layout.frames;
    take.positions = Vec::with_capacity(samples);
    take.residuals = Vec::with_capacity(samples);
    take.cameras = Vec::with_capacity(samples);
    take.frame_count = layout.frames;
    if layout.points == 0 {
        return;
    }
    let all = bytes.up_to(layout.start, layout.frames * layout.frame_bytes());
    for frame in all.chunks_exact(layout.frame_bytes()) {
        for point in frame[..layout.points * 4 * word].chunks_exact(4 * word) {
            let sample = if layout.real {
                real_sample(order, point, scale)
            } else {
                integer_sample(order, point, scale)
            };
            // NaN is how some writers mark a point as missing.
            let seen = sample.filter(|(position, ..)| !position.iter().any(|value| value.is_nan()));
            let (position, residual, cameras) = seen.unwrap_or((MISSING, -1.0, 0));
            take.positions.push(position);
            take.residuals.push((residual as f32).min(f32::MAX));
            take.cameras.push(cameras);
        }
    }
}

/// Takes samples beyond any real length as missing; gives how many.
pub(super) fn drop_absurd(take: &mut RawTake) -> usize {
    let mut dropped = 0;
    for (index, position) in take.positions.iter_mut().enumerate() {
        // NaN compares false: it is missing already.
        if position.iter().any(|value| value.abs() > MAX_MAGNITUDE) {
            *position = MISSING;
            take.residuals[index] = -1.0;
            take.cameras[index] = 0;
            dropped += 1;
        }
    }
    dropped
}

/// Position, residual and camera mask, `None` where the point is marked as missing.
type Sample = Option<([f64; 3], f64, u8)>;

fn integer_sample(order: ByteOrder, point: &[u8], scale: f64) -> Sample {
    let (words, _) = point.as_chunks::<2>();
    let &[x, y, z, last] = words else { return None };
    let last = order.integer(last);
    if last < 0 {
        return None;
    }
    let position = [x, y, z].map(|value| f64::from(order.integer(value)) * scale);
    Some((position, f64::from(last & 0xff) * scale, (last >> 8) as u8))
}

fn real_sample(order: ByteOrder, point: &[u8], scale: f64) -> Sample {
    let (words, _) = point.as_chunks::<4>();
    let &[x, y, z, last] = words else { return None };
    let (value, bits) = (order.real(last), order.real_bits(last));
    let position = [x, y, z].map(|value| order.real(value));
    let (cameras, residual) = if value.is_nan() {
        // The ezc3d library stores two integers here, of which -1 means missing; as a real
        // number that is a negative NaN.
        if bits >> 31 == 1 {
            return None;
        }
        (0, 0)
    } else if value < 0.0 {
        return None;
    } else if bits != 0 && bits < 0x0080_0000 {
        // Two small integers of that library look like a number too small to be normal.
        ((bits & 0x7f) as u8, (bits >> 16) as u8)
    } else {
        // The specified way: one integer of 15 bits, stored as a real number.
        let last = value.min(32767.0) as u16;
        ((last >> 8) as u8, (last & 0xff) as u8)
    };
    Some((position, f64::from(residual) * scale, cameras))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALE: f64 = 0.5;

    #[test]
    fn integers_carry_cameras_and_residual_in_the_fourth_word() {
        // 3, -4, 5; cameras 0b101, residual 6.
        let point = [3, 0, 0xfc, 0xff, 5, 0, 6, 0b101];
        let sample = integer_sample(ByteOrder::Intel, &point, SCALE);
        assert_eq!(sample, Some(([1.5, -2.0, 2.5], 3.0, 0b101)));
        let gone = [3, 0, 0xfc, 0xff, 5, 0, 0xff, 0xff];
        assert_eq!(integer_sample(ByteOrder::Intel, &gone, SCALE), None);
    }

    fn real(last: [u8; 4]) -> Sample {
        let mut point = [0; 16];
        point[..4].copy_from_slice(&1f32.to_le_bytes());
        point[12..].copy_from_slice(&last);
        real_sample(ByteOrder::Intel, &point, SCALE)
    }

    #[test]
    fn reals_carry_the_same_integer_or_that_of_ezc3d() {
        let at = [1.0, 0.0, 0.0];
        assert_eq!(
            real((5.0 * 256.0 + 6.0f32).to_le_bytes()),
            Some((at, 3.0, 5))
        );
        assert_eq!(real(0f32.to_le_bytes()), Some((at, 0.0, 0)));
        assert_eq!(real((-0f32).to_le_bytes()), Some((at, 0.0, 0)));
        assert_eq!(real((-1f32).to_le_bytes()), None);
        assert_eq!(
            real([0, 0, 0xff, 0xff]),
            None,
            "mask 0, residual -1 as two integers"
        );
        assert_eq!(
            real([5, 0, 6, 0]),
            Some((at, 3.0, 5)),
            "mask 5, residual 6 as two integers"
        );
        assert_eq!(
            real(f32::NAN.to_le_bytes()),
            Some((at, 0.0, 0)),
            "residual unknown"
        );
        assert_eq!(real(1e9f32.to_le_bytes()), Some((at, 127.5, 127)));
    }
}
