//! The system of equation 2, solved each frame.

use core::borrow::BorrowMut;

use super::super::output::{Output, SizeError, VertexOrder, Writer};
use super::LaplacianError;
use super::exact_check;
use super::turns::{MarkerPose, TurnReport, TurnState, Turns, frame, position_of};
use crate::Level;
use crate::asset::Lanes3;
use crate::math::transform_vector;
use crate::solve::sparse::{Factor, FactorParts, Row4};

/// Tables of an exact deformer. Rows are places of the surface in the order of the factors; several
/// vertices may share one, as along the seams of a texture.
#[derive(Clone, Copy, Debug)]
pub struct ExactParts<'a> {
    /// `[vertices]`: vertex of each lane, block after block, each once.
    pub order: &'a [u32],
    /// `[vertices]`: row of each lane.
    pub lane_rows: &'a [u32],
    /// `[blocks]`, or empty where no normals are wanted: at rest, unit length.
    pub rest_normals: &'a [Lanes3],
    /// `[rows]`: rest position x y z in metres, and the inverse of the mass.
    pub rest: &'a [[f32; 4]],
    /// `[rows]`: `L v` at rest, and the weight of the guess, which is part of the factor too.
    pub differential: &'a [[f32; 4]],
    /// `[rows + 1]`: first neighbour of each row.
    pub starts: &'a [u32],
    /// `[edges]`: neighbours; each edge stands at both ends.
    pub neighbours: &'a [u32],
    /// `[edges]`: cotangent weights.
    pub weights: &'a [f32],
    /// `[markers]`: row of each marker, ascending or not, each once.
    pub marker_rows: &'a [u32],
    /// Pairs of markers that are neighbours: a spanning tree, parents first.
    pub marker_edges: &'a [[u16; 2]],
    /// Weight of a marker's position against the differential coordinates.
    pub stiffness: f32,
    /// `[rows]`: four markers that guess the row's position.
    pub guide_markers: &'a [[u16; 4]],
    /// `[rows]`: their weights, which sum to one.
    pub guide_weights: &'a [[f32; 4]],
    /// Factor of `L` with the markers' rows fixed; edges conduct as [`LEAST_CONDUCTION`] says.
    pub harmonic: FactorParts<'a>,
    /// Factor of `L' M^-1 L + stiffness A`, with the weights of the guess on its diagonal.
    pub bilaplacian: FactorParts<'a>,
}

/// A checked exact deformer that borrows its tables.
#[derive(Clone, Copy, Debug)]
pub struct Exact<'a> {
    parts: ExactParts<'a>,
    harmonic: Factor<'a>,
    bilaplacian: Factor<'a>,
}

/// Edges conduct rotations by their cotangent weight, but at least this much: across obtuse angles
/// weights are negative, and rotations would leave the span of those around.
pub const LEAST_CONDUCTION: f32 = 1e-6;

/// Numbers of scratch that [`Exact::step`] needs for `rows` vertices.
#[must_use]
pub const fn exact_workspace_len(rows: usize) -> usize {
    rows * 16
}

impl<'a> Exact<'a> {
    /// Checks every table once; a step cannot fail after that. O(tables)
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn new_checked(parts: ExactParts<'a>) -> Result<Self, LaplacianError> {
        let (harmonic, bilaplacian) = exact_check::check(&parts)?;
        Ok(Self {
            parts,
            harmonic,
            bilaplacian,
        })
    }

    /// Tables that were checked before.
    pub(crate) const fn proved(
        parts: ExactParts<'a>,
        harmonic: Factor<'a>,
        bilaplacian: Factor<'a>,
    ) -> Self {
        Self {
            parts,
            harmonic,
            bilaplacian,
        }
    }

    /// Number of places that are solved for.
    #[must_use]
    pub fn row_count(&self) -> usize {
        self.parts.rest.len()
    }

    /// Number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.parts.order.len()
    }

    /// Number of markers.
    #[must_use]
    pub fn marker_count(&self) -> usize {
        self.parts.marker_rows.len()
    }

    /// The tables.
    #[must_use]
    pub fn parts(&self) -> &ExactParts<'a> {
        &self.parts
    }

    /// Multiplications of a step with `refinements` more solves, for three coordinates; an upper
    /// bound.
    #[must_use]
    pub fn multiply_adds(&self, refinements: usize) -> usize {
        let solve = 3 * self.bilaplacian.multiply_adds() + 18 * self.parts.weights.len();
        let rows = self.row_count();
        4 * self.harmonic.multiply_adds()
            + 150 * rows
            + 30 * self.vertex_count()
            + (solve + 30 * rows).saturating_mul(refinements.saturating_add(1))
    }

    /// Moves the surface to the markers: positions in metres, in the output's order; normals turn
    /// with their vertices.
    ///
    /// `poses`: `[markers]`; missing ones are held. `workspace`: [`exact_workspace_len`] numbers,
    /// old contents do not matter. `state`: [`super::turn_state_len`] of markers and rows.
    /// `refinements`: further solves that take back the rounding of the first; none is enough for
    /// 0.1 mm on a body. O(factor)
    ///
    /// # Errors
    /// [`SizeError`] where the state, the workspace or the output is too small.
    pub fn step<B: BorrowMut<[f32]>>(
        &self,
        poses: &[MarkerPose],
        refinements: usize,
        level: Level,
        state: &mut TurnState<B>,
        workspace: &mut [f32],
        output: &mut Output<'_>,
    ) -> Result<TurnReport, SizeError> {
        let poses = |marker: usize| poses.get(marker).copied();
        self.step_of(poses, refinements, level, state, workspace, output)
    }

    /// As [`Self::step`], with the pose of a marker wherever it comes from.
    pub(crate) fn step_of<B: BorrowMut<[f32]>>(
        &self,
        poses: impl Fn(usize) -> Option<MarkerPose>,
        refinements: usize,
        level: Level,
        state: &mut TurnState<B>,
        workspace: &mut [f32],
        output: &mut Output<'_>,
    ) -> Result<TurnReport, SizeError> {
        let rows = self.row_count();
        let needed = exact_workspace_len(rows);
        let found = workspace.len();
        let short = |buffer, needed, found| SizeError::TooSmall {
            buffer,
            needed,
            found,
        };
        let (vertices, found_vertices) = (self.vertex_count(), output.vertex_count());
        if found_vertices != vertices {
            return Err(short("output", vertices, found_vertices));
        }
        let by_source = output.order == VertexOrder::Source;
        let mut to = output.writer();
        let workspace = workspace.get_mut(..needed);
        let workspace = workspace.ok_or(short("workspace", needed, found))?;
        let rows4: &mut [Row4] = workspace.as_chunks_mut().0;
        let split = rows4.split_at_mut_checked(2 * rows);
        let (one, two) = split.ok_or(short("workspace", needed, found))?;
        let split = one.split_at_mut_checked(rows);
        let (turned, position) = split.ok_or(short("workspace", needed, found))?;
        let split = two.split_at_mut_checked(rows);
        let (residual, right) = split.ok_or(short("workspace", needed, found))?;

        let mut turns = state.parts(self.marker_count(), rows)?;
        let rest = |marker: usize| {
            let row = self.parts.marker_rows.get(marker);
            let row = row.and_then(|&row| self.parts.rest.get(row as usize));
            row.map_or([0.0; 3], |&[x, y, z, _]| [x, y, z])
        };
        let mut report = turns.follow(poses, rest, self.parts.marker_edges);
        self.spread_rotations(&turns, turned, level);
        self.guess(&turns, turned, position);
        if turns.is_far(self.parts.marker_edges) {
            turns.rebase(|_, row| turned.get(row).copied().unwrap_or_default());
            report.rebased = true;
        }
        self.turn_normals(turned, by_source, &mut to);
        for refinement in 0..=refinements {
            self.residual(turned, position, residual);
            self.right_hand_side(&turns, residual, position, right);
            if refinement > 0 {
                self.pull(&turns, turned, position, right);
            }
            self.bilaplacian.solve(right, level);
            for (position, change) in position.iter_mut().zip(&*right) {
                *position = add(*position, *change);
            }
        }
        for (place, row) in self.places(by_source) {
            let [x, y, z, _] = position.get(row).copied().unwrap_or_default();
            to.put_position(place, [x, y, z]);
        }
        Ok(report)
    }

    /// Where each lane goes in the output, and its row.
    fn places(&self, by_source: bool) -> impl Iterator<Item = (usize, usize)> + use<'a> {
        let lanes = self.parts.order.iter().zip(self.parts.lane_rows);
        lanes.enumerate().map(move |(lane, (&vertex, &row))| {
            let place = if by_source { vertex as usize } else { lane };
            (place, row as usize)
        })
    }

    fn turn_normals(&self, turned: &[Row4], by_source: bool, to: &mut Writer<'_>) {
        let lanes = self.parts.rest_normals.iter().flat_map(|[x, y, z]| {
            let normals = x.iter().zip(y).zip(z);
            normals.map(|((&x, &y), &z)| [x, y, z])
        });
        for ((place, row), normal) in self.places(by_source).zip(lanes) {
            let turn = turned.get(row).copied().unwrap_or_default();
            let matrix = frame(turn, [0.0; 3]);
            to.put_normal(place, transform_vector(&matrix, normal));
        }
    }

    /// Harmonic fields of the quaternions' components (Zayer et al. 2005): `L q = 0` with the
    /// markers' values given. Unit quaternions come out.
    fn spread_rotations(&self, turns: &Turns<'_>, rotation: &mut [Row4], level: Level) {
        rotation.fill([0.0; 4]);
        for (marker, &row) in self.parts.marker_rows.iter().enumerate() {
            let turn = turns.since_base(marker);
            for (neighbour, weight) in self.edges(row as usize) {
                // Not `max`: rules for signed zeros differ between targets.
                let conducts = if weight > LEAST_CONDUCTION {
                    weight
                } else {
                    LEAST_CONDUCTION
                };
                if let Some(to) = rotation.get_mut(neighbour) {
                    *to = add(*to, scale(turn, conducts));
                }
            }
        }
        for (marker, &row) in self.parts.marker_rows.iter().enumerate() {
            if let Some(to) = rotation.get_mut(row as usize) {
                *to = turns.since_base(marker);
            }
        }
        self.harmonic.solve(rotation, level);
        for (row, rotation) in rotation.iter_mut().enumerate() {
            *rotation = turns.row(row, *rotation);
        }
    }

    /// Positions from four markers. Solving for the difference to them keeps the numbers small,
    /// and with them the rounding.
    fn guess(&self, turns: &Turns<'_>, rotation: &[Row4], position: &mut [Row4]) {
        for (to, guess) in position.iter_mut().zip(self.guesses(turns, rotation)) {
            *to = guess;
        }
    }

    /// `right += pull (guess - v)`; nothing where `v` is the guess.
    fn pull(&self, turns: &Turns<'_>, rotation: &[Row4], position: &[Row4], right: &mut [Row4]) {
        let guesses = self.guesses(turns, rotation);
        let weights = self.parts.differential.iter().zip(guesses);
        for ((to, &at), (&[.., weight], guess)) in right.iter_mut().zip(position).zip(weights) {
            *to = add(*to, scale(sub(guess, at), weight));
        }
    }

    /// The mean place of a row's markers, and from there the row's own rotation: nothing collapses
    /// where markers turn against each other.
    fn guesses<'t>(
        &'t self,
        turns: &'t Turns<'_>,
        rotation: &'t [Row4],
    ) -> impl Iterator<Item = Row4> + use<'t, 'a> {
        let guides = self
            .parts
            .guide_markers
            .iter()
            .zip(self.parts.guide_weights);
        let rows = self.parts.rest.iter().zip(rotation).zip(guides);
        rows.map(|((&[x, y, z, _], &turn), (markers, weights))| {
            let (mut from, mut to) = ([0.0; 4], [0.0; 4]);
            for (&marker, &weight) in markers.iter().zip(weights) {
                let (Some(held), Some(&row)) = (
                    turns.markers.get(usize::from(marker)),
                    self.parts.marker_rows.get(usize::from(marker)),
                ) else {
                    continue;
                };
                let rest = self.parts.rest.get(row as usize).copied();
                from = add(from, scale(rest.unwrap_or_default(), weight));
                let [x, y, z] = position_of(held);
                to = add(to, scale([x, y, z, 0.0], weight));
            }
            let [x, y, z, _] = sub([x, y, z, 0.0], from);
            let [x, y, z] = transform_vector(&frame(turn, [0.0; 3]), [x, y, z]);
            add(to, [x, y, z, 0.0])
        })
    }

    /// `M^-1 (R d - L v)`, `[rows]`.
    fn residual(&self, rotation: &[Row4], position: &[Row4], residual: &mut [Row4]) {
        let rest = self.parts.rest.iter().zip(self.parts.differential);
        for (row, ((to, &turn), (&[.., inverse_mass], &[x, y, z, _]))) in
            residual.iter_mut().zip(rotation).zip(rest).enumerate()
        {
            let [x, y, z] = transform_vector(&frame(turn, [0.0; 3]), [x, y, z]);
            let missing = sub([x, y, z, 0.0], self.laplacian(row, position));
            *to = scale(missing, inverse_mass);
        }
    }

    /// `L' residual + stiffness A (p - v)`, `[rows]`.
    fn right_hand_side(
        &self,
        turns: &Turns<'_>,
        residual: &[Row4],
        position: &[Row4],
        right: &mut [Row4],
    ) {
        for (row, to) in right.iter_mut().enumerate() {
            *to = self.laplacian(row, residual);
        }
        for (held, &row) in turns.markers.iter().zip(self.parts.marker_rows) {
            let [x, y, z] = position_of(held);
            if let (Some(to), Some(&at)) = (right.get_mut(row as usize), position.get(row as usize))
            {
                *to = add(*to, scale(sub([x, y, z, 0.0], at), self.parts.stiffness));
            }
        }
    }

    /// `sum_j w_ij (v_i - v_j)`.
    #[inline(always)]
    fn laplacian(&self, row: usize, v: &[Row4]) -> Row4 {
        let own = v.get(row).copied().unwrap_or_default();
        self.edges(row).fold([0.0; 4], |sum, (neighbour, weight)| {
            let other = v.get(neighbour).copied().unwrap_or_default();
            add(sum, scale(sub(own, other), weight))
        })
    }

    #[inline(always)]
    fn edges(&self, row: usize) -> impl Iterator<Item = (usize, f32)> + use<'a> {
        let range = match (self.parts.starts.get(row), self.parts.starts.get(row + 1)) {
            (Some(&first), Some(&end)) => first as usize..end as usize,
            _ => 0..0,
        };
        let neighbours = self.parts.neighbours.get(range.clone()).unwrap_or_default();
        let weights = self.parts.weights.get(range).unwrap_or_default();
        neighbours
            .iter()
            .zip(weights)
            .map(|(&neighbour, &weight)| (neighbour as usize, weight))
    }
}

#[inline(always)]
fn add([a, b, c, d]: Row4, [e, f, g, h]: Row4) -> Row4 {
    [a + e, b + f, c + g, d + h]
}

#[inline(always)]
fn sub([a, b, c, d]: Row4, [e, f, g, h]: Row4) -> Row4 {
    [a - e, b - f, c - g, d - h]
}

#[inline(always)]
fn scale(row: Row4, factor: f32) -> Row4 {
    row.map(|x| x * factor)
}
