//! Named markers, found from the joints: a ray from inside the body meets the skin.

use glam::DVec3;

use super::Marker;
use crate::fit::{Part, Role, Side};
use crate::model::Avatar;
use crate::spatial::{Hit, Tree};
use crate::studio::StudioError;
use crate::studio::anatomy::Anatomy;

/// A point inside the body and the way to the skin.
struct Way {
    from: DVec3,
    to: DVec3,
}

/// The tips of elbows and knees, which even sets also mark.
pub(super) fn tips(anatomy: &Anatomy, tree: &Tree) -> Vec<Hit> {
    let mut out = Vec::new();
    for side in [Side::Left, Side::Right] {
        let at = |part| anatomy.limb(side, part).map(|joint| anatomy.at(joint));
        for [above, part, below] in [
            [Part::UpperArm, Part::LowerArm, Part::Hand],
            [Part::UpperLeg, Part::LowerLeg, Part::Foot],
        ] {
            let (Some(above), Some(tip), Some(below)) = (at(above), at(part), at(below)) else {
                continue;
            };
            let hinge = (tip - above).normalize_or_zero() - (below - tip).normalize_or_zero();
            let front = if part == Part::LowerArm {
                -anatomy.front
            } else {
                anatomy.front
            };
            let axis = (below - above).normalize_or(anatomy.up);
            let out_of_bend = (hinge + 0.1 * front).reject_from(axis);
            out.extend(tree.first_hit(tip, out_of_bend));
        }
    }
    out
}

/// CMU's 41 markers; with `all`, 12 more.
pub(super) fn place(avatar: &Avatar, all: bool) -> Result<Vec<Marker>, StudioError> {
    let anatomy = Anatomy::new(avatar)?;
    let tree = Tree::new(&avatar.mesh.triangles, &avatar.mesh.positions);
    let mut ways = trunk(&anatomy)?;
    for side in [Side::Left, Side::Right] {
        ways.extend(of_side(&anatomy, side, all)?);
    }
    let glue = |(name, way): (String, Way)| {
        let hit = tree
            .first_hit(way.from, way.to)
            .ok_or_else(|| StudioError::NoPlace {
                marker: name.clone(),
                why: "no skin lies around its joint".into(),
            })?;
        Ok(Marker {
            name,
            triangle: hit.triangle,
            vertices: avatar.mesh.triangles[hit.triangle],
            barycentric: hit.barycentric,
        })
    };
    ways.into_iter().map(glue).collect()
}

/// A point of the trunk: a height from the hips (0) to the thorax (1), and metres to the left.
fn on_trunk(anatomy: &Anatomy, height: f64, left: f64) -> DVec3 {
    let (hips, thorax) = (anatomy.at(anatomy.human.hips), anatomy.at(anatomy.thorax()));
    hips.lerp(thorax, height) + anatomy.left * (left * anatomy.scale)
}

fn trunk(anatomy: &Anatomy) -> Result<Vec<(String, Way)>, StudioError> {
    let (front, up) = (anatomy.front, anatomy.up);
    let neck = anatomy
        .human
        .neck
        .first()
        .copied()
        .unwrap_or(anatomy.thorax());
    let head = anatomy
        .human
        .roles
        .get(&Role::Head)
        .ok_or_else(|| missing("ARIEL", "head"))?;
    let skull = anatomy.at(*head) + up * (0.06 * anatomy.scale);
    let way = |from: DVec3, to: DVec3| Way { from, to };
    let throat = anatomy.at(neck) - up * (0.04 * anatomy.scale);
    Ok(vec![
        ("ARIEL".into(), way(skull, up)),
        ("C7".into(), way(anatomy.at(neck), -front)),
        ("T10".into(), way(on_trunk(anatomy, 0.62, 0.0), -front)),
        ("CLAV".into(), way(throat, front)),
        ("STRN".into(), way(on_trunk(anatomy, 0.72, 0.0), front)),
    ])
}

fn of_side(anatomy: &Anatomy, side: Side, all: bool) -> Result<Vec<(String, Way)>, StudioError> {
    let (front, up, size) = (anatomy.front, anatomy.up, anatomy.scale);
    let out = anatomy.outward(side);
    let sign = if side == Side::Left { 1.0 } else { -1.0 };
    let letter = if side == Side::Left { 'L' } else { 'R' };
    let need = |part: Part| {
        let joint = anatomy.limb(side, part);
        let joint = joint.ok_or_else(|| missing("of a limb", &format!("{side:?} {part:?}")))?;
        Ok::<_, StudioError>(anatomy.at(joint))
    };
    let (arm, elbow, hand) = (
        need(Part::UpperArm)?,
        need(Part::LowerArm)?,
        need(Part::Hand)?,
    );
    let (leg, knee, foot) = (
        need(Part::UpperLeg)?,
        need(Part::LowerLeg)?,
        need(Part::Foot)?,
    );
    let head = anatomy
        .human
        .roles
        .get(&Role::Head)
        .ok_or_else(|| missing("FHD", "head"))?;
    let skull = anatomy.at(*head) + up * (0.06 * size);
    // A rig without toes or fingers: where they begin on a common foot and hand.
    let ball = need(Part::Toes).unwrap_or(foot + front * (0.13 * size) - up * (0.04 * size));
    let fore = (hand - elbow).normalize_or(front);
    let knuckles = hand + fore * (0.05 * size);
    // Across the elbow's hinge, outward.
    let hinge = (elbow - arm).cross(hand - elbow);
    let hinge = hinge.try_normalize().unwrap_or(out);
    let hinge = if hinge.dot(out) < 0.0 { -hinge } else { hinge };
    // A thumb lies on the front side of a forearm whose palm faces the thigh.
    let thumb = front
        .reject_from(fore)
        .try_normalize()
        .unwrap_or(up.reject_from(fore));
    let thumb = if fore.dot(front) > 0.5 {
        (up - out * 0.5).reject_from(fore)
    } else {
        thumb
    };
    let back_of_hand = fore.cross(thumb) * sign;
    let back_of_hand = if back_of_hand.dot(out + up) < 0.0 {
        -back_of_hand
    } else {
        back_of_hand
    };
    let way = |name: &str, from: DVec3, to: DVec3| (format!("{letter}{name}"), Way { from, to });
    let mut ways = vec![
        way("FHD", skull, out * 0.6 + front * 0.8 + up * 0.3),
        way("BHD", skull, out * 0.6 - front * 0.8 + up * 0.3),
        way("SHO", arm, up),
        way("UPA", arm.lerp(elbow, 0.5), out - front * 0.2),
        way("ELB", elbow, hinge),
        way("FRM", elbow.lerp(hand, 0.5), hinge),
        way("IWR", elbow.lerp(hand, 0.96), thumb),
        way("OWR", elbow.lerp(hand, 0.96), -thumb),
        way("FIN", knuckles, back_of_hand),
        way(
            "FWT",
            on_trunk(anatomy, 0.05, sign * 0.10),
            front + out * 0.3,
        ),
        way("BWT", on_trunk(anatomy, 0.10, sign * 0.05), -front),
        way("THI", leg.lerp(knee, 0.55), out),
        way("KNE", knee, out),
        way("SHN", knee.lerp(foot, 0.45), out + front * 0.5),
        way("ANK", foot, out),
        way("HEE", foot - up * (0.03 * size), -front),
        way("MT5", ball, out),
        way("TOE", ball - out * (0.01 * size), up + front * 0.3),
    ];
    if all {
        ways.extend([
            way("MEL", elbow, -hinge),
            way("THM", knuckles, thumb),
            way("RIB", on_trunk(anatomy, 0.68, sign * 0.06), out),
            way("QUA", leg.lerp(knee, 0.5), front),
            way("MKN", knee, -out),
            way("MAN", foot, -out),
        ]);
    }
    Ok(ways)
}

fn missing(marker: &str, what: &str) -> StudioError {
    StudioError::NoPlace {
        marker: marker.to_owned(),
        why: format!("the body has no {what}"),
    }
}
