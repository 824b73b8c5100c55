//! Files that are damaged or lie.

use super::*;
use crate::import::{ImportErrorKind, Place};

fn error_after(change: impl FnOnce(&mut File)) -> ImportError {
    let mut file = skinned();
    change(&mut file);
    file.read().unwrap_err()
}

/// The error of a skinned triangle with one value replaced.
fn error_with(pointer: &str, value: Value) -> ImportError {
    error_after(|file| file.set(pointer, value))
}

fn is_at(error: &ImportError, item: &str) -> bool {
    error.place == Place::Item(item.into())
}

#[test]
fn every_truncation_is_refused() {
    let bytes = skinned().glb();
    assert!(read_bytes(&bytes).is_ok());
    assert_eq!(read_bytes(&[]).unwrap_err().kind, ImportErrorKind::Empty);
    for length in 1..bytes.len() {
        let error = read_bytes(&bytes[..length]).unwrap_err();
        let truncated = matches!(error.kind, ImportErrorKind::Truncated { .. });
        assert!(
            truncated && matches!(error.place, Place::Byte(_)),
            "{length}: {error}"
        );
    }
    let text = skinned().text();
    for length in 1..text.len() {
        let error = read_bytes(&text.as_bytes()[..length]).unwrap_err();
        assert!(matches!(error.place, Place::Line(1)), "{length}: {error}");
    }
}

#[test]
fn every_changed_byte_is_read_or_refused() {
    // The outcome may be either; what counts is that none of them panics or asks for all memory.
    for bytes in [skinned().glb(), skinned().text().into_bytes()] {
        let mut refused = 0;
        for at in 0..bytes.len() {
            for flip in [0x01, 0x10, 0x80, 0xFF] {
                let mut bytes = bytes.clone();
                bytes[at] ^= flip;
                refused += usize::from(read_bytes(&bytes).is_err());
            }
        }
        assert!(refused > bytes.len() / 2, "{refused} of {}", bytes.len());
    }
}

#[test]
fn chunks_that_lie_are_refused() {
    let bytes = skinned().glb();
    let at = |offset: usize, value: u32| {
        let mut bytes = bytes.clone();
        bytes[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
        read_bytes(&bytes)
    };
    let text = |offset, value| at(offset, value).unwrap_err().to_string();
    assert!(text(0, 0).contains("not a glTF file"));
    assert!(text(4, 1).contains("GLB version 1 is not supported"));
    assert!(text(8, 0).contains("which must be at least 20"));
    assert!(text(8, 11).contains("which must be at least 20"));
    assert!(text(8, u32::MAX).contains("the file ends inside the file"));
    assert!(text(12, u32::MAX).contains("at byte 12: the file ends inside a chunk"));
    // The JSON text is then taken for the next chunk's header.
    assert!(text(12, 0).contains("at byte 20: the file ends inside a chunk"));
    assert!(text(16, 0).contains("the JSON chunk is missing"));

    let mut longer = bytes.clone();
    longer.extend([1, 2, 3]);
    assert!(notice(
        &read_bytes(&longer).unwrap(),
        "3 bytes after the announced end"
    ));
    let json_length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    let error = at(20 + json_length + 4, 7).unwrap_err();
    assert!(is_at(&error, "buffers[0]"), "{error}");
}

#[test]
fn text_that_is_no_gltf_is_refused() {
    let text = |text: &str| read_bytes(text.as_bytes()).unwrap_err().to_string();
    assert!(text("HIERARCHY\nROOT").contains(r#"it starts with "HIERARCH""#));
    assert!(text("{}").contains("asset.version is missing"));
    assert!(text("{\n\n\"a\" 1}").starts_with("dir/body.glb:3: this is not glTF 2.0 JSON"));
    assert!(text(r#"{"asset": {"version": "1.0"}}"#).contains(r#"glTF version "1.0""#));
    let later = r#"{"asset": {"version": "2.1", "minVersion": "2.1"}}"#;
    assert!(text(later).contains(r#"glTF version "2.1" is not supported"#));
    assert!(text(r#"{"asset": {"version": "2.0"}}"#).contains("a mesh, a skin or an animation"));
    let nodes = r#"{"asset": {"version": "2.0"}, "nodes": 3}"#;
    assert!(text(nodes).contains("nodes is a number, which must be an array"));
    let deep = format!("{{\"a\":{}", "[".repeat(100_000));
    assert!(text(&deep).contains("recursion limit"));
    let marked = format!("\u{feff}{}", skinned().text());
    assert!(notice(
        &read_bytes(marked.as_bytes()).unwrap(),
        "byte order mark"
    ));
}

#[test]
fn extensions_that_change_the_geometry_are_refused_by_name() {
    let required = |name: &str| {
        let mut file = skinned();
        file.root.insert("extensionsRequired".into(), json!([name]));
        file.read()
    };
    for name in [
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "EXT_mesh_gpu_instancing",
        "VENDOR_own",
    ] {
        let error = required(name).unwrap_err();
        assert!(matches!(error.kind, ImportErrorKind::Unsupported { .. }));
        assert!(error.to_string().contains(name), "{error}");
        assert!(is_at(&error, "extensionsRequired[0]"));
    }
    assert!(required("KHR_materials_unlit").is_ok());
    assert!(required("KHR_mesh_quantization").is_ok());
    // Where an extension holds the data, and says so too late.
    let error = error_after(|file| {
        file.root["accessors"][0]
            .as_object_mut()
            .unwrap()
            .remove("bufferView");
    });
    assert!(is_at(&error, "accessors[0]"), "{error}");
}

#[test]
fn counts_and_ranges_that_lie_are_refused_before_any_allocation() {
    for (pointer, value, item) in [
        (
            "/accessors/0/count",
            json!(4_000_000_000_u32),
            "accessors[0]",
        ),
        ("/accessors/0/count", json!(u64::MAX), "accessors[0]"),
        ("/accessors/0/count", json!(4), "accessors[0]"),
        (
            "/bufferViews/0/byteLength",
            json!(1_u64 << 40),
            "bufferViews[0]",
        ),
        ("/bufferViews/0/byteLength", json!(35), "accessors[0]"),
        (
            "/bufferViews/0/byteOffset",
            json!(u64::MAX),
            "bufferViews[0]",
        ),
        ("/bufferViews/0/buffer", json!(7), "bufferViews[0]"),
        (
            "/bufferViews/0/buffer",
            json!(1_u64 << 32),
            "bufferViews[0]",
        ),
        ("/accessors/0/bufferView", json!(99), "accessors[0]"),
        ("/accessors/0/componentType", json!(5125), "accessors[0]"),
        ("/accessors/0/componentType", json!(1), "accessors[0]"),
        (
            "/accessors/0/componentType",
            json!((1_u64 << 32) + 5126),
            "accessors[0]",
        ),
        ("/accessors/0/type", json!("VEC4"), "accessors[0]"),
        ("/accessors/0/type", json!("VEC9"), "accessors[0]"),
        ("/accessors/0/type", json!(3), "accessors[0]"),
        ("/accessors/1/componentType", json!(F32), "accessors[1]"),
        ("/accessors/2/componentType", json!(U32), "accessors[2]"),
    ] {
        let error = error_with(pointer, value.clone());
        assert!(is_at(&error, item), "{pointer} = {value}: {error}");
    }
    let error = error_after(|file| file.root["bufferViews"][0]["byteStride"] = json!(8));
    assert!(
        error
            .to_string()
            .contains("byteStride of bufferViews[0] is 8"),
        "{error}"
    );
}

#[test]
fn small_files_cannot_ask_for_all_memory() {
    // A sparse accessor has no base data to hold its count against.
    let sparse = |count: u64| {
        let mut file = skinned();
        let bytes = file.view(&[0; 16]);
        file.root["accessors"][0] = json!({
            "componentType": F32, "count": count, "type": "VEC3",
            "sparse": {
                "count": 1,
                "indices": { "bufferView": bytes, "componentType": U8 },
                "values": { "bufferView": bytes },
            },
        });
        file.read().unwrap_err()
    };
    for count in [4_000_000_000, 1 << 28, u64::MAX] {
        let error = sparse(count);
        assert!(
            matches!(error.kind, ImportErrorKind::TooMany { .. }),
            "{error}"
        );
    }
    // Many nodes that share one mesh of many primitives.
    let mut file = one_triangle(|_| json!({}));
    let primitive = file.root["meshes"][0]["primitives"][0].clone();
    file.set("/meshes/0/primitives", json!(vec![primitive; 1000]));
    file.root
        .insert("nodes".into(), json!(vec![json!({ "mesh": 0 }); 1000]));
    let error = file.read().unwrap_err();
    assert!(
        matches!(error.kind, ImportErrorKind::TooMany { .. }),
        "{error}"
    );
}

#[test]
fn sparse_accessors_that_lie_are_refused() {
    let sparse = |count: u64, places: &[u8]| {
        let mut file = skinned();
        let indices = file.view(places);
        let values = file.view(&[0; 36]);
        file.root["accessors"][0]["sparse"] = json!({
            "count": count,
            "indices": { "bufferView": indices, "componentType": U8 },
            "values": { "bufferView": values },
        });
        file.read()
    };
    assert!(sparse(2, &[0, 2]).is_ok());
    for (count, places) in [
        (4, &[0, 1, 2, 3][..]),
        (2, &[0, 3]),
        (2, &[1, 1]),
        (2, &[2, 1]),
    ] {
        let error = sparse(count, places).unwrap_err();
        assert!(is_at(&error, "accessors[0].sparse"), "{error}");
    }
    let error = sparse(3, &[0, 1]).unwrap_err();
    assert!(
        matches!(error.kind, ImportErrorKind::Truncated { .. }),
        "{error}"
    );
}

#[test]
fn references_to_nothing_are_refused() {
    for (pointer, item) in [
        ("/nodes/0/mesh", "nodes[0]"),
        ("/nodes/0/skin", "nodes[0]"),
        ("/nodes/3/children/1", "nodes[3].children[1]"),
        ("/skins/0/joints/1", "skins[0].joints[1]"),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            "meshes[0].primitives[0]",
        ),
        (
            "/meshes/0/primitives/0/attributes/JOINTS_0",
            "meshes[0].primitives[0]",
        ),
    ] {
        let error = error_with(pointer, json!(1000));
        let bad_index = matches!(error.kind, ImportErrorKind::BadIndex { index: 1000, .. });
        assert!(bad_index && is_at(&error, item), "{pointer}: {error}");
        let error = error_with(pointer, json!(-1));
        assert!(
            matches!(error.kind, ImportErrorKind::NotThisFormat { .. }),
            "{error}"
        );
    }
    let mut file = skinned();
    let indices = file.accessor("SCALAR", U16, &[0_u16, 1, 65_535]);
    file.root["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let error = file.read().unwrap_err();
    assert!(
        error
            .to_string()
            .contains("vertex (index 2 of the list) 65535"),
        "{error}"
    );
    file.root.insert("scene".into(), json!(0));
    assert!(is_at(&file.read().unwrap_err(), "scene"));
    file.root.insert("scenes".into(), json!([{ "nodes": [4] }]));
    assert!(is_at(&file.read().unwrap_err(), "scenes[0].nodes[0]"));
}

#[test]
fn joints_outside_the_skin_matter_only_with_a_weight() {
    let joints = |bytes: [u8; 12]| {
        let mut file = skinned();
        let joints = file.accessor("VEC4", U8, &bytes);
        file.set("/meshes/0/primitives/0/attributes/JOINTS_0", json!(joints));
        file.read()
    };
    assert!(joints([0, 1, 200, 200, 1, 200, 200, 200, 1, 0, 0, 0]).is_ok());
    let error = joints([0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0]).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("joint (JOINTS_0 of vertex 1) 2 does not exist"),
        "{error}"
    );
}

#[test]
fn values_that_make_no_sense_are_refused() {
    let replaced = |name: &str, shape: &str, bad: f32| {
        let mut file = skinned();
        let mut numbers = vec![0.0; if shape == "VEC3" { 9 } else { 12 }];
        numbers[5] = bad;
        let accessor = file.floats(shape, &numbers);
        file.root["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
        file.read()
    };
    for bad in [f32::NAN, f32::INFINITY] {
        for (name, shape) in [
            ("POSITION", "VEC3"),
            ("NORMAL", "VEC3"),
            ("WEIGHTS_0", "VEC4"),
        ] {
            let error = replaced(name, shape, bad).unwrap_err();
            let text = format!("{name} of element 1 is not finite");
            assert!(error.to_string().contains(&text), "{error}");
        }
        let avatar = replaced("TANGENT", "VEC4", bad).unwrap();
        assert!(avatar.mesh.tangents.is_none() && notice(&avatar, "TANGENT dropped"));
    }
    let error = replaced("WEIGHTS_0", "VEC4", -0.5).unwrap_err();
    assert!(
        error.to_string().contains("WEIGHTS_0 of vertex 1 is -0.5"),
        "{error}"
    );
    assert!(notice(
        &replaced("WEIGHTS_0", "VEC4", -1e-6).unwrap(),
        "just below zero"
    ));

    let transform =
        |key: &str, value: Value| error_after(|file| file.root["nodes"][1][key] = value);
    assert!(
        transform("rotation", json!([0, 0, 0, 0]))
            .to_string()
            .contains("length of a rotation")
    );
    assert!(
        transform("translation", json!([1e300, 0, 0]))
            .to_string()
            .contains("not finite")
    );
    assert!(is_at(&transform("scale", json!([1, 1])), "nodes[1]"));
    let counts = error_after(|file| {
        let two = file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        file.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(two);
    });
    assert!(
        counts
            .to_string()
            .contains("3 elements in POSITION, 2 in NORMAL"),
        "{counts}"
    );
}

#[test]
fn hierarchies_must_be_trees() {
    let children = |lists: &[&[usize]]| {
        let mut file = one_triangle(|_| json!({}));
        file.root.insert("nodes".into(), json!([]));
        for list in lists {
            file.push("nodes", json!({ "mesh": 0, "name": "n", "children": list }));
        }
        file.read()
    };
    assert!(children(&[&[1, 2], &[], &[]]).is_ok());
    for lists in [&[&[0][..]][..], &[&[1], &[0]], &[&[], &[2], &[3], &[1]]] {
        let error = children(lists).unwrap_err();
        assert!(
            matches!(error.kind, ImportErrorKind::Cycle { .. }),
            "{error}"
        );
    }
    for lists in [&[&[2][..], &[2], &[]][..], &[&[1, 1], &[]]] {
        let error = children(lists).unwrap_err();
        assert!(
            matches!(error.kind, ImportErrorKind::Contradiction { .. }),
            "{error}"
        );
    }
}

#[test]
fn a_deep_hierarchy_needs_no_stack() {
    let mut file = one_triangle(|_| json!({}));
    let depth = 100_000;
    let link = |i: usize| {
        if i == 0 {
            json!({ "mesh": 0 })
        } else {
            json!({ "children": [i - 1] })
        }
    };
    file.root
        .insert("nodes".into(), (0..depth).map(link).collect());
    file.root
        .insert("scenes".into(), json!([{ "nodes": [depth - 1] }]));
    file.root.insert("scene".into(), json!(0));
    assert_eq!(file.read().unwrap().skeleton.joints.len(), depth);
}
