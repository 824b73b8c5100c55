//! JSON text into typed items, and the check of what a reader must understand.
//!
//! Each item is converted alone, so that an error names it, and so that oddities of parts that do
//! not move the surface (materials, images, cameras) cannot stop the import.

use gltf::json::accessor::Accessor;
use gltf::json::animation::Animation;
use gltf::json::buffer::{Buffer, View};
use gltf::json::mesh::Mesh;
use gltf::json::scene::Node;
use gltf::json::skin::Skin;
use serde_json::{Map, Value};

use super::container::Container;
use super::{checked, fault, item_fault};
use crate::import::{ImportError, ImportErrorKind, Notice, Place};

/// Required extensions that change how the surface looks but not where it is.
const HARMLESS_PREFIXES: [&str; 5] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "EXT_texture_",
    "MSFT_texture_",
];

/// Required extensions that the accessor reader handles.
const READ: [&str; 1] = ["KHR_mesh_quantization"];

/// Keys below which an integer above 2^32 is no index: sizes and free numbers.
const NOT_INDICES: [&str; 13] = [
    "byteLength",
    "byteOffset",
    "byteStride",
    "count",
    "min",
    "max",
    "matrix",
    "translation",
    "rotation",
    "scale",
    "weights",
    "extras",
    "extensions",
];

/// The parts of a glTF file that say where its surface is and how it moves.
pub(super) struct Document {
    pub accessors: Vec<Accessor>,
    pub views: Vec<View>,
    pub buffers: Vec<Buffer>,
    pub nodes: Vec<Node>,
    pub meshes: Vec<Mesh>,
    pub skins: Vec<Skin>,
    pub animations: Vec<Animation>,
    /// Root nodes of the default scene; `None` where the file names no default.
    pub scene: Option<Vec<usize>>,
}

impl Document {
    pub fn parse(
        container: &Container<'_>,
        notices: &mut Vec<Notice>,
    ) -> Result<Self, ImportError> {
        let root = serde_json::from_slice(container.json)
            .map_err(|error| json_fault(&error, container))?;
        let Value::Object(mut root) = root else {
            let kind = wrong_type("the JSON text", &root, "an object");
            return Err(fault(kind, Place::File));
        };
        check_version(&root)?;
        check_extensions(&root)?;

        drop_targetless_channels(&mut root, notices);
        let nodes: Vec<Node> = items(&mut root, "nodes", serde_json::from_value)?;
        let scene = default_scene(&root, &nodes)?;
        Ok(Self {
            accessors: items(&mut root, "accessors", serde_json::from_value)?,
            views: items(&mut root, "bufferViews", serde_json::from_value)?,
            buffers: items(&mut root, "buffers", serde_json::from_value)?,
            nodes,
            meshes: items(&mut root, "meshes", serde_json::from_value)?,
            skins: items(&mut root, "skins", serde_json::from_value)?,
            animations: items(&mut root, "animations", serde_json::from_value)?,
            scene,
        })
    }
}

/// Converts the list `key` of the root; an absent list is empty.
fn items<T>(
    root: &mut Map<String, Value>,
    key: &str,
    convert: impl Fn(Value) -> Result<T, serde_json::Error>,
) -> Result<Vec<T>, ImportError> {
    let list = match root.remove(key) {
        None => return Ok(Vec::new()),
        Some(Value::Array(list)) => list,
        Some(other) => return Err(item_fault(wrong_type(key, &other, "an array"), key)),
    };
    let convert_one = |(i, value): (usize, Value)| {
        let item = format!("{key}[{i}]");
        if let Some((field, index)) = oversized_index(key, &value) {
            let kind = ImportErrorKind::OutOfRange {
                what: field.into(),
                value: index.to_string(),
                expected: "below 2^32".into(),
            };
            return Err(item_fault(kind, item));
        }
        convert(value).map_err(|error| {
            let kind = ImportErrorKind::NotThisFormat {
                expected: "valid glTF 2.0",
                found: error.to_string(),
            };
            item_fault(kind, item)
        })
    };
    list.into_iter().enumerate().map(convert_one).collect()
}

/// The first integer that the item types would wrap to 32 bits, with its key.
///
/// Recursion is bounded: the JSON parser stops at 128 levels.
fn oversized_index<'v>(key: &'v str, value: &'v Value) -> Option<(&'v str, u64)> {
    match value {
        Value::Number(number) => number
            .as_u64()
            .filter(|&n| n > u32::MAX.into())
            .map(|n| (key, n)),
        Value::Array(list) => list.iter().find_map(|v| oversized_index(key, v)),
        Value::Object(map) => map
            .iter()
            .filter(|(key, _)| !NOT_INDICES.contains(&key.as_str()))
            .find_map(|(key, v)| oversized_index(key, v)),
        _ => None,
    }
}

/// Removes channels without a target node, which the specification says to ignore (extensions
/// animate other properties through them) and the item types demand.
fn drop_targetless_channels(root: &mut Map<String, Value>, notices: &mut Vec<Notice>) {
    let animations = root.get_mut("animations").and_then(Value::as_array_mut);
    for (i, animation) in animations.into_iter().flatten().enumerate() {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else {
            continue;
        };
        let before = channels.len();
        channels.retain(|channel| {
            let target = channel.get("target").and_then(Value::as_object);
            target.is_none_or(|target| target.contains_key("node"))
        });
        let dropped = before - channels.len();
        if dropped > 0 {
            let text = format!("{dropped} channels that target no node left out");
            notices.push(Notice::new(Place::Item(format!("animations[{i}]")), text));
        }
    }
}

fn check_version(root: &Map<String, Value>) -> Result<(), ImportError> {
    let asset = root.get("asset").and_then(Value::as_object);
    let field = |name| asset.and_then(|a| a.get(name)).and_then(Value::as_str);
    let Some(version) = field("version") else {
        let what = "asset.version".into();
        return Err(fault(ImportErrorKind::Missing { what }, Place::File));
    };
    // A file of a later 2.x is readable unless it says that 2.0 does not suffice.
    let needed = field("minVersion").unwrap_or(version);
    let readable = match field("minVersion") {
        Some(min) => min == "2.0",
        None => version.starts_with("2."),
    };
    if readable {
        return Ok(());
    }
    let what = format!("glTF version {needed:?}");
    Err(item_fault(ImportErrorKind::Unsupported { what }, "asset"))
}

fn check_extensions(root: &Map<String, Value>) -> Result<(), ImportError> {
    let required = root.get("extensionsRequired").and_then(Value::as_array);
    for (i, name) in required.into_iter().flatten().enumerate() {
        let name = name.as_str().unwrap_or_default();
        let harmless = HARMLESS_PREFIXES.iter().any(|p| name.starts_with(p));
        if harmless || READ.contains(&name) {
            continue;
        }
        let what = match name {
            "KHR_draco_mesh_compression" => "Draco compression (KHR_draco_mesh_compression)".into(),
            "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
                format!("meshopt compression ({name})")
            }
            _ => format!("the required extension {name:?}"),
        };
        let kind = ImportErrorKind::Unsupported { what };
        return Err(item_fault(kind, format!("extensionsRequired[{i}]")));
    }
    Ok(())
}

fn default_scene(
    root: &Map<String, Value>,
    nodes: &[Node],
) -> Result<Option<Vec<usize>>, ImportError> {
    let Some(index) = root.get("scene") else {
        return Ok(None);
    };
    let Some(index) = as_index(index) else {
        return Err(item_fault(wrong_type("scene", index, "an index"), "scene"));
    };
    let scenes = root.get("scenes").and_then(Value::as_array);
    let scenes = scenes.map_or(&[][..], Vec::as_slice);
    let scene = &scenes[checked(scenes, index, "scene", "scene")?];
    let list = scene.get("nodes").and_then(Value::as_array);
    let read = |(i, value): (usize, &Value)| {
        let item = format!("scenes[{index}].nodes[{i}]");
        match as_index(value) {
            Some(node) => checked(nodes, node, "node", &item),
            None => Err(item_fault(wrong_type("node", value, "an index"), item)),
        }
    };
    let list = list.into_iter().flatten().enumerate().map(read);
    list.collect::<Result<_, _>>().map(Some)
}

fn as_index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|index| index.try_into().ok())
}

fn wrong_type(what: &str, found: &Value, expected: &str) -> ImportErrorKind {
    let value = match found {
        Value::Null => "null",
        Value::Bool(_) => "a truth value",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    };
    ImportErrorKind::OutOfRange {
        what: what.into(),
        value: value.into(),
        expected: expected.into(),
    }
}

fn json_fault(error: &serde_json::Error, container: &Container<'_>) -> ImportError {
    let place = match container.json_offset {
        None => Place::Line(error.line()),
        Some(start) => {
            let lines = container.json.split_inclusive(|&byte| byte == b'\n');
            let before: usize = lines
                .take(error.line().saturating_sub(1))
                .map(<[u8]>::len)
                .sum();
            Place::Byte(start + (before + error.column()) as u64)
        }
    };
    let kind = if error.is_eof() {
        ImportErrorKind::Unclosed {
            what: "a bracket or string of the JSON text".into(),
        }
    } else {
        ImportErrorKind::NotThisFormat {
            expected: "glTF 2.0 JSON",
            found: error.to_string(),
        }
    };
    fault(kind, place)
}
