//! Registration and segmentation of bodies whose shape, pose and markers are known.
//!
//! The table over all bodies: `cargo run --release -p sinew-tests --example registration`.

use std::sync::OnceLock;

use glam::{DQuat, DVec3};
use sinew_host::fit::register::fold::folded;
use sinew_host::fit::register::marker_surface::marker_surface;
use sinew_host::fit::register::rig::rerig;
use sinew_host::fit::register::{
    Landmark, RegisterError, RegisterOptions, Registration, Template, register,
};
use sinew_host::fit::segment::rig::carried_over;
use sinew_host::fit::segment::{Agreement, SegmentOptions, parts_of_rig, segment};
use sinew_host::model::{Avatar, Mesh};
use sinew_host::studio::MarkerSet;
use sinew_tests::Random;
use sinew_tests::dense::{human, markers, measured, other_proportions, pose, reshape, skin};

/// A broad body with level arms, measured with half a millimetre of noise, and what became of the
/// bundled body.
struct Case {
    body: Avatar,
    template: Avatar,
    truth: Vec<DVec3>,
    set: MarkerSet,
    points: Vec<Option<DVec3>>,
    found: Registration,
}

fn case() -> &'static Case {
    static CASE: OnceLock<Case> = OnceLock::new();
    CASE.get_or_init(|| {
        let template = human();
        let body = reshape(&template, &other_proportions(&template, 1.0));
        let truth = skin(&body, &pose(&body, 0.0, 10.0), 2.0);
        let set = markers(&body, 350, 3);
        let points = measured(&set, &truth, 0.5e-3, &mut Random(7));
        let mut points: Vec<Option<DVec3>> = points.into_iter().map(Some).collect();
        points[17] = None;
        // A ghost beside the body.
        points.push(Some(DVec3::new(1.4, 1.6, 0.9)));
        let options = RegisterOptions::default();
        let found = register(Template::Rigged(&template), &points, &options, &|_| ());
        Case {
            body,
            truth,
            set,
            points,
            found: found.expect("registers"),
            template,
        }
    })
}

#[test]
fn another_body_in_another_pose_is_met_without_a_fold() {
    let case = case();
    let report = &case.found.report;
    assert!(report.residual_max < 0.5e-3, "{report:?}");
    assert_eq!((report.seen, &report.strays[..]), (350, &[350][..]));
    assert_eq!((case.found.glue[17], case.found.glue[350]), (None, None));
    let triangles = &case.template.mesh.triangles;
    let rest = &case.template.mesh.positions;
    assert!(folded(rest, &case.found.positions, triangles).is_empty());
    // Near markers the surface is the true one, and corresponds to it.
    let sites: Vec<DVec3> = case.points[..350].iter().flatten().copied().collect();
    let zone = (0..case.truth.len()).filter(|&at| {
        sites
            .iter()
            .any(|site| site.distance(case.truth[at]) < 0.05)
    });
    let zone: Vec<usize> = zone.collect();
    let tree = sinew_host::spatial::Tree::new(triangles, &case.truth);
    let off = |&at: &usize| {
        tree.closest(case.found.positions[at], |_| true)
            .unwrap()
            .distance
    };
    let mean = zone.iter().map(off).sum::<f64>() / zone.len() as f64;
    assert!(mean < 2.5e-3, "{mean}");
    let along = |&at: &usize| case.found.positions[at].distance(case.truth[at]);
    let mean = zone.iter().map(along).sum::<f64>() / zone.len() as f64;
    assert!(mean < 20e-3, "{mean}");
}

#[test]
fn hands_and_face_keep_their_shape() {
    let case = case();
    let sites: Vec<DVec3> = case.points[..350].iter().flatten().copied().collect();
    let (rest, now) = (&case.template.mesh.positions, &case.found.positions);
    let joints = &case.template.skeleton.joints;
    for name in ["LeftHandFinger1", "RightHandFinger1", "Head"] {
        let joint = joints.iter().position(|joint| joint.name == name).unwrap();
        let of = |at: &usize| {
            let list = &case.template.skin.influences[*at];
            let on = list
                .iter()
                .find(|on| case.template.skin.binds[on.0 as usize].joint == joint);
            let far = sites.iter().all(|site| site.distance(now[*at]) > 0.09);
            on.is_some_and(|on| on.1 > 0.9) && far
        };
        let part: Vec<usize> = (0..rest.len()).filter(of).collect();
        if part.len() < 10 {
            continue;
        }
        // Distances within the part grow all alike.
        let pairs = part.iter().zip(part.iter().cycle().skip(part.len() / 2));
        let ratios: Vec<f64> = pairs
            .map(|(&a, &b)| now[a].distance(now[b]) / rest[a].distance(rest[b]))
            .collect();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let spread = ratios
            .iter()
            .map(|r| (r / mean - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(
            spread < 0.08 && (0.75..1.3).contains(&mean),
            "{name}: {spread} {mean}"
        );
    }
}

#[test]
fn the_rig_goes_along_and_still_moves_the_skin() {
    let case = case();
    let fitted = rerig(&case.template, &case.found).unwrap();
    // At rest, the skin is the registered mesh.
    let rest = fitted.skeleton.rest();
    let model = fitted.skeleton.model(&rest);
    for bind in &fitted.skin.binds {
        let unmoved = model[bind.joint] * bind.inverse_bind;
        assert!(unmoved.translation.length() < 1e-9);
    }
    // Joints are near those of the true body in its pose.
    let local = pose(&case.body, 0.0, 10.0);
    let truth = case.body.skeleton.model(&local);
    let place = |at: DVec3| DQuat::from_rotation_y(2.0) * at + DVec3::new(0.4, 0.0, -0.7);
    for name in ["LeftForeArm", "RightLeg", "LeftUpLeg", "RightHand"] {
        let joint = fitted.skeleton.find(name).unwrap();
        let away = model[joint]
            .translation
            .distance(place(truth[joint].translation));
        assert!(away < 0.04, "{name}: {away}");
    }
    assert!(rerig(&sinew_tests::body::checked_arm(), &case.found).is_err());
}

#[test]
fn markers_are_glued_where_they_were_stuck_on_and_make_a_closed_surface() {
    let case = case();
    let rest = &case.template.mesh.positions;
    let off = |(own, glue): (&sinew_host::studio::Marker, &Option<_>)| {
        let glue: &sinew_host::fit::register::Glue = glue.as_ref()?;
        let corners = own.vertices.iter().zip(own.barycentric);
        let own: DVec3 = corners.map(|(&at, share)| rest[at as usize] * share).sum();
        Some(own.distance(glue.on(rest)))
    };
    let off: Vec<f64> = case
        .set
        .markers
        .iter()
        .zip(&case.found.glue)
        .filter_map(off)
        .collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    assert!(mean < 0.02, "{mean}");
    let triangles = &case.template.mesh.triangles;
    let surface = marker_surface(&case.found.positions, triangles, &case.found.glue);
    // Euler: a closed surface has twice as many triangles as corners.
    assert!((620..=700).contains(&surface.len()), "{}", surface.len());
    let used: std::collections::BTreeSet<u32> = surface.iter().flatten().copied().collect();
    assert_eq!(used.len(), 349);
}

#[test]
fn markers_in_motion_fall_into_the_parts_of_the_rig() {
    let template = human();
    let set = markers(&template, 350, 3);
    let mut random = Random(5);
    let rest = skin(&template, &template.skeleton.rest(), 0.0);
    let at_rest = measured(&set, &rest, 0.0, &mut random);
    let glue: Vec<_> = set
        .markers
        .iter()
        .map(|marker| {
            Some(sinew_host::fit::register::Glue {
                triangle: marker.triangle,
                vertices: marker.vertices,
                barycentric: marker.barycentric,
            })
        })
        .collect();
    let triangles = &template.mesh.triangles;
    let surface = marker_surface(&template.mesh.positions, triangles, &glue);
    let frames: Vec<Vec<DVec3>> = sinew_tests::dense::range_of_motion(&template, 48)
        .iter()
        .map(|local| measured(&set, &skin(&template, local, 0.3), 0.5e-3, &mut random))
        .collect();
    let of_rig = parts_of_rig(&template);
    let inside: Vec<Option<usize>> = set.markers.iter().map(|m| Some(m.triangle)).collect();
    let truth = carried_over(&of_rig, &inside, &at_rest, &surface);
    let options = SegmentOptions {
        parts: Some(of_rig.part_count()),
        ..SegmentOptions::default()
    };
    let found = segment(&at_rest, &surface, &frames, &options, &|_| ()).unwrap();
    let areas = vec![1.0; surface.len()];
    let agreement = Agreement::new(&found.triangle_parts, &truth.triangle_parts, &areas);
    assert_eq!(found.part_count(), of_rig.part_count());
    assert!(
        agreement.matched > 0.8 && agreement.rand > 0.7,
        "{agreement:?}"
    );
    let by_itself = segment(
        &at_rest,
        &surface,
        &frames,
        &SegmentOptions::default(),
        &|_| (),
    )
    .unwrap();
    assert!(
        (11..=22).contains(&by_itself.part_count()),
        "{:?}",
        by_itself.report
    );
}

#[test]
fn what_cannot_be_registered_is_refused() {
    let mesh = &case().template.mesh;
    let points = &case().points;
    let run = |points: &[Option<DVec3>], options: &RegisterOptions| {
        register(Template::Mesh(mesh), points, options, &|_| ()).unwrap_err()
    };
    let options = RegisterOptions::default();
    let few = run(&points[..5], &options);
    assert!(matches!(few, RegisterError::FewMarkers { count: 5, .. }));
    let one_place = run(&[Some(DVec3::ONE); 20], &options);
    assert!(matches!(one_place, RegisterError::NoExtent { .. }));
    let mut bad = points.clone();
    bad[3] = Some(DVec3::new(f64::NAN, 0.0, 0.0));
    assert!(matches!(
        run(&bad, &options),
        RegisterError::BadMarker { marker: 3, .. }
    ));
    for (marker, vertex, what) in [(9999, 0, "marker"), (0, 99_999, "vertex")] {
        let options = RegisterOptions {
            landmarks: vec![Landmark { marker, vertex }],
            ..RegisterOptions::default()
        };
        let error = run(points, &options);
        assert!(matches!(error, RegisterError::BadLandmark { what: found, .. } if found == what));
    }
    let options = RegisterOptions {
        stiffness: f64::NAN,
        ..RegisterOptions::default()
    };
    assert!(matches!(
        run(points, &options),
        RegisterError::BadOption { .. }
    ));
    let empty = Mesh {
        triangles: Vec::new(),
        parts: Vec::new(),
        ..mesh.clone()
    };
    let none = register(
        Template::Mesh(&empty),
        points,
        &RegisterOptions::default(),
        &|_| (),
    );
    assert_eq!(none.unwrap_err(), RegisterError::NoSurface);
    // Random points are no body.
    let mut random = Random(1);
    let mut unit = || random.unit() * 2.0 - 1.0;
    let cloud: Vec<_> = (0..300)
        .map(|_| Some(DVec3::new(unit(), unit(), unit())))
        .collect();
    let cloud = run(&cloud, &RegisterOptions::default());
    assert!(matches!(cloud, RegisterError::NoFit { .. }), "{cloud}");
}
