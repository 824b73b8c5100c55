//! Fields of offsets on the rest shape.

use glam::DVec3;

use crate::model::Avatar;

/// Offsets below this share of a mode's largest are left out.
const SMALL: f64 = 1e-4;

/// One way in which the flesh can move.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// What moves.
    pub name: String,
    /// Vertices and how far each moves for an amplitude of 1; at most about 1 long. Mesh space.
    pub offsets: Vec<(u32, DVec3)>,
}

/// A direction with the length of its weight for each vertex of a patch.
#[derive(Clone, Debug)]
pub(super) struct Region(Vec<(u32, DVec3)>);

impl Region {
    /// What `field` (vertex, position, normal) gives, where it is not nothing.
    pub fn over(avatar: &Avatar, field: impl Fn(usize, DVec3, DVec3) -> DVec3) -> Self {
        let vertices = avatar
            .mesh
            .positions
            .iter()
            .zip(&avatar.mesh.normals)
            .enumerate();
        let all = vertices
            .map(|(vertex, (&position, &normal))| (vertex as u32, field(vertex, position, normal)));
        Self(all.filter(|(_, offset)| offset.length() > SMALL).collect())
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Moves every vertex along its own direction.
    pub fn directed(&self, name: &str) -> Mode {
        Mode {
            name: name.to_owned(),
            offsets: self.0.clone(),
        }
    }

    /// Moves all vertices along one direction.
    pub fn along(&self, direction: DVec3, name: &str) -> Mode {
        let turned = self
            .0
            .iter()
            .map(|&(vertex, offset)| (vertex, direction * offset.length()));
        Mode {
            name: name.to_owned(),
            offsets: turned.collect(),
        }
    }
}

/// 1 at 0, 0 from 1 on, with two continuous derivatives.
pub(super) fn bump(x: f64) -> f64 {
    let rest = 1.0 - x * x;
    if rest > 0.0 { rest * rest * rest } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::bump;

    #[test]
    fn a_bump_ends_where_it_should() {
        assert_eq!(
            [bump(0.0), bump(1.0), bump(-2.0), bump(f64::NAN)],
            [1.0, 0.0, 0.0, 0.0]
        );
        assert_eq!(bump(0.5), 27.0 / 64.0);
    }
}
