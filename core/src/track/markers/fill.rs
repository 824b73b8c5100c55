//! A marker's place from its neighbours: a local frame, then what the host's regression adds.
//!
//! The frame is the weighted rigid motion of the neighbours (absolute orientation, Horn 1987),
//! found from the frame's last rotation by Gauss-Newton steps. Estimated neighbours weigh less by
//! their variance. Directions that the neighbours leave open, such as the turn about a line, stay
//! as they were.

use glam::{Mat3, Vec3, Vec3Swizzles};

use super::model::Model;
use super::state::Trace;
use super::turn::{COLD, Scatter, matrix, refine, triangle};
use crate::math::Quat4;

/// Steps from the last rotation.
const WARM: usize = 2;

/// Share of the neighbours' spread that a right rotation never leaves.
const ASTRAY: f32 = 0.1;
/// Most by which departures move a marker, metres.
const FARTHEST: f32 = 0.1;

/// The local frame of a marker and what its neighbours expect in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expectation {
    pub turn: Quat4,
    rotation: Mat3,
    /// Weighted mean of the neighbours in the world and in the local frame.
    centre: Vec3,
    middle: Vec3,
    /// The marker's place in the local frame, from regression.
    pub local: Vec3,
    /// Share of the neighbours' full weight that stands behind it, 0 to 1.
    pub share: f32,
    /// Mean variance of the neighbours themselves, square metres.
    pub inherited: f32,
    /// Variance because rigid neighbours are not measured, square metres.
    pub loose: f32,
    /// How much less rigid the neighbours are than learned: their mean square departure over its
    /// variance, at least 1.
    pub bent: f32,
}

impl Expectation {
    pub fn to_world(self, local: Vec3) -> Vec3 {
        self.rotation * (local - self.middle) + self.centre
    }

    pub fn to_local(self, world: Vec3) -> Vec3 {
        self.rotation.transpose() * (world - self.centre) + self.middle
    }
}

/// Most inner steps of one expectation, in the unit of [`super::work_bound`].
pub(super) const fn work(neighbours: usize) -> u32 {
    16 + 8 * neighbours as u32
}

impl Model<'_> {
    /// Where a marker's neighbours alone expect it, metres; `None` where they are fewer than three
    /// or on a line. `place`: of a marker that is measured.
    ///
    /// Linear in the neighbours.
    pub fn expect(
        &self,
        marker: usize,
        place: impl Fn(usize) -> Option<[f32; 3]>,
    ) -> Option<[f32; 3]> {
        let place = |index| Some((Vec3::from_array(place(index)?), 0.0));
        let found = expect(self, place, marker, None)?;
        Some(found.to_world(found.local).to_array())
    }
}

/// Where a marker is and how sure, as its neighbours need it; `None` where it has no place.
pub(super) fn placed(traces: &[Trace]) -> impl Fn(usize) -> Option<(Vec3, f32)> {
    |index| {
        let trace = traces.get(index).filter(|trace| trace.is_placed)?;
        Some((trace.position, trace.sigma))
    }
}

/// Where a marker's neighbours expect it; `None` without any. `place`: position and standard
/// deviation of a marker; `turn`: the frame's last rotation, if known.
pub(super) fn expect(
    model: &Model<'_>,
    place: impl Fn(usize) -> Option<(Vec3, f32)>,
    marker: usize,
    turn: Option<Quat4>,
) -> Option<Expectation> {
    let trust = |index: usize, full: f32| -> Option<(Vec3, f32, f32)> {
        let (position, sigma) = place(index)?;
        let variance = sigma * sigma;
        let weight = if variance > 0.0 {
            full / (1.0 + full * variance)
        } else {
            full
        };
        Some((position, weight, variance))
    };
    let (mut total, mut full, mut inherited) = (0.0, 0.0, 0.0);
    let (mut centre, mut middle) = (Vec3::ZERO, Vec3::ZERO);
    let (mut tight, mut tightest) = (Three([UNKNOWN; 3]), Three([UNKNOWN; 3]));
    for (index, link) in model.links(marker) {
        full += link.weight();
        tightest.insert(link.spread());
        let Some((position, weight, variance)) = trust(index, link.weight()) else {
            continue;
        };
        total += weight;
        centre += position * weight;
        middle += link.shape() * weight;
        inherited += link.weight() * variance;
        if variance == 0.0 {
            tight.insert(link.spread());
        }
    }
    if total <= 0.0 {
        return None;
    }
    let per_weight = 1.0 / total;
    centre *= per_weight;
    middle *= per_weight;
    // Columns of the sum of weight * world * local^T, and the local scatter.
    let (mut bx, mut by, mut bz) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    let (mut squares, mut mixed) = (Vec3::ZERO, Vec3::ZERO);
    let (mut spread, mut known) = (0.0, 0.0);
    for (index, link) in model.links(marker) {
        let Some((position, weight, _)) = trust(index, link.weight()) else {
            continue;
        };
        let local = link.shape() - middle;
        let arm = position - centre;
        let world = arm * weight;
        spread += world.dot(arm);
        known += 1.0;
        bx += world * local.x;
        by += world * local.y;
        bz += world * local.z;
        let weighted = local * weight;
        squares += weighted * local;
        mixed += weighted.yzx() * local;
    }
    let cross = Mat3::from_cols(bx, by, bz);
    let scatter = Scatter { squares, mixed };
    let size = spread + squares.x + squares.y + squares.z;
    // What the rotation leaves: the sum of weight * |world - turned local|^2.
    let left = |turn: Quat4| {
        let rotation = matrix(turn);
        let met = rotation.x_axis.dot(bx) + rotation.y_axis.dot(by) + rotation.z_axis.dot(bz);
        (size - 2.0 * met).max(0.0)
    };
    let turn = turn.map(|turn| refine(turn, &cross, &scatter, WARM));
    let turn = match turn.filter(|turn| left(*turn) < ASTRAY * size) {
        Some(turn) => turn,
        // Steps stay where they are half a turn from the right place.
        None => match start(model, &place, marker) {
            Some(new) => {
                let new = refine(new, &cross, &scatter, COLD);
                turn.filter(|turn| left(*turn) <= left(new)).unwrap_or(new)
            }
            None => turn?,
        },
    };
    let rotation = matrix(turn);
    let bent = left(turn) / (3.0 * f32::max(known - 2.0, 1.0));
    let back = rotation.transpose();
    let mut local = model.marker(marker).home;
    let mut moved = Vec3::ZERO;
    for (index, link) in model.links(marker) {
        let Some((position, weight, _)) = trust(index, link.weight()) else {
            continue;
        };
        let departure = back * (position - centre) + middle - link.shape();
        let trusted = if weight < link.weight() {
            weight / link.weight()
        } else {
            1.0
        };
        moved += link.gain(departure * trusted);
    }
    // In poses far from all that were learned a regression says anything.
    if moved.length_squared() < FARTHEST * FARTHEST {
        local += moved;
    }
    Some(Expectation {
        turn,
        rotation,
        centre,
        middle,
        local,
        share: total / full,
        inherited: inherited / full,
        bent: bent.max(1.0),
        loose: tight.0[2] * tight.0[2] - tightest.0[2] * tightest.0[2],
    })
}

/// Spread of a distance that is not there, metres.
const UNKNOWN: f32 = 0.06;

/// The smallest three, ascending: so many distances fix a place.
struct Three([f32; 3]);

impl Three {
    #[inline]
    fn insert(&mut self, mut carried: f32) {
        for slot in &mut self.0 {
            if carried < *slot {
                core::mem::swap(slot, &mut carried);
            }
        }
    }
}

/// A rotation from the first placed neighbours.
fn start(
    model: &Model<'_>,
    place: impl Fn(usize) -> Option<(Vec3, f32)>,
    marker: usize,
) -> Option<Quat4> {
    triangle(model.links(marker).filter_map(|(index, link)| {
        let (position, _) = place(index)?;
        Some((position, link.shape()))
    }))
}
