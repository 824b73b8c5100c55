//! Plain tables of markers: a time column, then `name_x,name_y,name_z` for every marker.
//!
//! Enters: comment lines (`#`), one line of column names, and one row a frame. Leaves: a
//! [`RawTake`]. This is what [`crate::export::marker_csv`] writes, and what many scripts do.

use super::table::{Rows, cell, csv_fields, decode, lines};
use super::take::{
    LengthUnit, RawTake, Stated, TakeOptions, UpAxis, settle, settle_rate, usable_rate,
};
use super::{ImportError, ImportErrorKind, Place};

/// Reads a marker table; `file` names it in errors.
///
/// The first columns may be `frame` and `time` (seconds). A comment may state `unit: mm`,
/// `up: +Z` and `rate: 120`.
/// Time and memory are linear in `content`.
///
/// # Errors
/// There are no three columns of one marker, a cell is not a number, there is no row, or no frame
/// rate can be made out.
pub fn parse(content: &[u8], file: &str, options: &TakeOptions) -> Result<RawTake, ImportError> {
    if content.is_empty() {
        return Err(ImportErrorKind::Empty.at(file, Place::File));
    }
    let text = decode(content);
    let mut filled = lines(&text)
        .filter(|(_, line)| !line.trim().is_empty())
        .peekable();
    let mut comments = Vec::new();
    while let Some((line, comment)) = filled.next_if(|(_, line)| line.trim_start().starts_with('#'))
    {
        comments.push((line, comment));
    }
    let (names_line, names) = filled.next().unwrap_or((1, ""));
    let names = csv_fields(names);
    let columns = Columns::find(&names);
    if columns.markers.is_empty() {
        let kind = ImportErrorKind::NotThisFormat {
            expected: "a marker table (columns name_x, name_y, name_z)",
            found: format!(
                "{} columns, the first {:?}",
                names.len(),
                names.first().unwrap_or(&"")
            ),
        };
        return Err(kind.at(file, Place::Line(names_line)));
    }

    let mut rows = Rows::new(file, columns.markers.len(), text.len());
    for (line, row) in filled {
        let fields = csv_fields(row);
        let value = |column: Option<usize>| {
            let text = column
                .and_then(|column| fields.get(column))
                .copied()
                .unwrap_or("");
            cell(text, file, line, || "frame or time".into()).map(|value| value.unwrap_or(f64::NAN))
        };
        let frame = match columns.frame {
            Some(_) => value(columns.frame)?,
            None => (rows.len() + 1) as f64,
        };
        let stamp = (frame, value(columns.time)?);
        let places = columns.markers.iter().map(|(_, columns)| *columns);
        rows.push(line, stamp, &fields, places, |marker| {
            format!("marker {:?}", columns.markers[marker].0)
        })?;
    }
    if rows.len() == 0 {
        let kind = ImportErrorKind::Missing {
            what: "a row of coordinates".into(),
        };
        return Err(kind.at(file, Place::Line(names_line + 1)));
    }

    let said = |key: &str| {
        comments.iter().find_map(|(line, comment)| {
            let (_, rest) = comment.split_once(key)?;
            let word = rest.split([' ', ',', ';']).find(|word| !word.is_empty())?;
            Some((*line, word))
        })
    };
    let labels = columns
        .markers
        .iter()
        .map(|(name, _)| name.clone())
        .collect();
    let rate = said("rate:").and_then(|(_, rate)| rate.parse().ok());
    let (mut take, _) = rows.finish(labels, rate);
    let found = Some(take.rate).filter(|rate| usable_rate(*rate));
    take.rate = settle_rate(
        found,
        options,
        file,
        "a frame rate (time column or comment)",
    )?;
    let unit = said("unit:").or(said("units "));
    let unit = unit.filter(|(_, unit)| LengthUnit::parse(unit).is_some());
    let stated = Stated {
        unit_place: unit.map(|(line, _)| Place::Line(line)),
        unit: unit.map(|(_, unit)| unit.to_owned()),
        up: said("up:").and_then(|(_, up)| UpAxis::parse(up)),
        usual_up: Some(UpAxis::PlusY),
    };
    settle(&mut take, &stated, options);
    Ok(take)
}

/// What the columns hold.
struct Columns {
    frame: Option<usize>,
    time: Option<usize>,
    markers: Vec<(String, [usize; 3])>,
}

impl Columns {
    fn find(names: &[&str]) -> Self {
        let begins = |word: &str| {
            names.iter().position(|name| {
                name.to_ascii_lowercase().starts_with(word) && axis_of(name).is_none()
            })
        };
        let mut markers = Vec::new();
        let mut column = 0;
        while column + 2 < names.len() {
            let three = [0, 1, 2].map(|index| axis_of(names[column + index]));
            match three {
                [Some((a, 'x')), Some((b, 'y')), Some((c, 'z'))] if a == b && b == c => {
                    markers.push((a.to_owned(), [column, column + 1, column + 2]));
                    column += 3;
                }
                _ => column += 1,
            }
        }
        Self {
            frame: begins("frame"),
            time: begins("time"),
            markers,
        }
    }
}

/// Marker name and axis of a column name such as `LASI_x`, `LASI.X` or `LASI:x`.
fn axis_of(name: &str) -> Option<(&str, char)> {
    let axis = name.chars().last()?.to_ascii_lowercase();
    let rest = name.strip_suffix(['x', 'y', 'z', 'X', 'Y', 'Z'])?;
    let marker = rest.strip_suffix(['_', '.', ':', ' ', '-'])?;
    (!marker.is_empty()).then_some((marker, axis))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<RawTake, ImportError> {
        parse(text.as_bytes(), "a.csv", &TakeOptions::default())
    }

    #[test]
    fn a_table_with_comment_and_gaps() {
        let text =
            "# unit: cm, up: +Z\ntime_s,A_x,A_y,A_z,B.X,B.Y,B.Z\n0,1,2,3,,,\n0.5,1,2,3,4,5,6\n";
        let take = read(text).unwrap();
        assert_eq!(take.labels, ["A", "B"]);
        assert_eq!(
            (take.rate, take.unit, take.up),
            (2.0, LengthUnit::Centimetre, UpAxis::PlusZ)
        );
        assert_eq!(take.position(0, 1), None);
        assert_eq!(take.position(1, 1), Some([4.0, 5.0, 6.0]));
    }

    #[test]
    fn refusals_name_what_was_expected() {
        let kind = |text: &str| read(text).unwrap_err().kind;
        assert!(matches!(
            kind("a,b,c\n1,2,3\n"),
            ImportErrorKind::NotThisFormat { .. }
        ));
        assert!(matches!(
            kind("A_x,A_y,A_z\n"),
            ImportErrorKind::Missing { .. }
        ));
        assert!(
            matches!(
                kind("A_x,A_y,A_z\n1,2,3\n"),
                ImportErrorKind::Missing { .. }
            ),
            "no rate"
        );
        assert!(matches!(
            kind("A_x,A_y,A_z\n1,2,q\n"),
            ImportErrorKind::BadNumber { .. }
        ));
    }
}
