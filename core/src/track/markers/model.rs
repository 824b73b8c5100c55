//! What the host learned about a marker set from clean takes.

use glam::Vec3;

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
pub struct Tables<'a> {
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

/// Tables whose counts agree and whose numbers are usable.
#[derive(Clone, Copy, Debug)]
pub struct Model<'a> {
    tables: Tables<'a>,
    dims: MarkerDims,
}

/// Why tables are not a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ModelError {
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

impl core::fmt::Display for ModelError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Length { table, expected, found } => {
                write!(f, "marker model: {found} rows of {table}, {expected} expected")
            }
            Self::Count { what, count, limit } => {
                write!(f, "marker model: {count} {what}, between 1 and {limit} expected")
            }
            Self::Index { table, row, index } => {
                write!(f, "marker model: row {row} of {table} names marker {index}")
            }
            Self::Number { table, row } => {
                write!(f, "marker model: row {row} of {table} holds an unusable number")
            }
        }?;
        write!(f, "; bake the model again")
    }
}

impl core::error::Error for ModelError {}

/// Largest length in a model, metres.
const FAR: f32 = 100.0;
/// Smallest spread, deviation, tolerance or time in a model.
const LEAST: f32 = 1e-5;

impl<'a> Model<'a> {
    /// Checks every count, index and number. Linear in the tables.
    ///
    /// # Errors
    /// [`ModelError`] names the first row that is wrong.
    pub fn new_checked(tables: Tables<'a>) -> Result<Self, ModelError> {
        let marker_count = tables.markers.len();
        count("markers", marker_count, MAX_MARKERS)?;
        let neighbour_count = tables.neighbours.len().checked_div(marker_count).unwrap_or(0);
        count("neighbours", neighbour_count, MAX_NEIGHBOURS)?;
        let links = marker_count * neighbour_count;
        length("neighbours", tables.neighbours.len(), links)?;
        length("links", tables.links.len(), links)?;
        let seed_count = tables.seeds.len();
        count("seeds", seed_count, MAX_MARKERS)?;
        length("seed markers", tables.seed_markers.len(), 4 * seed_count)?;
        for (row, &index) in tables.neighbours.iter().enumerate() {
            let index = usize::from(index);
            if index >= marker_count || row.checked_div(neighbour_count) == Some(index) {
                let table = "neighbours";
                return Err(ModelError::Index { table, row, index });
            }
        }
        for (row, &index) in tables.seed_markers.iter().enumerate() {
            let index = usize::from(index);
            if index >= marker_count {
                let table = "seed markers";
                return Err(ModelError::Index { table, row, index });
            }
        }
        numbers("markers", tables.markers, |&[x, y, z, sigma, memory, ..]| {
            is_length(x) && is_length(y) && is_length(z) && is_scale(sigma) && is_scale(memory)
        })?;
        numbers("links", tables.links, |link| {
            let &[x, y, z, weight, c0, c1, c2, c3, c4, c5, c6, c7, c8, distance, spread, _] = link;
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
        let dims = MarkerDims {
            marker_count,
            neighbour_count,
            seed_count,
        };
        Ok(Self { tables, dims })
    }

    /// Its counts.
    #[must_use]
    pub const fn dims(&self) -> &MarkerDims {
        &self.dims
    }

    /// Its tables.
    #[must_use]
    pub const fn tables(&self) -> &Tables<'a> {
        &self.tables
    }

    /// A marker's own numbers.
    pub(super) fn marker(&self, marker: usize) -> Marker {
        let row = self.tables.markers.get(marker);
        let [x, y, z, sigma, memory, ..] = row.copied().unwrap_or_default();
        Marker {
            home: Vec3::new(x, y, z),
            sigma,
            memory,
        }
    }

    /// A marker's neighbours, most rigid first.
    #[inline]
    pub(super) fn links(&self, marker: usize) -> impl Iterator<Item = (usize, Link<'a>)> + use<'a> {
        let count = self.dims.neighbour_count;
        let range = marker * count..marker * count + count;
        let links = self.tables.links.get(range.clone()).unwrap_or_default();
        let neighbours = self.tables.neighbours.get(range).unwrap_or_default();
        let each = neighbours.iter().zip(links);
        each.map(|(&index, link)| (usize::from(index), Link(link)))
    }

    /// Markers and geometry of a seed.
    pub(super) fn seed(&self, seed: usize) -> Option<([u16; 4], &'a [f32; SEED_NUMBERS])> {
        let (markers, _) = self.tables.seed_markers.as_chunks();
        Some((*markers.get(seed)?, self.tables.seeds.get(seed)?))
    }
}

/// A marker's own numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Marker {
    /// Mean place in the local frame, metres.
    pub home: Vec3,
    /// Standard deviation of a fill an axis, metres.
    pub sigma: f32,
    /// Seconds in which the error of a fill changes.
    pub memory: f32,
}

/// How a neighbour moves with a marker.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link<'a>(&'a [f32; LINK_NUMBERS]);

impl Link<'_> {
    /// The neighbour's place in the marker's local frame, metres.
    #[inline]
    pub fn shape(&self) -> Vec3 {
        let &[x, y, z, ..] = self.0;
        Vec3::new(x, y, z)
    }

    /// Its weight in the fit of the frame, 1 / square metre.
    #[inline]
    pub fn weight(&self) -> f32 {
        self.0[3]
    }

    /// How far a departure of the neighbour from `shape` moves the marker.
    #[inline]
    pub fn gain(&self, departure: Vec3) -> Vec3 {
        let &[_, _, _, _, a, b, c, d, e, f, g, h, i, ..] = self.0;
        let Vec3 { x, y, z } = departure;
        Vec3::new(
            a * x + d * y + g * z,
            b * x + e * y + h * z,
            c * x + f * y + i * z,
        )
    }

    /// Mean distance, metres.
    #[inline]
    pub fn distance(&self) -> f32 {
        self.0[13]
    }

    /// Its standard deviation, metres.
    #[inline]
    pub fn spread(&self) -> f32 {
        self.0[14]
    }
}

fn is_length(x: f32) -> bool {
    (-FAR..=FAR).contains(&x)
}

fn is_scale(x: f32) -> bool {
    (LEAST..=FAR).contains(&x)
}

fn count(what: &'static str, count: usize, limit: usize) -> Result<(), ModelError> {
    if (1..=limit).contains(&count) {
        Ok(())
    } else {
        Err(ModelError::Count { what, count, limit })
    }
}

fn length(table: &'static str, found: usize, expected: usize) -> Result<(), ModelError> {
    if found == expected {
        Ok(())
    } else {
        Err(ModelError::Length {
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
) -> Result<(), ModelError> {
    match rows.iter().position(|row| !is_usable(row)) {
        Some(row) => Err(ModelError::Number { table, row }),
        None => Ok(()),
    }
}
