//! Which parts of the surfaces the main light reaches: a depth map as the light sees it.
//!
//! Williams 1978, *Casting curved shadows on curved surfaces*, with percentage-closer filtering
//! (Reeves, Salesin and Cook 1987).

use glam::Vec3;

use super::assemble::{Paint, Triangle, UNIT, Vertex, doubled_area};
use super::raster::{Band, Pattern};
use super::scene::Mesh;

/// Texels along the longer side, at most.
const TEXELS: f32 = 640.0;

/// Nearest surfaces as seen from far away in the light's direction.
pub(super) struct ShadowMap {
    axes: LightAxes,
    /// World coordinates, along the axes, of the first texel's corner.
    left: f32,
    top: f32,
    texel: f32,
    columns: usize,
    rows: usize,
    /// `[rows x columns]`: greatest distance toward the light; negative infinity for none.
    toward_light: Vec<f32>,
}

/// Right-handed axes of a far light.
#[derive(Clone, Copy)]
struct LightAxes {
    right: Vec3,
    down: Vec3,
    toward: Vec3,
}

impl LightAxes {
    fn new(toward: Vec3) -> Self {
        let (right, down) = toward.any_orthonormal_pair();
        Self {
            right,
            down,
            toward,
        }
    }

    fn coordinates(&self, world: Vec3) -> Vec3 {
        Vec3::new(
            world.dot(self.right),
            world.dot(self.down),
            world.dot(self.toward),
        )
    }
}

/// The next size above `size` on a scale of four steps an octave. Frames of a clip mostly agree
/// on it, so that the texels lie still while the body moves.
pub(super) fn round_up(size: f32) -> f32 {
    ((size.log2() * 4.0).ceil() / 4.0).exp2()
}

impl ShadowMap {
    /// Draws all meshes; `toward` is the unit vector to the light. None if there is no extent.
    pub fn new(meshes: &[Mesh], toward: Vec3) -> Option<Self> {
        let axes = LightAxes::new(toward);
        let mut min = Vec3::INFINITY;
        let mut max = Vec3::NEG_INFINITY;
        for &position in meshes.iter().flat_map(|mesh| mesh.positions) {
            let point = axes.coordinates(Vec3::from(position));
            if point.is_finite() {
                min = min.min(point);
                max = max.max(point);
            }
        }
        let extent = (max - min).truncate().max_element();
        if !(extent > 1e-6 && extent.is_finite()) {
            return None;
        }
        // One texel of border makes every lookup outside see light.
        let texel = round_up(extent / (TEXELS - 4.0));
        let left = ((min.x / texel).floor() - 1.0) * texel;
        let top = ((min.y / texel).floor() - 1.0) * texel;
        let columns = ((max.x - left) / texel) as usize + 2;
        let rows = ((max.y - top) / texel) as usize + 2;
        let mut map = Self {
            axes,
            left,
            top,
            texel,
            columns,
            rows,
            toward_light: Vec::new(),
        };
        // The rasteriser keeps the largest positive nearness.
        let lift = 1.0 - min.z;
        let mut band = Band::new(Pattern::new(1), columns);
        band.reset(0, rows);
        for mesh in meshes {
            map.draw(mesh, lift, &mut band);
        }
        map.toward_light = band.nearness;
        for depth in &mut map.toward_light {
            *depth = if *depth > 0.0 { *depth - lift } else { f32::NEG_INFINITY };
        }
        Some(map)
    }

    fn draw(&self, mesh: &Mesh, lift: f32, band: &mut Band) {
        let vertices: Vec<Vertex> = mesh
            .positions
            .iter()
            .map(|&position| {
                let point = self.axes.coordinates(Vec3::from(position));
                let fixed = |value: f32| (value / self.texel * UNIT as f32).round() as i32;
                Vertex {
                    x: fixed(point.x - self.left),
                    y: fixed(point.y - self.top),
                    inverse_w: point.z + lift,
                    world: point,
                    normal: Vec3::ZERO,
                    color: Vec3::ZERO,
                }
            })
            .collect();
        for &[a, b, c] in mesh.triangles {
            let corner = |index: u32| vertices.get(index as usize);
            let (Some(va), Some(vb), Some(vc)) = (corner(a), corner(b), corner(c)) else {
                continue;
            };
            if !(va.world.is_finite() && vb.world.is_finite() && vc.world.is_finite()) {
                continue;
            }
            let area = doubled_area([va, vb, vc]);
            let triangle = Triangle {
                vertices: if area < 0 { [a, c, b] } else { [a, b, c] },
                flipped: false,
                paint: Paint::Mixed,
            };
            if area != 0 {
                band.draw(0, &triangle, &vertices);
            }
        }
    }

    /// The share of the light, 0 to 1, that reaches a surface point with this unit normal.
    ///
    /// Mixes 4 x 4 texels with tent weights, about 1 % of the scene wide.
    pub fn light(&self, world: Vec3, normal: Vec3) -> f32 {
        // A surface must not shade itself: the look-up starts a little above it, more where the
        // light grazes it and one texel spans more depth.
        let grazing = (1.0 - normal.dot(self.axes.toward)).clamp(0.0, 1.0);
        let lifted = world + normal * (self.texel * (1.5 + 3.0 * grazing));
        let point = self.axes.coordinates(lifted);
        let x = (point.x - self.left) / self.texel - 0.5;
        let y = (point.y - self.top) / self.texel - 0.5;
        let inside = x >= 1.0
            && y >= 1.0
            && x < self.columns as f32 - 2.0
            && y < self.rows as f32 - 2.0;
        if !inside {
            return 1.0;
        }
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x - column as f32, y - row as f32);
        let across = [1.0 - fx, 2.0 - fx, 1.0 + fx, fx];
        let along = [1.0 - fy, 2.0 - fy, 1.0 + fy, fy];
        let limit = point.z + self.texel;
        let mut light = 0.0;
        for (k, weight) in along.into_iter().enumerate() {
            let start = (row + k - 1) * self.columns + column - 1;
            let texels = &self.toward_light[start..start + 4];
            let lit = texels.iter().zip(across);
            let lit = lit.map(|(&depth, weight)| if depth <= limit { weight } else { 0.0 });
            light += weight * lit.sum::<f32>();
        }
        light / 16.0
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::Colors;
    use super::*;

    #[test]
    fn a_square_shades_what_lies_below_it() {
        let positions = [[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]];
        let mesh = Mesh {
            positions: &positions,
            normals: None,
            triangles: &[[0, 1, 2], [0, 2, 3], [0, 0, 9], [0, 0, 0]],
            colors: Colors::Uniform([0; 3]),
        };
        let map = ShadowMap::new(&[mesh], Vec3::Y).unwrap();
        assert_eq!(map.light(Vec3::new(0.3, 0.0, -0.2), Vec3::Y), 0.0);
        assert_eq!(map.light(Vec3::new(0.3, 1.0, -0.2), Vec3::Y), 1.0, "not on itself");
        assert_eq!(map.light(Vec3::new(0.3, 2.0, -0.2), Vec3::Y), 1.0);
        assert_eq!(map.light(Vec3::new(1.3, 0.0, -0.2), Vec3::Y), 1.0);
        assert!(ShadowMap::new(&[], Vec3::Y).is_none());
    }

    #[test]
    fn sizes_step_four_times_an_octave() {
        assert_eq!(round_up(1.0), 1.0);
        assert_eq!(round_up(1.01), 2f32.powf(0.25));
        assert_eq!(round_up(1.9), 2.0);
    }
}
