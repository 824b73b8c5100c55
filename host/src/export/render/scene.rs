//! What there is to draw. All of it is borrowed.

use super::{Bounds, Rgb};

/// Colours of a mesh, of points or of lines.
///
/// A list that is too short is continued with grey.
#[derive(Clone, Copy, Debug)]
pub enum Colors<'a> {
    /// One for all.
    Uniform(Rgb),
    /// `[vertices]`, mixed across a triangle: heat maps. For points and lines, one each.
    PerVertex(&'a [Rgb]),
    /// `[triangles]`: parts. For points and lines, one each.
    PerTriangle(&'a [Rgb]),
}

impl Colors<'_> {
    /// The colour of item `index`.
    pub(super) fn of(&self, index: usize) -> Rgb {
        match self {
            Self::Uniform(color) => *color,
            Self::PerVertex(colors) | Self::PerTriangle(colors) => {
                colors.get(index).copied().unwrap_or([128; 3])
            }
        }
    }
}

/// A triangle mesh; both sides of its surface are drawn.
///
/// Triangles with an index out of range or a corner that is not finite are left out.
#[derive(Clone, Copy, Debug)]
pub struct Mesh<'a> {
    /// `[vertices]`, metres.
    pub positions: &'a [[f32; 3]],
    /// `[vertices]`, of any length; where absent, they are computed from the triangles.
    pub normals: Option<&'a [[f32; 3]]>,
    /// `[triangles]`, vertex indices; either winding.
    pub triangles: &'a [[u32; 3]],
    /// Surface colour.
    pub colors: Colors<'a>,
}

/// Markers, drawn as small balls.
#[derive(Clone, Copy, Debug)]
pub struct Points<'a> {
    /// `[points]`, metres; those that are not finite are left out.
    pub positions: &'a [[f32; 3]],
    /// Metres; never drawn thinner than about a pixel.
    pub radius: f32,
    /// One each, or one for all.
    pub colors: Colors<'a>,
    /// How strongly they show through the meshes in front of them: 0 not at all, 1 fully.
    pub occluded_opacity: f32,
}

/// Line segments with round ends: skeletons, ropes, trajectories.
#[derive(Clone, Copy, Debug)]
pub struct Lines<'a> {
    /// `[segments]`, both ends in metres; those that are not finite are left out.
    pub segments: &'a [[[f32; 3]; 2]],
    /// Half the thickness in metres; never drawn thinner than about a pixel.
    pub radius: f32,
    /// One each, or one for all.
    pub colors: Colors<'a>,
    /// How strongly they show through the meshes in front of them: 0 not at all, 1 fully.
    pub occluded_opacity: f32,
}

/// A horizontal floor with a metre grid, faded out with distance.
///
/// It hides what is below it, and does not show from below.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Floor {
    /// Its y, metres.
    pub height: f32,
}

/// Everything in one picture.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// Surfaces.
    pub meshes: Vec<Mesh<'a>>,
    /// Markers.
    pub points: Vec<Points<'a>>,
    /// Skeletons and trajectories.
    pub lines: Vec<Lines<'a>>,
    /// Absent for a plain background.
    pub floor: Option<Floor>,
    /// Direction toward the main light; by default it stands behind the camera's left shoulder.
    /// Set it when the camera circles and the light must not.
    pub key_light: Option<[f32; 3]>,
}

impl Default for Scene<'_> {
    /// An empty floor at y = 0.
    fn default() -> Self {
        Self {
            meshes: Vec::new(),
            points: Vec::new(),
            lines: Vec::new(),
            floor: Some(Floor::default()),
            key_light: None,
        }
    }
}

impl Scene<'_> {
    /// The box around everything but the floor.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let meshes = self.meshes.iter().map(|mesh| Bounds::of(mesh.positions));
        let points = self.points.iter().map(|points| Bounds::of(points.positions));
        let lines = self.lines.iter();
        let lines = lines.map(|lines| Bounds::of(lines.segments.as_flattened()));
        meshes.chain(points).chain(lines).fold(Bounds::EMPTY, Bounds::union)
    }
}

/// How many samples a pixel takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// One: jagged, for quick looks.
    Draft,
    /// Four, for animations.
    #[default]
    Good,
    /// Sixteen, for stills.
    Best,
}

impl Quality {
    /// Samples along one side of a pixel.
    pub(super) fn side(self) -> usize {
        match self {
            Self::Draft => 1,
            Self::Good => 2,
            Self::Best => 4,
        }
    }
}
