//! Pictures of a skeleton in motion, as sticks, with the markers it was solved from.

use glam::DVec3;

use crate::export::png::contact_sheet;
use crate::export::render::{
    Bounds, Camera, Colors, Floor, Image, Lines, Points, Quality, Rgb, Scene, render,
};
use crate::model::Motion;
use crate::reference::pose::sample;
use crate::take::Take;

const PICTURES: usize = 8;
const COLUMNS: usize = 4;
const BONE: Rgb = [60, 70, 90];
const LEFT: Rgb = [0, 114, 178];
const RIGHT: Rgb = [213, 94, 0];
const MARKER: Rgb = [0, 158, 115];

/// A contact sheet of pictures spread over the motion: left bones blue, right ones orange, measured
/// markers green. O(pictures x (joints + markers + pixels))
#[must_use]
pub fn sheet(motion: &Motion, take: Option<&Take>, size: usize) -> Image {
    let last = motion.clip.duration;
    let times: Vec<f64> = (0..PICTURES)
        .map(|picture| last * picture as f64 / (PICTURES - 1) as f64)
        .collect();
    let images: Vec<Image> = times
        .iter()
        .map(|&seconds| picture(motion, take, seconds, size))
        .collect();
    let captions: Vec<String> = times.iter().map(|time| format!("{time:.2} s")).collect();
    let captions: Vec<&str> = captions.iter().map(String::as_str).collect();
    contact_sheet(&images, COLUMNS, &captions)
}

fn picture(motion: &Motion, take: Option<&Take>, seconds: f64, size: usize) -> Image {
    let joints = &motion.skeleton.joints;
    let model = motion
        .skeleton
        .model(&sample(&motion.skeleton, &motion.clip, seconds));
    let narrow = |at: DVec3| at.as_vec3().to_array();
    let color = |name: &str| {
        let lower = name.to_lowercase();
        match () {
            () if lower.starts_with("left") => LEFT,
            () if lower.starts_with("right") => RIGHT,
            () => BONE,
        }
    };
    let mut segments = Vec::new();
    let mut colors = Vec::new();
    let mut bounds = Bounds::EMPTY;
    for (at, joint) in joints.iter().enumerate() {
        let here = model[at].translation;
        bounds.include(here);
        if let Some(parent) = joint.parent {
            segments.push([narrow(model[parent].translation), narrow(here)]);
            colors.push(color(&joint.name));
        }
    }
    for (joint, end) in &motion.end_sites {
        let tip = model[*joint].transform_point3(*end);
        bounds.include(tip);
        segments.push([narrow(model[*joint].translation), narrow(tip)]);
        colors.push(color(&joints[*joint].name));
    }
    let markers: Vec<[f32; 3]> = take.map_or(Vec::new(), |take| {
        let last = take.frame_count().saturating_sub(1);
        let frame = ((seconds * take.rate()).round() as usize).min(last);
        let near =
            |at: &DVec3| at.cmpge(bounds.min - 0.5).all() && at.cmple(bounds.max + 0.5).all();
        let seen = take.seen(frame).map(|(_, at)| at).filter(near);
        seen.map(narrow).collect()
    });
    let middle = (bounds.min + bounds.max) / 2.0;
    bounds.include(DVec3::new(middle.x, bounds.min.y - 0.05, middle.z));
    let scene = Scene {
        lines: vec![Lines {
            segments: &segments,
            radius: 0.011,
            colors: Colors::PerVertex(&colors),
            occluded_opacity: 1.0,
        }],
        points: vec![Points {
            positions: &markers,
            radius: 0.012,
            colors: Colors::Uniform(MARKER),
            occluded_opacity: 1.0,
        }],
        floor: Some(Floor { height: 0.0 }),
        ..Scene::default()
    };
    let camera = Camera::framing(bounds, facing(motion, &model) + 0.5, 0.12, 1.0);
    render(&scene, &camera, size, size, Quality::default())
}

/// The way the root's +Z looks, radians about the vertical.
fn facing(motion: &Motion, model: &[glam::DAffine3]) -> f64 {
    let root = motion
        .skeleton
        .joints
        .iter()
        .position(|joint| joint.parent.is_none());
    let ahead = root.map_or(DVec3::Z, |root| model[root].transform_vector3(DVec3::Z));
    ahead.x.atan2(ahead.z)
}
