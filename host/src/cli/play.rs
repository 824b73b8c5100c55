//! `sinew play`: runs the core and writes what it computed.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glam::DVec3;
use serde_json::{Value, json};
use sinew_core::asset::Asset;
use sinew_core::deform::{NormalMode, SkinMode};

use super::bake::Fitting;
use super::say::Say;
use super::{Failure, load, markers};
use crate::export::{Frame, write_glb_frames, write_glb_of};
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
  sinew play body.sinew --mode dual --level 1 --output far.gif
  sinew play body.sinew --markers dense.c3d --output dense.gif

OUTPUT ends in
  .npy   float32 [frames, vertices, 3], metres, the source mesh's vertex order
  .glb   skinned mesh with the clip, for any viewer; in other modes than linear, which viewers
         do not know, a mesh with a morph target for each frame
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
    /// How transforms of several joints become one.
    #[arg(long, value_enum, default_value_t = Mode::Linear)]
    mode: Mode,
    /// Move normals by the inverse transpose, which is right under uneven scale too.
    #[arg(long)]
    exact_normals: bool,
    /// Level of detail: 0 is the finest.
    #[arg(long, default_value_t = 0, conflicts_with = "blocks")]
    level: usize,
    /// The finest level of detail of at most so many blocks of eight vertices.
    #[arg(long)]
    blocks: Option<usize>,
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

/// Skinning modes of the core.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// Weighted sum of matrices.
    Linear,
    /// Dual quaternions: twists keep their volume.
    Dual,
    /// Optimised centres of rotation; needs an asset baked with --centres.
    Centres,
}

impl Mode {
    fn core(self) -> SkinMode {
        match self {
            Self::Linear => SkinMode::Linear,
            Self::Dual => SkinMode::DualQuaternion,
            Self::Centres => SkinMode::CentresOfRotation,
        }
    }
}

impl Play {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let bytes = load::asset(&self.asset)?;
        let whole = bytes
            .asset()
            .map_err(|error| load::fault(&self.asset, &error))?;
        let level = match self.blocks {
            Some(blocks) => whole.level_within(blocks),
            None => self.level,
        };
        let asset = whole.level(level).ok_or_else(|| {
            let count = whole.level_count();
            Failure::Usage(format!(
                "--level {level}: the asset holds {count}, from 0; bake more with --levels"
            ))
        })?;
        let player = self.player(asset)?;
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
                write_npy(player, &motion, &times, &self.output, say)?;
                times.len()
            }
            "gif" | "png" => {
                let rate = self.rate.unwrap_or(own_rate.min(30.0));
                let shot = Shot {
                    size: self.size as usize,
                    rate,
                    ..Shot::default()
                };
                let film = Film::of(player, &motion, shot);
                let bar = say.progress("drawing", film.frame_count());
                let count = if ending == "gif" {
                    film.write_gif(&self.output, |done| bar.set_position(done as u64))?
                } else {
                    film.write_sheet(&self.output, |done| bar.set_position(done as u64))?
                };
                bar.finish_and_clear();
                count
            }
            "glb" if self.mode != Mode::Linear || asset.corrective().is_some() => {
                let times = frame_times(motion.duration(), self.rate.unwrap_or(own_rate));
                let file = frames_glb(player, &body, &motion, &times, say)?;
                write_atomic(&self.output, |out| Ok(out.write_all(&file)?))?;
                times.len()
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
                if asset.laplacian().is_some() {
                    say.line(
                        "note: a .glb can only hold the coarse skin of a scan; .npy, .gif and .png \
                         show its surface",
                    );
                }
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

    fn player<'a>(&self, asset: Asset<'a>) -> Result<Player<'a>, Failure> {
        let normals = if self.exact_normals {
            NormalMode::InverseTranspose
        } else {
            NormalMode::Fast
        };
        let player = Player::new(asset).with_modes(self.mode.core(), normals);
        player.map_err(|error| Failure::Usage(format!("{}: {error}", self.asset.display())))
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

/// The frames as morph targets, one after another: what every viewer shows as the core computed it.
fn frames_glb(
    mut player: Player<'_>,
    body: &Avatar,
    motion: &Motion,
    times: &[f64],
    say: &Say,
) -> Result<Vec<u8>, Failure> {
    let bar = say.progress("playing", times.len());
    let mut frames = Vec::with_capacity(times.len());
    for &seconds in times {
        motion.step(&mut player, seconds);
        let wide = |all: &[[f32; 3]]| all.iter().map(|v| DVec3::from(v.map(f64::from))).collect();
        frames.push(Frame {
            positions: wide(player.positions()),
            normals: wide(player.normals()),
        });
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(write_glb_frames(&body.mesh, &frames, times)?)
}

fn write_npy(
    mut player: Player<'_>,
    motion: &Motion,
    times: &[f64],
    output: &Path,
    say: &Say,
) -> Result<(), Failure> {
    let shape = [times.len(), player.positions().len(), 3];
    let mut writer = NpyWriter::create(output, &shape)?;
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
