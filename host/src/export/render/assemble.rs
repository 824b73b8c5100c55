//! Meshes in, clipped triangles in sample coordinates out.

use glam::Vec3;

use super::camera::View;
use super::image::Gamma;
use super::scene::{Colors, Mesh};

/// Fixed-point units in one sample. 8 bits keep shared edges watertight and sub-sample exact.
pub(super) const UNIT: i64 = 256;

/// How far outside the picture a vertex may lie, in half pictures, before its triangle is cut.
/// It bounds the fixed-point numbers; within it, parts outside are simply not visited.
const GUARD: f32 = 4.0;

/// A vertex ready for rasterising and shading.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// Fixed point, right and down from the picture's top left corner.
    pub x: i32,
    pub y: i32,
    /// 1 / distance in front of the eye, which is linear across the picture.
    pub inverse_w: f32,
    pub world: Vec3,
    /// Not normalised.
    pub normal: Vec3,
    /// Linear light.
    pub color: Vec3,
}

/// What a triangle is painted with.
#[derive(Clone, Copy, Debug)]
pub(super) enum Paint {
    /// The mix of its vertices' colours.
    Mixed,
    /// One colour, linear light.
    Flat(Vec3),
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// Into [`Assembly::vertices`]; turning so that the area is positive.
    pub vertices: [u32; 3],
    /// The eye sees the side that the normals point away from.
    pub flipped: bool,
    pub paint: Paint,
}

/// All triangles of a scene that may be visible.
#[derive(Default)]
pub(super) struct Assembly {
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<Triangle>,
}

/// A vertex before the division by `w`.
#[derive(Clone, Copy)]
struct Clipped {
    clip: Vec3,
    world: Vec3,
    normal: Vec3,
    color: Vec3,
}

/// Scale from clip space to fixed point.
struct Viewport {
    half_width: f64,
    half_height: f64,
}

impl Viewport {
    fn project(&self, vertex: &Clipped) -> Vertex {
        let (x, y) = (f64::from(vertex.clip.x), f64::from(vertex.clip.y));
        let inverse_w = 1.0 / f64::from(vertex.clip.z);
        Vertex {
            x: ((x * inverse_w + 1.0) * self.half_width).round() as i32,
            y: ((1.0 - y * inverse_w) * self.half_height).round() as i32,
            inverse_w: inverse_w as f32,
            world: vertex.world,
            normal: vertex.normal,
            color: vertex.color,
        }
    }
}

/// Signed distances from the near plane and the four guard planes; inside is positive.
fn plane_distances(clip: Vec3, near: f32) -> [f32; 5] {
    let reach = clip.z * GUARD;
    [
        clip.z - near,
        reach - clip.x,
        reach + clip.x,
        reach - clip.y,
        reach + clip.y,
    ]
}

/// One bit for each plane that the vertex is outside of: near and guard, then the picture's sides.
fn outside(clip: Vec3, near: f32) -> u16 {
    let guard = plane_distances(clip, near);
    let sides = [
        clip.z - clip.x,
        clip.z + clip.x,
        clip.z - clip.y,
        clip.z + clip.y,
    ];
    let distances = guard.into_iter().chain(sides);
    distances.enumerate().fold(0, |bits, (plane, distance)| {
        bits | u16::from(distance < 0.0) << plane
    })
}

/// The bits of the planes that must be cut at.
const CUT: u16 = 0b1_1111;

impl Assembly {
    /// Adds a mesh for a picture of `columns` x `rows` samples.
    pub fn add(&mut self, mesh: &Mesh, view: &View, columns: usize, rows: usize) {
        let gamma = Gamma::get();
        let viewport = Viewport {
            half_width: columns as f64 * UNIT as f64 / 2.0,
            half_height: rows as f64 * UNIT as f64 / 2.0,
        };
        let computed = match mesh.normals {
            Some(_) => Vec::new(),
            None => vertex_normals(mesh.positions, mesh.triangles),
        };
        let normals = mesh.normals.unwrap_or(&computed);
        let whole = match mesh.colors {
            Colors::Uniform(color) => Vec3::from(gamma.linear(color)),
            _ => Vec3::ZERO,
        };
        let base = self.vertices.len() as u32;
        let mut clipped = Vec::with_capacity(mesh.positions.len());
        self.vertices.reserve(mesh.positions.len());
        for (index, position) in mesh.positions.iter().enumerate() {
            let world = Vec3::from(*position);
            let normal = normals.get(index).map_or(Vec3::ZERO, |&normal| Vec3::from(normal));
            let color = match mesh.colors {
                Colors::PerVertex(_) => Vec3::from(gamma.linear(mesh.colors.of(index))),
                _ => whole,
            };
            let vertex = Clipped {
                clip: view.clip(world),
                world,
                normal: if normal.is_finite() { normal } else { Vec3::ZERO },
                color,
            };
            // Outside the guard the projection means nothing; cutting replaces it.
            let bits = outside(vertex.clip, view.near);
            self.vertices.push(viewport.project(&vertex));
            clipped.push((vertex, bits));
        }
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            let corner = |corner: usize| clipped.get(triangle[corner] as usize);
            let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) else {
                continue;
            };
            let finite = |v: &(Clipped, u16)| v.0.clip.is_finite();
            if a.1 & b.1 & c.1 != 0 || !(finite(a) && finite(b) && finite(c)) {
                continue;
            }
            let paint = match mesh.colors {
                Colors::PerTriangle(_) => {
                    Paint::Flat(Vec3::from(gamma.linear(mesh.colors.of(index))))
                }
                _ => Paint::Mixed,
            };
            let flipped = shows_back([&a.0, &b.0, &c.0], view.eye);
            if (a.1 | b.1 | c.1) & CUT == 0 {
                self.push(triangle.map(|vertex| base + vertex), flipped, paint);
                continue;
            }
            let polygon = self.cut([a.0, b.0, c.0], view.near, &viewport);
            for corner in 2..polygon.len() {
                self.push([polygon[0], polygon[corner - 1], polygon[corner]], flipped, paint);
            }
        }
    }

    /// Cuts a triangle at the near and guard planes (Sutherland and Hodgman 1974); gives the
    /// corners of what is left, at most eight.
    fn cut(&mut self, corners: [Clipped; 3], near: f32, viewport: &Viewport) -> Vec<u32> {
        let mut polygon = corners.to_vec();
        for plane in 0..5 {
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (index, to) in polygon.iter().enumerate() {
                let from = &polygon[(index + polygon.len() - 1) % polygon.len()];
                let before = plane_distances(from.clip, near)[plane];
                let after = plane_distances(to.clip, near)[plane];
                if (before < 0.0) != (after < 0.0) {
                    let t = before / (before - after);
                    kept.push(Clipped {
                        clip: from.clip.lerp(to.clip, t),
                        world: from.world.lerp(to.world, t),
                        normal: from.normal.lerp(to.normal, t),
                        color: from.color.lerp(to.color, t),
                    });
                }
                if after >= 0.0 {
                    kept.push(*to);
                }
            }
            polygon = kept;
        }
        // Rounding may leave a corner a hair on the wrong side of the near plane.
        for vertex in &mut polygon {
            vertex.clip.z = vertex.clip.z.max(near);
        }
        let first = self.vertices.len() as u32;
        self.vertices.extend(polygon.iter().map(|vertex| viewport.project(vertex)));
        (first..self.vertices.len() as u32).collect()
    }

    fn push(&mut self, vertices: [u32; 3], flipped: bool, paint: Paint) {
        let [a, b, c] = vertices;
        let vertices = match doubled_area(vertices.map(|v| &self.vertices[v as usize])) {
            0 => return,
            1.. => [a, b, c],
            _ => [a, c, b],
        };
        self.triangles.push(Triangle {
            vertices,
            flipped,
            paint,
        });
    }
}

/// Twice the signed area in fixed-point units squared.
pub(super) fn doubled_area([a, b, c]: [&Vertex; 3]) -> i64 {
    let edge = |v: &Vertex| (i64::from(v.x) - i64::from(a.x), i64::from(v.y) - i64::from(a.y));
    let ((bx, by), (cx, cy)) = (edge(b), edge(c));
    bx * cy - by * cx
}

/// Whether the eye is on the side that the vertex normals point away from, whatever the winding.
fn shows_back([a, b, c]: [&Clipped; 3], eye: Vec3) -> bool {
    let face = (b.world - a.world).cross(c.world - a.world);
    let outward = face.dot(a.normal + b.normal + c.normal);
    let toward_eye = face.dot(eye - a.world);
    (outward < 0.0) != (toward_eye < 0.0)
}

/// The part of a segment, in clip space, that lies inside the near and guard planes.
pub(super) fn clip_segment([mut from, mut to]: [Vec3; 2], near: f32) -> Option<[Vec3; 2]> {
    for plane in 0..5 {
        let before = plane_distances(from, near)[plane];
        let after = plane_distances(to, near)[plane];
        // Also refuses NaN.
        if !(before >= 0.0 || after >= 0.0) {
            return None;
        }
        let crossing = from.lerp(to, before / (before - after));
        if before < 0.0 {
            from = crossing;
        } else if after < 0.0 {
            to = crossing;
        }
    }
    let pull = |end: Vec3| Vec3::new(end.x, end.y, end.z.max(near));
    (from.is_finite() && to.is_finite()).then(|| [pull(from), pull(to)])
}

/// Area-weighted vertex normals, unit length; zero where a vertex has no proper triangle.
fn vertex_normals(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[f32; 3]> {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for triangle in triangles {
        let corner = |corner: usize| positions.get(triangle[corner] as usize);
        let (Some(&a), Some(&b), Some(&c)) = (corner(0), corner(1), corner(2)) else {
            continue;
        };
        let (a, b, c) = (Vec3::from(a), Vec3::from(b), Vec3::from(c));
        let face = (b - a).cross(c - a);
        if face.is_finite() {
            for &vertex in triangle {
                normals[vertex as usize] += face;
            }
        }
    }
    normals.iter().map(|normal| normal.normalize_or_zero().to_array()).collect()
}
