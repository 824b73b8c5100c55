//! One normal and one texture coordinate a vertex, out of those that its corners choose.

use glam::DVec3;

use crate::import::{Notice, Place};

/// A corner of a face; indices from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub vertex: u32,
    pub texcoord: Option<u32>,
    pub normal: Option<u32>,
}

/// `[vertices]`: the coordinate that the vertex's first corner chooses, `[0, 0]` where none does;
/// `None` where no corner chooses any. O(corners).
pub(super) fn texcoords<'a>(
    corners: impl Iterator<Item = &'a Corner>,
    table: &[[f64; 2]],
    vertex_count: usize,
    notices: &mut Vec<Notice>,
) -> Option<Vec<[f64; 2]>> {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        Unset,
        Set,
        Several,
    }
    let mut chosen =
        vec![([0.0; 2], State::Unset); if table.is_empty() { 0 } else { vertex_count }];
    let mut any = false;
    for corner in corners {
        let Some(index) = corner.texcoord else {
            continue;
        };
        any = true;
        let value = table[index as usize];
        let (first, state) = &mut chosen[corner.vertex as usize];
        match state {
            State::Unset => (*first, *state) = (value, State::Set),
            State::Set if *first != value => *state = State::Several,
            State::Set | State::Several => {}
        }
    }
    if !any {
        return None;
    }
    let several = chosen.iter().filter(|c| c.1 == State::Several).count();
    if several > 0 {
        let text = format!(
            "{several} vertices have several texture coordinates (seams); the first of each is \
             used, because vertices are kept as they stand in the file"
        );
        notices.push(Notice::new(Place::File, text));
    }
    Some(chosen.into_iter().map(|(value, _)| value).collect())
}

/// Directions that differ by less than files round them: 0.03 degrees.
const SAME: f64 = 1.0 - 1e-7;

/// `[vertices]`, unit length: the normal that all corners of the vertex agree on, else the mean of
/// what its corners choose, weighted by the corners' angles (Thuermer and Wuethrich 1998). A
/// corner without a usable normal counts with its face's. `None` where no corner chooses any.
/// O(corners).
pub(super) fn normals<'a, P: Iterator<Item = &'a [Corner]>>(
    polygons: impl Fn() -> P,
    table: &[DVec3],
    positions: &[DVec3],
    notices: &mut Vec<Notice>,
) -> Option<Vec<DVec3>> {
    let table: Vec<Option<DVec3>> = table.iter().map(|normal| normal.try_normalize()).collect();
    let of_corner = |corner: &Corner| corner.normal.and_then(|index| table[index as usize]);
    let mut corners = polygons().flatten();
    corners.find(|corner| corner.normal.is_some())?;
    let mut normals: Vec<Option<DVec3>> = vec![None; positions.len()];
    let mut blended = vec![false; positions.len()];
    let mut without = 0_usize;
    for corner in polygons().flatten() {
        let vertex = corner.vertex as usize;
        match (of_corner(corner), normals[vertex]) {
            (None, _) => {
                without += 1;
                blended[vertex] = true;
            }
            (Some(normal), None) => normals[vertex] = Some(normal),
            (Some(normal), Some(first)) => blended[vertex] |= normal.dot(first) < SAME,
        }
    }
    let count = blended.iter().filter(|blended| **blended).count();
    if count > 0 {
        blend(polygons(), of_corner, positions, &blended, &mut normals);
        let text = format!(
            "{count} vertices have corners with different normals ({without} corners have none); \
             their mean, weighted by the corner angles, is used, because vertices are kept as \
             they stand in the file"
        );
        notices.push(Notice::new(Place::File, text));
    }
    // A vertex of no face still needs a direction; any unit vector serves.
    Some(normals.into_iter().map(|n| n.unwrap_or(DVec3::Y)).collect())
}

/// Replaces the normals of `blended` vertices by their mean.
fn blend<'a>(
    polygons: impl Iterator<Item = &'a [Corner]>,
    of_corner: impl Fn(&Corner) -> Option<DVec3>,
    positions: &[DVec3],
    blended: &[bool],
    normals: &mut [Option<DVec3>],
) {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for polygon in polygons {
        let at = |index: usize| positions[polygon[index % polygon.len()].vertex as usize];
        if !polygon.iter().any(|corner| blended[corner.vertex as usize]) {
            continue;
        }
        // Newell: also right for polygons that are not flat or not convex.
        let face: DVec3 = (0..polygon.len()).map(|i| at(i).cross(at(i + 1))).sum();
        let face = face.normalize_or_zero();
        for (index, corner) in polygon.iter().enumerate() {
            let here = at(index);
            let next = (at(index + 1) - here).normalize_or_zero();
            let before = (at(index + polygon.len() - 1) - here).normalize_or_zero();
            let angle = next.dot(before).clamp(-1.0, 1.0).acos();
            let normal = of_corner(corner).unwrap_or(face);
            sums[corner.vertex as usize] += normal * angle;
        }
    }
    for ((normal, sum), _) in normals
        .iter_mut()
        .zip(sums)
        .zip(blended)
        .filter(|(_, blended)| **blended)
    {
        // Opposite normals cancel; then the first one stays.
        *normal = sum.try_normalize().or(*normal);
    }
}
