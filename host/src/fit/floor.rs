//! How high a body must be lifted so that its soles stand on the floor.

use glam::DVec3;

use super::humanoid::{Humanoid, Part, SIDES, ancestors};
use crate::model::{Avatar, Clip, Mesh, Skin};
use crate::reference::pose::{model, sample};
use crate::reference::skin::linear_blend;

/// Metres to add to the height of the hips so that the soles stand at y = 0.
///
/// A sole's height in a frame is that of the lowest vertex that hangs mostly on a foot or what is
/// below it, of both feet. The result puts the median over all frames on the floor: a heel that
/// strikes a little too deep, or a hand that touches the ground, does not make the body float.
/// `None` where no vertex hangs on a foot. O(frames x vertices of the feet)
#[must_use]
pub fn lift(avatar: &Avatar, human: &Humanoid, clip: &Clip) -> Option<f64> {
    let (mesh, skin) = feet(avatar, human);
    if mesh.positions.is_empty() {
        return None;
    }
    let longest = clip.tracks.iter().max_by_key(|track| track.times.len());
    let times = longest.map_or(&[0.0][..], |track| &track.times);
    let mut heights: Vec<f64> = times
        .iter()
        .map(|&time| {
            let pose = model(&avatar.skeleton, &sample(&avatar.skeleton, clip, time));
            let (points, _) = linear_blend(&mesh, &skin, &pose);
            points
                .iter()
                .fold(f64::INFINITY, |lowest, point| lowest.min(point.y))
        })
        .collect();
    heights.sort_by(f64::total_cmp);
    Some(-heights[heights.len() / 2])
}

/// The vertices of the feet alone.
fn feet(avatar: &Avatar, human: &Humanoid) -> (Mesh, Skin) {
    let feet = SIDES.map(|side| human.limb(side, Part::Foot));
    let is_foot = |joint: usize| {
        let mut line = std::iter::once(joint).chain(ancestors(&avatar.skeleton, joint));
        line.any(|at| feet.contains(&Some(at)))
    };
    let binds = &avatar.skin.binds;
    let hangs = |influences: &[(u32, f64)]| {
        let first = influences.first();
        first.is_some_and(|&(bind, _)| is_foot(binds[bind as usize].joint))
    };
    let all = avatar.skin.influences.iter().enumerate();
    let chosen: Vec<usize> = all
        .filter(|(_, list)| hangs(list))
        .map(|(vertex, _)| vertex)
        .collect();
    let pick = |values: &[DVec3]| chosen.iter().map(|&vertex| values[vertex]).collect();
    let mesh = Mesh {
        name: String::new(),
        positions: pick(&avatar.mesh.positions),
        normals: pick(&avatar.mesh.normals),
        tangents: None,
        texcoords: None,
        triangles: Vec::new(),
        parts: Vec::new(),
        morphs: Vec::new(),
    };
    let skin = Skin {
        binds: binds.clone(),
        influences: chosen
            .iter()
            .map(|&v| avatar.skin.influences[v].clone())
            .collect(),
    };
    (mesh, skin)
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::fit::{Role, Side};
    use crate::model::{Bind, Channel, Interpolation, Joint, Skeleton, Track, Transform};

    /// A foot 1 m below its root, with a vertex 0.1 m above the ground and one on the ground that
    /// hangs mostly on the root.
    fn avatar() -> Avatar {
        let joint = |name: &str, parent, y| Joint {
            name: name.into(),
            parent,
            rest: Transform {
                translation: DVec3::new(0.0, y, 0.0),
                ..Transform::IDENTITY
            },
        };
        let bind = |joint, y: f64| Bind {
            joint,
            inverse_bind: DAffine3::from_translation(DVec3::new(0.0, -y, 0.0)),
        };
        Avatar {
            mesh: Mesh {
                name: String::new(),
                positions: vec![DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO],
                normals: vec![DVec3::Y; 2],
                tangents: None,
                texcoords: None,
                triangles: Vec::new(),
                parts: Vec::new(),
                morphs: Vec::new(),
            },
            skeleton: Skeleton {
                joints: vec![joint("root", None, 1.2), joint("foot", Some(0), -1.0)],
            },
            skin: Skin {
                binds: vec![bind(0, 1.2), bind(1, 0.2)],
                influences: vec![vec![(1, 1.0)], vec![(0, 0.6), (1, 0.4)]],
            },
            clips: Vec::new(),
        }
    }

    fn human(roles: &[(Role, usize)]) -> Humanoid {
        Humanoid {
            hips: 0,
            spine: Vec::new(),
            neck: Vec::new(),
            roles: roles.iter().copied().collect(),
        }
    }

    fn clip(heights: &[f64]) -> Clip {
        let track = Track {
            joint: 0,
            channel: Channel::Translation,
            interpolation: Interpolation::Linear,
            times: (0..heights.len()).map(|frame| frame as f64).collect(),
            values: heights.iter().map(|&y| [0.0, y, 0.0, 0.0]).collect(),
        };
        Clip {
            tracks: vec![track],
            ..Clip::default()
        }
    }

    #[test]
    fn the_median_frame_stands_on_the_floor() {
        let human = human(&[(Role::Limb(Side::Left, Part::Foot), 1)]);
        // The foot's vertex is at 0.1, 0.4 and 3.1.
        let found = lift(&avatar(), &human, &clip(&[1.2, 1.5, 4.2])).unwrap();
        assert!((found + 0.4).abs() < 1e-12, "{found}");
        let still = lift(&avatar(), &human, &Clip::default()).unwrap();
        assert!((still + 0.1).abs() < 1e-12, "{still}");
    }

    #[test]
    fn without_feet_there_is_no_floor() {
        assert_eq!(lift(&avatar(), &human(&[]), &clip(&[1.2])), None);
    }
}
