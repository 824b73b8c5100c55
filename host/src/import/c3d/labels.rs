//! Names of the points, what they are, and the events.

use super::parameters::Parameters;
use crate::import::take::{PointKind, RawEvent};
use crate::import::{Notice, Place};

/// `points` labels and kinds; points without a label are numbered.
pub(super) fn find(
    parameters: &Parameters<'_>,
    points: usize,
    notices: &mut Vec<Notice>,
) -> (Vec<String>, Vec<PointKind>) {
    let mut labels = parameters.texts("POINT", "LABELS");
    let place = parameters
        .find("POINT", "LABELS")
        .map_or(Place::File, |found| Place::Byte(found.offset as u64));
    if labels.len() < points {
        let text = format!(
            "{} of {points} points have a label: the others are numbered",
            labels.len()
        );
        notices.push(Notice::new(place, text));
    }
    labels.resize(points, String::new());

    let groups = kind_groups(parameters);
    let kind = |label: &String| {
        groups
            .iter()
            .find(|(_, members)| members.binary_search(label).is_ok())
            .map_or_else(|| PointKind::of_label(label), |(kind, _)| *kind)
    };
    let kinds = labels.iter().map(kind).collect();
    for (number, label) in labels.iter_mut().enumerate() {
        if label.is_empty() {
            *label = format!("*{}", number + 1);
        }
    }
    (labels, kinds)
}

/// Labels of points that are no markers: the parameters that POINT:TYPE_GROUPS names in pairs of
/// (parameter, type), or else those that Vicon always calls the same.
fn kind_groups(parameters: &Parameters<'_>) -> Vec<(PointKind, Vec<String>)> {
    let mut pairs: Vec<(String, String)> = ["ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS"]
        .map(|name| (name.to_owned(), name.to_owned()))
        .to_vec();
    let stated = parameters.texts("POINT", "TYPE_GROUPS");
    pairs.extend(
        stated
            .chunks_exact(2)
            .map(|pair| (pair[0].clone(), pair[1].clone())),
    );
    pairs
        .into_iter()
        .map(|(name, kind)| {
            let mut members = parameters.texts("POINT", &name);
            members.retain(|label| !label.is_empty());
            members.sort();
            (kind_of(&kind), members)
        })
        .collect()
}

fn kind_of(name: &str) -> PointKind {
    let name = name.to_ascii_uppercase();
    match name.trim_end_matches('S') {
        "ANGLE" => PointKind::Angle,
        "FORCE" => PointKind::Force,
        "MOMENT" => PointKind::Moment,
        "POWER" => PointKind::Power,
        name if name.contains("MARKER") => PointKind::Model,
        _ => PointKind::Scalar,
    }
}

/// The EVENT group: labels, contexts, and times as pairs of minutes and seconds.
pub(super) fn events(parameters: &Parameters<'_>) -> Vec<RawEvent> {
    let mut contexts = parameters.texts("EVENT", "CONTEXTS").into_iter();
    let Some(times) = parameters.find("EVENT", "TIMES") else {
        return Vec::new();
    };
    let used = parameters
        .find("EVENT", "USED")
        .and_then(|used| used.count(0));
    let used = used
        .and_then(|used| usize::try_from(used).ok())
        .unwrap_or(usize::MAX);
    parameters
        .texts("EVENT", "LABELS")
        .into_iter()
        .take(used)
        .enumerate()
        .filter_map(|(number, label)| {
            let context = contexts.next().unwrap_or_default();
            let seconds = times.number(2 * number)? * 60.0 + times.number(2 * number + 1)?;
            seconds.is_finite().then_some(RawEvent {
                label,
                context,
                seconds,
            })
        })
        .collect()
}
