//! C3D files out: Intel byte order, real numbers.
//!
//! Enters: a [`RawTake`]. Leaves: header, parameters (POINT, TRIAL, EVENT, and the ANALOG and
//! FORCE_PLATFORM groups that the format asks for, without channels), and every point of every
//! frame in the take's own units and axes. Layout: *The C3D File Format User Guide* (c3d.org).

use std::io::Write;

use super::ExportErrorKind;
use crate::import::take::{RawTake, is_present};

mod parameters;

const BLOCK: usize = 512;
/// Texts that one parameter holds, by a dimension of 8 bits.
const TEXTS: usize = 255;

/// Writes a take as C3D. Coordinates become `f32`; a sample that is missing, or beyond `f32`, is
/// written as (0, 0, 0) with residual -1.
///
/// Analog channels and rigid bodies are not written.
///
/// # Errors
/// The take has more points, events or label text than the format can say, a list's length is
/// wrong, or `out` fails.
pub fn write_c3d(take: &RawTake, out: &mut dyn Write) -> Result<(), ExportErrorKind> {
    check(take)?;
    let scale = residual_scale(take);
    // The block where the data begins is part of what comes before it: write once to measure.
    let len = parameters::write(take, scale, 0)?.len();
    let blocks = len.div_ceil(BLOCK);
    limit(
        "the number of parameter blocks (512 bytes, mostly labels)",
        blocks,
        255,
    )?;
    let data_block = 2 + blocks;
    let mut section = parameters::write(take, scale, data_block)?;
    section[2] = blocks as u8;
    section.resize(blocks * BLOCK, 0);

    out.write_all(&header(take, scale, data_block))?;
    out.write_all(&section)?;
    let mut frame_bytes = Vec::with_capacity(take.point_count() * 16);
    for frame in 0..take.frame_count {
        frame_bytes.clear();
        for point in 0..take.point_count() {
            write_sample(take, take.index(frame, point), scale, &mut frame_bytes);
        }
        out.write_all(&frame_bytes)?;
    }
    // Readers that know only 16-bit frame counts read a longer take to the end of the file: there
    // the last block stays unfilled, or its zeros would be frames.
    if take.frame_count <= 65_535 {
        let written = take.frame_count * take.point_count() * 16;
        let padding = written.next_multiple_of(BLOCK) - written;
        out.write_all(&[0; BLOCK][..padding])?;
    }
    Ok(())
}

fn check(take: &RawTake) -> Result<(), ExportErrorKind> {
    limit("the number of points", take.point_count(), 65_535)?;
    let last = usize::try_from(last_frame(take)).unwrap_or(usize::MAX);
    limit("the last frame's number", last, u32::MAX as usize)?;
    limit("the number of events", take.events.len(), TEXTS)?;
    check_lengths(take)
}

/// Checks that every list of a take is as long as its counts ask for.
pub(super) fn check_lengths(take: &RawTake) -> Result<(), ExportErrorKind> {
    let samples = take.point_count().saturating_mul(take.frame_count);
    for (what, found, expected) in [
        ("positions", take.positions.len(), samples),
        ("residuals", take.residuals.len(), samples),
        ("cameras", take.cameras.len(), samples),
        ("kinds", take.kinds.len(), take.point_count()),
    ] {
        // What a source does not hold is empty.
        let absent = found == 0 && matches!(what, "residuals" | "cameras");
        if found != expected && !absent {
            return Err(ExportErrorKind::SizeMismatch {
                what: what.into(),
                expected: expected as u64,
                found: found as u64,
            });
        }
    }
    Ok(())
}

fn limit(what: &str, count: usize, limit: usize) -> Result<(), ExportErrorKind> {
    if count <= limit {
        return Ok(());
    }
    Err(ExportErrorKind::OutOfRange {
        what: what.into(),
        value: count.to_string(),
        expected: format!("at most {limit} in a C3D file"),
    })
}

/// Step of the 8-bit residual: the source's, else 0.01 mm in the take's unit; larger where the
/// largest residual would not fit.
fn residual_scale(take: &RawTake) -> f32 {
    let stored = take
        .scale
        .map(f32::abs)
        .filter(|scale| scale.is_finite() && *scale > 0.0);
    let step = stored.unwrap_or((1e-5 / take.unit.metres()) as f32);
    let residuals = take
        .residuals
        .iter()
        .copied()
        .filter(|residual| residual.is_finite());
    let largest = residuals.fold(0.0, f32::max);
    // A half more than 255 steps still rounds to 255.
    if largest < 255.5 * step {
        step
    } else {
        largest / 255.0
    }
}

fn last_frame(take: &RawTake) -> u64 {
    take.first_frame
        .saturating_add(take.frame_count as u64)
        .saturating_sub(1)
}

/// What fits into 16 bits; more than that is 65535, and the TRIAL group says the rest.
fn word(value: u64) -> [u8; 2] {
    u16::try_from(value).unwrap_or(u16::MAX).to_le_bytes()
}

fn header(take: &RawTake, scale: f32, data_block: usize) -> [u8; BLOCK] {
    let mut bytes = [0; BLOCK];
    let mut put =
        |offset: usize, value: &[u8]| bytes[offset..offset + value.len()].copy_from_slice(value);
    put(0, &[2, 0x50]);
    put(2, &word(take.point_count() as u64));
    put(6, &word(take.first_frame));
    put(8, &word(last_frame(take)));
    put(10, &word(10));
    put(12, &(-scale).to_le_bytes());
    put(16, &word(data_block as u64));
    // Analog samples a frame: 1, as ANALOG:RATE is the frame rate.
    put(18, &word(1));
    put(20, &(take.rate as f32).to_le_bytes());
    // The mark that event labels of four letters are supported.
    put(298, &word(12345));
    bytes
}

fn write_sample(take: &RawTake, index: usize, scale: f32, out: &mut Vec<u8>) {
    let position = take.positions[index].map(|value| value as f32);
    let seen = is_present(take.positions[index]) && position.iter().all(|value| value.is_finite());
    let last = if seen {
        let residual = take.residuals.get(index).copied().unwrap_or(0.0).max(0.0);
        let steps = (residual / scale).round().min(255.0) as u8;
        let cameras = take.cameras.get(index).copied().unwrap_or(0) & 0x7f;
        f32::from(u16::from_be_bytes([cameras, steps]))
    } else {
        -1.0
    };
    for value in if seen { position } else { [0.0; 3] } {
        out.extend(value.to_le_bytes());
    }
    out.extend(last.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::c3d::parse;
    use crate::import::take::{LengthUnit, MISSING, PointKind, RawEvent, TakeOptions, UpAxis};

    fn round_trip(take: &RawTake) -> RawTake {
        let mut bytes = Vec::new();
        write_c3d(take, &mut bytes).unwrap();
        assert!(take.frame_count > 65_535 || bytes.len() % BLOCK == 0);
        parse(&bytes, "a.c3d", &TakeOptions::default()).unwrap()
    }

    #[test]
    fn everything_that_c3d_holds_comes_back() {
        let labels = ["LASI", "Knöchel", "*3", "LKneeAngles", "V"]
            .map(str::to_owned)
            .to_vec();
        let mut take = RawTake::empty(labels, 120.0, 3);
        take.kinds = vec![
            PointKind::Marker,
            PointKind::Marker,
            PointKind::Unlabelled,
            PointKind::Angle,
            PointKind::Model,
        ];
        take.first_frame = 480;
        take.unit = LengthUnit::Centimetre;
        take.up = UpAxis::MinusX;
        take.scale = Some(-0.5);
        take.positions = vec![[1.5, -2.25, 1e6]; 15];
        take.positions[7] = MISSING;
        take.residuals = vec![0.5; 15];
        take.residuals[7] = -1.0;
        take.cameras = vec![0b101_0001; 15];
        take.cameras[7] = 0;
        let event = |label: &str, seconds| RawEvent {
            label: label.into(),
            context: "Left".into(),
            seconds,
        };
        take.events = vec![event("Foot Strike", 1.5), event("Foot Off", 61.25)];
        let back = round_trip(&take);
        assert!(back.positions[7].iter().all(|value| value.is_nan()));
        let comparable = |take: &RawTake| {
            let mut take = take.clone();
            take.positions[7] = [0.0; 3];
            take
        };
        assert_eq!(comparable(&back), comparable(&take));
    }

    #[test]
    fn more_than_255_labels_and_more_than_65535_frames() {
        let labels = (0..600).map(|number| format!("m{number}")).collect();
        let take = RawTake::empty(labels, 100.0, 2);
        let back = round_trip(&take);
        assert_eq!(back.labels, take.labels);

        let mut take = RawTake::empty(vec!["a".into()], 100.0, 70_001);
        for (frame, position) in take.positions.iter_mut().enumerate() {
            *position = [frame as f64, 1.0, 2.0];
        }
        for first in [1, 65_535, 100_000] {
            take.first_frame = first;
            let back = round_trip(&take);
            assert_eq!((back.frame_count, back.first_frame), (70_001, first));
            assert_eq!(back.position(70_000, 0), Some([70_000.0, 1.0, 2.0]));
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_or_missing() {
        let refusal = |take: &RawTake| write_c3d(take, &mut Vec::new()).unwrap_err().to_string();
        let long = RawTake::empty(vec!["x".repeat(128)], 100.0, 1);
        assert!(
            refusal(&long).ends_with("is 128 bytes long, which must be at most 127 bytes long")
        );
        let many = RawTake::empty(vec![String::new(); 70_000], 100.0, 0);
        let text = "the number of points is 70000, which must be at most 65535 in a C3D file";
        assert_eq!(refusal(&many), text);
        let text = RawTake::empty(vec!["x".repeat(100); 2000], 100.0, 0);
        assert!(refusal(&text).starts_with("the number of parameter blocks"));
        let mut short = RawTake::empty(vec!["a".into()], 100.0, 2);
        short.positions.pop();
        assert_eq!(refusal(&short), "positions: 2 expected, 1 given");

        let mut large = RawTake::empty(vec!["a".into()], 100.0, 2);
        large.positions = vec![[1e300, 0.0, 0.0], [1.0, 2.0, 3.0]];
        let back = round_trip(&large);
        assert_eq!(
            (back.position(0, 0), back.position(1, 0)),
            (None, Some([1.0, 2.0, 3.0]))
        );
        large.first_frame = u64::MAX;
        assert!(refusal(&large).starts_with("the last frame's number"));
    }

    #[test]
    fn large_residuals_widen_the_step() {
        let mut take = RawTake::empty(vec!["a".into()], 100.0, 3);
        take.positions = vec![[1.0, 2.0, 3.0]; 3];
        take.scale = Some(-0.01);
        take.residuals = vec![0.0, 2.55, 1.0];
        assert_eq!(round_trip(&take).residuals, [0.0, 2.55, 1.0]);
        take.residuals[1] = 51.0;
        assert_eq!(round_trip(&take).residuals, [0.0, 51.0, 1.0]);
    }
}
