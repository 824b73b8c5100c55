//! Statements in, vertex tables and parts with their corners out.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use super::attributes::Corner;
use crate::import::text::{Names, excerpt, number, trim, words};
use crate::import::{ImportErrorKind, Place};

/// What a face corner refers to; also the position in arrays over them.
#[derive(Clone, Copy)]
pub(super) enum Table {
    Position,
    Texcoord,
    Normal,
}

impl Table {
    fn noun(self) -> &'static str {
        match self {
            Self::Position => "vertex",
            Self::Texcoord => "texture coordinate",
            Self::Normal => "normal",
        }
    }
}

/// A part while it grows.
#[derive(Default)]
pub(super) struct Part {
    pub name: String,
    pub line: usize,
    pub polygon_sizes: Vec<u32>,
    pub corners: Vec<Corner>,
}

/// What has been read so far.
#[derive(Default)]
pub(super) struct Reader {
    pub positions: Vec<DVec3>,
    pub texcoords: Vec<[f64; 2]>,
    pub normals: Vec<DVec3>,
    pub parts: Vec<Part>,
    part_of_name: HashMap<String, usize>,
    group: Option<String>,
    pub object: Option<String>,
    material: Option<String>,
    /// The part that faces go to; found anew after a `g`, `o` or `usemtl` line.
    open_part: Option<usize>,
    pub object_count: usize,
    /// By [`Table`]: largest index used and its line, 0 for none. Positive indices may refer forward.
    pub furthest: [(u32, usize); 3],
    /// Keyword to first line and count of what is skipped.
    pub skipped: BTreeMap<&'static str, (usize, usize)>,
    pub unknown: Option<(usize, String, usize)>,
    pub extra_values: Option<usize>,
    pub names: Names,
}

/// Statements that say nothing about the surface itself.
const IGNORED: [&[u8]; 11] = [
    b"s",
    b"mg",
    b"mtllib",
    b"maplib",
    b"usemap",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
];

/// Elements that are no polygons, and what belongs to them.
const SKIPPED: [&str; 21] = [
    "l", "p", "vp", "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim",
    "hole", "scrv", "sp", "end", "con", "ctech", "stech", "call", "csh",
];

impl Reader {
    /// Reads one statement that starts on `line`.
    pub fn statement(&mut self, statement: &[u8], line: usize) -> Result<(), ImportErrorKind> {
        let end = statement.iter().position(|b| matches!(b, b' ' | b'\t'));
        let (keyword, rest) = statement.split_at(end.unwrap_or(statement.len()));
        match keyword {
            b"" => {}
            b"v" => {
                let (position, more) = numbers::<3>(rest, 3, "vertex")?;
                self.positions.push(DVec3::from_array(position));
                if more {
                    self.extra_values.get_or_insert(line);
                }
            }
            b"vt" => {
                let ([u, v], _) = numbers(rest, 1, "texture coordinate")?;
                self.texcoords.push([u, 1.0 - v]);
            }
            b"vn" => {
                let (normal, _) = numbers(rest, 3, "normal")?;
                self.normals.push(DVec3::from_array(normal));
            }
            b"f" | b"fo" => self.face(rest, line)?,
            b"g" => {
                let names: Vec<_> = words(rest)
                    .map(|word| self.names.read(word, line))
                    .collect();
                self.group = (!names.is_empty()).then(|| names.join(" "));
                if let Some(name) = self.group.clone() {
                    self.part(name, line);
                }
                self.open_part = None;
            }
            b"o" => {
                self.object = self.stated_name(rest, line);
                self.object_count += 1;
                self.open_part = None;
            }
            b"usemtl" => {
                self.material = self.stated_name(rest, line);
                self.open_part = None;
            }
            _ if keyword.starts_with(b"#") || IGNORED.contains(&keyword) => {}
            _ => self.skip(keyword, line)?,
        }
        Ok(())
    }

    fn stated_name(&mut self, rest: &[u8], line: usize) -> Option<String> {
        let name = trim(rest);
        (!name.is_empty()).then(|| self.names.read(name, line))
    }

    fn skip(&mut self, keyword: &[u8], line: usize) -> Result<(), ImportErrorKind> {
        if let Some(kind) = SKIPPED.iter().find(|kind| kind.as_bytes() == keyword) {
            self.skipped.entry(kind).or_insert((line, 0)).1 += 1;
            return Ok(());
        }
        let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
        if !keyword.iter().all(is_word) {
            return Err(ImportErrorKind::NotThisFormat {
                expected: "an OBJ file",
                found: format!("the word {}", excerpt(keyword)),
            });
        }
        let first = || (line, excerpt(keyword), 0);
        self.unknown.get_or_insert_with(first).2 += 1;
        Ok(())
    }

    fn part(&mut self, name: String, line: usize) -> usize {
        let next = self.parts.len();
        let part = *self.part_of_name.entry(name.clone()).or_insert(next);
        if part == next {
            self.parts.push(Part {
                name,
                line,
                ..Part::default()
            });
        }
        part
    }

    fn face(&mut self, rest: &[u8], line: usize) -> Result<(), ImportErrorKind> {
        let open = self.open_part.unwrap_or_else(|| {
            let stated = [&self.group, &self.object, &self.material];
            let name = stated.into_iter().flatten().next().cloned();
            self.part(name.unwrap_or_else(|| "default".into()), line)
        });
        self.open_part = Some(open);
        let start = self.parts[open].corners.len();
        for word in words(rest).take_while(|word| !word.starts_with(b"#")) {
            let corner = self.corner(word, line)?;
            self.parts[open].corners.push(corner);
        }
        let part = &mut self.parts[open];
        let count = part.corners.len() - start;
        match u32::try_from(count) {
            Ok(size @ 3..) => part.polygon_sizes.push(size),
            _ => {
                return Err(ImportErrorKind::OutOfRange {
                    what: "the number of corners of a face".into(),
                    value: count.to_string(),
                    expected: "at least 3".into(),
                });
            }
        }
        Ok(())
    }

    /// `v`, `v/t`, `v//n` or `v/t/n`.
    fn corner(&mut self, word: &[u8], line: usize) -> Result<Corner, ImportErrorKind> {
        let bad = || ImportErrorKind::BadNumber {
            what: "a face corner, v/vt/vn".into(),
            text: String::from_utf8_lossy(word).into_owned(),
        };
        let tables = [
            (Table::Position, self.positions.len()),
            (Table::Texcoord, self.texcoords.len()),
            (Table::Normal, self.normals.len()),
        ];
        let mut found = [None; 3];
        let mut fields = word.split(|&byte| byte == b'/');
        for (found, (table, count)) in found.iter_mut().zip(tables) {
            let field = fields.next().unwrap_or_default();
            if field.is_empty() {
                continue;
            }
            let index = integer(field).ok_or_else(bad)?;
            let zero_based = if index < 0 {
                index + count as i64
            } else {
                index - 1
            };
            let beyond = || ImportErrorKind::BadIndex {
                what: table.noun().into(),
                index,
                count: count as u64,
            };
            let zero_based = u32::try_from(zero_based).map_err(|_| beyond())?;
            let furthest = &mut self.furthest[table as usize];
            if zero_based >= furthest.0 {
                *furthest = (zero_based, line);
            }
            *found = Some(zero_based);
        }
        if fields.next().is_some() {
            return Err(bad());
        }
        Ok(Corner {
            vertex: found[0].ok_or_else(bad)?,
            texcoord: found[1],
            normal: found[2],
        })
    }

    /// Whether there is a mesh, and whether every index means something.
    pub fn check_references(&self) -> Result<(), (Place, ImportErrorKind)> {
        if self.positions.is_empty() {
            return Err(match &self.unknown {
                Some((line, found, _)) => {
                    let kind = ImportErrorKind::NotThisFormat {
                        expected: "an OBJ file",
                        found: format!("the word {found}"),
                    };
                    (Place::Line(*line), kind)
                }
                None => {
                    let what = "every vertex (v line)".to_owned();
                    (Place::File, ImportErrorKind::Missing { what })
                }
            });
        }
        if self.parts.iter().all(|part| part.corners.is_empty()) {
            let what = "every face (f line)".to_owned();
            return Err((Place::File, ImportErrorKind::Missing { what }));
        }
        let tables = [
            (Table::Position, self.positions.len()),
            (Table::Texcoord, self.texcoords.len()),
            (Table::Normal, self.normals.len()),
        ];
        for ((table, count), (index, line)) in tables.into_iter().zip(self.furthest) {
            // Line 0 is of a table that no face refers to. A table that is absent as a whole is
            // one that the exporter was told to leave out.
            let absent = count == 0 && !matches!(table, Table::Position);
            if line > 0 && index as usize >= count && !absent {
                let kind = ImportErrorKind::BadIndex {
                    what: table.noun().into(),
                    index: i64::from(index) + 1,
                    count: count as u64,
                };
                return Err((Place::Line(line), kind));
            }
        }
        Ok(())
    }
}

/// Up to `N` numbers, of which `needed` must be there, and whether more follow.
fn numbers<const N: usize>(
    rest: &[u8],
    needed: usize,
    noun: &str,
) -> Result<([f64; N], bool), ImportErrorKind> {
    let mut values = [0.0; N];
    let mut words = words(rest).take_while(|word| !word.starts_with(b"#"));
    for (index, value) in values.iter_mut().enumerate() {
        let what = || format!("value {} of a {noun}", index + 1);
        match words.next() {
            Some(word) => *value = number(word, what)?,
            None if index < needed => return Err(ImportErrorKind::Missing { what: what() }),
            None => break,
        }
    }
    Ok((values, words.next().is_some()))
}

/// A decimal integer.
fn integer(bytes: &[u8]) -> Option<i64> {
    std::str::from_utf8(bytes).ok()?.parse().ok()
}
