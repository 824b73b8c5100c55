//! The sole of a body's foot: the points with which it stands.

use glam::{DAffine3, DVec3};

use crate::fit::Side;
use crate::fit::humanoid::{Humanoid, Part, ancestors};
use crate::model::Avatar;

/// Points of a sole at rest, relative to the joints that carry them, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sole {
    /// Joints of the leg: hip, knee, ankle.
    pub leg: [usize; 3],
    /// Joint of the toes.
    pub toes: Option<usize>,
    /// Heel and ball, in the ankle's axes.
    pub stand: [DVec3; 2],
    /// Tip of the toes, in the axes of the toes, or the ankle's without any.
    pub tip: DVec3,
}

impl Sole {
    /// Reads a sole from the mesh; `None` where the body has no such leg or no skin on its foot.
    /// O(vertices)
    #[must_use]
    pub fn new(body: &Avatar, human: &Humanoid, side: Side) -> Option<Self> {
        let part = |part| human.limb(side, part);
        let leg = [
            part(Part::UpperLeg)?,
            part(Part::LowerLeg)?,
            part(Part::Foot)?,
        ];
        let (ankle, toes) = (leg[2], part(Part::Toes));
        let is_foot = |joint: usize| {
            joint == ankle || ancestors(&body.skeleton, joint).any(|above| above == ankle)
        };
        let rest = body.skeleton.model(&body.skeleton.rest());
        // Where each vertex of the foot is in the rest pose.
        let mut points: Vec<DVec3> = Vec::new();
        for (position, influences) in body.mesh.positions.iter().zip(&body.skin.influences) {
            if let Some(&(bind, _)) = influences.first() {
                let bind = &body.skin.binds[bind as usize];
                if is_foot(bind.joint) {
                    let to_model: DAffine3 = rest[bind.joint] * bind.inverse_bind;
                    points.push(to_model.transform_point3(*position));
                }
            }
        }
        let low = points.iter().map(|at| at.y).reduce(f64::min)?;
        let centre = points.iter().sum::<DVec3>() / points.len() as f64;
        let at = rest[ankle].translation;
        let ahead = toes.map_or(centre, |toes| rest[toes].translation) - at;
        let ahead = DVec3::new(ahead.x, 0.0, ahead.z).try_normalize()?;
        let along = |point: &DVec3| (*point - at).dot(ahead);
        let back = points.iter().map(along).fold(f64::INFINITY, f64::min);
        let front = points.iter().map(along).fold(f64::NEG_INFINITY, f64::max);
        let length = front - back;
        // The middle of the lowest skin about a place along the foot.
        let sole = |place: f64| {
            let near = |point: &&DVec3| (along(point) - place).abs() <= 0.12 * length;
            let floor = points
                .iter()
                .filter(near)
                .map(|at| at.y)
                .fold(f64::INFINITY, f64::min);
            let lowest = |point: &&DVec3| near(point) && point.y <= floor + 0.03 * length;
            let all: Vec<DVec3> = points.iter().filter(lowest).copied().collect();
            let middle = all.iter().sum::<DVec3>() / all.len().max(1) as f64;
            DVec3::new(middle.x, floor.min(low + 0.1 * length), middle.z)
        };
        let ball = toes.map_or(back + 0.72 * length, |toes| along(&rest[toes].translation));
        let ball = ball.clamp(back + 0.5 * length, front - 0.1 * length);
        let in_foot = rest[ankle].inverse();
        let tip = sole(front - 0.05 * length);
        Some(Self {
            leg,
            toes,
            stand: [sole(back + 0.12 * length), sole(ball)].map(|at| in_foot.transform_point3(at)),
            tip: rest[toes.unwrap_or(ankle)].inverse().transform_point3(tip),
        })
    }
}
