//! Puts joints in order, parents first, and names them.

use std::collections::HashMap;

use super::{Joint, Skeleton, bad_index, not_finite};
use crate::import::{ImportError, ImportErrorKind, Notice, Place, RawSkeleton};

/// The asset's joint indices are 16-bit, and 0xFFFF means "no parent".
pub const MAX_JOINTS: usize = 0xFFFF;

/// Returns the skeleton and, for every raw joint, its new index. O(joints).
pub(super) fn check(
    raw: RawSkeleton,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<(Skeleton, Vec<usize>), ImportError> {
    let count = raw.joints.len();
    if count > MAX_JOINTS {
        let kind = ImportErrorKind::TooMany {
            what: "joints".into(),
            count: count as u64,
            limit: MAX_JOINTS as u64,
        };
        return Err(kind.at(file, Place::File));
    }
    let order = parents_first(&raw, file)?;
    let mut place = vec![0; count];
    for (new, &old) in order.iter().enumerate() {
        place[old] = new;
    }
    let mut names: HashMap<String, usize> = HashMap::new();
    let mut joints = Vec::with_capacity(count);
    for &old in &order {
        let joint = &raw.joints[old];
        let at = || Place::Item(format!("joint {old} {:?}", joint.name));
        let rest = &joint.rest;
        if !(rest.translation.is_finite() && rest.rotation.is_finite() && rest.scale.is_finite()) {
            return Err(not_finite("the rest pose").at(file, at()));
        }
        let mut rest = *rest;
        let length = rest.rotation.length();
        if length < 1e-6 {
            let kind = ImportErrorKind::OutOfRange {
                what: "the rest rotation's length".into(),
                value: length.to_string(),
                expected: "1".into(),
            };
            return Err(kind.at(file, at()));
        }
        rest.rotation = rest.rotation.normalize();
        joints.push(Joint {
            name: unique_name(&joint.name, old, &mut names, notices),
            parent: joint.parent.map(|parent| place[parent]),
            rest,
        });
    }
    Ok((Skeleton { joints }, place))
}

/// An order in which every parent stands before its children; file order where that holds already.
fn parents_first(raw: &RawSkeleton, file: &str) -> Result<Vec<usize>, ImportError> {
    let count = raw.joints.len();
    for (index, joint) in raw.joints.iter().enumerate() {
        if let Some(parent) = joint.parent.filter(|&parent| parent >= count) {
            let place = Place::Item(format!("joint {index} {:?}", joint.name));
            return Err(bad_index("parent", parent, count).at(file, place));
        }
    }
    let mut order = Vec::with_capacity(count);
    let mut done = vec![false; count];
    let mut chain = Vec::new();
    for start in 0..count {
        // Climb to the first ancestor that is placed already, then place the chain downwards.
        let mut at = Some(start);
        while let Some(joint) = at.filter(|&joint| !done[joint]) {
            if chain.len() > count {
                let name = raw.joints[joint].name.clone();
                return Err(ImportErrorKind::Cycle { joint: name }.at(file, Place::File));
            }
            chain.push(joint);
            at = raw.joints[joint].parent;
        }
        while let Some(joint) = chain.pop() {
            done[joint] = true;
            order.push(joint);
        }
    }
    Ok(order)
}

fn unique_name(
    name: &str,
    index: usize,
    names: &mut HashMap<String, usize>,
    notices: &mut Vec<Notice>,
) -> String {
    let wanted = if name.is_empty() {
        format!("joint_{index}")
    } else {
        name.to_owned()
    };
    let mut unique = wanted.clone();
    while let Some(uses) = names.get_mut(&unique) {
        *uses += 1;
        unique = format!("{wanted}#{uses}");
    }
    names.insert(unique.clone(), 1);
    if unique != name {
        let place = Place::Item(format!("joint {index}"));
        let text = format!("the name {name:?} is empty or taken; called {unique:?} here");
        notices.push(Notice::new(place, text));
    }
    unique
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{RawJoint, Transform};

    fn raw(parents: &[Option<usize>]) -> RawSkeleton {
        let joint = |(index, &parent): (usize, &Option<usize>)| RawJoint {
            name: format!("j{index}"),
            parent,
            rest: Transform::IDENTITY,
        };
        RawSkeleton {
            joints: parents.iter().enumerate().map(joint).collect(),
        }
    }

    #[test]
    fn children_before_parents_are_reordered() {
        let (skeleton, place) =
            check(raw(&[Some(2), None, Some(1)]), "x", &mut Vec::new()).unwrap();
        let names: Vec<_> = skeleton.joints.iter().map(|j| j.name.as_str()).collect();
        assert_eq!(names, ["j1", "j2", "j0"]);
        assert_eq!(place, [2, 0, 1]);
        assert_eq!(skeleton.joints[2].parent, Some(1));
    }

    #[test]
    fn a_cycle_and_a_bad_parent_are_refused() {
        let error = check(raw(&[Some(1), Some(0)]), "x", &mut Vec::new()).unwrap_err();
        assert!(matches!(error.kind, ImportErrorKind::Cycle { .. }));
        let error = check(raw(&[Some(0)]), "x", &mut Vec::new()).unwrap_err();
        assert!(matches!(error.kind, ImportErrorKind::Cycle { .. }));
        let error = check(raw(&[Some(7)]), "x", &mut Vec::new()).unwrap_err();
        assert!(matches!(error.kind, ImportErrorKind::BadIndex { .. }));
    }

    #[test]
    fn repeated_names_are_told_apart() {
        let mut skeleton = raw(&[None, Some(0), Some(0)]);
        skeleton.joints[1].name = "j0".into();
        skeleton.joints[2].name = String::new();
        let mut notices = Vec::new();
        let (skeleton, _) = check(skeleton, "x", &mut notices).unwrap();
        let names: Vec<_> = skeleton.joints.iter().map(|j| j.name.as_str()).collect();
        assert_eq!(names, ["j0", "j0#2", "joint_2"]);
        assert_eq!(notices.len(), 2);
    }
}
