//! Opens any file that the command line names, by its ending.

use std::error::Error;
use std::path::Path;

use clap::{Args, ValueEnum};
use glam::DVec3;

use super::Failure;
use crate::bake::AssetBytes;
use crate::import::gltf::read_gltf;
use crate::import::take::{LengthUnit, TakeOptions, UpAxis, read_take};
use crate::import::{
    BvhOptions, ImportError, ImportErrorKind, Notice, Place, read_bvh_with, read_obj, read_ply,
    read_ply_points,
};
use crate::model::{Avatar, Mesh, Motion};
use crate::take::Take;

/// A file's contents, checked.
pub(crate) enum Loaded {
    Avatar(Box<Avatar>),
    Motion(Box<Motion>),
    Mesh(Box<Mesh>),
    Take(Box<Take>),
    Asset(AssetBytes),
}

/// How to read what a file does not say, or says wrongly.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct Reading {
    /// Unit of length of a motion, mesh or marker file: mm, cm, dm, m, in, ft, or metres in it.
    #[arg(long, value_parser = parse_unit)]
    unit: Option<Unit>,
    /// The axis that points up in a motion or marker file.
    #[arg(long, value_enum)]
    up: Option<Up>,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Unit {
    Named(LengthUnit),
    Metres(f64),
}

impl Unit {
    fn metres(self) -> f64 {
        match self {
            Self::Named(unit) => unit.metres(),
            Self::Metres(metres) => metres,
        }
    }
}

/// SOURCE=TARGET of `--map`.
pub(crate) fn pair(text: &str) -> Result<(String, String), String> {
    let pair = text.split_once('=');
    pair.map(|(source, target)| (source.to_owned(), target.to_owned()))
        .ok_or_else(|| "give SOURCE=TARGET".to_owned())
}

fn parse_unit(text: &str) -> Result<Unit, String> {
    let named = LengthUnit::parse(text).map(Unit::Named);
    let metres = text
        .parse()
        .ok()
        .filter(|&metres: &f64| metres.is_finite() && metres > 0.0);
    named
        .or(metres.map(Unit::Metres))
        .ok_or_else(|| "give mm, cm, dm, m, in, ft, or a positive number of metres".to_owned())
}

/// An axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Up {
    Y,
    Z,
}

/// What is read, by name ending.
const READABLE: &str = ".glb, .gltf, .obj, .ply, .bvh, .c3d, .trc, .csv or .sinew";

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
                unit_metres: reading.unit.map(Unit::metres),
                z_up: reading.up == Some(Up::Z),
                ..BvhOptions::default()
            };
            let raw = read_bvh_with(&read(path)?, &name, &options)?;
            let (motion, notices) = Motion::new(raw, &name)?;
            (Loaded::Motion(Box::new(motion)), notices)
        }
        "obj" | "ply" => {
            let parse = if ending == "ply" { read_ply } else { read_obj };
            let unit = reading.unit.map_or(1.0, Unit::metres);
            let (raw, mut notices) = parse(&read(path)?, &name, unit)?;
            let (mesh, more) = Mesh::new(raw, &name)?;
            notices.extend(more);
            (Loaded::Mesh(Box::new(mesh)), notices)
        }
        "c3d" | "trc" | "csv" => {
            let (take, notices) = take(path, reading)?;
            (Loaded::Take(Box::new(take)), notices)
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

/// Reads a frame of a moving mesh or point cloud: positions in metres, and triangles if any.
pub(crate) fn frame(path: &Path, reading: Reading) -> Result<(Vec<DVec3>, Vec<[u32; 3]>), Failure> {
    match any(path, reading) {
        Ok((Loaded::Mesh(mesh), _)) => Ok((mesh.positions, mesh.triangles)),
        Err(_) if path.extension().is_some_and(|ending| ending == "ply") => {
            let unit = reading.unit.map_or(1.0, Unit::metres);
            let points = read_ply_points(&read(path)?, &path.display().to_string(), unit)?;
            Ok((points, Vec::new()))
        }
        Err(failure) => Err(failure),
        Ok(_) => Err(Failure::Usage(format!(
            "{}: a mesh or point cloud is needed; give a .ply or .obj",
            path.display()
        ))),
    }
}

/// Reads a marker capture.
pub(crate) fn take(path: &Path, reading: Reading) -> Result<(Take, Vec<Notice>), Failure> {
    let unit = reading.unit.map(|unit| match unit {
        Unit::Named(unit) => Ok(unit),
        Unit::Metres(metres) => Err(Failure::Usage(format!(
            "--unit {metres}: marker files need a name: mm, cm, dm, m, in or ft"
        ))),
    });
    let options = TakeOptions {
        unit: unit.transpose()?,
        up: reading.up.map(|up| match up {
            Up::Y => UpAxis::PlusY,
            Up::Z => UpAxis::PlusZ,
        }),
        ..TakeOptions::default()
    };
    let raw = read_take(path, &options)?;
    let (take, more) = Take::from_raw(&raw).map_err(|error| fault(path, &error))?;
    Ok((take, [raw.notices, more].concat()))
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
