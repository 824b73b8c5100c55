//! The bundled body, a finer one made from it, and a pose.

use std::collections::HashMap;
use std::path::Path;

use glam::{Affine3A, DAffine3, DQuat, DVec3, Mat4};
use sinew_core::asset::Asset;
use sinew_core::math::Affine12;
use sinew_core::pose::{self, Dual17};
use sinew_host::import::gltf::read_gltf;
use sinew_host::model::{Avatar, Morph};

/// A body with the bind matrices of a pose.
#[derive(Clone)]
pub struct Body {
    pub avatar: Avatar,
    pose: Vec<DAffine3>,
}

impl Body {
    /// The bundled body, every joint turned a little.
    pub fn load() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/data/human.glb");
        let bytes = std::fs::read(path).expect("the bundled body");
        let raw = read_gltf(&bytes, "human.glb", Path::new("")).expect("reads");
        let (avatar, _) = Avatar::new(raw, "human.glb").expect("sound");
        let binds = avatar.skin.binds.len();
        let pose = (0..binds)
            .map(|at| {
                let angle = 0.2 * (at as f64).sin();
                DAffine3::from_rotation_translation(
                    DQuat::from_rotation_y(angle),
                    DVec3::splat(0.1 * angle),
                )
            })
            .collect();
        Self { avatar, pose }
    }

    pub fn palette(&self) -> Vec<Affine12> {
        let rows = |m: &DAffine3| {
            let [x, y, z] = m.matrix3.transpose().to_cols_array_2d();
            let t = m.translation;
            [
                x[0], x[1], x[2], t.x, y[0], y[1], y[2], t.y, z[0], z[1], z[2], t.z,
            ]
            .map(|x| x as f32)
        };
        self.pose.iter().map(rows).collect()
    }

    /// Joints, in the order of the binds, have no scale.
    pub fn duals(&self, asset: &Asset<'_>) -> Vec<Dual17> {
        let mut rotations = vec![[0.0; 4]; asset.dims().joint_count];
        for (bind, pose) in self.pose.iter().enumerate() {
            let (joint, _) = asset.bind(bind).expect("as many binds");
            rotations[joint] = DQuat::from_mat3(&pose.matrix3).as_quat().to_array();
        }
        let mut duals = vec![[0.0; 17]; self.pose.len()];
        let stretched = pose::duals(asset, &self.palette(), &rotations, &mut duals);
        assert!(!stretched);
        duals
    }

    pub fn affine(&self) -> Vec<Affine3A> {
        self.pose.iter().map(|m| m.as_affine3a()).collect()
    }

    pub fn mat4(&self) -> Vec<Mat4> {
        self.affine().into_iter().map(Mat4::from).collect()
    }
}

/// Every triangle cut into four; what lies between takes the mean of its two ends.
pub fn subdivided(body: &Body) -> Body {
    let mut fine = body.clone();
    let (mesh, skin) = (&mut fine.avatar.mesh, &mut fine.avatar.skin);
    for part in &mut mesh.parts {
        part.triangles = 4 * part.triangles.start..4 * part.triangles.end;
    }
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let coarse = std::mem::take(&mut mesh.triangles);
    for [a, b, c] in coarse {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
            *middles
                .entry([from.min(to), from.max(to)])
                .or_insert_with(|| {
                    let ends = [from as usize, to as usize];
                    let mean = |all: &[DVec3]| (all[ends[0]] + all[ends[1]]) / 2.0;
                    let (position, normal) =
                        (mean(&mesh.positions), mean(&mesh.normals).normalize());
                    let mut sum: HashMap<u32, f64> = HashMap::new();
                    for (bind, weight) in ends.iter().flat_map(|&end| &skin.influences[end]) {
                        *sum.entry(*bind).or_default() += weight / 2.0;
                    }
                    mesh.positions.push(position);
                    mesh.normals.push(normal);
                    skin.influences.push(sum.into_iter().collect());
                    mesh.positions.len() as u32 - 1
                })
        });
        mesh.triangles
            .extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    fine
}

/// The heaviest influences of each vertex, at most `limit`.
pub fn with_influences(body: &Body, limit: usize) -> Body {
    let mut body = body.clone();
    for row in &mut body.avatar.skin.influences {
        row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        row.truncate(limit);
        let sum: f64 = row.iter().map(|&(_, weight)| weight).sum();
        row.iter_mut().for_each(|(_, weight)| *weight /= sum);
    }
    body
}

/// Eight targets; each moves a tenth of the body, a slice from the feet up.
pub fn with_morphs(body: &Body) -> Body {
    let mut body = body.clone();
    let mesh = &mut body.avatar.mesh;
    mesh.morphs = (0..8)
        .map(|target| {
            let slice = 0.17 * f64::from(target)..0.17 * f64::from(target + 1);
            let moved = |position: &DVec3| f64::from(u8::from(slice.contains(&position.y)));
            let offsets = mesh.positions.iter();
            let offsets: Vec<DVec3> = offsets.map(|p| 0.01 * moved(p) * DVec3::X).collect();
            Morph {
                name: format!("target {target}"),
                normals: offsets.clone(),
                positions: offsets,
                rest_weight: 0.0,
            }
        })
        .collect();
    body
}
