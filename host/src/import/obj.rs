//! Wavefront OBJ files: text in, one polygon mesh out.
//!
//! Follows the *Advanced Visualizer* manual, appendix B1. A mesh here has one entry a `v` line, in
//! their order, so that results can be matched to the source vertex by vertex. OBJ lets every
//! corner of a face choose its own normal and texture coordinate; where the corners of a vertex
//! differ, the [`attributes`] module settles on one and a [`Notice`] says so.
//!
//! Parts of the surface are named by `g`; where no group is open by `o`, else by `usemtl`, else
//! `default`. A `g` line with several names gives one part whose name is all of them, joined by
//! spaces, as a face belongs to one part only; [`RawMesh::keep_primitives`] finds each of them.

use super::text::{Lines, check_unit, file_stem, text_of, trim};
use super::{ImportError, ImportErrorKind, Notice, Place, RawMesh, RawPrimitive};
use reader::{Reader, Table};

mod attributes;
mod reader;
#[cfg(test)]
mod tests;

/// Reads an OBJ file; `file` is its name for messages, `unit_metres` the length of its unit, which
/// the format does not state.
///
/// Positions `[v lines]` in metres, in file order; polygons are kept as they are; normals and
/// texture coordinates `[v lines]` where faces refer to any, the latter from the upper left as in
/// [`RawMesh::texcoords`]. Parts appear in the order of their first mention. O(bytes).
///
/// # Errors
/// [`ImportError`] with the line: text that is no OBJ, a value that is missing or no finite
/// number, an index of 0 or beyond what the file defines, a face with fewer than three corners,
/// no vertex or no face at all. What is skipped or settled is returned as a [`Notice`].
pub fn read_obj(
    bytes: &[u8],
    file: &str,
    unit_metres: f64,
) -> Result<(RawMesh, Vec<Notice>), ImportError> {
    let whole_file = |kind: ImportErrorKind| kind.at(file, Place::File);
    let text = text_of(bytes, "an OBJ file").map_err(whole_file)?;
    let unit_metres = check_unit(unit_metres).map_err(whole_file)?;
    let mut reader = Reader::default();
    let mut lines = Lines::new(text, 1);
    let mut joined = Vec::new();
    while let Some((line, statement)) = next_statement(&mut lines, &mut joined) {
        reader
            .statement(statement, line)
            .map_err(|kind| kind.at(file, Place::Line(line)))?;
    }
    let check = reader.check_references();
    check.map_err(|(place, kind)| kind.at(file, place))?;
    Ok(assemble(reader, unit_metres, file))
}

/// The next line without its white space, with the lines that a backslash at the end joins to it,
/// and the number of its first line.
fn next_statement<'a, 'text: 'a>(
    lines: &mut Lines<'text>,
    joined: &'a mut Vec<u8>,
) -> Option<(usize, &'a [u8])> {
    let (number, line) = lines.next()?;
    let line = trim(line);
    // A comment may end in a backslash by chance, as a Windows path does.
    let mut continued = line.strip_suffix(b"\\").filter(|_| !line.starts_with(b"#"));
    if continued.is_none() {
        return Some((number, line));
    }
    joined.clear();
    while let Some(part) = continued {
        joined.extend_from_slice(part);
        joined.push(b' ');
        let next = trim(lines.next().map_or(&[][..], |(_, line)| line));
        continued = next.strip_suffix(b"\\");
        if continued.is_none() {
            joined.extend_from_slice(next);
        }
    }
    Some((number, joined))
}

fn assemble(mut reader: Reader, unit_metres: f64, file: &str) -> (RawMesh, Vec<Notice>) {
    let mut notices = Vec::new();
    notice_skipped(&reader, &mut notices);
    drop_absent_tables(&mut reader, &mut notices);
    reader.parts.retain(|part| !part.corners.is_empty());
    reader.names.notice(&mut notices);
    let corners = || reader.parts.iter().flat_map(|part| &part.corners);
    let texcoords = attributes::texcoords(
        corners(),
        &reader.texcoords,
        reader.positions.len(),
        &mut notices,
    );
    let polygons = || {
        reader.parts.iter().flat_map(|part| {
            let mut rest = part.corners.as_slice();
            part.polygon_sizes.iter().map(move |&size| {
                let (polygon, tail) = rest.split_at(size as usize);
                rest = tail;
                polygon
            })
        })
    };
    let normals = attributes::normals(polygons, &reader.normals, &reader.positions, &mut notices);
    let name = reader.object.filter(|_| reader.object_count == 1);
    let mesh = RawMesh {
        name: name.unwrap_or_else(|| file_stem(file)),
        positions: reader.positions.iter().map(|p| *p * unit_metres).collect(),
        normals,
        tangents: None,
        texcoords,
        primitives: reader
            .parts
            .into_iter()
            .map(|part| RawPrimitive {
                name: part.name,
                corners: part.corners.iter().map(|corner| corner.vertex).collect(),
                polygon_sizes: part.polygon_sizes,
            })
            .collect(),
        morphs: Vec::new(),
    };
    (mesh, notices)
}

/// Forgets references to normals or texture coordinates of which the file has not a single one.
fn drop_absent_tables(reader: &mut Reader, notices: &mut Vec<Notice>) {
    let tables = [
        (
            Table::Texcoord,
            reader.texcoords.is_empty(),
            "texture coordinates",
        ),
        (Table::Normal, reader.normals.is_empty(), "normals"),
    ];
    for (table, is_empty, noun) in tables {
        let (_, line) = reader.furthest[table as usize];
        if !is_empty || line == 0 {
            continue;
        }
        let text = format!("faces refer to {noun}, of which the file has none; that is ignored");
        notices.push(Notice::new(Place::Line(line), text));
        for corner in reader.parts.iter_mut().flat_map(|part| &mut part.corners) {
            match table {
                Table::Normal => corner.normal = None,
                _ => corner.texcoord = None,
            }
        }
    }
}

fn notice_skipped(reader: &Reader, notices: &mut Vec<Notice>) {
    let mut say = |line: usize, text: String| {
        notices.push(Notice::new(Place::Line(line), text));
    };
    for (kind, &(line, count)) in &reader.skipped {
        say(
            line,
            format!("{count} {kind:?} statements are no polygons and are skipped"),
        );
    }
    if let Some((line, word, count)) = &reader.unknown {
        say(
            *line,
            format!("{count} lines with unknown keywords, such as {word}, are skipped"),
        );
    }
    if let Some(line) = reader.extra_values {
        say(
            line,
            "vertices have weights or colours, which are not kept".into(),
        );
    }
    let mut empty = reader.parts.iter().filter(|part| part.corners.is_empty());
    if let Some(first) = empty.next() {
        let count = 1 + empty.count();
        let text = format!(
            "{count} groups have no face and are dropped, such as {:?}",
            first.name
        );
        say(first.line, text);
    }
}
