//! BVH and OBJ readers on recordings and meshes that real programs wrote.
//!
//! With the environment variable `SINEW_DUMP_DIR` set, `dump_joint_positions` writes what
//! `tests/python/check_bvh.py` compares with other readers.

use std::path::Path;

use glam::{DQuat, DVec3};
use sinew_host::import::{
    BvhOptions, Channel, Notice, RawMesh, RawMotion, read_bvh, read_bvh_with, read_obj,
};
use sinew_tests::shared;

/// What is known of a recording without this reader.
struct Recording {
    file: &'static str,
    joints: usize,
    /// Numbers in a row.
    channels: usize,
    frames: usize,
    frame_time: f64,
    first_joints: [&'static str; 2],
    end_sites: usize,
    unit_metres: f64,
    /// First row's root translation as it stands in the file (with the `OFFSET` where it adds).
    first_root: [f64; 3],
}

const CMU_UNIT: f64 = 0.0254 / 0.45;

const RECORDINGS: [Recording; 9] = [
    Recording {
        file: "cmu_01_01.bvh",
        joints: 31,
        channels: 96,
        frames: 2752,
        frame_time: 0.008_333_3,
        first_joints: ["Hips", "LHipJoint"],
        end_sites: 7,
        unit_metres: CMU_UNIT,
        first_root: [9.3722, 17.8693, -17.3198],
    },
    Recording {
        file: "cmu_12_01_walk.bvh",
        joints: 31,
        channels: 96,
        frames: 524,
        frame_time: 0.008_333_3,
        first_joints: ["Hips", "LHipJoint"],
        end_sites: 7,
        unit_metres: CMU_UNIT,
        first_root: [0.0265, 16.2134, -25.4911],
    },
    Recording {
        file: "full_precision_frame_time.bvh",
        joints: 2,
        channels: 9,
        frames: 3,
        frame_time: 0.041_708_375_041_7,
        first_joints: ["Hips", "Head"],
        end_sites: 1,
        unit_metres: 0.1,
        first_root: [0.0, 90.0, 0.0],
    },
    Recording {
        file: "mh_benchmark_pose.bvh",
        joints: 163,
        channels: 891,
        frames: 1,
        frame_time: 0.041_667,
        first_joints: ["root", "pelvis.R"],
        end_sites: 49,
        unit_metres: 0.1,
        first_root: [-0.057_191, 0.610_814 - 0.641_280, 6.314_334 - 6.317_400],
    },
    Recording {
        file: "mh_face_poseunits.bvh",
        joints: 163,
        channels: 492,
        frames: 60,
        frame_time: 0.041_667,
        first_joints: ["root", "spine05"],
        end_sites: 49,
        unit_metres: 0.1,
        first_root: [0.0; 3],
    },
    Recording {
        file: "mixamo_tabs_freebvh.bvh",
        joints: 55,
        channels: 168,
        frames: 69,
        frame_time: 0.033_333_3,
        first_joints: ["mixamorig:Hips", "mixamorig:Spine"],
        end_sites: 15,
        unit_metres: 0.01,
        first_root: [-0.2399, 98.2948, -0.5224],
    },
    Recording {
        file: "mocapbank_crlf.bvh",
        joints: 19,
        channels: 60,
        frames: 455,
        frame_time: 0.033_333,
        first_joints: ["Hips", "Chest"],
        end_sites: 5,
        unit_metres: 0.01,
        first_root: [-44.0003, 93.5663, 229.0256],
    },
    Recording {
        file: "rotation_first_root.bvh",
        joints: 4,
        channels: 15,
        frames: 4,
        frame_time: 0.04,
        first_joints: ["Hips", "Spine"],
        end_sites: 2,
        unit_metres: CMU_UNIT,
        first_root: [10.0, 50.0, -20.0],
    },
    Recording {
        file: "yxz_test2.bvh",
        joints: 23,
        channels: 72,
        frames: 61,
        frame_time: 0.008_333,
        first_joints: ["Hips", "Chest"],
        end_sites: 5,
        unit_metres: 0.01,
        first_root: [148.829_378, 95.538_178, -16.391_471],
    },
];

fn bytes_of(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("a readable recording")
}

/// World position of every joint in every frame, `[frames][joints]`.
fn world_positions(motion: &RawMotion) -> Vec<Vec<DVec3>> {
    let joints = &motion.skeleton.joints;
    let mut translations = vec![None; joints.len()];
    let mut rotations = vec![None; joints.len()];
    for track in &motion.clip.tracks {
        match track.channel {
            Channel::Translation => translations[track.joint] = Some(&track.values),
            Channel::Rotation => rotations[track.joint] = Some(&track.values),
            Channel::Scale => panic!("BVH has no scale"),
        }
    }
    let frame_count = motion.clip.tracks.first().map_or(0, |t| t.times.len());
    let mut frames = Vec::with_capacity(frame_count);
    for frame in 0..frame_count {
        let mut world: Vec<(DVec3, DQuat)> = Vec::with_capacity(joints.len());
        for (index, joint) in joints.iter().enumerate() {
            let translation = translations[index].map_or(joint.rest.translation, |values| {
                DVec3::new(values[frame][0], values[frame][1], values[frame][2])
            });
            let rotation = rotations[index].map_or(joint.rest.rotation, |values| {
                DQuat::from_array(values[frame])
            });
            let (position, turn) = joint
                .parent
                .map_or((DVec3::ZERO, DQuat::IDENTITY), |parent| world[parent]);
            world.push((position + turn * translation, turn * rotation));
        }
        frames.push(world.into_iter().map(|(position, _)| position).collect());
    }
    frames
}

fn joint(motion: &RawMotion, name: &str) -> usize {
    let mut joints = motion.skeleton.joints.iter();
    joints
        .position(|joint| joint.name == name)
        .expect("the joint is there")
}

#[test]
fn every_recording_reads_as_stated() {
    for known in &RECORDINGS {
        let Some(path) = shared(&format!("bvh/{}", known.file)) else {
            continue;
        };
        let bytes = bytes_of(&path);
        let motion = read_bvh(&bytes, known.file).expect("a real recording");
        let joints = &motion.skeleton.joints;
        assert_eq!(joints.len(), known.joints, "{}", known.file);
        for (joint, name) in joints.iter().zip(known.first_joints) {
            assert_eq!(joint.name, name, "{}", known.file);
        }
        assert_eq!(motion.end_sites.len(), known.end_sites, "{}", known.file);
        let tracks = &motion.clip.tracks;
        assert_eq!(3 * tracks.len(), known.channels, "{}", known.file);
        for track in tracks {
            assert_eq!(track.values.len(), known.frames, "{}", known.file);
            assert_eq!(track.times.len(), known.frames, "{}", known.file);
            let last = (known.frames - 1) as f64 * known.frame_time;
            assert_eq!(track.times.last(), Some(&last), "{}", known.file);
        }
        assert_eq!(
            motion.clip.sample_period,
            Some(known.frame_time),
            "{}",
            known.file
        );
        let first = DVec3::from_array(known.first_root) * known.unit_metres;
        let root = &tracks[0].values[0];
        assert!(
            first.abs_diff_eq(DVec3::new(root[0], root[1], root[2]), 1e-12),
            "{}: {root:?}, not {first}",
            known.file
        );
        let unit = motion
            .notices
            .iter()
            .filter(|n| n.text.contains("no length unit"));
        assert_eq!(unit.count(), 1, "{}", known.file);
        let z_up = motion.notices.iter().any(|n| n.text.contains("Z is up"));
        assert_eq!(z_up, known.file.starts_with("mh_"), "{}", known.file);
    }
}

#[test]
fn captured_people_are_as_large_as_people() {
    for (file, hips, knee, foot) in [
        ("cmu_01_01.bvh", "Hips", "LeftLeg", "LeftFoot"),
        ("cmu_12_01_walk.bvh", "Hips", "LeftLeg", "LeftFoot"),
        (
            "mixamo_tabs_freebvh.bvh",
            "mixamorig:Hips",
            "mixamorig:LeftLeg",
            "mixamorig:LeftFoot",
        ),
        ("mocapbank_crlf.bvh", "Hips", "LeftKnee", "LeftAnkle"),
        ("yxz_test2.bvh", "Hips", "LeftKnee", "LeftAnkle"),
    ] {
        let Some(path) = shared(&format!("bvh/{file}")) else {
            continue;
        };
        let motion = read_bvh(&bytes_of(&path), file).expect("a real recording");
        let world = world_positions(&motion);
        let [hips, knee, foot] = [hips, knee, foot].map(|name| joint(&motion, name));
        for (number, frame) in world.iter().enumerate() {
            let shank = frame[knee].distance(frame[foot]);
            assert!(
                (0.3..0.55).contains(&shank),
                "{file} {number}: shank {shank} m"
            );
        }
        let lowest = world.iter().flatten().fold(f64::MAX, |low, p| low.min(p.y));
        assert!(lowest.abs() < 0.2, "{file}: the floor is at {lowest} m");
        let mean = world.iter().map(|frame| frame[hips].y).sum::<f64>() / world.len() as f64;
        assert!(
            (0.7..1.2).contains(&mean),
            "{file}: hips {mean} m above the floor"
        );
    }
}

#[test]
fn a_z_up_rig_stands_after_conversion() {
    let Some(path) = shared("bvh/mh_benchmark_pose.bvh") else {
        return;
    };
    let options = BvhOptions {
        z_up: true,
        ..BvhOptions::default()
    };
    let motion = read_bvh_with(&bytes_of(&path), "pose", &options).expect("a real recording");
    assert!(
        motion
            .notices
            .iter()
            .any(|n| n.text.contains("added to the OFFSET"))
    );
    let mut rest: Vec<DVec3> = Vec::new();
    for joint in &motion.skeleton.joints {
        let parent = joint.parent.map_or(DVec3::ZERO, |parent| rest[parent]);
        rest.push(parent + joint.rest.translation);
    }
    let height = rest[joint(&motion, "head")].y - rest[joint(&motion, "foot.L")].y;
    assert!(
        (1.2..1.6).contains(&height),
        "from ankle to head: {height} m"
    );
}

#[test]
fn cut_recordings_never_panic() {
    let Some(path) = shared("bvh/yxz_test2.bvh") else {
        return;
    };
    let bytes = bytes_of(&path);
    for length in (0..bytes.len()).step_by(211) {
        if let Ok(motion) = read_bvh(&bytes[..length], "cut") {
            let frames = motion.clip.tracks[0].times.len();
            assert!(frames < 61, "{length}");
        }
    }
}

fn read_mesh(relative: &str, unit_metres: f64) -> Option<(RawMesh, Vec<Notice>)> {
    let path = shared(relative)?;
    let mesh = read_obj(&bytes_of(&path), relative, unit_metres);
    Some(mesh.expect("a real mesh"))
}

fn face_count(mesh: &RawMesh) -> usize {
    mesh.primitives
        .iter()
        .map(|part| part.polygon_sizes.len())
        .sum()
}

#[test]
fn the_human_base_mesh_reads_as_stated() {
    let Some((mut mesh, notices)) = read_mesh("mesh/makehuman_base.obj", 0.1) else {
        return;
    };
    assert_eq!(mesh.positions.len(), 19158);
    assert_eq!(face_count(&mesh), 18486);
    // 172 group lines, of which 33 open a group again.
    assert_eq!(mesh.primitives.len(), 139);
    let sizes = mesh.primitives.iter().flat_map(|part| &part.polygon_sizes);
    assert!(sizes.clone().all(|size| *size == 4));
    let of_kind = |start: &str| {
        let parts = mesh.primitives.iter();
        parts.filter(|part| part.name.starts_with(start)).count()
    };
    assert_eq!((of_kind("joint-"), of_kind("helper-")), (125, 13));
    assert_eq!(mesh.normals, None);
    assert_eq!(mesh.texcoords.as_ref().map(Vec::len), Some(19158));
    assert_eq!(notices.len(), 1, "{notices:?}");
    assert!(notices[0].text.contains("texture coordinates (seams)"));

    let whole = mesh.positions.clone();
    let map = mesh.keep_primitives(&["body"]).expect("the body");
    assert_eq!(mesh.positions.len(), 13380);
    assert_eq!(mesh.texcoords.as_ref().map(Vec::len), Some(13380));
    assert_eq!(map.len(), 19158);
    for (old, new) in map.iter().enumerate() {
        if let Some(new) = new {
            assert_eq!(mesh.positions[*new as usize], whole[old]);
        }
    }
    let height = |p: &DVec3| p.y;
    let top = mesh.positions.iter().map(height).fold(f64::MIN, f64::max);
    let sole = mesh.positions.iter().map(height).fold(f64::MAX, f64::min);
    assert!((1.5..1.9).contains(&(top - sole)), "{} m tall", top - sole);
}

#[test]
fn vertex_sequences_read_as_stated() {
    for number in 0..5 {
        let file = match number {
            0 => "cylinder.obj".to_owned(),
            pose => format!("cylinder-{pose}.obj"),
        };
        let Some((mesh, notices)) = read_mesh(&format!("vertex_seq/his_cylinder/{file}"), 1.0)
        else {
            continue;
        };
        assert_eq!(mesh.positions.len(), 420, "{file}");
        assert_eq!(face_count(&mesh), 800, "{file}");
        assert_eq!(mesh.primitives.len(), 1, "{file}");
        // The rest mesh refers to texture coordinates that it does not hold.
        assert_eq!(mesh.texcoords, None, "{file}");
        assert_eq!(
            notices.len(),
            usize::from(number == 0),
            "{file}: {notices:?}"
        );
    }
}

#[test]
fn obj_vertices_are_in_the_order_of_a_raw_dump_of_the_same_mesh() {
    let Some((mesh, notices)) = read_mesh("vertex_seq/dem_bones/bone_rest.obj", 1.0) else {
        return;
    };
    let Some(path) = shared("vertex_seq/dem_bones/bone_anim_400x754x3_f32le.bin") else {
        return;
    };
    assert_eq!(notices, []);
    assert_eq!((mesh.positions.len(), face_count(&mesh)), (754, 752));
    let bytes = bytes_of(&path);
    let (values, _) = bytes.as_chunks::<4>();
    for (vertex, position) in mesh.positions.iter().enumerate() {
        for axis in 0..3 {
            let value = f64::from(f32::from_le_bytes(values[3 * vertex + axis]));
            assert!(
                (position[axis] - value).abs() < 1e-6,
                "vertex {vertex}, axis {axis}"
            );
        }
    }
}

#[test]
fn dump_joint_positions() {
    let Some(folder) = std::env::var_os("SINEW_DUMP_DIR") else {
        return;
    };
    let folder = Path::new(&folder);
    // The file's own unit, to compare with readers that know none.
    let options = BvhOptions {
        unit_metres: Some(1.0),
        ..BvhOptions::default()
    };
    for known in &RECORDINGS {
        let Some(path) = shared(&format!("bvh/{}", known.file)) else {
            continue;
        };
        let motion = read_bvh_with(&bytes_of(&path), known.file, &options).expect("a recording");
        let world = world_positions(&motion);
        let values = world.iter().flatten().flat_map(|p| p.to_array());
        let bytes: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
        let names: Vec<_> = motion.skeleton.joints.iter().map(|j| &j.name).collect();
        let stem = &motion.clip.name;
        let described = serde_json::json!({
            "source": path,
            "frames": world.len(),
            "joints": names,
            "notices": motion.notices.iter().map(|n| &n.text).collect::<Vec<_>>(),
        });
        std::fs::write(folder.join(format!("{stem}.f64")), bytes).expect("a writable folder");
        std::fs::write(folder.join(format!("{stem}.json")), described.to_string())
            .expect("a writable folder");
    }
}
