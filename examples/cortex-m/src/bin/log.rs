//! Logs what may go wrong, and how frames went, in compressed form over semihosting: texts stay in
//! the ELF file, `decode/` puts them back. `run.sh --log` compares what comes out with `log.out`.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use cortex_m_rt::entry;
use cortex_m_semihosting::debug;
use defmt::{error, info, warn};
use defmt_semihosting as _;
use glam::{Quat, Vec3};
use sinew_core::asset::{Asset, Dims};
use sinew_core::deform::Output;
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, cost, state_len, workspace_len};
use sinew_core::pose::Transform;
use sinew_core::track::rope::{Config, RopeTracker};
use sinew_cortex_m::ASSET;

const DIMS: Dims = Dims::of(ASSET);

// Memory and time are known before the program runs.
const _: () = assert!(4 * (state_len(&DIMS) + workspace_len(&DIMS)) < 1024, "RAM");
const _: () = assert!(cost(&DIMS, Budget::blocks(4)).mul_adds < 10_000, "time");

#[entry]
fn main() -> ! {
    static mut STATE: State<[f32; state_len(&DIMS)]> = State::new();
    static mut WORKSPACE: Workspace<[f32; workspace_len(&DIMS)]> = Workspace::new();
    static mut POSITIONS: [f32; 3 * DIMS.vertex_count] = [0.0; 3 * DIMS.vertex_count];

    info!(
        "{} vertices, {} joints",
        DIMS.vertex_count, DIMS.joint_count
    );
    info!("a frame of 4 blocks: {}", cost(&DIMS, Budget::blocks(4)));
    refused();
    play(STATE, WORKSPACE, POSITIONS);
    follow();
    loop {
        debug::exit(debug::EXIT_SUCCESS);
    }
}

/// What is not sound is refused, with the reason.
fn refused() {
    for bytes in [&ASSET[..100], &ASSET[16..], &ASSET[..ASSET.len() - 16]] {
        if let Err(reason) = Asset::new_checked(bytes) {
            error!("refused: {}", reason);
        }
    }
    if let Err(reason) = Output::separate(&DIMS, &mut [0.0; 7], None) {
        error!("refused: {}", reason);
    }
}

/// Frames under a budget, with input that is sound and input that is not.
fn play(
    state: &mut State<[f32; state_len(&DIMS)]>,
    workspace: &mut Workspace<[f32; workspace_len(&DIMS)]>,
    positions: &mut [f32],
) {
    let Ok(asset) = Asset::new_checked(ASSET) else {
        return;
    };
    let broken = Transform {
        rotation: Quat::NAN,
        translation: Vec3::INFINITY,
        scale: Vec3::ONE,
    };
    let clip = |index, seconds| Input::Clip {
        index,
        seconds,
        looped: true,
    };
    for input in [
        clip(0, 0.1),
        clip(9, 0.2),
        clip(0, f32::NAN),
        Input::Pose(&[broken]),
        Input::Rest,
    ] {
        let output = Output::separate(&DIMS, positions, None);
        let avatar = Avatar::new(&asset, state, workspace);
        let (Ok(mut output), Ok(mut avatar)) = (output, avatar) else {
            return;
        };
        let report = avatar.step(&input, Budget::blocks(4), &mut output);
        if report.flags.is_empty() {
            info!("{}", report);
        } else {
            warn!("{}", report);
        }
    }
}

/// A rope of five markers, one of which vanishes.
fn follow() {
    let Ok(mut tracker) = RopeTracker::<5, 8>::new(Config::new(100.0)) else {
        return;
    };
    for frame in 0..40_u8 {
        let mut points = [[0.0; 3]; 5];
        for (at, point) in (0_u8..).zip(&mut points) {
            *point = [0.1 * f32::from(at), 0.01 * f32::from(frame), 0.0];
        }
        if frame >= 35 {
            points[2] = [f32::NAN; 3];
        }
        let report = tracker.step(&points);
        if frame % 13 == 0 {
            info!("rope: {}", report);
        }
    }
    for sample in tracker.samples() {
        info!("rope: {}", sample.source);
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
