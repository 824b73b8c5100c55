//! TRC files out: a tab-separated table that OpenSim, Cortex and Motive read.

use std::io::Write;

use super::ExportErrorKind;
use super::c3d::check_lengths;
use crate::import::take::{RawTake, is_present};

/// Writes a take as TRC in its own units and axes; missing samples are blank.
///
/// Every number has as many digits as it takes to read the same `f64` back. Only points that are
/// positions are of use in TRC: what else `take` holds is written all the same.
///
/// # Errors
/// The lists of the take contradict its counts, or `out` fails.
pub fn write_trc(take: &RawTake, name: &str, out: &mut dyn Write) -> Result<(), ExportErrorKind> {
    check_lengths(take)?;
    let (rate, frames, points) = (take.rate, take.frame_count, take.point_count());
    writeln!(out, "PathFileType\t4\t(X/Y/Z)\t{}", plain(name))?;
    writeln!(
        out,
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames"
    )?;
    let unit = take.unit.symbol();
    writeln!(
        out,
        "{rate}\t{rate}\t{frames}\t{points}\t{unit}\t{rate}\t{}\t{frames}",
        take.first_frame
    )?;
    write!(out, "Frame#\tTime")?;
    for label in &take.labels {
        write!(out, "\t{}\t\t", plain(label))?;
    }
    write!(out, "\n\t")?;
    for number in 1..=points {
        write!(out, "\tX{number}\tY{number}\tZ{number}")?;
    }
    write!(out, "\n\n")?;
    for frame in 0..frames {
        write!(
            out,
            "{}\t{}",
            take.first_frame.saturating_add(frame as u64),
            frame as f64 / rate
        )?;
        for point in 0..points {
            match take.positions[take.index(frame, point)] {
                position if !is_present(position) => write!(out, "\t\t\t")?,
                [x, y, z] => write!(out, "\t{x}\t{y}\t{z}")?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Tabs and line ends would shift the columns.
fn plain(text: &str) -> String {
    text.replace(['\t', '\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::take::{LengthUnit, TakeOptions, UpAxis};
    use crate::import::trc::parse;

    #[test]
    fn a_take_comes_back_to_the_last_bit() {
        let mut take = RawTake::empty(vec!["A".into(), "B C".into()], 120.0, 3);
        take.first_frame = 12;
        take.unit = LengthUnit::Millimetre;
        take.positions[0] = [0.1 + 0.2, -1e-7, -1e11];
        take.positions[5] = [1.0, 2.0, 3.0];
        let mut bytes = Vec::new();
        write_trc(&take, "a\tb.trc", &mut bytes).unwrap();
        let options = TakeOptions {
            up: Some(UpAxis::PlusY),
            ..TakeOptions::default()
        };
        let back = parse(&bytes, "a.trc", &options).unwrap();
        assert_eq!(
            (&back.labels, back.rate, back.first_frame),
            (&take.labels, 120.0, 12)
        );
        for (frame, point) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
            assert_eq!(back.position(frame, point), take.position(frame, point));
        }
    }
}
