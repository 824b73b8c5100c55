//! Plain marker tables out: one row a frame, three columns a marker.

use std::io::Write;

use super::ExportErrorKind;
use super::c3d::check_lengths;
use crate::import::take::{RawTake, is_present};

/// Writes a take as CSV in its own units and axes: a comment with unit, up axis and rate, then
/// `frame,time_s,NAME_x,NAME_y,NAME_z,...`; missing samples are blank.
///
/// Every number has as many digits as it takes to read the same `f64` back. Commas and quotes in
/// names become `;` and `'`.
///
/// # Errors
/// The lists of the take contradict its counts, or `out` fails.
pub fn write_marker_csv(take: &RawTake, out: &mut dyn Write) -> Result<(), ExportErrorKind> {
    check_lengths(take)?;
    writeln!(
        out,
        "# unit: {}, up: {}, rate: {}",
        take.unit.symbol(),
        take.up.symbol(),
        take.rate
    )?;
    write!(out, "frame,time_s")?;
    for label in &take.labels {
        let name = label
            .replace(',', ";")
            .replace('"', "'")
            .replace(['\n', '\r'], " ");
        write!(out, ",{name}_x,{name}_y,{name}_z")?;
    }
    writeln!(out)?;
    for frame in 0..take.frame_count {
        write!(
            out,
            "{},{}",
            take.first_frame.saturating_add(frame as u64),
            frame as f64 / take.rate
        )?;
        for point in 0..take.point_count() {
            match take.positions[take.index(frame, point)] {
                position if !is_present(position) => write!(out, ",,,")?,
                [x, y, z] => write!(out, ",{x},{y},{z}")?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::marker_csv::parse;
    use crate::import::take::{LengthUnit, TakeOptions, UpAxis};

    #[test]
    fn a_take_comes_back_to_the_last_bit() {
        let mut take = RawTake::empty(vec!["A:1".into(), "B, \"C\"".into()], 59.94, 3);
        take.first_frame = 7;
        take.unit = LengthUnit::Inch;
        take.up = UpAxis::MinusZ;
        take.positions[1] = [0.1 + 0.2, -1e-7, -1e11];
        take.positions[4] = [1.0, 2.0, 3.0];
        let mut bytes = Vec::new();
        write_marker_csv(&take, &mut bytes).unwrap();
        let back = parse(&bytes, "a.csv", &TakeOptions::default()).unwrap();
        assert_eq!(back.labels, ["A:1", "B; 'C'"]);
        assert_eq!(
            (back.unit, back.up, back.rate),
            (take.unit, take.up, take.rate)
        );
        assert_eq!(back.first_frame, 7);
        for index in 0..6 {
            assert_eq!(
                back.position(index / 2, index % 2),
                take.position(index / 2, index % 2)
            );
        }
    }
}
