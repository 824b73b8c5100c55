//! Real glTF files, against counts that were taken from their JSON by hand and against positions
//! that `tests/python/skin_gltf.py` computes from them independently.

use std::path::Path;

use glam::DVec3;
use sinew_host::import::gltf::read_gltf;
use sinew_host::import::{Interpolation, RawAvatar};
use sinew_tests::{gltf_oracle, shared};

fn read(name: &str) -> Option<RawAvatar> {
    let path = shared(&format!("mesh/{name}"))?;
    let bytes = std::fs::read(&path).expect("the file was found");
    let folder = path.parent().expect("it has a folder");
    Some(read_gltf(&bytes, name, folder).expect("real files are readable"))
}

#[test]
fn cesium_man_has_the_counts_of_its_json() {
    let Some(avatar) = read("cesium_man.gltf") else {
        return;
    };
    assert_eq!(avatar.mesh.name, "Cesium_Man");
    assert_eq!(avatar.mesh.positions.len(), 3273);
    assert_eq!(avatar.mesh.primitives[0].polygon_sizes.len(), 14_016 / 3);
    assert_eq!(avatar.mesh.normals.as_ref().map(Vec::len), Some(3273));
    assert_eq!(avatar.mesh.texcoords.as_ref().map(Vec::len), Some(3273));
    assert_eq!(avatar.skin.joints.len(), 19);
    // The skin's joints and the two nodes above them.
    assert_eq!(avatar.skeleton.joints.len(), 21);
    // The file is known for vertices whose weights do not sum to one; they are kept as stated.
    let sum = |list: &Vec<(u32, f64)>| list.iter().map(|&(_, weight)| weight).sum::<f64>();
    let odd = |list: &&Vec<(u32, f64)>| (sum(list) - 1.0).abs() > 1e-6;
    assert_eq!(avatar.skin.influences.iter().filter(odd).count(), 210);
    assert_eq!(avatar.clips.len(), 1);
    let tracks = &avatar.clips[0].tracks;
    assert_eq!(tracks.len(), 57);
    assert!(tracks.iter().all(|track| track.times.len() == 49));
    assert!(
        tracks
            .iter()
            .all(|track| track.interpolation == Interpolation::Linear)
    );
    assert_eq!(tracks[0].times.last(), Some(&2.0));
    assert!(avatar.notices.is_empty(), "{:?}", avatar.notices);
}

#[test]
fn rigged_simple_has_the_counts_of_its_json() {
    let Some(avatar) = read("rigged_simple.gltf") else {
        return;
    };
    assert_eq!(avatar.mesh.positions.len(), 160);
    assert_eq!(avatar.mesh.primitives[0].corners.len(), 564);
    let joints: Vec<&str> = avatar.skeleton.joints.iter().map(|j| &*j.name).collect();
    assert_eq!(joints, ["Z_UP", "Armature", "Bone", "Bone.001"]);
    assert_eq!(avatar.skin.joints, [2, 3]);
    assert_eq!(avatar.clips[0].tracks.len(), 3);
    assert_eq!(avatar.clips[0].name, "rigged_simple");
    assert!(avatar.notices.is_empty(), "{:?}", avatar.notices);
}

#[test]
fn morph_stress_test_has_the_counts_of_its_json() {
    let Some(avatar) = read("MorphStressTest.gltf") else {
        return;
    };
    assert_eq!(avatar.mesh.name, "Cube.001");
    // 24 vertices of the base plate, which no target moves, and 1504 of the grid.
    assert_eq!(avatar.mesh.positions.len(), 24 + 1504);
    assert_eq!(avatar.mesh.primitives.len(), 2);
    let names: Vec<&str> = avatar
        .mesh
        .morphs
        .iter()
        .map(|morph| &*morph.name)
        .collect();
    assert_eq!(names[..2], ["Key 1", "Key 2"]);
    assert_eq!(names.len(), 8);
    assert!(
        avatar
            .mesh
            .morphs
            .iter()
            .all(|morph| morph.positions[..24] == [DVec3::ZERO; 24])
    );
    assert!(
        avatar
            .mesh
            .morphs
            .iter()
            .all(|morph| morph.normals.len() == 1528)
    );
    let clips: Vec<&str> = avatar.clips.iter().map(|clip| &*clip.name).collect();
    assert_eq!(clips, ["Individuals", "Pulse", "TheWave"]);
    let (interpolation, times, weights) = avatar.clips[0].morph_weights.as_ref().expect("weights");
    assert_eq!(*interpolation, Interpolation::Linear);
    assert_eq!((times.len(), weights.len()), (225, 225 * 8));
    // One rigid node.
    assert_eq!(avatar.skeleton.joints.len(), 1);
    assert!(
        avatar
            .skin
            .influences
            .iter()
            .all(|list| *list == [(0, 1.0)])
    );
}

/// Sum over all vertices and some single ones, as `skin_gltf.py FILE TIME VERTEX...` prints them.
struct Golden {
    file: &'static str,
    time: f64,
    sum: [f64; 3],
    vertices: [(usize, [f64; 3]); 3],
}

const GOLDEN: [Golden; 2] = [
    Golden {
        file: "cesium_man.gltf",
        time: 0.73,
        sum: [85.8273624265966, 3436.544345461039, 41.82945992089453],
        vertices: [
            (
                0,
                [
                    0.10508416154013384,
                    0.9359478882970531,
                    -0.015338937114739534,
                ],
            ),
            (
                1000,
                [
                    -0.06769676873443416,
                    1.4041277907059964,
                    0.08721795430787872,
                ],
            ),
            (
                3272,
                [
                    -0.09351383480328156,
                    1.4044501344483324,
                    -0.009905332367312308,
                ],
            ),
        ],
    },
    Golden {
        file: "rigged_simple.gltf",
        time: 0.9,
        sum: [
            144.35416848562014,
            -36.982710994419556,
            5.431915982678781e-05,
        ],
        vertices: [
            (
                0,
                [
                    -4.371138070706215e-08,
                    -4.575077056884766,
                    0.9999995827674866,
                ],
            ),
            (
                100,
                [2.405352199180559, 3.9104042824166276, 0.4158194807087918],
            ),
            (
                159,
                [2.1056347299275964, 4.080205520716517, 0.4158197657616111],
            ),
        ],
    },
];

#[test]
fn skinning_agrees_with_an_independent_reader() {
    for golden in &GOLDEN {
        let Some(avatar) = read(golden.file) else {
            return;
        };
        let (positions, normals) = gltf_oracle::skinned(&avatar, avatar.clips.first(), golden.time);
        // Node transforms are read as `f32`, the script's are `f64`.
        let near = |found: DVec3, expected: [f64; 3], tolerance: f64| {
            let error = (found - DVec3::from_array(expected)).length();
            assert!(error < tolerance, "{}: {error:.2e} off", golden.file);
        };
        for &(vertex, expected) in &golden.vertices {
            near(positions[vertex], expected, 1e-6);
        }
        near(
            positions.iter().sum(),
            golden.sum,
            1e-6 * positions.len() as f64,
        );
        assert!(
            normals
                .iter()
                .all(|normal| (normal.length() - 1.0).abs() < 1e-12)
        );
    }
}

#[test]
fn cesium_man_stands_upright_at_rest() {
    let Some(avatar) = read("cesium_man.gltf") else {
        return;
    };
    let (positions, _) = gltf_oracle::skinned(&avatar, None, 0.0);
    let min = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let max = positions
        .iter()
        .copied()
        .fold(DVec3::NEG_INFINITY, DVec3::max);
    assert!(min.y.abs() < 0.02, "feet at {}", min.y);
    assert!((1.4..1.6).contains(&max.y), "head at {}", max.y);
}

#[test]
fn a_real_file_cut_short_is_refused() {
    let Some(path) = shared("mesh/rigged_simple.gltf") else {
        return;
    };
    let bytes = std::fs::read(path).expect("the file was found");
    for length in (0..bytes.len() - 1).step_by(97) {
        let result = read_gltf(&bytes[..length], "cut.gltf", Path::new("."));
        assert!(result.is_err(), "{length}");
    }
}
