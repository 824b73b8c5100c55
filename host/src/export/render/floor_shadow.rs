//! Soft shadow on the floor: sharp where a foot stands, wide and faint under what is high up.
//!
//! Triangles are sorted into layers by height, projected along the light, and each layer is
//! blurred by the penumbra that a light of some width gives at that height. Two more layers,
//! projected straight down, darken the floor right at contacts.

use glam::{Vec2, Vec3, Vec3Swizzles};

use super::assemble::{Paint, Triangle, UNIT, Vertex, doubled_area};
use super::raster::{Band, NONE, Pattern};
use super::scene::Scene;
use super::shadow_map::round_up;

/// Texels along the longer side, at most.
const TEXELS: f32 = 360.0;

/// A slice of heights above the floor.
struct Layer {
    /// Metres above the floor: from the previous layer's `top` up to this.
    top: f32,
    /// Radius of the blur, metres.
    blur: f32,
    /// Share of the light that is blocked where the layer covers fully.
    strength: f32,
}

/// Along the main light. The blur is about a sixth of the height.
const CAST: [Layer; 5] = [
    Layer { top: 0.06, blur: 0.012, strength: 0.50 },
    Layer { top: 0.18, blur: 0.025, strength: 0.46 },
    Layer { top: 0.45, blur: 0.055, strength: 0.40 },
    Layer { top: 1.0, blur: 0.12, strength: 0.34 },
    Layer { top: f32::INFINITY, blur: 0.24, strength: 0.28 },
];

/// Straight down.
const CONTACT: [Layer; 2] = [
    Layer { top: 0.05, blur: 0.02, strength: 0.50 },
    Layer { top: 0.25, blur: 0.07, strength: 0.25 },
];

/// How much light reaches each place of the floor.
pub(super) struct FloorShadow {
    /// World x and z of the first texel's corner.
    corner: Vec2,
    texel: f32,
    columns: usize,
    rows: usize,
    /// `[rows x columns]`, 0 to 1.
    light: Vec<f32>,
}

impl FloorShadow {
    /// The shadow of everything in the scene on the plane y = `height`; `toward` is the unit
    /// vector to the light. None if nothing is above the floor.
    pub fn new(scene: &Scene, height: f32, toward: Vec3) -> Option<Self> {
        // A light near the horizon would stretch the shadow without end.
        let slope = Vec2::new(toward.x, toward.z) / toward.y.max(0.35);
        let mut soup = Soup::default();
        soup.gather(scene, height);
        let mut min = Vec2::INFINITY;
        let mut max = Vec2::NEG_INFINITY;
        for vertex in soup.vertices.iter().filter(|vertex| vertex.is_finite()) {
            let above = vertex.y.max(0.0);
            for point in [vertex.xz(), vertex.xz() - slope * above] {
                min = min.min(point);
                max = max.max(point);
            }
        }
        if soup.triangles.is_empty() || !(min.is_finite() && max.is_finite()) {
            return None;
        }
        let margin = CAST[CAST.len() - 1].blur * 2.0;
        let extent = (max - min).max_element() + 2.0 * margin;
        let texel = round_up(extent / TEXELS);
        let corner = ((min - margin) / texel).floor() * texel;
        let size = ((max + margin - corner) / texel).ceil();
        let (columns, rows) = (size.x as usize + 1, size.y as usize + 1);
        let mut shadow = Self {
            corner,
            texel,
            columns,
            rows,
            light: vec![1.0; columns * rows],
        };
        let mut band = Band::new(Pattern::new(1), columns);
        shadow.darken(&soup, &CAST, slope, &mut band);
        shadow.darken(&soup, &CONTACT, Vec2::ZERO, &mut band);
        Some(shadow)
    }

    /// Multiplies in the light that a set of layers lets through.
    fn darken(&mut self, soup: &Soup, layers: &[Layer], slope: Vec2, band: &mut Band) {
        let vertices = soup.vertices.iter().map(|&vertex| {
            let texels = (vertex.xz() - slope * vertex.y - self.corner) / self.texel;
            Vertex {
                x: (texels.x * UNIT as f32).round() as i32,
                y: (texels.y * UNIT as f32).round() as i32,
                inverse_w: 1.0,
                world: Vec3::ZERO,
                normal: Vec3::ZERO,
                color: Vec3::ZERO,
            }
        });
        let vertices: Vec<Vertex> = vertices.collect();
        let mut blocked = vec![0.0; self.light.len()];
        let mut bottom = f32::NEG_INFINITY;
        for layer in layers {
            band.reset(0, self.rows);
            let mut any = false;
            for &[a, b, c] in &soup.triangles {
                let corners = [a, b, c].map(|vertex| soup.vertices[vertex as usize].y);
                // What is below the floor is out of the light's way.
                let middle = corners.iter().sum::<f32>() / 3.0;
                let out = corners.iter().all(|&y| y < -0.02);
                if middle < bottom || middle >= layer.top || out {
                    continue;
                }
                let area = doubled_area([a, b, c].map(|vertex| &vertices[vertex as usize]));
                let triangle = Triangle {
                    vertices: if area < 0 { [a, c, b] } else { [a, b, c] },
                    flipped: false,
                    paint: Paint::Mixed,
                };
                if area != 0 {
                    band.draw(0, &triangle, &vertices);
                    any = true;
                }
            }
            bottom = layer.top;
            if any {
                let covered = band.nearest.iter();
                let mut cover: Vec<f32> =
                    covered.map(|&id| if id == NONE { 0.0 } else { 1.0 }).collect();
                blur(&mut cover, self.columns, layer.blur / self.texel);
                for (sum, cover) in blocked.iter_mut().zip(&cover) {
                    *sum += cover * layer.strength;
                }
            }
        }
        // Layers add up where they meet, and must not darken twice where they overlap.
        let most = layers.iter().fold(0.0, |most: f32, layer| most.max(layer.strength));
        for (light, blocked) in self.light.iter_mut().zip(&blocked) {
            *light *= 1.0 - blocked.clamp(0.0, most);
        }
    }

    /// The share of the light at a place of the floor, mixed from the four nearest texels.
    pub fn light(&self, x: f32, z: f32) -> f32 {
        let at = (Vec2::new(x, z) - self.corner) / self.texel - 0.5;
        let inside = at.x >= 0.0
            && at.y >= 0.0
            && at.x < self.columns as f32 - 1.0
            && at.y < self.rows as f32 - 1.0;
        if !inside {
            return 1.0;
        }
        let (column, row) = (at.x as usize, at.y as usize);
        let (fx, fy) = (at.x - column as f32, at.y - row as f32);
        let mix = |row: usize| {
            let start = row * self.columns + column;
            self.light[start] + (self.light[start + 1] - self.light[start]) * fx
        };
        mix(row) + (mix(row + 1) - mix(row)) * fy
    }
}

/// What throws a shadow, as bare triangles; y is the height above the floor, metres.
#[derive(Default)]
struct Soup {
    vertices: Vec<Vec3>,
    /// Only of finite vertices.
    triangles: Vec<[u32; 3]>,
}

impl Soup {
    fn gather(&mut self, scene: &Scene, height: f32) {
        for mesh in &scene.meshes {
            let base = self.vertices.len();
            let raised = |&position| Vec3::from(position) - Vec3::Y * height;
            self.vertices.extend(mesh.positions.iter().map(raised));
            let new = &self.vertices[base..];
            let finite = |&index: &u32| new.get(index as usize).is_some_and(|v| v.is_finite());
            let proper = mesh.triangles.iter().filter(|corners| corners.iter().all(finite));
            let base = base as u32;
            self.triangles.extend(proper.map(|corners| corners.map(|vertex| base + vertex)));
        }
        for points in &scene.points {
            for &position in points.positions {
                self.capsule(position, position, points.radius, height);
            }
        }
        for lines in &scene.lines {
            for &[from, to] in lines.segments {
                self.capsule(from, to, lines.radius, height);
            }
        }
    }

    /// A flat outline of a thick segment: an octagon cut in two halves, one at each end.
    fn capsule(&mut self, from: [f32; 3], to: [f32; 3], radius: f32, height: f32) {
        let (from, to) = (Vec3::from(from), Vec3::from(to));
        if !(from.is_finite() && to.is_finite() && radius.is_finite()) {
            return;
        }
        let along = Vec2::new(to.x - from.x, to.z - from.z).normalize_or(Vec2::X);
        let base = self.vertices.len() as u32;
        for k in 0..8 {
            let angle = (k as f32 - 1.5) * std::f32::consts::FRAC_PI_4;
            let offset = Vec2::from_angle(angle).rotate(along) * radius;
            let end = if k < 4 { to } else { from };
            let vertex = Vec3::new(end.x + offset.x, end.y - height, end.z + offset.y);
            self.vertices.push(vertex);
        }
        for k in 2..8 {
            self.triangles.push([base, base + k - 1, base + k]);
        }
    }
}

/// Blurs a picture by about a Gaussian of the given standard deviation in texels: three box
/// filters along each axis. Outside is zero. Linear in the number of texels.
fn blur(values: &mut [f32], columns: usize, deviation: f32) {
    // A box of radius r has variance r (r + 1) / 3.
    let radius = ((deviation * deviation + 0.25).sqrt() - 0.5).round().max(1.0) as usize;
    let rows = values.len() / columns;
    let mut line = Vec::new();
    let mut out = Vec::new();
    for row in values.chunks_exact_mut(columns) {
        if row.iter().any(|&value| value != 0.0) {
            line.clear();
            line.extend_from_slice(row);
            box_thrice(&mut line, &mut out, radius);
            row.copy_from_slice(&line);
        }
    }
    for column in 0..columns {
        line.clear();
        line.extend((0..rows).map(|row| values[row * columns + column]));
        if line.iter().any(|&value| value != 0.0) {
            box_thrice(&mut line, &mut out, radius);
            for (row, &value) in line.iter().enumerate() {
                values[row * columns + column] = value;
            }
        }
    }
}

fn box_thrice(line: &mut Vec<f32>, out: &mut Vec<f32>, radius: usize) {
    let scale = 1.0 / (2 * radius + 1) as f32;
    for _ in 0..3 {
        out.clear();
        let mut sum: f32 = line.iter().take(radius).sum();
        for index in 0..line.len() {
            sum += line.get(index + radius).copied().unwrap_or(0.0);
            out.push((sum * scale).max(0.0));
            sum -= if index >= radius { line[index - radius] } else { 0.0 };
        }
        std::mem::swap(line, out);
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::{Colors, Mesh, Points};
    use super::*;

    #[test]
    fn blur_keeps_the_sum_and_spreads_evenly() {
        let mut values = vec![0.0; 31 * 21];
        values[10 * 31 + 15] = 1.0;
        blur(&mut values, 31, 1.4);
        assert!((values.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        assert!((values[10 * 31 + 14] - values[10 * 31 + 16]).abs() < 1e-6);
        assert!((values[9 * 31 + 15] - values[10 * 31 + 14]).abs() < 1e-6);
        // Three boxes of radius 1: the middle weight is 7 / 27 along each axis.
        assert!((values[10 * 31 + 15] - (7.0f32 / 27.0).powi(2)).abs() < 1e-5);
    }

    #[test]
    fn a_low_board_shades_the_floor_beside_it_along_the_light() {
        let positions = [[-0.2, 0.5, -0.2], [0.2, 0.5, -0.2], [0.2, 0.5, 0.2], [-0.2, 0.5, 0.2]];
        let scene = Scene {
            meshes: vec![Mesh {
                positions: &positions,
                normals: None,
                triangles: &[[0, 1, 2], [0, 2, 3]],
                colors: Colors::Uniform([0; 3]),
            }],
            ..Scene::default()
        };
        let toward = Vec3::new(1.0, 1.0, 0.0).normalize();
        let shadow = FloorShadow::new(&scene, 0.0, toward).unwrap();
        // Moved by half a metre away from the light; 0.31 of the light blocked in the middle.
        let (middle, beside) = (shadow.light(-0.5, 0.0), shadow.light(0.5, 0.0));
        assert!(middle < 0.8 && middle >= 0.68, "{middle}");
        assert_eq!(beside, 1.0);
        assert_eq!(shadow.light(1e9, f32::NAN), 1.0);
    }

    #[test]
    fn nothing_and_nonsense_throw_no_shadow() {
        let points = [[f32::NAN, 0.0, 0.0]];
        let scene = Scene {
            points: vec![Points {
                positions: &points,
                radius: 0.01,
                colors: Colors::Uniform([0; 3]),
                occluded_opacity: 0.0,
            }],
            ..Scene::default()
        };
        assert!(FloorShadow::new(&scene, 0.0, Vec3::Y).is_none());
    }
}
