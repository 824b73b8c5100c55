//! `sinew studio`: a virtual capture with the truth beside it.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::bake::Fitting;
use super::say::Say;
use super::{Failure, load};
use crate::export::png::write_png;
use crate::export::{write_atomic, write_glb_of};
use crate::studio::rope::{self, Grip, RopeModel, hold, skipping};
use crate::studio::{
    Body, Direction, FleshOptions, MarkerLayout, MarkerSet, Ring, Scene, Shot, files, performed,
    pictures,
};

/// Film a body with virtual cameras: broken, unlabelled trajectories, and the truth beside them.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew studio --mesh body.glb --motion walk.bvh --out capture
  sinew studio --mesh body.glb --motion jump.bvh --markers set53 --cameras 8 --out capture
  sinew studio --mesh body.glb --rope skip --markers set41 --out skip
  sinew studio --mesh body.glb --motion jump.bvh --seed 7 --noise-mm 0.5 --swaps 0.5 --out capture

DIR receives
  capture.c3d    what a capture system gives: columns *1, *2, ...; every gap ends a trajectory
  labelled.c3d   the same points under their true names
  truth.c3d      where every marker really was
  studio.json    settings, cameras, markers (triangle, weights), whose points each trajectory holds
  markers.png, cameras.png, visible.png
  body.glb       with --rope: the body and what it really did; sinew rope --body takes it
  surface.npy    with --surface: float32 [frames, vertices, 3], metres")]
pub(crate) struct Studio {
    /// The body: a .glb or .gltf with skin weights.
    #[arg(long)]
    mesh: PathBuf,
    /// Captured motion (.bvh); without it, the body's own first clip.
    #[arg(long)]
    motion: Option<PathBuf>,
    #[command(flatten)]
    fitting: Fitting,
    /// How many markers, evenly spread; or set41 or set53 for named ones near the joints.
    #[arg(long, default_value = "350", value_name = "N", value_parser = layout)]
    markers: MarkerLayout,
    /// How many cameras.
    #[arg(long, default_value_t = 12, value_name = "N")]
    cameras: usize,
    /// How many of them stand low and look up.
    #[arg(long, default_value_t = 2, value_name = "N")]
    low_cameras: usize,
    /// Frames a second.
    #[arg(long, default_value_t = 120.0, value_name = "HZ")]
    rate: f64,
    /// Stop after this many seconds.
    #[arg(long)]
    seconds: Option<f64>,
    /// 2 plays the motion twice as fast.
    #[arg(long, default_value_t = 1.0)]
    speed: f64,
    /// Everything that happens by chance follows from it.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Standard deviation of a measured coordinate, millimetres.
    #[arg(long, default_value_t = 0.15, value_name = "MM")]
    noise_mm: f64,
    /// Points without a marker that begin in a second.
    #[arg(long, default_value_t = 5.0)]
    ghosts: f64,
    /// Chance that trajectories which meet are exchanged instead of broken, 0 to 1.
    #[arg(long, default_value_t = 0.0)]
    swaps: f64,
    /// Size of muscle bulges, 0 to 3.
    #[arg(long, default_value_t = 1.0)]
    muscle: f64,
    /// Depth of breath, 0 to 3.
    #[arg(long, default_value_t = 1.0)]
    breath: f64,
    /// Softness of the flesh, 0 to 3.
    #[arg(long, default_value_t = 1.0)]
    jiggle: f64,
    /// Put a rope into the body's hands: skip (the body skips, no --motion is needed), both, left
    /// or right (the hands of the motion hold it).
    #[arg(long, value_enum, value_name = "HANDS")]
    rope: Option<RopeHands>,
    /// Markers on the rope; by default as many as the scene's usual rope has.
    #[arg(long, value_name = "N", requires = "rope")]
    rope_markers: Option<usize>,
    /// Metres between them.
    #[arg(long, value_name = "METRES", default_value_t = 0.1, requires = "rope")]
    rope_spacing: f64,
    /// Also write the true surface of every frame.
    #[arg(long)]
    surface: bool,
    /// Folder for the results; made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// What the hands do with a rope.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum RopeHands {
    Skip,
    Both,
    Left,
    Right,
}

impl RopeHands {
    fn grip(self) -> Grip {
        match self {
            Self::Skip | Self::Both => Grip::Both,
            Self::Left => Grip::Left,
            Self::Right => Grip::Right,
        }
    }
}

fn layout(text: &str) -> Result<MarkerLayout, String> {
    match text {
        "set41" => Ok(MarkerLayout::Standard41),
        "set53" => Ok(MarkerLayout::Standard53),
        _ => text
            .parse()
            .map(MarkerLayout::Dense)
            .map_err(|_| "give a number, set41 or set53".into()),
    }
}

impl Studio {
    fn rope_scene(&self, hands: RopeHands) -> rope::Scene {
        let mut scene = match hands {
            RopeHands::Skip => rope::Scene::new(rope::Motion::Skipping, self.seed),
            RopeHands::Both => rope::Scene::held(RopeModel::braided(20), self.seed),
            RopeHands::Left | RopeHands::Right => {
                rope::Scene::held(RopeModel::braided(12), self.seed)
            }
        };
        scene.model.spacing = self.rope_spacing;
        if let Some(markers) = self.rope_markers {
            scene.model.markers = markers;
        }
        scene.rate = self.rate;
        scene.seconds = self.seconds.unwrap_or(scene.seconds);
        scene
    }

    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let (avatar, notices) = load::avatar(&self.mesh)?;
        say.notices(&self.mesh.display().to_string(), &notices);
        let mut rope = self.rope.map(|hands| self.rope_scene(hands));
        let skip = match (&mut rope, self.rope) {
            (Some(scene), Some(RopeHands::Skip)) => {
                let (clip, fitted) = skipping(&avatar, scene)?;
                *scene = fitted;
                Some(clip)
            }
            _ => None,
        };
        let made = skip.is_some();
        let clip = match (skip, &self.motion) {
            (Some(clip), _) => clip,
            (None, Some(path)) => {
                let (motion, notices) = load::motion(path, self.fitting.reading)?;
                let (clip, more) = self.fitting.fit(&motion, &avatar, "motion")?;
                say.notices(&path.display().to_string(), &[notices, more].concat());
                clip
            }
            (None, None) => avatar.clips.first().cloned().ok_or_else(|| {
                let mesh = self.mesh.display();
                Failure::Usage(format!("{mesh}: the body holds no clip; give --motion"))
            })?,
        };
        let scene = Scene {
            rate: self.rate,
            direction: Direction {
                speed: self.speed,
                seconds: self.seconds,
                // A clip that was made for the scene begins at rest and keeps its time.
                hold: if made { 0.0 } else { Direction::default().hold },
                blend: if made {
                    0.0
                } else {
                    Direction::default().blend
                },
                ..Direction::default()
            },
            flesh: FleshOptions {
                muscle: self.muscle,
                breath: self.breath,
                jiggle: self.jiggle,
                seed: self.seed,
                ..FleshOptions::default()
            },
        };
        let body = Body::new(&avatar, &clip, scene)?;
        if body.flesh().modes().is_empty() {
            say.line("note: no human body is recognised: bones alone, no flesh");
        }
        if body.performance().is_on_treadmill() {
            say.line("note: the actor would leave the volume: filmed on a treadmill");
        }
        let markers = MarkerSet::new(&avatar, self.markers, self.seed)?;
        let ring = Ring {
            camera_count: self.cameras,
            low_count: self.low_cameras,
            ..Ring::default()
        };
        let shot = Shot {
            ring: ring.reaching(body.performance().reach()),
            start_cameras: Shot::default().start_cameras.min(self.cameras),
            noise: self.noise_mm / 1000.0,
            ghosts_per_second: self.ghosts,
            swap_chance: self.swaps,
            seed: self.seed,
            ..Shot::default()
        };
        let bar = say.progress("filming", body.frame_count());
        let capture = shot.film(&body, &markers, &|done| bar.set_position(done as u64))?;
        bar.finish_and_clear();

        let held = match (&rope, self.rope) {
            (Some(scene), Some(hands)) => {
                let bar = say.progress("rope", body.frame_count());
                let progress = |done| bar.set_position(done as u64);
                let held = hold(&body, scene, hands.grip(), &shot, &progress)?;
                bar.finish_and_clear();
                Some(held)
            }
            _ => None,
        };
        let (mut unlabelled, mut labelled, mut truth) = (
            capture.take()?,
            capture.labelled_take()?,
            capture.truth_take()?,
        );
        if let Some(held) = &held {
            unlabelled = held.beside_unlabelled(&unlabelled, self.seed)?;
            labelled = held.beside_labelled(&labelled)?;
            truth = held.beside_truth(&truth)?;
        }

        std::fs::create_dir_all(&self.out).map_err(|error| load::fault(&self.out, &error))?;
        let path = |name: &str| self.out.join(name);
        files::write_take(&unlabelled, &path("capture.c3d"))?;
        files::write_take(&labelled, &path("labelled.c3d"))?;
        files::write_take(&truth, &path("truth.c3d"))?;
        if held.is_some() {
            let file = write_glb_of(&avatar, &[performed(&body)])?;
            write_atomic(path("body.glb"), |out| Ok(out.write_all(&file)?))?;
        }
        let description = capture.describe(&body, &markers, &shot).to_string();
        write_atomic(path("studio.json"), |out| {
            Ok(out.write_all(description.as_bytes())?)
        })?;
        write_png(
            path("markers.png"),
            &pictures::marker_sheet(&avatar, &markers, 800),
        )?;
        let middle = body.frame_count() / 2;
        write_png(
            path("cameras.png"),
            &pictures::camera_sheet(&body, &markers, &capture, middle, 480),
        )?;
        write_png(
            path("visible.png"),
            &pictures::visible_chart(&capture, 900, 320),
        )?;
        if self.surface {
            let bar = say.progress("surface", body.frame_count());
            files::write_surface(&body, &path("surface.npy"), &|done| {
                bar.set_position(done as u64);
            })?;
            bar.finish_and_clear();
        }
        let counts = capture.statistics();
        say.line(format!(
            "{} markers, {} cameras, {} frames at {} Hz",
            counts.marker_count,
            capture.cameras.len(),
            counts.frame_count,
            capture.rate
        ));
        say.line(format!(
            "{} trajectories ({} of ghosts, {} swaps); {:.1} % of samples missing in {} gaps of \
             {:.1} frames on average",
            counts.trajectory_count,
            counts.ghost_count,
            counts.swap_count,
            100.0 * counts.missing_fraction,
            counts.gap_count,
            counts.mean_gap
        ));
        if let Some(held) = &held {
            let samples = held.seen.iter().flatten();
            let seen = samples.clone().filter(|sample| sample.is_some()).count();
            say.line(format!(
                "a rope of {} markers, {:.1} % of its samples in sight",
                held.markers.first().map_or(0, Vec::len),
                100.0 * seen as f64 / samples.count().max(1) as f64
            ));
        }
        say.line(format!("wrote {}", self.out.display()));
        Ok(json!({
            "out": self.out.display().to_string(),
            "seed": self.seed,
            "rate_hz": capture.rate,
            "cameras": capture.cameras.len(),
            "statistics": counts.to_json(),
        }))
    }
}
