//! What compressed clips and motion tools cost: error, size, instructions a joint.
//!
//! `motion [BVH...]`: the bundled body in the given motions, or in the bundled ones and, where it is
//! present, CMU's in `../shared/data/bvh`. Instructions are those of x86-64, counted by
//! `valgrind --tool=callgrind` around repeated calls; without it their column stays empty.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::{env, fs};

use sinew_core::asset::Asset;
use sinew_core::pose::aim::{Look, Target, TwoBone, look_at, reach};
use sinew_core::pose::root_motion::extract;
use sinew_core::pose::{self, Local};
use sinew_host::bake::{BakeOptions, Baked, bake};
use sinew_host::fit::{Correspondence, Humanoid, Options, Part, Side, Which, retarget};
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::read_bvh;
use sinew_host::model::{Avatar, Motion};
use sinew_tests::{root, shared};

/// Millimetres in joint space.
const TOLERANCES: [f64; 4] = [0.1, 0.5, 1.0, 2.0];
const JOBS: [&str; 8] = [
    "sample, 32-bit keys",
    "sample, compressed",
    "crossfade",
    "additive",
    "to model space",
    "root motion",
    "two-bone reach",
    "look-at",
];
const REPEATS: u64 = 200;

type Fault = Box<dyn std::error::Error>;

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let done = match &arguments[..] {
        [flag, job, repeats] if flag == "--job" => run_job(job, repeats),
        files => table(files),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn body() -> Result<Avatar, Fault> {
    let bytes = fs::read(root().join("examples/data/human.glb"))?;
    let raw = read_gltf(&bytes, "human.glb", Path::new(""))?;
    Ok(Avatar::new(raw, "human.glb")?.0)
}

/// The bundled body with one clip.
fn with_clip(path: &Path) -> Result<Avatar, Fault> {
    let mut avatar = body()?;
    let name = path.display().to_string();
    let (motion, _) = Motion::new(read_bvh(&fs::read(path)?, &name)?, &name)?;
    let joints = Correspondence::new(&motion.skeleton, &avatar.skeleton, &[])?;
    let fitted = retarget(&motion, &avatar.skeleton, &joints, &Options::default())?;
    avatar.clips = vec![fitted.clip];
    Ok(avatar)
}

fn compressed(avatar: &Avatar, millimetres: Option<f64>) -> Result<Baked, Fault> {
    let options = BakeOptions {
        compression: millimetres.map(|mm| mm / 1e3),
        ..BakeOptions::default()
    };
    Ok(bake(avatar, &options)?)
}

fn table(files: &[String]) -> Result<(), Fault> {
    let mut paths: Vec<PathBuf> = files.iter().map(PathBuf::from).collect();
    if paths.is_empty() {
        paths = ["walk", "kneel"]
            .map(|name| root().join(format!("examples/data/{name}.bvh")))
            .to_vec();
        paths.extend(
            ["bvh/cmu_01_01.bvh", "bvh/cmu_12_01_walk.bvh"]
                .iter()
                .filter_map(|f| shared(f)),
        );
    }
    println!("clip, tolerance mm, worst error mm, bytes, of 16-bit samples %");
    for path in &paths {
        let avatar = with_clip(path)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        for tolerance in TOLERANCES {
            match compressed(&avatar, Some(tolerance))?
                .report
                .compression
                .first()
            {
                Some(clip) => println!(
                    "{name}, {tolerance}, {:.3}, {}, {:.1}",
                    1e3 * clip.error,
                    clip.bytes,
                    100.0 * clip.bytes as f64 / clip.raw_bytes as f64
                ),
                None => println!("{name}, {tolerance}, not compressible"),
            }
        }
    }
    println!("job, instructions a joint");
    for job in JOBS {
        match (count(job, REPEATS)?, count(job, 2 * REPEATS)?) {
            (Some(once), Some(twice)) => {
                let each = twice.saturating_sub(once) as f64 / REPEATS as f64;
                println!("{job}, {:.1}", each / joints_of(job)?);
            }
            _ => println!("{job}, needs valgrind"),
        }
    }
    Ok(())
}

/// Jobs on single limbs count as one.
fn joints_of(job: &str) -> Result<f64, Fault> {
    Ok(match job {
        "root motion" | "two-bone reach" | "look-at" => 1.0,
        _ => body()?.skeleton.joints.len() as f64,
    })
}

/// Instructions of this program when it repeats a job.
fn count(job: &str, repeats: u64) -> Result<Option<u64>, Fault> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(env::current_exe()?)
        .args(["--job", job, &repeats.to_string()])
        .output();
    let Ok(output) = output else { return Ok(None) };
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let line = text
        .lines()
        .find_map(|line| line.split("Collected :").nth(1));
    Ok(line.and_then(|number| number.trim().parse().ok()))
}

fn run_job(job: &str, repeats: &str) -> Result<(), Fault> {
    let repeats: u64 = repeats.parse()?;
    let avatar = with_clip(&root().join("examples/data/walk.bvh"))?;
    let packed = (job == "sample, compressed").then_some(0.5);
    let baked = compressed(&avatar, packed)?;
    let asset = baked.bytes.asset()?;
    let human = Humanoid::new(&avatar.skeleton, Which::Target)?;
    let mut work = Work::new(&asset);
    let limb = |part| human.limb(Side::Left, part).ok_or("no leg");
    let leg = TwoBone {
        joints: [
            limb(Part::UpperLeg)?,
            limb(Part::LowerLeg)?,
            limb(Part::Foot)?,
        ],
        keep_end: true,
    };
    for step in 0..repeats {
        work.step(&asset, job, step, &leg);
    }
    black_box(&work.local);
    Ok(())
}

struct Work {
    rest: Vec<Local>,
    local: Vec<Local>,
    other: Vec<Local>,
    delta: Vec<Local>,
    rotations: Vec<[f32; 4]>,
    model: Vec<[f32; 12]>,
}

impl Work {
    fn new(asset: &Asset<'_>) -> Self {
        let count = asset.dims().joint_count;
        let mut rest = vec![Local::default(); count];
        pose::rest(asset, &mut rest);
        let mut other = rest.clone();
        if let Some(clip) = asset.clip(0) {
            pose::sample(&clip, 0.4, &mut other);
        }
        let mut delta = rest.clone();
        pose::difference(&other, &rest, &mut delta);
        let mut rotations = vec![[0.0; 4]; count];
        let mut model = vec![[0.0; 12]; count];
        pose::rotations(asset, &other, &mut rotations);
        pose::to_model(asset, &other, &mut model);
        Self {
            local: rest.clone(),
            rest,
            other,
            delta,
            rotations,
            model,
        }
    }

    fn step(&mut self, asset: &Asset<'_>, job: &str, step: u64, leg: &TwoBone) {
        let at = (step % 50) as f32 * 0.013;
        match job {
            "sample, 32-bit keys" | "sample, compressed" => {
                if let Some(clip) = asset.clip(0) {
                    pose::sample(&clip, at, &mut self.local);
                }
            }
            "crossfade" => pose::crossfade(&mut self.local, &self.other, 0.3, None),
            "additive" => pose::add(&mut self.local, &self.delta, 0.01, None),
            "to model space" => {
                pose::to_model(asset, &self.other, &mut self.model);
            }
            "root motion" => {
                let mut root = self.other[0];
                black_box(extract(&mut root, &self.rest[0]));
            }
            "two-bone reach" => {
                let target = Target {
                    at: [0.1 + at, 0.2, 0.1],
                    pole: None,
                    weight: 1.0,
                };
                let came = reach(
                    asset,
                    leg,
                    &target,
                    &self.rotations,
                    &self.model,
                    &mut self.local,
                );
                black_box(came);
            }
            _ => {
                let look = Look {
                    joint: leg.joints[2],
                    axis: [0.0, 0.0, 1.0],
                    limit: 0.5,
                    weight: 1.0,
                };
                let target = [at, 1.6, 2.0];
                let came = look_at(
                    asset,
                    &look,
                    target,
                    &self.rotations,
                    &self.model,
                    &mut self.local,
                );
                black_box(came);
            }
        }
    }
}
