//! Plays the first clip of an asset and prints what that costs, as TOML.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hio};
use sinew_core::asset::{Asset, AssetError, Clip, Dims, crc32};
use sinew_core::deform::{Output, SizeError};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, FrameReport, Input, State, Workspace, cost, state_len,
    workspace_len,
};
use sinew_cortex_m::counter::Counter;
use sinew_cortex_m::{ASSET, DIMS, stack};

#[entry]
fn main() -> ! {
    static mut STATE: State<[f32; state_len(&DIMS)]> = State::new();
    static mut WORKSPACE: Workspace<[f32; workspace_len(&DIMS)]> = Workspace::new();
    static mut POSITIONS: [f32; 3 * DIMS.vertex_count] = [0.0; 3 * DIMS.vertex_count];
    static mut NORMALS: [f32; 3 * DIMS.vertex_count] = [0.0; 3 * DIMS.vertex_count];

    let status = match play(STATE, WORKSPACE, POSITIONS, NORMALS) {
        Ok(()) => debug::EXIT_SUCCESS,
        Err(error) => {
            if let Ok(mut out) = hio::hstderr() {
                let _ = writeln!(out, "{error}");
            }
            debug::EXIT_FAILURE
        }
    };
    loop {
        debug::exit(status);
    }
}

/// Why there is nothing to print.
enum Fault {
    Asset(AssetError),
    Size(SizeError),
    NoClip,
    NoTimer,
    Frame(FrameReport),
    Console,
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Asset(error) => write!(f, "the asset: {error}"),
            Self::Size(error) => write!(f, "a buffer: {error}"),
            Self::NoClip => write!(f, "the asset has no clip to play"),
            Self::NoTimer => write!(f, "the system timer is taken"),
            Self::Frame(report) => write!(f, "a frame was not whole: {report:?}"),
            Self::Console => write!(f, "the semihosting console does not answer"),
        }
    }
}

impl From<AssetError> for Fault {
    fn from(error: AssetError) -> Self {
        Self::Asset(error)
    }
}

impl From<SizeError> for Fault {
    fn from(error: SizeError) -> Self {
        Self::Size(error)
    }
}

/// Fewest, most and all instructions of something done once a frame.
struct Spread {
    min: u64,
    max: u64,
    sum: u64,
}

impl Spread {
    const NONE: Self = Self {
        min: u64::MAX,
        max: 0,
        sum: 0,
    };

    fn add(&mut self, instructions: u64) {
        self.min = self.min.min(instructions);
        self.max = self.max.max(instructions);
        self.sum += instructions;
    }
}

fn play(
    state: &mut State<[f32; state_len(&DIMS)]>,
    workspace: &mut Workspace<[f32; workspace_len(&DIMS)]>,
    positions: &mut [f32],
    normals: &mut [f32],
) -> Result<(), Fault> {
    let peripherals = cortex_m::Peripherals::take().ok_or(Fault::NoTimer)?;
    let counter = Counter::start(peripherals.SYST);
    // The compiler must not prepare anything from bytes that it knows.
    let bytes = black_box(ASSET);
    let (_, stack_load) = stack::depth(|| Asset::new_checked(bytes));
    let (asset, load) = counter.count(|| Asset::new_checked(bytes));
    let asset = asset?;
    let clip = asset.clip(0).ok_or(Fault::NoClip)?;

    let mut hash = Fingerprint::new();
    let (mut frame, mut pose) = (Spread::NONE, Spread::NONE);
    let mut stack_frame = 0;
    for seconds in clip.sample_times() {
        let input = black_box(Input::Clip {
            index: 0,
            seconds,
            looped: false,
        });
        let mut output = Output::separate(asset.dims(), positions, Some(normals))?;
        let mut avatar = Avatar::new(&asset, state, workspace)?;
        let mut step = |budget| counter.count(|| avatar.step(&input, budget, &mut output));
        let ((report, instructions), depth) = stack::depth(|| step(Budget::UNLIMITED));
        if !report.flags.is_empty() || report.blocks_left > 0 {
            return Err(Fault::Frame(report));
        }
        frame.add(instructions);
        stack_frame = stack_frame.max(depth);
        // The same again without vertices: what is left is the pose.
        pose.add(step(Budget::blocks(0)).1);
        hash.update(positions);
        hash.update(normals);
    }

    let frames = clip.sample_times().len() as u64;
    let vertices = DIMS.vertex_count as u64;
    let skin = (frame.sum - pose.sum) / frames;
    let bound = cost(&DIMS, Budget::UNLIMITED);
    let mut out = hio::hstdout().map_err(|()| Fault::Console)?;
    let mut line =
        |name: &str, value: u64| writeln!(out, "{name} = {value}").map_err(|_| Fault::Console);
    line("joints", DIMS.joint_count as u64)?;
    line("vertices", vertices)?;
    line("blocks", DIMS.block_count as u64)?;
    line("slots", DIMS.slot_count as u64)?;
    line("frames", frames)?;
    line("milli_instructions_a_tick", counter.milli_rate())?;
    line("icount_load", load)?;
    line("icount_frame_min", frame.min)?;
    line("icount_frame_mean", frame.sum / frames)?;
    line("icount_frame_max", frame.max)?;
    line("icount_pose_mean", pose.sum / frames)?;
    line("icount_skin_mean", skin)?;
    line("icount_skin_vertex", skin / vertices)?;
    line("bound_mul_adds_frame", bound.mul_adds)?;
    line("bytes_asset", ASSET.len() as u64)?;
    line("bytes_state", size_of_val(state) as u64)?;
    line("bytes_workspace", size_of_val(workspace) as u64)?;
    line(
        "bytes_output",
        (size_of_val(positions) + size_of_val(normals)) as u64,
    )?;
    line("bytes_stack_load", stack_load as u64)?;
    line("bytes_stack_frame", stack_frame as u64)?;
    line("bytes_of_Asset", size_of::<Asset<'_>>() as u64)?;
    line("bytes_of_AssetError", size_of::<AssetError>() as u64)?;
    line("bytes_of_Avatar", size_of::<Avatar<'_, '_>>() as u64)?;
    line("bytes_of_Clip", size_of::<Clip<'_>>() as u64)?;
    line("bytes_of_Dims", size_of::<Dims>() as u64)?;
    line("bytes_of_FrameReport", size_of::<FrameReport>() as u64)?;
    line("bytes_of_Input", size_of::<Input<'_>>() as u64)?;
    line("bytes_of_Output", size_of::<Output<'_>>() as u64)?;
    writeln!(out, "compiler = \"{}\"", env!("SINEW_COMPILER")).map_err(|_| Fault::Console)?;
    writeln!(out, "asset = \"{:08x}\"", crc32(ASSET)).map_err(|_| Fault::Console)?;
    writeln!(out, "fingerprint = \"{:016x}\"", hash.value()).map_err(|_| Fault::Console)
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    if let Ok(mut out) = hio::hstderr() {
        let _ = writeln!(out, "{info}");
    }
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
