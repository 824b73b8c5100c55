//! What baking a scan found, in words and as JSON.

use serde_json::{Value, json};

use crate::cli::say::Say;
use crate::fit::laplace::Driven;
use crate::fit::laplace::align::Alignment;
use crate::fit::laplace::drive::DriveReport;
use crate::fit::laplace::rig::Rig;

pub(super) fn tell_drive(driven: &Driven, say: &Say) {
    let report = &driven.report;
    say.line(format!(
        "{} frames at {:.0} Hz; markers {:.1} mm from their vertices in the reference pose, size x {:.3}",
        driven.poses.len(),
        driven.rate,
        1e3 * report.misfit,
        report.similarity.scale,
    ));
    if report.retargeted {
        say.line(format!(
            "proportions differ: positions scaled part by part; {} stands of feet, {:.1} mm of slide",
            report.plants,
            1e3 * report.slide
        ));
    }
}

pub(super) fn tell_rig(rig: &Rig, say: &Say) {
    let report = &rig.report;
    if report.attached > 0 {
        let count = report.attached;
        say.line(format!(
            "{count} components without a marker follow their nearest marker"
        ));
    }
    if let (Some((handles, virtual_count)), Some(held_out)) = (report.handles, &report.held_out) {
        let [mean, p99, max] =
            [held_out.mean, held_out.percentile_99, held_out.max].map(|x| 1e3 * x);
        say.line(format!(
            "collapsed: {handles} handles a block, {} markers and {virtual_count} virtual handles; \
             fitted to {} poses",
            report.markers, report.poses.0
        ));
        say.line(format!(
            "from the exact surface in {} poses held out: mean {mean:.2} mm, 99 % below {p99:.2}, \
             at most {max:.2}",
            report.poses.1
        ));
    }
    let [[mean, worst], [kept_mean, kept_worst]] =
        report.volume_loss.map(|loss| loss.map(|x| 1e2 * x));
    say.line(format!(
        "volume lost in a pose: mean {mean:.2} %, worst {worst:.2} %"
    ));
    if (kept_mean, kept_worst) != (mean, worst) {
        say.line(format!(
            "corrected: mean {kept_mean:.2} %, worst {kept_worst:.2} %"
        ));
    }
}

pub(super) fn rig_json(rig: &Rig, drive: &DriveReport, alignment: Option<&Alignment>) -> Value {
    let report = &rig.report;
    let held_out = report.held_out.map(|held_out| {
        json!({
            "mean_mm": 1e3 * held_out.mean,
            "p99_mm": 1e3 * held_out.percentile_99,
            "max_mm": 1e3 * held_out.max,
        })
    });
    json!({
        "markers": report.markers,
        "attached_components": report.attached,
        "handles_a_block": report.handles.map(|handles| handles.0),
        "virtual_handles": report.handles.map(|handles| handles.1),
        "held_out": held_out,
        "poses": { "fitted": report.poses.0, "held_out": report.poses.1 },
        "volume_loss_percent": {
            "mean": 1e2 * report.volume_loss[0][0],
            "worst": 1e2 * report.volume_loss[0][1],
            "corrected_mean": 1e2 * report.volume_loss[1][0],
            "corrected_worst": 1e2 * report.volume_loss[1][1],
        },
        "scale": drive.similarity.scale,
        "marker_misfit_mm": 1e3 * drive.misfit,
        "retargeted": drive.retargeted,
        "foot_stands": drive.plants,
        "foot_slide_mm": 1e3 * drive.slide,
        "alignment": alignment.map(|found| {
            json!({ "residual_mm": 1e3 * found.residual, "lead": found.lead })
        }),
    })
}
