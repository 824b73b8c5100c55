//! A body that was cut into rigid parts, joined into one skin (Mažrimas & Beinaravičius, sections 7.1
//! and 8.1).
//!
//! In: a mesh whose parts (OBJ groups) have gaps between them. Out: one mesh, a joint in the middle of
//! every gap, weights that blend across it.
//!
//! 1. [`borders`]: open edges become loops; every stretch of a loop knows which other part's border it
//!    faces.
//! 2. [`bridge`]: facing stretches are joined by rows of triangles; what stays open where three parts
//!    meet is filled.
//! 3. `hierarchy`: parts that were joined hang on each other, from the hips outward; a part's joint
//!    stands in the gap above it and bears the part's name, so that motion finds it by name.
//! 4. Every vertex belongs to its part's joint; memberships spread as automatic weights do.

pub mod borders;
pub mod bridge;
mod error;
mod hierarchy;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use glam::DVec3;

use super::inside::{CELLS, Inside};
use super::weights::{WeightOptions, WeightsError, weigh_members};
use crate::model::{Avatar, Mesh, Part, vertex_normals};
use crate::spatial::{face_outward, weld};
use borders::{Face, facing, loops};
use bridge::{Patch, fill, join_faces};
pub use error::JoinError;

/// How to join.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JoinOptions {
    /// The widest gap that is bridged, metres; by default as wide as its border's radius.
    pub gap: Option<f64>,
    /// How weights are found.
    pub weights: WeightOptions,
}

/// What was joined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JoinReport {
    /// Pairs of parts with the width of the gap between them, metres, the widest first.
    pub gaps: Vec<Gap>,
    /// Triangles put in.
    pub added: usize,
    /// Holes between three and more parts that were filled.
    pub corners: usize,
    /// Borders that face no other part: number of edges and middle of each.
    pub open: Vec<(usize, DVec3)>,
    /// Parts that touch no other one and hang on the nearest.
    pub attached: Vec<usize>,
}

/// A bridged gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// The parts on both sides.
    pub parts: [usize; 2],
    /// Mean distance between the borders, metres.
    pub width: f64,
    /// Length of the border, metres.
    pub length: f64,
    /// Middle of both borders.
    pub centre: DVec3,
}

/// The parts as one surface.
#[derive(Clone, Debug, Default)]
pub struct Shell {
    /// Metres; vertices in one place are one.
    pub positions: Vec<DVec3>,
    /// Facing outward.
    pub triangles: Vec<[u32; 3]>,
    /// `[vertices]`: the part that each belongs to.
    pub part_of: Vec<u32>,
    /// `[triangles]`: the part that each belongs to.
    pub part_of_triangle: Vec<u32>,
}

impl Shell {
    fn new(mesh: &Mesh) -> Self {
        let first = weld(&mesh.positions);
        let faces = face_outward(&mesh.positions, &mesh.triangles, &first);
        let mut number: BTreeMap<u32, u32> = BTreeMap::new();
        let mut shell = Self::default();
        for (part, range) in mesh.parts.iter().enumerate() {
            for corners in &faces[range.triangles.clone()] {
                let [a, b, c] = *corners;
                if a == b || b == c || c == a {
                    continue;
                }
                let corners = corners.map(|vertex| {
                    *number.entry(vertex).or_insert_with(|| {
                        shell.positions.push(mesh.positions[vertex as usize]);
                        shell.part_of.push(part as u32);
                        shell.positions.len() as u32 - 1
                    })
                });
                shell.triangles.push(corners);
                shell.part_of_triangle.push(part as u32);
            }
        }
        shell
    }

    fn add(&mut self, patch: Patch) {
        self.positions.extend(patch.positions);
        self.part_of.extend(patch.part_of);
        for corners in patch.triangles {
            self.part_of_triangle
                .push(self.part_of[corners[0] as usize]);
            self.triangles.push(corners);
        }
    }
}

/// Joins the parts of a mesh into one body with a joint a part, in the pose in which it is cut.
/// O(border vertices^2 + cells log cells)
///
/// # Errors
/// [`JoinError`]: fewer than two parts, two parts of one name, parts without any border that faces
/// another; what [`weigh_members`] refuses.
pub fn join(mesh: &Mesh, options: &JoinOptions) -> Result<(Avatar, JoinReport), JoinError> {
    check(mesh)?;
    let mut shell = Shell::new(mesh);
    let mut report = JoinReport::default();
    let before = shell.triangles.len();
    let borders = loops(&shell);
    let faces = facing(&shell, &borders, options.gap);
    let mut gaps: BTreeMap<[u32; 2], Vec<&Face>> = BTreeMap::new();
    for face in &faces {
        gaps.entry(face.parts()).or_default().push(face);
    }
    report.gaps = gaps.values().map(|faces| gap(&shell, faces)).collect();
    report.gaps.extend(hierarchy::touching(&shell));
    if report.gaps.is_empty() {
        let open = borders.len();
        return Err(JoinError::NothingFaces { open });
    }
    report.gaps.sort_by(|a, b| b.width.total_cmp(&a.width));
    let bridged = join_faces(&mut shell, &faces);
    for border in loops(&shell) {
        if border.edges().any(|edge| bridged.contains(&edge)) {
            let patch = fill(&shell, &border);
            shell.add(patch);
            report.corners += 1;
        } else {
            report
                .open
                .push((border.vertices.len(), border.centre(&shell)));
        }
    }
    report.added = shell.triangles.len() - before;
    let names: Vec<&str> = mesh.parts.iter().map(|part| part.name.as_str()).collect();
    let (skeleton, joint_of, attached) = hierarchy::skeleton(&shell, &names, &report.gaps);
    report.attached = attached;

    let joined = one_mesh(mesh, &shell);
    let members: Vec<u32> = shell
        .part_of
        .iter()
        .map(|&part| joint_of[part as usize])
        .collect();
    let inside = Inside::new(&joined, CELLS).map_err(|_| WeightsError::NoSurface)?;
    let weighed = weigh_members(&joined, &inside, &skeleton, &members, &options.weights)?;
    let body = Avatar {
        mesh: joined,
        skeleton,
        skin: weighed.skin,
        clips: Vec::new(),
    };
    Ok((body, report))
}

fn check(mesh: &Mesh) -> Result<(), JoinError> {
    let parts = mesh.parts.iter().filter(|part| !part.triangles.is_empty());
    let count = parts.count();
    if count < 2 {
        return Err(JoinError::TooFewParts { count });
    }
    let mut names: Vec<&str> = mesh.parts.iter().map(|part| part.name.as_str()).collect();
    names.sort_unstable();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(JoinError::SameName {
            name: pair[0].to_owned(),
        }),
        None => Ok(()),
    }
}

fn gap(shell: &Shell, faces: &[&Face]) -> Gap {
    let mut sum = DVec3::ZERO;
    let (mut count, mut width, mut length) = (0.0, 0.0, 0.0);
    for face in faces {
        let sides = face.sides.each_ref().map(|side| {
            side.iter()
                .map(|&v| shell.positions[v as usize])
                .collect::<Vec<DVec3>>()
        });
        for (own, other) in [(&sides[0], &sides[1]), (&sides[1], &sides[0])] {
            length += own
                .windows(2)
                .map(|pair| pair[0].distance(pair[1]))
                .sum::<f64>()
                / 2.0;
            for &at in own {
                let near = other
                    .iter()
                    .map(|o| o.distance(at))
                    .fold(f64::INFINITY, f64::min);
                width += near;
            }
            // Both borders count the same, however many vertices each has.
            // A closed side ends with the vertex that it begins with.
            let once = &own[usize::from(face.is_closed())..];
            sum += once.iter().sum::<DVec3>() / once.len() as f64;
            count += own.len() as f64;
        }
    }
    Gap {
        parts: faces[0].parts().map(|part| part as usize),
        width: width / count,
        length,
        centre: sum / (2 * faces.len()) as f64,
    }
}

/// Triangles by part, as they were named.
fn one_mesh(mesh: &Mesh, shell: &Shell) -> Mesh {
    let mut triangles = Vec::with_capacity(shell.triangles.len());
    let mut parts = Vec::with_capacity(mesh.parts.len());
    for (at, part) in mesh.parts.iter().enumerate() {
        let first = triangles.len();
        let own = shell.triangles.iter().zip(&shell.part_of_triangle);
        triangles.extend(
            own.filter(|(_, of)| **of as usize == at)
                .map(|(corners, _)| *corners),
        );
        parts.push(Part {
            name: part.name.clone(),
            triangles: first..triangles.len(),
        });
    }
    Mesh {
        name: mesh.name.clone(),
        normals: vertex_normals(&shell.positions, &triangles),
        positions: shell.positions.clone(),
        tangents: None,
        texcoords: None,
        triangles,
        parts,
        morphs: Vec::new(),
    }
}
