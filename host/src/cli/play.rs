//! `sinew play`: runs the core and writes what it computed.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};
use sinew_core::asset::Asset;

use super::bake::Fitting;
use super::say::Say;
use super::{Failure, load, markers};
use crate::export::write_glb_of;
use crate::export::{NpyWriter, write_atomic};
use crate::film::{Film, Shot};
use crate::model::Avatar;
use crate::play::{Motion, Player, frame_times};
use crate::reference;
use crate::verify::DEFAULT_PERIOD;

/// Run the core over a clip and write the frames.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew play body.sinew --output walk.gif
  sinew play body.sinew --clip 1 --rate 60 --output walk.npy
  sinew play body.sinew --motion other.bvh --output other.glb
  sinew play body.sinew --markers dense.c3d --output dense.gif

OUTPUT ends in
  .npy   float32 [frames, vertices, 3], metres, the source mesh's vertex order
  .glb   skinned mesh with the clip, for any viewer
  .gif   moving picture
  .png   contact sheet")]
pub(crate) struct Play {
    /// The asset.
    asset: PathBuf,
    /// Clip to play, by number or name; the first without it.
    #[arg(long, conflicts_with_all = ["motion", "markers"])]
    clip: Option<String>,
    /// Captured motion (.bvh) to play instead of a clip of the asset.
    #[arg(long)]
    motion: Option<PathBuf>,
    /// Captured markers (.c3d, .trc, .csv) that drive the skin, by the labels it was baked with.
    #[arg(long, value_name = "TAKE", conflicts_with = "motion")]
    markers: Option<PathBuf>,
    #[command(flatten)]
    fitting: Fitting,
    /// Frames a second; the motion's own rate without it, at most 30 for pictures.
    #[arg(long)]
    rate: Option<f64>,
    /// Width and height of a picture, or of each picture of a sheet, pixels.
    #[arg(long, default_value_t = 360, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Where to write.
    #[arg(long, short)]
    output: PathBuf,
}

impl Play {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let bytes = load::asset(&self.asset)?;
        let asset = bytes
            .asset()
            .map_err(|error| load::fault(&self.asset, &error))?;
        let body = reference::unpack(&asset);
        if self.rate.is_some_and(|rate| !(rate > 0.0 && rate <= 1e4)) {
            return Err(Failure::Usage("--rate must lie between 0 and 10000".into()));
        }
        let (motion, period) = self.motion(&asset, &body, say)?;
        let own_rate = 1.0 / period.unwrap_or(DEFAULT_PERIOD);
        let ending = self
            .output
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .to_lowercase();
        let frames = match ending.as_str() {
            "npy" => {
                let times = frame_times(motion.duration(), self.rate.unwrap_or(own_rate));
                write_npy(&asset, &motion, &times, &self.output, say)?;
                times.len()
            }
            "gif" | "png" => {
                let rate = self.rate.unwrap_or(own_rate.min(30.0));
                let shot = Shot {
                    size: self.size as usize,
                    rate,
                    ..Shot::default()
                };
                let film = Film::new(asset, &motion, shot);
                let bar = say.progress("drawing", film.frame_count());
                let count = if ending == "gif" {
                    film.write_gif(&self.output, |done| bar.set_position(done as u64))?
                } else {
                    film.write_sheet(&self.output, |done| bar.set_position(done as u64))?
                };
                bar.finish_and_clear();
                count
            }
            "glb" => {
                let clip = match &motion {
                    Motion::Own { index, .. } => body.clips.get(*index).cloned(),
                    Motion::Foreign(clip, _) => Some(clip.clone()),
                    Motion::Markers { .. } => {
                        return Err(Failure::Usage(
                            "a skin that markers drive is no skinned mesh: write .npy, .gif or .png"
                                .into(),
                        ));
                    }
                };
                let keys = clip
                    .iter()
                    .flat_map(|clip| &clip.tracks)
                    .map(|t| t.times.len())
                    .max();
                let file = write_glb_of(&body, clip.as_slice())?;
                write_atomic(&self.output, |out| Ok(out.write_all(&file)?))?;
                keys.unwrap_or(1)
            }
            _ => {
                let text = "the output must end in .npy, .glb, .gif or .png";
                return Err(Failure::Usage(format!("{}: {text}", self.output.display())));
            }
        };
        say.line(format!("wrote {} ({frames} frames)", self.output.display()));
        Ok(json!({
            "output": self.output.display().to_string(),
            "frames": frames,
            "vertices": asset.dims().vertex_count,
            "duration_s": motion.duration(),
        }))
    }

    /// The motion and the seconds between its samples.
    fn motion(
        &self,
        asset: &Asset<'_>,
        body: &Avatar,
        say: &Say,
    ) -> Result<(Motion, Option<f64>), Failure> {
        if let Some(path) = &self.markers {
            let motion = markers::motion(asset, path, self.fitting.reading, say)?;
            let period = match &motion {
                Motion::Markers { rate, .. } => Some(1.0 / rate),
                _ => None,
            };
            return Ok((motion, period));
        }
        if let Some(path) = &self.motion {
            let (motion, notices) = load::motion(path, self.fitting.reading)?;
            let (clip, more) = self.fitting.fit(&motion, body, "motion")?;
            say.notices(&path.display().to_string(), &[notices, more].concat());
            let period = clip.sample_period;
            return Ok((Motion::Foreign(clip, body.skeleton.clone()), period));
        }
        let wanted = self.clip.as_deref().unwrap_or("0");
        let index = find_clip(body, wanted, &self.asset)?;
        let clip = &body.clips[index];
        Ok((
            Motion::Own {
                index,
                duration: clip.duration,
            },
            clip.sample_period,
        ))
    }
}

fn find_clip(body: &Avatar, wanted: &str, asset: &Path) -> Result<usize, Failure> {
    let by_name = body.clips.iter().position(|clip| clip.name == wanted);
    let by_number = wanted
        .parse()
        .ok()
        .filter(|&index: &usize| index < body.clips.len());
    by_name.or(by_number).ok_or_else(|| {
        let names: Vec<_> = body.clips.iter().map(|clip| clip.name.as_str()).collect();
        let held = if names.is_empty() {
            "it holds none; give --motion".to_owned()
        } else {
            format!("it holds {}", names.join(", "))
        };
        Failure::Usage(format!("{}: no clip {wanted:?}; {held}", asset.display()))
    })
}

fn write_npy(
    asset: &Asset<'_>,
    motion: &Motion,
    times: &[f64],
    output: &Path,
    say: &Say,
) -> Result<(), Failure> {
    let shape = [times.len(), asset.dims().vertex_count, 3];
    let mut writer = NpyWriter::create(output, &shape)?;
    let mut player = Player::new(*asset);
    let bar = say.progress("playing", times.len());
    for &seconds in times {
        motion.step(&mut player, seconds);
        writer.push(player.positions().as_flattened())?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    writer.finish()?;
    Ok(())
}
