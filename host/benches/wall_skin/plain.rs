//! The controls: a copy, and loops as one would write them with `glam`.

use std::hint::black_box;

use glam::{Affine3A, Mat4, Vec3};
use sinew_core::deform::PlainMesh;
use sinew_host::model::Avatar;

/// A mesh as engines hold it.
#[derive(Clone)]
pub struct Plain {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// `[vertices x influences]`
    joints: Vec<u16>,
    /// `[vertices x influences]`
    weights: Vec<f32>,
    influences: usize,
}

impl Plain {
    pub fn new(avatar: &Avatar, influences: usize) -> Self {
        let numbers = |all: &[glam::DVec3]| all.iter().map(|v| v.as_vec3().to_array()).collect();
        let (mut joints, mut weights) = (Vec::new(), Vec::new());
        for row in &avatar.skin.influences {
            for at in 0..influences {
                let (joint, weight) = row.get(at).copied().unwrap_or((0, 0.0));
                joints.push(joint as u16);
                weights.push(weight as f32);
            }
        }
        Self {
            positions: numbers(&avatar.mesh.positions),
            normals: numbers(&avatar.mesh.normals),
            joints,
            weights,
            influences,
        }
    }

    /// As the core's plain path takes it.
    pub fn mesh(&self) -> PlainMesh<'_> {
        let (binds, weights) = (&self.joints, &self.weights);
        PlainMesh::new(
            &self.positions,
            &self.normals,
            binds,
            weights,
            self.influences,
        )
        .expect("lengths agree")
    }

    pub fn touch(&self, positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]) {
        positions.copy_from_slice(&self.positions);
        normals.copy_from_slice(&self.normals);
        let mut sums = [0_u32; 32];
        for chunk in self.weights.as_chunks::<32>().0 {
            for (sum, weight) in sums.iter_mut().zip(chunk) {
                *sum ^= weight.to_bits();
            }
        }
        black_box(sums);
        black_box((positions, normals));
    }

    pub fn mat4(&self, palette: &[Mat4], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]) {
        match self.influences {
            4 => self.mat4_by::<4>(palette, positions, normals),
            _ => self.mat4_by::<8>(palette, positions, normals),
        }
    }

    fn mat4_by<const N: usize>(
        &self,
        palette: &[Mat4],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) {
        let vertices = self.positions.iter().zip(&self.normals);
        let weights = self
            .joints
            .as_chunks::<N>()
            .0
            .iter()
            .zip(self.weights.as_chunks::<N>().0);
        let to = positions.iter_mut().zip(&mut *normals);
        for (((position, normal), (joints, weights)), (to, to_normal)) in
            vertices.zip(weights).zip(to)
        {
            let mut matrix = palette[usize::from(joints[0])] * weights[0];
            for at in 1..N {
                matrix += palette[usize::from(joints[at])] * weights[at];
            }
            *to = matrix
                .transform_point3(Vec3::from_array(*position))
                .to_array();
            *to_normal = matrix
                .transform_vector3(Vec3::from_array(*normal))
                .normalize()
                .to_array();
        }
        black_box((positions, normals));
    }

    pub fn affine(
        &self,
        palette: &[Affine3A],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) {
        match self.influences {
            4 => self.affine_by::<4>(palette, positions, normals),
            _ => self.affine_by::<8>(palette, positions, normals),
        }
    }

    fn affine_by<const N: usize>(
        &self,
        palette: &[Affine3A],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) {
        let vertices = self.positions.iter().zip(&self.normals);
        let weights = self
            .joints
            .as_chunks::<N>()
            .0
            .iter()
            .zip(self.weights.as_chunks::<N>().0);
        let to = positions.iter_mut().zip(&mut *normals);
        for (((position, normal), (joints, weights)), (to, to_normal)) in
            vertices.zip(weights).zip(to)
        {
            let first = &palette[usize::from(joints[0])];
            let (mut matrix, mut move_by) =
                (first.matrix3 * weights[0], first.translation * weights[0]);
            for at in 1..N {
                let other = &palette[usize::from(joints[at])];
                matrix += other.matrix3 * weights[at];
                move_by += other.translation * weights[at];
            }
            *to = (matrix * glam::Vec3A::from_array(*position) + move_by).to_array();
            *to_normal = (matrix * glam::Vec3A::from_array(*normal))
                .normalize()
                .to_array();
        }
        black_box((positions, normals));
    }
}
