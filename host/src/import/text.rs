//! What the readers of text formats share: line ends, words and numbers, straight from bytes.

use super::{ImportErrorKind, Notice, Place};

/// Larger magnitudes are damage: no length or angle of a recording comes near it, and the limit
/// keeps every later product finite.
pub(super) const MAX_MAGNITUDE: f64 = 1e12;

/// Checks that `bytes` can be text, and takes a byte order mark off.
///
/// # Errors
/// [`ImportErrorKind::Empty`] for white space only; [`ImportErrorKind::NotThisFormat`] for UTF-16.
pub(super) fn text_of<'a>(
    bytes: &'a [u8],
    expected: &'static str,
) -> Result<&'a [u8], ImportErrorKind> {
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        let found = "UTF-16 text; save it as UTF-8".to_owned();
        return Err(ImportErrorKind::NotThisFormat { expected, found });
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    if bytes.iter().all(|&byte| is_space(byte)) {
        return Err(ImportErrorKind::Empty);
    }
    Ok(bytes)
}

/// The start of `bytes`, fit to be shown in a message.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    const SHOWN: usize = 24;
    let shown = bytes.get(..SHOWN).unwrap_or(bytes);
    let more = if bytes.len() > SHOWN { "…" } else { "" };
    format!("\"{}{more}\"", shown.escape_ascii())
}

/// White space, line ends included.
pub(super) fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | 0x0B | 0x0C)
}

/// White space taken off both ends.
pub(super) fn trim(mut bytes: &[u8]) -> &[u8] {
    while let [first, rest @ ..] = bytes
        && is_space(*first)
    {
        bytes = rest;
    }
    while let [rest @ .., last] = bytes
        && is_space(*last)
    {
        bytes = rest;
    }
    bytes
}

/// The parts of a line between white space.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|&byte| is_space(byte))
        .filter(|word| !word.is_empty())
}

/// Physical lines with their one-based numbers; LF, CR LF and a lone CR all end one.
#[derive(Clone)]
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
    /// Whether the line given last had an end, which a file that was cut lacks.
    pub(super) ended: bool,
}

impl<'a> Lines<'a> {
    /// `first` is the number of the first line of `bytes`.
    pub(super) fn new(bytes: &'a [u8], first: usize) -> Self {
        Self {
            rest: bytes,
            number: first,
            ended: true,
        }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let number = self.number;
        self.number += 1;
        let end = self.rest.iter().position(|b| matches!(b, b'\n' | b'\r'));
        let Some(end) = end else {
            self.ended = false;
            return Some((number, std::mem::take(&mut self.rest)));
        };
        let (line, tail) = self.rest.split_at(end);
        self.rest = tail.strip_prefix(b"\r\n").unwrap_or(&tail[1..]);
        Some((number, line))
    }
}

/// Reads a number that must be finite; `what` names it in the error.
///
/// # Errors
/// [`ImportErrorKind::BadNumber`], [`ImportErrorKind::NotFinite`] (also for what C libraries
/// print, such as `-1.#IND`) and [`ImportErrorKind::OutOfRange`] beyond [`MAX_MAGNITUDE`].
#[inline]
pub(super) fn number(word: &[u8], what: impl Fn() -> String) -> Result<f64, ImportErrorKind> {
    let value = plain_decimal(word).or_else(|| {
        let text = std::str::from_utf8(word).ok()?;
        text.parse::<f64>().ok()
    });
    match value {
        Some(value) if value.abs() <= MAX_MAGNITUDE => Ok(value),
        _ => Err(number_fault(word, value, what())),
    }
}

/// Digits with at most one point, few enough that mantissa and power of ten are exact and one
/// division rounds correctly (Clinger 1990); this is nearly every number of a real file.
#[inline]
fn plain_decimal(word: &[u8]) -> Option<f64> {
    const EXACT_DIGITS: usize = 15;
    const POWERS: [f64; EXACT_DIGITS + 1] = [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
    ];
    let (negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    if digits.len() > EXACT_DIGITS + 1 {
        return None;
    }
    let mut mantissa = 0_u64;
    let mut count = 0;
    let mut before_point = None;
    for &byte in digits {
        match byte {
            b'0'..=b'9' => {
                mantissa = 10 * mantissa + u64::from(byte - b'0');
                count += 1;
            }
            b'.' if before_point.is_none() => before_point = Some(count),
            _ => return None,
        }
    }
    if count == 0 || count > EXACT_DIGITS {
        return None;
    }
    let size = mantissa as f64 / POWERS[count - before_point.unwrap_or(count)];
    Some(if negative { -size } else { size })
}

#[cold]
fn number_fault(word: &[u8], value: Option<f64>, what: String) -> ImportErrorKind {
    let text = String::from_utf8_lossy(word).into_owned();
    match value {
        Some(value) if value.is_finite() => ImportErrorKind::OutOfRange {
            what,
            value: text,
            expected: format!("between -{MAX_MAGNITUDE:e} and {MAX_MAGNITUDE:e}"),
        },
        Some(_) => ImportErrorKind::NotFinite { what },
        None => {
            let lower = text.to_ascii_lowercase();
            if lower.contains("#ind") || lower.contains("nan") || lower.contains("#inf") {
                return ImportErrorKind::NotFinite { what };
            }
            let what = if is_comma_decimal(word) {
                format!("{what}; the decimal sign must be a point, not a comma")
            } else {
                what
            };
            ImportErrorKind::BadNumber { what, text }
        }
    }
}

fn is_comma_decimal(word: &[u8]) -> bool {
    word.contains(&b',')
        && word
            .iter()
            .all(|b| matches!(b, b'0'..=b'9' | b',' | b'.' | b'-' | b'+' | b'e' | b'E'))
}

/// Turns names into text, and remembers which were not UTF-8.
#[derive(Default)]
pub(super) struct Names {
    repaired: usize,
    first: Option<(usize, String)>,
}

impl Names {
    /// The name, each invalid byte sequence replaced by U+FFFD.
    pub(super) fn read(&mut self, bytes: &[u8], line: usize) -> String {
        let name = String::from_utf8_lossy(bytes);
        if let std::borrow::Cow::Owned(name) = &name {
            self.repaired += 1;
            self.first.get_or_insert_with(|| (line, name.clone()));
        }
        name.into_owned()
    }

    /// Says what was repaired.
    pub(super) fn notice(self, notices: &mut Vec<Notice>) {
        if let Some((line, name)) = self.first {
            let text = format!(
                "{} names are not UTF-8; their unreadable bytes are replaced, as in {name:?}",
                self.repaired
            );
            notices.push(Notice::new(Place::Line(line), text));
        }
    }
}

/// The file's name without folder and ending.
pub(super) fn file_stem(file: &str) -> String {
    let stem = std::path::Path::new(file).file_stem();
    stem.map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// Checks a length unit that the caller states.
///
/// # Errors
/// [`ImportErrorKind::OutOfRange`].
pub(super) fn check_unit(unit_metres: f64) -> Result<f64, ImportErrorKind> {
    if (1e-9..=1e9).contains(&unit_metres) {
        return Ok(unit_metres);
    }
    Err(ImportErrorKind::OutOfRange {
        what: "the stated length unit in metres".into(),
        value: unit_metres.to_string(),
        expected: "between 1e-9 and 1e9".into(),
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A small repeatable generator (Marsaglia's xorshift) for damage.
    pub struct Random(pub u64);

    impl Random {
        /// Less than `limit`.
        pub fn below(&mut self, limit: usize) -> usize {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 % limit as u64) as usize
        }
    }

    #[test]
    fn every_line_end_counts_once() {
        let lines: Vec<_> = Lines::new(b"a\r\nb\rc\n\nd", 1).collect();
        let expected: [(usize, &[u8]); 5] = [(1, b"a"), (2, b"b"), (3, b"c"), (4, b""), (5, b"d")];
        assert_eq!(lines, expected);
    }

    #[test]
    fn an_unended_last_line_is_known() {
        let mut lines = Lines::new(b"a\nb", 1);
        lines.next();
        assert!(lines.ended);
        lines.next();
        assert!(!lines.ended);
    }

    #[test]
    fn numbers_are_finite_and_of_sane_size() {
        let read = |word: &[u8]| number(word, || "w".into());
        assert_eq!(read(b"-1.5e+01"), Ok(-15.0));
        assert_eq!(read(b".0083333"), Ok(0.008_333_3));
        let what = || "w".to_owned();
        for word in ["nan", "-inf", "1e999", "-1.#IND", "1.#QNAN", "-nan(ind)"] {
            let expected = ImportErrorKind::NotFinite { what: what() };
            assert_eq!(read(word.as_bytes()), Err(expected), "{word}");
        }
        let huge = read(b"1e13");
        assert!(matches!(huge, Err(ImportErrorKind::OutOfRange { .. })));
        let comma = read(b"1,5").expect_err("a comma is no decimal point");
        assert!(comma.to_string().contains("not a comma"), "{comma}");
        let word = read(b"\xFF").expect_err("not text");
        assert!(matches!(word, ImportErrorKind::BadNumber { .. }));
    }

    #[test]
    fn the_short_way_gives_the_same_bits() {
        let mut random = Random(3);
        for _ in 0..20_000 {
            let digits = 1 + random.below(16);
            let mut text: String = (0..digits)
                .map(|_| char::from(b"0123456789"[random.below(10)]))
                .collect();
            if random.below(4) > 0 {
                text.insert(random.below(digits + 1), '.');
            }
            if random.below(2) > 0 {
                text.insert(0, '-');
            }
            let expected: f64 = text.parse().expect("a number");
            let read = plain_decimal(text.as_bytes());
            assert!(digits > 15 || read.is_some(), "{text}");
            assert!(
                read.is_none_or(|value| value.to_bits() == expected.to_bits()),
                "{text}"
            );
        }
        for word in ["", "-", ".", "-.", "1.2.3", "1e3", "--1", "+1"] {
            assert_eq!(plain_decimal(word.as_bytes()), None, "{word}");
        }
    }

    #[test]
    fn utf16_and_blank_files_are_refused() {
        assert_eq!(text_of(b" \r\n", "x"), Err(ImportErrorKind::Empty));
        assert_eq!(text_of(b"\xEF\xBB\xBF", "x"), Err(ImportErrorKind::Empty));
        assert!(text_of(b"\xFF\xFEH\0", "x").is_err());
        assert_eq!(text_of(b"\xEF\xBB\xBFv", "x"), Ok(&b"v"[..]));
    }
}
