//! Bodies without a rig, and bodies cut into parts.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use sinew_host::export::obj::write_obj;
use sinew_host::fit::cut::{JoinOptions, join};
use sinew_host::fit::humanoid::{PARTS, SIDES};
use sinew_host::fit::rig::{RigError, fit_skeleton};
use sinew_host::fit::weights::{Method, WeightOptions, WeightsError, weigh};
use sinew_host::fit::{Humanoid, Which};
use sinew_host::import::read_obj;
use sinew_host::model::{Avatar, Mesh, Skeleton, Skin};
use sinew_host::reference::pose::{model, sample};
use sinew_host::simplify::simplify;
use sinew_tests::bare::{bundled, carried, difference, in_place, poses, surface};
use sinew_tests::cut::{cut, range_of_motion, with_arms};
use sinew_tests::human;

/// Every so many frames of a clip are looked at.
const STEP: usize = 20;

fn weights(mesh: &Mesh, skeleton: &Skeleton, method: Method) -> Skin {
    let options = WeightOptions {
        method,
        ..WeightOptions::default()
    };
    let weighed = weigh(mesh, skeleton, &options).expect("weighs");
    for row in &weighed.skin.influences {
        assert!((1..=4).contains(&row.len()));
        assert!(row.iter().all(|&(_, weight)| weight > 0.0));
        assert!((row.iter().map(|&(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-9);
    }
    weighed.skin
}

#[test]
fn weights_move_the_body_as_the_artists_do() {
    let body = human::body();
    for (method, limit) in [(Method::Smooth, 0.004), (Method::Simple, 0.006)] {
        let skin = weights(&body.mesh, &body.skeleton, method);
        for name in ["walk.bvh", "kneel.bvh"] {
            let clip = carried(&bundled(name), &body.skeleton);
            let poses = poses(&body.skeleton, &clip, STEP);
            let found = difference(&body.mesh, (&body.skin, &poses), (&skin, &poses));
            println!("{method:?}, {name}: {found}");
            assert!(found.mean < limit, "{method:?}, {name}: {found}");
        }
    }
}

/// Mean and greatest distance between limb joints of the same role, metres.
fn limbs_off(truth: &Skeleton, found: &Skeleton) -> (f64, f64) {
    let places = |skeleton: &Skeleton| skeleton.model(&skeleton.rest());
    let (own, other) = (places(truth), places(found));
    let [truth, found] = [truth, found].map(|s| Humanoid::new(s, Which::Target).expect("human"));
    let mut off = Vec::new();
    for (side, part) in SIDES
        .into_iter()
        .flat_map(|side| PARTS.map(|part| (side, part)))
    {
        if let (Some(a), Some(b)) = (truth.limb(side, part), found.limb(side, part)) {
            off.push(own[a].translation.distance(other[b].translation));
        }
    }
    let worst = off.iter().copied().fold(0.0, f64::max);
    (off.iter().sum::<f64>() / off.len() as f64, worst)
}

#[test]
fn a_skeleton_stands_where_the_artist_put_it() {
    let body = human::body();
    let motions = ["walk.bvh", "kneel.bvh"].map(bundled);
    let own = ("its own rig", body.skeleton.clone(), Vec::new());
    let captured = motions.iter().map(|motion| {
        let (skeleton, ends) = (motion.skeleton.clone(), motion.end_sites.clone());
        (motion.clip.name.as_str(), skeleton, ends)
    });
    for (name, skeleton, ends) in std::iter::once(own).chain(captured) {
        let fitted = fit_skeleton(&body.mesh, &skeleton, &ends).expect("fits");
        let (mean, worst) = limbs_off(&body.skeleton, &fitted.skeleton);
        println!(
            "{name}: limb joints {:.1} mm off, {:.1} at most",
            1e3 * mean,
            1e3 * worst
        );
        assert!(mean < 0.02 && worst < 0.05, "{name}: {mean} {worst}");
        if name != "its own rig" {
            continue;
        }
        // Other hierarchies bend the trunk elsewhere.
        let skin = weights(&body.mesh, &fitted.skeleton, Method::Smooth);
        for motion in &motions {
            let [own, other] = [&body.skeleton, &fitted.skeleton]
                .map(|skeleton| poses(skeleton, &carried(motion, skeleton), STEP));
            let other = in_place(&own, &other, 0);
            let found = difference(&body.mesh, (&body.skin, &own), (&skin, &other));
            println!("  {}, weights and joints fitted: {found}", motion.clip.name);
        }
    }
}

#[test]
fn other_stances_and_meshes_are_met() {
    let body = human::body();
    let own = |body: &Avatar| {
        let fitted = fit_skeleton(&body.mesh, &body.skeleton, &[]).expect("fits");
        limbs_off(&body.skeleton, &fitted.skeleton)
    };
    let mut cases: Vec<(&str, Avatar)> = vec![
        ("T-pose", with_arms(&body, DVec3::X)),
        ("steep A-pose", with_arms(&body, DVec3::new(0.5, -1.0, 0.0))),
        ("turned away", moved(&body, DAffine3::from_rotation_y(2.5))),
        (
            "half as large",
            moved(&body, DAffine3::from_scale(DVec3::splat(0.5))),
        ),
    ];
    let coarse = simplify(&body, 1500);
    let mut few = body.clone();
    (few.mesh, few.skin) = (coarse.mesh, coarse.skin);
    cases.push(("1,500 vertices", few));
    let mut open = body.clone();
    open.mesh.triangles.retain(|corners| {
        let crown = corners
            .iter()
            .all(|&v| open.mesh.positions[v as usize].y > 1.70);
        let sole = corners
            .iter()
            .all(|&v| open.mesh.positions[v as usize].y < 0.004);
        !(crown || sole)
    });
    open.mesh.parts.clear();
    cases.push(("open at crown and soles", open));
    for (name, body) in cases {
        let (mean, worst) = own(&body);
        println!(
            "{name}: limb joints {:.1} mm off, {:.1} at most",
            1e3 * mean,
            1e3 * worst
        );
        assert!(mean < 0.022 && worst < 0.06, "{name}: {mean} {worst}");
    }
}

/// The body elsewhere, its skeleton too.
fn moved(body: &Avatar, by: DAffine3) -> Avatar {
    let mut out = body.clone();
    for at in &mut out.mesh.positions {
        *at = by.transform_point3(*at);
    }
    let places = body.skeleton.model(&body.skeleton.rest());
    let places: Vec<DVec3> = places
        .iter()
        .map(|p| by.transform_point3(p.translation))
        .collect();
    out.skeleton = sinew_host::fit::rig::parallel(&body.skeleton, &places);
    out
}

#[test]
fn an_arm_beside_the_hip_does_not_pull_it() {
    let body = with_arms(&human::body(), DVec3::new(0.16, -1.0, 0.0));
    let wrong = |skin: &Skin| {
        let side = |joint: usize| {
            let name = body.skeleton.joints[joint].name.as_str();
            let arm = ["Hand", "Finger", "Thumb", "ForeArm"]
                .iter()
                .any(|part| name.contains(part));
            let leg = ["Leg", "Foot", "Toe", "Hip", "LowerBack"]
                .iter()
                .any(|part| name.contains(part));
            (arm, leg)
        };
        let pulled = body
            .skin
            .influences
            .iter()
            .zip(&skin.influences)
            .map(|(own, other)| {
                let heaviest = side(body.skin.binds[own[0].0 as usize].joint);
                let of = |&&(bind, _): &&(u32, f64)| {
                    let (arm, leg) = side(bind as usize);
                    heaviest.0 && leg || heaviest.1 && arm
                };
                other
                    .iter()
                    .filter(of)
                    .map(|&(_, weight)| weight)
                    .sum::<f64>()
            });
        pulled.fold(0.0, f64::max)
    };
    let smooth = wrong(&weights(&body.mesh, &body.skeleton, Method::Smooth));
    let simple = wrong(&weights(&body.mesh, &body.skeleton, Method::Simple));
    println!("greatest weight across the gap: smooth {smooth:.3}, simple {simple:.3}");
    assert!(smooth < 0.01, "{smooth}");
    assert!(simple > 0.1, "the test has no case: {simple}");
}

#[test]
fn loose_parts_and_bad_triangles_are_weighed_too() {
    let mut body = human::body();
    let mesh = &mut body.mesh;
    // A patch of cloth before the chest, a vertex of no triangle, a triangle twice, one without area.
    let first = mesh.positions.len() as u32;
    for (x, y) in [
        (-0.05, 1.2),
        (0.05, 1.2),
        (0.05, 1.3),
        (-0.05, 1.3),
        (0.0, 1.25),
    ] {
        mesh.positions.push(DVec3::new(x, y, 0.2));
        mesh.normals.push(DVec3::Z);
    }
    mesh.triangles.extend([
        [first, first + 1, first + 2],
        [first, first + 2, first + 3],
        mesh.triangles[0],
        [7, 7, 8],
    ]);
    mesh.parts.clear();
    let skin = weights(mesh, &body.skeleton, Method::Smooth);
    let spine = |bind: u32| body.skeleton.joints[bind as usize].name.contains("Spine");
    for row in &skin.influences[first as usize..] {
        assert!(spine(row[0].0), "{row:?}");
    }
}

#[test]
fn what_cannot_be_rigged_is_refused() {
    let body = human::body();
    let skeleton = &body.skeleton;
    let refused = |mesh: &Mesh| weigh(mesh, skeleton, &WeightOptions::default()).unwrap_err();
    let mut soup = body.mesh.clone();
    soup.parts.clear();
    soup.positions = soup
        .triangles
        .as_flattened()
        .iter()
        .map(|&v| body.mesh.positions[v as usize] + 1e-4 * f64::from(v % 7) * DVec3::ONE)
        .collect();
    let corners = soup.positions.len() as u32;
    soup.positions
        .iter_mut()
        .zip(0..)
        .for_each(|(at, k)| *at += 1e-3 * DVec3::splat(f64::from(k % 3)));
    soup.normals = vec![DVec3::Y; soup.positions.len()];
    soup.triangles = (0..corners / 3)
        .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
        .collect();
    let mut flat = body.mesh.clone();
    flat.positions.iter_mut().for_each(|at| at.z = 0.0);
    assert_eq!(refused(&flat), WeightsError::Hollow);
    let mut empty = body.mesh.clone();
    empty.triangles.clear();
    assert_eq!(refused(&empty), WeightsError::NoSurface);
    let away = moved(&body, DAffine3::from_translation(DVec3::X * 9.0));
    assert_eq!(refused(&away.mesh), WeightsError::Beside);
    let options = WeightOptions {
        influences: 9,
        ..WeightOptions::default()
    };
    let error = weigh(&body.mesh, skeleton, &options).unwrap_err();
    assert_eq!(error, WeightsError::Influences { found: 9 });
    let none = Skeleton::default();
    let error = weigh(&body.mesh, &none, &WeightOptions::default()).unwrap_err();
    assert_eq!(error, WeightsError::NoJoints);
    // Simple weights need no inside.
    let simple = WeightOptions {
        method: Method::Simple,
        ..WeightOptions::default()
    };
    assert!(weigh(&soup, skeleton, &simple).is_ok());

    let fit = |mesh: &Mesh| fit_skeleton(mesh, skeleton, &[]).unwrap_err();
    assert_eq!(fit(&flat), RigError::Hollow);
    assert_eq!(fit(&empty), RigError::NoSurface);
    let lying = moved(&body, DAffine3::from_rotation_x(-1.57));
    assert!(matches!(fit(&lying.mesh), RigError::NoLimb { .. }));
    let mut legless = body.mesh.clone();
    legless
        .triangles
        .retain(|t| t.iter().all(|&v| body.mesh.positions[v as usize].y > 0.7));
    legless.parts.clear();
    assert!(matches!(fit(&legless), RigError::NoLimb { .. }));
}

#[test]
fn a_body_in_fifteen_parts_is_joined() {
    let whole = with_arms(&human::body(), DVec3::X);
    // Through the file, as users have it.
    let text = write_obj(&cut(&whole));
    let (raw, _) = read_obj(text.as_bytes(), "cut.obj", 1.0).expect("reads");
    let (parts, _) = Mesh::new(raw, "cut.obj").expect("sound");
    assert_eq!(parts.parts.len(), 15);
    let (joined, report) = join(&parts, &JoinOptions::default()).expect("joins");
    let widest = report.gaps[0].width;
    println!(
        "{} gaps, {:.1} mm at most; {} triangles, {} corners filled",
        report.gaps.len(),
        1e3 * widest,
        report.added,
        report.corners
    );
    assert!(
        report.open.is_empty() && report.attached.is_empty(),
        "{report:?}"
    );
    assert_eq!(joined.skeleton.joints.len(), 15);
    Humanoid::new(&joined.skeleton, Which::Target).expect("names say what parts are");

    // Closed: every edge has two triangles that run it in both directions.
    let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for &[a, b, c] in &joined.mesh.triangles {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            *edges.entry([a, b]).or_default() += 1;
        }
    }
    for (&[a, b], &count) in &edges {
        assert_eq!((count, edges.get(&[b, a])), (1, Some(&1)), "edge {a} {b}");
    }
    // The bridges lie where the body was.
    let tree = sinew_host::spatial::Tree::new(&whole.mesh.triangles, &whole.mesh.positions);
    let off = |&at: &DVec3| tree.closest(at, |_| true).expect("near").distance;
    let worst = joined.mesh.positions.iter().map(off).fold(0.0, f64::max);
    println!("farthest from the uncut body: {:.1} mm", 1e3 * worst);
    assert!(worst < 0.008, "{worst}");

    // No crack opens, as any program sees it that reads the file: places that are one at rest stay one.
    let clip = range_of_motion(&joined.skeleton, 40.0);
    let bytes = sinew_host::export::write_glb_of(&joined, &[]).expect("writes");
    let raw = sinew_host::import::gltf::read_gltf(&bytes, "joined.glb", std::path::Path::new(""));
    let (read, _) = Avatar::new(raw.expect("reads"), "joined.glb").expect("sound");
    let first = sinew_host::spatial::weld(&read.mesh.positions);
    let mut crack: f64 = 0.0;
    let mut stretch: f64 = 0.0;
    for step in 0..(clip.duration / 0.5) as u32 {
        let pose = model(
            &read.skeleton,
            &sample(&read.skeleton, &clip, 0.5 * f64::from(step)),
        );
        let posed = surface(&read.mesh, &read.skin, &pose);
        for (vertex, &first) in first.iter().enumerate() {
            crack = crack.max(posed[vertex].distance(posed[first as usize]));
        }
        for &[a, b, _] in &read.mesh.triangles {
            stretch = stretch.max(posed[a as usize].distance(posed[b as usize]));
        }
    }
    println!(
        "widest crack {:.3} mm; longest edge {:.0} mm",
        1e3 * crack,
        1e3 * stretch
    );
    assert!(crack < 1e-3);
    assert!(stretch < 0.12, "{stretch}");
}
