//! Pictures of an avatar in motion.

use std::path::Path;

use glam::DVec3;
use sinew_core::asset::Asset;

use crate::export::ExportError;
use crate::export::gif::write_gif;
use crate::export::png::{contact_sheet, write_png};
use crate::export::render::{Bounds, Camera, Colors, Image, Mesh, Quality, Rgb, Scene, render};
use crate::play::{Motion, Player, frame_times};

pub mod skeleton;

/// How to film.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// Width and height of a picture, pixels.
    pub size: usize,
    /// Frames a second.
    pub rate: f64,
    /// Radians from straight in front toward the body's left.
    pub yaw: f64,
    /// Radians above the horizon.
    pub pitch: f64,
}

impl Default for Shot {
    fn default() -> Self {
        Self {
            size: 360,
            rate: 30.0,
            yaw: 0.6,
            pitch: 0.12,
        }
    }
}

/// Pictures on a contact sheet.
const SHEET_PICTURES: usize = 12;
/// Pictures in a row of it.
const SHEET_COLUMNS: usize = 4;
const SKIN: Rgb = [208, 170, 148];

/// An asset, its motion and a camera that walks beside it.
#[derive(Debug)]
pub struct Film<'a> {
    asset: Asset<'a>,
    motion: &'a Motion,
    shot: Shot,
    triangles: Vec<[u32; 3]>,
    /// Frames the body as if it stayed where it is.
    camera: Camera,
    /// Where the body is, ten times a second, smoothed over a second; on the floor.
    path: Vec<DVec3>,
}

/// Places a second at which the body's way is known.
const PATH_RATE: f64 = 10.0;

impl<'a> Film<'a> {
    /// Plays the motion once to place the camera. O(frames x vertices)
    #[must_use]
    pub fn new(asset: Asset<'a>, motion: &'a Motion, shot: Shot) -> Self {
        let order = asset.source_order();
        let triangles = asset.triangles().iter();
        let triangles = triangles.map(|t| t.map(|at| order[at as usize])).collect();
        let mut player = Player::new(asset);
        let boxes: Vec<Bounds> = frame_times(motion.duration(), PATH_RATE)
            .into_iter()
            .map(|seconds| {
                motion.step(&mut player, seconds);
                Bounds::of(player.positions())
            })
            .collect();
        let floor = |at: DVec3| DVec3::new(at.x, 0.0, at.z);
        let centres: Vec<DVec3> = boxes.iter().map(|b| floor((b.min + b.max) / 2.0)).collect();
        let path = smooth(&centres, (PATH_RATE / 2.0) as usize);
        let mut bounds = Bounds::EMPTY;
        for (body, at) in boxes.iter().zip(&path) {
            bounds.include(body.min - *at);
            bounds.include(body.max - *at);
            // The floor under the body belongs into the picture.
            bounds.include(floor(body.min - *at));
        }
        let camera = Camera::framing(bounds, shot.yaw, shot.pitch, 1.0);
        Self {
            asset,
            motion,
            shot,
            triangles,
            camera,
            path,
        }
    }

    fn camera_at(&self, seconds: f64) -> Camera {
        let place = (seconds * PATH_RATE).clamp(0.0, (self.path.len() - 1) as f64);
        let (before, t) = (place as usize, place.fract());
        let after = (before + 1).min(self.path.len() - 1);
        let at = self.path[before].lerp(self.path[after], t);
        let Camera { eye, target, .. } = self.camera;
        Camera {
            eye: eye + at,
            target: target + at,
            ..self.camera
        }
    }

    /// Frames of the moving picture.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        frame_times(self.motion.duration(), self.shot.rate).len()
    }

    /// Writes an animated GIF and returns its frames. `progress` hears how many are drawn.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_gif(
        &self,
        path: &Path,
        progress: impl FnMut(usize),
    ) -> Result<usize, ExportError> {
        let times = frame_times(self.motion.duration(), self.shot.rate);
        let images = self.draw(&times, progress);
        write_gif(path, &images, 1.0 / self.shot.rate)?;
        Ok(images.len())
    }

    /// Writes a PNG of pictures spread over the motion and returns how many.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_sheet(
        &self,
        path: &Path,
        progress: impl FnMut(usize),
    ) -> Result<usize, ExportError> {
        let last = self.motion.duration();
        let count = if last > 0.0 { SHEET_PICTURES } else { 1 };
        let step = last / (count.max(2) - 1) as f64;
        let times: Vec<f64> = (0..count).map(|picture| picture as f64 * step).collect();
        let images = self.draw(&times, progress);
        let captions: Vec<String> = times.iter().map(|time| format!("{time:.2} s")).collect();
        let captions: Vec<&str> = captions.iter().map(String::as_str).collect();
        write_png(
            path,
            &contact_sheet(&images, SHEET_COLUMNS.min(count), &captions),
        )?;
        Ok(count)
    }

    fn draw(&self, times: &[f64], mut progress: impl FnMut(usize)) -> Vec<Image> {
        let mut player = Player::new(self.asset);
        let draw = |(done, &seconds): (usize, &f64)| {
            self.motion.step(&mut player, seconds);
            let scene = Scene {
                meshes: vec![Mesh {
                    positions: player.positions(),
                    normals: Some(player.normals()),
                    triangles: &self.triangles,
                    colors: Colors::Uniform(SKIN),
                }],
                ..Scene::default()
            };
            progress(done + 1);
            render(
                &scene,
                &self.camera_at(seconds),
                self.shot.size,
                self.shot.size,
                Quality::default(),
            )
        };
        times.iter().enumerate().map(draw).collect()
    }
}

/// Mean over `reach` neighbours on both sides, as far as there are as many on either.
fn smooth(points: &[DVec3], reach: usize) -> Vec<DVec3> {
    let last = points.len() - 1;
    let mean = |at: usize| {
        let reach = reach.min(at).min(last - at);
        let near = &points[at - reach..=at + reach];
        near.iter().sum::<DVec3>() / near.len() as f64
    };
    (0..points.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_way_is_not_changed_by_smoothing() {
        let way: Vec<DVec3> = (0..9).map(|x| DVec3::new(f64::from(x), 0.0, 2.0)).collect();
        for (a, b) in smooth(&way, 3).iter().zip(&way) {
            assert!(a.distance(*b) < 1e-12);
        }
    }
}
