//! CSV exports of OptiTrack Motive, format versions 1.1 and 1.2x.
//!
//! Enters: a line of settings, rows that say for every column its type, name, ID and quantity, a
//! row of axes, and one row a frame. Leaves: a [`RawTake`] with every marker, labelled or not,
//! and the rigid bodies. The rows of the head differ between versions, so that they are told by
//! their content (OptiTrack documentation, "Data Export: CSV").

use glam::{DQuat, DVec3};

use super::table::{Rows, cell, csv_fields, decode, lines};
use super::take::{
    PointKind, RawRigidBody, RawTake, Stated, TakeOptions, UpAxis, settle, settle_rate, usable_rate,
};
use super::{ImportError, ImportErrorKind, Notice, Place};

/// Lines in which the head must end.
const HEAD_LINES: usize = 20;

/// Reads a Motive CSV export; `file` names it in errors.
///
/// Time and memory are linear in `content`.
///
/// # Errors
/// It is not such an export, the row of axes or all frames are missing, a cell is not a number,
/// the rotation type is unknown, or no frame rate can be made out.
pub fn parse(content: &[u8], file: &str, options: &TakeOptions) -> Result<RawTake, ImportError> {
    if content.is_empty() {
        return Err(ImportErrorKind::Empty.at(file, Place::File));
    }
    let text = decode(content);
    let head = Head::read(&text, file)?;
    let mut notices = Vec::new();
    let (points, mut bodies) = head.columns(file, &mut notices)?;

    let mut rows = Rows::new(file, points.len(), text.len());
    for (line, row) in lines(&text)
        .skip(head.axes_line)
        .filter(|(_, line)| !line.trim().is_empty())
    {
        let fields = csv_fields(row);
        let value = |column: usize, what: &str| {
            let text = fields.get(column).copied().unwrap_or("");
            cell(text, file, line, || what.to_owned()).map(|value| value.unwrap_or(f64::NAN))
        };
        let stamp = (value(0, "frame number")?, value(1, "time")?);
        let places = points.iter().map(|point| point.position);
        rows.push(line, stamp, &fields, places, |point| {
            format!("marker {:?}", points[point].name)
        })?;
        for body in &mut bodies {
            let pose = body.pose(|column| value(column, &body.name))?;
            body.poses.push(pose);
            if let Some(column) = body.error {
                body.errors.push(value(column, &body.name)?);
            }
        }
    }
    if rows.len() == 0 {
        let kind = ImportErrorKind::Missing {
            what: "a row of coordinates".into(),
        };
        return Err(kind.at(file, Place::Line(head.axes_line + 1)));
    }

    let setting = |key| {
        head.setting(key)
            .and_then(|value: &str| value.parse::<f64>().ok())
    };
    let stated_rate = setting("Export Frame Rate").or(setting("Capture Frame Rate"));
    let announced = setting("Total Exported Frames").or(setting("Total Frames in Take"));
    if let Some(announced) = announced.filter(|announced| *announced != rows.len() as f64) {
        let text = format!(
            "{announced} frames announced, {} rows are there",
            rows.len()
        );
        notices.push(Notice::new(Place::Line(1), text));
    }
    let labels = points.iter().map(|point| point.name.clone()).collect();
    let (mut take, frames) = rows.finish(labels, stated_rate);
    take.notices.splice(0..0, notices);
    for (kind, point) in take.kinds.iter_mut().zip(&points) {
        *kind = if point.expected {
            PointKind::Model
        } else {
            PointKind::of_label(&point.name)
        };
    }
    take.rigid_bodies = bodies
        .into_iter()
        .map(|body| body.spread(&frames, take.frame_count))
        .collect();
    let found = Some(take.rate).filter(|rate| usable_rate(*rate));
    take.rate = settle_rate(found, options, file, "a frame rate (Export Frame Rate)")?;
    let stated = Stated {
        unit_place: Some(Place::Line(1)),
        unit: head.setting("Length Units").map(str::to_owned),
        // Motive's own axes; an export with others does not say so.
        up: Some(UpAxis::PlusY),
        usual_up: None,
    };
    settle(&mut take, &stated, options);
    Ok(take)
}

/// Everything above the first frame.
struct Head<'a> {
    settings: Vec<&'a str>,
    /// `Rigid Body`, `Marker` and the like, one a column.
    types: Vec<&'a str>,
    names: Vec<&'a str>,
    ids: Vec<&'a str>,
    /// `Rotation`, `Position`, `Marker Quality` and the like.
    quantities: Vec<&'a str>,
    axes: Vec<&'a str>,
    /// One-based line of `axes`.
    axes_line: usize,
}

impl<'a> Head<'a> {
    fn read(text: &'a str, file: &str) -> Result<Self, ImportError> {
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
            .position(|(_, fields)| fields.iter().any(|field| names_type(&field)));
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
    fn setting(&self, key: &str) -> Option<&'a str> {
        let at = self
            .settings
            .iter()
            .position(|field| field.eq_ignore_ascii_case(key))?;
        self.settings.get(at + 1).copied()
    }

    /// Points and bodies in the order of their columns.
    fn columns(
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
struct Point {
    name: String,
    position: [usize; 3],
    /// Where the body expects the marker, not where it was seen.
    expected: bool,
}

/// Columns of a rotation.
enum Rotation {
    None,
    /// X, Y, Z, W.
    Quaternion([usize; 4]),
    /// Order of the axes; columns of X, Y, Z in degrees.
    Euler([usize; 3], [usize; 3]),
}

/// A rigid body's columns and what they held so far.
struct Body {
    name: String,
    position: [usize; 3],
    rotation: Rotation,
    error: Option<usize>,
    poses: Vec<Option<(DQuat, DVec3)>>,
    errors: Vec<f64>,
}

impl Body {
    /// The pose of one row, `None` where a cell is blank.
    fn pose(
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
    fn spread(self, frames: &[usize], frame_count: usize) -> RawRigidBody {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::take::LengthUnit;

    fn read(text: &str) -> Result<RawTake, ImportError> {
        parse(text.as_bytes(), "a.csv", &TakeOptions::default())
    }

    const OLD: &str = "Format Version,1.1,Take Name,t,Capture Frame Rate,100,Rotation Type,XYZ,Length Units,Centimeters\n\
        \n,,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker\n\
        ,,B,B,B,B,B,B,B,B:1,B:1,B:1\n\
        ,,\"1\",\"1\",\"1\",\"1\",\"1\",\"1\",\"1\",\"2\",\"2\",\"2\"\n\
        ,,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position,Position,Position\n\
        Frame,Time,X,Y,Z,X,Y,Z,,X,Y,Z\n\
        0,0.00,90,0,90,1,2,3,0.5,4,5,6\n\
        1,0.01,,,,,,,,,,\n\
        3,0.03,,,,,,,,,,\n";

    #[test]
    fn version_1_1_with_euler_angles_and_a_frame_left_out() {
        let take = read(OLD).unwrap();
        assert_eq!(
            (take.frame_count, take.rate, take.unit),
            (4, 100.0, LengthUnit::Centimetre)
        );
        assert_eq!(take.labels, ["B:1"]);
        assert_eq!(take.position(0, 0), Some([4.0, 5.0, 6.0]));
        assert_eq!(take.position(1, 0), None);
        let body = &take.rigid_bodies[0];
        let (rotation, origin) = body.poses[0].unwrap();
        assert_eq!(origin, DVec3::new(1.0, 2.0, 3.0));
        // About X, then about the turned Z: the body's X ends along the turned Y, which is Z.
        assert!((rotation * DVec3::X - DVec3::Z).length() < 1e-12);
        assert!((rotation * DVec3::Y - DVec3::NEG_X).length() < 1e-12);
        assert_eq!((body.poses[1], body.errors[0]), (None, 0.5));
        assert!(body.errors[1].is_nan());
    }

    #[test]
    fn version_1_25_with_row_names_parents_and_expected_markers() {
        let text = "Format Version,1.25,Export Frame Rate,120,Rotation Type,Quaternion,Length Units,Millimeters\n\
            ,Type,Rigid Body Marker,Rigid Body Marker,Rigid Body Marker,Marker,Marker,Marker,Marker,Marker,Marker\n\
            ,Name,B:1,B:1,B:1,B:1,B:1,B:1,Unlabeled 7,Unlabeled 7,Unlabeled 7\n\
            ,ID,9F,9F,9F,9F,9F,9F,B7,B7,B7\n,Parent,B,B,B,B,B,B,,,\n\
            ,,Position,Position,Position,Position,Position,Position,Position,Position,Position\n\
            Frame,Time (Seconds),X,Y,Z,X,Y,Z,X,Y,Z\n\
            10,0.000000,1,2,3,4,5,6,,,\n11,0.008333,1,2,3,4,5,6,7,8,9\n";
        let take = read(text).unwrap();
        assert_eq!(take.labels, ["B:1", "B:1", "Unlabeled 7"]);
        assert_eq!(
            take.kinds,
            [PointKind::Model, PointKind::Marker, PointKind::Unlabelled]
        );
        assert_eq!((take.first_frame, take.rate), (10, 120.0));
        assert_eq!(take.position(0, 2), None);
        assert_eq!(take.position(1, 2), Some([7.0, 8.0, 9.0]));
    }

    #[test]
    fn refusals_say_what_is_missing() {
        assert!(matches!(
            read("Frame,Time,X\n").unwrap_err().kind,
            ImportErrorKind::NotThisFormat { .. }
        ));
        let kind = |text: &str| read(text).unwrap_err().kind;
        assert!(matches!(
            kind("Format Version,2.0\n"),
            ImportErrorKind::Unsupported { .. }
        ));
        assert!(matches!(
            kind("Format Version,1.23\n,,Marker\n"),
            ImportErrorKind::Missing { .. }
        ));
        assert!(matches!(
            kind(&OLD.replace("XYZ", "ABC")),
            ImportErrorKind::Unsupported { .. }
        ));
        let error = read(&OLD.replace("0.5,4,5,6", "0.5,4,?,6")).unwrap_err();
        assert_eq!(error.place, Place::Line(8));
        let (head, _) = OLD.split_once("0,0.00").unwrap();
        assert!(matches!(kind(head), ImportErrorKind::Missing { .. }));
    }
}
