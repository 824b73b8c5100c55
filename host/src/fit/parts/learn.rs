//! The whole way from a capture to tables.

use glam::DVec3;

use super::collapsed::Example;
use super::exact::{Membership, Ridge};
use super::segments::normalised;
use super::spread::Skin;
use super::tables::{ModeData, RigTables};
use super::{
    Glued, MarkerPlayer, PartsFitError, Segments, collapsed, exact, hybrid, marker_frame, patches,
    rig, weights,
};
use crate::model::Mesh;

/// A way from markers to skin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The published one: quadratic parts, radial-basis residuals.
    Exact,
    /// A fixed sparse matrix.
    Collapsed,
    /// Skinning with marker residuals.
    Hybrid,
}

/// How to learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Most markers that move a block in the hybrid mode.
    pub hybrid_markers: usize,
    /// Most markers that move a block in the collapsed mode.
    pub collapsed_markers: usize,
    /// Pull of quadratic parts toward rigid ones.
    pub ridge: Ridge,
    /// Most frames to learn from.
    pub frames: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            hybrid_markers: 8,
            collapsed_markers: 20,
            ridge: Ridge::default(),
            frames: 160,
        }
    }
}

/// A part that moves a marker this much interpolates it.
const MEMBER_WEIGHT: f64 = 0.05;
/// Parts that move a vertex less do not move it.
const LEAST_WEIGHT: f64 = 0.02;
/// Least frames to learn from.
const FEWEST_FRAMES: usize = 8;
/// Residuals may be this much longer than any that was seen, and at least so long in metres.
const MARGIN: f64 = 2.0;
const LEAST_LIMIT: f64 = 0.03;

/// A learnt skin in all three modes.
#[derive(Clone, Debug)]
pub struct Learnt {
    /// From markers to part frames.
    pub rig: RigTables,
    /// Tables of each mode.
    pub exact: ModeData,
    /// See [`Mode::Collapsed`].
    pub collapsed: ModeData,
    /// See [`Mode::Hybrid`].
    pub hybrid: ModeData,
    /// `[markers]`: (part, weight) by the likelihood of their motion.
    pub memberships: Vec<Vec<(u32, f64)>>,
}

impl Learnt {
    /// The tables of a mode.
    #[must_use]
    pub fn mode(&self, mode: Mode) -> &ModeData {
        match mode {
            Mode::Exact => &self.exact,
            Mode::Collapsed => &self.collapsed,
            Mode::Hybrid => &self.hybrid,
        }
    }

    /// Runs a mode.
    ///
    /// # Errors
    /// Tables that the core refuses.
    pub fn player(&self, mode: Mode) -> Result<MarkerPlayer<'_>, PartsFitError> {
        Ok(MarkerPlayer::new(&self.rig, self.mode(mode))?)
    }
}

/// Learns a skin. `markers`: where each is glued, and where it is in mesh space at rest, metres;
/// `frames`: `[frames][markers]`, metres, complete.
/// O(markers vertices^1.5 + frames vertices + vertices markers^2)
///
/// # Errors
/// Too few markers or frames, missing markers, glue beside the mesh, a surface that cannot be
/// factored.
pub fn learn(
    mesh: &Mesh,
    segments: &Segments,
    (markers, rest): (&[Glued], &[DVec3]),
    frames: &[Vec<DVec3>],
    options: &Options,
) -> Result<Learnt, PartsFitError> {
    check(mesh, (markers, rest), frames)?;
    let (positions, normals) = (&mesh.positions, &mesh.normals);
    let step = frames.len().div_ceil(options.frames.max(1)).max(1);
    let frames: Vec<&Vec<DVec3>> = frames.iter().step_by(step).collect();
    let owned: Vec<Vec<DVec3>> = frames.iter().map(|&frame| frame.clone()).collect();

    let skin = Skin::new(positions, normals, &mesh.triangles, markers);
    let distances = skin.distances(markers);
    let by_surface = patches::by_surface(&distances);

    let mut rig = rig::tables(segments, markers, rest, 1e3);
    // Flesh blends its frames one way or the other; the markers show which leaves them less to say.
    let [dual, mean] = [false, true].map(|linear| residuals(&rig, &owned, linear));
    let (dual, mean) = (dual?, mean?);
    let sum = |all: &[Vec<DVec3>]| -> f64 { all.iter().flatten().map(|r| r.length()).sum() };
    let linear = sum(&mean) < sum(&dual);
    let residuals = if linear { mean } else { dual };
    let longest = residuals.iter().flatten().map(|r| r.length());
    let longest = longest.fold(0.0, f64::max);
    rig.residual_limit = (MARGIN * longest).max(LEAST_LIMIT) as f32;

    let memberships = weights::of_markers(segments, markers, rest, &owned);
    let glued = (markers, rest);
    let fields = skin.biharmonic(markers)?;
    let surface = (&skin, &by_surface[..], &fields[..]);
    let exact = exact_mode(mesh, segments, glued, &memberships, surface, options.ridge);
    let order = patches::by_parts(&by_surface, &segments.vertex_weights);
    let blocks = patches::tables(order, &segments.vertex_weights, positions, normals);
    let most = options.hybrid_markers;
    let fields = skin.local(fields, markers);
    let slots = hybrid::slots(&blocks.order, &skin, &fields, &residuals, most);
    let hybrid = ModeData::Hybrid {
        blocks,
        slots,
        linear,
    };

    let mut player = MarkerPlayer::new(&rig, &hybrid)?;
    let mut example = |markers: &Vec<DVec3>| {
        player.step(&marker_frame(markers));
        Example {
            markers: markers.clone(),
            positions: player.positions().to_vec(),
            normals: player.normals().to_vec(),
        }
    };
    let at_rest = example(&rest.to_vec());
    let examples: Vec<Example> = owned.iter().map(&mut example).collect();
    let most = options.collapsed_markers;
    let slots = collapsed::slots(&by_surface, &skin, &at_rest, &examples, &distances, most);
    let collapsed = ModeData::Collapsed {
        order: by_surface,
        slots,
    };
    Ok(Learnt {
        rig,
        exact,
        collapsed,
        hybrid,
        memberships,
    })
}

fn check(
    mesh: &Mesh,
    (markers, rest): (&[Glued], &[DVec3]),
    frames: &[Vec<DVec3>],
) -> Result<(), PartsFitError> {
    let few = |what, found, needed, remedy| PartsFitError::TooFew {
        what,
        found,
        needed,
        remedy,
    };
    if markers.len() < 4 {
        let remedy = "put more on the body";
        return Err(few("markers", markers.len(), 4, remedy));
    }
    if frames.len() < FEWEST_FRAMES {
        let remedy = "give a longer take";
        return Err(few("frames", frames.len(), FEWEST_FRAMES, remedy));
    }
    if rest.len() != markers.len() {
        let remedy = "give one for each marker";
        return Err(few("rest positions", rest.len(), markers.len(), remedy));
    }
    let count = mesh.positions.len();
    for (at, marker) in markers.iter().enumerate() {
        let outside = marker.vertices.iter().find(|&&v| v as usize >= count);
        if let Some(&vertex) = outside {
            return Err(PartsFitError::Glue {
                marker: at,
                vertex,
                count,
            });
        }
    }
    for (at, frame) in frames.iter().enumerate() {
        let missing = (0..markers.len())
            .find(|&marker| !frame.get(marker).is_some_and(|point| point.is_finite()));
        if let Some(marker) = missing {
            return Err(PartsFitError::Missing { frame: at, marker });
        }
    }
    Ok(())
}

/// `[frames][markers]`: residuals as the core finds them.
fn residuals(
    rig: &RigTables,
    frames: &[Vec<DVec3>],
    linear: bool,
) -> Result<Vec<Vec<DVec3>>, PartsFitError> {
    use sinew_core::deform::parts::{RigState, rig_state_len, rig_workspace_len};
    let rig = rig.rig()?.with_linear_blend(linear);
    let (markers, parts) = (rig.marker_count(), rig.part_count());
    let mut state = RigState::with(vec![0.0; rig_state_len(markers, parts)]);
    let mut workspace = vec![0.0; rig_workspace_len(markers, parts)];
    let one = |frame: &Vec<DVec3>| {
        let followed = rig.follow(&marker_frame(frame), &mut state, &mut workspace);
        let followed = followed.expect("the memory has the rig's size");
        let rows = followed.residuals.iter();
        rows.map(|r| DVec3::from_array(r.map(f64::from))).collect()
    };
    Ok(frames.iter().map(one).collect())
}

fn exact_mode(
    mesh: &Mesh,
    segments: &Segments,
    (markers, rest): (&[Glued], &[DVec3]),
    memberships: &[Vec<(u32, f64)>],
    (skin, by_surface, spread): (&Skin, &[u32], &[Vec<f64>]),
    ridge: Ridge,
) -> ModeData {
    let vertex_weights = if segments.smooth {
        segments.vertex_weights.clone()
    } else {
        spread_weights(segments, memberships, spread)
    };
    let mut fields = vec![vec![0.0; mesh.positions.len()]; segments.part_count()];
    for (vertex, row) in vertex_weights.iter().enumerate() {
        for &(part, weight) in row {
            fields[part as usize][vertex] = weight;
        }
    }
    let order = patches::by_parts(by_surface, &vertex_weights);
    let blocks = patches::tables(order, &vertex_weights, &mesh.positions, &mesh.normals);
    // A marker on which several parts act must be known to each, or one of them would miss it.
    let members: Vec<Vec<Membership>> = markers
        .iter()
        .zip(memberships)
        .map(|(marker, likely)| {
            let row = marker.weights_of(&vertex_weights).into_iter();
            let shares = normalised(row.filter(|&(_, share)| share >= MEMBER_WEIGHT));
            let mut row: Vec<Membership> = shares
                .iter()
                .map(|&(part, share)| Membership {
                    part,
                    weight: share * share,
                    share,
                })
                .collect();
            for &(part, weight) in likely {
                match row.iter_mut().find(|own| own.part == part) {
                    Some(own) => own.weight = weight,
                    None => row.push(Membership {
                        part,
                        weight,
                        share: 0.0,
                    }),
                }
            }
            row
        })
        .collect();
    let modes = exact::tables(&blocks, skin, &members, rest, &fields, ridge);
    ModeData::Exact { blocks, modes }
}

/// Weights of vertices from memberships of markers, spread biharmonically (the paper interpolates
/// in the nearest triangle of the marker surface): smooth across borders.
fn spread_weights(
    segments: &Segments,
    memberships: &[Vec<(u32, f64)>],
    spread: &[Vec<f64>],
) -> Vec<Vec<(u32, f64)>> {
    let mut fields = vec![vec![0.0; segments.vertex_weights.len()]; segments.part_count()];
    for (row, weights) in memberships.iter().zip(spread) {
        for &(part, share) in row {
            for (sum, weight) in fields[part as usize].iter_mut().zip(weights) {
                *sum += share * weight;
            }
        }
    }
    let of = |(vertex, own): (usize, &Vec<(u32, f64)>)| {
        let all = fields.iter().enumerate();
        let near = all.map(|(part, field)| (part as u32, field[vertex]));
        let row = normalised(near.filter(|&(_, weight)| weight >= LEAST_WEIGHT));
        // Nothing spreads to where no marker is.
        if row.is_empty() { own.clone() } else { row }
    };
    segments.vertex_weights.iter().enumerate().map(of).collect()
}
