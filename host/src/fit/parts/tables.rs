//! Owned tables of a marker-driven skin; the core's views borrow them.

use sinew_core::asset::{LANES, Lanes3, MarkerMode};
use sinew_core::deform::parts::{
    Collapsed, Exact, ExactTables, Hybrid, MarkerRig, MarkerRigTables, MarkerRows, MarkerSlots,
    PartBlocks, PartsError,
};

/// Owned [`MarkerRigTables`].
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in MarkerRigTables")]
pub struct RigTables {
    pub rest: Vec<[f32; 3]>,
    pub parents: Vec<u16>,
    pub pivots: Vec<[f32; 4]>,
    pub member_starts: Vec<u32>,
    pub member_markers: Vec<u16>,
    pub member_weights: Vec<f32>,
    pub carrier_starts: Vec<u32>,
    pub carrier_parts: Vec<u16>,
    pub carrier_weights: Vec<f32>,
    pub residual_limit: f32,
}

/// Owned [`PartBlocks`].
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in PartBlocks")]
pub struct BlockTables {
    pub order: Vec<u32>,
    pub positions: Vec<Lanes3>,
    pub normals: Vec<Lanes3>,
    pub starts: Vec<u32>,
    pub parts: Vec<u16>,
    pub weights: Vec<[u16; LANES]>,
}

/// Owned [`MarkerRows`].
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in MarkerRows")]
pub struct SlotRows<Shares> {
    pub starts: Vec<u32>,
    pub markers: Vec<u16>,
    pub shares: Vec<Shares>,
}

impl<Shares> Default for SlotRows<Shares> {
    fn default() -> Self {
        Self {
            starts: vec![0],
            markers: Vec::new(),
            shares: Vec::new(),
        }
    }
}

impl<Shares> SlotRows<Shares> {
    /// Adds the (marker, shares) of the next block.
    pub fn push(&mut self, mut block: Vec<(usize, Shares)>) {
        block.sort_by_key(|slot| slot.0);
        for (marker, shares) in block {
            self.markers.push(marker as u16);
            self.shares.push(shares);
        }
        self.starts.push(self.markers.len() as u32);
    }

    fn view(&self) -> MarkerRows<'_, Shares> {
        MarkerRows {
            starts: &self.starts,
            markers: &self.markers,
            shares: &self.shares,
        }
    }

    /// Mean number of markers a block.
    #[must_use]
    pub fn markers_a_block(&self) -> f64 {
        self.markers.len() as f64 / (self.starts.len().max(2) - 1) as f64
    }
}

/// Owned [`MarkerSlots`].
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in MarkerSlots")]
pub struct SlotTables {
    pub positions: SlotRows<[f32; LANES]>,
    pub tangents: SlotRows<[[f32; LANES]; 2]>,
}

/// Owned [`ExactTables`], without its blocks.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in ExactTables")]
pub struct ModeTables {
    pub gradients: Vec<[[f32; LANES]; 2]>,
    pub to_local: Vec<[f32; 12]>,
    pub from_local: Vec<[f32; 12]>,
    pub dilations: Vec<f32>,
    pub member_starts: Vec<u32>,
    pub member_markers: Vec<u16>,
    pub member_local: Vec<[f32; 4]>,
    pub member_inverse: Vec<[f32; 10]>,
    pub smoothing: f32,
}

impl RigTables {
    /// The core's view, checked.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn rig(&self) -> Result<MarkerRig<'_>, PartsError> {
        MarkerRig::new_checked(MarkerRigTables {
            rest: &self.rest,
            parents: &self.parents,
            pivots: &self.pivots,
            member_starts: &self.member_starts,
            member_markers: &self.member_markers,
            member_weights: &self.member_weights,
            carrier_starts: &self.carrier_starts,
            carrier_parts: &self.carrier_parts,
            carrier_weights: &self.carrier_weights,
            residual_limit: self.residual_limit,
        })
    }
}

impl BlockTables {
    /// The core's view.
    #[must_use]
    pub fn view(&self) -> PartBlocks<'_> {
        PartBlocks {
            order: &self.order,
            positions: &self.positions,
            normals: &self.normals,
            starts: &self.starts,
            parts: &self.parts,
            weights: &self.weights,
        }
    }
}

impl SlotTables {
    /// The core's view.
    #[must_use]
    pub fn view(&self) -> MarkerSlots<'_> {
        MarkerSlots {
            positions: self.positions.view(),
            tangents: self.tangents.view(),
        }
    }
}

/// Everything that a mode needs besides the rig.
#[derive(Clone, Debug, PartialEq)]
pub enum ModeData {
    /// A fixed matrix from markers to vertices.
    Collapsed {
        /// `[vertices]`: vertex of each lane.
        order: Vec<u32>,
        /// Markers of blocks.
        slots: SlotTables,
    },
    /// Skinning on part frames with marker residuals.
    Hybrid {
        /// Parts of blocks.
        blocks: BlockTables,
        /// Markers of blocks.
        slots: SlotTables,
        /// Whether frames are blended linearly, and not as dual quaternions.
        linear: bool,
    },
    /// Quadratic parts with radial-basis residuals.
    Exact {
        /// Parts of blocks.
        blocks: BlockTables,
        /// Transformations.
        modes: ModeTables,
    },
}

impl ModeData {
    /// The core's view, checked, for a rig of so many parts and markers.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn view(&self, (parts, markers): (usize, usize)) -> Result<MarkerMode<'_>, PartsError> {
        Ok(match self {
            Self::Collapsed { order, slots } => {
                MarkerMode::Collapsed(Collapsed::new_checked(order, slots.view(), markers)?)
            }
            Self::Hybrid { blocks, slots, .. } => MarkerMode::Hybrid(Hybrid::new_checked(
                blocks.view(),
                slots.view(),
                (parts, markers),
            )?),
            Self::Exact { blocks, modes } => {
                let tables = ExactTables {
                    blocks: blocks.view(),
                    gradients: &modes.gradients,
                    to_local: &modes.to_local,
                    from_local: &modes.from_local,
                    dilations: &modes.dilations,
                    member_starts: &modes.member_starts,
                    member_markers: &modes.member_markers,
                    member_local: &modes.member_local,
                    member_inverse: &modes.member_inverse,
                    smoothing: modes.smoothing,
                };
                MarkerMode::Exact(Exact::new_checked(tables, markers)?)
            }
        })
    }

    /// Whether frames are blended linearly.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        matches!(self, Self::Hybrid { linear: true, .. })
    }

    /// `[vertices]`: vertex of each lane.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        match self {
            Self::Collapsed { order, .. } => order,
            Self::Hybrid { blocks, .. } | Self::Exact { blocks, .. } => &blocks.order,
        }
    }
}
