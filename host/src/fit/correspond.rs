//! Which joint of a body follows which joint of a motion.
//!
//! In: two skeletons, and pairs that overrule. Limbs, fingers and heads correspond by role. Spines
//! and necks correspond along their length, however many joints each has. What is left corresponds
//! where the names are the same.

use std::collections::{BTreeMap, BTreeSet};

use super::humanoid::{Candidates, Finger, Humanoid, Role, ancestors, candidates};
use super::{FitError, Which, names};
use crate::model::Skeleton;

/// What a joint of the body follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// One joint of the motion.
    Joint(usize),
    /// Two neighbours along the spine or neck, and how far from the first to the second, between
    /// 0 and 1.
    Between(usize, usize, f64),
}

/// Which joint of the body follows which joint of the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Correspondence {
    /// Roles in the motion's skeleton.
    pub source: Humanoid,
    /// Roles in the body's skeleton.
    pub target: Humanoid,
    /// `[target joints]`; `None` keeps the rest pose relative to the parent.
    pub drives: Vec<Option<Drive>>,
    source_joint_count: usize,
}

impl Correspondence {
    /// Matches two skeletons.
    ///
    /// Each pair names a joint of `source`, then what follows it: a joint of `target`. Instead of
    /// either joint a role may stand (`leftUpperLeg`), which then belongs to the other joint.
    /// O(source joints x target joints)
    ///
    /// # Errors
    /// Names in `pairs` that mean nothing or contradict each other; roles that several joints could
    /// play; skeletons without legs or head.
    pub fn new(
        source: &Skeleton,
        target: &Skeleton,
        pairs: &[(String, String)],
    ) -> Result<Self, FitError> {
        let mut of_source = candidates(source);
        let mut of_target = candidates(target);
        let direct = overrule(source, target, pairs, &mut of_source, &mut of_target)?;
        let source_roles = Humanoid::choose(source, Which::Source, &of_source)?;
        let target_roles = Humanoid::choose(target, Which::Target, &of_target)?;

        let mut drives = vec![None; target.joints.len()];
        drives[target_roles.hips] = Some(Drive::Joint(source_roles.hips));
        let (spine, neck) = (&source_roles.spine, &source_roles.neck);
        let chest = spine.last().copied().unwrap_or(source_roles.hips);
        spread(source_roles.hips, spine, &target_roles.spine, &mut drives);
        spread(chest, neck, &target_roles.neck, &mut drives);
        for (&role, &joint) in &target_roles.roles {
            if role != Role::Head {
                let found = source_roles.roles.get(&role).copied();
                let found = found.or_else(|| finger_instead(role, &source_roles));
                drives[joint] = found.map(Drive::Joint);
            }
        }
        same_names(
            (source, &source_roles),
            (target, &target_roles),
            &mut drives,
        );
        for (from, to) in direct {
            drives[to] = Some(Drive::Joint(from));
        }
        Ok(Self {
            source: source_roles,
            target: target_roles,
            drives,
            source_joint_count: source.joints.len(),
        })
    }

    /// Whether this can be of these two skeletons, by their sizes.
    pub(super) fn is_of(&self, source: &Skeleton, target: &Skeleton) -> bool {
        self.source_joint_count == source.joints.len() && self.drives.len() == target.joints.len()
    }

    /// Joints of the body from the hips down that follow nothing.
    #[must_use]
    pub fn unmapped_target(&self, target: &Skeleton) -> Vec<usize> {
        let above: BTreeSet<usize> = ancestors(target, self.target.hips).collect();
        let free = |&joint: &usize| self.drives[joint].is_none() && !above.contains(&joint);
        (0..self.drives.len()).filter(free).collect()
    }

    /// Joints of the motion that nothing follows.
    #[must_use]
    pub fn unmapped_source(&self, source: &Skeleton) -> Vec<usize> {
        let mut used: BTreeSet<usize> = ancestors(source, self.source.hips).collect();
        for drive in self.drives.iter().flatten() {
            match *drive {
                Drive::Joint(joint) => used.extend([joint]),
                Drive::Between(first, second, _) => used.extend([first, second]),
            }
        }
        (0..source.joints.len())
            .filter(|joint| !used.contains(joint))
            .collect()
    }

    /// Joints of the body's arms and legs, by role, that follow nothing.
    #[must_use]
    pub fn unmapped_limbs(&self) -> Vec<Role> {
        let free = |(role, joint): (&Role, &usize)| {
            let limb = matches!(role, Role::Limb(..)) && self.drives[*joint].is_none();
            limb.then_some(*role)
        };
        self.target.roles.iter().filter_map(free).collect()
    }
}

/// Spreads a chain of source joints over a chain of target joints.
///
/// Both chains begin with the joint they hang on, which corresponds already. Joint `k` of `n` in the
/// target stands at `k m / n` of the `m` joints in the source.
fn spread(root: usize, source: &[usize], target: &[usize], drives: &mut [Option<Drive>]) {
    let at = |index: usize| if index == 0 { root } else { source[index - 1] };
    for (index, &joint) in target.iter().enumerate() {
        let position = (index + 1) * source.len();
        let (whole, rest) = (position / target.len(), position % target.len());
        #[allow(clippy::cast_precision_loss, reason = "fewer than 65535 joints")]
        let fraction = rest as f64 / target.len() as f64;
        drives[joint] = Some(if rest == 0 {
            Drive::Joint(at(whole))
        } else {
            Drive::Between(at(whole), at(whole + 1), fraction)
        });
    }
}

/// A joint for all fingers follows the middle finger, or the index finger, of a rig that has them.
fn finger_instead(role: Role, source: &Humanoid) -> Option<usize> {
    let Role::Finger(side, Finger::All, _) = role else {
        return None;
    };
    let one = |finger| source.roles.get(&Role::Finger(side, finger, 0)).copied();
    one(Finger::Middle).or_else(|| one(Finger::Index))
}

/// Joints without a role follow a joint without a role of the same name, whatever its spelling.
fn same_names(
    (source, source_roles): (&Skeleton, &Humanoid),
    (target, target_roles): (&Skeleton, &Humanoid),
    drives: &mut [Option<Drive>],
) {
    let free = |skeleton: &Skeleton, roles: &Humanoid| {
        let mut taken: BTreeSet<usize> = ancestors(skeleton, roles.hips).collect();
        taken.extend([roles.hips]);
        taken.extend(
            roles
                .spine
                .iter()
                .chain(&roles.neck)
                .chain(roles.roles.values()),
        );
        let parsed = names::parse(skeleton.joints.iter().map(|joint| joint.name.as_str()));
        let mut by_name: BTreeMap<names::Name, Vec<usize>> = BTreeMap::new();
        for (joint, name) in parsed
            .into_iter()
            .enumerate()
            .filter(|(at, _)| !taken.contains(at))
        {
            by_name.entry(name).or_default().push(joint);
        }
        by_name
    };
    let sources = free(source, source_roles);
    for (name, joints) in free(target, target_roles) {
        if let (&[to], Some(&[from])) = (&joints[..], sources.get(&name).map(Vec::as_slice)) {
            drives[to] = Some(Drive::Joint(from));
        }
    }
}

/// Applies the pairs: roles are settled in the candidates, the rest is returned as (source, target).
fn overrule(
    source: &Skeleton,
    target: &Skeleton,
    pairs: &[(String, String)],
    of_source: &mut Candidates,
    of_target: &mut Candidates,
) -> Result<Vec<(usize, usize)>, FitError> {
    let mut direct = Vec::new();
    let mut settled = BTreeSet::new();
    let mut followers = BTreeSet::new();
    for (from, to) in pairs {
        let (joint, other) = (find(source, from), find(target, to));
        let role = match (joint, other) {
            (Some(joint), Some(other)) => {
                if !followers.insert(other) {
                    return Err(FitError::MappedTwice { name: to.clone() });
                }
                let plays = |roles: &Candidates, joint| {
                    roles
                        .iter()
                        .find(|(_, joints)| joints.contains(&joint))
                        .map(|(&role, _)| role)
                };
                let Some(role) = plays(of_target, other).or_else(|| plays(of_source, joint)) else {
                    direct.push((joint, other));
                    continue;
                };
                role
            }
            (Some(_), None) => Role::parse(to).ok_or_else(|| unknown(Which::Target, target, to))?,
            (None, Some(_)) => {
                Role::parse(from).ok_or_else(|| unknown(Which::Source, source, from))?
            }
            (None, None) => {
                if Role::parse(from).is_some() && Role::parse(to).is_some() {
                    return Err(FitError::NoJoint {
                        source_name: from.clone(),
                        target_name: to.clone(),
                    });
                }
                return Err(if Role::parse(from).is_some() {
                    unknown(Which::Target, target, to)
                } else {
                    unknown(Which::Source, source, from)
                });
            }
        };
        for (which, joint, roles) in [
            (Which::Source, joint, &mut *of_source),
            (Which::Target, other, &mut *of_target),
        ] {
            let Some(joint) = joint else { continue };
            if !settled.insert((which == Which::Source, role)) {
                return Err(FitError::MappedTwice {
                    name: role.to_string(),
                });
            }
            // A joint plays one role only.
            roles
                .values_mut()
                .for_each(|joints| joints.retain(|&other| other != joint));
            roles.retain(|_, joints| !joints.is_empty());
            roles.insert(role, vec![joint]);
        }
    }
    Ok(direct)
}

/// The joint of this name; in other case or with another prefix if only one fits.
fn find(skeleton: &Skeleton, name: &str) -> Option<usize> {
    skeleton.find(name).or_else(|| {
        let plain = |name: &str| name.rsplit([':', '|']).next().map(str::to_lowercase);
        let same = |&joint: &usize| plain(&skeleton.joints[joint].name) == plain(name);
        let mut found = (0..skeleton.joints.len()).filter(same);
        found.next().filter(|_| found.next().is_none())
    })
}

fn unknown(which: Which, skeleton: &Skeleton, name: &str) -> FitError {
    let wanted = name.to_lowercase();
    let resembles = |own: &&String| {
        let own = own.to_lowercase();
        !wanted.is_empty() && (own.contains(&wanted) || wanted.contains(&own))
    };
    let names = skeleton.joints.iter().map(|joint| &joint.name);
    FitError::UnknownJoint {
        which,
        name: name.to_owned(),
        similar: names.filter(resembles).take(3).cloned().collect(),
    }
}

#[cfg(test)]
mod tests;
