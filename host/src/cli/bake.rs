//! `sinew bake`: a body and its motion into one asset.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::load::Reading;
use super::markers::FromMarkers;
use super::register::Body;
use super::rig::rig;
use super::say::{Say, bytes, notices_json, thousands};
use super::track::learn_from;
use super::verify::{measure, to_json as error_json};
use super::{Failure, cost, load};
use crate::bake::{Additions, BakeOptions, BakeReport, Baked, bake_adding};
use crate::export::write_atomic;
use crate::fit::weights::WeightOptions;
use crate::fit::{Correspondence, Options, Reference, feet, floor, retarget};
use crate::import::Place;
use crate::model::{Avatar, Clip, Motion, Notice, Skeleton};
use crate::simplify::simplify;
use crate::verify::BAKE_LIMIT;
use sinew_core::frame::Budget;

mod correctives;
mod laplacian;

/// Turn a body and captured motion into an asset, and say how good it is and what it will cost.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew bake --mesh body.glb --output body.sinew
  sinew bake --mesh body.glb --motion walk.bvh --motion run.bvh --output body.sinew
  sinew bake --mesh body.glb --marker-set clean.c3d --output body.sinew
  sinew bake --mesh body.glb --motion walk.bvh --compress 0.5 --output body.sinew
  sinew bake --mesh scan.obj --auto-rig --motion walk.bvh --output body.sinew
  sinew bake --mesh body.glb --motion odd.bvh --map Bip01_Pelvis=hips --output body.sinew
  sinew bake --mesh body.glb --centres --levels 5000,2000 --output game.sinew
  sinew bake --mesh body.glb --vertices 2000 --influences 4 --quantise --compress 0.5 --output device.sinew
  sinew bake --mesh body.glb --markers dense.c3d --output body.sinew
  sinew bake --mesh body.glb --correctives dense.c3d --motion walk.bvh --output body.sinew
  sinew bake --mesh body.glb --markers dense.c3d --mode hybrid --rest-frame 40 --output body.sinew
  sinew bake --mode laplacian --mesh scan.ply --markers take.c3d --output scan.sinew
  sinew bake --mode laplacian --mesh scan.obj --template walk.bvh --picture markers.png \\
    --save-pairs markers.txt --output scan.sinew")]
pub(crate) struct Bake {
    /// The body: a .glb or .gltf with skin weights; with --auto-rig, and for scans, a .ply or .obj too.
    #[arg(long)]
    mesh: PathBuf,
    /// Give a body without skin weights a rig first: the skeleton of the first --motion, fitted.
    #[arg(long)]
    auto_rig: bool,
    /// Captured motion (.bvh), put on the body by rotation alone; may be given several times.
    #[arg(long)]
    motion: Vec<PathBuf>,
    /// A named, clean take of a marker set, so that `sinew track` and the core know it; may be given
    /// several times.
    #[arg(long, value_name = "TAKE")]
    marker_set: Vec<PathBuf>,
    #[command(flatten)]
    fitting: Fitting,
    /// Find centres of rotation, which `play --mode centres` needs.
    #[arg(long)]
    centres: bool,
    /// Store positions and normals in 16-bit numbers: half the bytes; the error is stated.
    #[arg(long)]
    quantise: bool,
    /// Simplify the body to at most so many vertices first.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..))]
    vertices: Option<u32>,
    /// Hold coarser levels of detail too, of at most so many vertices each.
    #[arg(long, value_name = "N,N..", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(4..))]
    levels: Vec<u32>,
    /// Keep only the heaviest influences of each vertex.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    influences: Option<u32>,
    #[command(flatten)]
    laplacian: laplacian::Laplacian,
    #[command(flatten)]
    from_markers: FromMarkers,
    #[command(flatten)]
    correctives: correctives::FromCapture,
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
    #[arg(long, value_name = "SOURCE=TARGET", value_parser = load::pair)]
    map: Vec<(String, String)>,
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
        let correspondence = Correspondence::new(&motion.skeleton, &body.skeleton, &self.map)?;
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
        let options = BakeOptions {
            centres: self.centres,
            quantised: self.quantise,
            levels: self.levels.iter().map(|&count| count as usize).collect(),
            compression: self.compress.map(|mm| mm / 1e3),
            ..BakeOptions::default()
        };
        if self.from_markers.is_laplacian() {
            let followed = (self.from_markers.take(), &self.motion[..]);
            let (mesh, reading) = (&self.mesh, self.fitting.reading);
            let (scan, output) = (&self.laplacian, &self.output);
            return scan.run(mesh, followed, reading, &options, output, say);
        }
        let (mut body, mut notices) = if self.auto_rig {
            (self.rigged(say)?, Vec::new())
        } else {
            load::avatar(&self.mesh)?
        };
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
        if let Some(most) = self.influences {
            body.skin.limit(most as usize);
        }
        if let Some(vertices) = self.vertices {
            let before = body.mesh.positions.len();
            let simple = simplify(&body, vertices as usize);
            (body.mesh, body.skin) = (simple.mesh, simple.skin);
            say.line(format!(
                "simplified from {} to {} vertices, {:.2} mm off",
                thousands(before as u64),
                thousands(body.mesh.positions.len() as u64),
                simple.error * 1e3,
            ));
        }
        let marker_set = if self.marker_set.is_empty() {
            None
        } else {
            Some(learn_from(&self.marker_set, self.fitting.reading, say)?)
        };
        let flesh = self.correctives.learn(&body, self.fitting.reading, say)?;
        if let Some((correctives, _)) = &flesh {
            body = correctives.on(&body);
        }
        let learnt = self.from_markers.learn(&body, self.fitting.reading, say)?;
        let additions = Additions {
            marker_skin: learnt.as_ref().map(|learnt| &learnt.0),
            markers: marker_set.as_ref(),
            correctives: flesh.as_ref().map(|flesh| &flesh.0.data),
        };
        let baked = bake_adding(&body, &options, &additions)?;
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
        let packed = baked.report.pack_error.map_or(0.0, |error| error.position);
        let limit = BAKE_LIMIT + packed + 2.0 * options.compression.unwrap_or(0.0);
        object["error"] = error_json(&error, limit);
        object["cost"] = cost::to_json(&asset, length, Budget::UNLIMITED);
        if let Some((_, report)) = learnt {
            object["marker_skin"] = report;
        }
        if let Some((_, report)) = flesh {
            object["correctives"] = report;
        }
        object["notices"] = notices_json(&notices);
        Ok(object)
    }
}

impl Bake {
    /// The body with the skeleton of the first motion.
    fn rigged(&self, say: &Say) -> Result<Avatar, Failure> {
        let Some(path) = self.motion.first() else {
            return Err(Failure::Usage(
                "--auto-rig takes its skeleton from a motion; give a --motion".into(),
            ));
        };
        let (motion, _) = load::motion(path, self.fitting.reading)?;
        let body = Body::load(&self.mesh, self.fitting.reading, false, say)?;
        let options = WeightOptions::default();
        let (skeleton, ends) = (&motion.skeleton, &motion.end_sites);
        let made = rig(&self.mesh, body.mesh(), skeleton, ends, true, &options, say)?;
        Ok(made.body)
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
    if let Some(error) = report.pack_error {
        say.line(format!(
            "16-bit shape: positions within {:.4} mm, normals within {:.4} degrees",
            error.position * 1e3,
            error.normal.to_degrees(),
        ));
    }
    for (index, level) in report.levels.iter().enumerate() {
        say.line(format!(
            "level {}: {} vertices, {} triangles, {} blocks, {:.2} mm off",
            index + 1,
            thousands(level.vertices as u64),
            thousands(level.triangles as u64),
            thousands(level.blocks as u64),
            level.error * 1e3,
        ));
    }
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
        "packed": report.pack_error.map(|error| json!({
            "position_m": error.position,
            "normal_rad": error.normal,
        })),
        "levels": report.levels.iter().map(|level| json!({
            "vertices": level.vertices,
            "triangles": level.triangles,
            "blocks": level.blocks,
            "error_m": level.error,
        })).collect::<Vec<_>>(),
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
