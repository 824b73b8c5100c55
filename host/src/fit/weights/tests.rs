use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::*;
use crate::import::{RawMesh, RawPrimitive, Transform};
use crate::model::Joint;

/// A closed tube along x from 0 to 1, 0.1 thick.
fn tube() -> Mesh {
    const RINGS: u32 = 41;
    const SIDES: u32 = 12;
    let mut positions = Vec::new();
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let angle = TAU * f64::from(side) / f64::from(SIDES);
            let x = f64::from(ring) / f64::from(RINGS - 1);
            positions.push(DVec3::new(x, 0.05 * angle.cos(), 0.05 * angle.sin()));
        }
    }
    positions.extend([DVec3::ZERO, DVec3::X]);
    let mut corners = Vec::new();
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let next = (side + 1) % SIDES;
            let [a, b] = [ring * SIDES + side, ring * SIDES + next];
            if ring + 1 < RINGS {
                corners.extend([a, b, b + SIDES, a, b + SIDES, a + SIDES]);
            }
            if ring == 0 {
                corners.extend([b, a, RINGS * SIDES]);
            }
            if ring + 1 == RINGS {
                corners.extend([a, b, RINGS * SIDES + 1]);
            }
        }
    }
    let polygon_sizes = vec![3; corners.len() / 3];
    let raw = RawMesh {
        positions,
        primitives: vec![RawPrimitive {
            name: "tube".into(),
            corners,
            polygon_sizes,
        }],
        ..RawMesh::default()
    };
    Mesh::new(raw, "tube").expect("sound").0
}

/// A chain of joints along x.
fn chain(at: &[f64]) -> Skeleton {
    let joint = |(index, x): (usize, &f64)| {
        let before = index.checked_sub(1).map_or(0.0, |before| at[before]);
        Joint {
            name: format!("joint {index}"),
            parent: index.checked_sub(1),
            rest: Transform {
                translation: DVec3::X * (x - before),
                rotation: DQuat::IDENTITY,
                scale: DVec3::ONE,
            },
        }
    };
    Skeleton {
        joints: at.iter().enumerate().map(joint).collect(),
    }
}

fn weight(skin: &Skin, vertex: usize, joint: u32) -> f64 {
    let row = skin.influences[vertex].iter();
    row.filter(|&&(own, _)| own == joint)
        .map(|&(_, weight)| weight)
        .sum()
}

#[test]
fn both_ways_hand_over_at_the_joint() {
    let mesh = tube();
    let skeleton = chain(&[0.02, 0.5]);
    for method in [Method::Simple, Method::Smooth] {
        let options = WeightOptions {
            method,
            ..WeightOptions::default()
        };
        let weighed = weigh(&mesh, &skeleton, &options).expect("weighs");
        assert!(weighed.idle.is_empty());
        for (vertex, at) in mesh.positions.iter().enumerate() {
            let second = weight(&weighed.skin, vertex, 1);
            match at.x {
                x if x < 0.35 => assert!(second < 0.05, "{method:?} {x} {second}"),
                x if x > 0.65 => assert!(second > 0.95, "{method:?} {x} {second}"),
                x if (x - 0.5).abs() < 1e-9 => {
                    // Members change from one ring of vertices to the next: this one is of one side.
                    assert!((second - 0.5).abs() < 0.3, "{method:?} {second}");
                }
                _ => {}
            }
        }
    }
}

#[test]
fn one_influence_is_the_heaviest() {
    let mesh = tube();
    let options = WeightOptions {
        influences: 1,
        ..WeightOptions::default()
    };
    let skin = weigh(&mesh, &chain(&[0.02, 0.3, 0.6]), &options)
        .expect("weighs")
        .skin;
    for (row, at) in skin.influences.iter().zip(&mesh.positions) {
        let joint = u32::from(at.x > 0.31) + u32::from(at.x > 0.61);
        let border = (at.x - 0.3).abs() < 0.03 || (at.x - 0.6).abs() < 0.03;
        assert!(border || row[..] == [(joint, 1.0)], "{row:?} at {at}");
    }
}

#[test]
fn joints_in_one_place_share_nothing() {
    let mesh = tube();
    let weighed = weigh(&mesh, &chain(&[0.02, 0.02, 0.5]), &WeightOptions::default());
    let weighed = weighed.expect("weighs");
    assert_eq!(weighed.idle, [0]);
}

#[test]
fn known_members_are_kept() {
    let mesh = tube();
    let inside = Inside::new(&mesh, CELLS).expect("a surface");
    // Against what the bones say.
    let members: Vec<u32> = mesh
        .positions
        .iter()
        .map(|at| u32::from(at.x > 0.7))
        .collect();
    let skeleton = chain(&[0.02, 0.5]);
    let weighed = weigh_members(
        &mesh,
        &inside,
        &skeleton,
        &members,
        &WeightOptions::default(),
    );
    let skin = weighed.expect("weighs").skin;
    for (vertex, at) in mesh.positions.iter().enumerate() {
        let own = weight(&skin, vertex, members[vertex]);
        assert!((at.x - 0.7).abs() < 0.15 || own > 0.95, "{own} at {at}");
    }
}
