//! A tenth of a frame's work in every frame: what is shown is whole, no vertex is older than stated,
//! and once the motion holds still the surface is exact again within the stated number of frames.

use sinew_core::asset::{Asset, LANES, MarkerMode};
use sinew_core::deform::parts::{
    ExactBudget, ExactState, PartFrames, RigState, exact_state_len, rig_state_len,
    rig_workspace_len,
};
use sinew_core::deform::{Level, Output};
use sinew_core::frame::{
    Avatar, Budget, FrameReport, Input, Rota, State, Workspace, cost, state_len, workspace_len,
};
use sinew_core::track::markers::{Config, Model, Phase};
use sinew_host::bake::AssetBytes;
use sinew_host::fit::laplace::rig::Solve;
use sinew_host::fit::parts::Mode;
use sinew_host::label::Labeller;
use sinew_tests::{Random, human, tiny};

/// An avatar with its memory.
struct Rig<'a> {
    asset: Asset<'a>,
    state: State<Vec<f32>>,
    workspace: Workspace<Vec<f32>>,
    positions: Vec<f32>,
}

impl<'a> Rig<'a> {
    fn new(bytes: &'a AssetBytes) -> Self {
        let asset = bytes.asset().expect("sound");
        let dims = *asset.dims();
        Self {
            asset,
            state: State::with(vec![0.0; state_len(&dims)]),
            workspace: Workspace::with(vec![0.0; workspace_len(&dims)]),
            positions: vec![0.0; 3 * dims.vertex_count],
        }
    }

    fn step(&mut self, seconds: f32, budget: Budget) -> FrameReport {
        let mut output = Output::separate(self.asset.dims(), &mut self.positions, None);
        let output = output.as_mut().expect("fits");
        let mut avatar =
            Avatar::new(&self.asset, &mut self.state, &mut self.workspace).expect("fits");
        let input = Input::Clip {
            index: 0,
            seconds,
            looped: true,
        };
        avatar.step(&input, budget, output)
    }
}

/// Every vertex as in one of the frames.
fn is_made_of(shown: &[f32], frames: &[Vec<f32>]) -> bool {
    let vertices = shown.as_chunks::<3>().0.iter().enumerate();
    vertices.into_iter().all(|(at, vertex)| {
        let mut frames = frames.iter();
        frames.any(|frame| frame.as_chunks::<3>().0[at] == *vertex)
    })
}

/// Plays with a budget and without; returns the age that was allowed.
fn play(bytes: &AssetBytes, budget: impl Fn(usize) -> Budget, age: usize) {
    let (mut full, mut starved) = (Rig::new(bytes), Rig::new(bytes));
    starved.step(0.0, Budget::UNLIMITED);
    full.step(0.0, Budget::UNLIMITED);
    let mut shown = vec![full.positions.clone(); age];
    for frame in 1..40 {
        let seconds = 0.01 * frame as f32;
        full.step(seconds, Budget::UNLIMITED);
        starved.step(seconds, budget(frame));
        shown.remove(0);
        shown.push(full.positions.clone());
        assert!(is_made_of(&starved.positions, &shown), "frame {frame}");
    }
    assert_ne!(starved.positions, full.positions);
    for frame in 40..40 + age {
        starved.step(0.39, budget(frame));
    }
    assert_eq!(starved.positions, full.positions);
}

fn tenth(asset: &Asset<'_>) -> Budget {
    Budget::blocks(asset.dims().block_count.div_ceil(10))
}

#[test]
fn skin_and_collapsed_surfaces_take_turns() {
    for bytes in [
        tiny::arm(),
        tiny::scan(Solve::Collapsed { tolerance: 3e-3 }),
    ] {
        let asset = bytes.asset().expect("sound");
        let budget = tenth(&asset);
        let age = budget.frames_to_all(asset.dims().block_count);
        assert!(age >= 5, "{age}");
        play(&bytes, |_| budget, age);
    }
}

#[test]
fn a_tenth_of_the_multiply_adds_of_a_body_is_a_budget() {
    let bytes = human::asset();
    let asset = bytes.asset().expect("sound");
    let whole = cost(asset.dims(), Budget::UNLIMITED).mul_adds;
    let budget = Budget::within(asset.dims(), whole / 10);
    assert!(cost(asset.dims(), budget).mul_adds <= whole / 10);
    let more = Budget::blocks(budget.blocks + 1);
    assert!(cost(asset.dims(), more).mul_adds > whole / 10);
    play(
        &bytes,
        |_| budget,
        budget.frames_to_all(asset.dims().block_count),
    );
}

#[test]
fn urgent_blocks_are_never_old() {
    let bytes = human::small_asset();
    let asset = bytes.asset().expect("sound");
    let budget = tenth(&asset).with_urgent(100..110);
    let (mut full, mut starved) = (Rig::new(&bytes), Rig::new(&bytes));
    starved.step(0.0, Budget::UNLIMITED);
    for frame in 1..20 {
        let seconds = 0.02 * frame as f32;
        full.step(seconds, Budget::UNLIMITED);
        starved.step(seconds, budget);
        let urgent = &asset.source_order()[100 * LANES..110 * LANES];
        for &vertex in urgent {
            let at = 3 * vertex as usize;
            assert_eq!(starved.positions[at..at + 3], full.positions[at..at + 3]);
        }
    }
    assert_ne!(starved.positions, full.positions);
    play(
        &bytes,
        |_| budget,
        budget.frames_to_all(asset.dims().block_count),
    );
}

#[test]
fn a_solved_surface_shows_its_last_solve() {
    let bytes = tiny::scan(Solve::Exact);
    let budget =
        |frame: usize| Budget::UNLIMITED.with_solves(usize::from(frame.is_multiple_of(10)));
    play(&bytes, budget, 10);
}

/// A skin that markers drive, its blocks by turns.
#[test]
fn marker_skins_take_turns_and_solve_a_part_a_frame() {
    for mode in [Mode::Collapsed, Mode::Hybrid, Mode::Exact] {
        let bytes = tiny::marker_skin(mode);
        let asset = bytes.asset().expect("sound");
        let dims = *asset.dims();
        let skin = asset.marker_skin().expect("markers");
        let (count, parts) = (skin.rig.marker_count(), skin.rig.part_count());
        let budget = tenth(&asset);
        let run = |starve: bool, still: usize| -> Vec<f32> {
            let mut random = Random(9);
            let mut state = RigState::with(vec![0.0; rig_state_len(count, parts)]);
            let mut handles = vec![0.0; rig_workspace_len(count, parts)];
            let members = dims.marker_skin.exact_member_count;
            let mut exact_state = ExactState::with(vec![0.0; exact_state_len(members)]);
            let room = match &skin.mode {
                MarkerMode::Exact(exact) => exact.workspace_len(),
                _ => 0,
            };
            let mut room = vec![0.0; room];
            let mut positions = vec![0.0; 3 * dims.vertex_count];
            let (mut rota, mut seen) = (Rota::new(), skin.rig.tables().rest.to_vec());
            for frame in 0..20 + still {
                if frame < 20 {
                    for place in seen.iter_mut().flatten() {
                        *place += 0.004 * (random.unit() as f32 - 0.5);
                    }
                }
                let followed = skin
                    .rig
                    .follow(&seen, &mut state, &mut handles)
                    .expect("fits");
                let exact = ExactBudget {
                    quadratic: true,
                    residual_parts: if starve { 1 } else { usize::MAX },
                };
                let whole = frame == 0 || !starve;
                let due = match whole {
                    true => Rota::new().due(dims.block_count, &Budget::UNLIMITED),
                    false => rota.due(dims.block_count, &budget),
                };
                let mut output = Output::separate(&dims, &mut positions, None).expect("fits");
                let level = Level::best();
                match &skin.mode {
                    MarkerMode::Collapsed(skin) => due.into_iter().for_each(|blocks| {
                        skin.blocks(followed.positions, blocks, level, &mut output);
                    }),
                    MarkerMode::Hybrid(skin) => due.into_iter().for_each(|blocks| {
                        let frames = PartFrames {
                            palette: followed.palette,
                            duals: followed.duals,
                        };
                        skin.blocks(&frames, followed.residuals, blocks, level, &mut output);
                    }),
                    MarkerMode::Exact(skin) => {
                        let handles = skin
                            .handles(&followed, exact, &mut exact_state, &mut room)
                            .expect("fits");
                        due.into_iter().for_each(|blocks| {
                            skin.blocks(&handles, blocks, level, &mut output);
                        });
                    }
                }
                assert!(positions.iter().all(|x| x.is_finite()), "{mode:?} {frame}");
            }
            positions
        };
        // A part a frame, then every block once more.
        let solves = if mode == Mode::Exact { parts } else { 0 };
        let age = budget.frames_to_all(dims.block_count) + solves;
        let exact = run(false, 0);
        let distance = |other: &[f32]| {
            let pairs = exact.iter().zip(other).map(|(a, b)| (a - b).abs());
            pairs.fold(0.0, f32::max)
        };
        assert!(distance(&run(true, 0)) > 1e-4, "{mode:?}");
        let still = run(true, age);
        // Markers that were held to a limit settle a little while they stand still.
        assert!(distance(&still) < 2e-6, "{mode:?}: {}", distance(&still));
    }
}

#[test]
fn a_tenth_of_the_search_finds_the_markers_later() {
    let bytes = tiny::film();
    let asset = bytes.asset().expect("sound");
    let model = Model::of(&asset).expect("a set");
    let clip = asset.clip(0).expect("a clip");
    let frames_until = |search: u32| {
        let config = Config {
            search,
            ..Config::new(120.0, model.dims())
        };
        let mut labeller = Labeller::new(model, config, 16);
        let mut places = vec![[0.0; 10]; asset.dims().joint_count];
        let mut samples = Vec::new();
        for frame in 0..200 {
            sinew_core::pose::sample(&clip, frame as f32 / 120.0, &mut places);
            let points: Vec<_> = places.iter().map(|p| [p[4], p[5], p[6]]).collect();
            let report = labeller.step(&points, &mut samples).expect("fits");
            let mut numbers = samples.iter().flat_map(|sample| sample.position);
            assert!(numbers.all(f32::is_finite));
            if report.phase == Phase::Tracking {
                return frame + 1;
            }
        }
        panic!("never found with {search} steps a frame");
    };
    let whole = Config::default_search(model.dims());
    let (soon, late) = (frames_until(whole), frames_until(whole / 10));
    println!("found after {soon} frames, with a tenth of the search after {late}");
    assert!(
        late <= 10 * soon + 10,
        "{late} frames, {soon} with all of the search"
    );
}
