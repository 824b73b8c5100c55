//! Wall-clock time of loading, posing and skinning the bundled body, beside what a plain program
//! does: `cargo bench -p sinew-host --bench wall`.
//!
//! Every stage is timed in the same rounds as its controls, one after the other, so that what
//! disturbs the machine disturbs all of them. Compare ratios, not times.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use glam::{Mat4, Quat, Vec3};
use sinew_core::asset::{Asset, Channel};
use sinew_core::deform::{Level, Output, VertexOrder};
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, state_len, workspace_len};
use sinew_host::bake::AssetBytes;

fn main() {
    // Cargo passes `--bench` when it benchmarks; as a test, a few short rounds show that it runs.
    let thorough = std::env::args().any(|argument| argument == "--bench");
    let file = std::fs::read(bundled()).expect("the bundled body was baked");
    let file = AssetBytes::new(&file);
    let asset = file.asset().expect("a sound asset");
    let mut table = Table::new(thorough);
    load(&mut table, &file);
    pose(&mut table, &asset);
    skin(&mut table, &asset);
}

/// The asset of `sinew demo`, baked anew.
fn bundled() -> PathBuf {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/data");
    let output = Path::new(env!("CARGO_TARGET_TMPDIR")).join("wall.sinew");
    let status = Command::new(env!("CARGO_BIN_EXE_sinew"))
        .args(["bake", "--quiet", "--mesh"])
        .arg(data.join("human.glb"))
        .arg("--motion")
        .arg(data.join("walk.bvh"))
        .arg("--output")
        .arg(&output)
        .status()
        .expect("sinew runs");
    assert!(status.success(), "baking the bundled body failed");
    output
}

fn load(table: &mut Table, file: &AssetBytes) {
    let bytes = file.as_slice();
    let mut copy = vec![0_u8; bytes.len()];
    table.stage(
        "wall_load_human",
        &mut [
            ("sinew", &mut || {
                black_box(Asset::new_checked(black_box(bytes))).expect("sound");
            }),
            ("copy", &mut || {
                copy.copy_from_slice(black_box(bytes));
                black_box(&copy);
            }),
        ],
    );
}

fn pose(table: &mut Table, asset: &Asset<'_>) {
    let mut rig = Rig::new(asset);
    let mut plain = PlainRig::new(asset);
    let (mut a, mut b) = (Clock::new(asset), Clock::new(asset));
    table.stage(
        "wall_pose_human",
        &mut [
            ("sinew", &mut || {
                rig.step(asset, a.next(), Budget::blocks(0), Level::best());
            }),
            ("plain glam", &mut || {
                plain.pose(b.next());
                black_box(&plain.palette);
            }),
        ],
    );
}

fn skin(table: &mut Table, asset: &Asset<'_>) {
    let mut plain = PlainRig::new(asset);
    plain.pose(0.5);
    let mesh = PlainMesh::new(asset);
    let mut rigs: [Rig; 3] = std::array::from_fn(|_| Rig::new(asset));
    let [best, in_blocks, scalar] = &mut rigs;
    in_blocks.order = VertexOrder::Block;
    let mut positions = mesh.positions.clone();
    let mut normals = mesh.normals.clone();
    let (mut copied, mut copied_normals) = (positions.clone(), normals.clone());
    let all = Budget::UNLIMITED;
    table.stage(
        "wall_skin_human",
        &mut [
            ("sinew", &mut || best.step(asset, 0.5, all, Level::best())),
            ("sinew, block order", &mut || {
                in_blocks.step(asset, 0.5, all, Level::best());
            }),
            ("sinew, no SIMD", &mut || {
                scalar.step(asset, 0.5, all, Level::Scalar);
            }),
            ("plain glam", &mut || {
                mesh.skin(&plain.palette, &mut positions, &mut normals);
                black_box((&positions, &normals));
            }),
            ("copy", &mut || {
                copied.copy_from_slice(black_box(&mesh.positions));
                copied_normals.copy_from_slice(black_box(&mesh.normals));
                black_box((&copied, &copied_normals));
                let bits = mesh.weights.as_flattened().iter().map(|x| x.to_bits());
                black_box(bits.fold(0, u32::wrapping_add));
            }),
        ],
    );
}

/// Times that go through the clip, so that no search finds its key where the last one did.
struct Clock {
    times: Vec<f32>,
    at: usize,
}

impl Clock {
    fn new(asset: &Asset<'_>) -> Self {
        let clip = asset.clip(0).expect("a clip");
        Self {
            // Between keys, where interpolation has work.
            times: clip.sample_times().map(|seconds| seconds + 0.01).collect(),
            at: 0,
        }
    }

    fn next(&mut self) -> f32 {
        self.at = (self.at + 7) % self.times.len();
        self.times[self.at]
    }
}

/// The core with its memory.
struct Rig {
    state: State<Vec<f32>>,
    workspace: Workspace<Vec<f32>>,
    positions: Vec<f32>,
    normals: Vec<f32>,
    order: VertexOrder,
}

impl Rig {
    fn new(asset: &Asset<'_>) -> Self {
        let dims = asset.dims();
        Self {
            state: State::with(vec![0.0; state_len(dims)]),
            workspace: Workspace::with(vec![0.0; workspace_len(dims)]),
            positions: vec![0.0; 3 * dims.vertex_count],
            normals: vec![0.0; 3 * dims.vertex_count],
            order: VertexOrder::Source,
        }
    }

    fn step(&mut self, asset: &Asset<'_>, seconds: f32, budget: Budget, level: Level) {
        let input = Input::Clip {
            index: 0,
            seconds,
            looped: false,
        };
        let (positions, normals) = (&mut self.positions, &mut self.normals);
        let output = Output::separate(asset.dims(), positions, Some(normals)).expect("fits");
        let report = Avatar::new(asset, &mut self.state, &mut self.workspace)
            .expect("fits")
            .with_level(level)
            .step(&input, budget, &mut output.in_order(self.order));
        assert!(report.flags.is_empty());
        black_box((&self.positions, &self.normals));
    }
}

/// A track's keys, unpacked.
struct PlainTrack {
    joint: usize,
    channel: Channel,
    times: Vec<f32>,
    values: Vec<[f32; 4]>,
}

/// A skeleton as a program without sinew would hold it: glam types, a matrix a joint.
struct PlainRig {
    parents: Vec<Option<usize>>,
    rest: Vec<(Quat, Vec3, Vec3)>,
    local: Vec<(Quat, Vec3, Vec3)>,
    model: Vec<Mat4>,
    binds: Vec<(usize, Mat4)>,
    palette: Vec<Mat4>,
    tracks: Vec<PlainTrack>,
}

impl PlainRig {
    fn new(asset: &Asset<'_>) -> Self {
        let dims = asset.dims();
        let rest = (0..dims.joint_count).filter_map(|joint| asset.rest(joint));
        let rest: Vec<_> = rest
            .map(|&[x, y, z, w, tx, ty, tz, sx, sy, sz]| {
                let rotation = Quat::from_xyzw(x, y, z, w);
                (rotation, Vec3::new(tx, ty, tz), Vec3::new(sx, sy, sz))
            })
            .collect();
        let binds = (0..dims.bind_count).filter_map(|bind| asset.bind(bind));
        let tracks = asset.clip(0).expect("a clip").tracks().map(|track| {
            let width = track.channel.width();
            PlainTrack {
                joint: track.target,
                channel: track.channel,
                times: track.times.to_vec(),
                values: track
                    .values
                    .chunks(width)
                    .map(|value| std::array::from_fn(|at| value.get(at).copied().unwrap_or(0.0)))
                    .collect(),
            }
        });
        Self {
            parents: (0..dims.joint_count)
                .map(|joint| asset.parent(joint))
                .collect(),
            local: rest.clone(),
            model: vec![Mat4::IDENTITY; rest.len()],
            rest,
            binds: binds.map(|(joint, rows)| (joint, matrix(rows))).collect(),
            palette: vec![Mat4::IDENTITY; dims.bind_count],
            tracks: tracks.collect(),
        }
    }

    fn pose(&mut self, seconds: f32) {
        self.local.copy_from_slice(&self.rest);
        for track in &self.tracks {
            let after = track.times.partition_point(|&time| time <= seconds);
            let from = after.saturating_sub(1);
            let to = after.min(track.times.len() - 1);
            let (start, end) = (track.times[from], track.times[to]);
            let t = if end > start {
                (seconds - start) / (end - start)
            } else {
                0.0
            };
            let (a, b) = (track.values[from], track.values[to]);
            let local = &mut self.local[track.joint];
            let blend = || Vec3::from_slice(&a).lerp(Vec3::from_slice(&b), t);
            match track.channel {
                Channel::Rotation => local.0 = Quat::from_array(a).slerp(Quat::from_array(b), t),
                Channel::Translation => local.1 = blend(),
                Channel::Scale => local.2 = blend(),
                Channel::MorphWeight => {}
            }
        }
        for (joint, &(rotation, translation, scale)) in self.local.iter().enumerate() {
            let own = Mat4::from_scale_rotation_translation(scale, rotation, translation);
            self.model[joint] = match self.parents[joint] {
                Some(parent) => self.model[parent] * own,
                None => own,
            };
        }
        for (palette, &(joint, inverse)) in self.palette.iter_mut().zip(&self.binds) {
            *palette = self.model[joint] * inverse;
        }
    }
}

fn matrix(&[a, b, c, x, d, e, f, y, g, h, i, z]: &[f32; 12]) -> Mat4 {
    Mat4::from_cols_array(&[a, d, g, 0.0, b, e, h, 0.0, c, f, i, 0.0, x, y, z, 1.0])
}

/// A mesh as a program without sinew would hold it: four influences a vertex.
struct PlainMesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    joints: Vec<[u16; 4]>,
    weights: Vec<[f32; 4]>,
}

impl PlainMesh {
    fn new(asset: &Asset<'_>) -> Self {
        let count = asset.dims().vertex_count;
        let mut mesh = Self {
            positions: vec![Vec3::ZERO; count],
            normals: vec![Vec3::ZERO; count],
            joints: vec![[0; 4]; count],
            weights: vec![[0.0; 4]; count],
        };
        for (at, &source) in asset.source_order().iter().enumerate() {
            let (block, lane, source) = (at / 8, at % 8, source as usize);
            let [x, y, z] = asset.rest_positions()[block].map(|axis| axis[lane]);
            mesh.positions[source] = Vec3::new(x, y, z);
            let [x, y, z] = asset.rest_normals()[block].map(|axis| axis[lane]);
            mesh.normals[source] = Vec3::new(x, y, z);
            let slots = asset.slots(block).filter(|(_, weights)| weights[lane] > 0);
            let mut slots: Vec<_> = slots.map(|(bind, weights)| (weights[lane], bind)).collect();
            slots.sort_unstable_by(|a, b| b.cmp(a));
            for (influence, (weight, bind)) in slots.into_iter().take(4).enumerate() {
                mesh.joints[source][influence] = bind;
                mesh.weights[source][influence] = f32::from(weight) / 65535.0;
            }
        }
        mesh
    }

    fn skin(&self, palette: &[Mat4], positions: &mut [Vec3], normals: &mut [Vec3]) {
        let influences = self.joints.iter().zip(&self.weights);
        let rest = self.positions.iter().zip(&self.normals);
        let outputs = positions.iter_mut().zip(normals);
        for (((joints, weights), (&point, &normal)), (to, to_normal)) in
            influences.zip(rest).zip(outputs)
        {
            let matrix = palette[usize::from(joints[0])] * weights[0]
                + palette[usize::from(joints[1])] * weights[1]
                + palette[usize::from(joints[2])] * weights[2]
                + palette[usize::from(joints[3])] * weights[3];
            *to = matrix.transform_point3(point);
            *to_normal = matrix.transform_vector3(normal).normalize_or_zero();
        }
    }
}

/// Something to time, with its name.
type Contestant<'c> = (&'c str, &'c mut dyn FnMut());

/// Runs stages and prints what they took.
struct Table {
    rounds: usize,
    /// Time a contestant gets in a round.
    slice: Duration,
}

impl Table {
    fn new(thorough: bool) -> Self {
        let (rounds, slice) = if thorough {
            (101, Duration::from_millis(5))
        } else {
            (3, Duration::from_micros(100))
        };
        println!("median of {rounds} rounds; ratios to the last row of each stage");
        Self { rounds, slice }
    }

    fn stage(&mut self, name: &str, contestants: &mut [Contestant<'_>]) {
        let calls: Vec<u32> = contestants
            .iter_mut()
            .map(|(_, work)| {
                let started = Instant::now();
                work();
                let once = started.elapsed().max(Duration::from_nanos(100));
                (self.slice.as_nanos() / once.as_nanos()).clamp(1, 100_000) as u32
            })
            .collect();
        let mut times = vec![Vec::with_capacity(self.rounds); contestants.len()];
        for _ in 0..self.rounds {
            for ((times, (_, work)), &calls) in times.iter_mut().zip(&mut *contestants).zip(&calls)
            {
                let started = Instant::now();
                for _ in 0..calls {
                    work();
                }
                times.push(started.elapsed().as_secs_f64() / f64::from(calls));
            }
        }
        let Some(control) = times.last().cloned() else {
            return;
        };
        for ((what, _), times) in contestants.iter().zip(&times) {
            let ratios: Vec<_> = times.iter().zip(&control).map(|(a, b)| a / b).collect();
            let [low, middle, high] = quartiles(ratios);
            let [_, time, _] = quartiles(times.clone());
            println!(
                "{name:<16} {what:<20} {:>9.2} us  x {middle:.2} ({low:.2} to {high:.2})",
                time * 1e6
            );
        }
    }
}

/// First quartile, median, third quartile.
fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|quarter| values[(values.len() - 1) * quarter / 4])
}
