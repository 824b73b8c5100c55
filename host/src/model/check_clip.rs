//! Checks keys, sorts tracks and makes neighbouring quaternions agree in sign.

use super::{Clip, MorphTrack, Track, bad_index, not_finite};
use crate::import::{
    Channel, ImportError, ImportErrorKind, Interpolation, Notice, Place, RawClip, RawTrack,
};

/// `order` maps raw joint indices to the skeleton's. O(keys).
pub(super) fn check(
    raw: RawClip,
    order: &[usize],
    morph_count: usize,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<Clip, ImportError> {
    let clip_name = raw.name;
    let mut tracks: Vec<Track> = Vec::with_capacity(raw.tracks.len());
    for (index, track) in raw.tracks.into_iter().enumerate() {
        let place = Place::Item(format!("clip {clip_name:?}, track {index}"));
        let checked = check_track(track, order).map_err(|kind| kind.at(file, place.clone()))?;
        tracks.push(checked);
    }
    tracks.sort_by_key(|track| (track.joint, track.channel));
    let before = tracks.len();
    tracks.dedup_by_key(|track| (track.joint, track.channel));
    if tracks.len() < before {
        let place = Place::Item(format!("clip {clip_name:?}"));
        let text = "several tracks move one channel of one joint; the first is used";
        notices.push(Notice::new(place, text));
    }
    let morph_track = raw
        .morph_weights
        .map(|(interpolation, times, values)| {
            check_morph_track(interpolation, times, values, morph_count)
        })
        .transpose()
        .map_err(|kind| kind.at(file, Place::Item(format!("clip {clip_name:?}, weights"))))?;
    let ends = tracks.iter().map(|track| &track.times);
    let duration = ends
        .chain(morph_track.iter().map(|track| &track.times))
        .filter_map(|times| times.last())
        .fold(0.0, |longest: f64, &end| longest.max(end));
    Ok(Clip {
        name: clip_name,
        tracks,
        morph_track,
        duration,
        sample_period: raw.sample_period,
    })
}

fn check_times(times: &[f64]) -> Result<(), ImportErrorKind> {
    if times.is_empty() {
        return Err(ImportErrorKind::Missing {
            what: "a key".into(),
        });
    }
    if let Some(key) = times.iter().position(|time| !time.is_finite()) {
        return Err(not_finite(format!("the time of key {key}")));
    }
    if times[0] < 0.0 {
        return Err(ImportErrorKind::OutOfRange {
            what: "the time of key 0".into(),
            value: times[0].to_string(),
            expected: "at least 0".into(),
        });
    }
    if let Some(key) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(ImportErrorKind::OutOfRange {
            what: format!("the time of key {}", key + 1),
            value: times[key + 1].to_string(),
            expected: format!("later than {}", times[key]),
        });
    }
    Ok(())
}

fn values_a_key(interpolation: Interpolation) -> usize {
    if interpolation == Interpolation::CubicSpline {
        3
    } else {
        1
    }
}

fn check_track(raw: RawTrack, order: &[usize]) -> Result<Track, ImportErrorKind> {
    let joint = *order
        .get(raw.joint)
        .ok_or_else(|| bad_index("joint", raw.joint, order.len()))?;
    check_times(&raw.times)?;
    check_length(
        raw.values.len(),
        raw.times.len() * values_a_key(raw.interpolation),
    )?;
    let mut values = raw.values;
    if let Some(value) = values.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
        return Err(not_finite(format!("value {value}")));
    }
    if raw.channel == Channel::Rotation {
        match raw.interpolation {
            Interpolation::CubicSpline => {}
            Interpolation::Step | Interpolation::Linear => normalise_rotations(&mut values)?,
        }
    }
    Ok(Track {
        joint,
        channel: raw.channel,
        interpolation: raw.interpolation,
        times: raw.times,
        values,
    })
}

/// Unit length, and each key on the same side as the one before, so that interpolation takes the
/// shorter arc.
fn normalise_rotations(values: &mut [[f64; 4]]) -> Result<(), ImportErrorKind> {
    let mut before = [0.0; 4];
    for (key, value) in values.iter_mut().enumerate() {
        let length = value.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length < 1e-6 {
            return Err(ImportErrorKind::OutOfRange {
                what: format!("the length of quaternion {key}"),
                value: length.to_string(),
                expected: "1".into(),
            });
        }
        let dot: f64 = value.iter().zip(&before).map(|(a, b)| a * b).sum();
        let factor = if dot < 0.0 { -1.0 } else { 1.0 } / length;
        value.iter_mut().for_each(|x| *x *= factor);
        before = *value;
    }
    Ok(())
}

fn check_length(found: usize, needed: usize) -> Result<(), ImportErrorKind> {
    if found == needed {
        return Ok(());
    }
    Err(ImportErrorKind::Contradiction {
        what: format!("{found} key values where the key times need {needed}"),
    })
}

fn check_morph_track(
    interpolation: Interpolation,
    times: Vec<f64>,
    values: Vec<f64>,
    morph_count: usize,
) -> Result<MorphTrack, ImportErrorKind> {
    check_times(&times)?;
    check_length(
        values.len(),
        times.len() * morph_count * values_a_key(interpolation),
    )?;
    if let Some(value) = values.iter().position(|x| !x.is_finite()) {
        return Err(not_finite(format!("weight {value}")));
    }
    Ok(MorphTrack {
        interpolation,
        times,
        values,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(times: &[f64], values: &[[f64; 4]]) -> RawClip {
        RawClip {
            name: "c".into(),
            tracks: vec![RawTrack {
                joint: 0,
                channel: Channel::Rotation,
                interpolation: Interpolation::Linear,
                times: times.to_vec(),
                values: values.to_vec(),
            }],
            ..RawClip::default()
        }
    }

    fn run(raw: RawClip) -> Result<Clip, ImportError> {
        check(raw, &[0], 0, "x", &mut Vec::new())
    }

    #[test]
    fn quaternions_are_made_unit_and_continuous() {
        let clip = run(track(
            &[0.0, 1.0],
            &[[0.0, 0.0, 0.0, 2.0], [0.0, 0.0, 0.0, -1.0]],
        ))
        .unwrap();
        assert_eq!(clip.tracks[0].values, [[0.0, 0.0, 0.0, 1.0]; 2]);
        assert!((clip.duration - 1.0).abs() < f64::EPSILON);
    }

    #[test]
    fn bad_keys_are_refused() {
        let unit = [0.0, 0.0, 0.0, 1.0];
        for (times, values) in [
            (vec![], vec![]),
            (vec![0.0, 0.0], vec![unit; 2]),
            (vec![0.0, f64::NAN], vec![unit; 2]),
            (vec![-1.0], vec![unit]),
            (vec![0.0], vec![unit; 2]),
            (vec![0.0], vec![[0.0; 4]]),
            (vec![0.0], vec![[f64::INFINITY, 0.0, 0.0, 1.0]]),
        ] {
            assert!(run(track(&times, &values)).is_err(), "{times:?} {values:?}");
        }
        let mut raw = track(&[0.0], &[unit]);
        raw.tracks[0].joint = 3;
        assert!(matches!(
            run(raw).unwrap_err().kind,
            ImportErrorKind::BadIndex { .. }
        ));
    }
}
