//! The bundled body as a scan: its skinned surface is the truth, a few of its vertices are markers.

use glam::{DQuat, DVec3};
use sinew_host::fit::laplace::graph::Graph;
use sinew_host::fit::laplace::{MarkerTarget, Surface, SurfaceOptions};
use sinew_host::fit::{Correspondence, Options, retarget};
use sinew_host::model::{Avatar, Clip, Motion};
use sinew_host::{import, reference};

/// A body with markers, and what moves it.
#[derive(Debug)]
pub struct Scan {
    /// Surface, skeleton and weights.
    pub body: Avatar,
    /// The factored systems.
    pub surface: Surface,
}

/// The bundled body.
///
/// # Panics
/// Where the sample does not load.
#[must_use]
pub fn bundled_body() -> Avatar {
    let path = crate::root().join("examples/data/human.glb");
    let bytes = std::fs::read(&path).expect("the sample is there");
    let folder = path.parent().expect("has one");
    let raw = import::gltf::read_gltf(&bytes, "human.glb", folder).expect("reads");
    Avatar::new(raw, "human.glb").expect("sound").0
}

/// A BVH motion on a body.
///
/// # Panics
/// Where it does not load.
#[must_use]
pub fn fitted(path: &std::path::Path, body: &Avatar) -> Clip {
    let bytes = std::fs::read(path).expect("readable");
    let raw = import::read_bvh(&bytes, "motion").expect("reads");
    let (motion, _) = Motion::new(raw, "motion").expect("sound");
    let map = Correspondence::new(&motion.skeleton, &body.skeleton, &[]).expect("corresponds");
    retarget(&motion, &body.skeleton, &map, &Options::default())
        .expect("fits")
        .clip
}

impl Scan {
    /// `count` markers spread over the body.
    ///
    /// # Panics
    /// Where the system cannot be factored.
    #[must_use]
    pub fn new(body: Avatar, count: usize, options: &SurfaceOptions) -> Self {
        let (positions, triangles) = (body.mesh.positions.clone(), &body.mesh.triangles);
        let graph = Graph::new(&positions, triangles);
        let markers = graph.spread(&[0], count);
        let surface = Surface::new(positions, triangles, markers, options).expect("factors");
        Self { body, surface }
    }

    /// The true surface and its markers at a time of a clip.
    #[must_use]
    pub fn at(&self, clip: &Clip, seconds: f64) -> (Vec<DVec3>, Vec<MarkerTarget>) {
        let local = reference::pose::sample(&self.body.skeleton, clip, seconds);
        let model = self.body.skeleton.model(&local);
        let (truth, _) = reference::skin::linear_blend(&self.body.mesh, &self.body.skin, &model);
        let targets = self.surface.markers.iter().map(|&vertex| {
            let influences = &self.body.skin.influences[vertex as usize];
            let mut sum = [0.0; 4];
            let mut first = None;
            for &(bind, weight) in influences {
                let bind = &self.body.skin.binds[bind as usize];
                let matrix = model[bind.joint] * bind.inverse_bind;
                let turn = DQuat::from_mat3(&matrix.matrix3).normalize();
                let first = *first.get_or_insert(turn);
                let turn = if turn.dot(first) < 0.0 { -turn } else { turn };
                for (sum, x) in sum.iter_mut().zip(turn.to_array()) {
                    *sum += weight * x;
                }
            }
            MarkerTarget {
                position: truth[vertex as usize],
                rotation: DQuat::from_array(sum).normalize(),
            }
        });
        let targets = targets.collect();
        (truth, targets)
    }
}
