//! `sinew inspect`: what a file holds.

use std::path::PathBuf;

use clap::Args;
use glam::DVec3;
use serde_json::{Value, json};
use sinew_core::asset::{Asset, Dims, SectionKind};

use super::load::{Loaded, Reading};
use super::say::{Say, bytes, notices_json, thousands};
use super::{Failure, load};
use crate::model::{Avatar, Channel, Clip, Mesh, Motion, Skeleton};
use crate::take::Take;

/// Say what any supported file or asset holds: counts, extents, joints, clips, what was repaired.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew inspect body.glb
  sinew inspect walk.bvh --json
  sinew inspect scan.obj --unit mm
  sinew inspect take.c3d --up z")]
pub(crate) struct Inspect {
    /// A .glb, .gltf, .obj, .ply, .bvh, .c3d, .trc, .csv or .sinew.
    file: PathBuf,
    #[command(flatten)]
    reading: Reading,
}

impl Inspect {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let (loaded, notices) = load::any(&self.file, self.reading)?;
        let name = self.file.display().to_string();
        say.line(&name);
        let mut object = match &loaded {
            Loaded::Avatar(avatar) => body(avatar, say),
            Loaded::Motion(motion) => capture(motion, say),
            Loaded::Mesh(mesh) => surface(mesh, say),
            Loaded::Take(take) => markers(take, say),
            Loaded::Asset(file) => {
                let asset = file
                    .asset()
                    .map_err(|error| load::fault(&self.file, &error))?;
                packed(&asset, file.as_slice().len(), say)
            }
        };
        say.notices(&name, &notices);
        object["file"] = json!(name);
        object["notices"] = notices_json(&notices);
        Ok(object)
    }
}

fn body(avatar: &Avatar, say: &Say) -> Value {
    let mut object = surface(&avatar.mesh, say);
    object["kind"] = json!("body");
    object["skeleton"] = hierarchy(&avatar.skeleton, say);
    let influences = avatar.skin.influences.iter().map(Vec::len);
    let most = influences.clone().max().unwrap_or(0);
    let mean = influences.sum::<usize>() as f64 / avatar.skin.influences.len() as f64;
    say.line(format!(
        "  skin      {} joints bound, {mean:.2} influences a vertex, at most {most}",
        avatar.skin.binds.len()
    ));
    object["skin"] = json!({ "binds": avatar.skin.binds.len(), "mean_influences": mean, "max_influences": most });
    object["clips"] = avatar.clips.iter().map(|clip| motion(clip, say)).collect();
    object
}

fn surface(mesh: &Mesh, say: &Say) -> Value {
    let (low, high) = extent(&mesh.positions);
    let size = high - low;
    say.line(format!(
        "  mesh      {} vertices, {} triangles, {} parts, {} morph targets",
        thousands(mesh.positions.len() as u64),
        thousands(mesh.triangles.len() as u64),
        mesh.parts.len(),
        mesh.morphs.len(),
    ));
    say.line(format!(
        "  extent    {:.3} x {:.3} x {:.3} m, lowest point at {:.3} m",
        size.x, size.y, size.z, low.y
    ));
    let parts = mesh.parts.iter();
    let parts = parts.map(|part| json!({ "name": part.name, "triangles": part.triangles.len() }));
    json!({
        "kind": "mesh",
        "vertices": mesh.positions.len(),
        "triangles": mesh.triangles.len(),
        "parts": parts.collect::<Vec<_>>(),
        "morphs": mesh.morphs.iter().map(|morph| morph.name.as_str()).collect::<Vec<_>>(),
        "extent_m": { "min": low.to_array(), "max": high.to_array() },
    })
}

fn extent(points: &[DVec3]) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = points
        .iter()
        .fold(start, |(low, high), &p| (low.min(p), high.max(p)));
    if points.is_empty() {
        (DVec3::ZERO, DVec3::ZERO)
    } else {
        (low, high)
    }
}

fn hierarchy(skeleton: &Skeleton, say: &Say) -> Value {
    let model = skeleton.model(&skeleton.rest());
    let places: Vec<DVec3> = model.iter().map(|matrix| matrix.translation).collect();
    let (low, high) = extent(&places);
    let roots = skeleton
        .joints
        .iter()
        .filter(|joint| joint.parent.is_none())
        .count();
    say.line(format!(
        "  skeleton  {} joints, {roots} root{}, {:.3} m from lowest to highest joint",
        skeleton.joints.len(),
        if roots == 1 { "" } else { "s" },
        high.y - low.y
    ));
    let joints = skeleton.joints.iter().zip(&places);
    let joints = joints.map(|(joint, place)| {
        let parent = joint
            .parent
            .map(|parent| skeleton.joints[parent].name.as_str());
        json!({ "name": joint.name, "parent": parent, "rest_m": place.to_array() })
    });
    json!({ "joints": joints.collect::<Vec<_>>(), "height_m": high.y - low.y })
}

fn motion(clip: &Clip, say: &Say) -> Value {
    let count = |channel| {
        clip.tracks
            .iter()
            .filter(|track| track.channel == channel)
            .count()
    };
    let keys: usize = clip.tracks.iter().map(|track| track.times.len()).sum();
    let rate = clip.sample_period.map(|period| 1.0 / period);
    let sampled = rate.map_or(String::new(), |rate| format!(" at {rate:.2} a second"));
    say.line(format!(
        "  clip      {:?}: {:.3} s{sampled}; {} rotations, {} translations, {} scales, {} keys",
        clip.name,
        clip.duration,
        count(Channel::Rotation),
        count(Channel::Translation),
        count(Channel::Scale),
        thousands(keys as u64),
    ));
    json!({
        "name": clip.name,
        "duration_s": clip.duration,
        "rate_hz": rate,
        "tracks": clip.tracks.len(),
        "keys": keys,
        "morph_weights": clip.morph_track.is_some(),
    })
}

fn capture(file: &Motion, say: &Say) -> Value {
    let skeleton = hierarchy(&file.skeleton, say);
    let clip = motion(&file.clip, say);
    json!({ "kind": "motion", "skeleton": skeleton, "clips": [clip], "end_sites": file.end_sites.len() })
}

fn markers(take: &Take, say: &Say) -> Value {
    let markers = take.marker_count();
    let seconds = take.frame_count() as f64 / take.rate();
    say.line(format!(
        "  markers   {markers}, {} frames at {:.2} a second ({seconds:.2} s)",
        thousands(take.frame_count() as u64),
        take.rate(),
    ));
    let gaps: Vec<usize> = (0..markers)
        .flat_map(|m| take.gaps(m).map(|gap| gap.len()))
        .collect();
    say.line(format!(
        "  missing   {:.2} % of samples in {} gaps, the longest {} frames; {} frames complete",
        take.missing_fraction() * 100.0,
        thousands(gaps.len() as u64),
        thousands(gaps.iter().copied().max().unwrap_or(0) as u64),
        thousands(take.complete_frame_count() as u64),
    ));
    let bounds = take.bounds();
    if let Some((low, high)) = bounds {
        let size = high - low;
        say.line(format!(
            "  extent    {:.3} x {:.3} x {:.3} m",
            size.x, size.y, size.z
        ));
    }
    let source = take.source();
    say.line(format!(
        "  source    {}, {} up",
        source.unit.symbol(),
        source.up.symbol()
    ));
    let rows = take.labels().iter().enumerate().map(|(marker, label)| {
        json!({
            "label": label,
            "missing": take.missing_count(marker),
            "gaps": take.gaps(marker).count(),
        })
    });
    json!({
        "kind": "markers",
        "markers": rows.collect::<Vec<_>>(),
        "frames": take.frame_count(),
        "rate_hz": take.rate(),
        "missing_fraction": take.missing_fraction(),
        "complete_frames": take.complete_frame_count(),
        "extent_m": bounds.map(|(low, high)| json!({ "min": low.to_array(), "max": high.to_array() })),
        "unit": source.unit.symbol(),
        "up": source.up.symbol(),
    })
}

fn packed(asset: &Asset<'_>, length: usize, say: &Say) -> Value {
    let dims: &Dims = asset.dims();
    say.line(format!(
        "  asset     version {}, {}; {} vertices in {} blocks, {} slots, {} triangles",
        sinew_core::asset::VERSION,
        bytes(length),
        thousands(dims.vertex_count as u64),
        thousands(dims.block_count as u64),
        thousands(dims.slot_count as u64),
        thousands(dims.triangle_count as u64),
    ));
    let held = [
        (dims.shapes.block_count > 0, "16-bit shapes"),
        (dims.shapes.tangent_block_count > 0, "tangents"),
        (dims.centre_block_count > 0, "centres of rotation"),
        (dims.morph_count > 0, "morph targets"),
    ];
    let held = held.into_iter().filter(|(held, _)| *held);
    let held: Vec<&str> = held.map(|(_, what)| what).collect();
    if !held.is_empty() {
        say.line(format!("  holds     {}", held.join(", ")));
    }
    let levels = (1..asset.level_count()).filter_map(|index| asset.level(index));
    let levels: Vec<Dims> = levels.map(|level| *level.dims()).collect();
    for (index, level) in levels.iter().enumerate() {
        say.line(format!(
            "  level {}   {} vertices in {} blocks, {} triangles",
            index + 1,
            thousands(level.vertex_count as u64),
            thousands(level.block_count as u64),
            thousands(level.triangle_count as u64),
        ));
    }
    let avatar = crate::reference::unpack(asset);
    let skeleton = hierarchy(&avatar.skeleton, say);
    let clips: Vec<Value> = avatar.clips.iter().map(|clip| motion(clip, say)).collect();
    let sections = SectionKind::ALL.iter();
    let sections = sections.map(|kind| (format!("{kind:?}"), json!(kind.bytes(dims))));
    json!({
        "kind": "asset",
        "version": sinew_core::asset::VERSION,
        "bytes": length,
        "vertices": dims.vertex_count,
        "blocks": dims.block_count,
        "slots": dims.slot_count,
        "triangles": dims.triangle_count,
        "holds": held,
        "levels": levels.iter().map(|level| json!({
            "vertices": level.vertex_count,
            "blocks": level.block_count,
            "triangles": level.triangle_count,
        })).collect::<Vec<_>>(),
        "skeleton": skeleton,
        "clips": clips,
        "section_bytes": sections.collect::<serde_json::Map<_, _>>(),
    })
}
