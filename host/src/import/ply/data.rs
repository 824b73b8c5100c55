//! Values after the header, in the file's own way of writing them.

use super::super::text::{Lines, is_space, number, words};
use super::super::{ImportErrorKind, Place};
use super::Fault;
use super::header::{Format, Header, Kind, Property, Scalar};

/// Corners of a face; more are damage.
const MOST_ITEMS: f64 = 1e6;

/// The values, one after another.
pub(super) struct Values<'a> {
    format: Format,
    total: usize,
    rest: &'a [u8],
    lines: Lines<'a>,
    line: usize,
    words: Vec<&'a [u8]>,
    next_word: usize,
}

impl<'a> Values<'a> {
    pub fn new(bytes: &'a [u8], header: &Header) -> Self {
        let rest = bytes.get(header.bytes..).unwrap_or_default();
        Self {
            format: header.format,
            total: bytes.len(),
            rest,
            lines: Lines::new(rest, header.lines + 1),
            line: header.lines,
            words: Vec::new(),
            next_word: 0,
        }
    }

    /// Bytes not yet read; in a text, those of whole lines not yet read.
    pub fn remaining(&self) -> usize {
        match self.format {
            Format::Text => self.lines.clone().map(|(_, line)| line.len() + 1).sum(),
            _ => self.rest.len(),
        }
    }

    pub fn only_space_left(&self) -> bool {
        self.format == Format::Text
            && self
                .lines
                .clone()
                .all(|(_, line)| line.iter().all(|&b| is_space(b)))
    }

    /// Where the value read last stands.
    pub fn place(&self) -> Place {
        match self.format {
            Format::Text => Place::Line(self.line),
            _ => Place::Byte((self.total - self.rest.len()) as u64),
        }
    }

    /// A row of a text is a line; empty lines and comments between rows are skipped.
    pub fn start_row(&mut self, element: &str, row: usize, count: usize) -> Result<(), Fault> {
        if self.format != Format::Text {
            return Ok(());
        }
        for (number, line) in self.lines.by_ref() {
            self.line = number;
            self.words.clear();
            self.words.extend(words(line));
            self.next_word = 0;
            if !self.words.is_empty() && self.words[0] != b"comment" {
                return Ok(());
            }
        }
        let kind = ImportErrorKind::Truncated {
            what: format!("the element {element} (rows)"),
            needed: count as u64,
            found: row as u64,
        };
        Err((Place::Line(self.line), kind))
    }

    pub fn scalar(&mut self, scalar: Scalar, name: &str) -> Result<f64, Fault> {
        if self.format == Format::Text {
            let word = self.words.get(self.next_word);
            self.next_word += 1;
            let place = Place::Line(self.line);
            let missing = || ImportErrorKind::Missing {
                what: format!("the value of {name}"),
            };
            let word = word.ok_or_else(|| (place.clone(), missing()))?;
            return number(word, || name.to_owned()).map_err(|kind| (place, kind));
        }
        let size = scalar.bytes();
        let Some((bytes, rest)) = self.rest.split_at_checked(size) else {
            let kind = ImportErrorKind::Truncated {
                what: format!("the value of {name} (bytes)"),
                needed: size as u64,
                found: self.rest.len() as u64,
            };
            return Err((self.place(), kind));
        };
        self.rest = rest;
        let mut little = [0; 8];
        for (at, &byte) in bytes.iter().enumerate() {
            let at = if self.format == Format::Big {
                size - 1 - at
            } else {
                at
            };
            little[at] = byte;
        }
        let bits = u64::from_le_bytes(little);
        Ok(match scalar {
            Scalar::I8 => f64::from(bits as u8 as i8),
            Scalar::U8 => f64::from(bits as u8),
            Scalar::I16 => f64::from(bits as u16 as i16),
            Scalar::U16 => f64::from(bits as u16),
            Scalar::I32 => f64::from(bits as u32 as i32),
            Scalar::U32 => f64::from(bits as u32),
            Scalar::F32 => f64::from(f32::from_bits(bits as u32)),
            Scalar::F64 => f64::from_bits(bits),
        })
    }

    /// Hands over the items of a list.
    pub fn list(
        &mut self,
        property: &Property,
        mut take: impl FnMut(f64) -> Result<(), ImportErrorKind>,
    ) -> Result<(), Fault> {
        let Kind::List { count, item } = property.kind else {
            return self.scalar_as_item(property, take);
        };
        let length = self.scalar(count, &property.name)?;
        if !(0.0..=MOST_ITEMS).contains(&length) || length.fract() != 0.0 {
            let kind = ImportErrorKind::OutOfRange {
                what: format!("the length of a list {}", property.name),
                value: length.to_string(),
                expected: format!("a whole number from 0 to {MOST_ITEMS}"),
            };
            return Err((self.place(), kind));
        }
        for _ in 0..length as usize {
            let value = self.scalar(item, &property.name)?;
            take(value).map_err(|kind| (self.place(), kind))?;
        }
        Ok(())
    }

    fn scalar_as_item(
        &mut self,
        property: &Property,
        mut take: impl FnMut(f64) -> Result<(), ImportErrorKind>,
    ) -> Result<(), Fault> {
        let Kind::Scalar(scalar) = property.kind else {
            return Ok(());
        };
        let value = self.scalar(scalar, &property.name)?;
        take(value).map_err(|kind| (self.place(), kind))
    }
}
