//! The bundled body, 2,000 vertices of it or 500, as markers drive it: assets whose tables are fitted, so
//! that other arithmetic in a solver may give other bytes.

use std::sync::OnceLock;

use glam::DVec3;
use sinew_host::bake::write::MarkerSkinData;
use sinew_host::bake::{AssetBytes, BakeOptions, bake_rig, bake_with};
use sinew_host::fit::laplace::SurfaceOptions;
use sinew_host::fit::laplace::graph::Graph;
use sinew_host::fit::laplace::repair::{RepairOptions, repair};
use sinew_host::fit::laplace::rig::{RigOptions, Solve, rig};
use sinew_host::fit::live::{self, LearnOptions};
use sinew_host::fit::parts::{Glued, Learnt, Mode, Options, Segments, learn};
use sinew_host::model::Avatar;
use sinew_host::reference;
use sinew_host::simplify::simplify;
use sinew_host::studio::MarkerLayout;
use sinew_host::take::Take;

use crate::laplacian::{Scan, driven_by};
use crate::marker_film::{self, truth};
use crate::{dense, human};

const MARKERS: usize = 100;
/// On the actor, who has a rope besides.
const ACTOR_MARKERS: usize = 45;

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
fn glued(body: &Avatar, count: usize) -> Vec<Glued> {
    let mesh = &body.mesh;
    let vertices = Graph::new(&mesh.positions, &mesh.triangles).spread(&[0], count);
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
    let learnt = LEARNT.get_or_init(|| learnt(&body, &glued(&body, MARKERS)));
    let skin = MarkerSkinData {
        names: (0..MARKERS).map(|at| format!("M{at:03}")).collect(),
        rig: learnt.rig.clone(),
        mode: learnt.mode(mode).clone(),
    };
    let baked = bake_with(&body, &BakeOptions::default(), Some(&skin), None);
    baked.expect("bakes").bytes
}

fn learnt(body: &Avatar, glued: &[Glued]) -> Learnt {
    let rest: Vec<DVec3> = glued.iter().map(|at| at.on(&body.mesh.positions)).collect();
    let frames: Vec<Vec<DVec3>> = surfaces(body)
        .iter()
        .map(|surface| glued.iter().map(|marker| marker.on(surface)).collect())
        .collect();
    let segments = Segments::of_rig(body, glued);
    learn(
        &body.mesh,
        &segments,
        (glued, &rest),
        &frames,
        &Options::default(),
    )
    .expect("learns")
}

/// 500 vertices of the body with its walk: a marker set that is recognised live, and the skin that
/// the named markers drive.
///
/// # Panics
/// When the bundled files are absent or no longer fit.
#[must_use]
pub fn actor() -> AssetBytes {
    let mut body = human::small_body();
    let simple = simplify(&body, 500);
    (body.mesh, body.skin) = (simple.mesh, simple.skin);
    let glued = glued(&body, ACTOR_MARKERS);
    let (rate, clip) = (120.0, &body.clips[0]);
    let frames = (clip.duration * rate) as usize;
    let mut paths = vec![DVec3::NAN; glued.len() * frames];
    for frame in 0..frames {
        let local = reference::pose::sample(&body.skeleton, clip, frame as f64 / rate);
        let surface = dense::skin(&body, &local, 0.0);
        for (marker, glued) in glued.iter().enumerate() {
            paths[marker * frames + frame] = glued.on(&surface);
        }
    }
    let names: Vec<String> = (0..glued.len()).map(|at| format!("M{at:03}")).collect();
    let take = Take::new(names.clone(), rate, frames, paths).expect("a sound take");
    let set = live::learn(&[take], &LearnOptions::default(), &|| ()).expect("the set is learned");
    // The skin's markers in the order of the set's.
    let order = set.labels.iter().map(|label| {
        let place = names.iter().position(|name| name == label);
        glued[place.expect("of this take")]
    });
    let glued: Vec<Glued> = order.collect();
    assert_eq!(glued.len(), names.len(), "every marker is in the set");
    let learnt = learnt(&body, &glued);
    let skin = MarkerSkinData {
        names: set.labels.clone(),
        rig: learnt.rig.clone(),
        mode: learnt.mode(Mode::Collapsed).clone(),
    };
    let baked = bake_with(&body, &BakeOptions::default(), Some(&skin), Some(&set));
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
