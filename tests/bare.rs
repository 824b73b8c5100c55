//! How far skins lie apart through motions: a body's own weights against others.

use std::fs;
use std::path::Path;

use glam::{DAffine3, DVec3};
use sinew_host::export::png::contact_sheet;
use sinew_host::export::render::{
    Bounds, Camera, Colors, Floor, Image, Mesh as Drawn, Quality, Rgb, Scene, render,
};
use sinew_host::fit::{Correspondence, Options, retarget};
use sinew_host::import::read_bvh;
use sinew_host::model::{Clip, Mesh, Motion, Skeleton, Skin};
use sinew_host::reference::pose::{model, sample};
use sinew_host::reference::skin::linear_blend;

use crate::root;

/// A captured motion.
///
/// # Panics
/// When the file is absent or not sound.
#[must_use]
pub fn motion(path: &Path) -> Motion {
    let name = path.display().to_string();
    let raw = read_bvh(&fs::read(path).expect("a file"), &name).expect("a motion");
    Motion::new(raw, &name).expect("a sound motion").0
}

/// A bundled one.
#[must_use]
pub fn bundled(name: &str) -> Motion {
    motion(&root().join("examples/data").join(name))
}

/// A motion on a skeleton, without regard to the floor.
///
/// # Panics
/// When the two do not fit.
#[must_use]
pub fn carried(motion: &Motion, skeleton: &Skeleton) -> Clip {
    let joints = Correspondence::new(&motion.skeleton, skeleton, &[]).expect("fits");
    let done = retarget(motion, skeleton, &joints, &Options::default());
    done.expect("fits").clip
}

/// Distances between the vertices of two surfaces through a motion, metres.
#[derive(Clone, Debug, Default)]
pub struct Difference {
    /// Over vertices and frames.
    pub mean: f64,
    /// The 95th percentile over vertices of their means over frames.
    pub most: f64,
    /// Of any vertex in any frame.
    pub worst: f64,
    /// `[vertices]`: mean over frames.
    pub each: Vec<f64>,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [mean, most, worst] = [self.mean, self.most, self.worst].map(|d| 1e3 * d);
        write!(f, "mean {mean:.2} mm, 95 % {most:.1}, worst {worst:.0}")
    }
}

/// Model-space poses of a skeleton in every `step`-th frame of a clip.
#[must_use]
pub fn poses(skeleton: &Skeleton, clip: &Clip, step: usize) -> Vec<Vec<DAffine3>> {
    let longest = clip.tracks.iter().max_by_key(|track| track.times.len());
    let times = longest
        .map(|track| track.times.as_slice())
        .unwrap_or_default();
    let pose = |&time: &f64| model(skeleton, &sample(skeleton, clip, time));
    times.iter().step_by(step).map(pose).collect()
}

/// The second poses, moved so that the joint is where it is in the first ones: bodies whose legs differ
/// a little walk a little less far.
#[must_use]
pub fn in_place(
    first: &[Vec<DAffine3>],
    second: &[Vec<DAffine3>],
    joint: usize,
) -> Vec<Vec<DAffine3>> {
    let moved = |(first, second): (&Vec<DAffine3>, &Vec<DAffine3>)| {
        let by = first[joint].translation - second[joint].translation;
        let by = DAffine3::from_translation(by);
        second.iter().map(|&pose| by * pose).collect()
    };
    first.iter().zip(second).map(moved).collect()
}

/// The surface of a mesh in a pose.
#[must_use]
pub fn surface(mesh: &Mesh, skin: &Skin, pose: &[DAffine3]) -> Vec<DVec3> {
    linear_blend(mesh, skin, pose).0
}

/// Compares two skins of one mesh, each in its own poses.
///
/// # Panics
/// Where there is nothing to compare.
#[must_use]
pub fn difference(
    mesh: &Mesh,
    (truth, truth_poses): (&Skin, &[Vec<DAffine3>]),
    (other, other_poses): (&Skin, &[Vec<DAffine3>]),
) -> Difference {
    assert!(!truth_poses.is_empty() && truth_poses.len() == other_poses.len());
    let mut out = Difference {
        each: vec![0.0; mesh.positions.len()],
        ..Difference::default()
    };
    for (a, b) in truth_poses.iter().zip(other_poses) {
        let (a, b) = (surface(mesh, truth, a), surface(mesh, other, b));
        for ((a, b), each) in a.iter().zip(&b).zip(&mut out.each) {
            let away = a.distance(*b);
            out.worst = out.worst.max(away);
            *each += away / truth_poses.len() as f64;
        }
    }
    out.mean = out.each.iter().sum::<f64>() / out.each.len() as f64;
    let mut sorted = out.each.clone();
    sorted.sort_by(f64::total_cmp);
    out.most = sorted[sorted.len() * 95 / 100];
    out
}

/// A surface as it is drawn, vertices in their colours, seen from half left.
#[must_use]
pub fn picture(positions: &[DVec3], triangles: &[[u32; 3]], colors: &[Rgb], size: usize) -> Image {
    let skin: Vec<[f32; 3]> = positions.iter().map(|at| at.as_vec3().to_array()).collect();
    let bounds = Bounds::of(&skin);
    let scene = Scene {
        meshes: vec![Drawn {
            positions: &skin,
            normals: None,
            triangles,
            colors: Colors::PerVertex(colors),
        }],
        floor: Some(Floor {
            height: bounds.min.y as f32,
        }),
        ..Scene::default()
    };
    let camera = Camera::framing(bounds, 0.6, 0.1, 0.9);
    render(&scene, &camera, size * 9 / 10, size, Quality::Good)
}

/// How far each vertex is off as a colour: skin below 2 mm, red from 40 mm on.
#[must_use]
pub fn heat(each: &[f64]) -> Vec<Rgb> {
    let color = |off: &f64| {
        let part = ((off - 0.002) / 0.038).clamp(0.0, 1.0);
        let mix = |from: f64, to: f64| (from + part * (to - from)) as u8;
        [mix(208.0, 214.0), mix(170.0, 20.0), mix(148.0, 20.0)]
    };
    each.iter().map(color).collect()
}

/// Skins of one mesh beside each other, a row a pose: the first as it is, the others coloured by their
/// distance from it.
#[must_use]
pub fn side_by_side(mesh: &Mesh, skins: &[(&str, &Skin, &[Vec<DAffine3>])]) -> Image {
    let mut pictures = Vec::new();
    let mut captions = Vec::new();
    let poses = skins.first().map_or(0, |(_, _, poses)| poses.len());
    for pose in 0..poses {
        let mut truth: Option<Vec<DVec3>> = None;
        for (name, skin, poses) in skins {
            let at = surface(mesh, skin, &poses[pose]);
            let first = truth.get_or_insert_with(|| at.clone());
            let off: Vec<f64> = at
                .iter()
                .zip(first.iter())
                .map(|(a, b)| a.distance(*b))
                .collect();
            pictures.push(picture(&at, &mesh.triangles, &heat(&off), 560));
            captions.push(*name);
        }
    }
    contact_sheet(&pictures, skins.len(), &captions)
}
