//! A body from four sides.

use glam::DVec3;

use super::png::contact_sheet;
use super::render::{Camera, Colors, Floor, Image, Mesh, Points, Quality, Rgb, Scene, render};

/// Colours that neighbours can be told by; they begin again where there are more parts.
pub const PART_COLORS: [Rgb; 20] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [240, 228, 66],
    [0, 114, 178],
    [213, 94, 0],
    [204, 121, 167],
    [120, 94, 240],
    [153, 204, 51],
    [139, 69, 19],
    [255, 160, 160],
    [64, 192, 192],
    [128, 128, 0],
    [200, 60, 60],
    [100, 149, 237],
    [180, 180, 180],
    [46, 120, 60],
    [255, 200, 120],
    [150, 60, 150],
    [90, 90, 120],
];

/// A surface and points on it, from four sides; each side `size` pixels high.
#[must_use]
pub fn body_sheet(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    colors: Colors<'_>,
    points: &[DVec3],
    point_colors: Colors<'_>,
    size: usize,
) -> Image {
    let narrow = |points: &[DVec3]| -> Vec<[f32; 3]> {
        points.iter().map(|at| at.as_vec3().to_array()).collect()
    };
    let (skin, dots) = (narrow(positions), narrow(points));
    let lowest = skin.iter().map(|at| at[1]).fold(f32::INFINITY, f32::min);
    let mut scene = Scene {
        meshes: vec![Mesh {
            positions: &skin,
            normals: None,
            triangles,
            colors,
        }],
        floor: lowest.is_finite().then_some(Floor { height: lowest }),
        ..Scene::default()
    };
    let bounds = scene.bounds();
    let span = bounds.max - bounds.min;
    scene.points.push(Points {
        positions: &dots,
        radius: (0.0035 * span.max_element()) as f32,
        colors: point_colors,
        occluded_opacity: 0.0,
    });
    let quarter = std::f64::consts::FRAC_PI_2;
    let pictures: Vec<Image> = (0..4)
        .map(|side| {
            let camera = Camera::framing(bounds, quarter * f64::from(side) + 0.15, 0.1, 0.9);
            render(&scene, &camera, size * 9 / 10, size, Quality::Good)
        })
        .collect();
    contact_sheet(&pictures, 4, &["front", "left", "back", "right"])
}
