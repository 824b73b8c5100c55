//! The truth: a body that moves, bulges, breathes and jiggles, one surface a frame.

use glam::{DAffine3, DVec3};

use super::StudioError;
use super::error::within;
use super::flesh::{Flesh, FleshOptions};
use super::performance::{Direction, Performance};
use crate::model::{Avatar, Clip};
use crate::spatial::weld;

/// Most frames of a capture.
const MOST_FRAMES: f64 = 1_000_000.0;

/// What is filmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scene {
    /// Frames a second.
    pub rate: f64,
    /// How the clip is performed.
    pub direction: Direction,
    /// The flesh on the bones.
    pub flesh: FleshOptions,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            rate: 120.0,
            direction: Direction::default(),
            flesh: FleshOptions::default(),
        }
    }
}

/// A surface in one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// `[vertices]`, metres, the mesh's order.
    pub positions: Vec<DVec3>,
    /// `[vertices]`, unit length, of this surface.
    pub normals: Vec<DVec3>,
}

/// A moving body whose surface in any frame is known.
#[derive(Clone, Debug)]
pub struct Body<'a> {
    avatar: &'a Avatar,
    scene: Scene,
    performance: Performance<'a>,
    flesh: Flesh,
    /// `[frames x modes]`
    amplitudes: Vec<f64>,
    frame_count: usize,
    /// `[vertices]`: the first vertex in the same place, so that seams do not split normals.
    welded: Vec<u32>,
}

impl<'a> Body<'a> {
    /// A body that performs a clip of its own skeleton. O(frames x joints)
    ///
    /// # Errors
    /// A clip for another skeleton, a mesh without triangles, a setting out of its range.
    pub fn new(avatar: &'a Avatar, clip: &Clip, scene: Scene) -> Result<Self, StudioError> {
        within("rate", scene.rate, 1.0, 10_000.0, "between 1 and 10,000 Hz")?;
        if avatar.mesh.triangles.is_empty() {
            return Err(StudioError::NoSurface {
                name: avatar.mesh.name.clone(),
            });
        }
        let performance = Performance::new(avatar, clip, scene.direction)?;
        let duration = performance.duration();
        within(
            "frames",
            duration * scene.rate,
            0.0,
            MOST_FRAMES,
            "at most 1,000,000",
        )?;
        let frame_count = crate::play::frame_times(duration, scene.rate).len();
        let flesh = Flesh::new(avatar, scene.flesh)?;
        let amplitudes = flesh.amplitudes(&performance, scene.rate, frame_count);
        Ok(Self {
            avatar,
            scene,
            performance,
            flesh,
            amplitudes,
            frame_count,
            welded: weld(&avatar.mesh.positions),
        })
    }

    /// Whose body it is.
    #[must_use]
    pub fn avatar(&self) -> &'a Avatar {
        self.avatar
    }

    /// What was asked for.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The motion.
    #[must_use]
    pub fn performance(&self) -> &Performance<'a> {
        &self.performance
    }

    /// The flesh, with its modes.
    #[must_use]
    pub fn flesh(&self) -> &Flesh {
        &self.flesh
    }

    /// How many frames there are, at [`Scene::rate`].
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.frame_count
    }

    /// The time of a frame, seconds.
    #[must_use]
    pub fn seconds(&self, frame: usize) -> f64 {
        frame as f64 / self.scene.rate
    }

    /// Amplitudes `[modes]` of the flesh in a frame, metres.
    ///
    /// # Panics
    /// If there is no such frame.
    #[must_use]
    pub fn amplitudes(&self, frame: usize) -> &[f64] {
        let width = self.flesh.modes().len();
        assert!(frame < self.frame_count, "no such frame");
        &self.amplitudes[frame * width..(frame + 1) * width]
    }

    /// Model-space matrices `[joints]` in a frame, metres. O(joints)
    #[must_use]
    pub fn pose(&self, frame: usize) -> Vec<DAffine3> {
        self.performance.pose(self.seconds(frame))
    }

    /// The true surface in a frame: `v = sum_i w_i M_i D_i^-1 (v_d + offset)`. O(vertices)
    ///
    /// # Panics
    /// If there is no such frame.
    #[must_use]
    pub fn surface(&self, frame: usize) -> Surface {
        let mut surface = Surface::default();
        self.surface_into(frame, &mut surface);
        surface
    }

    /// [`Self::surface`] into memory that is there already; its old contents do not matter.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn surface_into(&self, frame: usize, surface: &mut Surface) {
        self.flesh
            .offsets(self.amplitudes(frame), &mut surface.positions);
        self.skin(frame, surface);
    }

    /// The surface of the bones alone: the same pose without bulge, breath and jiggle.
    ///
    /// # Panics
    /// If there is no such frame.
    #[must_use]
    pub fn skeleton_surface(&self, frame: usize) -> Surface {
        assert!(frame < self.frame_count, "no such frame");
        let mut surface = Surface {
            positions: vec![DVec3::ZERO; self.avatar.mesh.positions.len()],
            normals: Vec::new(),
        };
        self.skin(frame, &mut surface);
        surface
    }

    /// Takes offsets, leaves positions and normals.
    fn skin(&self, frame: usize, surface: &mut Surface) {
        let pose = self.pose(frame);
        let skin = &self.avatar.skin;
        let palette: Vec<DAffine3> = skin
            .binds
            .iter()
            .map(|bind| pose[bind.joint] * bind.inverse_bind)
            .collect();
        let vertices = self.avatar.mesh.positions.iter().zip(&skin.influences);
        for (point, (&rest, influences)) in surface.positions.iter_mut().zip(vertices) {
            let displaced = rest + *point;
            *point = influences
                .iter()
                .map(|&(bind, weight)| weight * palette[bind as usize].transform_point3(displaced))
                .sum();
        }
        self.normals(surface);
    }

    /// Normals of the moved triangles, each weighted by its area.
    fn normals(&self, surface: &mut Surface) {
        let Surface { positions, normals } = surface;
        normals.clear();
        normals.resize(positions.len(), DVec3::ZERO);
        for triangle in &self.avatar.mesh.triangles {
            let [a, b, c] = triangle.map(|at| positions[at as usize]);
            let normal = (b - a).cross(c - a);
            for &at in triangle {
                normals[self.welded[at as usize] as usize] += normal;
            }
        }
        for vertex in 0..normals.len() {
            // The first of those in one place stands before the others: it is ready by then.
            let first = self.welded[vertex] as usize;
            normals[vertex] = if first == vertex {
                normals[vertex].normalize_or(self.avatar.mesh.normals[vertex])
            } else {
                normals[first]
            };
        }
    }
}
