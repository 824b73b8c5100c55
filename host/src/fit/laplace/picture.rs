//! Pictures of markers and handles on a scan.

use glam::DVec3;

use super::rig::{Rig, Tables};
use crate::export::png::contact_sheet;
use crate::export::render::{
    Camera, Colors, Floor, Image, Lines, Mesh, Points, Quality, Rgb, Scene, render,
};

const SKIN: Rgb = [208, 170, 148];
const MARKER: Rgb = [214, 39, 40];
const HANDLE: Rgb = [31, 119, 180];
const EDGE: Rgb = [120, 120, 120];

/// Markers red, their tree grey, virtual handles blue, on the surface at rest and from four sides;
/// each side `size` pixels high.
#[must_use]
pub fn marker_sheet(rig: &Rig, size: usize) -> Image {
    let narrow = |p: &DVec3| p.as_vec3().to_array();
    let skin: Vec<[f32; 3]> = rig.body.mesh.positions.iter().map(narrow).collect();
    let model = rig.body.skeleton.model(&rig.body.skeleton.rest());
    let markers: Vec<[f32; 3]> = model
        .iter()
        .map(|joint| narrow(&joint.translation))
        .collect();
    let (edges, handles) = match &rig.tables {
        Tables::Exact(tables) => (&tables.marker_edges, Vec::new()),
        Tables::Collapsed(tables) => (&tables.marker_edges, tables.virtual_rest()),
    };
    let segments: Vec<[[f32; 3]; 2]> = edges
        .iter()
        .map(|edge| edge.map(|marker| markers[usize::from(marker)]))
        .collect();
    let lowest = skin.iter().map(|at| at[1]).fold(f32::INFINITY, f32::min);
    let dots = |positions, radius, color| Points {
        positions,
        radius,
        colors: Colors::Uniform(color),
        occluded_opacity: 0.0,
    };
    let scene = Scene {
        meshes: vec![Mesh {
            positions: &skin,
            normals: None,
            triangles: &rig.body.mesh.triangles,
            colors: Colors::Uniform(SKIN),
        }],
        points: vec![dots(&markers, 0.010, MARKER), dots(&handles, 0.005, HANDLE)],
        lines: vec![Lines {
            segments: &segments,
            radius: 0.002,
            colors: Colors::Uniform(EDGE),
            occluded_opacity: 0.25,
        }],
        floor: Some(Floor { height: lowest }),
        ..Scene::default()
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    let pictures: Vec<Image> = (0..4)
        .map(|side| {
            let camera = Camera::framing(scene.bounds(), quarter * f64::from(side), 0.1, 0.8);
            render(&scene, &camera, size * 8 / 10, size, Quality::Good)
        })
        .collect();
    contact_sheet(&pictures, 4, &["front", "left", "back", "right"])
}
