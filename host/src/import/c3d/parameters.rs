//! The parameter section: named values in named groups.
//!
//! Enters: the bytes from the parameter header to the data. Leaves: every entry that can be made
//! out. Real files break most rules of the section, so that nothing here fails: an entry whose
//! value does not fit is kept as far as it goes and reported (C3D User Guide, "The Parameter
//! Section").

use super::bytes::{ByteOrder, Bytes, text};

/// A parameter section holds at most 255 blocks of 512 bytes.
pub(super) const MAX_SECTION: usize = 255 * 512;

/// All groups and parameters of a file.
pub(super) struct Parameters<'a> {
    order: ByteOrder,
    /// (number, name).
    groups: Vec<(u8, String)>,
    entries: Vec<Entry<'a>>,
    /// What does not obey the format: offset and text.
    pub faults: Vec<(usize, String)>,
    /// First byte after the last entry.
    pub end: usize,
}

/// One parameter as stored.
struct Entry<'a> {
    group: u8,
    name: String,
    offset: usize,
    kind: i8,
    dimensions: &'a [u8],
    value: &'a [u8],
}

/// One parameter with the byte order needed to read it.
#[derive(Clone, Copy)]
pub(super) struct Parameter<'a> {
    order: ByteOrder,
    kind: i8,
    dimensions: &'a [u8],
    value: &'a [u8],
    /// Where its entry begins.
    pub offset: usize,
}

impl<'a> Parameters<'a> {
    /// Reads entries from `start` (after the four header bytes) and stops at `limit`.
    ///
    /// Linear in `limit - start`.
    pub(super) fn read(bytes: Bytes<'a>, order: ByteOrder, start: usize, limit: usize) -> Self {
        let limit = limit
            .min(bytes.data.len())
            .min(start.saturating_add(MAX_SECTION));
        let mut this = Self {
            order,
            groups: Vec::new(),
            entries: Vec::new(),
            faults: Vec::new(),
            end: start,
        };
        let mut at = start;
        while let Some(next) = this.read_entry(&bytes.data[..limit], at) {
            at = next;
        }
        this.report_repeats();
        this
    }

    /// Reads the entry at `at`; gives where the next one begins, `None` after the last.
    fn read_entry(&mut self, section: &'a [u8], at: usize) -> Option<usize> {
        // A negative length only says that the entry is locked.
        let name_len = usize::from((*section.get(at)? as i8).unsigned_abs());
        if name_len == 0 {
            self.end = at + 1;
            return None;
        }
        let cut = |this: &mut Self| {
            this.faults
                .push((at, "the section ends inside an entry".into()));
            None
        };
        let Some(id) = section.get(at + 1).map(|byte| *byte as i8) else {
            return cut(self);
        };
        let pointer = at + 2 + name_len;
        let (Some(name), Some(step)) = (
            section.get(at + 2..pointer),
            section
                .get(pointer..pointer + 2)
                .and_then(<[u8]>::first_chunk),
        ) else {
            return cut(self);
        };
        let name = text(name);
        let step = usize::from(self.order.word(*step));
        // The step counts from its own first byte; 0 marks the last entry.
        let next = pointer + step;
        let body_end = if step == 0 {
            section.len()
        } else {
            next.min(section.len())
        };
        let body = section.get(pointer + 2..body_end).unwrap_or(&[]);
        self.end = body_end;
        if next > section.len() {
            self.faults
                .push((at, format!("{name} points behind the section")));
        }
        match id {
            0 => self.faults.push((at, format!("{name} has group number 0"))),
            i8::MIN..0 => self.groups.push((id.unsigned_abs(), name)),
            1..=i8::MAX => self.keep(at, id as u8, name, body),
        }
        (step != 0).then_some(next)
    }

    fn keep(&mut self, offset: usize, group: u8, name: String, body: &'a [u8]) {
        let (Some(kind), Some(rank)) = (body.first(), body.get(1)) else {
            self.faults.push((offset, format!("{name} has no value")));
            return;
        };
        let kind = *kind as i8;
        let rank = usize::from(*rank);
        let Some(dimensions) = body.get(2..2 + rank) else {
            self.faults.push((
                offset,
                format!("{name} has {rank} dimensions, which do not fit"),
            ));
            return;
        };
        if !matches!(kind, -1 | 1 | 2 | 4) {
            self.faults
                .push((offset, format!("{name} has the unknown type {kind}")));
            return;
        }
        let rest = &body[2 + rank..];
        let size = dimensions
            .iter()
            .fold(usize::from(kind.unsigned_abs()), |size, side| {
                size.saturating_mul(usize::from(*side))
            });
        let value = &rest[..size.min(rest.len())];
        if value.len() < size {
            self.faults.push((
                offset,
                format!("{name} announces {size} bytes, {} are there", value.len()),
            ));
        } else if rest.len() == size && size > 0 {
            // The step is trusted over the description, whose length byte some writers leave out.
            self.faults
                .push((offset, format!("{name} has no description length")));
        }
        self.entries.push(Entry {
            group,
            name,
            offset,
            kind,
            dimensions,
            value,
        });
    }

    /// A name that occurs twice with different values in one group.
    fn report_repeats(&mut self) {
        let mut order: Vec<usize> = (0..self.entries.len()).collect();
        let key = |entry: &Entry| (entry.group, entry.name.to_ascii_uppercase());
        order.sort_by_cached_key(|index| (key(&self.entries[*index]), *index));
        for pair in order.windows(2) {
            let [first, second] = [&self.entries[pair[0]], &self.entries[pair[1]]];
            if key(first) == key(second) && first.value != second.value {
                let fault = format!("{} stands here a second time: this one counts", second.name);
                self.faults.push((second.offset, fault));
            }
        }
    }

    /// The parameter `group:name`, the last one where it is repeated.
    pub(super) fn find(&self, group: &str, name: &str) -> Option<Parameter<'a>> {
        let entry = self.entries.iter().rev().find(|entry| {
            entry.name.eq_ignore_ascii_case(name)
                && self.groups.iter().any(|(number, group_name)| {
                    *number == entry.group && group_name.eq_ignore_ascii_case(group)
                })
        })?;
        Some(Parameter {
            order: self.order,
            kind: entry.kind,
            dimensions: entry.dimensions,
            value: entry.value,
            offset: entry.offset,
        })
    }

    /// True if the group is there.
    pub(super) fn has_group(&self, group: &str) -> bool {
        self.groups
            .iter()
            .any(|(_, name)| name.eq_ignore_ascii_case(group))
    }

    /// Texts of `name`, `name2`, `name3` and so on, one after another.
    pub(super) fn texts(&self, group: &str, name: &str) -> Vec<String> {
        let mut all = Vec::new();
        for number in 1.. {
            let part = match number {
                1 => self.find(group, name),
                _ => self.find(group, &format!("{name}{number}")),
            };
            match part {
                Some(part) => all.extend(part.texts()),
                None => break,
            }
        }
        all
    }
}

impl Parameter<'_> {
    /// Number `index`, whatever numeric type it is stored as.
    pub(super) fn number(&self, index: usize) -> Option<f64> {
        match self.kind {
            1 => self.value.get(index).map(|byte| f64::from(*byte as i8)),
            2 => self
                .chunk(index)
                .map(|bytes| f64::from(self.order.integer(bytes))),
            4 => self.chunk(index).map(|bytes| self.order.real(bytes)),
            _ => None,
        }
    }

    /// Number `index` as a count: 16-bit integers are unsigned, reals must be whole.
    pub(super) fn count(&self, index: usize) -> Option<u64> {
        match self.kind {
            1 => self.value.get(index).map(|byte| u64::from(*byte)),
            2 => self
                .chunk(index)
                .map(|bytes| u64::from(self.order.word(bytes))),
            4 => self
                .chunk(index)
                .map(|bytes| self.order.real(bytes))
                .filter(|value| (0.0..4e9).contains(value) && value.fract() == 0.0)
                .map(|value| value as u64),
            _ => None,
        }
    }

    /// All texts; empty where the parameter is not text or its texts have no letters.
    pub(super) fn texts(&self) -> Vec<String> {
        if self.kind != -1 {
            return Vec::new();
        }
        let letters = self.dimensions.first().map_or(1, |side| usize::from(*side));
        if letters == 0 {
            return Vec::new();
        }
        self.value.chunks_exact(letters).map(text).collect()
    }

    fn chunk<const N: usize>(&self, index: usize) -> Option<[u8; N]> {
        self.value
            .get(index.checked_mul(N)?..)?
            .first_chunk()
            .copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Group 1 POINT, then the given entries, then the end mark.
    fn section(entries: &[&[u8]]) -> Vec<u8> {
        let mut bytes = vec![5, 0xff];
        bytes.extend(b"POINT\x03\x00\x00");
        for entry in entries {
            bytes.extend(*entry);
        }
        bytes.push(0);
        bytes
    }

    fn read(data: &[u8]) -> Parameters<'_> {
        let bytes = Bytes { data, skipped: 0 };
        Parameters::read(bytes, ByteOrder::Intel, 0, data.len())
    }

    #[test]
    fn a_plain_entry_a_locked_one_and_one_without_description_length() {
        let data = section(&[
            b"\x04\x01USED\x07\x00\x02\x00\x1a\x00\x00",
            b"\xfb\x01UNITS\x0a\x00\xff\x01\x04mm  \x00",
            b"\x06\x01LABELS\x0c\x00\xff\x02\x03\x02AB CD ",
        ]);
        let parameters = read(&data);
        assert_eq!(parameters.find("point", "used").unwrap().count(0), Some(26));
        assert_eq!(parameters.find("POINT", "UNITS").unwrap().texts(), ["mm"]);
        assert_eq!(parameters.texts("POINT", "LABELS"), ["AB", "CD"]);
        assert!(parameters.find("POINT", "SCALE").is_none());
        assert_eq!(parameters.faults.len(), 1, "{:?}", parameters.faults);
        assert_eq!(parameters.end, data.len());
    }

    #[test]
    fn the_last_of_two_counts_and_a_value_that_is_too_long_is_cut() {
        let data = section(&[
            b"\x04\x01USED\x07\x00\x02\x00\x1a\x00\x00",
            b"\x04\x01used\x07\x00\x02\x00\x1b\x00\x00",
            b"\x05\x01UNITS\x0a\x00\xff\x02\x04\x20mm  ",
        ]);
        let parameters = read(&data);
        assert_eq!(parameters.find("POINT", "USED").unwrap().count(0), Some(27));
        assert_eq!(parameters.find("POINT", "UNITS").unwrap().texts(), ["mm"]);
        assert_eq!(parameters.faults.len(), 2, "{:?}", parameters.faults);
    }

    #[test]
    fn numbers_of_every_type_and_texts_without_letters() {
        let data = section(&[
            b"\x01\x01A\x06\x00\x01\x00\xff\x00",
            b"\x01\x01B\x07\x00\x02\x00\xff\xff\x00",
            b"\x01\x01C\x09\x00\x04\x00\x00\x00\x48\x42\x00",
            b"\x01\x01D\x0c\x00\xff\x07\x00\xff\xff\xff\xff\xff\xff\x00",
        ]);
        let parameters = read(&data);
        let find = |name| parameters.find("POINT", name).unwrap();
        assert_eq!(
            (find("A").number(0), find("A").count(0)),
            (Some(-1.0), Some(255))
        );
        assert_eq!(
            (find("B").number(0), find("B").count(0)),
            (Some(-1.0), Some(65535))
        );
        assert_eq!(
            (find("C").number(0), find("C").count(0)),
            (Some(50.0), Some(50))
        );
        assert_eq!(find("C").number(1), None);
        assert!(find("D").texts().is_empty());
        assert!(find("A").texts().is_empty());
    }

    #[test]
    fn a_section_cut_anywhere_gives_what_is_there() {
        let data = section(&[
            b"\x04\x01USED\x07\x00\x02\x00\x1a\x00\x00",
            b"\x06\x01LABELS\x0c\x00\xff\x02\x03\x02AB CD ",
        ]);
        for len in 0..data.len() {
            let parameters = read(&data[..len]);
            assert!(parameters.end <= len.max(1));
            if len >= 22 {
                assert_eq!(
                    parameters.find("POINT", "USED").unwrap().count(0),
                    Some(26),
                    "{len}"
                );
            }
        }
    }
}
