//! What the host learned about a marker set from clean takes.

use glam::Vec3;

use crate::asset::{Asset, LINK_NUMBERS, MarkerDims, MarkerError, MarkerTables, SEED_NUMBERS};

/// Tables whose counts agree and whose numbers are usable.
#[derive(Clone, Copy, Debug)]
pub struct Model<'a> {
    tables: MarkerTables<'a>,
    dims: MarkerDims,
}

impl<'a> Model<'a> {
    /// Checks every count, index and number. Linear in the tables.
    ///
    /// # Errors
    /// [`MarkerError`] names the first row that is wrong.
    pub fn new_checked(tables: MarkerTables<'a>) -> Result<Self, MarkerError> {
        let dims = tables.check()?;
        Ok(Self { tables, dims })
    }

    /// The marker set of an asset, which has been checked; `None` where it has none.
    #[must_use]
    pub fn of(asset: &Asset<'a>) -> Option<Self> {
        let tables = asset.live_markers()?;
        let dims = asset.dims().markers;
        Some(Self { tables, dims })
    }

    /// Its counts.
    #[must_use]
    pub const fn dims(&self) -> &MarkerDims {
        &self.dims
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
