//! Files are built here byte by byte, so that every expected number can be seen in its test.

mod geometry;
mod hostile;
mod motion;

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bytemuck::NoUninit;
use serde_json::{Map, Value, json};

use super::read_gltf;
use crate::import::{ImportError, RawAvatar};

const I8: u32 = 5120;
const U8: u32 = 5121;
const I16: u32 = 5122;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// A glTF file under construction.
#[derive(Clone, Default)]
struct File {
    root: Map<String, Value>,
    bin: Vec<u8>,
}

impl File {
    /// Appends to a list of the root and returns the index.
    fn push(&mut self, list: &str, item: Value) -> usize {
        let list = self.root.entry(list).or_insert_with(|| json!([]));
        let list = list.as_array_mut().expect("lists are arrays");
        list.push(item);
        list.len() - 1
    }

    /// Appends bytes as a buffer view.
    fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() });
        self.push("bufferViews", view)
    }

    /// Appends numbers as an accessor.
    fn accessor<T: NoUninit>(&mut self, shape: &str, component: u32, numbers: &[T]) -> usize {
        let width = match shape {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let view = self.view(bytemuck::cast_slice(numbers));
        self.push(
            "accessors",
            json!({
                "bufferView": view, "componentType": component,
                "count": numbers.len() / width, "type": shape,
            }),
        )
    }

    /// The same with `normalized` set.
    fn fractions<T: NoUninit>(&mut self, shape: &str, component: u32, numbers: &[T]) -> usize {
        let index = self.accessor(shape, component, numbers);
        self.root["accessors"][index]["normalized"] = json!(true);
        index
    }

    fn floats(&mut self, shape: &str, numbers: &[f32]) -> usize {
        self.accessor(shape, F32, numbers)
    }

    /// The corners of the triangle (0,0,0), (1,0,0), (0,1,0).
    fn triangle(&mut self) -> usize {
        self.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    }

    /// Changes one value, found by a JSON pointer.
    fn set(&mut self, pointer: &str, value: Value) {
        let mut root = Value::Object(std::mem::take(&mut self.root));
        *root.pointer_mut(pointer).expect("the value is there") = value;
        let Value::Object(root) = root else { return };
        self.root = root;
    }

    fn json(&self, buffer: Value) -> String {
        let mut root = self.root.clone();
        root.entry("asset").or_insert(json!({ "version": "2.0" }));
        if !self.bin.is_empty() {
            root.entry("buffers").or_insert(json!([buffer]));
        }
        Value::Object(root).to_string()
    }

    fn glb(&self) -> Vec<u8> {
        let mut json = self
            .json(json!({ "byteLength": self.bin.len() }))
            .into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        for (kind, data) in [(b"JSON", &json), (b"BIN\0", &self.bin)] {
            bytes.extend((data.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(data);
        }
        let length = (bytes.len() as u32).to_le_bytes();
        bytes[8..12].copy_from_slice(&length);
        bytes
    }

    fn text(&self) -> String {
        let data = STANDARD.encode(&self.bin);
        let uri = format!("data:application/octet-stream;base64,{data}");
        self.json(json!({ "byteLength": self.bin.len(), "uri": uri }))
    }

    fn read(&self) -> Result<RawAvatar, ImportError> {
        read_bytes(&self.glb())
    }
}

fn read_bytes(bytes: &[u8]) -> Result<RawAvatar, ImportError> {
    read_gltf(bytes, "dir/body.glb", Path::new("no/such/folder"))
}

/// One triangle on one node, drawn with the given attributes beside its positions.
fn one_triangle(attributes: impl FnOnce(&mut File) -> Value) -> File {
    let mut file = File::default();
    let positions = file.triangle();
    let mut attributes = attributes(&mut file);
    attributes["POSITION"] = json!(positions);
    file.push(
        "meshes",
        json!({ "primitives": [{ "attributes": attributes }] }),
    );
    file.push("nodes", json!({ "mesh": 0 }));
    file
}

/// A triangle skinned to two joints: node 0 carries it, nodes 1 and 2 are its joints, 3 their
/// parent.
fn skinned() -> File {
    let mut file = one_triangle(|file| {
        let joints = file.accessor("VEC4", U8, &[0_u8, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
        let weights = [0.25, 0.75, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let weights = file.floats("VEC4", &weights);
        json!({ "JOINTS_0": joints, "WEIGHTS_0": weights })
    });
    file.push("nodes", json!({ "name": "hip", "translation": [0, 1, 0] }));
    file.push("nodes", json!({ "name": "knee", "translation": [0, 2, 0] }));
    file.push("nodes", json!({ "name": "root", "children": [1, 2] }));
    file.push("skins", json!({ "joints": [1, 2] }));
    file.root["nodes"][0]["skin"] = json!(0);
    file
}

fn notice(avatar: &RawAvatar, part: &str) -> bool {
    avatar
        .notices
        .iter()
        .any(|notice| notice.text.contains(part))
}
