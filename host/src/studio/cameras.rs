//! The cameras around the actor.
//!
//! Pinhole cameras without lens distortion, in a ring around a small volume, some of them low and
//! looking up (Park & Hodgins 2006, section 4, figure 2a: twelve of 4 megapixels, two of them low).

use glam::{DVec2, DVec3};

use super::StudioError;
use super::error::within;

/// Most cameras; a sample holds one bit for each.
pub const MOST_CAMERAS: usize = 32;

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Its centre, metres.
    pub position: DVec3,
    /// Unit vectors: right and up in the picture, and along the optical axis.
    pub axes: [DVec3; 3],
    /// Width and height, pixels.
    pub resolution: [u32; 2],
    /// Focal length, pixels.
    pub focal: f64,
}

impl Camera {
    /// A camera at `position` that looks at `target`, upright, with the horizontal opening angle
    /// `field` (radians).
    #[must_use]
    pub fn look_at(position: DVec3, target: DVec3, resolution: [u32; 2], field: f64) -> Self {
        let forward = (target - position).try_normalize().unwrap_or(DVec3::NEG_Z);
        // Straight up or down leaves the roll open.
        let right = forward.cross(DVec3::Y).try_normalize().unwrap_or(DVec3::X);
        Self {
            position,
            axes: [right, right.cross(forward), forward],
            resolution,
            focal: f64::from(resolution[0]) / 2.0 / (field / 2.0).tan(),
        }
    }

    /// Column and row of a point in the picture, pixels from its upper left corner; `None` behind
    /// the camera or beside the picture.
    #[must_use]
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        let offset = point - self.position;
        let [x, y, z] = self.axes.map(|axis| offset.dot(axis));
        let [width, height] = self.resolution.map(f64::from);
        let pixel = DVec2::new(
            width / 2.0 + self.focal * x / z,
            height / 2.0 - self.focal * y / z,
        );
        let inside = z > 0.0 && (0.0..width).contains(&pixel.x) && (0.0..height).contains(&pixel.y);
        inside.then_some(pixel)
    }

    /// Unit vector from the camera through a pixel.
    #[must_use]
    pub fn ray(&self, pixel: DVec2) -> DVec3 {
        let [width, height] = self.resolution.map(f64::from);
        let [right, up, forward] = self.axes;
        (forward * self.focal + right * (pixel.x - width / 2.0) + up * (height / 2.0 - pixel.y))
            .normalize()
    }
}

/// Cameras in a ring around a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// All cameras, 2 to 32.
    pub camera_count: usize,
    /// How many of them stand low and look up.
    pub low_count: usize,
    /// Middle of the volume on the floor, metres.
    pub centre: DVec3,
    /// From the middle to the cameras, metres.
    pub radius: f64,
    /// Height of the volume, metres.
    pub height: f64,
    /// Pixels.
    pub resolution: [u32; 2],
    /// Horizontal opening angle, radians.
    pub field: f64,
}

impl Default for Ring {
    /// Twelve cameras of 4 megapixels, two of them low, around 2 m by 2 m by 2.5 m.
    fn default() -> Self {
        Self {
            camera_count: 12,
            low_count: 2,
            centre: DVec3::ZERO,
            radius: 2.6,
            height: 2.5,
            resolution: [2352, 1728],
            field: 62f64.to_radians(),
        }
    }
}

impl Ring {
    /// Further out where the actor goes further than a metre from the middle.
    #[must_use]
    pub fn reaching(self, reach: f64) -> Self {
        Self {
            radius: self.radius + (reach - 0.8).max(0.0),
            ..self
        }
    }

    /// The cameras: the high ones evenly around, by turns at three heights, the low ones in front
    /// and behind (evenly from there on).
    ///
    /// # Errors
    /// A number that is out of its range.
    pub fn cameras(&self) -> Result<Vec<Camera>, StudioError> {
        let count = self.camera_count as f64;
        within(
            "cameras",
            count,
            2.0,
            MOST_CAMERAS as f64,
            "between 2 and 32",
        )?;
        within(
            "low cameras",
            self.low_count as f64,
            0.0,
            count,
            "at most the cameras",
        )?;
        within(
            "camera radius",
            self.radius,
            0.5,
            100.0,
            "between 0.5 and 100 m",
        )?;
        within(
            "volume height",
            self.height,
            0.1,
            100.0,
            "between 0.1 and 100 m",
        )?;
        within(
            "field of view",
            self.field,
            0.05,
            2.6,
            "between 0.05 and 2.6 rad",
        )?;
        for side in self.resolution {
            within(
                "resolution",
                f64::from(side),
                16.0,
                65_536.0,
                "between 16 and 65536 pixels",
            )?;
        }
        within("centre", self.centre.length(), 0.0, 1e6, "a finite point")?;
        // Floor cameras first see what faces down: half a metre up, aimed at the chest. The others
        // are aimed at the middle of a standing body.
        let high_count = self.camera_count - self.low_count;
        let high = (0..high_count).map(|index| {
            let turn = (index as f64 + 0.5) / high_count as f64;
            let height = self.height * [0.98, 0.62, 0.8][index % 3];
            (turn, height, 0.38 * self.height)
        });
        let low = (0..self.low_count).map(|index| {
            let turn = index as f64 / self.low_count as f64;
            (turn, 0.12 * self.height, 0.44 * self.height)
        });
        let cameras = high.chain(low).map(|(turn, height, aim)| {
            let (sin, cos) = (turn * std::f64::consts::TAU).sin_cos();
            let position = self.centre + DVec3::new(self.radius * sin, height, self.radius * cos);
            let target = self.centre + DVec3::Y * aim;
            Camera::look_at(position, target, self.resolution, self.field)
        });
        Ok(cameras.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_projects_where_similar_triangles_say() {
        // 90 degrees across 200 pixels: focal length 100 pixels.
        let field = std::f64::consts::FRAC_PI_2;
        let camera = Camera::look_at(DVec3::new(0.0, 1.0, 5.0), DVec3::Y, [200, 100], field);
        assert!((camera.focal - 100.0).abs() < 1e-9);
        // 1 m right and 0.5 m up at a distance of 4 m: 25 and 12.5 pixels.
        let pixel = camera.project(DVec3::new(1.0, 1.5, 1.0)).unwrap();
        assert!((pixel - DVec2::new(125.0, 37.5)).length() < 1e-9, "{pixel}");
        assert_eq!(camera.project(DVec3::new(0.0, 1.0, 6.0)), None, "behind");
        assert_eq!(camera.project(DVec3::new(5.0, 1.0, 1.0)), None, "beside");
        let back = camera.position + camera.ray(pixel) * (17.25f64).sqrt();
        assert!((back - DVec3::new(1.0, 1.5, 1.0)).length() < 1e-9);
    }

    #[test]
    fn the_ring_sees_the_volume_and_two_look_up() {
        let cameras = Ring::default().cameras().unwrap();
        assert_eq!(cameras.len(), 12);
        let up: Vec<_> = cameras
            .iter()
            .filter(|camera| camera.axes[2].y > 0.0)
            .collect();
        assert_eq!(up.len(), 2);
        assert!(up.iter().all(|camera| camera.position.y < 0.5));
        for camera in &cameras {
            let seen = |point| camera.project(point).is_some();
            assert!(seen(DVec3::new(0.0, 0.05, 0.0)) && seen(DVec3::new(0.0, 1.75, 0.0)));
        }
    }

    #[test]
    fn impossible_rings_are_refused() {
        let refuse = |ring: Ring| ring.cameras().unwrap_err().to_string();
        let text = refuse(Ring {
            camera_count: 1,
            ..Ring::default()
        });
        assert_eq!(text, "cameras is 1; it must be between 2 and 32");
        refuse(Ring {
            low_count: 13,
            ..Ring::default()
        });
        refuse(Ring {
            radius: f64::NAN,
            ..Ring::default()
        });
        refuse(Ring {
            field: 3.2,
            ..Ring::default()
        });
        refuse(Ring {
            resolution: [0, 10],
            ..Ring::default()
        });
        refuse(Ring {
            centre: DVec3::INFINITY,
            ..Ring::default()
        });
    }
}
