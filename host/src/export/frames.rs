//! A surface in motion as binary glTF: whatever moved it, every viewer shows the same.

use glam::DVec3;

use super::glb::{GlbError, GlbScene, write_glb};
use crate::import::{Interpolation, RawClip, RawMorph};
use crate::model::Mesh;

/// A surface at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// `[vertices]`, metres.
    pub positions: Vec<DVec3>,
    /// `[vertices]`, unit length.
    pub normals: Vec<DVec3>,
}

/// Frames at ascending `times` (seconds) as the bytes of a `.glb`: the first is the mesh, each
/// other a morph target that is full at its time and fades in and out between. 24 bytes a vertex
/// and frame; no frame gives the mesh itself. O(frames x (vertices + frames))
///
/// # Errors
/// [`GlbError`] where the format cannot hold them.
pub fn write_glb_frames(mesh: &Mesh, frames: &[Frame], times: &[f64]) -> Result<Vec<u8>, GlbError> {
    let rest = Frame {
        positions: mesh.positions.clone(),
        normals: mesh.normals.clone(),
    };
    let (first, others) = match frames {
        [first, others @ ..] => (first, others),
        [] => (&rest, frames),
    };
    let differences = |all: &[DVec3], from: &[DVec3]| -> Vec<DVec3> {
        all.iter().zip(from).map(|(&to, &from)| to - from).collect()
    };
    let morphs = others.iter().enumerate().map(|(at, frame)| RawMorph {
        name: format!("frame {}", at + 1),
        positions: differences(&frame.positions, &first.positions),
        normals: differences(&frame.normals, &first.normals),
        rest_weight: 0.0,
    });
    let morphs: Vec<RawMorph> = morphs.collect();
    let weight = |key: usize, morph: usize| f64::from(u8::from(key == morph + 1));
    let keys = 0..frames.len();
    let weights = keys.flat_map(|key| (0..others.len()).map(move |morph| weight(key, morph)));
    let clip = RawClip {
        name: "frames".into(),
        morph_weights: Some((
            Interpolation::Linear,
            times.iter().copied().take(frames.len()).collect(),
            weights.collect(),
        )),
        ..RawClip::default()
    };
    write_glb(&GlbScene {
        name: &mesh.name,
        positions: &first.positions,
        normals: Some(&first.normals),
        triangles: &mesh.triangles,
        morphs: &morphs,
        clips: if morphs.is_empty() {
            &[]
        } else {
            std::slice::from_ref(&clip)
        },
        ..GlbScene::default()
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::import::gltf::read_gltf;

    #[test]
    fn frames_come_back_at_their_times() {
        let at = |height: f64| Frame {
            positions: [DVec3::ZERO, DVec3::X, DVec3::Z]
                .map(|p| p + height * DVec3::Y)
                .to_vec(),
            normals: vec![DVec3::Y; 3],
        };
        let mesh = Mesh {
            name: "sheet".into(),
            positions: at(0.0).positions,
            normals: at(0.0).normals,
            tangents: None,
            texcoords: None,
            triangles: vec![[0, 2, 1]],
            parts: Vec::new(),
            morphs: Vec::new(),
        };
        let bytes =
            write_glb_frames(&mesh, &[at(1.0), at(3.0), at(2.0)], &[0.0, 0.5, 1.0]).unwrap();
        let raw = read_gltf(&bytes, "frames.glb", Path::new("")).unwrap();
        assert_eq!(raw.mesh.positions[1], DVec3::new(1.0, 1.0, 0.0));
        assert_eq!(raw.mesh.morphs[0].positions[1], DVec3::new(0.0, 2.0, 0.0));
        let (_, times, weights) = raw.clips[0].morph_weights.clone().unwrap();
        assert_eq!(times, [0.0, 0.5, 1.0]);
        assert_eq!(weights, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    }
}
