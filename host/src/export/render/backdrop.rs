//! What shows where nothing stands: a pale gradient, and the floor with its grid and shadow.

use glam::{Vec2, Vec3};

use super::Rgb;
use super::camera::View;
use super::floor_shadow::FloorShadow;
use super::image::Gamma;

const SKY_TOP: Rgb = [226, 231, 238];
const SKY_BOTTOM: Rgb = [246, 247, 249];
const FLOOR: Rgb = [233, 235, 238];
const LINE: Rgb = [203, 208, 216];

/// Metres between lines, and their width.
const GRID: [(f32, f32); 2] = [(1.0, 0.010), (0.1, 0.002)];

/// Background and floor of one picture.
pub(super) struct Backdrop<'a> {
    pub view: &'a View,
    pub width: usize,
    pub height: usize,
    /// y of the floor, and its shadow.
    pub floor: Option<(f32, Option<&'a FloorShadow>)>,
    /// Where on the floor (x, z) the stage is, and how far from there it begins to fade, metres.
    pub stage: (Vec2, f32),
}

impl Backdrop<'_> {
    /// Whether a point is hidden below the floor.
    pub fn hides(&self, world: Vec3) -> bool {
        // A sole that rests on the floor may dip into it by rounding.
        const SLACK: f32 = 5e-4;
        let below = |height: f32| self.view.eye.y > height && world.y < height - SLACK;
        self.floor.is_some_and(|(height, _)| below(height))
    }

    /// Linear light at the centre of a pixel.
    pub fn color(&self, column: usize, row: usize, gamma: &Gamma) -> Vec3 {
        let linear = |color: Rgb| Vec3::from(gamma.linear(color));
        let down = (row as f32 + 0.5) / self.height as f32;
        let sky = linear(SKY_TOP).lerp(linear(SKY_BOTTOM), smooth(down));
        let Some((height, shadow)) = self.floor else {
            return sky;
        };
        let x = (column as f32 + 0.5) / self.width as f32 * 2.0 - 1.0;
        let ray = self.view.ray(x, 1.0 - 2.0 * down);
        let above = self.view.eye.y - height;
        if above <= 0.0 || ray.y >= -1e-6 {
            return sky;
        }
        let distance = above / -ray.y;
        let hit = self.view.eye + ray * distance;
        let place = Vec2::new(hit.x, hit.z);
        let (centre, radius) = self.stage;
        let away = (place.distance(centre) / radius - 1.0) / 2.0;
        let strength = 1.0 - smooth(away.clamp(0.0, 1.0));
        if strength <= 0.0 {
            return sky;
        }
        // How far the hit moves from one pixel to the next, across and along the picture.
        let step = |axis: Vec3| {
            let moved = (axis - ray * (axis.y / ray.y)) * distance;
            Vec2::new(moved.x, moved.z).abs()
        };
        let across = step(self.view.right * (2.0 * self.view.tan_x / self.width as f32));
        let along = step(self.view.up * (2.0 * self.view.tan_y / self.height as f32));
        let footprint = (across + along).max(Vec2::splat(1e-6));
        let mut lines = 0.0;
        for (spacing, width) in GRID {
            // Lines nearer to each other than some pixels only make noise.
            let pixels = spacing / footprint.max_element();
            let visible = smooth(((pixels - 12.0) / 36.0).clamp(0.0, 1.0));
            if visible > 0.0 {
                let x = line_cover(place.x, footprint.x, spacing, width);
                let z = line_cover(place.y, footprint.y, spacing, width);
                lines += visible * (x + z - x * z) * (1.0 - lines);
            }
        }
        let floor = linear(FLOOR).lerp(linear(LINE), lines);
        let lit = floor * shadow.map_or(1.0, |shadow| shadow.light(place.x, place.y));
        sky.lerp(lit, strength)
    }
}

/// 3 t^2 - 2 t^3.
pub(super) fn smooth(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// The share of the interval `at +- footprint / 2` that lies on lines of `width` centred on the
/// multiples of `spacing`; all in metres.
fn line_cover(at: f32, footprint: f32, spacing: f32, width: f32) -> f32 {
    // Length of line between -infinity and x, up to a constant.
    let length = |x: f32| {
        let periods = (x + width / 2.0) / spacing;
        let whole = periods.floor();
        whole * width + ((periods - whole) * spacing).min(width)
    };
    (length(at + footprint / 2.0) - length(at - footprint / 2.0)) / footprint
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_cover_the_right_share() {
        // On a line, between lines, half on it, and a footprint of exactly one period.
        assert!((line_cover(2.0, 0.01, 1.0, 0.02) - 1.0).abs() < 1e-4);
        assert_eq!(line_cover(2.5, 0.01, 1.0, 0.02), 0.0);
        assert!((line_cover(-1.01, 0.02, 1.0, 0.02) - 0.5).abs() < 1e-4);
        assert!((line_cover(0.3, 1.0, 1.0, 0.02) - 0.02).abs() < 1e-5);
    }
}
