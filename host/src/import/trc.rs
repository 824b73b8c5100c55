//! TRC files of Motion Analysis, OpenSim and others: a tab-separated table of markers.
//!
//! Enters: five header lines (file type, keys, values, marker names, coordinate names) and one
//! row a frame. Leaves: a [`RawTake`]. Real files have more or fewer rows and columns than their
//! header says, blanks or NaN for missing samples, and spaces for tabs.

use super::table::{Rows, cell, decode, lines};
use super::take::{RawTake, Stated, TakeOptions, UpAxis, settle, settle_rate, usable_rate};
use super::{ImportError, ImportErrorKind, Notice, Place};

/// Reads a TRC file; `file` names it in errors.
///
/// Time and memory are linear in `content`.
///
/// # Errors
/// It is not TRC, the header is cut short, a cell is not a number, there is no row, or no frame
/// rate can be made out. Contradictions between header and rows become notices.
pub fn parse(content: &[u8], file: &str, options: &TakeOptions) -> Result<RawTake, ImportError> {
    if content.is_empty() {
        return Err(ImportErrorKind::Empty.at(file, Place::File));
    }
    let text = decode(content);
    let header = Header::read(&text, file)?;
    let mut notices = Vec::new();
    let columns = Columns::find(&text, &header, &mut notices);
    let labels = header.labels(columns.points, &mut notices);

    let mut rows = Rows::new(file, columns.points, text.len());
    let ends_whole = text.ends_with(['\n', '\r']);
    let mut body = body(&text, header.lines).peekable();
    while let Some((line, row)) = body.next() {
        let fields = fields(row);
        let whole = fields.len() >= columns.offset + 3 * columns.points;
        if body.peek().is_none() && !ends_whole && !whole && rows.len() > 0 {
            notices.push(Notice::new(
                Place::Line(line),
                "the last row is cut short: left out",
            ));
            break;
        }
        let value = |column: usize, what: &'static str| {
            let text = fields.get(column).copied().unwrap_or("");
            cell(text, file, line, || what.to_owned()).map(|value| value.unwrap_or(f64::NAN))
        };
        let stamp = (value(0, "frame number")?, value(1, "time")?);
        let places = (0..columns.points).map(|point| {
            let first = columns.offset + 3 * point;
            [first, first + 1, first + 2]
        });
        rows.push(line, stamp, &fields, places, |point| {
            format!("marker {:?}", labels[point])
        })?;
    }
    if rows.len() == 0 {
        let kind = ImportErrorKind::Missing {
            what: "a row of coordinates".into(),
        };
        return Err(kind.at(file, Place::Line(header.lines + 1)));
    }
    if let Some(announced) = header
        .frames
        .filter(|announced| *announced != rows.len() as f64)
    {
        let text = format!(
            "{announced} frames announced, {} rows are there",
            rows.len()
        );
        notices.push(Notice::new(Place::Line(3), text));
    }

    let (mut take, _) = rows.finish(labels, header.rate);
    take.notices.splice(0..0, notices);
    let found = Some(take.rate).filter(|rate| usable_rate(*rate));
    take.rate = settle_rate(found, options, file, "a frame rate (DataRate)")?;
    let stated = Stated {
        unit_place: Some(Place::Line(3)),
        unit: header.unit.map(str::to_owned),
        up: None,
        usual_up: Some(UpAxis::PlusY),
    };
    settle(&mut take, &stated, options);
    Ok(take)
}

/// What the first five lines say.
struct Header<'a> {
    rate: Option<f64>,
    frames: Option<f64>,
    markers: Option<f64>,
    unit: Option<&'a str>,
    /// Fields of the line of marker names, after frame number and time.
    names: Vec<&'a str>,
    /// Column of the first coordinate name, if that line is there.
    first_coordinate: Option<usize>,
    /// How many lines the header has.
    lines: usize,
}

impl<'a> Header<'a> {
    fn read(text: &'a str, file: &str) -> Result<Self, ImportError> {
        let mut head = lines(text);
        let first = head.next().map_or("", |(_, line)| line);
        let mark = first.trim_start().get(..12).unwrap_or("");
        if !mark.eq_ignore_ascii_case("PathFileType") {
            let kind = ImportErrorKind::NotThisFormat {
                expected: "a TRC file (its first word is PathFileType)",
                found: format!(
                    "it begins with {:?}",
                    first.chars().take(20).collect::<String>()
                ),
            };
            return Err(kind.at(file, Place::Line(1)));
        }
        let lines: Vec<&str> = head
            .map(|(_, line)| line)
            .filter(|line| !line.trim().is_empty())
            .take(4)
            .collect();
        let &[keys, values, names, ..] = lines.as_slice() else {
            let kind = ImportErrorKind::Truncated {
                what: "the header (lines)".into(),
                needed: 5,
                found: 1 + lines.len() as u64,
            };
            return Err(kind.at(file, Place::Line(1 + lines.len())));
        };
        let (keys, values) = (fields(keys), fields(values));
        let value = |key: &str| {
            let column = keys
                .iter()
                .position(|other| other.eq_ignore_ascii_case(key))?;
            values
                .get(column)
                .copied()
                .filter(|value| !value.is_empty())
        };
        let number = |key| value(key).and_then(|value: &str| value.parse::<f64>().ok());
        let names: Vec<&str> = fields(names);
        if !names
            .first()
            .is_some_and(|first| first.to_ascii_lowercase().starts_with("frame"))
        {
            let kind = ImportErrorKind::Missing {
                what: "the line of marker names (Frame#, Time, ...)".into(),
            };
            return Err(kind.at(file, Place::Line(4)));
        }
        let coordinates = lines.get(3).map(|line| fields(line)).unwrap_or_default();
        let is_name = |field: &&str| field.starts_with(['X', 'Y', 'Z', 'x', 'y', 'z']);
        let named = coordinates
            .iter()
            .all(|field| field.is_empty() || is_name(field));
        let first_coordinate = coordinates.iter().position(is_name).filter(|_| named);
        Ok(Self {
            rate: number("DataRate")
                .or(number("CameraRate"))
                .filter(|rate| usable_rate(*rate)),
            frames: number("NumFrames"),
            markers: number("NumMarkers").filter(|count| *count >= 0.0 && count.fract() == 0.0),
            unit: value("Units"),
            names: names.into_iter().skip(2).collect(),
            first_coordinate,
            lines: line_of(text, if first_coordinate.is_some() { 5 } else { 4 }),
        })
    }

    /// One label a point; points without a name are numbered.
    fn labels(&self, points: usize, notices: &mut Vec<Notice>) -> Vec<String> {
        // Three columns a marker, unless blanks between the names are missing or added.
        let regular = self
            .names
            .iter()
            .enumerate()
            .all(|(column, name)| name.is_empty() || column % 3 == 0);
        let mut labels: Vec<String> = self
            .names
            .iter()
            .enumerate()
            .filter(|(column, name)| {
                if regular {
                    column % 3 == 0
                } else {
                    !name.is_empty()
                }
            })
            .map(|(_, name)| (*name).to_owned())
            .collect();
        let extra: Vec<String> = labels
            .drain(points.min(labels.len())..)
            .filter(|name| !name.is_empty())
            .collect();
        if let (Some(first), Some(last)) = (extra.first(), extra.last()) {
            let text = format!(
                "{} names without columns of their own: {first:?} to {last:?} left out",
                extra.len()
            );
            notices.push(Notice::new(Place::Line(4), text));
        }
        labels.resize(points, String::new());
        for (point, label) in labels.iter_mut().enumerate() {
            if label.is_empty() {
                *label = format!("*{}", point + 1);
            }
        }
        labels
    }
}

/// Where the coordinates stand in the rows.
struct Columns {
    /// Of the first coordinate.
    offset: usize,
    points: usize,
}

impl Columns {
    fn find(text: &str, header: &Header<'_>, notices: &mut Vec<Notice>) -> Self {
        // One look at all rows: how far they reach, and whether the column after the time is used.
        let (mut reach, mut third, mut end_used) = (0, false, 0);
        for (_, row) in body(text, header.lines) {
            let fields = fields(row);
            third |= fields.get(2).is_some_and(|field| !field.is_empty());
            let used = fields
                .iter()
                .rposition(|field| !field.is_empty())
                .map_or(0, |last| last + 1);
            end_used = end_used.max(used);
            reach = reach.max(fields.len());
        }
        let names = header.names.iter().filter(|name| !name.is_empty()).count();
        let stated = header.markers.map(|count| count as usize);
        // An empty column after the time shifts everything, if the rows are that long.
        let shifted = header.first_coordinate == Some(3)
            && !third
            && reach >= 3 + 3 * stated.unwrap_or(names)
            && end_used % 3 == 0;
        let offset = if shifted { 3 } else { 2 };
        let used = end_used.saturating_sub(offset).div_ceil(3);
        let points = match stated {
            Some(stated) if used > stated && names > stated => used.min(names),
            Some(stated) if stated <= names.max(used) => stated,
            _ => names.max(used),
        };
        if let Some(stated) = stated.filter(|stated| *stated != points) {
            let text = format!(
                "{stated} markers announced, {names} names and columns for {used} are there: {points} taken"
            );
            notices.push(Notice::new(Place::Line(3), text));
        } else if used > points {
            let text = format!(
                "{points} markers announced, columns for {used} are filled: the rest left out"
            );
            notices.push(Notice::new(Place::Line(3), text));
        }
        Self { offset, points }
    }
}

/// Rows after the header that are not blank.
fn body(text: &str, header_lines: usize) -> impl Iterator<Item = (usize, &str)> {
    lines(text)
        .skip(header_lines)
        .filter(|(_, line)| !line.trim().is_empty())
}

/// Number of the line that is the `count`-th which is not blank.
fn line_of(text: &str, count: usize) -> usize {
    let mut filled = lines(text).filter(|(_, line)| !line.trim().is_empty());
    filled.nth(count - 1).map_or(0, |(number, _)| number)
}

/// Fields between tabs, or between blanks where there is no tab.
fn fields(line: &str) -> Vec<&str> {
    if line.contains('\t') {
        line.split('\t').map(str::trim).collect()
    } else {
        line.split_whitespace().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::take::LengthUnit;

    const HEAD: &str = "PathFileType\t4\t(X/Y/Z)\tC:\\a b\\c.trc\n\
        DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\n\
        100\t100\t2\t2\tmm\t100\n";

    fn read(text: &str) -> Result<RawTake, ImportError> {
        parse(text.as_bytes(), "a.trc", &TakeOptions::default())
    }

    #[test]
    fn blanks_and_nan_are_missing() {
        let text = format!(
            "{HEAD}Frame#\tTime\tA\t\t\tB\t\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n\
             7\t0.00\t1\t2\t3\t\t\t\n8\t0.01\tNaN\tnan\tNAN\t4e0\t-5\t6\n"
        );
        let take = read(&text).unwrap();
        assert_eq!(take.labels, ["A", "B"]);
        assert_eq!(
            (take.frame_count, take.rate, take.first_frame),
            (2, 100.0, 7)
        );
        assert_eq!(take.unit, LengthUnit::Millimetre);
        assert_eq!(take.position(0, 0), Some([1.0, 2.0, 3.0]));
        assert_eq!(take.position(0, 1), None);
        assert_eq!(take.position(1, 0), None);
        assert_eq!(take.position(1, 1), Some([4.0, -5.0, 6.0]));
    }

    #[test]
    fn an_empty_column_after_the_time_shifts_the_rows_only_if_they_have_it() {
        let names = "Frame#\tTime\t\tA\t\tB\n\t\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n";
        let plain = format!("{HEAD}{names}1\t0\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t4\t5\t6\n");
        let shifted =
            format!("{HEAD}{names}1\t0\t\t1\t2\t3\t4\t5\t6\n2\t0.01\t\t1\t2\t3\t4\t5\t6\n");
        for text in [plain, shifted] {
            let take = read(&text).unwrap();
            assert_eq!(take.labels, ["A", "B"]);
            assert_eq!(take.position(1, 1), Some([4.0, 5.0, 6.0]));
        }
    }

    #[test]
    fn rows_overrule_the_header_and_left_out_frames_are_missing() {
        let text = format!(
            "{HEAD}Frame# Time A B\n1 0.00 1 2 3 4 5 6\n2 0.01 1 2 3 4 5 6\n5 0.04 1 2 3 4 5 7\n"
        );
        let take = read(&text).unwrap();
        assert_eq!(take.frame_count, 5);
        assert_eq!(take.position(2, 0), None);
        assert_eq!(take.position(4, 1), Some([4.0, 5.0, 7.0]));
        assert!(
            take.notices
                .iter()
                .any(|notice| notice.text.contains("2 frames announced, 3 rows"))
        );
    }

    #[test]
    fn more_columns_or_names_than_markers() {
        let rows = "1\t0\t1\t2\t3\t4\t5\t6\t\t\t\n2\t0.01\t1\t2\t3\t4\t5\t6\t\t\t\n";
        let text = format!("{HEAD}Frame#\tTime\tA\t\t\tB\t\t\tV\t\t\n\t\tX1\n{rows}");
        let take = read(&text).unwrap();
        assert_eq!(take.labels, ["A", "B"]);
        assert!(
            take.notices
                .iter()
                .any(|notice| notice.text.contains("\"V\""))
        );

        let text = text.replace("\t6\t\t\t\n", "\t6\t7\t8\t9\n");
        assert_eq!(
            read(&text).unwrap().labels,
            ["A", "B", "V"],
            "filled columns count"
        );
    }

    #[test]
    fn refusals_name_the_line() {
        let error = read("PathFileType\t4\nDataRate\tCamera").unwrap_err();
        assert_eq!(error.place, Place::Line(2));
        assert!(matches!(
            error.kind,
            ImportErrorKind::Truncated {
                needed: 5,
                found: 2,
                ..
            }
        ));
        assert!(matches!(
            read("hello").unwrap_err().kind,
            ImportErrorKind::NotThisFormat { .. }
        ));
        assert!(matches!(read("").unwrap_err().kind, ImportErrorKind::Empty));

        let text = format!("{HEAD}Frame#\tTime\tA\t\t\tB\n\t\tX1\n1\t0\t1\t2\tx\t4\t5\t6\n");
        let error = read(&text).unwrap_err();
        assert_eq!(
            error.to_string(),
            "a.trc:6: \"x\" is not a number (marker \"A\"); correct the value at that place"
        );
        let text = format!("{HEAD}Frame#\tTime\tA\t\t\tB\n\t\tX1\n");
        assert!(matches!(
            read(&text).unwrap_err().kind,
            ImportErrorKind::Missing { .. }
        ));
    }

    #[test]
    fn a_last_row_cut_by_a_failed_copy_is_left_out() {
        let text = format!(
            "{HEAD}Frame#\tTime\tA\t\t\tB\n\t\tX1\n1\t0\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t4\t5"
        );
        let take = read(&text).unwrap();
        assert_eq!(take.frame_count, 1);
    }

    #[test]
    fn a_wide_header_over_short_rows_cannot_exhaust_memory() {
        let mut text = format!("{}Frame#\tTime", HEAD.replace("\t2\tmm", "\t20000\tmm"));
        for marker in 0..20000 {
            text.push_str(&format!("\tm{marker}\t\t"));
        }
        text.push_str("\n\t\tX1\n");
        for row in 0..10000 {
            text.push_str(&format!("{row}\t0\n"));
        }
        assert!(matches!(
            read(&text).unwrap_err().kind,
            ImportErrorKind::TooMany { .. }
        ));
    }
}
