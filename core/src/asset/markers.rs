//! A marker set as the tracker knows it, learned by the host from clean takes.

use super::Asset;
use super::header::{DIMS_WORDS, count as header_count};

/// Counts of a marker model. They size every buffer and bound the work of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MarkerDims {
    /// Markers.
    pub marker_count: usize,
    /// Neighbours of each marker.
    pub neighbour_count: usize,
    /// Constellations of four by which the set is recognised.
    pub seed_count: usize,
}

/// First of its words in the header.
const WORD: usize = 32;

impl MarkerDims {
    pub(super) const fn read(bytes: &[u8]) -> Self {
        Self {
            marker_count: header_count(bytes, WORD),
            neighbour_count: header_count(bytes, WORD + 1),
            seed_count: header_count(bytes, WORD + 2),
        }
    }

    pub(super) const fn write(&self, words: &mut [usize; DIMS_WORDS]) {
        words[WORD] = self.marker_count;
        words[WORD + 1] = self.neighbour_count;
        words[WORD + 2] = self.seed_count;
    }

    /// Bytes of a table with a row a link.
    pub(super) const fn link_count(&self, row_bytes: usize) -> Option<usize> {
        match self.marker_count.checked_mul(self.neighbour_count) {
            Some(links) => links.checked_mul(row_bytes),
            None => None,
        }
    }

    /// Index of the first count in the header that is out of range.
    pub(super) const fn fault(&self) -> Option<usize> {
        if self.marker_count == 0 {
            if self.neighbour_count != 0 {
                return Some(WORD + 1);
            }
            if self.seed_count != 0 {
                return Some(WORD + 2);
            }
            return None;
        }
        if self.marker_count > MAX_MARKERS {
            return Some(WORD);
        }
        if self.neighbour_count == 0 || self.neighbour_count > MAX_NEIGHBOURS {
            return Some(WORD + 1);
        }
        if self.seed_count == 0 || self.seed_count > MAX_SEEDS {
            return Some(WORD + 2);
        }
        None
    }
}

/// Most seeds of a model.
pub const MAX_SEEDS: usize = 4096;
/// Most frames a second.
pub const MAX_RATE: f32 = 1e4;
/// Most markers of a model.
pub const MAX_MARKERS: usize = 4096;
/// Most neighbours of a marker.
pub const MAX_NEIGHBOURS: usize = 16;
/// Numbers of a marker: home (3), deviation of a fill, memory of its error, 0, 0, 0.
pub const MARKER_NUMBERS: usize = 8;
/// Numbers of a link: shape (3), weight, coefficients (9), distance, its spread, 0.
pub const LINK_NUMBERS: usize = 16;
/// Numbers of a seed: distances ab, ac, bc, ad, bd, cd; tolerance; signed volume.
pub const SEED_NUMBERS: usize = 8;

/// The tables of a model, as they stand in an asset.
#[derive(Clone, Copy, Debug, Default)]
pub struct MarkerTables<'a> {
    /// `[markers]`: home in the local frame (metres), deviation of a fill an axis (metres),
    /// seconds in which its error changes, three zeros.
    pub markers: &'a [[f32; MARKER_NUMBERS]],
    /// `[markers x neighbours]`, most rigid first.
    pub neighbours: &'a [u16],
    /// `[markers x neighbours]`: the neighbour's place in the local frame (metres), its weight
    /// (1 / square metre), how its three departures move the marker (`[3 x 3]`, row-major by
    /// departure), mean distance and its standard deviation (metres), zero.
    pub links: &'a [[f32; LINK_NUMBERS]],
    /// `[seeds x 4]`: markers a, b, c, d.
    pub seed_markers: &'a [u16],
    /// `[seeds]`: distances ab, ac, bc, ad, bd, cd and their tolerance (metres), six times the
    /// signed volume (cubic metres; 0 where the four are too flat to tell their mirror image).
    pub seeds: &'a [[f32; SEED_NUMBERS]],
}

/// Why tables are not a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MarkerError {
    /// A table of a wrong length.
    Length {
        /// Which.
        table: &'static str,
        /// Rows expected.
        expected: usize,
        /// Rows found.
        found: usize,
    },
    /// A count outside its range.
    Count {
        /// What is counted.
        what: &'static str,
        /// How many.
        count: usize,
        /// The largest count.
        limit: usize,
    },
    /// A marker that does not exist, or is its own neighbour.
    Index {
        /// The table.
        table: &'static str,
        /// Row in it.
        row: usize,
        /// What stands there.
        index: usize,
    },
    /// A number that is not finite or outside its range.
    Number {
        /// The table.
        table: &'static str,
        /// Row in it.
        row: usize,
    },
}

impl core::fmt::Display for MarkerError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Length {
                table,
                expected,
                found,
            } => {
                write!(
                    f,
                    "marker model: {found} rows of {table}, {expected} expected"
                )
            }
            Self::Count { what, count, limit } => {
                write!(
                    f,
                    "marker model: {count} {what}, between 1 and {limit} expected"
                )
            }
            Self::Index { table, row, index } => {
                write!(f, "marker model: row {row} of {table} names marker {index}")
            }
            Self::Number { table, row } => {
                write!(
                    f,
                    "marker model: row {row} of {table} holds an unusable number"
                )
            }
        }?;
        write!(f, "; bake the model again")
    }
}

impl core::error::Error for MarkerError {}

/// Largest length in a model, metres.
const FAR: f32 = 100.0;
/// Smallest spread, deviation, tolerance or time in a model.
const LEAST: f32 = 1e-5;

impl MarkerTables<'_> {
    /// Checks every count, index and number. Linear in the tables.
    ///
    /// # Errors
    /// [`MarkerError`] names the first row that is wrong.
    pub fn check(&self) -> Result<MarkerDims, MarkerError> {
        let tables = self;
        let marker_count = tables.markers.len();
        count("markers", marker_count, MAX_MARKERS)?;
        let neighbour_count = tables
            .neighbours
            .len()
            .checked_div(marker_count)
            .unwrap_or(0);
        count("neighbours", neighbour_count, MAX_NEIGHBOURS)?;
        let links = marker_count * neighbour_count;
        length("neighbours", tables.neighbours.len(), links)?;
        length("links", tables.links.len(), links)?;
        let seed_count = tables.seeds.len();
        count("seeds", seed_count, MAX_SEEDS)?;
        length("seed markers", tables.seed_markers.len(), 4 * seed_count)?;
        for (row, &index) in tables.neighbours.iter().enumerate() {
            let index = usize::from(index);
            if index >= marker_count || row.checked_div(neighbour_count) == Some(index) {
                let table = "neighbours";
                return Err(MarkerError::Index { table, row, index });
            }
        }
        for (row, &index) in tables.seed_markers.iter().enumerate() {
            let index = usize::from(index);
            if index >= marker_count {
                let table = "seed markers";
                return Err(MarkerError::Index { table, row, index });
            }
        }
        numbers(
            "markers",
            tables.markers,
            |&[x, y, z, sigma, memory, ..]| {
                is_length(x) && is_length(y) && is_length(z) && is_scale(sigma) && is_scale(memory)
            },
        )?;
        numbers("links", tables.links, |link| {
            let &[
                x,
                y,
                z,
                weight,
                c0,
                c1,
                c2,
                c3,
                c4,
                c5,
                c6,
                c7,
                c8,
                distance,
                spread,
                _,
            ] = link;
            let coefficients = [c0, c1, c2, c3, c4, c5, c6, c7, c8];
            is_length(x)
                && is_length(y)
                && is_length(z)
                && (1e-3..=1e9).contains(&weight)
                && coefficients.iter().all(|c| is_length(*c))
                && is_scale(distance)
                && is_scale(spread)
        })?;
        numbers("seeds", tables.seeds, |seed| {
            let [distances @ .., tolerance, volume] = seed;
            distances.iter().all(|d| is_scale(*d)) && is_scale(*tolerance) && is_length(*volume)
        })?;
        Ok(MarkerDims {
            marker_count,
            neighbour_count,
            seed_count,
        })
    }
}

impl<'a> Asset<'a> {
    /// The marker set; `None` where the asset was baked without.
    #[must_use]
    pub fn live_markers(&self) -> Option<MarkerTables<'a>> {
        (self.dims.markers.marker_count > 0).then_some(self.markers)
    }

    /// Frames a second of the takes that the marker set was learned from; 0 without.
    #[must_use]
    pub fn live_rate(&self) -> f32 {
        self.live_rate.first().map_or(0.0, |&[rate, ..]| rate)
    }

    /// Name of a marker; empty for one that does not exist.
    #[must_use]
    pub fn live_name(&self, marker: usize) -> &'a str {
        match self.live_names.get(marker) {
            Some(&[offset, length]) => self.name(offset, length),
            None => "",
        }
    }
}

fn is_length(x: f32) -> bool {
    (-FAR..=FAR).contains(&x)
}

fn is_scale(x: f32) -> bool {
    (LEAST..=FAR).contains(&x)
}

fn count(what: &'static str, count: usize, limit: usize) -> Result<(), MarkerError> {
    if (1..=limit).contains(&count) {
        Ok(())
    } else {
        Err(MarkerError::Count { what, count, limit })
    }
}

fn length(table: &'static str, found: usize, expected: usize) -> Result<(), MarkerError> {
    if found == expected {
        Ok(())
    } else {
        Err(MarkerError::Length {
            table,
            expected,
            found,
        })
    }
}

fn numbers<T>(
    table: &'static str,
    rows: &[T],
    is_usable: impl Fn(&T) -> bool,
) -> Result<(), MarkerError> {
    match rows.iter().position(|row| !is_usable(row)) {
        Some(row) => Err(MarkerError::Number { table, row }),
        None => Ok(()),
    }
}
