//! glTF 2.0, as text (`.gltf`) and binary (`.glb`).
//!
//! Bytes and the folder of the file enter; one [`RawAvatar`] leaves. The stages:
//!
//! | module | does |
//! | --- | --- |
//! | `container` | splits GLB chunks from JSON text |
//! | `document` | JSON into typed items; refuses extensions that change the geometry |
//! | `buffer` | data URIs and external files into bytes |
//! | `accessor` | bytes into numbers, every range checked first |
//! | `hierarchy` | parents, local transforms, the default scene |
//! | `skin` | skins and rigid meshes into binds |
//! | `mesh`, `primitive`, `morph` | primitives and morph targets into one mesh |
//! | `animation`, `weights` | channels into clips |
//!
//! The `gltf` crate supplies the JSON types only. Its own readers trust the file: a GLB length
//! below 12, an accessor without elements or a sparse index too many make them panic.
//!
//! Source: Khronos Group, *glTF 2.0 Specification* (ISO/IEC 12113:2022).

mod accessor;
mod animation;
mod buffer;
mod container;
mod document;
mod hierarchy;
mod mesh;
mod morph;
mod primitive;
mod skin;
mod weights;

#[cfg(test)]
mod tests;

use std::path::Path;

use self::accessor::Reader;
use self::document::Document;
use self::hierarchy::Hierarchy;
use super::{ImportError, ImportErrorKind, Place, RawAvatar, RawSkeleton, RawSkin};

/// Reads a glTF 2.0 file into one mesh, skeleton and skin, and its clips.
///
/// `file` names the file in errors and stands in for missing names; `folder` is where external
/// buffers lie. Meshes of the default scene (of all nodes, where none is named) follow each other
/// in node order. A skinned mesh keeps its bind space and ignores its node's transform, as the
/// specification asks; any other mesh keeps its node's space and hangs on that node with weight 1
/// and an identity inverse bind matrix. Joints are the joints of used skins, the nodes of rigid
/// meshes, and all their ancestors, in node order. A file without meshes gives its skeletons and
/// clips alone.
///
/// Metres, seconds, Y up, as in the file. Time and memory are linear in the file's size, up to
/// a factor that [`ImportErrorKind::TooMany`] reports when a file goes beyond it.
///
/// # Errors
///
/// An [`ImportError`] whose place is a byte of the container, a line of the JSON text or an item
/// such as `accessors[3]`.
pub fn read_gltf(bytes: &[u8], file: &str, folder: &Path) -> Result<RawAvatar, ImportError> {
    read(bytes, file, folder).map_err(|error| ImportError {
        file: file.to_owned(),
        ..error
    })
}

fn read(bytes: &[u8], file: &str, folder: &Path) -> Result<RawAvatar, ImportError> {
    let mut notices = Vec::new();
    let container = container::split(bytes, &mut notices)?;
    let document = Document::parse(&container, &mut notices)?;
    let stem = Path::new(file)
        .file_stem()
        .map_or(file.into(), |stem| stem.to_string_lossy());

    let mut reader = Reader::new(&document, container.bin, folder, bytes.len(), notices);
    let hierarchy = Hierarchy::read(&mut reader)?;
    let instances = mesh::instances(&mut reader, &hierarchy)?;
    let binds = skin::Binds::read(&mut reader, &instances)?;
    let surface = mesh::read(&mut reader, &instances, &binds, &stem)?;

    let mut used = vec![false; document.nodes.len()];
    if instances.is_empty() {
        skin::mark_joints(&document, &mut used)?;
        animation::mark_targets(&document, &mut used)?;
        if !used.contains(&true) {
            let what = "a mesh, a skin or an animation".into();
            return Err(fault(ImportErrorKind::Missing { what }, Place::File));
        }
    }
    for &node in &binds.nodes {
        used[node] = true;
    }
    let (joints, joint_of_node) = hierarchy.joints(&document, used);
    let clips = animation::read(&mut reader, &joint_of_node, &surface.morphs, &stem)?;

    let joint_of = |&node: &usize| {
        joint_of_node[node]
            .expect("every bind's node was marked as used before the joints were made")
    };
    Ok(RawAvatar {
        mesh: surface.mesh,
        skeleton: RawSkeleton { joints },
        skin: RawSkin {
            joints: binds.nodes.iter().map(joint_of).collect(),
            inverse_bind: binds.inverse,
            influences: surface.influences,
        },
        clips,
        notices: reader.notices,
    })
}

/// An error whose file [`read_gltf`] fills in.
fn fault(kind: ImportErrorKind, place: Place) -> ImportError {
    kind.at("", place)
}

/// The same at an item such as `nodes[3]`.
fn item_fault(kind: ImportErrorKind, item: impl Into<String>) -> ImportError {
    fault(kind, Place::Item(item.into()))
}

/// A checked reference into one of the document's lists.
fn checked<T>(list: &[T], index: usize, what: &str, item: &str) -> Result<usize, ImportError> {
    if index < list.len() {
        return Ok(index);
    }
    let kind = ImportErrorKind::BadIndex {
        what: what.into(),
        index: index as i64,
        count: list.len() as u64,
    };
    Err(item_fault(kind, item))
}
