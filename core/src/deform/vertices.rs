//! Single vertices: for ray casts, attachment points and measurements.

use super::lanes::Lanes;
use super::output::SizeError;
use super::rest::Room;
use super::rigid::Rigid;
use super::skin::{Blend, Slots, Task, move_point, to_unit_length, turn, turned};
use crate::asset::{LANES, Run};

/// The vertices named, the same bits as in their blocks. Those that do not exist are left out.
///
/// A function of its own for every blend, as the kernel is.
#[inline(never)]
pub(super) fn some<B: Blend>(
    job: &Task<'_, '_, B>,
    ids: &[u32],
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
) {
    let mut room = Room::new();
    let mut normals = normals.iter_mut();
    for (&id, position) in ids.iter().zip(positions) {
        let normal = normals.next();
        if id as usize >= job.shape.asset.dims().vertex_count {
            continue;
        }
        let (point, direction) = one(job, id as usize / LANES, id as usize % LANES, &mut room);
        *position = point;
        if let Some(normal) = normal {
            *normal = direction;
        }
    }
}

fn one<B: Blend>(
    job: &Task<'_, '_, B>,
    block: usize,
    lane: usize,
    room: &mut Room,
) -> ([f32; 3], [f32; 3]) {
    let asset = job.shape.asset;
    let mut blended = 0;
    let mut found: Option<Run<'_>> = None;
    for run in asset.runs() {
        if run.blocks.contains(&block) {
            found = Some(run);
            break;
        }
        blended += if run.slots == 1 { 0 } else { run.blocks.len() };
    }
    let Some(run) = found else {
        return ([0.0; 3], [0.0; 3]);
    };
    let rest = job.shape.block::<f32>((), block, room);
    let position = f32::load3((), rest.positions, lane);
    let at = block - run.blocks.start;
    let slots = at * run.slots..(at + 1) * run.slots;
    let binds = run.binds.get(slots.clone()).unwrap_or_default();
    if let &[bind] = binds {
        let rigid = Rigid::of(job.blend.rigid(bind), job.normals.exact);
        let mut normal = turn(&rigid.normals, f32::load3((), rest.normals, lane));
        if !(rigid.keeps_length && job.shape.has_unit_normals()) {
            normal = to_unit_length((), normal);
        }
        return (move_point(&rigid.matrix, position), normal);
    }
    let slots = Slots {
        binds,
        weights: run.weights.get(slots).unwrap_or_default(),
        centre: asset
            .centres
            .get(blended + at)
            .unwrap_or(&super::rest::ORIGIN),
    };
    let matrix = job.blend.matrix::<f32>((), &slots, lane);
    let normal = turned((), job, &matrix, &rest, lane);
    (move_point(&matrix, position), to_unit_length((), normal))
}

/// `positions`, and `normals` where wanted, must have as many places as there are ids.
pub(super) fn check(ids: usize, positions: usize, normals: Option<usize>) -> Result<(), SizeError> {
    let lengths = [("positions", Some(positions)), ("normals", normals)];
    for (buffer, found) in lengths {
        if let Some(found) = found.filter(|&found| found < ids) {
            return Err(SizeError::TooSmall {
                buffer,
                needed: 3 * ids,
                found: 3 * found,
            });
        }
    }
    Ok(())
}
