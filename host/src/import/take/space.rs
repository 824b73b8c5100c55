//! Finds the unit and the up axis of a take: the caller's word, else the file's, else the data's.
//!
//! Enters: source coordinates. Leaves: [`RawTake::unit`], [`RawTake::up`], and a notice for
//! everything that was not stated. The rules look for a person in the recording, because almost
//! every marker capture holds one.

use glam::DVec3;

use super::{LengthUnit, Place, RawTake, TakeOptions, UpAxis, split_subject};

/// What a file says about its space.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stated {
    /// Where the file speaks of units, for notices.
    pub unit_place: Option<Place>,
    /// The unit as text, absent or empty where the file is silent.
    pub unit: Option<String>,
    /// The up axis.
    pub up: Option<UpAxis>,
    /// What files of this format mostly use, where neither file nor data tells.
    pub usual_up: Option<UpAxis>,
}

/// Frames that the rules look at.
const SAMPLED_FRAMES: usize = 200;
/// How much one axis must stand out before a rule decides.
const CLEAR: f64 = 1.5;

/// Sets `take.unit` and `take.up`.
pub(crate) fn settle(take: &mut RawTake, stated: &Stated, options: &TakeOptions) {
    let sample = Sample::of(take);
    settle_unit(take, stated, options, &sample);
    settle_up(take, stated, options, &sample);
}

fn settle_unit(take: &mut RawTake, stated: &Stated, options: &TakeOptions, sample: &Sample) {
    let text = stated.unit.as_deref().unwrap_or("").trim();
    let place = stated.unit_place.clone().unwrap_or(Place::File);
    let extent = sample.largest_extent();
    let known = options.unit.or_else(|| LengthUnit::parse(text));
    take.unit = match (known, extent) {
        (Some(unit), _) => unit,
        (None, Some(extent)) => {
            let unit = likely_unit(extent);
            let said = if text.is_empty() {
                "no unit is stated".to_owned()
            } else {
                format!("the unit {text:?} is not known")
            };
            take.notice(
                place.clone(),
                format!(
                    "{said}: {symbol} taken, because the markers spread over {extent:.4} units; \
                     state the unit if this is wrong",
                    symbol = unit.symbol()
                ),
            );
            unit
        }
        (None, None) => {
            take.notice(
                place.clone(),
                "no unit is stated and no markers tell: mm taken",
            );
            LengthUnit::Millimetre
        }
    };
    if let (Some(unit), Some(extent)) = (known, extent) {
        let metres = extent * unit.metres();
        if !(0.005..=100.0).contains(&metres) {
            take.notice(
                place,
                format!(
                    "in {} the markers of a frame spread over {metres:.3e} m: \
                     state the unit if this is wrong",
                    unit.symbol()
                ),
            );
        }
    }
}

/// A frame of markers on a person or a part of one spreads over 0.25 m to 10 m.
fn likely_unit(extent: f64) -> LengthUnit {
    if extent < 10.0 {
        LengthUnit::Metre
    } else if extent < 250.0 {
        LengthUnit::Centimetre
    } else {
        LengthUnit::Millimetre
    }
}

fn settle_up(take: &mut RawTake, stated: &Stated, options: &TakeOptions, sample: &Sample) {
    if let Some(up) = options.up {
        take.up = up;
        return;
    }
    let evidence = by_names(take, sample);
    if let Some(up) = stated.up {
        take.up = up;
        if let Some(seen) = evidence.filter(|seen| *seen != up) {
            take.notice(
                Place::File,
                format!(
                    "the file says that {} is up, but the upper body's markers lie towards {}: \
                     the file's axis taken; state the up axis if this is wrong",
                    up.symbol(),
                    seen.symbol()
                ),
            );
        }
        return;
    }
    let (up, why) = if let Some(up) = evidence {
        (up, "the upper body's markers lie that way from the feet")
    } else if let Some(up) = by_floor(sample) {
        (
            up,
            "only along it does everything stay on one side of the origin",
        )
    } else if let Some(up) = by_extent(sample) {
        (up, "the markers of a frame spread farthest along it")
    } else {
        (
            stated.usual_up.unwrap_or(UpAxis::PlusY),
            "this is usual, and neither the file nor the markers tell",
        )
    };
    take.up = up;
    take.notice(
        Place::File,
        format!(
            "no up axis is stated: {} taken, because {why}; state the up axis if this is wrong",
            up.symbol()
        ),
    );
}

/// Measured marker positions of up to [`SAMPLED_FRAMES`] frames, evenly spread.
struct Sample {
    /// One list a frame: (point, position).
    frames: Vec<Vec<(usize, DVec3)>>,
}

impl Sample {
    fn of(take: &RawTake) -> Self {
        let step = take.frame_count.div_ceil(SAMPLED_FRAMES).max(1);
        let measured: Vec<usize> = (0..take.point_count())
            .filter(|point| take.kinds[*point].is_measured())
            .collect();
        let frames = if measured.is_empty() {
            0
        } else {
            take.frame_count
        };
        let frames = (0..frames)
            .step_by(step)
            .map(|frame| {
                let seen = measured.iter().filter_map(|point| {
                    let position = DVec3::from(take.position(frame, *point)?);
                    (position != DVec3::ZERO).then_some((*point, position))
                });
                seen.collect()
            })
            .collect();
        Self { frames }
    }

    /// Median over frames of the bounding box's sides.
    fn extents(&self) -> Option<DVec3> {
        let boxes: Vec<DVec3> = self
            .frames
            .iter()
            .filter(|frame| frame.len() > 1)
            .map(|frame| {
                let all = || frame.iter().map(|(_, position)| *position);
                let low = all().fold(DVec3::INFINITY, DVec3::min);
                let high = all().fold(DVec3::NEG_INFINITY, DVec3::max);
                high - low
            })
            .collect();
        median(&boxes)
    }

    fn largest_extent(&self) -> Option<f64> {
        self.extents()
            .map(DVec3::max_element)
            .filter(|extent| *extent > 0.0)
    }
}

/// Largest side of the median frame's bounding box, in source units.
pub(crate) fn median_extent(take: &RawTake) -> Option<f64> {
    Sample::of(take).largest_extent()
}

/// Median of each component.
fn median(values: &[DVec3]) -> Option<DVec3> {
    if values.is_empty() {
        return None;
    }
    let component = |axis: usize| {
        let mut list: Vec<f64> = values.iter().map(|value| value[axis]).collect();
        list.sort_by(f64::total_cmp);
        list[list.len() / 2]
    };
    Some(DVec3::new(component(0), component(1), component(2)))
}

/// The axis that stands out by [`CLEAR`] over both others.
fn clear_axis(size: DVec3) -> Option<usize> {
    let size = size.abs();
    (0..3).find(|axis| (0..3).all(|other| other == *axis || size[*axis] > CLEAR * size[other]))
}

/// Head, shoulders and pelvis against feet, by the names that marker sets use.
fn by_names(take: &RawTake, sample: &Sample) -> Option<UpAxis> {
    const UPPER: [&str; 12] = [
        "HEAD", "FHD", "BHD", "SHO", "ACR", "CLAV", "STRN", "STERN", "C7", "T10", "ASI", "PSI",
    ];
    const LOWER: [&str; 5] = ["TOE", "HEEL", "ANK", "FOOT", "META"];
    const LOWER_END: [&str; 6] = ["HEE", "HEL", "MT1", "MT2", "MT5", "CAL"];
    let side = |label: &String| {
        let name = split_subject(label).1.to_ascii_uppercase();
        if name.contains("WHEEL") {
            return None;
        }
        let upper = UPPER.iter().any(|part| name.contains(part));
        let lower = LOWER.iter().any(|part| name.contains(part))
            || LOWER_END.iter().any(|part| name.ends_with(part));
        match (upper, lower) {
            (true, false) => Some(true),
            (false, true) => Some(false),
            _ => None,
        }
    };
    let sides: Vec<Option<bool>> = take.labels.iter().map(side).collect();
    let rises: Vec<DVec3> = sample
        .frames
        .iter()
        .filter_map(|frame| {
            let mean = |upper: bool| {
                let group = frame
                    .iter()
                    .filter(|(point, _)| sides[*point] == Some(upper));
                let (sum, count) = group.fold((DVec3::ZERO, 0), |(sum, count), (_, position)| {
                    (sum + *position, count + 1)
                });
                (count > 0).then(|| sum / f64::from(count))
            };
            Some(mean(true)? - mean(false)?)
        })
        .collect();
    let rise = median(&rises)?;
    let axis = clear_axis(rise)?;
    Some(UpAxis::from_index(axis, rise[axis] > 0.0))
}

/// The floor is at height 0 in a calibrated volume, and the origin lies within the floor's area.
fn by_floor(sample: &Sample) -> Option<UpAxis> {
    let mut above = [false; 3];
    for (axis, above) in above.iter_mut().enumerate() {
        let mut values: Vec<f64> = sample
            .frames
            .iter()
            .flatten()
            .map(|(_, position)| position[axis])
            .collect();
        if values.len() < 20 {
            return None;
        }
        values.sort_by(f64::total_cmp);
        // A hundredth on each side may be ghosts.
        let low = values[values.len() / 100];
        let high = values[values.len() - 1 - values.len() / 100];
        *above = low > -0.05 * (high - low);
    }
    match above {
        [true, false, false] => Some(UpAxis::PlusX),
        [false, true, false] => Some(UpAxis::PlusY),
        [false, false, true] => Some(UpAxis::PlusZ),
        _ => None,
    }
}

/// A standing person is taller than wide.
fn by_extent(sample: &Sample) -> Option<UpAxis> {
    let axis = clear_axis(sample.extents()?)?;
    Some(UpAxis::from_index(axis, true))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two frames of four markers; `axis` gives each marker's place along X, Y, Z.
    fn take(labels: [&str; 4], places: [[f64; 3]; 4]) -> RawTake {
        let labels = labels.map(str::to_owned).to_vec();
        let mut take = RawTake::empty(labels, 100.0, 20);
        for frame in 0..20 {
            for (point, place) in places.iter().enumerate() {
                take.positions[frame * 4 + point] = *place;
            }
        }
        take
    }

    fn settled(mut take: RawTake, stated: Stated, options: TakeOptions) -> RawTake {
        settle(&mut take, &stated, &options);
        take
    }

    const STANDING_Z: [[f64; 3]; 4] = [
        [500.0, -900.0, 1700.0],
        [480.0, -870.0, 1650.0],
        [300.0, 700.0, 60.0],
        [350.0, 750.0, 20.0],
    ];

    #[test]
    fn names_beat_extents_and_units_follow_the_spread() {
        // Wider (along Y, 1650) than 1.5 x tall would not be: only the names decide here.
        let take = take(["LFHD", "C7", "LTOE", "RHEE"], STANDING_Z);
        let take = settled(take, Stated::default(), TakeOptions::default());
        // The rise (150, -1610, 1635) is not clear, the floor rule sees X and Z on one side, and
        // the extents (200, 1650, 1680) tell nothing.
        assert_eq!(take.up, UpAxis::PlusY, "the usual axis");
        assert_eq!(take.unit, LengthUnit::Millimetre);
        assert_eq!(take.notices.len(), 2);

        let mut places = STANDING_Z;
        places[0][1] = 650.0;
        places[1][1] = 640.0;
        let take = self::take(["LFHD", "C7", "LTOE", "RHEE"], places);
        let take = settled(take, Stated::default(), TakeOptions::default());
        assert_eq!(take.up, UpAxis::PlusZ);

        // Heads towards -Z: hung upside down in Y-forward axes.
        for place in &mut places {
            place[2] = -place[2];
        }
        let take = self::take(["Ann:LFHD", "Ann:C7", "Ann:LTOE", "Ann:RHEE"], places);
        let take = settled(take, Stated::default(), TakeOptions::default());
        assert_eq!(take.up, UpAxis::MinusZ);
    }

    #[test]
    fn floor_and_extent_decide_without_names() {
        let floor = [
            [-3.0, -0.3, 0.1],
            [3.0, 0.4, 0.2],
            [-2.0, 0.1, 1.0],
            [-2.1, 0.2, 1.2],
        ];
        let take = take(["a", "b", "c", "d"], floor);
        let take = settled(take, Stated::default(), TakeOptions::default());
        assert_eq!((take.up, take.unit), (UpAxis::PlusZ, LengthUnit::Metre));

        let tall = [
            [1.0, 2.0, 1.0],
            [1.1, 2.1, 1.1],
            [1.0, 3.7, 1.0],
            [1.2, 3.6, 1.2],
        ];
        let take = self::take(["a", "b", "c", "d"], tall);
        let take = settled(take, Stated::default(), TakeOptions::default());
        assert_eq!(take.up, UpAxis::PlusY);
    }

    #[test]
    fn the_file_beats_the_data_and_the_caller_beats_the_file() {
        let stated = Stated {
            unit: Some("cm".into()),
            up: Some(UpAxis::PlusX),
            ..Stated::default()
        };
        let mut places = STANDING_Z;
        places[0][1] = 650.0;
        places[1][1] = 640.0;
        let labels = ["LFHD", "C7", "LTOE", "RHEE"];
        let options = TakeOptions::default();
        let file = settled(take(labels, places), stated.clone(), options);
        assert_eq!(
            (file.up, file.unit),
            (UpAxis::PlusX, LengthUnit::Centimetre)
        );
        assert_eq!(file.notices.len(), 1, "names contradict the file");

        let options = TakeOptions {
            unit: Some(LengthUnit::Millimetre),
            up: Some(UpAxis::MinusY),
            rate: None,
        };
        let caller = settled(take(labels, places), stated, options);
        assert_eq!(
            (caller.up, caller.unit),
            (UpAxis::MinusY, LengthUnit::Millimetre)
        );
        assert!(caller.notices.is_empty());
    }

    #[test]
    fn nothing_to_see_is_not_an_error() {
        let none = settled(
            RawTake::empty(vec![], 100.0, 5),
            Stated::default(),
            TakeOptions::default(),
        );
        assert_eq!(
            (none.up, none.unit),
            (UpAxis::PlusY, LengthUnit::Millimetre)
        );
        let unseen = RawTake::empty(vec!["a".into()], 100.0, 3);
        let unseen = settled(unseen, Stated::default(), TakeOptions::default());
        assert_eq!(unseen.notices.len(), 2);
    }
}
