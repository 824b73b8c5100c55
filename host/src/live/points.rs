//! Raw points over UDP, for capture systems without a protocol of their own.
//!
//! One datagram a frame, little-endian:
//!
//! | offset | type | what |
//! | --- | --- | --- |
//! | 0 | 4 bytes | `SNWP` |
//! | 4 | u8 | version, 1 |
//! | 5 | u8 | zero |
//! | 6 | u16 | points, at most 4,092 |
//! | 8 | u32 | frame number, one more each frame, wraps |
//! | 12 | u32 | zero |
//! | 16 | u64 | microseconds of the sender's clock |
//! | 24 | points x 16 bytes | u32 marker number, 4,294,967,295 where unknown; f32 x, y, z |
//!
//! Metres, right-handed, Y up. Unlabelled points come in any order.

use super::{LARGEST_DATAGRAM, LiveError};

/// Port that is listened to unless told otherwise.
pub const PORT: u16 = 39_600;

const MAGIC: &[u8; 4] = b"SNWP";
const VERSION: u8 = 1;
const HEADER: usize = 24;
const POINT: usize = 16;
const UNLABELLED: u32 = u32::MAX;

/// Points that a datagram holds.
pub const MOST: usize = (LARGEST_DATAGRAM - HEADER) / POINT;

/// A point, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Which marker it is, if the sender knows.
    pub marker: Option<u32>,
    /// Where.
    pub position: [f32; 3],
}

/// One frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Frame number, wraps.
    pub number: u32,
    /// The sender's clock.
    pub microseconds: u64,
    /// What was seen.
    pub points: Vec<Point>,
}

/// Reads a datagram. O(points)
///
/// # Errors
/// Other bytes than described above, numbers that are not finite.
pub fn read(packet: &[u8]) -> Result<Frame, LiveError> {
    let malformed = |at, what| Err(LiveError::Malformed { at, what });
    let Some((header, points)) = packet.split_at_checked(HEADER) else {
        return Err(LiveError::Short {
            at: packet.len(),
            what: "the header",
        });
    };
    if header[..4] != *MAGIC {
        return malformed(0, "not a frame of points");
    }
    if header[4] != VERSION {
        return malformed(4, "a version that is not known");
    }
    if header[5] != 0 || header[12..16] != [0; 4] {
        return malformed(5, "reserved bytes that are not zero");
    }
    let word = |at: usize| [header[at], header[at + 1], header[at + 2], header[at + 3]];
    let count = usize::from(u16::from_le_bytes([header[6], header[7]]));
    if points.len() != count * POINT {
        return malformed(6, "another number of points than the length tells");
    }
    let microseconds = [word(16), word(20)].concat();
    let microseconds = microseconds.try_into().map(u64::from_le_bytes);
    let mut frame = Frame {
        number: u32::from_le_bytes(word(8)),
        microseconds: microseconds.unwrap_or(0),
        points: Vec::with_capacity(count),
    };
    for row in points.as_chunks::<POINT>().0 {
        let words = row.as_chunks::<4>().0;
        let marker = u32::from_le_bytes(words[0]);
        let position = [words[1], words[2], words[3]].map(f32::from_le_bytes);
        if !position.iter().all(|x| x.is_finite() && x.abs() <= 1e6) {
            return Err(LiveError::NotFinite {
                what: "the position",
                name: format!("point {}", frame.points.len()),
            });
        }
        frame.points.push(Point {
            marker: (marker != UNLABELLED).then_some(marker),
            position,
        });
    }
    Ok(frame)
}

/// The datagram that says this.
///
/// # Errors
/// More than [`MOST`] points.
pub fn write(frame: &Frame) -> Result<Vec<u8>, LiveError> {
    let count = frame.points.len();
    let Some(stated) = u16::try_from(count).ok().filter(|_| count <= MOST) else {
        return Err(LiveError::TooMany { count, limit: MOST });
    };
    let mut bytes = Vec::with_capacity(HEADER + POINT * count);
    bytes.extend_from_slice(MAGIC);
    bytes.extend([VERSION, 0]);
    bytes.extend(stated.to_le_bytes());
    bytes.extend(frame.number.to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(frame.microseconds.to_le_bytes());
    for point in &frame.points {
        bytes.extend(point.marker.unwrap_or(UNLABELLED).to_le_bytes());
        bytes.extend(point.position.iter().flat_map(|x| x.to_le_bytes()));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame() -> Frame {
        let point = |marker, x| Point {
            marker,
            position: [x, 1.5, -2.0],
        };
        Frame {
            number: 7,
            microseconds: 1 << 40,
            points: vec![point(Some(3), 0.5), point(None, -0.25)],
        }
    }

    #[test]
    fn a_frame_survives_and_no_part_of_it_passes() {
        let bytes = write(&frame()).expect("fits");
        assert_eq!(read(&bytes), Ok(frame()));
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "cut at {length}");
        }
        assert!(read(&[bytes, vec![0]].concat()).is_err());
    }

    #[test]
    fn too_many_points_and_numbers_that_are_none_are_refused() {
        let mut wrong = frame();
        wrong.points[1].position[2] = f32::INFINITY;
        assert!(read(&write(&wrong).expect("fits")).is_err());
        wrong.points = vec![wrong.points[0]; MOST + 1];
        assert!(write(&wrong).is_err());
    }
}
