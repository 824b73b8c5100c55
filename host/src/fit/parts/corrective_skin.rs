//! A skeleton's skin with correctives: linear blending over a rest shape that predicted residuals
//! displace.

use glam::{DAffine3, DVec3};
use sinew_core::asset::Dims;
use sinew_core::deform::parts::{Corrective, CorrectiveState, Hybrid, PartFrames, PartsError};
use sinew_core::deform::{Level, Output};

use super::correctives::{CorrectiveData, Stretch, learn, rows};
use super::spread::Skin;
use super::tables::{BlockTables, SlotTables};
use super::{Glued, PartsFitError, Segments, hybrid, patches};
use crate::model::Avatar;

/// A dense capture of a body whose skeleton's motion is known.
#[derive(Clone, Debug, Default)]
pub struct Performed {
    /// Frames a second.
    pub rate: f64,
    /// `[frames][joints]`: model space.
    pub poses: Vec<Vec<DAffine3>>,
    /// `[frames][markers]`, metres, complete.
    pub markers: Vec<Vec<DVec3>>,
}

/// Tables of a skeleton's skin with correctives.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrectiveSkin {
    /// What predicts residuals.
    pub data: CorrectiveData,
    /// `[parts]`: the bind whose matrix is the part's frame.
    pub part_binds: Vec<u16>,
    /// Binds of blocks.
    pub blocks: BlockTables,
    /// Markers of blocks.
    pub slots: SlotTables,
}

/// Most frames from which the spread of residuals is refitted.
const MOST_FRAMES: usize = 160;

/// Learns correctives from performances. `rest`: `[markers]`, metres; `most`: markers a block.
/// O(markers vertices^1.5 + frames markers)
///
/// # Errors
/// A surface that cannot be factored, tables that the core refuses.
pub fn learn_skin(
    body: &Avatar,
    segments: &Segments,
    (markers, rest): (&[Glued], &[DVec3]),
    performances: &[Performed],
    most: usize,
) -> Result<CorrectiveSkin, PartsFitError> {
    let binds = &body.skin.binds;
    let part_binds: Vec<u16> = segments
        .names
        .iter()
        .map(|name| {
            let joint = body.skeleton.find(name);
            let bind = binds.iter().position(|bind| Some(bind.joint) == joint);
            bind.unwrap_or(0) as u16
        })
        .collect();
    let carried: Vec<Vec<(u32, f64)>> = markers
        .iter()
        .map(|marker| marker.weights_of(&body.skin.influences))
        .collect();
    let stretches: Vec<Stretch> = performances
        .iter()
        .map(|performed| {
            let mut stretch = Stretch {
                rate: performed.rate,
                ..Stretch::default()
            };
            for (pose, seen) in performed.poses.iter().zip(&performed.markers) {
                let palette = palette(body, pose);
                let of = |&bind: &u16| palette[usize::from(bind)];
                stretch.frames.push(part_binds.iter().map(of).collect());
                let back = |(row, (seen, rest)): (&Vec<(u32, f64)>, (&DVec3, &DVec3))| {
                    blended(&palette, row).inverse().transform_point3(*seen) - *rest
                };
                let pairs = carried.iter().zip(seen.iter().zip(rest));
                stretch.residuals.push(pairs.map(back).collect());
            }
            stretch
        })
        .collect();
    let memberships: Vec<Vec<(u32, f64)>> = markers.iter().map(|m| segments.at(m)).collect();
    let data = learn(segments, &memberships, rest, &stretches)?;

    let mesh = &body.mesh;
    let skin = Skin::new(&mesh.positions, &mesh.normals, &mesh.triangles, markers);
    let fields = skin.biharmonic(markers)?;
    let by_surface = patches::by_surface(&skin.distances(markers));
    let order = patches::by_parts(&by_surface, &body.skin.influences);
    let influences = &body.skin.influences;
    let blocks = patches::tables(order, influences, &mesh.positions, &mesh.normals);
    let seen: Vec<Vec<DVec3>> = stretches.into_iter().flat_map(|s| s.residuals).collect();
    let step = seen.len().div_ceil(MOST_FRAMES).max(1);
    let seen: Vec<Vec<DVec3>> = seen.into_iter().step_by(step).collect();
    let slots = hybrid::slots(&blocks.order, &skin, &fields, &seen, most);
    Ok(CorrectiveSkin {
        data,
        part_binds,
        blocks,
        slots,
    })
}

/// `[binds]`: matrices from the rest pose.
#[must_use]
pub fn palette(body: &Avatar, pose: &[DAffine3]) -> Vec<DAffine3> {
    let binds = body.skin.binds.iter();
    binds
        .map(|bind| pose[bind.joint] * bind.inverse_bind)
        .collect()
}

fn blended(palette: &[DAffine3], row: &[(u32, f64)]) -> DAffine3 {
    let mut sum = DAffine3::ZERO;
    for &(bind, weight) in row {
        let matrix = &palette[bind as usize];
        sum.matrix3 += matrix.matrix3 * weight;
        sum.translation += matrix.translation * weight;
    }
    sum
}

/// Runs a skin with correctives in the core.
#[derive(Debug)]
pub struct CorrectivePlayer<'t> {
    skin: &'t CorrectiveSkin,
    corrective: Corrective<'t>,
    hybrid: Hybrid<'t>,
    state: CorrectiveState<Vec<f32>>,
    features: Vec<f32>,
    residuals: Vec<[f32; 3]>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    level: Level,
}

impl<'t> CorrectivePlayer<'t> {
    /// Memory for one body. `binds`: of its skin.
    ///
    /// # Errors
    /// Tables that the core refuses.
    pub fn new(skin: &'t CorrectiveSkin, binds: usize) -> Result<Self, PartsError> {
        let corrective = skin.data.view()?;
        let handles = corrective.handle_count();
        let (blocks, slots) = (skin.blocks.view(), skin.slots.view());
        let hybrid = Hybrid::new_checked(blocks, slots, (binds, handles))?;
        Ok(Self {
            skin,
            corrective,
            hybrid,
            state: CorrectiveState::with(vec![0.0; corrective.state_len()]),
            features: vec![0.0; corrective.feature_count()],
            residuals: vec![[0.0; 3]; handles],
            positions: vec![[0.0; 3]; skin.blocks.order.len()],
            normals: vec![[0.0; 3]; skin.blocks.order.len()],
            level: Level::best(),
        })
    }

    /// Steps to a palette `[binds]`, `seconds` after the frame before.
    ///
    /// # Panics
    /// Never: the buffers were made for the tables.
    pub fn step(&mut self, palette: &[[f32; 12]], seconds: f32) {
        let of = |&bind: &u16| palette.get(usize::from(bind)).copied();
        let frames: Option<Vec<[f32; 12]>> = self.skin.part_binds.iter().map(of).collect();
        let frames = frames.unwrap_or_default();
        self.corrective
            .features(&frames, seconds, &mut self.state, &mut self.features)
            .expect("the memory has the right size");
        self.corrective
            .residuals(&self.features, &mut self.residuals);
        let dims = Dims {
            vertex_count: self.positions.len(),
            ..Dims::default()
        };
        let normals = Some(self.normals.as_flattened_mut());
        let mut output = Output::separate(&dims, self.positions.as_flattened_mut(), normals)
            .expect("the buffers have the mesh's size");
        let frames = PartFrames {
            palette,
            duals: &[],
        };
        let all = 0..usize::MAX;
        self.hybrid
            .blocks(&frames, &self.residuals, all, self.level, &mut output);
    }

    /// Metres, `[vertices]`, in the source's order.
    #[must_use]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Unit length, `[vertices]`.
    #[must_use]
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }
}

/// Matrices as the core takes them.
#[must_use]
pub fn core_palette(palette: &[DAffine3]) -> Vec<[f32; 12]> {
    palette.iter().map(rows).collect()
}
