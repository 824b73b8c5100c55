//! Meshes, skins and morph targets.

use glam::{DAffine3, DQuat, DVec3};

use super::*;
use crate::import::Transform;

fn vector(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

#[test]
fn a_rigid_mesh_hangs_on_its_node() {
    let mut file = one_triangle(|_| json!({}));
    file.root["meshes"][0]["name"] = json!("hat");
    file.root["nodes"][0]["name"] = json!("head");
    file.push(
        "nodes",
        json!({ "children": [0], "translation": [1, 2, 3], "scale": [2, 2, 2] }),
    );
    file.push("nodes", json!({ "name": "elsewhere" }));
    let avatar = file.read().unwrap();

    assert_eq!(avatar.mesh.name, "hat");
    assert_eq!(avatar.mesh.positions, [DVec3::ZERO, DVec3::X, DVec3::Y]);
    assert_eq!(avatar.mesh.normals, None);
    assert_eq!(avatar.mesh.primitives[0].name, "hat");
    assert_eq!(avatar.mesh.primitives[0].corners, [0, 1, 2]);
    assert_eq!(avatar.mesh.primitives[0].polygon_sizes, [3]);
    let joints = &avatar.skeleton.joints;
    assert_eq!(joints.len(), 2);
    assert_eq!(
        (joints[0].name.as_str(), joints[0].parent),
        ("head", Some(1))
    );
    assert_eq!((joints[1].name.as_str(), joints[1].parent), ("", None));
    assert_eq!(joints[1].rest.translation, vector(1.0, 2.0, 3.0));
    assert_eq!(joints[1].rest.scale, DVec3::splat(2.0));
    assert_eq!(avatar.skin.joints, [0]);
    assert_eq!(avatar.skin.inverse_bind, [DAffine3::IDENTITY]);
    assert_eq!(avatar.skin.influences, vec![vec![(0, 1.0)]; 3]);
    assert!(avatar.notices.is_empty(), "{:?}", avatar.notices);
}

#[test]
fn text_binary_and_external_buffers_read_alike() {
    let file = skinned();
    let binary = file.read().unwrap();
    let text = read_bytes(file.text().as_bytes()).unwrap();
    assert_eq!(binary, text);

    let folder = std::env::temp_dir().join(format!("sinew-gltf-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("sub dir")).unwrap();
    std::fs::write(folder.join("sub dir/a.bin"), &file.bin).unwrap();
    let external = |length: usize, uri: &str| {
        let json = file.json(json!({ "byteLength": length, "uri": uri }));
        read_gltf(json.as_bytes(), "body.gltf", &folder)
    };
    let whole = external(file.bin.len(), "sub%20dir/a.bin");
    let short = external(file.bin.len() + 1, "sub%20dir/a.bin");
    let absent = external(file.bin.len(), "b.bin");
    let directory = external(file.bin.len(), "sub%20dir");
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(whole.unwrap(), binary);
    let text = short.unwrap_err().to_string();
    assert!(
        text.starts_with("body.gltf in buffers[0]: the file ends inside"),
        "{text}"
    );
    let text = absent.unwrap_err().to_string();
    assert!(text.contains("cannot be read"), "{text}");
    let text = directory.unwrap_err().to_string();
    assert!(text.contains("not a regular file"), "{text}");
}

#[test]
fn skins_keep_weights_and_ignore_the_node() {
    let mut file = skinned();
    file.root["nodes"][0]["translation"] = json!([9, 9, 9]);
    // Sixteen numbers in columns: a translation by (5, 6, 7), then the identity.
    let mut matrices = [0.0_f32; 32];
    for i in [0, 5, 10, 15, 16, 21, 26, 31] {
        matrices[i] = 1.0;
    }
    matrices[12..15].copy_from_slice(&[5.0, 6.0, 7.0]);
    let matrices = file.floats("MAT4", &matrices);
    file.root["skins"][0]["inverseBindMatrices"] = json!(matrices);
    let avatar = file.read().unwrap();

    let names: Vec<&str> = avatar.skeleton.joints.iter().map(|j| &*j.name).collect();
    assert_eq!(names, ["hip", "knee", "root"]);
    assert_eq!(avatar.skeleton.joints[0].parent, Some(2));
    assert_eq!(avatar.skin.joints, [0, 1]);
    let shift = DAffine3::from_translation(vector(5.0, 6.0, 7.0));
    assert_eq!(avatar.skin.inverse_bind, [shift, DAffine3::IDENTITY]);
    let influences = [vec![(0, 0.25), (1, 0.75)], vec![(1, 1.0)], vec![(1, 1.0)]];
    assert_eq!(avatar.skin.influences, influences);
}

#[test]
fn two_skins_and_a_rigid_mesh_share_one_skeleton() {
    let mut file = skinned();
    // The same mesh again, on a second skin that shares the knee, and once rigid.
    file.push("nodes", json!({ "mesh": 0, "skin": 1 }));
    file.push("nodes", json!({ "mesh": 0 }));
    file.push("skins", json!({ "joints": [2, 3] }));
    let avatar = file.read().unwrap();
    assert_eq!(avatar.mesh.positions.len(), 9);
    assert_eq!(avatar.mesh.primitives.len(), 3);
    assert_eq!(avatar.mesh.primitives[2].corners, [6, 7, 8]);
    // Joints: nodes 1, 2, 3 and 5.
    assert_eq!(avatar.skeleton.joints.len(), 4);
    assert_eq!(avatar.skin.joints, [0, 1, 1, 2, 3]);
    assert_eq!(avatar.skin.influences[3], [(2, 0.25), (3, 0.75)]);
    assert_eq!(avatar.skin.influences[8], [(4, 1.0)]);
}

#[test]
fn integer_weights_and_further_sets() {
    let file = one_triangle(|file| {
        let zero = file.accessor("VEC4", U16, &[0_u16; 12]);
        let one = file.accessor("VEC4", U8, &[1_u8; 12]);
        let bytes = [255_u8, 0, 0, 0, 51, 0, 0, 0, 0, 0, 0, 0];
        let bytes = file.fractions("VEC4", U8, &bytes);
        let shorts = [0_u16, 0, 0, 0, 13_107, 0, 0, 0, 65_535, 0, 0, 0];
        let shorts = file.fractions("VEC4", U16, &shorts);
        json!({ "JOINTS_0": zero, "WEIGHTS_0": bytes, "JOINTS_1": one, "WEIGHTS_1": shorts })
    });
    let mut file = file;
    file.push("nodes", json!({}));
    file.push("skins", json!({ "joints": [1, 0] }));
    file.root["nodes"][0]["skin"] = json!(0);
    let influences = file.read().unwrap().skin.influences;
    // 51/255 and 13107/65535 are both 1/5.
    assert_eq!(
        influences,
        [vec![(0, 1.0)], vec![(0, 0.2), (1, 0.2)], vec![(1, 1.0)]]
    );

    let meshes = file.root["meshes"].clone();
    let mut missing = file.clone();
    missing.set("/meshes/0/primitives/0/attributes", {
        let mut attributes = meshes[0]["primitives"][0]["attributes"].clone();
        attributes.as_object_mut().unwrap().remove("WEIGHTS_1");
        attributes
    });
    let text = missing.read().unwrap_err().to_string();
    assert!(
        text.contains("meshes[0].primitives[0]: the attribute WEIGHTS_1 is missing"),
        "{text}"
    );
}

#[test]
fn vertices_without_weights_stay_empty() {
    let mut file = skinned();
    let weights = file.floats("VEC4", &[0.0; 12]);
    file.set(
        "/meshes/0/primitives/0/attributes/WEIGHTS_0",
        json!(weights),
    );
    let avatar = file.read().unwrap();
    assert_eq!(avatar.skin.influences, vec![vec![]; 3]);

    let mut bare = one_triangle(|_| json!({}));
    bare.push("skins", json!({ "joints": [0] }));
    bare.root["nodes"][0]["skin"] = json!(0);
    let avatar = bare.read().unwrap();
    assert_eq!(avatar.skin.influences, vec![vec![]; 3]);
    assert!(notice(&avatar, "no weights"));
}

#[test]
fn indices_of_every_width_and_topology() {
    let mut file = File::default();
    let square = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
    let positions = file.floats("VEC3", &square);
    let bytes = file.accessor("SCALAR", U8, &[0_u8, 1, 2, 2, 1, 3, 3]);
    let shorts = file.accessor("SCALAR", U16, &[0_u16, 1, 2, 3]);
    let words = file.accessor("SCALAR", U32, &[0_u32, 1, 3, 2]);
    let primitive = |mode: u32, indices: Option<usize>| {
        let mut primitive = json!({ "attributes": { "POSITION": positions }, "mode": mode });
        if let Some(indices) = indices {
            primitive["indices"] = json!(indices);
        }
        primitive
    };
    let primitives = [
        primitive(4, Some(bytes)),
        primitive(5, Some(shorts)),
        primitive(6, Some(words)),
        primitive(5, None),
        primitive(1, None),
        primitive(0, None),
    ];
    file.push("meshes", json!({ "primitives": primitives }));
    file.push("nodes", json!({ "mesh": 0 }));
    let avatar = file.read().unwrap();
    let corners: Vec<&[u32]> = avatar.mesh.primitives.iter().map(|p| &*p.corners).collect();
    // The specification turns every second triangle of a strip; a fan ends on its first corner.
    let strip: &[u32] = &[0, 1, 2, 1, 3, 2];
    assert_eq!(
        corners,
        [&[0, 1, 2, 2, 1, 3], strip, &[1, 3, 0, 3, 2, 0], strip]
    );
    // All share one vertex range.
    assert_eq!(avatar.mesh.positions.len(), 4);
    assert!(notice(&avatar, "1 corners after the last whole triangle"));
    assert!(notice(&avatar, "Lines skipped") && notice(&avatar, "Points skipped"));
}

#[test]
fn quantised_and_interleaved_attributes() {
    let mut file = File::default();
    // Position as i16, two bytes of padding, then normal as normalised i8, one byte of padding.
    let mut bytes = Vec::new();
    for (position, normal) in [([1_i16, 2, -3], [127_i8, 0, 0]), ([4, 5, 6], [0, -128, 0])] {
        bytes.extend(bytemuck::cast_slice::<i16, u8>(&position));
        bytes.extend([0, 0]);
        bytes.extend(bytemuck::cast_slice::<i8, u8>(&normal));
        bytes.push(0);
    }
    bytes.truncate(bytes.len() - 1);
    let view = file.view(&bytes);
    file.root["bufferViews"][view]["byteStride"] = json!(12);
    let accessor = json!({
        "bufferView": view, "componentType": I16, "count": 2, "type": "VEC3",
    });
    let positions = file.push("accessors", accessor.clone());
    let normals = file.push("accessors", accessor);
    file.root["accessors"][normals]["byteOffset"] = json!(8);
    file.root["accessors"][normals]["componentType"] = json!(I8);
    file.root["accessors"][normals]["normalized"] = json!(true);
    let texcoords = file.fractions("VEC2", U16, &[0_u16, 65_535, 13_107, 0]);
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": texcoords });
    file.push(
        "meshes",
        json!({ "primitives": [{ "attributes": attributes }] }),
    );
    file.push("nodes", json!({ "mesh": 0 }));
    file.root.insert(
        "extensionsRequired".into(),
        json!(["KHR_mesh_quantization"]),
    );
    let mesh = file.read().unwrap().mesh;
    assert_eq!(
        mesh.positions,
        [vector(1.0, 2.0, -3.0), vector(4.0, 5.0, 6.0)]
    );
    assert_eq!(mesh.normals.unwrap(), [DVec3::X, DVec3::NEG_Y]);
    assert_eq!(mesh.texcoords.unwrap(), [[0.0, 1.0], [0.2, 0.0]]);
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut file = one_triangle(|_| json!({}));
    let indices = file.view(&[0, 2]);
    let values = file.view(bytemuck::cast_slice(&[7.0_f32, 8.0, 9.0, 1.0, 2.0, 3.0]));
    file.root["accessors"][0]["sparse"] = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": U8 },
        "values": { "bufferView": values },
    });
    let expected = [vector(7.0, 8.0, 9.0), DVec3::X, vector(1.0, 2.0, 3.0)];
    assert_eq!(file.read().unwrap().mesh.positions, expected);
    // Without a base, the elements that are not listed are zero.
    file.root["accessors"][0]
        .as_object_mut()
        .unwrap()
        .remove("bufferView");
    let expected = [vector(7.0, 8.0, 9.0), DVec3::ZERO, vector(1.0, 2.0, 3.0)];
    assert_eq!(file.read().unwrap().mesh.positions, expected);
}

#[test]
fn missing_and_zero_normals_come_from_triangles() {
    let mut file = one_triangle(|file| {
        let normals = file.floats("VEC3", &[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
        let tangents = file.floats("VEC4", &[1.0, 0.0, 0.0, -1.0].repeat(3));
        json!({ "NORMAL": normals, "TANGENT": tangents })
    });
    let avatar = file.read().unwrap();
    assert_eq!(
        avatar.mesh.normals.as_deref(),
        Some(&[DVec3::Z, DVec3::Z, DVec3::X][..])
    );
    assert_eq!(
        avatar.mesh.tangents.as_deref(),
        Some(&[[1.0, 0.0, 0.0, -1.0]; 3][..])
    );
    assert!(notice(&avatar, "1 vertices without a normal"));

    let bare = json!({ "attributes": { "POSITION": 0 } });
    file.push("meshes", json!({ "primitives": [bare] }));
    file.push("nodes", json!({ "mesh": 1 }));
    let avatar = file.read().unwrap();
    assert_eq!(avatar.mesh.normals.unwrap()[3..], [DVec3::Z; 3]);
    assert_eq!(avatar.mesh.tangents, None);
}

#[test]
fn matrices_become_transforms_and_shear_is_said() {
    let mut file = one_triangle(|_| json!({}));
    // Columns: x to y, y to -x, z doubled, shift (1, 2, 3): a quarter turn about z.
    let matrix = json!([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 2, 0, 1, 2, 3, 1]);
    file.root["nodes"][0]["matrix"] = matrix;
    let avatar = file.read().unwrap();
    let Transform {
        translation,
        rotation,
        scale,
    } = avatar.skeleton.joints[0].rest;
    let quarter = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
    assert_eq!(translation, vector(1.0, 2.0, 3.0));
    assert!(rotation.abs_diff_eq(quarter, 1e-12), "{rotation}");
    assert!(scale.abs_diff_eq(vector(1.0, 1.0, 2.0), 1e-12));
    assert!(avatar.notices.is_empty());
    file.set("/nodes/0/matrix/4", json!(-1.5));
    file.set("/nodes/0/matrix/5", json!(0.5));
    assert!(notice(&file.read().unwrap(), "shear"));
    file.set("/nodes/0/matrix/15", json!(0.5));
    let text = file.read().unwrap_err().to_string();
    assert!(text.contains("nodes[0]: the last row"), "{text}");
}

#[test]
fn the_default_scene_chooses_the_meshes() {
    let mut file = one_triangle(|_| json!({}));
    file.push("nodes", json!({ "mesh": 0 }));
    assert_eq!(file.read().unwrap().mesh.positions.len(), 6);
    file.push("scenes", json!({ "nodes": [1] }));
    file.push("scenes", json!({}));
    assert_eq!(file.read().unwrap().mesh.positions.len(), 6);
    file.root.insert("scene".into(), json!(0));
    assert_eq!(file.read().unwrap().mesh.positions.len(), 3);
    file.root.insert("scene".into(), json!(1));
    let avatar = file.read().unwrap();
    assert_eq!(avatar.mesh.positions.len(), 6);
    assert!(notice(&avatar, "all nodes taken"));
}

#[test]
fn morph_targets_of_two_meshes_stand_one_after_another() {
    let mut file = File::default();
    let positions = file.triangle();
    let up = file.floats("VEC3", &[0.0, 1.0, 0.0].repeat(3));
    let tilt = file.floats("VEC3", &[0.5, 0.0, 0.0].repeat(3));
    // An accessor without data is all zero: exporters write it for a target that does nothing.
    let nothing = file.push(
        "accessors",
        json!({ "componentType": F32, "count": 3, "type": "VEC3" }),
    );
    let attributes = json!({ "POSITION": positions });
    let targets = json!([{ "POSITION": up, "NORMAL": tilt }, { "POSITION": nothing }]);
    file.push(
        "meshes",
        json!({
            "primitives": [{ "attributes": attributes, "targets": targets }],
            "weights": [0.25, 0.5], "extras": { "targetNames": ["smile", "frown"] },
        }),
    );
    let targets = json!([{ "POSITION": tilt }]);
    file.push(
        "meshes",
        json!({
            "primitives": [{ "attributes": attributes, "targets": targets }],
        }),
    );
    file.push("nodes", json!({ "mesh": 0, "weights": [1, 0] }));
    file.push("nodes", json!({ "mesh": 1 }));
    file.push("nodes", json!({ "mesh": 0 }));
    let morphs = file.read().unwrap().mesh.morphs;

    let about: Vec<(&str, f64)> = morphs.iter().map(|m| (&*m.name, m.rest_weight)).collect();
    let expected = [
        ("smile", 1.0),
        ("frown", 0.0),
        ("0", 0.0),
        ("smile", 0.25),
        ("frown", 0.5),
    ];
    assert_eq!(about, expected);
    let (zero, up, side) = ([DVec3::ZERO; 3], [DVec3::Y; 3], [DVec3::X * 0.5; 3]);
    assert_eq!(morphs[0].positions, [up, zero, zero].concat());
    assert_eq!(morphs[0].normals, [side, zero, zero].concat());
    assert_eq!(morphs[1].positions, [DVec3::ZERO; 9]);
    assert!(morphs[1].normals.is_empty());
    assert_eq!(morphs[2].positions, [zero, side, zero].concat());
    assert_eq!(morphs[3].positions, [zero, zero, up].concat());
}
