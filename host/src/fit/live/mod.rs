//! Learns from clean takes what the core needs to label and fill markers while they move.
//!
//! In: takes of one marker set, named, gaps allowed. Out: a [`MarkerModel`]: each marker's most
//! rigid neighbours with their distances, the regression that fills it (Park & Hodgins 2006,
//! section 4.3, as [`crate::clean::fill`] does it), and constellations of four by which the set is
//! recognised.

use glam::DVec3;
use sinew_core::asset::{
    Asset, LINK_NUMBERS, MARKER_NUMBERS, MAX_MARKERS, MarkerTables, SEED_NUMBERS,
};
use sinew_core::track::markers::Model;

use crate::clean::fill::{FillOptions, View, fill, in_parallel};
use crate::clean::neighbours::Neighbour;
use crate::import::take::PointKind;
use crate::take::{Take, TakeError};

mod bridge;
mod pairs;
mod regress;
mod seeds;

use pairs::Pairs;

/// How to learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnOptions {
    /// Neighbours of each marker, 3 to 16.
    pub neighbour_count: usize,
    /// Most constellations by which the set is recognised.
    pub seed_count: usize,
    /// A marker seen in a smaller share of the frames is left out, 0 to 1.
    pub least_seen: f64,
}

impl Default for LearnOptions {
    fn default() -> Self {
        Self {
            neighbour_count: 8,
            seed_count: 64,
            least_seen: 0.05,
        }
    }
}

/// Takes from which no model can be learned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LearnError {
    /// Too few markers.
    #[error(
        "{found} named markers are seen often enough, {needed} are needed; give a take that shows \
         the whole set"
    )]
    Markers {
        /// How many there are.
        found: usize,
        /// How many there must be.
        needed: usize,
    },
    /// Too many markers.
    #[error("{found} markers, where a model holds at most {MAX_MARKERS}; give fewer")]
    TooMany {
        /// How many there are.
        found: usize,
    },
    /// Too few frames.
    #[error("{found} frames in all takes together, {needed} are needed; give a longer take")]
    Frames {
        /// How many there are.
        found: usize,
        /// How many there must be.
        needed: usize,
    },
    /// A marker that shares too few frames with others.
    #[error(
        "marker {label}: too few frames show it together with {needed} others; give a take that \
         does, or leave the marker out"
    )]
    Alone {
        /// Which.
        label: String,
        /// Neighbours that it must have.
        needed: usize,
    },
    /// No four markers that hold together.
    #[error(
        "no four markers keep their distances, so the set cannot be recognised; give a longer \
         take, or add markers to the head or the pelvis"
    )]
    NoSeed,
    /// A setting outside its range.
    #[error("{what}: {value}, {range} expected")]
    Setting {
        /// Which.
        what: &'static str,
        /// Its value.
        value: usize,
        /// What is allowed.
        range: &'static str,
    },
    /// Takes that cannot be joined.
    #[error("joining the takes: {0}")]
    Take(#[from] TakeError),
}

/// A marker set as the core tracks it.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerModel {
    /// `[markers]`
    pub labels: Vec<String>,
    /// Frames a second of the takes learned from.
    pub rate: f64,
    /// As [`MarkerTables`] describes them.
    pub markers: Vec<[f32; MARKER_NUMBERS]>,
    /// `[markers x neighbours]`
    pub neighbours: Vec<u16>,
    /// `[markers x neighbours]`
    pub links: Vec<[f32; LINK_NUMBERS]>,
    /// `[seeds x 4]`
    pub seed_markers: Vec<u16>,
    /// `[seeds]`
    pub seeds: Vec<[f32; SEED_NUMBERS]>,
    /// Markers of the takes that were seen too seldom to be learned.
    pub left_out: Vec<String>,
}

impl MarkerModel {
    /// The tables, for the core.
    #[must_use]
    pub fn tables(&self) -> MarkerTables<'_> {
        MarkerTables {
            markers: &self.markers,
            neighbours: &self.neighbours,
            links: &self.links,
            seed_markers: &self.seed_markers,
            seeds: &self.seeds,
        }
    }

    /// The marker set of an asset; `None` where it has none.
    #[must_use]
    pub fn of(asset: &Asset<'_>) -> Option<Self> {
        let tables = asset.live_markers()?;
        let names = 0..tables.markers.len();
        Some(Self {
            labels: names
                .map(|marker| asset.live_name(marker).to_owned())
                .collect(),
            rate: f64::from(asset.live_rate()),
            markers: tables.markers.to_vec(),
            neighbours: tables.neighbours.to_vec(),
            links: tables.links.to_vec(),
            seed_markers: tables.seed_markers.to_vec(),
            seeds: tables.seeds.to_vec(),
            left_out: Vec::new(),
        })
    }

    /// The checked model.
    ///
    /// # Panics
    /// Where somebody has changed the tables to something that is no model.
    #[must_use]
    pub fn model(&self) -> Model<'_> {
        Model::new_checked(self.tables()).expect("a learned model is sound")
    }
}

/// Least number of frames to learn from.
const LEAST_FRAMES: usize = 30;
/// Least number of markers.
const LEAST_MARKERS: usize = 5;
/// Training samples may be filled this well, metres.
const FILLED: f64 = 0.01;

/// Learns a model from takes of one set. `progress` is called once for each marker, from several
/// threads; the result does not depend on them.
///
/// Quadratic in markers, linear in frames.
///
/// # Errors
/// [`LearnError`] where the takes do not show enough.
pub fn learn(
    takes: &[Take],
    options: &LearnOptions,
    progress: &(dyn Fn() + Sync),
) -> Result<MarkerModel, LearnError> {
    if !(3..=16).contains(&options.neighbour_count) {
        return Err(LearnError::Setting {
            what: "neighbours",
            value: options.neighbour_count,
            range: "3 to 16",
        });
    }
    let (take, left_out) = join(takes, options)?;
    let filled = fill(
        &take,
        &FillOptions {
            limit: FILLED,
            ..FillOptions::default()
        },
        &|| {},
    );
    // What was filled well counts as measured: few frames of gappy takes are complete.
    let known = |sigma: &f32| if sigma.is_nan() { f32::NAN } else { 0.0 };
    let sigma: Vec<f32> = filled.sigma.iter().map(known).collect();
    let view = View {
        take: &filled.take,
        sigma: &sigma,
    };
    let count = options.neighbour_count.min(take.marker_count() - 1);
    let pairs = Pairs::measure(&view);
    let seeds = seeds::choose(&view, &pairs, options.seed_count);
    if seeds.is_empty() {
        return Err(LearnError::NoSeed);
    }
    let mut sets: Vec<Vec<Neighbour>> = Vec::with_capacity(take.marker_count());
    for marker in 0..take.marker_count() {
        let ranked = pairs.rank(marker);
        if ranked.len() < count {
            return Err(LearnError::Alone {
                label: take.labels()[marker].clone(),
                needed: count,
            });
        }
        sets.push(ranked[..count].to_vec());
    }
    for seed in &seeds {
        bridge::reach(&mut sets, &pairs, seed.markers);
    }
    let markers: Vec<usize> = (0..take.marker_count()).collect();
    let learned = in_parallel(&markers, |marker| {
        let row = regress::regress(&view, marker, &sets[marker]);
        progress();
        row
    });
    let mut model = MarkerModel {
        labels: take.labels().to_vec(),
        rate: take.rate(),
        markers: Vec::new(),
        neighbours: Vec::new(),
        links: Vec::new(),
        seed_markers: seeds
            .iter()
            .flat_map(|s| s.markers.map(|m| m as u16))
            .collect(),
        seeds: seeds.iter().map(|seed| seed.numbers).collect(),
        left_out,
    };
    for (marker, row) in learned.into_iter().enumerate() {
        let (numbers, links) = row.ok_or_else(|| LearnError::Alone {
            label: model.labels[marker].clone(),
            needed: count,
        })?;
        model.markers.push(numbers);
        model
            .neighbours
            .extend(sets[marker].iter().map(|n| n.marker as u16));
        model.links.extend(links);
    }
    Ok(model)
}

/// All takes one after another, with the markers that are named and seen often enough; and the
/// names of the others.
fn join(takes: &[Take], options: &LearnOptions) -> Result<(Take, Vec<String>), LearnError> {
    let frames: usize = takes.iter().map(Take::frame_count).sum();
    if frames < LEAST_FRAMES {
        return Err(LearnError::Frames {
            found: frames,
            needed: LEAST_FRAMES,
        });
    }
    let mut labels: Vec<String> = Vec::new();
    let mut left_out = Vec::new();
    let mut positions = Vec::new();
    for take in takes {
        for (label, kind) in take.labels().iter().zip(take.kinds()) {
            if *kind != PointKind::Marker || labels.contains(label) || left_out.contains(label) {
                continue;
            }
            let mut path: Vec<DVec3> = Vec::with_capacity(frames);
            for take in takes {
                match take.labels().iter().position(|other| other == label) {
                    Some(marker) => path.extend(take.trajectory(marker)),
                    None => path.extend(std::iter::repeat_n(DVec3::NAN, take.frame_count())),
                }
            }
            let seen = path.iter().filter(|position| !position.is_nan()).count();
            let needed = (options.least_seen * frames as f64).max(LEAST_FRAMES as f64);
            if (seen as f64) < needed {
                left_out.push(label.clone());
            } else {
                labels.push(label.clone());
                positions.extend(path);
            }
        }
    }
    if labels.len() < LEAST_MARKERS {
        return Err(LearnError::Markers {
            found: labels.len(),
            needed: LEAST_MARKERS,
        });
    }
    if labels.len() > MAX_MARKERS {
        return Err(LearnError::TooMany {
            found: labels.len(),
        });
    }
    let rate = takes[0].rate();
    Ok((Take::new(labels, rate, frames, positions)?, left_out))
}
