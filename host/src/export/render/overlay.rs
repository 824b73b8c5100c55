//! Markers and line segments as shaded capsules: a marker is a capsule of length zero.

use glam::{Vec2, Vec3};

use super::assemble::{UNIT, clip_segment};
use super::camera::View;
use super::image::Gamma;
use super::raster::Band;
use super::scene::Scene;

/// Nothing is drawn with a smaller radius, in pixels.
const LEAST_RADIUS: f32 = 0.9;

/// A capsule on the picture. Lengths are in samples.
pub(super) struct Capsule {
    from: Vec2,
    to: Vec2,
    from_radius: f32,
    to_radius: f32,
    from_inverse_w: f32,
    to_inverse_w: f32,
    /// Samples in a metre at distance 1.
    focal: f32,
    /// Linear light.
    pub color: Vec3,
    /// How strongly it shows through what is in front of it.
    pub occluded_opacity: f32,
}

/// Where the line of sight through a sample enters a capsule.
pub(super) struct Entry {
    /// 1 / distance in front of the eye.
    pub inverse_w: f32,
    /// Unit normal along the camera's right, up and back.
    pub normal: Vec3,
}

impl Capsule {
    /// What a line of sight meets, as if the eye were far away; none beside the capsule.
    pub fn entry(&self, sample: Vec2) -> Option<Entry> {
        let along = self.to - self.from;
        let square = along.length_squared();
        let t = if square > 0.0 {
            ((sample - self.from).dot(along) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let radius = self.from_radius + (self.to_radius - self.from_radius) * t;
        let offset = (sample - self.from - along * t) / radius;
        let square = offset.length_squared();
        if square >= 1.0 || square.is_nan() {
            return None;
        }
        let toward = (1.0 - square).sqrt();
        let axis = self.from_inverse_w + (self.to_inverse_w - self.from_inverse_w) * t;
        let bulge = radius / (axis * self.focal) * toward;
        // A capsule around the eye itself has no front.
        let distance = (1.0 / axis - bulge).max(1e-6);
        Some(Entry {
            inverse_w: 1.0 / distance,
            normal: Vec3::new(offset.x, -offset.y, toward),
        })
    }

    /// `[left, top, right, bottom]` in fixed point.
    pub fn bounds(&self) -> [i64; 4] {
        let radius = self.from_radius.max(self.to_radius);
        let low = self.from.min(self.to) - radius;
        let high = self.from.max(self.to) + radius;
        let fixed = |value: f32| (value * UNIT as f32) as i64;
        [fixed(low.x), fixed(low.y), fixed(high.x), fixed(high.y)]
    }

    /// Draws it as number `id` into a band of its own kind.
    pub fn draw(&self, id: u32, band: &mut Band) {
        let (rows, columns) = band.cells(self.bounds());
        for row in rows {
            for column in columns.clone() {
                let cell = (row - band.first_row) * band.columns + column;
                let sample = sample_position(band, column, row);
                if let Some(entry) = self.entry(sample)
                    && entry.inverse_w > band.nearness[cell]
                {
                    band.nearness[cell] = entry.inverse_w;
                    band.nearest[cell] = id;
                }
            }
        }
    }
}

/// Position of a sample, in samples.
pub(super) fn sample_position(band: &Band, column: usize, row: usize) -> Vec2 {
    let [x, y] = band.pattern.position(column, row);
    Vec2::new(x as f32, y as f32) / UNIT as f32
}

/// All markers and segments of a scene that may be visible, for a picture of `columns` x `rows`
/// samples with `side` samples along a pixel.
pub(super) fn capsules(
    scene: &Scene,
    view: &View,
    columns: usize,
    rows: usize,
    side: usize,
) -> Vec<Capsule> {
    let gamma = Gamma::get();
    let half = Vec2::new(columns as f32, rows as f32) / 2.0;
    let focal = half.y / view.tan_y;
    let mut capsules = Vec::new();
    let mut push = |[from, to]: [[f32; 3]; 2], radius: f32, color, occluded_opacity: f32| {
        let ends = [view.clip(Vec3::from(from)), view.clip(Vec3::from(to))];
        let Some([from, to]) = clip_segment(ends, view.near) else {
            return;
        };
        if !radius.is_finite() {
            return;
        }
        let place = |end: Vec3| Vec2::new(1.0 + end.x / end.z, 1.0 - end.y / end.z) * half;
        let size = |end: Vec3| (radius * focal / end.z).max(LEAST_RADIUS * side as f32);
        capsules.push(Capsule {
            from: place(from),
            to: place(to),
            from_radius: size(from),
            to_radius: size(to),
            from_inverse_w: 1.0 / from.z,
            to_inverse_w: 1.0 / to.z,
            focal,
            color: Vec3::from(gamma.linear(color)),
            occluded_opacity: occluded_opacity.clamp(0.0, 1.0),
        });
    };
    for points in &scene.points {
        for (index, &position) in points.positions.iter().enumerate() {
            let color = points.colors.of(index);
            push([position; 2], points.radius, color, points.occluded_opacity);
        }
    }
    for lines in &scene.lines {
        for (index, &segment) in lines.segments.iter().enumerate() {
            let color = lines.colors.of(index);
            push(segment, lines.radius, color, lines.occluded_opacity);
        }
    }
    capsules
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entry_is_nearer_than_the_axis_by_the_bulge() {
        let capsule = Capsule {
            from: Vec2::new(10.0, 10.0),
            to: Vec2::new(20.0, 10.0),
            from_radius: 4.0,
            to_radius: 4.0,
            from_inverse_w: 0.5,
            to_inverse_w: 0.5,
            focal: 80.0,
            color: Vec3::ONE,
            occluded_opacity: 0.0,
        };
        // Four samples at distance 2 are 0.1 m.
        let entry = capsule.entry(Vec2::new(15.0, 10.0)).unwrap();
        assert!((entry.inverse_w - 1.0 / 1.9).abs() < 1e-6);
        assert_eq!(entry.normal, Vec3::Z);
        let side = capsule.entry(Vec2::new(15.0, 7.6)).unwrap();
        assert!((side.normal - Vec3::new(0.0, 0.6, 0.8)).length() < 1e-6);
        assert!(capsule.entry(Vec2::new(15.0, 14.1)).is_none());
        assert!(capsule.entry(Vec2::new(23.9, 10.0)).is_some(), "round end");
        assert!(capsule.entry(Vec2::new(23.9, 12.0)).is_none());
    }
}
