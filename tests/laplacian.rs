//! The bundled body as a scan: its skinned surface is the truth, a few of its vertices are markers.

use glam::{DAffine3, DQuat, DVec3};
use sinew_host::fit::laplace::align::Similarity;
use sinew_host::fit::laplace::drive::DriveReport;
use sinew_host::fit::laplace::graph::Graph;
use sinew_host::fit::laplace::suggest::suggest;
use sinew_host::fit::laplace::{Driven, MarkerTarget, Surface, SurfaceOptions};
use sinew_host::fit::parts::Glued;
use sinew_host::fit::{Correspondence, Options, retarget};
use sinew_host::model::{Avatar, Bind, Clip, Joint, Mesh, Motion, Skeleton, Skin, Transform};
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

    /// `count` markers placed where they do most good in poses of a clip.
    ///
    /// # Panics
    /// Where the system cannot be factored.
    #[must_use]
    pub fn suggested(body: Avatar, clips: &[&Clip], count: usize) -> Self {
        let mut scan = Self::new(body, count, &SurfaceOptions::default());
        let mut poses = Vec::new();
        for clip in clips {
            poses.extend((0..4).map(|k| scan.at(clip, clip.duration * f64::from(k) / 4.0).0));
        }
        let mesh = &scan.body.mesh;
        let (positions, triangles) = (&mesh.positions, &mesh.triangles);
        let options = SurfaceOptions::default();
        let markers = suggest(positions, triangles, &poses, count, &options).expect("suggests");
        scan.surface =
            Surface::new(positions.clone(), triangles, markers, &options).expect("factors");
        scan
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

/// A tube of 0.6 m along y with a radius of 0.05 m: positions, triangles, normals.
#[must_use]
pub fn tube(rings: u32, sides: u32) -> (Vec<DVec3>, Vec<[u32; 3]>, Vec<DVec3>) {
    let (mut positions, mut triangles, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    for ring in 0..rings {
        for side in 0..sides {
            let angle = std::f64::consts::TAU * f64::from(side) / f64::from(sides);
            let out = DVec3::new(angle.cos(), 0.0, -angle.sin());
            let height = 0.6 * f64::from(ring) / f64::from(rings - 1);
            positions.push(0.05 * out + DVec3::Y * height);
            normals.push(out);
            if ring + 1 < rings {
                let (low, next) = (ring * sides + side, ring * sides + (side + 1) % sides);
                triangles.push([low, next, next + sides]);
                triangles.push([low, next + sides, low + sides]);
            }
        }
    }
    (positions, triangles, normals)
}

/// The body with every triangle cut into four; new vertices lie half-way, weights too.
#[must_use]
pub fn subdivided(body: &Avatar) -> Avatar {
    let mut fine = body.clone();
    let mut middle_of = std::collections::HashMap::new();
    let mut triangles = Vec::new();
    for &[a, b, c] in &body.mesh.triangles {
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(a, b)| {
            *middle_of.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let mesh = &mut fine.mesh;
                let (i, j) = (a as usize, b as usize);
                mesh.positions
                    .push((mesh.positions[i] + mesh.positions[j]) / 2.0);
                mesh.normals
                    .push((mesh.normals[i] + mesh.normals[j]).normalize_or(DVec3::Y));
                let mut weights = std::collections::BTreeMap::new();
                for vertex in [i, j] {
                    for &(bind, weight) in &body.skin.influences[vertex] {
                        *weights.entry(bind).or_insert(0.0) += weight / 2.0;
                    }
                }
                fine.skin.influences.push(weights.into_iter().collect());
                mesh.positions.len() as u32 - 1
            })
        });
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    fine.mesh.triangles = triangles;
    fine.mesh.parts.clear();
    fine
}

/// The instructions that every machine of this kind has.
#[must_use]
pub fn baseline() -> fearless_simd::Level {
    fearless_simd::Level::baseline()
}

/// The tube as a body: its upper half hangs on a second joint at 0.3 m, whose share grows from 0 at
/// `from` to 1 `over` further up, metres.
#[must_use]
pub fn jointed_tube(rings: u32, sides: u32, from: f64, over: f64) -> Avatar {
    let (positions, triangles, normals) = tube(rings, sides);
    let influences = positions.iter().map(|p| {
        let upper = ((p.y - from) / over).clamp(0.0, 1.0);
        let pairs = [(0, 1.0 - upper), (1, upper)];
        pairs.into_iter().filter(|pair| pair.1 > 0.0).collect()
    });
    let joint = |name: &str, parent, height: f64| Joint {
        name: name.into(),
        parent,
        rest: Transform {
            translation: DVec3::Y * height,
            ..Transform::IDENTITY
        },
    };
    let bind = |joint, height: f64| Bind {
        joint,
        inverse_bind: DAffine3::from_translation(DVec3::Y * -height),
    };
    Avatar {
        skin: Skin {
            binds: vec![bind(0, 0.0), bind(1, 0.3)],
            influences: influences.collect(),
        },
        mesh: Mesh {
            name: "tube".into(),
            positions,
            normals,
            tangents: None,
            texcoords: None,
            triangles,
            parts: Vec::new(),
            morphs: Vec::new(),
        },
        skeleton: Skeleton {
            joints: vec![joint("lower", None, 0.0), joint("upper", Some(0), 0.3)],
        },
        clips: Vec::new(),
    }
}

/// A marker on a tube, near a vertex below the last ring.
#[must_use]
pub fn on_tube(vertex: u32, sides: u32) -> Glued {
    let last = u32::from(vertex % sides == sides - 1);
    Glued {
        vertices: [vertex, vertex + sides, vertex + 1 - sides * last],
        weights: [0.7, 0.2, 0.1],
    }
}

/// Markers that are known in every frame, `[frames][markers]`: nothing was aligned or retargeted.
#[must_use]
pub fn driven_by(poses: Vec<Vec<MarkerTarget>>, rate: f64) -> Driven {
    Driven {
        poses,
        rate,
        report: DriveReport {
            similarity: Similarity::IDENTITY,
            misfit: 0.0,
            retargeted: false,
            plants: 0,
            slide: 0.0,
        },
    }
}
