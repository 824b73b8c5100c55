//! `sinew bake`: a body and its motion into one asset.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::load::Reading;
use super::markers::FromMarkers;
use super::say::{Say, bytes, notices_json, thousands};
use super::verify::{measure, to_json as error_json};
use super::{Failure, cost, load};
use crate::bake::{BakeOptions, BakeReport, Baked, bake_with};
use crate::export::write_atomic;
use crate::fit::{Correspondence, Options, Reference, feet, floor, retarget};
use crate::import::Place;
use crate::model::{Avatar, Clip, Motion, Notice, Skeleton};
use crate::verify::BAKE_LIMIT;
use sinew_core::frame::Budget;

/// Turn a body and captured motion into an asset, and say how good it is and what it will cost.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew bake --mesh body.glb --output body.sinew
  sinew bake --mesh body.glb --motion walk.bvh --motion run.bvh --output body.sinew
  sinew bake --mesh body.glb --motion walk.bvh --compress 0.5 --output body.sinew
  sinew bake --mesh body.glb --motion odd.bvh --map Bip01_Pelvis=hips --output body.sinew
  sinew bake --mesh body.glb --markers dense.c3d --output body.sinew
  sinew bake --mesh body.glb --markers dense.c3d --mode hybrid --rest-frame 40 --output body.sinew")]
pub(crate) struct Bake {
    /// The body: a .glb or .gltf with skin weights.
    #[arg(long)]
    mesh: PathBuf,
    /// Captured motion (.bvh), put on the body by rotation alone; may be given several times.
    #[arg(long)]
    motion: Vec<PathBuf>,
    #[command(flatten)]
    fitting: Fitting,
    #[command(flatten)]
    from_markers: FromMarkers,
    /// Compress clips: joints, and skin 100 mm around them, may stray so many millimetres.
    #[arg(long, value_name = "MM")]
    compress: Option<f64>,
    /// Where to write the asset.
    #[arg(long, short)]
    output: PathBuf,
}

/// How a captured motion is put on a body.
#[derive(Args, Clone, Default)]
pub(crate) struct Fitting {
    /// The motion's joint SOURCE drives the body's joint TARGET, whatever their names suggest.
    #[arg(long, value_name = "SOURCE=TARGET")]
    map: Vec<String>,
    #[command(flatten)]
    pub reading: Reading,
    /// Count rotations from this frame (0 is the first) instead of the motion's rest pose, where
    /// the actor stands straight in it and not in the rest pose.
    #[arg(long, value_name = "FRAME")]
    reference_frame: Option<usize>,
    /// Leave the height of the motion as it is instead of putting the feet on the floor.
    #[arg(long)]
    keep_height: bool,
    /// Leave feet where rotations alone put them, instead of holding them where they stand.
    #[arg(long)]
    free_feet: bool,
}

impl Fitting {
    /// The motion on the body's skeleton, standing on the floor.
    pub fn fit(
        &self,
        motion: &Motion,
        body: &Avatar,
        name: &str,
    ) -> Result<(Clip, Vec<Notice>), Failure> {
        let map = self.map.iter().map(|pair| {
            pair.split_once('=')
                .map(|(source, target)| (source.to_owned(), target.to_owned()))
                .ok_or_else(|| Failure::Usage(format!("--map {pair}: give SOURCE=TARGET")))
        });
        let map = map.collect::<Result<Vec<_>, _>>()?;
        let correspondence = Correspondence::new(&motion.skeleton, &body.skeleton, &map)?;
        let reference = self
            .reference_frame
            .map_or(Reference::Rest, Reference::Frame);
        let mut options = Options {
            reference,
            ..Options::default()
        };
        let mut fitted = retarget(motion, &body.skeleton, &correspondence, &options)?;
        if !self.keep_height
            && let Some(lift) = floor::lift(body, &correspondence.target, &fitted.clip)
        {
            options.lift = lift;
            fitted = retarget(motion, &body.skeleton, &correspondence, &options)?;
        }
        let mut notices = Vec::new();
        if !(self.keep_height || self.free_feet) {
            let (source, target) = (&correspondence.source, &correspondence.target);
            let (clip, report) = feet::hold(body, target, &fitted.clip, motion, source);
            let stances = report.contacts.iter();
            let stances: usize = stances.map(|(_, on)| on.heel.len() + on.ball.len()).sum();
            if stances > 0 {
                let text = format!(
                    "feet held in {stances} contacts, within {:.1} mm; hips sink {:.0} mm at most",
                    1e3 * report.slide.max(report.height),
                    1e3 * report.sink,
                );
                notices.push(Notice::new(Place::File, text));
            }
            fitted.clip = clip;
        }
        fitted.clip.name = name.to_owned();
        let mut unmapped = |joints: Vec<usize>, skeleton: &Skeleton, what: &str| {
            let names = joints
                .iter()
                .map(|&joint| skeleton.joints[joint].name.as_str());
            let names: Vec<_> = names.collect();
            if !names.is_empty() {
                let text = format!(
                    "{what}: {} (--map SOURCE=TARGET joins them)",
                    names.join(", ")
                );
                notices.push(Notice::new(Place::File, text));
            }
        };
        let (source, target) = (&motion.skeleton, &body.skeleton);
        unmapped(
            correspondence.unmapped_source(source),
            source,
            "joints of the motion that move nothing",
        );
        unmapped(
            correspondence.unmapped_target(target),
            target,
            "joints of the body that stay at rest",
        );
        Ok((fitted.clip, notices))
    }
}

impl Bake {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        if self.compress.is_some_and(|mm| !(mm > 0.0 && mm <= 1e3)) {
            return Err(Failure::Usage(
                "--compress must lie between 0 and 1000 mm".into(),
            ));
        }
        let (mut body, mut notices) = load::avatar(&self.mesh)?;
        say.notices(&self.mesh.display().to_string(), &notices);
        for path in &self.motion {
            let (motion, more) = load::motion(path, self.fitting.reading)?;
            say.notices(&path.display().to_string(), &more);
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            let (clip, fit_notices) = self.fitting.fit(&motion, &body, &name)?;
            say.notices(&path.display().to_string(), &fit_notices);
            notices.extend(more);
            notices.extend(fit_notices);
            body.clips.push(clip);
        }
        let options = BakeOptions {
            compression: self.compress.map(|mm| mm / 1e3),
            ..BakeOptions::default()
        };
        let learnt = self.from_markers.learn(&body, self.fitting.reading, say)?;
        let marker_skin = learnt.as_ref().map(|learnt| &learnt.0);
        let baked = bake_with(&body, &options, marker_skin)?;
        let asset = baked.bytes.asset()?;
        tell(&baked.report, say);
        let error = measure(&asset, &body, say);
        let length = baked.bytes.as_slice().len();
        cost::tell(&asset, length, Budget::UNLIMITED, say);
        write(&baked, &self.output)?;
        say.line(format!(
            "wrote {} ({})",
            self.output.display(),
            bytes(length)
        ));
        let mut object = to_json(&baked.report);
        object["output"] = json!(self.output.display().to_string());
        // Skin beyond the shell around its joint may stray a little farther: twice is allowed.
        let limit = BAKE_LIMIT + 2.0 * options.compression.unwrap_or(0.0);
        object["error"] = error_json(&error, limit);
        object["cost"] = cost::to_json(&asset, length, Budget::UNLIMITED);
        if let Some((_, report)) = learnt {
            object["marker_skin"] = report;
        }
        object["notices"] = notices_json(&notices);
        Ok(object)
    }
}

/// Writes an asset whole or not at all.
pub(crate) fn write(baked: &Baked, output: &std::path::Path) -> Result<(), Failure> {
    write_atomic(output, |file| Ok(file.write_all(baked.bytes.as_slice())?))?;
    Ok(())
}

/// The report in words.
pub(crate) fn tell(report: &BakeReport, say: &Say) {
    let dims = &report.dims;
    say.line(format!(
        "{} vertices in {} blocks, {:.2} slots a block, {} blocks of one joint; {} triangles",
        thousands(dims.vertex_count as u64),
        thousands(dims.block_count as u64),
        dims.slot_count as f64 / dims.block_count as f64,
        thousands(dims.rigid_block_count as u64),
        thousands(dims.triangle_count as u64),
    ));
    say.line(format!(
        "{} joints, {} clips; {} of {} keys kept; weights within {:.1e}",
        dims.joint_count,
        dims.clip_count,
        thousands(report.keys.1 as u64),
        thousands(report.keys.0 as u64),
        report.weight_error,
    ));
    for clip in &report.compression {
        say.line(format!(
            "clip {:?} compressed to {} ({:.1} % of 16-bit samples), {:.3} mm off at most",
            clip.name,
            bytes(clip.bytes),
            100.0 * clip.bytes as f64 / clip.raw_bytes as f64,
            1e3 * clip.error,
        ));
    }
}

pub(crate) fn to_json(report: &BakeReport) -> Value {
    let dims = &report.dims;
    let sections = report.section_bytes.iter();
    let sections = sections.map(|(kind, length)| (format!("{kind:?}"), json!(length)));
    json!({
        "vertices": dims.vertex_count,
        "blocks": dims.block_count,
        "slots": dims.slot_count,
        "rigid_blocks": dims.rigid_block_count,
        "triangles": dims.triangle_count,
        "joints": dims.joint_count,
        "clips": dims.clip_count,
        "keys": { "source": report.keys.0, "kept": report.keys.1 },
        "weight_error": report.weight_error,
        "compression": report.compression.iter().map(|clip| json!({
            "clip": clip.name,
            "worst_error_mm": 1e3 * clip.error,
            "bytes": clip.bytes,
            "bytes_16_bit": clip.raw_bytes,
            "keys": clip.keys,
        })).collect::<Vec<_>>(),
        "section_bytes": sections.collect::<serde_json::Map<_, _>>(),
    })
}
