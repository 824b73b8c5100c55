//! Which camera sees which marker, and where its dot lies.

use glam::{DMat3, DVec2, DVec3};

use super::cameras::Camera;
use super::random::Random;
use crate::spatial::Tree;

/// What a camera can make out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Diameter of the hemispherical markers, metres.
    pub marker_diameter: f64,
    /// Largest angle between a marker's normal and the way to the camera, radians.
    pub facing_limit: f64,
    /// Standard deviation of that limit from frame to frame, radians: markers seen aslant flicker.
    pub facing_spread: f64,
    /// Chance that a camera misses a dot that it could see.
    pub miss: f64,
    /// Seconds for which the shutter is open: a dot that moves further than its width in this time
    /// is missed more often, by the square of the ratio.
    pub exposure: f64,
    /// What light and lens add to the diameter of a dot, pixels.
    pub blur: f64,
}

impl Default for Sight {
    fn default() -> Self {
        Self {
            marker_diameter: 0.003,
            facing_limit: 78f64.to_radians(),
            facing_spread: 3f64.to_radians(),
            miss: 0.06,
            exposure: 2e-3,
            blur: 1.0,
        }
    }
}

/// A marker as the cameras see it in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Seen {
    /// Bit `n` is set if camera `n` sees it.
    pub cameras: u32,
    /// Where the rays meet, metres, without noise; moved where a camera took two dots for one.
    pub position: DVec3,
}

impl Sight {
    /// Chance of a miss at a speed in metres a second.
    fn miss_at(&self, speed: f64) -> f64 {
        let smear = speed * self.exposure / self.marker_diameter;
        (self.miss * (1.0 + smear * smear)).min(1.0)
    }

    /// What the cameras see of markers at `points` with unit `normals` that move at `speeds` (metres
    /// a second), on the surface in `tree`.
    /// O(markers x cameras x log triangles)
    pub(super) fn look(
        &self,
        tree: &Tree,
        cameras: &[Camera],
        points: &[DVec3],
        normals: &[DVec3],
        speeds: &[f64],
        random: &mut Random,
    ) -> Vec<Seen> {
        let mut seen: Vec<Seen> = points
            .iter()
            .map(|&position| Seen {
                cameras: 0,
                position,
            })
            .collect();
        // The dot that each camera measures where it is not the marker's own.
        let mut moved: Vec<(usize, usize, DVec2)> = Vec::new();
        for (number, camera) in cameras.iter().enumerate() {
            let mut dots = Vec::new();
            for (marker, (&point, &normal)) in points.iter().zip(normals).enumerate() {
                // Drawn for every marker, so that one in the dark does not shift the others' luck.
                let limit = self.facing_limit + self.facing_spread * random.normal();
                let missed = random.unit() < self.miss_at(speeds[marker]);
                // The top of the hemisphere: its foot is on the skin, which would hide it.
                let top = point + normal * (self.marker_diameter / 2.0);
                let Some(pixel) = camera.project(top) else {
                    continue;
                };
                let way = camera.position - top;
                let facing = normal.dot(way) >= limit.cos() * way.length();
                if !missed && facing && !tree.blocks(top, camera.position) {
                    seen[marker].cameras |= 1 << number;
                    let depth = (top - camera.position).dot(camera.axes[2]);
                    dots.push((
                        marker,
                        pixel,
                        self.marker_diameter * camera.focal / depth + self.blur,
                    ));
                }
            }
            moved.extend(
                merged(&mut dots)
                    .into_iter()
                    .map(|(marker, pixel)| (marker, number, pixel)),
            );
        }
        moved.sort_by_key(|&(marker, ..)| marker);
        for of_marker in moved.chunk_by(|a, b| a.0 == b.0) {
            let marker = of_marker[0].0;
            seen[marker].position = triangulate(cameras, seen[marker], of_marker);
        }
        seen
    }
}

/// Pairs of dots (marker, pixel, diameter) that touch become one in the middle of the two.
fn merged(dots: &mut [(usize, DVec2, f64)]) -> Vec<(usize, DVec2)> {
    dots.sort_by(|a, b| a.1.x.total_cmp(&b.1.x));
    let widest = dots.iter().map(|dot| dot.2).fold(0.0, f64::max);
    let mut out = Vec::new();
    for (at, &(marker, pixel, size)) in dots.iter().enumerate() {
        for &(other, at_other, other_size) in &dots[at + 1..] {
            if at_other.x - pixel.x > widest {
                break;
            }
            if pixel.distance(at_other) < (size + other_size) / 2.0 {
                let middle = (pixel + at_other) / 2.0;
                out.extend([(marker, middle), (other, middle)]);
            }
        }
    }
    out
}

/// The point nearest to the rays of all cameras that see a marker, some of them through a dot that
/// is not its own.
fn triangulate(cameras: &[Camera], seen: Seen, moved: &[(usize, usize, DVec2)]) -> DVec3 {
    let (mut matrix, mut sum, mut rays) = (DMat3::ZERO, DVec3::ZERO, 0);
    for (number, camera) in cameras.iter().enumerate() {
        if seen.cameras >> number & 1 == 0 {
            continue;
        }
        let other = moved.iter().find(|(_, of, _)| *of == number);
        let ray = match other {
            Some(&(_, _, pixel)) => camera.ray(pixel),
            None => (seen.position - camera.position).normalize(),
        };
        let across = DMat3::IDENTITY - DMat3::from_cols(ray * ray.x, ray * ray.y, ray * ray.z);
        matrix += across;
        sum += across * camera.position;
        rays += 1;
    }
    // One ray, or all along one line, meet nowhere.
    if rays < 2 || matrix.determinant() < 1e-6 {
        return seen.position;
    }
    matrix.inverse() * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing by chance.
    fn strict() -> Sight {
        Sight {
            facing_spread: 0.0,
            miss: 0.0,
            ..Sight::default()
        }
    }

    fn camera(position: DVec3) -> Camera {
        Camera::look_at(position, DVec3::ZERO, [2000, 2000], 1.0)
    }

    fn plate(height: f64) -> Tree {
        let corner = |x, z| DVec3::new(x, height, z);
        let positions = [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ];
        Tree::new(&[[0, 1, 2], [0, 2, 3]], &positions)
    }

    #[test]
    fn a_plate_hides_the_marker_from_the_camera_behind_it() {
        let cameras = [DVec3::Y * 3.0, DVec3::new(5.0, 1.0, 0.0)].map(camera);
        let look = |tree: &Tree, normal: DVec3| {
            let mut random = Random::new(1);
            strict().look(
                tree,
                &cameras,
                &[DVec3::ZERO],
                &[normal],
                &[0.0],
                &mut random,
            )[0]
            .cameras
        };
        let oblique = DVec3::new(1.0, 1.0, 0.0).normalize();
        assert_eq!(look(&Tree::new(&[], &[]), oblique), 0b11);
        // The plate at 0.5 m spans 1 m to each side: the ray to the second camera, which rises by
        // 0.2 m a metre, passes it 2.5 m out.
        assert_eq!(look(&plate(0.5), oblique), 0b10);
        assert_eq!(look(&plate(-0.5), oblique), 0b11, "behind the marker");
        // Straight up: the second camera lies 79 degrees off, beyond the limit of 78.
        assert_eq!(look(&Tree::new(&[], &[]), DVec3::Y), 0b01);
        assert_eq!(look(&Tree::new(&[], &[]), DVec3::NEG_Y), 0);
    }

    #[test]
    fn dots_that_touch_pull_markers_together_in_that_camera_alone() {
        // From above the two markers stand 1 mm apart, less than a dot; from the side far apart.
        let cameras = [DVec3::Y * 3.0, DVec3::new(3.0, 0.1, 0.0)].map(camera);
        let points = [DVec3::ZERO, DVec3::new(0.0, -0.05, 1e-3)];
        let normals = [DVec3::new(1.0, 1.0, 0.0).normalize(); 2];
        let air = Tree::new(&[], &[]);
        let seen = strict().look(
            &air,
            &cameras,
            &points,
            &normals,
            &[0.0; 2],
            &mut Random::new(1),
        );
        assert!(seen.iter().all(|seen| seen.cameras == 0b11));
        let moved = seen[0].position - points[0];
        // Half a millimetre in one of two rays: a quarter at the meeting point.
        assert!((moved.z - 0.25e-3).abs() < 0.05e-3, "{moved}");
        let apart = [DVec3::ZERO, DVec3::new(0.0, -0.05, 0.02)];
        let seen = strict().look(
            &air,
            &cameras,
            &apart,
            &normals,
            &[0.0; 2],
            &mut Random::new(1),
        );
        assert_eq!(seen[0].position, DVec3::ZERO);
    }

    #[test]
    fn misses_come_at_their_rate() {
        let sight = Sight {
            miss: 0.1,
            ..strict()
        };
        let cameras = [camera(DVec3::Y * 3.0)];
        assert!(
            (sight.miss_at(3.0) - 0.5).abs() < 1e-12,
            "smeared over two widths"
        );
        assert_eq!(sight.miss_at(1e3), 1.0);
        let points = vec![DVec3::ZERO; 1];
        let mut random = Random::new(4);
        let air = Tree::new(&[], &[]);
        let seen = (0..10_000).filter(|_| {
            sight.look(&air, &cameras, &points, &[DVec3::Y], &[0.0], &mut random)[0].cameras != 0
        });
        assert!((8_850..9_150).contains(&seen.count()));
    }
}
