//! `sinew verify`: an asset against the oracle.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};
use sinew_core::asset::Asset;

use super::say::Say;
use super::{Failure, load};
use crate::model::Avatar;
use crate::reference;
use crate::verify::{CORE_LIMIT, VerifyReport, limit_of, verify};

/// Check an asset: every byte, every clip against the f64 oracle, the same bits at every level.
#[derive(Args)]
#[command(after_help = "Example:\n  sinew verify body.sinew --json")]
pub(crate) struct Verify {
    /// The asset.
    asset: PathBuf,
}

impl Verify {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let bytes = load::asset(&self.asset)?;
        let asset = bytes
            .asset()
            .map_err(|error| load::fault(&self.asset, &error))?;
        let truth = reference::unpack(&asset);
        let report = measure(&asset, &truth, say);
        let limit = limit_of(&asset, CORE_LIMIT);
        let object = to_json(&report, limit);
        if !report.passed(limit) {
            say.object(&object);
            let limit = report.limit(limit) * 1e3;
            return Err(Failure::Data(format!(
                "{}: does not do what it should (limit {limit:.4} mm); bake it again",
                self.asset.display()
            )));
        }
        Ok(object)
    }
}

/// Compares and tells, with progress.
pub(crate) fn measure(asset: &Asset<'_>, truth: &Avatar, say: &Say) -> VerifyReport {
    let bar = say.progress("verifying", 0);
    let report = verify(asset, truth, |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    tell(&report, say);
    report
}

/// The report in words.
fn tell(report: &VerifyReport, say: &Say) {
    let (clip, seconds, vertex) = report.worst_place;
    say.line(format!(
        "{} frames against the oracle: mean {:.6} mm, worst {:.6} mm (clip {clip}, {seconds:.3} s, vertex {vertex})",
        report.frames,
        report.mean_error * 1e3,
        report.worst_error * 1e3,
    ));
    say.line(format!(
        "normals: worst {:.4} degrees; levels {}; fingerprint {:016x}",
        report.worst_normal.to_degrees(),
        if report.levels_agree {
            "agree to the bit"
        } else {
            "DIFFER"
        },
        report.fingerprint,
    ));
    if report.order_faults > 0 {
        say.line(format!("{} vertices are out of order", report.order_faults));
    }
}

/// `limit`: metres that a body of 1.8 m may be off.
pub(crate) fn to_json(report: &VerifyReport, limit: f64) -> Value {
    let (clip, seconds, vertex) = report.worst_place;
    json!({
        "passed": report.passed(limit),
        "limit_mm": report.limit(limit) * 1e3,
        "frames": report.frames,
        "mean_error_mm": report.mean_error * 1e3,
        "worst_error_mm": report.worst_error * 1e3,
        "worst_place": { "clip": clip, "seconds": seconds, "vertex": vertex },
        "worst_normal_degrees": report.worst_normal.to_degrees(),
        "height_m": report.height,
        "levels_agree": report.levels_agree,
        "order_faults": report.order_faults,
        "fingerprint": format!("{:016x}", report.fingerprint),
    })
}
