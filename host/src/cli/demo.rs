//! `sinew demo`: the whole way on the bundled body.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::{Value, json};

use super::bake::{Fitting, tell as tell_bake, to_json as bake_json, write};
use super::say::{Say, bytes};
use super::verify::{measure, to_json as error_json};
use super::{Failure, cost};
use crate::bake::{BakeOptions, bake};
use crate::export::write_atomic;
use crate::export::write_glb_of;
use crate::film::{Film, Shot};
use crate::import::gltf::read_gltf;
use crate::import::read_bvh;
use crate::model::{Avatar, Motion};
use crate::play::Motion as Shown;
use crate::verify::BAKE_LIMIT;
use sinew_core::frame::Budget;

/// Import the bundled body and its captured walk, bake them, play and verify the asset, draw it.
#[derive(Args)]
#[command(after_help = "Example:\n  sinew demo --out /tmp/demo")]
pub(crate) struct Demo {
    /// Folder for what it makes.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

const BODY: &[u8] = include_bytes!("../../../examples/data/human.glb");
const CAPTURES: [(&str, &[u8]); 2] = [
    ("walk", include_bytes!("../../../examples/data/walk.bvh")),
    ("kneel", include_bytes!("../../../examples/data/kneel.bvh")),
];

impl Demo {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let started = Instant::now();
        std::fs::create_dir_all(&self.out)
            .map_err(|error| Failure::Data(format!("{}: {error}", self.out.display())))?;
        say.line("1. import: a body with its rig, two captured motions");
        let mut body = bundled_body(say)?;
        for (name, file) in CAPTURES {
            let clip = bundled_clip(name, file, &body, say)?;
            body.clips.push(clip);
        }
        say.line("2. bake");
        let baked = bake(&body, &BakeOptions::default())?;
        let asset = baked.bytes.asset()?;
        tell_bake(&baked.report, say);
        let path = |name: &str| self.out.join(name);
        write(&baked, &path("human.sinew"))?;
        say.line("3. verify: the core against the oracle, at every sample and halfway between");
        let error = measure(&asset, &body, say);
        let length = baked.bytes.as_slice().len();
        cost::tell(&asset, length, Budget::UNLIMITED, say);
        say.line("4. play");
        let mut files = vec!["human.sinew"];
        let walk = Shown::Own {
            index: 0,
            duration: body.clips[0].duration,
        };
        let kneel = Shown::Own {
            index: 1,
            duration: body.clips[1].duration,
        };
        for (motion, gif, sheet) in [
            (&walk, Some("walk.gif"), "walk.png"),
            (&kneel, None, "kneel.png"),
        ] {
            let film = Film::new(asset, motion, Shot::default());
            if let Some(gif) = gif {
                let bar = say.progress("drawing", film.frame_count());
                film.write_gif(&path(gif), |done| bar.set_position(done as u64))?;
                bar.finish_and_clear();
                files.push(gif);
            }
            film.write_sheet(&path(sheet), |_| {})?;
            files.push(sheet);
        }
        let scene = write_glb_of(&body, &body.clips)?;
        write_atomic(path("human.glb"), |file| Ok(file.write_all(&scene)?))?;
        files.extend(["human.glb", "report.json"]);
        let report = json!({
            "bake": bake_json(&baked.report),
            "error": error_json(&error, BAKE_LIMIT),
            "cost": cost::to_json(&asset, length, Budget::UNLIMITED),
            "files": files,
        });
        write_atomic(path("report.json"), |file| {
            Ok(writeln!(file, "{report:#}")?)
        })?;
        for name in &files {
            let length = std::fs::metadata(path(name)).map_or(0, |file| file.len());
            say.line(format!(
                "   {} ({})",
                path(name).display(),
                bytes(length as usize)
            ));
        }
        say.line(format!("done in {:.1} s", started.elapsed().as_secs_f64()));
        if !error.passed(BAKE_LIMIT) {
            let text = format!(
                "the asset misses its limit of {:.4} mm",
                error.limit(BAKE_LIMIT) * 1e3
            );
            return Err(Failure::Data(text));
        }
        Ok(report)
    }
}

fn bundled_body(say: &Say) -> Result<Avatar, Failure> {
    let name = "human.glb";
    let (body, notices) = Avatar::new(read_gltf(BODY, name, Path::new(""))?, name)?;
    say.notices(name, &notices);
    Ok(body)
}

fn bundled_clip(
    name: &str,
    file: &[u8],
    body: &Avatar,
    say: &Say,
) -> Result<crate::model::Clip, Failure> {
    let file_name = format!("{name}.bvh");
    let (motion, notices) = Motion::new(read_bvh(file, &file_name)?, &file_name)?;
    say.notices(&file_name, &notices);
    let (clip, notices) = Fitting::default().fit(&motion, body, name)?;
    say.notices(&file_name, &notices);
    Ok(clip)
}
