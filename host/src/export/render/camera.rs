//! Where the picture is taken from.

use glam::{DVec3, Vec3};

/// A box around a set of points, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinate on each axis.
    pub min: DVec3,
    /// Largest coordinate on each axis.
    pub max: DVec3,
}

impl Bounds {
    /// Around nothing; any union replaces it.
    pub const EMPTY: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    /// The box around the finite ones of `positions` (metres).
    #[must_use]
    pub fn of(positions: &[[f32; 3]]) -> Self {
        let mut bounds = Self::EMPTY;
        for position in positions {
            bounds.include(Vec3::from(*position).as_dvec3());
        }
        bounds
    }

    /// Grows the box to hold `point`, unless that is not finite.
    pub fn include(&mut self, point: DVec3) {
        if point.is_finite() {
            self.min = self.min.min(point);
            self.max = self.max.max(point);
        }
    }

    /// The box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Whether it holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !(self.min.cmple(self.max).all() && self.min.is_finite() && self.max.is_finite())
    }
}

/// A perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands, metres.
    pub eye: DVec3,
    /// What it looks at, metres.
    pub target: DVec3,
    /// Which way is up in the picture; need not be perpendicular.
    pub up: DVec3,
    /// Opening angle from the lower to the upper edge, radians.
    pub vertical_fov: f64,
}

impl Camera {
    /// Stands as near as shows all of `bounds` with a small margin.
    ///
    /// `yaw` and `pitch` are radians: 0, 0 looks from +Z toward -Z, at the face of a body that
    /// faces +Z; positive yaw moves the camera toward +X, positive pitch lifts it. `aspect` is
    /// width by height. Unite the bounds of all frames of a clip first, so that the camera holds
    /// still.
    #[must_use]
    pub fn framing(bounds: Bounds, yaw: f64, pitch: f64, aspect: f64) -> Self {
        const VERTICAL_FOV: f64 = 0.5;
        const MARGIN: f64 = 0.07;
        let bounds = if bounds.is_empty() {
            Bounds {
                min: DVec3::new(-0.5, 0.0, -0.5),
                max: DVec3::new(0.5, 1.0, 0.5),
            }
        } else {
            bounds
        };
        let pitch = pitch.clamp(-1.57, 1.57);
        let back = DVec3::new(
            yaw.sin() * pitch.cos(),
            pitch.sin(),
            yaw.cos() * pitch.cos(),
        );
        let right = DVec3::new(yaw.cos(), 0.0, -yaw.sin());
        let up = back.cross(right);
        let tan_y = (VERTICAL_FOV / 2.0).tan();
        let aspect = if aspect.is_finite() { aspect } else { 1.0 };
        let tan_x = tan_y * aspect.clamp(0.01, 100.0);
        // The eye (x, z in camera axes) sees a corner if |cx - x| <= (z - cz) tan. Over all
        // corners that is z tan + x >= max(cx + cz tan) and z tan - x >= max(-cx + cz tan).
        let (tan_x, tan_y) = (tan_x * (1.0 - MARGIN), tan_y * (1.0 - MARGIN));
        let mut plus = [f64::NEG_INFINITY; 2];
        let mut minus = [f64::NEG_INFINITY; 2];
        for corner in 0..8 {
            let pick = |axis: usize| {
                let side = if corner >> axis & 1 == 0 { bounds.min } else { bounds.max };
                side[axis]
            };
            let corner = DVec3::new(pick(0), pick(1), pick(2));
            let depth = corner.dot(back);
            for (axis, (direction, tan)) in [(right, tan_x), (up, tan_y)].into_iter().enumerate() {
                let offset = corner.dot(direction);
                plus[axis] = plus[axis].max(offset + depth * tan);
                minus[axis] = minus[axis].max(-offset + depth * tan);
            }
        }
        let distance = |axis: usize, tan: f64| (plus[axis] + minus[axis]) / (2.0 * tan);
        // One point has no size; the camera then keeps a metre away.
        let centre = (bounds.min + bounds.max) / 2.0;
        let z = distance(0, tan_x)
            .max(distance(1, tan_y))
            .max(centre.dot(back) + 1e-3);
        let z = if bounds.min == bounds.max { z + 1.0 } else { z };
        let eye = right * ((plus[0] - minus[0]) / 2.0) + up * ((plus[1] - minus[1]) / 2.0) + back * z;
        Self {
            eye,
            target: eye - back * (z - centre.dot(back)),
            up: DVec3::Y,
            vertical_fov: VERTICAL_FOV,
        }
    }

    /// Axes and scales for a picture of this size; any nonsense in the camera is replaced.
    pub(super) fn view(&self, width: usize, height: usize) -> View {
        let finite = |v: DVec3, other: DVec3| if v.is_finite() { v } else { other };
        let eye = finite(self.eye, DVec3::new(0.0, 1.0, 3.0));
        let target = finite(self.target, DVec3::Y);
        let back = (eye - target).try_normalize().unwrap_or(DVec3::Z);
        // Looking along `up` leaves the roll open: any perpendicular direction will do.
        let right = finite(self.up, DVec3::Y)
            .cross(back)
            .try_normalize()
            .filter(|right| right.is_finite())
            .unwrap_or_else(|| DVec3::X.reject_from(back).try_normalize().unwrap_or(DVec3::Z));
        let fov = if self.vertical_fov.is_finite() { self.vertical_fov } else { 0.5 };
        let tan_y = (fov.clamp(1e-3, 3.0) / 2.0).tan();
        let distance = (eye - target).length();
        View {
            eye: eye.as_vec3(),
            right: right.as_vec3(),
            up: back.cross(right).as_vec3(),
            back: back.as_vec3(),
            tan_x: (tan_y * width as f64 / height as f64) as f32,
            tan_y: tan_y as f32,
            near: (distance * 1e-3).max(1e-4) as f32,
            target: target.as_vec3(),
        }
    }
}

/// A camera as orthonormal axes, for one picture size.
pub(super) struct View {
    pub eye: Vec3,
    pub target: Vec3,
    pub right: Vec3,
    pub up: Vec3,
    /// From the target to the eye.
    pub back: Vec3,
    /// Half the picture's width and height at distance 1.
    pub tan_x: f32,
    pub tan_y: f32,
    /// Distance of the plane in front of which nothing is drawn, metres.
    pub near: f32,
}

impl View {
    /// `x`, `y` from -w to +w across the picture, and `w`, the distance in front of the eye.
    pub fn clip(&self, world: Vec3) -> Vec3 {
        let offset = world - self.eye;
        Vec3::new(
            offset.dot(self.right) / self.tan_x,
            offset.dot(self.up) / self.tan_y,
            -offset.dot(self.back),
        )
    }

    /// Direction, with depth 1, through a point given as -1..1 from left to right, bottom to top.
    pub fn ray(&self, x: f32, y: f32) -> Vec3 {
        self.right * (x * self.tan_x) + self.up * (y * self.tan_y) - self.back
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clip_axes_match_the_picture() {
        let camera = Camera {
            eye: DVec3::new(0.0, 0.0, 5.0),
            target: DVec3::ZERO,
            up: DVec3::Y,
            vertical_fov: std::f64::consts::FRAC_PI_2,
        };
        let view = camera.view(200, 100);
        let clip = view.clip(Vec3::new(2.0, 1.0, 1.0));
        assert!((clip - Vec3::new(1.0, 1.0, 4.0)).length() < 1e-6);
        assert!((view.ray(1.0, -1.0) - Vec3::new(2.0, -1.0, -1.0)).length() < 1e-6);
    }

    #[test]
    fn framing_touches_the_margin_and_shows_every_corner() {
        let bounds = Bounds::of(&[[1.0, 0.0, -2.0], [1.6, 1.8, -1.5], [f32::NAN, 9.0, 9.0]]);
        for (yaw, pitch, aspect) in [(0.0, 0.0, 1.0), (0.7, 0.3, 1.8), (3.0, -1.5, 0.5)] {
            let camera = Camera::framing(bounds, yaw, pitch, aspect);
            let view = camera.view((aspect * 1000.0) as usize, 1000);
            let mut widest = 0f32;
            for corner in 0..8 {
                let pick = |bit: usize, lo, hi| if corner >> bit & 1 == 0 { lo } else { hi };
                let clip = view.clip(Vec3::new(
                    pick(0, 1.0, 1.6),
                    pick(1, 0.0, 1.8),
                    pick(2, -2.0, -1.5),
                ));
                assert!(clip.z > view.near);
                widest = widest.max((clip.x / clip.z).abs()).max((clip.y / clip.z).abs());
            }
            assert!((widest - 0.93).abs() < 1e-3, "{widest}");
        }
    }

    #[test]
    fn nonsense_gives_a_finite_view() {
        let camera = Camera::framing(Bounds::EMPTY, 0.0, 0.0, f64::NAN);
        assert!(camera.eye.is_finite() && camera.target.is_finite());
        for up in [DVec3::ZERO, DVec3::Z, DVec3::NAN] {
            let camera = Camera {
                eye: DVec3::Z,
                target: DVec3::ZERO,
                up,
                vertical_fov: f64::NAN,
            };
            let view = camera.view(10, 10);
            assert!((view.right.length() - 1.0).abs() < 1e-6);
            assert!((view.up.length() - 1.0).abs() < 1e-6);
        }
    }
}
