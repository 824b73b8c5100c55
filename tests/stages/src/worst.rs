//! Poses that cost a frame most.

use glam::{Quat, Vec3};
use sinew_core::asset::Asset;
use sinew_core::pose::Transform;

/// Most joints.
pub(crate) const JOINTS: usize = 128;

/// The rest pose with every joint scaled unevenly, so that no normal keeps its length; `None` for a
/// skeleton that is too large.
pub(crate) fn stretched<'p>(
    asset: &Asset<'_>,
    pose: &'p mut [Transform; JOINTS],
) -> Option<&'p [Transform]> {
    posed(asset, pose, |_, place| {
        place.scale = Vec3::new(1.02, 0.98, 1.0);
    })
}

/// The rest pose with every second joint turned so many thirds of a revolution, so that surfaces
/// that blend quaternions need a new base every second time.
pub(crate) fn twisted<'p>(
    asset: &Asset<'_>,
    thirds: usize,
    pose: &'p mut [Transform; JOINTS],
) -> Option<&'p [Transform]> {
    const SINE: f32 = 0.866_025_4;
    const HALVES: [[f32; 2]; 6] = [
        [0.0, 1.0],
        [SINE, 0.5],
        [SINE, -0.5],
        [0.0, -1.0],
        [-SINE, -0.5],
        [-SINE, 0.5],
    ];
    let [sine, cosine] = HALVES.get(thirds % 6).copied().unwrap_or_default();
    posed(asset, pose, |joint, place| {
        if joint % 2 == 1 {
            place.rotation = Quat::from_xyzw(0.0, sine, 0.0, cosine);
        }
    })
}

fn posed<'p>(
    asset: &Asset<'_>,
    pose: &'p mut [Transform; JOINTS],
    change: impl Fn(usize, &mut Transform),
) -> Option<&'p [Transform]> {
    let pose = pose.get_mut(..asset.dims().joint_count)?;
    for (joint, place) in pose.iter_mut().enumerate() {
        let &[x, y, z, w, a, b, c, ..] = asset.rest(joint)?;
        *place = Transform {
            rotation: Quat::from_xyzw(x, y, z, w),
            translation: Vec3::new(a, b, c),
            scale: Vec3::ONE,
        };
        change(joint, place);
    }
    Some(pose)
}
