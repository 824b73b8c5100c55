//! Which joint of a skeleton plays which role of a human body.
//!
//! Limbs and head are found by name; hips, spine and neck follow from the structure: the hips are
//! where legs and head come together, the thorax where arms and head do. Roles carry the names of
//! the VRM humanoid.

use std::collections::BTreeMap;
use std::fmt;

use super::names::{self, Meaning};
use super::{FitError, Which};
use crate::model::Skeleton;

/// Half of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// The body's own left.
    Left,
    /// The body's own right.
    Right,
}

/// Both sides.
pub const SIDES: [Side; 2] = [Side::Left, Side::Right];

/// A joint of an arm or a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The clavicle.
    Shoulder,
    /// From the shoulder to the elbow.
    UpperArm,
    /// From the elbow to the wrist.
    LowerArm,
    /// From the wrist on.
    Hand,
    /// From the hip to the knee.
    UpperLeg,
    /// From the knee to the ankle.
    LowerLeg,
    /// From the ankle on.
    Foot,
    /// From the ball of the foot on.
    Toes,
}

/// Parts in their order along the arm, then the leg.
pub const PARTS: [Part; 8] = [
    Part::Shoulder,
    Part::UpperArm,
    Part::LowerArm,
    Part::Hand,
    Part::UpperLeg,
    Part::LowerLeg,
    Part::Foot,
    Part::Toes,
];

/// A finger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Finger {
    Thumb,
    Index,
    Middle,
    Ring,
    Little,
    /// All but the thumb in one.
    All,
}

const FINGERS: [Finger; 6] = [
    Finger::Thumb,
    Finger::Index,
    Finger::Middle,
    Finger::Ring,
    Finger::Little,
    Finger::All,
];

/// What a joint is in a human body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Where the legs and the rest come together; found by structure, unless it is named.
    Hips,
    /// The head.
    Head,
    /// A joint of an arm or leg.
    Limb(Side, Part),
    /// A joint of a finger: 0, 1, 2 from the palm.
    Finger(Side, Finger, u8),
}

impl fmt::Display for Role {
    /// The VRM humanoid's name.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = |side: &Side| if *side == Side::Left { "left" } else { "right" };
        match self {
            Self::Hips => f.write_str("hips"),
            Self::Head => f.write_str("head"),
            Self::Limb(s, part) => write!(f, "{}{part:?}", side(s)),
            Self::Finger(s, Finger::All, _) => write!(f, "{}Fingers", side(s)),
            Self::Finger(s, finger, phalanx) => {
                let thumb = ["Metacarpal", "Proximal", "Distal"];
                let other = ["Proximal", "Intermediate", "Distal"];
                let names = if *finger == Finger::Thumb {
                    thumb
                } else {
                    other
                };
                write!(
                    f,
                    "{}{finger:?}{}",
                    side(s),
                    names[usize::from(*phalanx).min(2)]
                )
            }
        }
    }
}

impl Role {
    /// All roles.
    pub fn all() -> impl Iterator<Item = Self> {
        let limbs = SIDES
            .into_iter()
            .flat_map(|s| PARTS.map(|part| Self::Limb(s, part)));
        let fingers = SIDES.into_iter().flat_map(|s| {
            let of = move |finger: Finger| {
                let count = if finger == Finger::All { 1 } else { 3 };
                (0..count).map(move |phalanx| Self::Finger(s, finger, phalanx))
            };
            FINGERS.into_iter().flat_map(of)
        });
        [Self::Hips, Self::Head]
            .into_iter()
            .chain(limbs)
            .chain(fingers)
    }

    /// The role of this VRM name, in any case.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        Self::all().find(|role| role.to_string().eq_ignore_ascii_case(name))
    }
}

/// The joints that could play each role, by name alone.
pub(super) type Candidates = BTreeMap<Role, Vec<usize>>;

/// The roles that joints of a skeleton play.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Humanoid {
    /// Where the legs and the rest come together.
    pub hips: usize,
    /// From above the hips up to the joint from which arms and neck go out; may be empty.
    pub spine: Vec<usize>,
    /// From above that joint to the head.
    pub neck: Vec<usize>,
    /// Limbs, fingers and the head (the hips stand above); a rig without a head joint has its last neck joint here.
    pub roles: BTreeMap<Role, usize>,
}

/// Roles without which a motion cannot be carried over.
const NEEDED: [Part; 3] = [Part::UpperLeg, Part::LowerLeg, Part::Foot];

/// Finds the joints that could play each role. O(joints x roles)
pub(super) fn candidates(skeleton: &Skeleton) -> Candidates {
    let mut found: BTreeMap<(Option<Side>, Meaning), Vec<usize>> = BTreeMap::new();
    let parsed = names::parse(skeleton.joints.iter().map(|joint| joint.name.as_str()));
    for (joint, name) in parsed.iter().enumerate() {
        if let Some(meaning) = name.meaning() {
            found.entry(meaning).or_default().push(joint);
        }
    }
    let mut out = Candidates::new();
    let mut take = |role, joints: Option<Vec<usize>>| {
        if let Some(joints) = joints {
            out.insert(role, topmost(skeleton, &joints));
        }
    };
    let mut of = |side, meaning| found.remove(&(side, meaning));
    let head = of(None, Meaning::Head);
    take(Role::Head, head.or_else(|| of(None, Meaning::Neck)));
    for side in SIDES {
        let s = Some(side);
        let mut limb = |part, joints| take(Role::Limb(side, part), joints);
        // Sure meanings first; a weak one goes to the first role that is still open.
        let upper_leg = of(s, Meaning::UpperLeg).or_else(|| of(s, Meaning::WeakHip));
        limb(
            Part::UpperLeg,
            upper_leg.or_else(|| of(s, Meaning::WeakLeg)),
        );
        limb(
            Part::LowerLeg,
            of(s, Meaning::LowerLeg).or_else(|| of(s, Meaning::WeakLeg)),
        );
        let upper_arm = of(s, Meaning::UpperArm).or_else(|| of(s, Meaning::WeakArm));
        limb(
            Part::UpperArm,
            upper_arm.or_else(|| of(s, Meaning::WeakShoulder)),
        );
        limb(
            Part::Shoulder,
            of(s, Meaning::Clavicle).or_else(|| of(s, Meaning::WeakShoulder)),
        );
        limb(Part::LowerArm, of(s, Meaning::LowerArm));
        limb(Part::Hand, of(s, Meaning::Hand));
        let feet = of(s, Meaning::Foot);
        // SMPL has toes called "foot" below an ankle.
        let below = feet.as_ref().map(|feet| below_first(skeleton, feet));
        limb(
            Part::Toes,
            of(s, Meaning::Toes).or(below.filter(|below| !below.is_empty())),
        );
        limb(Part::Foot, feet);
        for finger in FINGERS {
            let joints = of(s, Meaning::Finger(finger)).unwrap_or_default();
            for (phalanx, joint) in chain(skeleton, &joints).into_iter().enumerate().take(3) {
                let phalanx = u8::try_from(phalanx).unwrap_or(u8::MAX);
                if finger != Finger::All || phalanx == 0 {
                    take(Role::Finger(side, finger, phalanx), Some(vec![joint]));
                }
            }
        }
    }
    out
}

/// The joints that have no ancestor among `joints`.
fn topmost(skeleton: &Skeleton, joints: &[usize]) -> Vec<usize> {
    let mut below = vec![false; skeleton.joints.len()];
    joints.iter().for_each(|&joint| below[joint] = true);
    let chosen = below.clone();
    // Parents come first, so that one pass hands the mark down to all descendants.
    for (joint, parent) in skeleton.joints.iter().map(|joint| joint.parent).enumerate() {
        below[joint] = parent.is_some_and(|parent| below[parent] || chosen[parent]);
    }
    let free = |joint: &&usize| !below[**joint];
    joints.iter().filter(free).copied().collect()
}

/// The joints that are descendants of the only topmost one; none where several are topmost.
fn below_first(skeleton: &Skeleton, joints: &[usize]) -> Vec<usize> {
    let top = topmost(skeleton, joints);
    let below = joints
        .iter()
        .filter(|joint| top.len() == 1 && !top.contains(joint));
    below.copied().collect()
}

/// The joints from top to bottom if each is an ancestor of the next; else none.
fn chain(skeleton: &Skeleton, joints: &[usize]) -> Vec<usize> {
    let mut joints = joints.to_vec();
    joints.sort_unstable();
    let linked = |pair: &[usize]| ancestors(skeleton, pair[1]).any(|above| above == pair[0]);
    if joints.windows(2).all(linked) {
        joints
    } else {
        Vec::new()
    }
}

/// Parent, its parent, and so on.
pub(super) fn ancestors(skeleton: &Skeleton, joint: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(skeleton.joints[joint].parent, |&at| {
        skeleton.joints[at].parent
    })
}

/// The lowest joint that is each joint or an ancestor of it.
fn common(skeleton: &Skeleton, joints: &[usize]) -> Option<usize> {
    let line = |joint| std::iter::once(joint).chain(ancestors(skeleton, joint));
    let (&first, others) = joints.split_first()?;
    let mut rank = vec![None; skeleton.joints.len()];
    let first: Vec<usize> = line(first).collect();
    first
        .iter()
        .enumerate()
        .for_each(|(at, &joint)| rank[joint] = Some(at));
    let mut meets = others
        .iter()
        .map(|&other| line(other).find_map(|joint| rank[joint]));
    let highest = meets.try_fold(0, |highest: usize, meet| Some(highest.max(meet?)))?;
    first.get(highest).copied()
}

/// The joints below `top`, down to and with `bottom`; empty where they are the same.
fn path(skeleton: &Skeleton, top: usize, bottom: usize) -> Vec<usize> {
    let line = std::iter::once(bottom).chain(ancestors(skeleton, bottom));
    let mut path: Vec<usize> = line.take_while(|&at| at != top).collect();
    path.reverse();
    path
}

impl Humanoid {
    /// Reads the roles of a skeleton from its joints' names and structure. O(joints x roles)
    ///
    /// # Errors
    /// A role that several joints could play; no joint for the legs or the head.
    pub fn new(skeleton: &Skeleton, which: Which) -> Result<Self, FitError> {
        Self::choose(skeleton, which, &candidates(skeleton))
    }

    pub(super) fn choose(
        skeleton: &Skeleton,
        which: Which,
        candidates: &Candidates,
    ) -> Result<Self, FitError> {
        let mut roles = BTreeMap::new();
        for (role, joints) in candidates {
            if let [joint] = joints[..] {
                roles.insert(*role, joint);
                continue;
            }
            let name = |&joint: &usize| skeleton.joints[joint].name.clone();
            return Err(FitError::Ambiguous {
                which,
                role: role.to_string(),
                candidates: joints.iter().take(4).map(name).collect(),
            });
        }
        let legs = SIDES
            .into_iter()
            .flat_map(|s| NEEDED.map(|part| Role::Limb(s, part)));
        let missing: Vec<String> = std::iter::once(Role::Head)
            .chain(legs)
            .filter(|role| !roles.contains_key(role))
            .map(|role| role.to_string())
            .collect();
        if !missing.is_empty() {
            return Err(FitError::MissingRole {
                which,
                roles: missing,
            });
        }

        let head = roles[&Role::Head];
        let of = |part| SIDES.map(|side| roles.get(&Role::Limb(side, part)).copied());
        let arms = [of(Part::Shoulder), of(Part::UpperArm)].concat();
        let upper: Vec<usize> = arms.into_iter().flatten().chain([head]).collect();
        let legs = of(Part::UpperLeg).into_iter().flatten();
        let all: Vec<usize> = upper.iter().copied().chain(legs).collect();
        let apart = || FitError::Apart { which };
        let lowest = common(skeleton, &all).ok_or_else(apart)?;
        let hips = roles.remove(&Role::Hips).unwrap_or(lowest);
        if hips != lowest && !ancestors(skeleton, lowest).any(|above| above == hips) {
            return Err(apart());
        }
        let thorax = if upper.len() > 1 {
            common(skeleton, &upper).ok_or_else(apart)?
        } else {
            // Without arms the thorax is what carries the neck.
            let neck = path(skeleton, hips, head);
            let parsed = names::parse(neck.iter().map(|&at| skeleton.joints[at].name.as_str()));
            let is_neck = |name: &names::Name| matches!(name.meaning(), Some((_, Meaning::Neck)));
            let first = parsed
                .iter()
                .position(is_neck)
                .unwrap_or(neck.len().saturating_sub(1));
            if first == 0 { hips } else { neck[first - 1] }
        };
        Ok(Self {
            hips,
            spine: path(skeleton, hips, thorax),
            neck: path(skeleton, thorax, head),
            roles,
        })
    }

    /// The joint of a limb.
    #[must_use]
    pub fn limb(&self, side: Side, part: Part) -> Option<usize> {
        self.roles.get(&Role::Limb(side, part)).copied()
    }
}

#[cfg(test)]
mod tests;
