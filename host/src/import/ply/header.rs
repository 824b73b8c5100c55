//! The header: format, elements and their properties.

use super::super::text::{Lines, excerpt, trim, words};
use super::super::{ImportErrorKind, Place};
use super::Fault;

/// More elements or properties than any program writes.
const MOST_NAMES: u64 = 1000;

/// How the values are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Text,
    Little,
    Big,
}

/// A number's type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub name: String,
    pub kind: Kind,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
    line: usize,
}

/// Where coordinates stand among a vertex's properties.
pub(super) struct VertexPlaces {
    pub position: [usize; 3],
    pub normal: Option<[usize; 3]>,
}

impl Element {
    pub fn vertex_places(&self) -> Result<VertexPlaces, Fault> {
        let find = |name: &str| {
            self.properties
                .iter()
                .position(|p| p.name == name && matches!(p.kind, Kind::Scalar(_)))
        };
        let all = |names: [&str; 3]| Some([find(names[0])?, find(names[1])?, find(names[2])?]);
        let what = || "a property x, y or z of the vertices".to_owned();
        let missing = || {
            (
                Place::Line(self.line),
                ImportErrorKind::Missing { what: what() },
            )
        };
        Ok(VertexPlaces {
            position: all(["x", "y", "z"]).ok_or_else(missing)?,
            normal: all(["nx", "ny", "nz"]),
        })
    }

    /// Bytes that a row takes at least; two a value in text, but for the last one.
    fn smallest_row(&self, format: Format) -> usize {
        let smallest = |property: &Property| match (format, property.kind) {
            (Format::Text, _) => 2,
            (_, Kind::Scalar(scalar)) => scalar.bytes(),
            (_, Kind::List { count, .. }) => count.bytes(),
        };
        self.properties.iter().map(smallest).sum()
    }
}

pub(super) struct Header {
    pub format: Format,
    pub elements: Vec<Element>,
    /// Where values start.
    pub bytes: usize,
    /// Lines of the header.
    pub lines: usize,
}

impl Header {
    pub fn read(bytes: &[u8]) -> Result<Self, Fault> {
        if bytes.is_empty() {
            return Err((Place::File, ImportErrorKind::Empty));
        }
        let mut lines = Lines::new(bytes, 1);
        let first = lines.next().map_or(&[][..], |(_, line)| trim(line));
        if first != b"ply" {
            let kind = ImportErrorKind::NotThisFormat {
                expected: "a PLY file",
                found: excerpt(first),
            };
            return Err((Place::File, kind));
        }
        let mut format = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut names = 0;
        for (number, line) in lines {
            let place = Place::Line(number);
            let mut statement = words(line);
            match statement.next() {
                None | Some(b"comment" | b"obj_info") => {}
                Some(b"end_header") => {
                    let format = format.ok_or_else(|| missing(place, "the line `format`"))?;
                    let end = end_of_line(bytes, number);
                    return Ok(Self {
                        format,
                        elements,
                        bytes: end,
                        lines: number,
                    });
                }
                Some(b"format") => {
                    format = Some(match statement.next() {
                        Some(b"ascii") => Format::Text,
                        Some(b"binary_little_endian") => Format::Little,
                        Some(b"binary_big_endian") => Format::Big,
                        other => {
                            let what = format!("format {}", excerpt(other.unwrap_or_default()));
                            return Err((place, ImportErrorKind::Unsupported { what }));
                        }
                    });
                }
                Some(b"element") => {
                    names += 1;
                    elements.push(element(&mut statement, number)?);
                }
                Some(b"property") => {
                    names += 1;
                    let Some(element) = elements.last_mut() else {
                        return Err(missing(place, "the element of a property"));
                    };
                    element.properties.push(property(&mut statement, number)?);
                }
                Some(other) => {
                    let what = format!("the header line {}", excerpt(other));
                    return Err((place, ImportErrorKind::Unsupported { what }));
                }
            }
            if names > MOST_NAMES {
                let kind = ImportErrorKind::TooMany {
                    what: "elements and properties".into(),
                    count: names,
                    limit: MOST_NAMES,
                };
                return Err((Place::Line(number), kind));
            }
        }
        Err(missing(Place::File, "the line `end_header`"))
    }

    /// Whether the rest of the file can hold an element's rows.
    pub fn fits(&self, element: &Element, remaining: usize) -> Result<(), Fault> {
        let row = element.smallest_row(self.format);
        let needed = (element.count as u64).saturating_mul(row as u64);
        // The last value of a text need not be followed by anything.
        if needed <= remaining as u64 + 1 {
            return Ok(());
        }
        let kind = ImportErrorKind::Truncated {
            what: format!("the element {} (bytes)", element.name),
            needed,
            found: remaining as u64,
        };
        Err((Place::Line(element.line), kind))
    }
}

fn missing(place: Place, what: &str) -> Fault {
    let what = what.to_owned();
    (place, ImportErrorKind::Missing { what })
}

fn end_of_line(bytes: &[u8], line: usize) -> usize {
    let mut rest = Lines::new(bytes, 1);
    let mut end = 0;
    for _ in 0..line {
        if let Some((_, text)) = rest.next() {
            end += text.len();
            end += match bytes.get(end..) {
                Some([b'\r', b'\n', ..]) => 2,
                Some([_, ..]) => 1,
                _ => 0,
            };
        }
    }
    end
}

fn element<'a>(
    statement: &mut impl Iterator<Item = &'a [u8]>,
    line: usize,
) -> Result<Element, Fault> {
    let name = statement.next().unwrap_or_default();
    let count = statement.next().unwrap_or_default();
    let text = String::from_utf8_lossy(count).into_owned();
    let what = format!("the count of {}", excerpt(name));
    let count = text.parse::<u32>().map_err(|_| {
        let kind = ImportErrorKind::BadNumber { what, text };
        (Place::Line(line), kind)
    })?;
    Ok(Element {
        name: String::from_utf8_lossy(name).into_owned(),
        count: count as usize,
        properties: Vec::new(),
        line,
    })
}

fn property<'a>(
    statement: &mut impl Iterator<Item = &'a [u8]>,
    line: usize,
) -> Result<Property, Fault> {
    let scalar = |word: Option<&[u8]>| {
        let word = word.unwrap_or_default();
        Scalar::parse(word).ok_or_else(|| {
            let what = format!("the property type {}", excerpt(word));
            (Place::Line(line), ImportErrorKind::Unsupported { what })
        })
    };
    let kind = match statement.next() {
        Some(b"list") => Kind::List {
            count: scalar(statement.next())?,
            item: scalar(statement.next())?,
        },
        word => Kind::Scalar(scalar(word)?),
    };
    let name = statement.next();
    let name = name.ok_or_else(|| missing(Place::Line(line), "the name of a property"))?;
    Ok(Property {
        name: String::from_utf8_lossy(name).into_owned(),
        kind,
    })
}
