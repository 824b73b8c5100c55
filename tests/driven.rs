//! The bundled body, 2,000 vertices of it, as markers drive it: assets whose tables are fitted, so
//! that other arithmetic in a solver may give other bytes.

use std::sync::OnceLock;

use glam::DVec3;
use sinew_host::bake::write::MarkerSkinData;
use sinew_host::bake::{AssetBytes, BakeOptions, bake_rig, bake_with};
use sinew_host::fit::laplace::SurfaceOptions;
use sinew_host::fit::laplace::graph::Graph;
use sinew_host::fit::laplace::repair::{RepairOptions, repair};
use sinew_host::fit::laplace::rig::{RigOptions, Solve, rig};
use sinew_host::fit::parts::{Glued, Learnt, Mode, Options, Segments, learn};
use sinew_host::model::Avatar;
use sinew_host::reference;
use sinew_host::studio::MarkerLayout;

use crate::laplacian::{Scan, driven_by};
use crate::marker_film::{self, truth};
use crate::{dense, human};

const MARKERS: usize = 100;

/// The walk and a range of motion as surfaces, `[frames][vertices]`.
fn surfaces(body: &Avatar) -> Vec<Vec<DVec3>> {
    let clip = &body.clips[0];
    let walk = (0..40).map(|k| {
        reference::pose::sample(&body.skeleton, clip, clip.duration * f64::from(k) / 40.0)
    });
    walk.chain(dense::range_of_motion(body, 80))
        .map(|local| dense::skin(body, &local, 0.0))
        .collect()
}

/// Markers on vertices spread over the body, and the corner of a triangle that each sits on.
fn glued(body: &Avatar) -> Vec<Glued> {
    let mesh = &body.mesh;
    let vertices = Graph::new(&mesh.positions, &mesh.triangles).spread(&[0], MARKERS);
    vertices
        .into_iter()
        .map(|vertex| {
            let mut corners = mesh.triangles.iter().copied();
            let mut corners = corners.find(|corners| corners.contains(&vertex));
            let corners = corners.as_mut().expect("no vertex is stray");
            while corners[0] != vertex {
                corners.rotate_left(1);
            }
            Glued {
                vertices: *corners,
                weights: [1.0, 0.0, 0.0],
            }
        })
        .collect()
}

/// The body with its walk and the skin of 100 markers in a mode.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn skin(mode: Mode) -> AssetBytes {
    static LEARNT: OnceLock<Learnt> = OnceLock::new();
    let body = human::small_body();
    let glued = glued(&body);
    let learnt = LEARNT.get_or_init(|| {
        let rest: Vec<DVec3> = glued.iter().map(|at| at.on(&body.mesh.positions)).collect();
        let frames: Vec<Vec<DVec3>> = surfaces(&body)
            .iter()
            .map(|surface| glued.iter().map(|marker| marker.on(surface)).collect())
            .collect();
        let segments = Segments::of_rig(&body, &glued);
        let markers = (&glued[..], &rest[..]);
        learn(&body.mesh, &segments, markers, &frames, &Options::default()).expect("learns")
    });
    let skin = MarkerSkinData {
        names: (0..MARKERS).map(|at| format!("M{at:03}")).collect(),
        rig: learnt.rig.clone(),
        mode: learnt.mode(mode).clone(),
    };
    let baked = bake_with(&body, &BakeOptions::default(), Some(&skin), None);
    baked.expect("bakes").bytes
}

/// The body as a scan that follows 100 markers through its walk.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn scan(solve: Solve) -> AssetBytes {
    let body = human::small_body();
    let clip = body.clips[0].clone();
    let scan = Scan::new(body, MARKERS, &SurfaceOptions::default());
    let rate = 30.0;
    let frames = (clip.duration * rate) as u32;
    let driven = driven_by(
        (0..frames)
            .map(|frame| scan.at(&clip, f64::from(frame) / rate).1)
            .collect(),
        rate,
    );
    let mesh = &scan.body.mesh;
    let repaired = repair(&mesh.positions, &mesh.triangles, &RepairOptions::default());
    let repaired = repaired.expect("repairs");
    let places = scan.surface.markers.iter();
    let vertices: Vec<u32> = places
        .map(|&vertex| repaired.vertex_of[vertex as usize].expect("markers stay"))
        .collect();
    let names: Vec<String> = (0..MARKERS).map(|at| format!("M{at:03}")).collect();
    let options = RigOptions {
        solve,
        attach: true,
        ..RigOptions::default()
    };
    let rig = rig(mesh, &repaired, &vertices, &names, &driven, &options).expect("rigs");
    bake_rig(&rig, &BakeOptions::default())
        .expect("bakes")
        .bytes
}

/// Three seconds of 53 markers on the walking body, and the set learned from them.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn film() -> AssetBytes {
    let body = human::small_body();
    let film = truth(&body, &body.clips[0], MarkerLayout::Standard53, 120.0, 3.0);
    marker_film::asset(&film, std::slice::from_ref(&film))
}
