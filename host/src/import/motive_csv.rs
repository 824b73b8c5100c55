//! CSV exports of OptiTrack Motive, format versions 1.1 and 1.2x.
//!
//! Enters: a line of settings, rows that say for every column its type, name, ID and quantity, a
//! row of axes, and one row a frame. Leaves: a [`RawTake`] with every marker, labelled or not,
//! and the rigid bodies. The rows of the head differ between versions, so that they are told by
//! their content (OptiTrack documentation, "Data Export: CSV").

mod head;

use self::head::Head;
use super::table::{Rows, cell, csv_fields, decode, lines};
use super::take::{
    PointKind, RawTake, Stated, TakeOptions, UpAxis, settle, settle_rate, usable_rate,
};
use super::{ImportError, ImportErrorKind, Notice, Place};

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

#[cfg(test)]
mod tests {
    use glam::DVec3;

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
