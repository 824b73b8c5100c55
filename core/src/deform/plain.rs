//! Skinning of meshes that were not baked: the caller's own arrays, any number of influences.

use super::output::{Output, SizeError};
use crate::math::{Affine12, rough_inverse_sqrt};

/// A mesh in the caller's arrays.
#[derive(Clone, Copy, Debug)]
pub struct PlainMesh<'m> {
    positions: &'m [[f32; 3]],
    normals: &'m [[f32; 3]],
    binds: &'m [u16],
    weights: &'m [f32],
    influences: usize,
}

impl<'m> PlainMesh<'m> {
    /// Brings the arrays together.
    ///
    /// `positions`: `[vertices]`, metres; `normals`: `[vertices]`, or empty; `binds`, `weights`:
    /// `[vertices x influences]`, row-major, weights of a vertex summing to one. A bind beyond the
    /// palette counts as weightless.
    ///
    /// # Errors
    /// [`SizeError`] where lengths disagree.
    pub fn new(
        positions: &'m [[f32; 3]],
        normals: &'m [[f32; 3]],
        binds: &'m [u16],
        weights: &'m [f32],
        influences: usize,
    ) -> Result<Self, SizeError> {
        let vertices = positions.len();
        let needed = influences.saturating_mul(vertices);
        let lengths = [
            (
                "normals",
                normals.len(),
                if normals.is_empty() { 0 } else { vertices },
            ),
            ("binds", binds.len(), needed),
            ("weights", weights.len(), needed),
        ];
        for (buffer, found, needed) in lengths {
            if found != needed {
                return Err(SizeError::TooSmall {
                    buffer,
                    needed,
                    found,
                });
            }
        }
        if influences == 0 {
            return Err(SizeError::TooSmall {
                buffer: "influences",
                needed: 1,
                found: 0,
            });
        }
        Ok(Self {
            positions,
            normals,
            binds,
            weights,
            influences,
        })
    }

    /// Vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }
}

/// Skins all vertices of a plain mesh, one after another:
/// `v = (sum_i w_i M_i D_i^-1) v_d` (Mažrimas & Beinaravičius, section 2).
///
/// `palette: [binds]`. Baked blocks are faster; this is for meshes that change too often to bake.
/// An output made for fewer vertices gets those. O(vertices x influences)
pub fn skin_plain(mesh: &PlainMesh<'_>, palette: &[Affine12], output: &mut Output<'_>) {
    let mut output = output.writer();
    let rows = mesh.binds.chunks_exact(mesh.influences.max(1));
    let rows = rows.zip(mesh.weights.chunks_exact(mesh.influences.max(1)));
    for (vertex, (&position, (binds, weights))) in mesh.positions.iter().zip(rows).enumerate() {
        let mut matrix = [0.0; 12];
        for (&bind, &weight) in binds.iter().zip(weights) {
            if let Some(row) = palette.get(usize::from(bind)) {
                for (sum, &value) in matrix.iter_mut().zip(row) {
                    *sum += value * weight;
                }
            }
        }
        output.put_position(vertex, crate::math::transform_point(&matrix, position));
        if let Some(&normal) = mesh.normals.get(vertex) {
            let turned = crate::math::transform_vector(&matrix, normal);
            let [x, y, z] = turned;
            let factor = rough_inverse_sqrt(x * x + y * y + z * z + super::skin::SMALLEST_LENGTH2);
            output.put_normal(vertex, turned.map(|value| value * factor));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::Dims;
    use crate::math::IDENTITY;

    #[test]
    fn half_of_two_matrices_is_halfway() {
        let mut lifted = IDENTITY;
        lifted[7] = 2.0;
        let mesh = PlainMesh::new(
            &[[1.0, 0.0, 0.0]],
            &[[0.0, 1.0, 0.0]],
            &[0, 1],
            &[0.5; 2],
            2,
        );
        let dims = Dims {
            vertex_count: 1,
            ..Dims::default()
        };
        let (mut positions, mut normals) = ([0.0; 3], [0.0; 3]);
        let mut output = Output::separate(&dims, &mut positions, Some(&mut normals)).unwrap();
        skin_plain(&mesh.unwrap(), &[IDENTITY, lifted], &mut output);
        assert_eq!(positions, [1.0, 1.0, 0.0]);
        assert!((normals[1] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn lengths_that_disagree_are_refused() {
        let point = [[0.0; 3]];
        assert!(PlainMesh::new(&point, &[], &[0], &[1.0, 0.0], 1).is_err());
        assert!(PlainMesh::new(&point, &[], &[], &[], 0).is_err());
        assert!(PlainMesh::new(&point, &[[0.0; 3]; 2], &[0], &[1.0], 1).is_err());
    }
}
