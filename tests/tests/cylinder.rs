//! A published skinning example with its answer: rest mesh, weights and bone matrices in, the
//! posed mesh out (Hyperspectral Inverse Skinning data set).

use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};
use sinew_core::asset::Dims;
use sinew_core::deform::{Output, PlainMesh, skin_plain};
use sinew_host::bake::{BakeOptions, bake};
use sinew_host::model::{Avatar, Bind, Joint, Mesh, Skeleton, Skin, Transform};
use sinew_host::play::Player;
use sinew_tests::shared;

const FOLDER: &str = "vertex_seq/his_cylinder";

fn numbers(path: &Path) -> Vec<f64> {
    let text = std::fs::read_to_string(path).expect("readable");
    text.split_whitespace()
        .map(|word| word.parse().expect("a number"))
        .collect()
}

fn vertices(path: &Path) -> Vec<DVec3> {
    let text = std::fs::read_to_string(path).expect("readable");
    let rows = text.lines().filter_map(|line| line.strip_prefix("v "));
    rows.map(|row| {
        let xyz: Vec<f64> = row
            .split_whitespace()
            .map(|x| x.parse().expect("a number"))
            .collect();
        DVec3::from_slice(&xyz)
    })
    .collect()
}

/// Four rows of three a bone: the transposed 3 x 4 matrix.
fn bones(path: &Path) -> Vec<DAffine3> {
    let bones = numbers(path);
    let bone = |m: &[f64]| DAffine3 {
        matrix3: DMat3::from_cols_slice(&m[..9]),
        translation: DVec3::from_slice(&m[9..12]),
    };
    bones.chunks_exact(12).map(bone).collect()
}

#[test]
fn the_plain_path_reproduces_every_pose() {
    let Some(folder) = shared(FOLDER) else { return };
    let rest = vertices(&folder.join("cylinder.obj"));
    let table = numbers(&folder.join("cylinder.DMAT"));
    let (bone_count, count) = (table[0] as usize, table[1] as usize);
    assert_eq!((bone_count, count), (4, rest.len()));
    let weight = |vertex: usize, bone: usize| table[2 + bone * count + vertex];
    let positions: Vec<[f32; 3]> = rest.iter().map(|p| p.as_vec3().to_array()).collect();
    let binds: Vec<u16> = (0..count).flat_map(|_| 0..4).collect();
    let weights: Vec<f32> = (0..count)
        .flat_map(|v| (0..4).map(move |b| weight(v, b) as f32))
        .collect();
    let mesh = PlainMesh::new(&positions, &[], &binds, &weights, 4).expect("sizes fit");
    for pose in 1..=4 {
        let palette: Vec<[f32; 12]> = bones(&folder.join(format!("cylinder-{pose}.Tmat")))
            .iter()
            .map(|m| {
                let [x, y, z] = m.matrix3.transpose().to_cols_array_2d();
                let t = m.translation;
                let rows = [
                    [x[0], x[1], x[2], t.x],
                    [y[0], y[1], y[2], t.y],
                    [z[0], z[1], z[2], t.z],
                ];
                let mut row = [0.0; 12];
                row.iter_mut()
                    .zip(rows.as_flattened())
                    .for_each(|(to, &from)| *to = from as f32);
                row
            })
            .collect();
        let dims = Dims {
            vertex_count: count,
            ..Dims::default()
        };
        let mut out = vec![0.0; 3 * count];
        let mut output = Output::separate(&dims, &mut out, None).expect("sizes fit");
        skin_plain(&mesh, &palette, &mut output);
        let truth = vertices(&folder.join(format!("cylinder-{pose}.obj")));
        let worst = truth
            .iter()
            .zip(out.as_chunks::<3>().0)
            .map(|(truth, got)| {
                (*truth - DVec3::from_array(got.map(f64::from)))
                    .abs()
                    .max_element()
            })
            .fold(0.0, f64::max);
        // The files hold six digits: 5e-7 each way on coordinates up to 2.
        assert!(worst <= 2e-6, "pose {pose}: {worst}");
    }
}

/// The same through an asset, whose weights have 15 bits: the error stays where the bake says.
#[test]
fn an_asset_reproduces_every_pose_within_its_stated_weight_error() {
    let Some(folder) = shared(FOLDER) else { return };
    let rest = vertices(&folder.join("cylinder.obj"));
    let table = numbers(&folder.join("cylinder.DMAT"));
    let count = rest.len();
    for pose in 1..=4 {
        let bones = bones(&folder.join(format!("cylinder-{pose}.Tmat")));
        // The bone matrices need not be rotations, so they stand in the inverse bind matrices.
        let body = Avatar {
            mesh: Mesh {
                name: "cylinder".into(),
                normals: vec![DVec3::Y; count],
                positions: rest.clone(),
                tangents: None,
                texcoords: None,
                triangles: Vec::new(),
                parts: Vec::new(),
                morphs: Vec::new(),
            },
            skeleton: Skeleton {
                joints: vec![Joint {
                    name: "root".into(),
                    parent: None,
                    rest: Transform::IDENTITY,
                }],
            },
            skin: Skin {
                binds: bones
                    .iter()
                    .map(|&m| Bind {
                        joint: 0,
                        inverse_bind: m,
                    })
                    .collect(),
                influences: (0..count)
                    .map(|v| {
                        let sum: f64 = (0..4).map(|b| table[2 + b * count + v]).sum();
                        (0..4)
                            .map(|b| (b as u32, table[2 + b * count + v] / sum))
                            .collect()
                    })
                    .collect(),
            },
            clips: Vec::new(),
        };
        let baked = bake(&body, &BakeOptions::default()).expect("bakes");
        let mut player = Player::new(baked.bytes.asset().expect("sound"));
        player.step(&sinew_core::frame::Input::Rest);
        let truth = vertices(&folder.join(format!("cylinder-{pose}.obj")));
        for (at, (truth, got)) in truth.iter().zip(player.positions()).enumerate() {
            // Four weights, each off by at most the stated error, on images of the vertex that
            // lie as far apart as they do.
            let images: Vec<DVec3> = bones.iter().map(|m| m.transform_point3(rest[at])).collect();
            let spread = images.iter().map(|p| p.distance(*truth)).sum::<f64>();
            let limit = baked.report.weight_error * spread + 2e-6;
            let error = truth.distance(DVec3::from_array(got.map(f64::from)));
            assert!(
                error <= limit,
                "pose {pose}, vertex {at}: {error} above {limit}"
            );
        }
    }
}
