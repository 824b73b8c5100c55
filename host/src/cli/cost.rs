//! `sinew cost`: what an asset needs on its target.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use sinew_core::asset::{Asset, Dims, MarkerMode};
use sinew_core::deform::parts::{exact_state_len, rig_state_len, rig_workspace_len};
use sinew_core::frame::{Budget, cost, parts_cost, state_len, workspace_len};

use super::say::{Say, bytes, thousands};
use super::{Failure, load};

/// Flash, RAM and operations a frame, before anything is built.
#[derive(Args)]
#[command(after_help = "Example:\n  sinew cost body.sinew --target cortex-m7 --blocks 100")]
pub(crate) struct CostCommand {
    /// The asset.
    asset: PathBuf,
    /// At most this many blocks of eight vertices a frame.
    #[arg(long)]
    blocks: Option<usize>,
    /// Also estimate instructions a frame for this machine.
    #[arg(long, value_enum)]
    target: Option<Target>,
}

/// A machine whose instructions were counted.
#[derive(Clone, Copy, ValueEnum)]
enum Target {
    /// Single-precision FPU, no vector unit.
    #[value(name = "cortex-m7")]
    CortexM7,
}

impl Target {
    /// Instructions a multiply-add of the bound, measured on the bundled body (tests/budgets.toml).
    fn instructions_a_mul_add(self) -> f64 {
        match self {
            Self::CortexM7 => CORTEX_M7_INSTRUCTIONS_A_MUL_ADD,
        }
    }
}

const CORTEX_M7_INSTRUCTIONS_A_MUL_ADD: f64 = 2.0;

impl CostCommand {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let file = load::asset(&self.asset)?;
        let asset = file
            .asset()
            .map_err(|error| load::fault(&self.asset, &error))?;
        let budget = self.blocks.map_or(Budget::UNLIMITED, Budget::blocks);
        let mut object = to_json(&asset, file.as_slice().len(), budget);
        tell(&asset, file.as_slice().len(), budget, say);
        if let Some(target) = self.target {
            let frame = cost(asset.dims(), budget);
            let estimate = frame.mul_adds as f64 * target.instructions_a_mul_add();
            say.line(format!(
                "estimate       {} instructions a frame",
                thousands(estimate as u64)
            ));
            object["estimated_instructions"] = json!(estimate as u64);
        }
        Ok(object)
    }
}

/// Bytes of RAM: state, workspace, and output of positions and normals.
fn ram(dims: &Dims) -> [usize; 3] {
    [
        4 * state_len(dims),
        4 * workspace_len(dims),
        24 * dims.vertex_count,
    ]
}

pub(crate) fn tell(asset: &Asset<'_>, flash: usize, budget: Budget, say: &Say) {
    let dims = asset.dims();
    let [state, workspace, output] = ram(dims);
    let frame = cost(dims, budget);
    say.line(format!("flash          {}", bytes(flash)));
    say.line(format!(
        "RAM            {} (state {}, workspace {}, output {})",
        bytes(state + workspace + output),
        bytes(state),
        bytes(workspace),
        bytes(output),
    ));
    say.line(format!(
        "a frame        at most {} multiply-adds, {} divisions; reads {}, writes {}",
        thousands(frame.mul_adds),
        thousands(frame.divisions),
        bytes(frame.bytes_read as usize),
        bytes(frame.bytes_written as usize),
    ));
    if let Some([operations, ram]) = by_markers(asset, budget) {
        say.line(format!(
            "by markers     at most {} multiply-adds; {} of RAM besides the output",
            thousands(operations),
            bytes(ram as usize),
        ));
    }
}

/// Multiply-adds of a frame of the skin that markers drive, and its state and workspace in bytes.
fn by_markers(asset: &Asset<'_>, budget: Budget) -> Option<[u64; 2]> {
    let (skin, dims) = (asset.marker_skin()?, asset.dims());
    let (markers, parts) = (skin.rig.marker_count(), skin.rig.part_count());
    let numbers = rig_state_len(markers, parts) + rig_workspace_len(markers, parts);
    let more = match &skin.mode {
        MarkerMode::Exact(exact) => {
            exact_state_len(dims.marker_skin.exact_member_count) + exact.workspace_len()
        }
        _ => 0,
    };
    let operations = parts_cost(dims, budget).mul_adds;
    Some([operations, 4 * (numbers + more) as u64])
}

pub(crate) fn to_json(asset: &Asset<'_>, flash: usize, budget: Budget) -> Value {
    let dims = asset.dims();
    let [state, workspace, output] = ram(dims);
    let frame = cost(dims, budget);
    let mut object = json!({
        "flash_bytes": flash,
        "ram_bytes": { "state": state, "workspace": workspace, "output": output },
        "frame": {
            "mul_adds": frame.mul_adds,
            "divisions": frame.divisions,
            "bytes_read": frame.bytes_read,
            "bytes_written": frame.bytes_written,
        },
    });
    if let Some([operations, ram]) = by_markers(asset, budget) {
        object["by_markers"] = json!({ "mul_adds": operations, "ram_bytes": ram });
    }
    object
}
