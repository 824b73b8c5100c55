//! Checks vertices, triangulates polygons, finds missing normals and normalises weights.

use glam::DVec3;

use super::{Bind, Mesh, Morph, Part, Skin, bad_index, not_finite};
use crate::import::{
    ImportError, ImportErrorKind, Notice, Place, RawMesh, RawMorph, RawPrimitive, RawSkin,
};

/// More influences than this never help and would let one vertex stall a frame.
pub const MAX_INFLUENCES: usize = 16;

/// O(corners).
pub(super) fn check(
    raw: RawMesh,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<Mesh, ImportError> {
    let whole = || Place::Item(format!("mesh {:?}", raw.name));
    let count = raw.positions.len();
    if count == 0 {
        let what = "every vertex".to_owned();
        return Err(ImportErrorKind::Missing { what }.at(file, whole()));
    }
    if count > u32::MAX as usize / 2 {
        let kind = ImportErrorKind::TooMany {
            what: "vertices".into(),
            count: count as u64,
            limit: u64::from(u32::MAX / 2),
        };
        return Err(kind.at(file, whole()));
    }
    if let Some(vertex) = raw.positions.iter().position(|p| !p.is_finite()) {
        return Err(not_finite(format!("the position of vertex {vertex}")).at(file, whole()));
    }
    let lengths = [
        ("normals", raw.normals.as_ref().map(Vec::len)),
        ("tangents", raw.tangents.as_ref().map(Vec::len)),
        ("texture coordinates", raw.texcoords.as_ref().map(Vec::len)),
    ];
    for (what, length) in lengths {
        if length.is_some_and(|length| length != count) {
            let what = format!("{} {what} for {count} vertices", length.unwrap_or(0));
            return Err(ImportErrorKind::Contradiction { what }.at(file, whole()));
        }
    }
    let mut triangles = Vec::new();
    let mut parts = Vec::with_capacity(raw.primitives.len());
    for primitive in &raw.primitives {
        let start = triangles.len();
        triangulate(primitive, &raw.positions, &mut triangles)
            .map_err(|kind| kind.at(file, Place::Item(format!("part {:?}", primitive.name))))?;
        parts.push(Part {
            name: primitive.name.clone(),
            triangles: start..triangles.len(),
        });
    }
    let computed = || vertex_normals(&raw.positions, &triangles);
    let normals = match raw.normals {
        Some(stated) => repair_normals(stated, computed, &raw.name, notices),
        None => {
            let place = Place::Item(format!("mesh {:?}", raw.name));
            notices.push(Notice::new(
                place,
                "has no normals; computed from its triangles",
            ));
            computed()
        }
    };
    let mut morphs = Vec::with_capacity(raw.morphs.len());
    for morph in raw.morphs {
        let place = Place::Item(format!("morph target {:?}", morph.name));
        morphs.push(check_morph(morph, count).map_err(|kind| kind.at(file, place))?);
    }
    Ok(Mesh {
        name: raw.name,
        positions: raw.positions,
        normals,
        tangents: raw.tangents,
        texcoords: raw.texcoords,
        triangles,
        parts,
        morphs,
    })
}

fn check_morph(raw: RawMorph, count: usize) -> Result<Morph, ImportErrorKind> {
    if raw.positions.len() != count || !(raw.normals.is_empty() || raw.normals.len() == count) {
        let (positions, normals) = (raw.positions.len(), raw.normals.len());
        return Err(ImportErrorKind::Contradiction {
            what: format!("{positions} positions and {normals} normals for {count} vertices"),
        });
    }
    let finite = |values: &[DVec3]| values.iter().all(|value| value.is_finite());
    if !(finite(&raw.positions) && finite(&raw.normals) && raw.rest_weight.is_finite()) {
        return Err(not_finite("an offset or the weight"));
    }
    Ok(Morph {
        name: raw.name,
        positions: raw.positions,
        normals: raw.normals,
        rest_weight: raw.rest_weight,
    })
}

/// Quads along the shorter diagonal, larger polygons as fans.
fn triangulate(
    primitive: &RawPrimitive,
    positions: &[DVec3],
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), ImportErrorKind> {
    let count = positions.len();
    if let Some(&corner) = primitive.corners.iter().find(|&&c| c as usize >= count) {
        return Err(bad_index("vertex", corner as usize, count));
    }
    let mut rest = primitive.corners.as_slice();
    for &size in &primitive.polygon_sizes {
        let polygon = rest.split_off(..size as usize).filter(|p| p.len() >= 3);
        let Some(polygon) = polygon else {
            return Err(ImportErrorKind::Contradiction {
                what: format!("a polygon of {size} corners with {} left", rest.len()),
            });
        };
        let at = |corner: usize| positions[polygon[corner] as usize];
        if let &[a, b, c, d] = polygon
            && at(1).distance_squared(at(3)) < at(0).distance_squared(at(2))
        {
            triangles.extend([[a, b, d], [b, c, d]]);
        } else {
            let fan = polygon[1..].windows(2);
            triangles.extend(fan.map(|pair| [polygon[0], pair[0], pair[1]]));
        }
    }
    if rest.is_empty() {
        Ok(())
    } else {
        Err(ImportErrorKind::Contradiction {
            what: format!("{} corners belong to no polygon", rest.len()),
        })
    }
}

/// Vertex normals from triangles, each weighted by its angle at the vertex. O(triangles).
#[must_use]
pub fn vertex_normals(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let corner = triangle.map(|index| positions[index as usize]);
        let Some(face) = (corner[1] - corner[0])
            .cross(corner[2] - corner[0])
            .try_normalize()
        else {
            continue;
        };
        for at in 0..3 {
            let one = corner[(at + 1) % 3] - corner[at];
            let two = corner[(at + 2) % 3] - corner[at];
            normals[triangle[at] as usize] += face * one.angle_between(two);
        }
    }
    // A vertex of no triangle still needs a direction; any unit vector serves.
    normals
        .into_iter()
        .map(|normal| normal.normalize_or(DVec3::Y))
        .collect()
}

fn repair_normals(
    stated: Vec<DVec3>,
    computed: impl Fn() -> Vec<DVec3>,
    mesh: &str,
    notices: &mut Vec<Notice>,
) -> Vec<DVec3> {
    let usable = |normal: &DVec3| normal.is_finite() && normal.length_squared() > 1e-12;
    let broken = stated.iter().filter(|normal| !usable(normal)).count();
    if broken == 0 {
        return stated.into_iter().map(DVec3::normalize).collect();
    }
    let place = Place::Item(format!("mesh {mesh:?}"));
    let text = format!("{broken} normals are zero or not finite; computed from the triangles");
    notices.push(Notice::new(place, text));
    let stated = stated.into_iter().zip(computed());
    stated
        .map(|(normal, computed)| {
            if usable(&normal) {
                normal.normalize()
            } else {
                computed
            }
        })
        .collect()
}

/// `order` maps raw joint indices to the skeleton's. O(influences), plus O(vertices) for each
/// vertex without a weight.
pub(super) fn check_skin(
    raw: RawSkin,
    mesh: &Mesh,
    order: &[usize],
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<Skin, ImportError> {
    let at = |item: String| Place::Item(item);
    let vertex_count = mesh.positions.len();
    if raw.joints.len() != raw.inverse_bind.len() || raw.influences.len() != vertex_count {
        let what = format!(
            "{} joints, {} inverse bind matrices; {} weighted vertices of {vertex_count}",
            raw.joints.len(),
            raw.inverse_bind.len(),
            raw.influences.len()
        );
        return Err(ImportErrorKind::Contradiction { what }.at(file, at("skin".into())));
    }
    let mut binds = Vec::with_capacity(raw.joints.len());
    for (bind, (&joint, &inverse_bind)) in raw.joints.iter().zip(&raw.inverse_bind).enumerate() {
        let place = || at(format!("skin, joint {bind}"));
        if !inverse_bind.is_finite() {
            return Err(not_finite("the inverse bind matrix").at(file, place()));
        }
        let joint = *order
            .get(joint)
            .ok_or_else(|| bad_index("joint", joint, order.len()).at(file, place()))?;
        binds.push(Bind {
            joint,
            inverse_bind,
        });
    }
    let mut facts = WeightFacts::default();
    let mut influences = Vec::with_capacity(vertex_count);
    for (vertex, raw) in raw.influences.into_iter().enumerate() {
        let checked = check_influences(raw, binds.len(), &mut facts)
            .map_err(|kind| kind.at(file, at(format!("skin, vertex {vertex}"))))?;
        influences.push(checked);
    }
    adopt_weights(&mut influences, mesh, &mut facts)
        .map_err(|kind| kind.at(file, at("skin".into())))?;
    facts.say(notices);
    let mut used = vec![false; binds.len()];
    for &(bind, _) in influences.iter().flatten() {
        used[bind as usize] = true;
    }
    let idle = used.iter().filter(|&&used| !used).count();
    if idle > 0 {
        let text = format!("{idle} of {} skin joints move no vertex", binds.len());
        notices.push(Notice::new(at("skin".into()), text));
    }
    Ok(Skin { binds, influences })
}

#[derive(Default)]
struct WeightFacts {
    normalised: usize,
    worst_sum: f64,
    dropped: usize,
    adopted: usize,
}

impl WeightFacts {
    fn say(&self, notices: &mut Vec<Notice>) {
        let mut say = |text: String| notices.push(Notice::new(Place::Item("skin".into()), text));
        if self.normalised > 0 {
            let (count, sum) = (self.normalised, self.worst_sum);
            say(format!(
                "weights of {count} vertices do not sum to 1 (worst {sum:.4}); normalised"
            ));
        }
        if self.dropped > 0 {
            let count = self.dropped;
            say(format!(
                "{count} vertices have over {MAX_INFLUENCES} influences; the heaviest are kept"
            ));
        }
        if self.adopted > 0 {
            let count = self.adopted;
            say(format!(
                "{count} vertices have no weight; each takes those of the nearest vertex that has"
            ));
        }
    }
}

/// Heaviest first, at most [`MAX_INFLUENCES`], summing to one; empty where nothing pulls.
fn check_influences(
    raw: Vec<(u32, f64)>,
    bind_count: usize,
    facts: &mut WeightFacts,
) -> Result<Vec<(u32, f64)>, ImportErrorKind> {
    let mut merged: Vec<(u32, f64)> = Vec::with_capacity(raw.len());
    for (bind, weight) in raw {
        if !weight.is_finite() {
            return Err(not_finite("a weight"));
        }
        if weight < 0.0 {
            return Err(ImportErrorKind::OutOfRange {
                what: "a weight".into(),
                value: weight.to_string(),
                expected: "at least 0".into(),
            });
        }
        if weight == 0.0 {
            // Exporters pad with weight 0 and any joint, so the joint is not looked at.
            continue;
        }
        if bind as usize >= bind_count {
            return Err(bad_index("skin joint", bind as usize, bind_count));
        }
        match merged.iter_mut().find(|(other, _)| *other == bind) {
            Some((_, sum)) => *sum += weight,
            None => merged.push((bind, weight)),
        }
    }
    merged.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    if merged.len() > MAX_INFLUENCES {
        merged.truncate(MAX_INFLUENCES);
        facts.dropped += 1;
    }
    let sum: f64 = merged.iter().map(|(_, weight)| weight).sum();
    // Files hold weights as f32 or 16-bit integers, so a sum within 1e-4 is exact for them.
    if !merged.is_empty() && (sum - 1.0).abs() > 1e-4 {
        facts.normalised += 1;
        if (sum - 1.0).abs() > (facts.worst_sum - 1.0).abs() || facts.normalised == 1 {
            facts.worst_sum = sum;
        }
    }
    merged.iter_mut().for_each(|(_, weight)| *weight /= sum);
    Ok(merged)
}

/// Gives every vertex without weights those of the nearest vertex that has some.
fn adopt_weights(
    influences: &mut [Vec<(u32, f64)>],
    mesh: &Mesh,
    facts: &mut WeightFacts,
) -> Result<(), ImportErrorKind> {
    let orphans: Vec<usize> = (0..influences.len())
        .filter(|&vertex| influences[vertex].is_empty())
        .collect();
    if orphans.is_empty() {
        return Ok(());
    }
    let mut weighted: Vec<usize> = (0..influences.len())
        .filter(|&vertex| !influences[vertex].is_empty())
        .collect();
    if weighted.is_empty() {
        return Err(ImportErrorKind::Missing {
            what: "a weight on any vertex".into(),
        });
    }
    // Sorted along one axis, a search outward can stop once that axis alone is too far.
    let key = |vertex: usize| mesh.positions[vertex].y;
    weighted.sort_by(|&a, &b| key(a).total_cmp(&key(b)));
    for &orphan in &orphans {
        let at = mesh.positions[orphan];
        let middle = weighted.partition_point(|&vertex| key(vertex) < at.y);
        let (below, above) = weighted.split_at(middle);
        let mut best = (f64::INFINITY, weighted[0]);
        search(below.iter().rev(), mesh, at, &mut best);
        search(above.iter(), mesh, at, &mut best);
        influences[orphan] = influences[best.1].clone();
    }
    facts.adopted = orphans.len();
    Ok(())
}

fn search<'a>(
    vertices: impl Iterator<Item = &'a usize>,
    mesh: &Mesh,
    at: DVec3,
    best: &mut (f64, usize),
) {
    for &vertex in vertices {
        let position = mesh.positions[vertex];
        if (position.y - at.y).powi(2) > best.0 {
            return;
        }
        let distance = position.distance_squared(at);
        if distance < best.0 {
            *best = (distance, vertex);
        }
    }
}

#[cfg(test)]
mod tests;
