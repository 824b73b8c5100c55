//! How much light a surface point sends to the eye.

use glam::Vec3;

use super::assemble::{Assembly, Paint, Triangle};
use super::camera::View;
use super::shadow_map::ShadowMap;

/// Brightness of each light, linear; warm key, cool fill.
const KEY: Vec3 = Vec3::new(0.98, 0.93, 0.86);
const FILL: Vec3 = Vec3::new(0.17, 0.20, 0.25);
const BACK: Vec3 = Vec3::new(0.24, 0.25, 0.27);
const SKY: Vec3 = Vec3::new(0.36, 0.385, 0.42);
const GROUND: Vec3 = Vec3::new(0.19, 0.18, 0.17);
const GLOSS: f32 = 0.05;
const SHININESS: i32 = 24;

/// A main light, a weak one opposite, one from behind for the outline, and light from all around
/// that is brighter from above.
pub(super) struct Lights {
    /// Unit vectors toward the lights.
    pub key: Vec3,
    fill: Vec3,
    back: Vec3,
    eye: Vec3,
}

impl Lights {
    /// Placed around the camera, except for a key light of one's own.
    pub fn new(view: &View, key: Option<[f32; 3]>) -> Self {
        // Level axes: a camera that looks down must not sink the lights into the floor.
        let level = |v: Vec3| Vec3::new(v.x, 0.0, v.z).normalize_or_zero();
        let right = level(view.right);
        let toward = right.cross(Vec3::Y);
        let place = |r: f32, u: f32, t: f32| (right * r + Vec3::Y * u + toward * t).normalize_or(Vec3::Y);
        let own = key.map(Vec3::from).and_then(Vec3::try_normalize);
        Self {
            key: own.unwrap_or_else(|| place(-0.62, 1.0, 0.75)),
            fill: place(0.9, 0.25, 0.5),
            back: place(0.35, 0.7, -0.9),
            eye: view.eye,
        }
    }

    /// Light sent to the eye; `normal` is a unit vector on the eye's side, `lit` the share of the
    /// key light that arrives. All linear.
    pub fn surface(&self, color: Vec3, normal: Vec3, world: Vec3, lit: f32) -> Vec3 {
        let facing = |light: Vec3, wrap: f32| ((normal.dot(light) + wrap) / (1.0 + wrap)).max(0.0);
        let up = normal.y * 0.5 + 0.5;
        let key = facing(self.key, 0.0) * lit;
        let light = GROUND.lerp(SKY, up)
            + KEY * key
            + FILL * facing(self.fill, 0.5)
            + BACK * facing(self.back, 0.0).powi(2);
        let to_eye = (self.eye - world).normalize_or_zero();
        let half = (self.key + to_eye).normalize_or_zero();
        let gloss = GLOSS * normal.dot(half).max(0.0).powi(SHININESS) * key;
        color * light + gloss
    }
}

/// Colour, normal and place of a triangle at a sample, mixed with perspective.
pub(super) struct Fragment {
    pub color: Vec3,
    /// Unit, on the eye's side.
    pub normal: Vec3,
    pub world: Vec3,
}

impl Fragment {
    /// At a sample position in fixed point inside the triangle.
    pub fn new(assembly: &Assembly, triangle: &Triangle, [x, y]: [i64; 2], eye: Vec3) -> Self {
        let [a, b, c] = triangle.vertices.map(|vertex| &assembly.vertices[vertex as usize]);
        let edge = |x: i64, y: i64| ((x - i64::from(a.x)) as f32, (y - i64::from(a.y)) as f32);
        let (bx, by) = edge(i64::from(b.x), i64::from(b.y));
        let (cx, cy) = edge(i64::from(c.x), i64::from(c.y));
        let (px, py) = edge(x, y);
        // Rounding may put the shares of a very thin triangle outside 0 to 1.
        let area = bx * cy - by * cx;
        let share_b = ((px * cy - py * cx) / area).clamp(0.0, 1.0);
        let share_c = ((bx * py - by * px) / area).clamp(0.0, 1.0 - share_b);
        let share_a = 1.0 - share_b - share_c;
        let weights = Vec3::new(
            share_a * a.inverse_w,
            share_b * b.inverse_w,
            share_c * c.inverse_w,
        );
        let weights = weights / weights.element_sum();
        let mix = |a: Vec3, b: Vec3, c: Vec3| a * weights.x + b * weights.y + c * weights.z;
        let world = mix(a.world, b.world, c.world);
        let normal = mix(a.normal, b.normal, c.normal).try_normalize();
        let normal = match normal {
            Some(normal) if triangle.flipped => -normal,
            Some(normal) => normal,
            // Without vertex normals, or where opposite ones cancel: the triangle's own.
            None => {
                let face = (b.world - a.world).cross(c.world - a.world).normalize_or(Vec3::Y);
                if face.dot(eye - world) < 0.0 { -face } else { face }
            }
        };
        Self {
            color: match triangle.paint {
                Paint::Flat(color) => color,
                Paint::Mixed => mix(a.color, b.color, c.color),
            },
            normal,
            world,
        }
    }

    /// Light sent to the eye.
    pub fn light(&self, lights: &Lights, shadows: Option<&ShadowMap>) -> Vec3 {
        let turned_away = self.normal.dot(lights.key) <= 0.0;
        let lit = match shadows {
            Some(map) if !turned_away => map.light(self.world, self.normal),
            _ => 1.0,
        };
        lights.surface(self.color, self.normal, self.world, lit)
    }
}
