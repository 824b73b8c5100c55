//! Keeps some parts of a mesh and only the vertices that they use.

use super::{ImportErrorKind, RawMesh, RawPrimitive};

impl RawMesh {
    /// Keeps the parts with these names and drops all other parts and the vertices that no kept
    /// part uses; kept vertices stay in order.
    ///
    /// A name that no part has as a whole also finds parts that have it as one of several words,
    /// as an OBJ group line with several names gives. Returns, for each vertex before, its index
    /// now. O(vertices + corners).
    ///
    /// # Errors
    /// [`ImportErrorKind::Missing`] with the names there are, if one is not found;
    /// [`ImportErrorKind::BadIndex`] if a part refers to a vertex that does not exist. The mesh is
    /// then unchanged.
    pub fn keep_primitives(&mut self, names: &[&str]) -> Result<Vec<Option<u32>>, ImportErrorKind> {
        let mut kept = vec![false; self.primitives.len()];
        for name in names {
            self.mark(name, &mut kept)?;
        }
        let count = self.positions.len();
        let mut used = vec![false; count];
        for (primitive, _) in self.primitives.iter().zip(&kept).filter(|(_, kept)| **kept) {
            for &corner in &primitive.corners {
                let vertex = used.get_mut(corner as usize);
                *vertex.ok_or_else(|| ImportErrorKind::BadIndex {
                    what: format!("vertex of part {:?}", primitive.name),
                    index: i64::from(corner),
                    count: count as u64,
                })? = true;
            }
        }
        let mut next = 0;
        let new_index: Vec<Option<u32>> = used
            .iter()
            .map(|&used| {
                let index = next;
                next += u32::from(used);
                used.then_some(index)
            })
            .collect();
        let mut part = 0;
        self.primitives.retain(|_| {
            part += 1;
            kept[part - 1]
        });
        for RawPrimitive { corners, .. } in &mut self.primitives {
            for corner in corners {
                *corner = new_index[*corner as usize].unwrap_or_default();
            }
        }
        retain(&mut self.positions, &used);
        if let Some(normals) = &mut self.normals {
            retain(normals, &used);
        }
        if let Some(tangents) = &mut self.tangents {
            retain(tangents, &used);
        }
        if let Some(texcoords) = &mut self.texcoords {
            retain(texcoords, &used);
        }
        for morph in &mut self.morphs {
            retain(&mut morph.positions, &used);
            retain(&mut morph.normals, &used);
        }
        Ok(new_index)
    }

    fn mark(&self, name: &str, kept: &mut [bool]) -> Result<(), ImportErrorKind> {
        let whole = |part: &RawPrimitive| part.name == name;
        let word = |part: &RawPrimitive| part.name.split(' ').any(|word| word == name);
        let is_whole = self.primitives.iter().any(whole);
        let mut found = false;
        for (part, kept) in self.primitives.iter().zip(kept) {
            if if is_whole { whole(part) } else { word(part) } {
                *kept = true;
                found = true;
            }
        }
        if found {
            return Ok(());
        }
        const SHOWN: usize = 8;
        let there: Vec<_> = self.primitives.iter().map(|p| p.name.as_str()).collect();
        let shown = there[..there.len().min(SHOWN)].join(", ");
        let more = there.len().saturating_sub(SHOWN);
        let what = format!("the part {name:?} (there are: {shown}, and {more} more)");
        Err(ImportErrorKind::Missing { what })
    }
}

/// Keeps the marked values; a list of another length, such as a morph target without normals, is
/// left to the checks that follow import.
fn retain<T>(values: &mut Vec<T>, used: &[bool]) {
    if values.len() == used.len() {
        let mut used = used.iter();
        values.retain(|_| used.next().is_some_and(|used| *used));
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use crate::import::{ImportErrorKind, RawMesh, RawMorph, RawPrimitive};

    fn mesh() -> RawMesh {
        let part = |name: &str, corners: [u32; 3]| RawPrimitive {
            name: name.into(),
            corners: corners.to_vec(),
            polygon_sizes: vec![3],
        };
        let positions: Vec<_> = (0..6).map(|i| DVec3::splat(f64::from(i))).collect();
        RawMesh {
            normals: Some(positions.clone()),
            tangents: Some((0..6).map(|i| [f64::from(i); 4]).collect()),
            texcoords: Some((0..6).map(|i| [f64::from(i); 2]).collect()),
            morphs: vec![RawMorph {
                positions: positions.clone(),
                ..RawMorph::default()
            }],
            positions,
            primitives: vec![
                part("body", [0, 2, 4]),
                part("left arm", [1, 2, 5]),
                part("arm", [5, 4, 3]),
            ],
            ..RawMesh::default()
        }
    }

    #[test]
    fn keeps_parts_their_vertices_and_all_that_hangs_on_them() {
        let mut mesh = mesh();
        let map = mesh.keep_primitives(&["body"]).expect("there");
        assert_eq!(map, [Some(0), None, Some(1), None, Some(2), None]);
        let expected = [0.0, 2.0, 4.0].map(DVec3::splat);
        assert_eq!(mesh.positions, expected);
        assert_eq!(mesh.normals.as_deref(), Some(&expected[..]));
        assert_eq!(mesh.texcoords, Some(vec![[0.0; 2], [2.0; 2], [4.0; 2]]));
        assert_eq!(mesh.tangents.map(|t| t.len()), Some(3));
        assert_eq!(mesh.morphs[0].positions, expected);
        assert_eq!(mesh.morphs[0].normals, []);
        assert_eq!(mesh.primitives.len(), 1);
        assert_eq!(mesh.primitives[0].corners, [0, 1, 2]);
    }

    #[test]
    fn a_whole_name_comes_before_a_word_of_one() {
        let names = |select: &[&str]| {
            let mut mesh = mesh();
            mesh.keep_primitives(select).map(|_| {
                let parts = mesh.primitives.into_iter();
                parts.map(|part| part.name).collect::<Vec<_>>()
            })
        };
        assert_eq!(names(&["arm"]), Ok(vec!["arm".to_owned()]));
        assert_eq!(names(&["left"]), Ok(vec!["left arm".to_owned()]));
        let both = names(&["arm", "body"]);
        assert_eq!(both, Ok(vec!["body".to_owned(), "arm".to_owned()]));
    }

    #[test]
    fn what_is_not_there_leaves_the_mesh_alone() {
        let mut changed = mesh();
        let error = changed
            .keep_primitives(&["body", "head"])
            .expect_err("no head");
        assert!(error.to_string().contains("body, left arm, arm"), "{error}");
        assert_eq!(changed, mesh());
        changed.primitives[0].corners[1] = 6;
        let before = changed.clone();
        let error = changed.keep_primitives(&["body"]).expect_err("no vertex 6");
        assert!(matches!(error, ImportErrorKind::BadIndex { index: 6, .. }));
        assert_eq!(changed, before);
    }
}
