use glam::{DMat3, DVec3};

use super::*;

/// A bending sheet of 5 x 5 markers, broken into fragments at different times, columns shared.
fn broken_sheet() -> (Vec<Vec<DVec3>>, Take) {
    const FRAMES: usize = 240;
    let truth: Vec<Vec<DVec3>> = (0..25)
        .map(|marker| {
            let (u, v) = (0.05 * f64::from(marker % 5), 0.05 * f64::from(marker / 5));
            (0..FRAMES)
                .map(|frame| {
                    let time = frame as f64 / 120.0;
                    let bent = DVec3::new(u, v, 0.1 * (3.0 * u + 2.0 * time).sin() * u);
                    DMat3::from_rotation_y(1.5 * time) * bent + DVec3::X * time
                })
                .collect()
        })
        .collect();
    // Each marker but those of the first row is out of sight for 30 frames at its own time.
    let mut columns: Vec<Vec<DVec3>> = Vec::new();
    for (marker, path) in truth.iter().enumerate() {
        let gap = 40 + 6 * marker..70 + 6 * marker;
        let (mut before, mut after) = (path.clone(), path.clone());
        before[gap.start..].fill(DVec3::NAN);
        after[..gap.end].fill(DVec3::NAN);
        columns.push(before);
        columns.push(after);
    }
    // A ghost between two markers.
    let mut ghost = vec![DVec3::NAN; FRAMES];
    for frame in 100..110 {
        ghost[frame] = truth[12][frame] + DVec3::new(0.02, 0.03, 0.06);
    }
    columns.push(ghost);
    let labels = (0..columns.len()).map(|at| format!("*{at}")).collect();
    let take = Take::new(labels, 120.0, FRAMES, columns.concat()).unwrap();
    (truth, take)
}

#[test]
fn fragments_find_their_markers() {
    let (truth, take) = broken_sheet();
    let merged = merge(&take, &MergeOptions::default(), &|_| ()).unwrap();
    assert_eq!(merged.reference_frame, Some(0));
    assert_eq!(merged.take.marker_count(), 25, "{:?}", merged.take.labels());
    assert_eq!(merged.ghosts().len(), 1);
    for (marker, path) in truth.iter().enumerate() {
        let found = merged.take.trajectory(marker);
        assert_eq!(merged.take.missing_count(marker), 30);
        for (position, truth) in found.iter().zip(path) {
            assert!(position.is_nan() || position == truth, "marker {marker}");
        }
    }
    assert_eq!(merged.decisions.len(), 25);
    assert_eq!(merged.doubtful().count(), 0);
}

#[test]
fn named_takes_stay_as_they_are() {
    let path = vec![DVec3::X, DVec3::NAN, DVec3::Y];
    let take = Take::new(vec!["LASI".into()], 100.0, 3, path).unwrap();
    let merged = merge(&take, &MergeOptions::default(), &|_| ()).unwrap();
    assert_eq!(merged.take.labels(), take.labels());
    assert!(merged.fragments.is_empty() && merged.decisions.is_empty());
    let empty = Take::new(Vec::new(), 100.0, 0, Vec::new()).unwrap();
    assert_eq!(
        merge(&empty, &MergeOptions::default(), &|_| ())
            .unwrap()
            .take
            .marker_count(),
        0
    );
}
