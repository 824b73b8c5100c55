//! Assets of a few dozen vertices, one for each way to move them.

use glam::{DMat3, DQuat, DVec3};
use sinew_host::bake::write::MarkerSkinData;
use sinew_host::bake::{AssetBytes, BakeOptions, bake, bake_rig, bake_with};
use sinew_host::fit::laplace::MarkerTarget;
use sinew_host::fit::laplace::repair::{RepairOptions, repair};
use sinew_host::fit::laplace::rig::{RigOptions, Solve, rig};
use sinew_host::fit::parts::{Glued, Mode, Options, Segments, learn};
use sinew_host::model::Avatar;
use sinew_host::take::Take;

use crate::body::checked_arm;
use crate::laplacian::{driven_by, jointed_tube};
use crate::marker_film;

const SIDES: u32 = 8;

/// The arm in 16-bit numbers with tangents, and centres of rotation for every mode.
///
/// # Panics
/// Never.
#[must_use]
pub fn arm() -> AssetBytes {
    let mut body = checked_arm();
    let normals = body.mesh.normals.iter();
    let tangents = normals.map(|normal| {
        let [x, y, z] = normal.any_orthonormal_vector().to_array();
        [x, y, z, 1.0]
    });
    body.mesh.tangents = Some(tangents.collect());
    let options = BakeOptions {
        quantised: true,
        centres: true,
        ..BakeOptions::default()
    };
    bake(&body, &options).expect("bakes").bytes
}

/// How the upper half of the tube is bent at a time.
fn bend(time: f64) -> DMat3 {
    DMat3::from_rotation_x(1.1 * (1.3 * time).sin())
        * DMat3::from_rotation_y(0.6 * (0.9 * time).cos())
}

/// The bent tube at a time, `[vertices]`.
fn bent_surface(body: &Avatar, time: f64) -> Vec<DVec3> {
    let (elbow, turn) = (DVec3::Y * 0.3, bend(time));
    let vertices = body.mesh.positions.iter().zip(&body.skin.influences);
    vertices
        .map(|(&p, row)| {
            let moved = |&(bind, weight): &(u32, f64)| {
                let upper = turn * (p - elbow) + elbow;
                weight * if bind == 0 { p } else { upper }
            };
            row.iter().map(moved).sum()
        })
        .collect()
}

/// A tube of 13 rings that 24 markers drive.
///
/// # Panics
/// Never.
#[must_use]
pub fn marker_skin(mode: Mode) -> AssetBytes {
    let body = jointed_tube(13, SIDES, 0.2, 0.2);
    let markers = (0..12)
        .step_by(2)
        .flat_map(|ring| (0..4).map(move |side| ring * SIDES + (2 * side + ring / 2 % 2) % SIDES));
    let glued: Vec<Glued> = markers
        .map(|vertex| Glued {
            vertices: [vertex, vertex + SIDES, vertex],
            weights: [0.7, 0.3, 0.0],
        })
        .collect();
    let on = |surface: &[DVec3]| -> Vec<DVec3> {
        glued.iter().map(|marker| marker.on(surface)).collect()
    };
    let frames: Vec<Vec<DVec3>> = (0..40)
        .map(|frame| on(&bent_surface(&body, 0.17 * f64::from(frame))))
        .collect();
    let rest = on(&body.mesh.positions);
    let segments = Segments::of_rig(&body, &glued);
    let options = Options::default();
    let learnt = learn(&body.mesh, &segments, (&glued, &rest), &frames, &options);
    let learnt = learnt.expect("learns");
    let skin = MarkerSkinData {
        names: (0..glued.len()).map(|at| format!("M{at}")).collect(),
        mode: learnt.mode(mode).clone(),
        rig: learnt.rig,
    };
    let baked = bake_with(&body, &BakeOptions::default(), Some(&skin), None);
    baked.expect("bakes").bytes
}

/// A tube of 9 rings as a scan that follows 8 markers.
///
/// # Panics
/// Never.
#[must_use]
pub fn scan(solve: Solve) -> AssetBytes {
    let body = jointed_tube(9, SIDES, 0.2, 0.2);
    let mesh = &body.mesh;
    let repaired = repair(&mesh.positions, &mesh.triangles, &RepairOptions::default());
    let repaired = repaired.expect("repairs");
    let vertices = [0, 2, 4, 6].map(|side| [side, 8 * SIDES + side]).concat();
    let pose = |time: f64| {
        let surface = bent_surface(&body, time);
        let target = |&vertex: &u32| MarkerTarget {
            position: surface[vertex as usize],
            rotation: match vertex {
                0..SIDES => DQuat::IDENTITY,
                _ => DQuat::from_mat3(&bend(time)),
            },
        };
        vertices.iter().map(target).collect()
    };
    let driven = driven_by(
        (0..40).map(|frame| pose(0.1 * f64::from(frame))).collect(),
        30.0,
    );
    let names: Vec<String> = (0..vertices.len()).map(|at| format!("M{at}")).collect();
    let options = RigOptions {
        solve,
        ..RigOptions::default()
    };
    let rig = rig(mesh, &repaired, &vertices, &names, &driven, &options).expect("rigs");
    bake_rig(&rig, &BakeOptions::default())
        .expect("bakes")
        .bytes
}

/// Two seconds of nine markers on two bones, and the set learned from them.
///
/// # Panics
/// Never.
#[must_use]
pub fn film() -> AssetBytes {
    const FRAMES: usize = 240;
    let rest: [DVec3; 9] = std::array::from_fn(|at| {
        let at = at as f64;
        DVec3::new(0.07 * (2.1 * at).sin(), 0.066 * at, 0.05 * (1.3 * at).cos())
    });
    let elbow = DVec3::Y * 0.3;
    let paths = rest.iter().enumerate().flat_map(|(at, &place)| {
        (0..FRAMES).map(move |frame| {
            let time = frame as f64 / 40.0;
            let moved = bend(time) * (place - elbow) + elbow;
            let here = if at < 4 { place } else { moved };
            DQuat::from_rotation_y(0.5 * time) * here + DVec3::X * (0.2 * time)
        })
    });
    let labels = (0..rest.len()).map(|at| format!("M{at}")).collect();
    let film = Take::new(labels, 120.0, FRAMES, paths.collect()).expect("a sound take");
    marker_film::asset(&film, std::slice::from_ref(&film))
}
