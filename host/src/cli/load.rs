//! Opens any file that the command line names, by its ending.

use std::error::Error;
use std::path::Path;

use super::Failure;
use crate::bake::AssetBytes;
use crate::import::gltf::read_gltf;
use crate::import::{
    BvhOptions, ImportError, ImportErrorKind, Notice, Place, read_bvh_with, read_obj,
};
use crate::model::{Avatar, Mesh, Motion};

/// A file's contents, checked.
pub(crate) enum Loaded {
    Avatar(Box<Avatar>),
    Motion(Box<Motion>),
    Mesh(Box<Mesh>),
    Asset(AssetBytes),
}

/// How to read what a file does not say.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reading {
    /// Metres in the file's unit of length.
    pub unit: Option<f64>,
    /// Whether Z is up instead of Y.
    pub z_up: bool,
}

/// What is read, by name ending.
const READABLE: &str = ".glb, .gltf, .obj, .bvh or .sinew";

/// Reads a file of any kind.
pub(crate) fn any(path: &Path, reading: Reading) -> Result<(Loaded, Vec<Notice>), Failure> {
    let name = path.display().to_string();
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let folder = path.parent().unwrap_or(Path::new(""));
    Ok(match ending.as_str() {
        "glb" | "gltf" => {
            let raw = read_gltf(&read(path)?, &name, folder)?;
            let (avatar, notices) = Avatar::new(raw, &name)?;
            (Loaded::Avatar(Box::new(avatar)), notices)
        }
        "bvh" => {
            let options = BvhOptions {
                unit_metres: reading.unit,
                z_up: reading.z_up,
                ..BvhOptions::default()
            };
            let raw = read_bvh_with(&read(path)?, &name, &options)?;
            let (motion, notices) = Motion::new(raw, &name)?;
            (Loaded::Motion(Box::new(motion)), notices)
        }
        "obj" => {
            let (raw, mut notices) = read_obj(&read(path)?, &name, reading.unit.unwrap_or(1.0))?;
            let (mesh, more) = Mesh::new(raw, &name)?;
            notices.extend(more);
            (Loaded::Mesh(Box::new(mesh)), notices)
        }
        "sinew" => (Loaded::Asset(asset(path)?), Vec::new()),
        _ => {
            let text = format!("{name}: files of this name ending are not read; give {READABLE}");
            return Err(Failure::Usage(text));
        }
    })
}

/// Reads a body with its skin.
pub(crate) fn avatar(path: &Path) -> Result<(Avatar, Vec<Notice>), Failure> {
    match any(path, Reading::default())? {
        (Loaded::Avatar(avatar), notices) => Ok((*avatar, notices)),
        _ => Err(Failure::Usage(format!(
            "{}: a body with skin weights is needed; give a .glb or .gltf",
            path.display()
        ))),
    }
}

/// Reads a captured motion.
pub(crate) fn motion(path: &Path, reading: Reading) -> Result<(Motion, Vec<Notice>), Failure> {
    match any(path, reading)? {
        (Loaded::Motion(motion), notices) => Ok((*motion, notices)),
        _ => Err(Failure::Usage(format!(
            "{}: a captured motion is needed; give a .bvh",
            path.display()
        ))),
    }
}

/// Reads an asset's bytes; whether they are sound is for the caller to ask.
pub(crate) fn asset(path: &Path) -> Result<AssetBytes, Failure> {
    Ok(AssetBytes::new(&read(path)?))
}

/// A fault of `path` that its own error does not name.
pub(crate) fn fault(path: &Path, error: &dyn Error) -> Failure {
    Failure::Data(format!("{}: {error}", path.display()))
}

fn read(path: &Path) -> Result<Vec<u8>, ImportError> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path)
        .map_err(|error| ImportErrorKind::Io(error.to_string()).at(&name, Place::File))?;
    if bytes.is_empty() {
        return Err(ImportErrorKind::Empty.at(&name, Place::File));
    }
    Ok(bytes)
}
