//! Where the parts of a standing human body are, from its inside alone.
//!
//! In: the cells of a body that stands upright (Y up) in a T- or A-pose. Out: a [`Figure`]. The places
//! farthest from the middle of the trunk, going through the inside, are head, hands and feet. From
//! each hand and foot the body is followed inward (`limbs`); what is left is read layer by
//! layer (`trunk`).

use glam::DVec3;

use super::error::RigError;
use super::limbs::{arm, crotch, leg, leg_cells};
use super::trunk;
use crate::spatial::Solid;

/// A limb with one bend, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// Its axis from the shoulder or hip to the wrist or ankle.
    pub axis: Vec<DVec3>,
    /// Fingertip, or tip of the toes.
    pub tip: DVec3,
}

/// Landmarks of a body, metres. Pairs are left, right as the body sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Which way is which.
    pub axes: Axes,
    /// Sole to crown.
    pub height: f64,
    /// Height of the soles.
    pub floor: f64,
    /// Highest place.
    pub crown: DVec3,
    /// Where the neck begins and where the head does.
    pub neck: [DVec3; 2],
    /// Shoulder to fingertip.
    pub arms: [Limb; 2],
    /// Hip to toes.
    pub legs: [Limb; 2],
    /// Where the spine passes, from below, a cell apart.
    pub spine: Vec<DVec3>,
}

/// Horizontal directions of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Unit vector to its left.
    pub left: DVec3,
    /// Unit vector to where it looks.
    pub front: DVec3,
}

impl Axes {
    /// The body looks along `left x up`.
    pub(super) fn of_left(left: DVec3) -> Self {
        Self {
            left,
            front: left.cross(DVec3::Y),
        }
    }
}

impl Figure {
    /// Finds the landmarks. O(cells log cells)
    ///
    /// # Errors
    /// [`RigError::Hollow`], [`RigError::NoLimb`].
    pub fn new(solid: &Solid) -> Result<Self, RigError> {
        if solid.is_empty() {
            return Err(RigError::Hollow);
        }
        let half = 0.5 * solid.size();
        let heights = (0..solid.len() as u32).map(|cell| solid.centre(cell).y);
        let floor = heights.clone().fold(f64::INFINITY, f64::min) - half;
        let height = heights.fold(f64::NEG_INFINITY, f64::max) + half - floor;
        let mut ends = Extremities::find(solid, floor, height)?;
        let crotch = crotch(solid, ends.feet, floor, height);
        let mut cells = ends.feet.map(|foot| leg_cells(solid, foot, crotch));
        if cells[0].contains(&ends.feet[1]) {
            return Err(RigError::NoLimb {
                limb: "pair of legs",
                why: "they are not apart below the hips".into(),
            });
        }
        let mut axes = Axes::of_left(ends.left);
        // Toes point to where the body looks.
        let ahead = |at: usize| {
            let ankle = middle(solid, &cells[at], |y| {
                (0.06..0.14).contains(&((y - floor) / height))
            });
            ankle.map_or(0.0, |ankle| {
                (solid.centre(ends.feet[at]) - ankle).dot(axes.front)
            })
        };
        if ahead(0) + ahead(1) < 0.0 {
            axes = Axes::of_left(-axes.left);
            ends.feet.reverse();
            ends.hands.reverse();
            cells.reverse();
        }
        let spine = trunk::spine(solid, axes, crotch);
        let [left, right] = ends.hands.map(|hand| arm(solid, hand, height));
        let arms = [left?, right?];
        let [left, right] = [0, 1].map(|at| {
            leg(
                solid,
                &cells[at],
                ends.feet[at],
                axes,
                &spine,
                crotch,
                floor,
                height,
            )
        });
        let legs = [left?, right?];
        let shoulder = (arms[0].axis[0].y + arms[1].axis[0].y) / 2.0;
        Ok(Self {
            axes,
            height,
            floor,
            crown: solid.centre(ends.head).with_y(floor + height),
            neck: trunk::neck(solid, axes, &spine, shoulder, floor, height),
            arms,
            legs,
            spine,
        })
    }

    /// Where the spine passes at a height.
    #[must_use]
    pub fn spine_at(&self, y: f64) -> DVec3 {
        trunk::at_height(&self.spine, y)
    }
}

/// The mean place of cells whose height is accepted.
pub(super) fn middle(solid: &Solid, cells: &[u32], may: impl Fn(f64) -> bool) -> Option<DVec3> {
    let chosen = cells.iter().map(|&cell| solid.centre(cell));
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for place in chosen.filter(|place| may(place.y)) {
        sum += place;
        count += 1.0;
    }
    (count > 0.0).then(|| sum / count)
}

/// The cells that stand out most: those from which the way to any cell farther away leads back the
/// longest (persistence; Edelsbrunner, Letscher & Zomorodian 2002). O(cells log cells)
fn ends(solid: &Solid, away: &[f32], count: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..away.len() as u32)
        .filter(|&c| away[c as usize].is_finite())
        .collect();
    order.sort_by(|&a, &b| {
        away[b as usize]
            .total_cmp(&away[a as usize])
            .then(a.cmp(&b))
    });
    // From the farthest inward, regions grow and meet; each is known by its farthest cell.
    let mut above: Vec<u32> = (0..away.len() as u32).collect();
    let mut is_in = vec![false; away.len()];
    let find = |above: &mut Vec<u32>, mut cell: u32| {
        while above[cell as usize] != cell {
            let next = above[above[cell as usize] as usize];
            above[cell as usize] = next;
            cell = next;
        }
        cell
    };
    let mut born = Vec::new();
    for &cell in &order {
        is_in[cell as usize] = true;
        let mut own = None;
        for next in solid.neighbours(cell).filter(|&next| is_in[next as usize]) {
            let other = find(&mut above, next);
            let Some(known) = own else {
                own = Some(other);
                continue;
            };
            if known == other {
                continue;
            }
            let (far, near) = if away[known as usize] >= away[other as usize] {
                (known, other)
            } else {
                (other, known)
            };
            born.push((away[near as usize] - away[cell as usize], near));
            above[near as usize] = far;
            own = Some(far);
        }
        above[cell as usize] = own.unwrap_or(cell);
    }
    if let Some(&first) = order.first() {
        born.push((f32::INFINITY, first));
    }
    born.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    born.into_iter().take(count).map(|(_, cell)| cell).collect()
}

/// The ends of a body: cells.
struct Extremities {
    head: u32,
    hands: [u32; 2],
    feet: [u32; 2],
    /// From the second hand and foot to the first, horizontal, unit.
    left: DVec3,
}

impl Extremities {
    fn find(solid: &Solid, floor: f64, height: f64) -> Result<Self, RigError> {
        let part = |cell: u32| (solid.centre(cell).y - floor) / height;
        let depth = solid.depth();
        let trunk = (0..solid.len() as u32).filter(|&cell| (0.45..0.75).contains(&part(cell)));
        let trunk = trunk.max_by(|&a, &b| depth[a as usize].total_cmp(&depth[b as usize]));
        let no_limb = |limb, why: &str| RigError::NoLimb {
            limb,
            why: why.to_owned(),
        };
        let trunk = trunk.ok_or_else(|| no_limb("trunk", "nothing is at half its height"))?;
        let (away, _) = solid.march(&[(trunk, 0.0, 0)]);
        let mut found = ends(solid, &away, 5);
        found.sort_by(|&a, &b| part(a).total_cmp(&part(b)));
        let [foot, other_foot, .., head] = found[..] else {
            return Err(no_limb("limbs", "it is all of one piece"));
        };
        if part(other_foot) > 0.2 {
            return Err(no_limb("second foot", "only one end reaches the floor"));
        }
        if part(head) < 0.9 {
            return Err(no_limb("head", "its highest part is no end of it"));
        }
        let &[hand, other_hand] = &found[2..found.len() - 1] else {
            return Err(no_limb("arms", "too few ends stand out"));
        };
        let flat = |a: u32, b: u32| (solid.centre(a) - solid.centre(b)).with_y(0.0);
        let (hands, mut feet) = (flat(hand, other_hand), [foot, other_foot]);
        if hands.length() < 0.2 * height {
            return Err(no_limb("arms", "its hands are not left and right of it"));
        }
        if flat(feet[0], feet[1]).dot(hands) < 0.0 {
            feet.reverse();
        }
        let apart = flat(feet[0], feet[1]).normalize_or_zero();
        Ok(Self {
            head,
            hands: [hand, other_hand],
            feet,
            left: (hands.normalize_or_zero() + apart).normalize_or(DVec3::X),
        })
    }
}
