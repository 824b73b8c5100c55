//! The head of a Motive export: which column holds what.

use glam::{DQuat, DVec3};

use crate::import::table::{csv_fields, lines};
use crate::import::take::RawRigidBody;
use crate::import::{ImportError, ImportErrorKind, Notice, Place};

/// Lines in which the head must end.
const HEAD_LINES: usize = 20;

/// Everything above the first frame.
pub(super) struct Head<'a> {
    settings: Vec<&'a str>,
    /// `Rigid Body`, `Marker` and the like, one a column.
    types: Vec<&'a str>,
    names: Vec<&'a str>,
    ids: Vec<&'a str>,
    /// `Rotation`, `Position`, `Marker Quality` and the like.
    quantities: Vec<&'a str>,
    axes: Vec<&'a str>,
    /// One-based line of `axes`.
    pub axes_line: usize,
}

impl<'a> Head<'a> {
    pub(super) fn read(text: &'a str, file: &str) -> Result<Self, ImportError> {
        let rows: Vec<(usize, Vec<&str>)> = lines(text)
            .take(HEAD_LINES)
            .filter(|(_, line)| !line.trim().is_empty())
            .map(|(number, line)| (number, csv_fields(line)))
            .collect();
        let settings = rows
            .first()
            .map(|(_, fields)| fields.clone())
            .unwrap_or_default();
        if !settings
            .first()
            .is_some_and(|first| first.eq_ignore_ascii_case("Format Version"))
        {
            let found: String = text.chars().take(20).collect();
            let kind = ImportErrorKind::NotThisFormat {
                expected: "a Motive CSV export with its header (first cell: Format Version)",
                found: format!("it begins with {found:?}"),
            };
            return Err(kind.at(file, Place::Line(1)));
        }
        let version = settings.get(1).copied().unwrap_or("");
        if !version.starts_with("1.") {
            let what =
                format!("version {version:?} of the Motive CSV format (known: 1.1 and 1.2x)");
            return Err(ImportErrorKind::Unsupported { what }.at(file, Place::Line(1)));
        }
        let is_axes = |fields: &[&str]| {
            fields
                .first()
                .is_some_and(|first| first.eq_ignore_ascii_case("Frame"))
                && fields
                    .get(1)
                    .is_some_and(|second| second.to_ascii_lowercase().starts_with("time"))
        };
        let Some(axes) = rows.iter().position(|(_, fields)| is_axes(fields)) else {
            let last = rows.last().map_or(1, |(number, _)| *number);
            let what = "the row of axes (Frame, Time, X, Y, Z, ...)".into();
            return Err(ImportErrorKind::Missing { what }.at(file, Place::Line(last)));
        };
        let above = &rows[1.min(axes)..axes];
        let names_type = |field: &&str| {
            [
                "Rigid Body",
                "Rigid Body Marker",
                "Marker",
                "Bone",
                "Bone Marker",
            ]
            .contains(field)
        };
        let types = above
            .iter()
            .position(|(_, fields)| fields.iter().any(names_type));
        let row = |index: Option<usize>| {
            let last = above.len().saturating_sub(1);
            index
                .filter(|index| *index < last)
                .map(|index| above[index].1.clone())
                .unwrap_or_default()
        };
        Ok(Self {
            settings,
            types: row(types),
            names: row(types.map_or(Some(0), |types| Some(types + 1))),
            ids: row(types.map(|types| types + 2)),
            quantities: above
                .last()
                .map(|(_, fields)| fields.clone())
                .unwrap_or_default(),
            axes: rows[axes].1.clone(),
            axes_line: rows[axes].0,
        })
    }

    /// The value behind `key` in the first line.
    pub(super) fn setting(&self, key: &str) -> Option<&'a str> {
        let at = self
            .settings
            .iter()
            .position(|field| field.eq_ignore_ascii_case(key))?;
        self.settings.get(at + 1).copied()
    }

    /// Points and bodies in the order of their columns.
    pub(super) fn columns(
        &self,
        file: &str,
        notices: &mut Vec<Notice>,
    ) -> Result<(Vec<Point>, Vec<Body>), ImportError> {
        let field = |row: &[&'a str], column: usize| row.get(column).copied().unwrap_or("");
        let key = |column| {
            (
                field(&self.types, column),
                field(&self.names, column),
                field(&self.ids, column),
            )
        };
        let place = Place::Line(self.axes_line);
        let local = self
            .setting("Coordinate Space")
            .is_some_and(|space| space.eq_ignore_ascii_case("Local"));
        let (mut points, mut bodies) = (Vec::new(), Vec::new());
        let mut dropped_bones = 0;
        let mut column = 2;
        while column < self.axes.len() {
            let (kind, name, _) = key(column);
            let end = (column..self.axes.len())
                .find(|other| key(*other) != key(column))
                .unwrap_or(self.axes.len());
            let find = |quantity: &str, axis: &str| {
                (column..end).find(|column| {
                    let stated = field(&self.quantities, *column);
                    let same = stated.eq_ignore_ascii_case(quantity)
                        || (stated.is_empty() && quantity == "Position");
                    same && field(&self.axes, *column).eq_ignore_ascii_case(axis)
                })
            };
            let three = |quantity| {
                Some([
                    find(quantity, "X")?,
                    find(quantity, "Y")?,
                    find(quantity, "Z")?,
                ])
            };
            let position = three("Position");
            let is_bone = kind.eq_ignore_ascii_case("Bone");
            if is_bone || kind.eq_ignore_ascii_case("Rigid Body") {
                if is_bone && local {
                    dropped_bones += 1;
                } else if let Some(position) = position {
                    let rotation = match (three("Rotation"), find("Rotation", "W")) {
                        (Some([x, y, z]), Some(w)) => Rotation::Quaternion([x, y, z, w]),
                        (Some(angles), None) => Rotation::Euler(self.euler_order(file)?, angles),
                        _ => Rotation::None,
                    };
                    let error = (column..end)
                        .find(|column| field(&self.quantities, *column).contains("Error"));
                    bodies.push(Body {
                        name: name.into(),
                        position,
                        rotation,
                        error,
                        poses: Vec::new(),
                        errors: Vec::new(),
                    });
                }
            } else if let Some(position) = position {
                let expected = kind.contains("Body Marker") || kind.contains("Bone Marker");
                points.push(Point {
                    name: name.into(),
                    position,
                    expected,
                });
            }
            column = end;
        }
        if points.is_empty() && bodies.is_empty() {
            let what = "a column of marker positions".into();
            return Err(ImportErrorKind::Missing { what }.at(file, place));
        }
        if points.is_empty() {
            notices.push(Notice::new(place.clone(), "the file holds no markers"));
        }
        if dropped_bones > 0 {
            let text =
                format!("{dropped_bones} bones are stated relative to their parents: left out");
            notices.push(Notice::new(place, text));
        }
        for (number, point) in points.iter_mut().enumerate() {
            if point.name.is_empty() {
                point.name = format!("*{}", number + 1);
            }
        }
        Ok((points, bodies))
    }

    /// Order of the Euler angles, each about an axis that the earlier ones have turned.
    fn euler_order(&self, file: &str) -> Result<[usize; 3], ImportError> {
        let order = self.setting("Rotation Type").unwrap_or("");
        Ok(match order.to_ascii_uppercase().as_str() {
            "XYZ" => [0, 1, 2],
            "XZY" => [0, 2, 1],
            "YXZ" => [1, 0, 2],
            "YZX" => [1, 2, 0],
            "ZXY" => [2, 0, 1],
            "ZYX" => [2, 1, 0],
            _ => {
                let what = format!("rotation type {order:?}");
                return Err(ImportErrorKind::Unsupported { what }.at(file, Place::Line(1)));
            }
        })
    }
}

/// A marker's columns.
pub(super) struct Point {
    pub name: String,
    pub position: [usize; 3],
    /// Where the body expects the marker, not where it was seen.
    pub expected: bool,
}

/// Columns of a rotation.
pub(super) enum Rotation {
    None,
    /// X, Y, Z, W.
    Quaternion([usize; 4]),
    /// Order of the axes; columns of X, Y, Z in degrees.
    Euler([usize; 3], [usize; 3]),
}

/// A rigid body's columns and what they held so far.
pub(super) struct Body {
    pub name: String,
    position: [usize; 3],
    rotation: Rotation,
    pub error: Option<usize>,
    pub poses: Vec<Option<(DQuat, DVec3)>>,
    pub errors: Vec<f64>,
}

impl Body {
    /// The pose of one row, `None` where a cell is blank.
    pub(super) fn pose(
        &self,
        value: impl Fn(usize) -> Result<f64, ImportError>,
    ) -> Result<Option<(DQuat, DVec3)>, ImportError> {
        let three = |[x, y, z]: [usize; 3]| Ok(DVec3::new(value(x)?, value(y)?, value(z)?));
        let position = three(self.position)?;
        let rotation = match self.rotation {
            Rotation::None => Some(DQuat::IDENTITY),
            Rotation::Quaternion([x, y, z, w]) => {
                let rotation = DQuat::from_xyzw(value(x)?, value(y)?, value(z)?, value(w)?);
                // A zero quaternion is how an untracked body is sometimes written.
                (rotation.length_squared() > 1e-6).then(|| rotation.normalize())
            }
            Rotation::Euler(order, columns) => {
                let angles = three(columns)?;
                let about = |axis: usize| {
                    DQuat::from_axis_angle(DVec3::AXES[axis], angles[axis].to_radians())
                };
                Some(about(order[0]) * about(order[1]) * about(order[2]))
            }
        };
        Ok(rotation
            .filter(|rotation| rotation.is_finite() && position.is_finite())
            .map(|rotation| (rotation, position)))
    }

    /// Puts row values at their frames.
    pub(super) fn spread(self, frames: &[usize], frame_count: usize) -> RawRigidBody {
        let mut poses = vec![None; frame_count];
        let mut errors = vec![
            f64::NAN;
            if self.errors.is_empty() {
                0
            } else {
                frame_count
            }
        ];
        for (row, frame) in frames.iter().enumerate() {
            poses[*frame] = self.poses[row];
            if let Some(error) = self.errors.get(row) {
                errors[*frame] = *error;
            }
        }
        RawRigidBody {
            name: self.name,
            poses,
            errors,
        }
    }
}
