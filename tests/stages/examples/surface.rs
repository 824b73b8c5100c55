//! How far a surface is from the one that another build of the core gave.
//!
//! `surface ASSET FILE`: plays the first clip; writes the frames to FILE where there is none, else
//! prints the distance from those in it, millimetres. So, of the approximate arithmetic:
//!
//! ```text
//! cargo run --release -p sinew-stages --example surface -- body.sinew exact.frames
//! cargo run --release -p sinew-stages --features micromath --example surface -- body.sinew exact.frames
//! ```

use std::error::Error;
use std::path::Path;
use std::{env, fs};

use sinew_core::asset::{ALIGNMENT, Asset};
use sinew_core::deform::Output;
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, state_len, workspace_len};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [asset, frames] = &arguments[..] else {
        return Err("usage: surface ASSET FILE".into());
    };
    let found = play(&fs::read(asset)?)?;
    if !Path::new(frames).exists() {
        let bytes: Vec<u8> = found.iter().flat_map(|x| x.to_le_bytes()).collect();
        return Ok(fs::write(frames, bytes)?);
    }
    let bytes = fs::read(frames)?;
    let other = bytes.as_chunks().0.iter().map(|&x| f32::from_le_bytes(x));
    let other: Vec<f32> = other.collect();
    if other.len() != found.len() {
        return Err("the frames are of another asset".into());
    }
    let points = found
        .as_chunks::<3>()
        .0
        .iter()
        .zip(other.as_chunks::<3>().0);
    let distances = points.map(|(a, b)| {
        let square = |axis: usize| f64::from(a[axis] - b[axis]).powi(2);
        1e3 * (square(0) + square(1) + square(2)).sqrt()
    });
    let distances: Vec<f64> = distances.collect();
    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
    let most = distances.iter().copied().fold(0.0, f64::max);
    println!("{mean:.4} mm on average, {most:.4} mm at most");
    Ok(())
}

/// Positions of all frames.
fn play(file: &[u8]) -> Result<Vec<f32>, Box<dyn Error>> {
    let mut bytes = vec![0; file.len() + ALIGNMENT];
    let start = bytes.as_ptr().align_offset(ALIGNMENT);
    bytes[start..start + file.len()].copy_from_slice(file);
    let asset = Asset::new_checked(&bytes[start..start + file.len()])?;
    let (dims, clip) = (asset.dims(), asset.clip(0).ok_or("no clip")?);
    let mut state = State::with(vec![0.0; state_len(dims)]);
    let mut workspace = Workspace::with(vec![0.0; workspace_len(dims)]);
    let mut positions = vec![0.0; 3 * dims.vertex_count];
    let mut all = Vec::new();
    for seconds in clip.sample_times() {
        let mut output = Output::separate(dims, &mut positions, None)?;
        let input = Input::Clip {
            index: 0,
            seconds,
            looped: false,
        };
        let mut avatar = Avatar::new(&asset, &mut state, &mut workspace)?;
        avatar.step(&input, Budget::UNLIMITED, &mut output);
        all.extend_from_slice(&positions);
    }
    Ok(all)
}
