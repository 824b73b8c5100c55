//! A published sequence that linear skinning does not reproduce.

use std::path::Path;

use glam::DVec3;
use sinew_host::fit;
use sinew_host::fit::parts::{Glued, Options, Segments, learn, marker_frame};

use crate::{Failure, MODES};

/// A published vertex sequence that no linear skinning reproduces: markers on it, every second
/// frame learnt from, the others compared.
pub fn dem_bones(root: &Path) -> Result<(), Failure> {
    const COUNTS: [usize; 2] = [400, 754];
    const MARKERS: usize = 120;
    let folder = root.join("../shared/data/vertex_seq/dem_bones");
    if !folder.exists() {
        println!("SKIPPED: {} is not here", folder.display());
        return Ok(());
    }
    let numbers = std::fs::read(folder.join("bone_anim_400x754x3_f32le.bin"))?;
    let numbers: Vec<f64> = numbers
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f64::from(f32::from_le_bytes(*bytes)))
        .collect();
    let frames: Vec<Vec<DVec3>> = numbers
        .chunks_exact(3 * COUNTS[1])
        .map(|frame| frame.chunks_exact(3).map(DVec3::from_slice).collect())
        .collect();
    let text = std::fs::read(folder.join("bone_rest.obj"))?;
    let (raw, _) = sinew_host::import::read_obj(&text, "bone_rest.obj", 1.0)?;
    let (mut mesh, _) = sinew_host::model::Mesh::new(raw, "bone_rest.obj")?;
    if mesh.positions.len() != COUNTS[1] {
        return Err(format!("the mesh has {} vertices", mesh.positions.len()).into());
    }
    mesh.positions.clone_from(&frames[0]);
    let weights = std::fs::read_to_string(folder.join("bone_weights.csv"))?;
    let rows: Vec<Vec<f64>> = weights
        .lines()
        .filter_map(|line| {
            line.split(',')
                .map(|cell| cell.trim().parse().ok())
                .collect()
        })
        .collect();
    let rows: Vec<&[f64]> = rows
        .iter()
        .map(|row| &row[row.len().saturating_sub(6)..])
        .collect();
    let vertex_weights: Vec<Vec<(u32, f64)>> = rows
        .iter()
        .map(|row| {
            let sum: f64 = row.iter().sum();
            let used = row.iter().enumerate().filter(|(_, w)| **w > 1e-3);
            used.map(|(part, weight)| (part as u32, weight / sum))
                .collect()
        })
        .collect();
    let segments = Segments {
        names: (0..6).map(|part| format!("bone {part}")).collect(),
        parents: vec![None; 6],
        pivots: vec![None; 6],
        vertex_weights: vertex_weights.clone(),
        smooth: true,
    };
    let graph = fit::laplace::graph::Graph::new(&mesh.positions, &mesh.triangles);
    let chosen = graph.spread(&[0], MARKERS - 1);
    let glued: Vec<Glued> = std::iter::once(0)
        .chain(chosen)
        .map(|vertex| Glued {
            vertices: [vertex; 3],
            weights: [1.0, 0.0, 0.0],
        })
        .collect();
    let at = |frame: &Vec<DVec3>| -> Vec<DVec3> { glued.iter().map(|m| m.on(frame)).collect() };
    let train: Vec<Vec<DVec3>> = frames.iter().step_by(2).map(at).collect();
    let options = Options::default();
    let learnt = learn(
        &mesh,
        &segments,
        (&glued, &at(&frames[0])),
        &train,
        &options,
    )?;
    let held_out: Vec<&Vec<DVec3>> = frames.iter().skip(1).step_by(2).collect();
    let linear: f64 = held_out
        .iter()
        .map(|frame| linear_error(&mesh.positions, &vertex_weights, frame))
        .sum::<f64>()
        / held_out.len() as f64;
    println!(
        "dem_bones, {} markers, rms over held-out frames (extent 3.7):",
        glued.len()
    );
    println!("  best linear skinning   {:.4}", linear.sqrt());
    for (name, mode, budget) in MODES {
        let mut player = learnt.player(mode)?.with_budget(budget);
        let (mut sum, mut count) = (0.0, 0.0);
        for frame in &held_out {
            player.step(&marker_frame(&at(frame)));
            for (a, b) in player.positions().iter().zip(*frame) {
                sum += DVec3::from_array(a.map(f64::from)).distance_squared(*b);
                count += 1.0;
            }
        }
        println!("  {name:22} {:.4}", f64::sqrt(sum / count));
    }
    println!();
    Ok(())
}

/// Mean squared error of the affine matrices that fit a frame best, by normal equations.
fn linear_error(rest: &[DVec3], weights: &[Vec<(u32, f64)>], frame: &[DVec3]) -> f64 {
    const N: usize = 24;
    let row = |vertex: usize| {
        let mut row = [0.0; N];
        for &(bone, weight) in &weights[vertex] {
            let terms = [rest[vertex].x, rest[vertex].y, rest[vertex].z, 1.0];
            for (to, term) in row[4 * bone as usize..].iter_mut().zip(terms) {
                *to = weight * term;
            }
        }
        row
    };
    let mut matrix = vec![[0.0; N + 3]; N];
    for (vertex, target) in frame.iter().enumerate() {
        let row = row(vertex);
        for (to, a) in matrix.iter_mut().zip(row) {
            for (to, b) in to.iter_mut().zip(row.into_iter().chain(target.to_array())) {
                *to += a * b;
            }
        }
    }
    for at in 0..N {
        matrix[at][at] += 1e-9;
        let pivot = matrix[at];
        for below in matrix.iter_mut().skip(at + 1) {
            let share = below[at] / pivot[at];
            for (to, from) in below.iter_mut().zip(pivot) {
                *to -= share * from;
            }
        }
    }
    let mut solved = [DVec3::ZERO; N];
    for at in (0..N).rev() {
        let mut value = DVec3::new(matrix[at][N], matrix[at][N + 1], matrix[at][N + 2]);
        for (known, share) in solved.iter().zip(matrix[at]).skip(at + 1) {
            value -= share * *known;
        }
        solved[at] = value / matrix[at][at];
    }
    let error = |(vertex, target): (usize, &DVec3)| {
        let found: DVec3 = row(vertex).iter().zip(&solved).map(|(a, b)| *a * *b).sum();
        found.distance_squared(*target)
    };
    frame.iter().enumerate().map(error).sum::<f64>() / frame.len() as f64
}
