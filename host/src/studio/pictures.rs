//! Pictures of a capture: where the markers sit, what a camera sees, how much is missing.

use glam::DVec3;

use super::body::{Body, Surface};
use super::capture::Capture;
use super::markers::MarkerSet;
use crate::export::plot::{Chart, Series, Style};
use crate::export::png::contact_sheet;
use crate::export::render::{
    Camera, Colors, Floor, Image, Mesh, Points, Quality, Rgb, Scene, render,
};
use crate::model::Avatar;

const SKIN: Rgb = [208, 170, 148];
const MARKER: Rgb = [214, 39, 40];
/// Seen by the camera of the picture; by enough others; by too few.
const SEEN: Rgb = [30, 160, 60];
const ELSEWHERE: Rgb = [245, 170, 20];
const MISSING: Rgb = [214, 39, 40];

fn narrow(points: &[DVec3]) -> Vec<[f32; 3]> {
    points.iter().map(|at| at.as_vec3().to_array()).collect()
}

fn scene<'a>(
    avatar: &'a Avatar,
    skin: &'a [[f32; 3]],
    dots: &'a [[f32; 3]],
    colors: Colors<'a>,
    radius: f32,
    floor: f32,
) -> Scene<'a> {
    Scene {
        meshes: vec![Mesh {
            positions: skin,
            normals: None,
            triangles: &avatar.mesh.triangles,
            colors: Colors::Uniform(SKIN),
        }],
        points: vec![Points {
            positions: dots,
            radius,
            colors,
            occluded_opacity: 0.0,
        }],
        floor: Some(Floor { height: floor }),
        ..Scene::default()
    }
}

/// The markers on the rest shape, from four sides; each side `size` pixels high.
#[must_use]
pub fn marker_sheet(avatar: &Avatar, markers: &MarkerSet, size: usize) -> Image {
    let rest = Surface {
        positions: avatar.mesh.positions.clone(),
        normals: avatar.mesh.normals.clone(),
    };
    let (skin, dots) = (narrow(&rest.positions), narrow(&markers.positions(&rest)));
    let lowest = skin.iter().map(|at| at[1]).fold(f32::INFINITY, f32::min);
    let scene = scene(avatar, &skin, &dots, Colors::Uniform(MARKER), 0.006, lowest);
    let quarter = std::f64::consts::FRAC_PI_2;
    let pictures: Vec<Image> = (0..4)
        .map(|side| {
            let camera = Camera::framing(scene.bounds(), quarter * f64::from(side), 0.1, 0.7);
            render(&scene, &camera, size * 7 / 10, size, Quality::Good)
        })
        .collect();
    contact_sheet(&pictures, 4, &["front", "left", "back", "right"])
}

/// A frame through the lens of a capture's camera: green markers it sees, orange ones have a point
/// thanks to others, red ones have none. `width` is in pixels; the true surface is drawn.
///
/// # Panics
/// If there is no such camera or frame.
#[must_use]
pub fn camera_view(
    body: &Body<'_>,
    markers: &MarkerSet,
    capture: &Capture,
    camera: usize,
    frame: usize,
    width: usize,
) -> Image {
    let surface = body.surface(frame);
    let normals = markers.normals(&surface);
    // Lifted a little, or half of each ball would sink into the skin.
    let lifted: Vec<DVec3> = markers
        .positions(&surface)
        .iter()
        .zip(&normals)
        .map(|(at, normal)| *at + 2e-3 * *normal)
        .collect();
    let mut colors = vec![MISSING; lifted.len()];
    for owner in capture.truth.owners[frame].iter().flatten() {
        let marker = *owner as usize;
        let by_this = capture.truth.cameras[frame][marker] >> camera & 1 == 1;
        colors[marker] = if by_this { SEEN } else { ELSEWHERE };
    }
    let (skin, dots) = (narrow(&surface.positions), narrow(&lifted));
    let scene = scene(
        body.avatar(),
        &skin,
        &dots,
        Colors::PerVertex(&colors),
        0.011,
        0.0,
    );
    let lens = &capture.cameras[camera];
    let [pixels_wide, pixels_high] = lens.resolution.map(f64::from);
    let eye = Camera {
        eye: lens.position,
        target: lens.position + lens.axes[2] * 3.0,
        up: lens.axes[1],
        vertical_fov: 2.0 * (pixels_high / 2.0 / lens.focal).atan(),
    };
    let height = (width as f64 * pixels_high / pixels_wide) as usize;
    render(&scene, &eye, width, height.max(1), Quality::Good)
}

/// The views of all cameras in one frame.
///
/// # Panics
/// If there is no such frame.
#[must_use]
pub fn camera_sheet(
    body: &Body<'_>,
    markers: &MarkerSet,
    capture: &Capture,
    frame: usize,
    width: usize,
) -> Image {
    let all = 0..capture.cameras.len();
    let pictures: Vec<Image> = all
        .clone()
        .map(|camera| camera_view(body, markers, capture, camera, frame, width))
        .collect();
    let captions: Vec<String> = all
        .map(|camera| {
            let seen = capture.truth.cameras[frame].iter();
            let seen = seen.filter(|mask| *mask >> camera & 1 == 1).count();
            format!("camera {}: {seen}", camera + 1)
        })
        .collect();
    let captions: Vec<&str> = captions.iter().map(String::as_str).collect();
    contact_sheet(&pictures, 4, &captions)
}

/// The share of markers with a point, over time.
#[must_use]
pub fn visible_chart(capture: &Capture, width: usize, height: usize) -> Image {
    let fractions = capture.visible_fractions();
    let at = |(frame, share): (usize, f64)| [frame as f64 / capture.rate, share * 100.0];
    let points = fractions.into_iter().enumerate().map(at).collect();
    let chart = Chart {
        title: "Markers with a measured point".into(),
        x_label: "s".into(),
        y_label: "%".into(),
        series: vec![Series::new("", Style::Line, points)],
        y_range: Some([0.0, 100.0]),
        ..Chart::default()
    };
    chart.render(width, height)
}
