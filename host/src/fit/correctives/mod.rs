//! Correctives: what flesh does when a skeleton alone drives the skin (the future work of Park &
//! Hodgins 2006, section 7).
//!
//! In: a skinned body and dense captures of it. Out: morph targets, and the core's tables that
//! predict their weights from the skeleton's motion.
//!
//! | stage | takes | gives |
//! | --- | --- | --- |
//! | [`pose`] | markers glued to the skin | the skeleton under them |
//! | [`regress`] | residuals of markers, the core's features | residuals as sums of features |
//! | [`modes`] | these sums | few modes a part, spread over the surface |

pub mod modes;
pub mod pose;
pub mod regress;

use glam::{DAffine3, DVec3};
use sinew_core::asset::NO_PARENT;
use sinew_core::deform::parts::{Corrective, CorrectiveTables, PartsError};

use super::parts::{Glued, PartsFitError, Segments};
use crate::bake::write::rows;
use crate::model::{Avatar, Morph};

/// Owned [`CorrectiveTables`].
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in CorrectiveTables")]
pub struct CorrectiveData {
    pub parents: Vec<u16>,
    pub binds: Vec<u16>,
    pub pivots: Vec<[f32; 3]>,
    pub springs: Vec<[[f32; 2]; 2]>,
    pub starts: Vec<u32>,
    pub features: Vec<u16>,
    pub coefficients: Vec<f32>,
    pub ranges: Vec<[f32; 2]>,
}

impl CorrectiveData {
    /// The tables as the core takes them.
    #[must_use]
    pub fn tables(&self) -> CorrectiveTables<'_> {
        CorrectiveTables {
            parents: &self.parents,
            binds: &self.binds,
            pivots: &self.pivots,
            springs: &self.springs,
            starts: &self.starts,
            features: &self.features,
            coefficients: &self.coefficients,
            ranges: &self.ranges,
        }
    }

    /// The core's view, checked, for a skin of so many binds.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn view(&self, binds: usize) -> Result<Corrective<'_>, PartsError> {
        Corrective::new_checked(self.tables(), binds)
    }
}

/// A dense capture of a body whose skeleton's motion is known: consecutive frames.
#[derive(Clone, Debug, Default)]
pub struct Performed {
    /// Frames a second.
    pub rate: f64,
    /// `[frames][joints]`: model space.
    pub poses: Vec<Vec<DAffine3>>,
    /// `[frames][markers]`, metres.
    pub markers: Vec<Vec<DVec3>>,
}

/// Morph targets and what moves them.
#[derive(Clone, Debug, PartialEq)]
pub struct Correctives {
    /// Predicts weights.
    pub data: CorrectiveData,
    /// `[modes]`: to be appended to the body's morph targets.
    pub morphs: Vec<Morph>,
    /// Root mean square of the markers' distance from the skeleton's skin, and of what is left of
    /// it, in stretches that were not learnt from; metres.
    pub held_out: [f64; 2],
}

/// Frames to learn from, in seconds.
const LEAST_SECONDS: f64 = 4.0;
/// Fewest markers.
const FEWEST_MARKERS: usize = 20;

/// Learns correctives. `markers`: where each is glued, and where it is at rest, metres.
/// O(markers vertices^1.5 + parts (frames features^2 + markers^3))
///
/// # Errors
/// Too little to learn from, a surface that cannot be factored, tables that the core refuses.
pub fn learn(
    body: &Avatar,
    (markers, rest): (&[Glued], &[DVec3]),
    performances: &[Performed],
) -> Result<Correctives, PartsFitError> {
    let frames = |p: &Performed| p.poses.len().min(p.markers.len());
    let seconds: f64 = performances.iter().map(|p| frames(p) as f64 / p.rate).sum();
    let few = |what, found: usize, needed, remedy| PartsFitError::TooFew {
        what,
        found,
        needed,
        remedy,
    };
    if markers.len() < FEWEST_MARKERS {
        let (found, remedy) = (markers.len(), "capture more on the body");
        return Err(few("markers", found, FEWEST_MARKERS, remedy));
    }
    if seconds < LEAST_SECONDS {
        let needed = LEAST_SECONDS as usize;
        let remedy = "give a longer take, without gaps";
        return Err(few(
            "seconds without gaps",
            seconds as usize,
            needed,
            remedy,
        ));
    }
    let segments = Segments::of_rig(body, markers);
    let stretches: Vec<regress::Stretch> = performances
        .iter()
        .map(|performed| residuals(body, (markers, rest), performed))
        .collect();
    let mut data = skeleton(body, &segments, markers, rest);
    let parts: Vec<usize> = markers
        .iter()
        .map(|m| segments.at(m)[0].0 as usize)
        .collect();
    let binds = body.skin.binds.len();
    let learnt = regress::learn(&mut data, binds, &parts, &stretches)?;
    let found = modes::reduce(&data, &parts, &learnt);
    let morphs = modes::spread(body, markers, &mut data, found)?;
    data.view(binds)?;
    Ok(Correctives {
        data,
        morphs,
        held_out: learnt.held_out,
    })
}

impl Correctives {
    /// The body with the morph targets appended; a clip that animates others leaves them at 0.
    #[must_use]
    pub fn on(&self, body: &Avatar) -> Avatar {
        let mut body = body.clone();
        let (before, added) = (body.mesh.morphs.len(), self.morphs.len());
        body.mesh.morphs.extend(self.morphs.iter().cloned());
        for track in body
            .clips
            .iter_mut()
            .filter_map(|clip| clip.morph_track.as_mut())
        {
            let wider = track.values.chunks_exact(before.max(1)).flat_map(|row| {
                let zeros = std::iter::repeat_n(0.0, added);
                row.iter().copied().chain(zeros)
            });
            track.values = wider.collect();
        }
        body
    }
}

/// Parts with their binds and pivots, without springs or terms.
fn skeleton(
    body: &Avatar,
    segments: &Segments,
    markers: &[Glued],
    rest: &[DVec3],
) -> CorrectiveData {
    let bind = |name: &String| {
        let joint = body.skeleton.find(name);
        let binds = &body.skin.binds;
        binds.iter().position(|bind| Some(bind.joint) == joint)
    };
    let pivot = |part: usize| {
        let own = markers.iter().zip(rest);
        let own = own.filter(|(marker, _)| segments.at(marker)[0].0 as usize == part);
        let own: Vec<DVec3> = own.map(|(_, &p)| p).collect();
        let middle = own.iter().sum::<DVec3>() / own.len().max(1) as f64;
        middle.as_vec3().to_array()
    };
    let parents = segments.parents.iter();
    CorrectiveData {
        parents: parents
            .map(|parent| parent.map_or(NO_PARENT, |parent| parent as u16))
            .collect(),
        // A joint that moves no vertex has no bind; its markers are then another part's.
        binds: segments
            .names
            .iter()
            .map(|name| bind(name).unwrap_or(0) as u16)
            .collect(),
        pivots: (0..segments.part_count()).map(pivot).collect(),
        springs: vec![[[20.0, 0.3]; 2]; segments.part_count()],
        starts: vec![0],
        ..CorrectiveData::default()
    }
}

/// Markers carried back to the rest pose by the skin that moves them, less where they are there.
fn residuals(
    body: &Avatar,
    (markers, rest): (&[Glued], &[DVec3]),
    performed: &Performed,
) -> regress::Stretch {
    let carried: Vec<Vec<(u32, f64)>> = markers
        .iter()
        .map(|marker| marker.weights_of(&body.skin.influences))
        .collect();
    let mut stretch = regress::Stretch {
        rate: performed.rate,
        ..regress::Stretch::default()
    };
    for (pose, seen) in performed.poses.iter().zip(&performed.markers) {
        let palette = palette(body, pose);
        let back = |(row, (seen, rest)): (&Vec<(u32, f64)>, (&DVec3, &DVec3))| {
            blended(&palette, row).inverse().transform_point3(*seen) - *rest
        };
        let pairs = carried.iter().zip(seen.iter().zip(rest));
        stretch.residuals.push(pairs.map(back).collect());
        let core = palette.iter().map(|matrix| rows(matrix).map(|x| x as f32));
        stretch.palettes.push(core.collect());
    }
    stretch
}

/// `[binds]`: matrices from the rest pose.
fn palette(body: &Avatar, pose: &[DAffine3]) -> Vec<DAffine3> {
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
