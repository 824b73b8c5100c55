//! From source units and axes to metres with Y up, and back.

use std::collections::HashMap;

use glam::DVec3;

use super::{SourceSpace, Take, TakeError, expect_len};
use crate::import::take::{MISSING, RawTake};
use crate::import::{Notice, Place};

impl Take {
    /// The measured markers of a raw take, converted to metres with Y up; what was left out or
    /// repaired is in the second value.
    ///
    /// Points that are no measured positions (angles, forces, model outputs) are left out. A
    /// sample at exactly (0, 0, 0) that no camera saw is missing: this is how some programs write
    /// it. Repeated labels are numbered. Linear in the samples.
    ///
    /// # Errors
    /// The counts of `raw` disagree, its rate is not above 0, or a coordinate is infinite.
    pub fn from_raw(raw: &RawTake) -> Result<(Self, Vec<Notice>), TakeError> {
        let samples = raw.point_count().saturating_mul(raw.frame_count);
        expect_len("positions", raw.positions.len(), samples)?;
        expect_len("kinds", raw.kinds.len(), raw.point_count())?;
        for (what, len) in [
            ("residuals", raw.residuals.len()),
            ("cameras", raw.cameras.len()),
        ] {
            if len > 0 {
                expect_len(what, len, samples)?;
            }
        }
        let mut notices = Vec::new();
        let markers: Vec<usize> = (0..raw.point_count())
            .filter(|point| raw.kinds[*point].is_measured())
            .collect();
        let left_out = raw.point_count() - markers.len();
        if left_out > 0 {
            let text = format!("{left_out} points are no measured positions: left out");
            notices.push(Notice::new(Place::File, text));
        }

        let source = SourceSpace {
            unit: raw.unit,
            up: raw.up,
        };
        let matrix = source.to_metres();
        let mut zeros = 0;
        let mut positions = Vec::with_capacity(markers.len() * raw.frame_count);
        for point in &markers {
            for frame in 0..raw.frame_count {
                let index = raw.index(frame, *point);
                let position = raw.positions[index];
                let unseen = raw.cameras.get(index).is_none_or(|mask| *mask == 0)
                    && raw
                        .residuals
                        .get(index)
                        .is_none_or(|residual| *residual <= 0.0);
                positions.push(if position == [0.0; 3] && unseen {
                    zeros += 1;
                    DVec3::NAN
                } else {
                    matrix * DVec3::from(position)
                });
            }
        }
        if zeros > 0 {
            let text =
                format!("{zeros} samples stand at exactly (0, 0, 0) unseen: taken as missing");
            notices.push(Notice::new(Place::File, text));
        }
        let labels = markers
            .iter()
            .map(|point| raw.labels[*point].clone())
            .collect();
        let mut take = Self::new(labels, raw.rate, raw.frame_count, positions)?;
        take.kinds = markers.iter().map(|point| raw.kinds[*point]).collect();
        take.first_frame = raw.first_frame;
        take.source = source;
        take.events.clone_from(&raw.events);
        let renamed = number_repeats(&mut take.labels);
        if renamed > 0 {
            let text = format!("{renamed} labels are repeated: numbered");
            notices.push(Notice::new(Place::File, text));
        }
        Ok((take, notices))
    }

    /// The take in the units and axes of its source, for writing.
    ///
    /// Converting there and back changes a coordinate by no more than a few units in the last
    /// place of an `f64`.
    #[must_use]
    pub fn to_raw(&self) -> RawTake {
        let turn = self.source.up.to_y_up().transpose();
        let metres = self.source.unit.metres();
        let mut raw = RawTake::empty(self.labels.clone(), self.rate, self.frame_count);
        raw.kinds.clone_from(&self.kinds);
        raw.first_frame = self.first_frame;
        raw.unit = self.source.unit;
        raw.up = self.source.up;
        raw.events.clone_from(&self.events);
        for marker in 0..self.marker_count() {
            for (frame, position) in self.trajectory(marker).iter().enumerate() {
                let index = raw.index(frame, marker);
                raw.positions[index] = if position.is_nan() {
                    MISSING
                } else {
                    (turn * *position / metres).to_array()
                };
            }
        }
        raw
    }
}

/// Makes labels unique by appending `#2`, `#3` and so on; gives how many changed.
fn number_repeats(labels: &mut [String]) -> usize {
    let mut seen: HashMap<String, usize> = HashMap::new();
    for label in labels.iter() {
        seen.entry(label.clone()).or_insert(0);
    }
    let mut renamed = 0;
    for label in labels {
        let count = seen.entry(label.clone()).or_insert(0);
        *count += 1;
        if *count == 1 {
            continue;
        }
        let mut number = *count;
        let unique = loop {
            let name = format!("{label}#{number}");
            if !seen.contains_key(&name) {
                break name;
            }
            number += 1;
        };
        seen.insert(label.clone(), number);
        seen.insert(unique.clone(), 1);
        *label = unique;
        renamed += 1;
    }
    renamed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::take::{LengthUnit, PointKind, UpAxis};

    #[test]
    fn raw_source_space_comes_back() {
        let labels = ["M", "M", "M#2", "angle", "M"].map(str::to_owned).to_vec();
        let mut raw = RawTake::empty(labels, 50.0, 2);
        raw.kinds[3] = PointKind::Angle;
        raw.unit = LengthUnit::Millimetre;
        raw.up = UpAxis::PlusZ;
        raw.positions[0] = [1000.0, 2000.0, 3000.0];
        raw.positions[1] = [0.0; 3];
        let (take, notices) = Take::from_raw(&raw).unwrap();
        assert_eq!(take.labels(), ["M", "M#3", "M#2", "M#4"]);
        assert_eq!(take.position(0, 0), Some(DVec3::new(1.0, 3.0, -2.0)));
        assert_eq!(take.position(1, 0), None, "the origin, unseen");
        assert_eq!(notices.len(), 3, "angle, zero, labels: {notices:?}");
        let back = take.to_raw();
        assert_eq!(back.position(0, 0), Some([1000.0, 2000.0, 3000.0]));
        assert_eq!((back.unit, back.up), (raw.unit, raw.up));

        let one = take.trajectory(0).to_vec();
        let merged = take.with_trajectories(vec!["one".into()], one).unwrap();
        assert_eq!(merged.source(), take.source());
        assert_eq!(
            merged.to_raw().position(0, 0),
            Some([1000.0, 2000.0, 3000.0])
        );

        raw.residuals = vec![1.0; 10];
        let (take, _) = Take::from_raw(&raw).unwrap();
        assert_eq!(
            take.position(1, 0),
            Some(DVec3::ZERO),
            "the origin, measured"
        );
        raw.residuals.pop();
        assert!(matches!(
            Take::from_raw(&raw),
            Err(TakeError::Mismatch {
                what: "residuals",
                ..
            })
        ));
    }
}
