//! Random frames through every stage: ordinary, denormal, huge, infinite and no numbers at all.
//!
//! After every frame each number that came out must be finite and the guard bytes around every
//! buffer as they were. Now and then a calm frame follows, so that a storm also meets stages that
//! are under way.

use glam::{Quat, Vec3};
use sinew_core::asset::{Asset, MarkerMode};
use sinew_core::deform::parts::{
    ExactBudget, ExactState, PartFrames, RigState, exact_state_len, rig_state_len,
    rig_workspace_len,
};
use sinew_core::deform::{Level, NormalMode, Output, SkinMode, VertexOrder};
use sinew_core::frame::{
    Avatar, Budget, Input, State, Workspace, any_mode_workspace_len, state_len,
};
use sinew_core::pose::{self, Transform, aim};
use sinew_core::track::{markers, rope};
use sinew_host::bake::AssetBytes;
use sinew_host::fit::laplace::rig::Solve;
use sinew_host::fit::parts::Mode;

use crate::{Random, tiny};

/// What a storm runs through: so many frames, from a seed. Panics on the first fault.
pub type Storm = fn(u64, u64);

/// All storms by the stage that they go through.
pub const ALL: &[(&str, Storm)] = &[
    ("skin", skin),
    ("pose tools", tools),
    ("laplacian, collapsed", |frames, seed| {
        play(
            &tiny::scan(Solve::Collapsed { tolerance: 3e-3 }),
            frames,
            seed,
        );
    }),
    ("laplacian, exact", |frames, seed| {
        play(&tiny::scan(Solve::Exact), frames, seed);
    }),
    ("parts, collapsed", |frames, seed| {
        parts(&tiny::marker_skin(Mode::Collapsed), frames, seed);
    }),
    ("parts, hybrid", |frames, seed| {
        parts(&tiny::marker_skin(Mode::Hybrid), frames, seed);
    }),
    ("parts, exact", |frames, seed| {
        parts(&tiny::marker_skin(Mode::Exact), frames, seed);
    }),
    ("rope", rope),
    ("markers", markers),
];

/// A buffer between guards.
struct Guarded(Vec<f32>);

/// A NaN that no arithmetic makes.
const GUARD: u32 = 0x7FA5_5A5A;
const GUARDS: usize = 16;

impl Guarded {
    fn new(length: usize) -> Self {
        let guard = f32::from_bits(GUARD);
        let mut numbers = vec![guard; length + 2 * GUARDS];
        numbers[GUARDS..GUARDS + length].fill(0.0);
        Self(numbers)
    }

    fn room(&mut self) -> &mut [f32] {
        let end = self.0.len() - GUARDS;
        &mut self.0[GUARDS..end]
    }

    fn check(&self, what: &str) {
        let end = self.0.len() - GUARDS;
        let guards = self.0[..GUARDS].iter().chain(&self.0[end..]);
        let mut guards = guards.map(|number| number.to_bits());
        assert!(
            guards.all(|bits| bits == GUARD),
            "{what}: written beyond its end"
        );
    }

    /// The same for an output, whose numbers must be finite too.
    fn check_finite(&self, what: &str, frame: u64) {
        self.check(what);
        let numbers = &self.0[GUARDS..self.0.len() - GUARDS];
        let finite = numbers.iter().all(|number| number.is_finite());
        assert!(finite, "{what}: not finite in frame {frame}");
    }
}

/// Any number: one in four of the wild ones in a wild frame.
fn number(random: &mut Random, wild: bool) -> f32 {
    if wild {
        match random.below(40) {
            0 => return f32::NAN,
            1 => return f32::INFINITY,
            2 => return f32::NEG_INFINITY,
            3 => return f32::from_bits(random.bits() as u32 & 0x807F_FFFF),
            4 => return f32::MAX,
            5 => return -f32::MAX,
            6 => return 1e6,
            7 => return 0.0,
            8 | 9 => return f32::from_bits(random.bits() as u32),
            _ => {}
        }
    }
    4.0 * random.unit() as f32 - 2.0
}

fn point(random: &mut Random, wild: bool) -> [f32; 3] {
    [(); 3].map(|()| number(random, wild))
}

fn transform(random: &mut Random, wild: bool) -> Transform {
    let [x, y, z] = point(random, wild);
    Transform {
        rotation: Quat::from_xyzw(x, y, z, number(random, wild)),
        translation: Vec3::from_array(point(random, wild)),
        scale: Vec3::from_array(point(random, wild)),
    }
}

/// Frames through everything that a skinned body has, on every level by turns.
fn skin(frames: u64, seed: u64) {
    play(&tiny::arm(), frames, seed);
}

/// Frames of an avatar.
fn play(bytes: &AssetBytes, frames: u64, seed: u64) {
    let mut random = Random(seed);
    let asset = bytes.asset().expect("sound");
    let dims = *asset.dims();
    let mut state = State::with(vec![0.0; state_len(&dims)]);
    let mut workspace = Workspace::with(vec![0.0; any_mode_workspace_len(&dims)]);
    let mut positions = Guarded::new(3 * dims.vertex_count);
    let mut normals = Guarded::new(3 * dims.vertex_count);
    let mut tangents = Guarded::new(4 * dims.vertex_count);
    let mut transforms = vec![Transform::IDENTITY; dims.joint_count];
    for frame in 0..frames {
        let wild = random.below(4) > 0;
        for place in &mut transforms {
            *place = transform(&mut random, wild);
        }
        let joints = random.below(dims.joint_count + 1);
        let input = match random.below(8) {
            0 => Input::Rest,
            1 => Input::Hold,
            2 => Input::Clip {
                index: random.below(dims.clip_count + 1),
                seconds: number(&mut random, wild),
                looped: random.below(2) == 0,
            },
            3 => Input::Pose(&transforms[..joints]),
            _ => Input::Pose(&transforms),
        };
        let mut output =
            Output::separate(&dims, positions.room(), Some(normals.room())).expect("fits");
        if random.below(2) == 0 {
            output = output.in_order(VertexOrder::Block);
        }
        if dims.shapes.tangent_block_count > 0 && random.below(2) == 0 {
            output = output.with_tangents(tangents.room()).expect("fits");
        }
        let mut avatar = Avatar::new(&asset, &mut state, &mut workspace).expect("fits");
        if dims.centre_block_count > 0 {
            let modes = [
                SkinMode::Linear,
                SkinMode::DualQuaternion,
                SkinMode::CentresOfRotation,
            ];
            avatar = avatar.with_mode(modes[random.below(3)]).expect("centres");
        }
        if random.below(2) == 0 {
            avatar = avatar.with_normals(NormalMode::InverseTranspose);
        }
        if random.below(4) == 0 {
            avatar = avatar.with_level(Level::Scalar);
        }
        let blocks = match random.below(3) {
            0 => random.below(dims.block_count + 2),
            _ => usize::MAX,
        };
        let budget = Budget::blocks(blocks).with_solves(random.below(4));
        let report = avatar.step(&input, budget, &mut output);
        assert_eq!(report.blocks_done + report.blocks_left, dims.block_count);
        let joints = avatar.model().iter().flatten();
        assert!(joints.copied().all(f32::is_finite), "joints, frame {frame}");
        if let Some(bounds) = avatar.bounds() {
            let ends = bounds.low.iter().chain(&bounds.high);
            assert!(ends.copied().all(f32::is_finite), "bounds, frame {frame}");
        }
        positions.check_finite("positions", frame);
        normals.check_finite("normals", frame);
        tangents.check_finite("tangents", frame);
    }
}

/// Crossfades, layers, reaches and looks over poses that a body accepted.
fn tools(frames: u64, seed: u64) {
    let mut random = Random(seed);
    let bytes = tiny::arm();
    let asset = bytes.asset().expect("sound");
    let joints = asset.dims().joint_count;
    let mut poses = [(); 3].map(|()| vec![[0.0; 10]; joints]);
    let [local, other, delta] = &mut poses;
    for pose in [&mut *local, other, delta] {
        pose::rest(&asset, pose);
    }
    let (mut model, mut rotations) = (vec![[0.0; 12]; joints], vec![[0.0; 4]; joints]);
    for frame in 0..frames {
        let wild = random.below(4) > 0;
        let pose: Vec<Transform> = (0..joints).map(|_| transform(&mut random, wild)).collect();
        pose::accept(&pose, other);
        let weight = number(&mut random, wild);
        match random.below(4) {
            0 => pose::crossfade(local, other, weight, None),
            1 => {
                pose::difference(other, local, delta);
                pose::add(local, delta, weight, None);
            }
            2 => {
                pose::to_model(&asset, local, &mut model);
                pose::rotations(&asset, local, &mut rotations);
                let limb = aim::TwoBone {
                    joints: [0, 1, 2],
                    keep_end: random.below(2) == 0,
                };
                let target = aim::Target {
                    at: point(&mut random, wild),
                    pole: (random.below(2) == 0).then(|| point(&mut random, wild)),
                    weight,
                };
                let _ = aim::reach(&asset, &limb, &target, &rotations, &model, local);
            }
            _ => pose::rest(&asset, local),
        }
        // What a tool leaves is taken up like any other pose.
        let numbers = local.iter().flatten();
        assert!(numbers.copied().all(f32::is_finite), "pose, frame {frame}");
    }
}

/// Frames of a skin that markers drive.
fn parts(bytes: &AssetBytes, frames: u64, seed: u64) {
    let mut random = Random(seed);
    let asset: Asset<'_> = bytes.asset().expect("sound");
    let dims = *asset.dims();
    let skin = asset.marker_skin().expect("markers");
    let (count, parts) = (skin.rig.marker_count(), skin.rig.part_count());
    let room = match &skin.mode {
        MarkerMode::Exact(exact) => exact.workspace_len(),
        _ => 0,
    };
    let members = dims.marker_skin.exact_member_count;
    let mut memory = [
        Guarded::new(rig_state_len(count, parts)),
        Guarded::new(rig_workspace_len(count, parts)),
        Guarded::new(exact_state_len(members)),
        Guarded::new(room),
    ];
    let mut positions = Guarded::new(3 * dims.vertex_count);
    let mut normals = Guarded::new(3 * dims.vertex_count);
    let mut seen = vec![[0.0; 3]; count];
    {
        let [rig_state, handles, exact_state, exact_room] = &mut memory;
        let mut rig_state = RigState::with(rig_state.room());
        let mut exact_state = ExactState::with(exact_state.room());
        for frame in 0..frames {
            let wild = random.below(4) > 0;
            // Half of the frames are the body at rest but for a few markers.
            let calm = random.below(2) == 0;
            for (place, rest) in seen.iter_mut().zip(skin.rig.tables().rest) {
                *place = match calm && random.below(8) > 0 {
                    true => *rest,
                    false => point(&mut random, wild),
                };
            }
            let given = match random.below(16) {
                0 => random.below(count + 1),
                _ => count,
            };
            let level = match random.below(4) {
                0 => Level::Scalar,
                _ => Level::best(),
            };
            let followed = skin
                .rig
                .follow(&seen[..given], &mut rig_state, handles.room());
            let followed = followed.expect("fits");
            let mut output =
                Output::separate(&dims, positions.room(), Some(normals.room())).expect("fits");
            let all = 0..usize::MAX;
            match &skin.mode {
                MarkerMode::Collapsed(skin) => {
                    skin.blocks(followed.positions, all, level, &mut output);
                }
                MarkerMode::Hybrid(skin) => {
                    let frames = PartFrames {
                        palette: followed.palette,
                        duals: followed.duals,
                    };
                    skin.blocks(&frames, followed.residuals, all, level, &mut output);
                }
                MarkerMode::Exact(skin) => {
                    let budget = ExactBudget {
                        quadratic: random.below(4) > 0,
                        residual_parts: random.below(4),
                    };
                    let handles =
                        skin.handles(&followed, budget, &mut exact_state, exact_room.room());
                    skin.blocks(&handles.expect("fits"), all, level, &mut output);
                }
            }
            positions.check_finite("positions", frame);
            normals.check_finite("normals", frame);
        }
    }
    for memory in &memory {
        memory.check("memory");
    }
}

/// Points of a rope of five, some of them wild, some missing, some in the wrong place.
fn rope(frames: u64, seed: u64) {
    use rope::{Config, RopeTracker, start_work_bound, work_bound};
    const TRACES: usize = 5;
    const POINTS: usize = 12;
    let mut random = Random(seed);
    let config = Config::new(100.0);
    let mut tracker = RopeTracker::<TRACES, POINTS>::new(config).expect("sound");
    let bound = work_bound(TRACES, POINTS).max(start_work_bound(TRACES, POINTS));
    for frame in 0..frames {
        if frame % 10_000 == 9_999 {
            tracker = RopeTracker::new(config).expect("sound");
        }
        let wild = random.below(8) == 0;
        let mut points = Vec::with_capacity(POINTS + 3);
        for at in 0..TRACES {
            if random.below(12) > 0 {
                let [x, y, z] = point(&mut random, wild);
                let near = 0.02 * (frame % 50) as f32;
                points.push([0.1 * at as f32 + 0.004 * x, near + 0.004 * y, 0.004 * z]);
            }
        }
        for _ in 0..random.below(POINTS - TRACES + 3) {
            let wild = random.below(2) == 0;
            points.push(point(&mut random, wild));
        }
        let report = tracker.step(&points);
        assert!(report.work <= bound, "{} > {bound}", report.work);
        for sample in tracker.samples() {
            let mut numbers = sample.position.into_iter().chain([sample.confidence]);
            assert!(numbers.all(f32::is_finite), "rope, frame {frame}");
        }
    }
}

/// Points of a set of nine markers, some of them wild, some missing, some in the wrong place.
fn markers(frames: u64, seed: u64) {
    use markers::{Config, FixedWorkspace, Model, Trace, Tracker, work_bound};
    const POINTS: usize = 14;
    let mut random = Random(seed);
    let bytes = tiny::film();
    let asset = bytes.asset().expect("sound");
    let model = Model::of(&asset).expect("a set");
    let count = model.dims().marker_count;
    let config = Config::new(120.0, model.dims());
    let bound = work_bound(model.dims(), POINTS, config.search);
    let mut traces = vec![Trace::EMPTY; 2 * count];
    let mut state = markers::State::with(&mut traces[..]);
    let mut workspace = FixedWorkspace::<16, POINTS>::new();
    let clip = asset.clip(0).expect("a clip");
    let mut places = vec![[0.0; 10]; asset.dims().joint_count];
    for frame in 0..frames {
        if frame % 10_000 == 9_999 {
            state.reset();
        }
        pose::sample(&clip, (frame % 240) as f32 / 120.0, &mut places);
        let wild = random.below(8) == 0;
        let mut points = Vec::with_capacity(POINTS + 3);
        for place in &places {
            if random.below(12) > 0 {
                let [x, y, z] = point(&mut random, wild);
                let near = [
                    place[4] + 5e-4 * x,
                    place[5] + 5e-4 * y,
                    place[6] + 5e-4 * z,
                ];
                points.push(near);
            }
        }
        for _ in 0..random.below(POINTS - count + 3) {
            let wild = random.below(2) == 0;
            points.push(point(&mut random, wild));
        }
        let at = random.below(points.len() + 1);
        points.rotate_left(at);
        let mut tracker = Tracker::new(&model, config, &mut state, &mut workspace).expect("fits");
        let report = tracker.step(&points);
        assert!(report.work <= bound, "{} > {bound}", report.work);
        for sample in tracker.samples() {
            let mut numbers = sample.position.into_iter().chain([sample.confidence]);
            assert!(numbers.all(f32::is_finite), "markers, frame {frame}");
        }
    }
}
