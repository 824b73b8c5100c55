//! The `MOTION` section: rows of numbers in, raw tracks out, in the file's unit and axes.

use glam::DQuat;

use super::hierarchy::{Hierarchy, Joint, Slot};
use crate::import::text::{Lines, number, trim, words};
use crate::import::{ImportError, ImportErrorKind, Notice, Place};

/// What moves one joint, one entry a frame.
pub(super) struct JointMotion {
    pub joint: usize,
    /// Position channels as stated, 0 on axes without one; empty where the joint has none.
    pub positions: Vec<[f64; 4]>,
    /// Unit quaternions x, y, z, w; empty where the joint has no rotation channel.
    pub rotations: Vec<[f64; 4]>,
}

/// The whole section.
pub(super) struct Motion {
    /// Seconds; 0 only where there is one frame at most.
    pub frame_time: f64,
    pub frame_count: usize,
    /// Joints with channels, in file order.
    pub joints: Vec<JointMotion>,
}

/// What stands before the rows.
struct Header {
    /// Line and number of announced frames, as text.
    frames: Option<(usize, String)>,
    /// Line and seconds.
    frame_time: Option<(usize, f64)>,
}

/// Reads `text`, whose first line is line `line` of the file. O(bytes); memory follows the rows
/// that are there, never the announced count.
pub(super) fn read(
    text: &[u8],
    line: usize,
    hierarchy: &Hierarchy,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<Motion, ImportError> {
    let mut lines = Lines::new(text, line);
    let header = read_header(&mut lines, file)?;
    let mut motion = Motion {
        frame_time: 0.0,
        frame_count: 0,
        joints: empty_tracks(&hierarchy.joints),
    };
    read_rows(lines, hierarchy, &mut motion, file, notices)?;
    motion.frame_time = check_frame_time(&header, motion.frame_count, file, notices)?;
    check_frame_count(&header, &motion, hierarchy, file, notices)?;
    if motion.frame_count == 0 {
        motion.joints.clear();
    }
    Ok(motion)
}

fn empty_tracks(joints: &[Joint]) -> Vec<JointMotion> {
    let moved = joints.iter().enumerate();
    moved
        .filter(|(_, joint)| !joint.slots.is_empty())
        .map(|(joint, _)| JointMotion {
            joint,
            positions: Vec::new(),
            rotations: Vec::new(),
        })
        .collect()
}

/// Takes the lines that start with `Frames` or `Frame Time`, and blank ones.
fn read_header(lines: &mut Lines<'_>, file: &str) -> Result<Header, ImportError> {
    let mut header = Header {
        frames: None,
        frame_time: None,
    };
    loop {
        let mut ahead = lines.clone();
        let Some((number_of_line, line)) = ahead.next() else {
            return Ok(header);
        };
        let line = trim(line);
        if let Some(value) = after_keyword(line, b"frames") {
            let text = String::from_utf8_lossy(value).into_owned();
            header.frames = Some((number_of_line, text));
        } else if let Some(value) = after_keyword(line, b"frame").and_then(|rest| {
            // "Frame Time:", with any space between the words.
            after_keyword(rest, b"time")
        }) {
            let seconds = number(value, || "Frame Time".into())
                .map_err(|kind| kind.at(file, Place::Line(number_of_line)))?;
            header.frame_time = Some((number_of_line, seconds));
        } else if !line.is_empty() {
            return Ok(header);
        }
        *lines = ahead;
    }
}

/// What follows `keyword` in any case, without colon and space.
fn after_keyword<'a>(line: &'a [u8], keyword: &[u8]) -> Option<&'a [u8]> {
    let (start, rest) = line.split_at_checked(keyword.len())?;
    if !start.eq_ignore_ascii_case(keyword) {
        return None;
    }
    let rest = trim(rest);
    Some(trim(rest.strip_prefix(b":").unwrap_or(rest)))
}

/// How a row failed.
enum RowFault {
    /// Fewer numbers than channels.
    Short(usize),
    /// The word in this column is no usable number.
    Word(usize, ImportErrorKind),
    /// More numbers than channels.
    Long(usize),
}

fn read_rows(
    mut lines: Lines<'_>,
    hierarchy: &Hierarchy,
    motion: &mut Motion,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<(), ImportError> {
    let columns = hierarchy.column_count;
    let mut row = vec![0.0; columns];
    while let Some((line_number, line)) = lines.next() {
        match read_row(line, &mut row, hierarchy) {
            Ok(false) => {}
            Ok(true) => {
                push_row(&row, &hierarchy.joints, &mut motion.joints);
                motion.frame_count += 1;
            }
            Err(fault) => {
                let ended = lines.ended;
                let is_last = lines.all(|(_, line)| trim(line).is_empty());
                let kind = match fault {
                    RowFault::Short(found) if is_last => {
                        let text = format!(
                            "the last row has {found} of {columns} values: the file was cut short, \
                             and the row is dropped"
                        );
                        notices.push(Notice::new(Place::Line(line_number), text));
                        return Ok(());
                    }
                    // Cut inside its last number, such as "-" or "1.5e".
                    RowFault::Word(column, ImportErrorKind::BadNumber { .. })
                        if !ended && words(line).count() == column + 1 =>
                    {
                        let text = "the last row ends inside a number: the file was cut short, \
                                    and the row is dropped";
                        notices.push(Notice::new(Place::Line(line_number), text));
                        return Ok(());
                    }
                    RowFault::Word(_, kind) => kind,
                    RowFault::Short(found) | RowFault::Long(found) => {
                        let what = format!(
                            "the row has {found} values, the hierarchy has {columns} channels"
                        );
                        ImportErrorKind::Contradiction { what }
                    }
                };
                return Err(kind.at(file, Place::Line(line_number)));
            }
        }
    }
    Ok(())
}

/// Fills `row`; false for a blank line.
fn read_row(line: &[u8], row: &mut [f64], hierarchy: &Hierarchy) -> Result<bool, RowFault> {
    let mut words = words(line);
    for (column, value) in row.iter_mut().enumerate() {
        let Some(word) = words.next() else {
            return if column == 0 {
                Ok(false)
            } else {
                Err(RowFault::Short(column))
            };
        };
        *value = number(word, || describe(hierarchy, column))
            .map_err(|kind| RowFault::Word(column, kind))?;
    }
    match words.count() {
        0 => Ok(!row.is_empty()),
        more => Err(RowFault::Long(row.len() + more)),
    }
}

/// What a column holds, for messages.
fn describe(hierarchy: &Hierarchy, column: usize) -> String {
    let owner = hierarchy.joints.iter().find(|joint| {
        (joint.first_column..joint.first_column + joint.slots.len()).contains(&column)
    });
    let Some(joint) = owner else {
        return format!("column {}", column + 1);
    };
    let (axis, kind) = match joint.slots[column - joint.first_column] {
        Slot::Position(axis) => (axis, "position"),
        Slot::Rotation(axis) => (axis, "rotation"),
    };
    let axis = ["X", "Y", "Z"][axis];
    format!(
        "{axis}{kind} of joint {:?}, column {}",
        joint.name,
        column + 1
    )
}

fn push_row(row: &[f64], joints: &[Joint], tracks: &mut [JointMotion]) {
    for track in tracks {
        let joint = &joints[track.joint];
        let mut position = None;
        let mut rotation = None;
        let values = &row[joint.first_column..joint.first_column + joint.slots.len()];
        for (&slot, &value) in joint.slots.iter().zip(values) {
            match slot {
                Slot::Position(axis) => position.get_or_insert([0.0; 4])[axis] = value,
                Slot::Rotation(axis) => {
                    let turn = axis_rotation(axis, value.to_radians());
                    rotation = Some(rotation.map_or(turn, |before: DQuat| before * turn));
                }
            }
        }
        track.positions.extend(position);
        track.rotations.extend(rotation.map(|q| q.to_array()));
    }
}

fn axis_rotation(axis: usize, angle: f64) -> DQuat {
    match axis {
        0 => DQuat::from_rotation_x(angle),
        1 => DQuat::from_rotation_y(angle),
        _ => DQuat::from_rotation_z(angle),
    }
}

fn check_frame_time(
    header: &Header,
    frame_count: usize,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<f64, ImportError> {
    let Some((line, seconds)) = header.frame_time else {
        let what = "the Frame Time line after MOTION".to_owned();
        return Err(ImportErrorKind::Missing { what }.at(file, Place::File));
    };
    if seconds > 0.0 {
        return Ok(seconds);
    }
    if seconds == 0.0 && frame_count <= 1 {
        let text = "Frame Time is 0, which a single pose does not need";
        notices.push(Notice::new(Place::Line(line), text));
        return Ok(0.0);
    }
    let kind = ImportErrorKind::OutOfRange {
        what: "Frame Time".into(),
        value: seconds.to_string(),
        expected: "more than 0 seconds".into(),
    };
    Err(kind.at(file, Place::Line(line)))
}

fn check_frame_count(
    header: &Header,
    motion: &Motion,
    hierarchy: &Hierarchy,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<(), ImportError> {
    let found = motion.frame_count;
    if hierarchy.column_count == 0 {
        let text = "no joint has a channel: the file holds a rest pose and no motion";
        notices.push(Notice::new(Place::File, text));
        return Ok(());
    }
    let Some((line, text)) = &header.frames else {
        let text = format!("the Frames line is missing; the {found} rows there are read");
        notices.push(Notice::new(Place::File, text));
        return Ok(());
    };
    let place = Place::Line(*line);
    // As a float, so that "2752.0" and counts beyond 64 bits are understood too.
    let announced = text.parse::<f64>().ok();
    let announced = announced.filter(|count| *count >= 0.0 && count.fract() == 0.0);
    let Some(announced) = announced else {
        let what = "Frames".to_owned();
        let text = text.clone();
        return Err(ImportErrorKind::BadNumber { what, text }.at(file, place));
    };
    if announced == 0.0 && found == 0 {
        let text = "the file holds a rest pose and no frame";
        notices.push(Notice::new(place, text));
    } else if found == 0 {
        let what = "the motion rows".to_owned();
        return Err(ImportErrorKind::Truncated {
            what,
            needed: announced as u64,
            found: 0,
        }
        .at(file, place));
    } else if announced != found as f64 {
        let text = format!("{text} frames are announced, {found} rows are there and are read");
        notices.push(Notice::new(place, text));
    }
    Ok(())
}
