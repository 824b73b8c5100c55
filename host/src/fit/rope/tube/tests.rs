use super::super::{Origin, RopeSample};
use super::*;

fn arch(phase: f64) -> Vec<DVec3> {
    // Markers on a circle of radius 0.4, 0.1 m apart along it.
    let at = |i: usize| {
        let angle = 0.25 * i as f64 + phase;
        DVec3::new(0.4 * angle.cos(), 1.0 + 0.4 * angle.sin(), 0.1 * phase)
    };
    (0..9).map(at).collect()
}

fn trace() -> Trace {
    let sample = |position: DVec3| RopeSample {
        position,
        origin: Origin::Measured(0),
        gap: 0,
        confidence: 1.0,
    };
    let frame = |f: usize| arch(0.02 * f as f64).into_iter().map(sample).collect();
    Trace {
        rate: 50.0,
        start: 0,
        frames: (0..5).map(frame).collect(),
    }
}

#[test]
fn the_weights_are_a_partition_of_one_and_never_negative() {
    for segment in 0..4 {
        for step in 0..=10 {
            let list = weights(5, segment, 0.1 * f64::from(step));
            assert!(list.len() <= 4 && list.iter().all(|(j, w)| *j < 5 && *w > 0.0));
            let sum: f64 = list.iter().map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
    }
    assert_eq!(weights(5, 0, 0.0), [(0, 1.0)]);
}

#[test]
fn the_tube_passes_through_the_markers_and_stays_round() {
    let trace = trace();
    let options = TubeOptions::default();
    let rope = tube(&trace, "rope", &options).unwrap();
    let clip = &rope.clips[0];
    for (frame, samples) in trace.frames.iter().enumerate() {
        let pose = crate::reference::pose::sample(&rope.skeleton, clip, frame as f64 / 50.0);
        let model = rope.skeleton.model(&pose);
        let place = |vertex: usize| -> DVec3 {
            let list = rope.skin.influences[vertex].iter();
            list.map(|&(bind, weight)| {
                let bind = &rope.skin.binds[bind as usize];
                let matrix = model[bind.joint] * bind.inverse_bind;
                matrix.transform_point3(rope.mesh.positions[vertex]) * weight
            })
            .sum()
        };
        for (marker, sample) in samples.iter().enumerate() {
            let ring = marker * options.rings * options.sides;
            let around: Vec<DVec3> = (0..options.sides).map(|k| place(ring + k)).collect();
            let centre = around.iter().sum::<DVec3>() / options.sides as f64;
            let off = centre.distance(sample.position);
            assert!(off < 1e-9, "frame {frame}, marker {marker}: {off}");
            for point in around {
                let radius = point.distance(centre);
                assert!(
                    (radius - options.radius).abs() < 0.05 * options.radius,
                    "{radius}"
                );
            }
        }
        // Half-way between two markers the tube lies on the circle, to a tenth of a millimetre.
        let ring = (4 * options.rings + options.rings / 2) * options.sides;
        let centre =
            (0..options.sides).map(|k| place(ring + k)).sum::<DVec3>() / options.sides as f64;
        let radius = (centre - DVec3::new(0.0, 1.0, centre.z)).length();
        assert!((radius - 0.4).abs() < 2e-4, "{radius}");
    }
}

#[test]
fn a_body_takes_the_rope_along() {
    let rope = tube(&trace(), "rope", &TubeOptions::default()).unwrap();
    let both = beside(&rope, 0, &rope);
    assert_eq!(both.mesh.positions.len(), 2 * rope.mesh.positions.len());
    assert_eq!(both.skeleton.joints.len(), 20);
    assert_eq!(both.skeleton.joints[10].name, "rope_");
    assert_eq!(both.skeleton.joints[11].parent, Some(10));
    assert_eq!(both.clips.len(), 1);
    assert_eq!(both.clips[0].tracks.len(), 2 * rope.clips[0].tracks.len());
    let (last, first) = (both.skin.influences.last(), rope.skin.influences.last());
    assert_eq!(last.unwrap()[0].0, first.unwrap()[0].0 + 9);
}
