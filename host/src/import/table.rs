//! What all text formats of marker data share: decoding, cells, rows, frame numbers, rate.

use std::borrow::Cow;

use super::take::{MISSING, RawTake, usable_rate};
use super::text::MAX_MAGNITUDE;
use super::{ImportError, ImportErrorKind, Notice, Place};

/// The content as text: UTF-8 or UTF-16 with or without a mark, else Latin-1.
pub(super) fn decode(content: &[u8]) -> Cow<'_, str> {
    if let Some(rest) = content.strip_prefix(b"\xff\xfe") {
        return utf16(rest, u16::from_le_bytes);
    }
    if let Some(rest) = content.strip_prefix(b"\xfe\xff") {
        return utf16(rest, u16::from_be_bytes);
    }
    let content = content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(content);
    match std::str::from_utf8(content) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => content.iter().map(|byte| char::from(*byte)).collect(),
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Cow<'static, str> {
    let (pairs, _) = bytes.as_chunks::<2>();
    let units = pairs.iter().map(|pair| unit(*pair));
    char::decode_utf16(units)
        .map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect()
}

/// Lines with their one-based numbers; ends are LF, CR LF or, without any LF, CR.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> + Clone {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    text.split(end)
        .map(|line| line.strip_suffix('\r').unwrap_or(line))
        .enumerate()
        .map(|(index, line)| (index + 1, line))
}

/// Fields of a CSV line, quotes removed, blanks around them too.
pub(super) fn csv_fields(line: &str) -> Vec<&str> {
    let mut fields = Vec::new();
    let mut rest = line;
    loop {
        let trimmed = rest.trim_start();
        let (field, end) = match trimmed
            .strip_prefix('"')
            .and_then(|inner| Some((inner, inner.find('"')?)))
        {
            Some((inner, close)) => (
                &inner[..close],
                inner[close + 1..]
                    .find(',')
                    .map(|at| &inner[close + 1 + at..]),
            ),
            None => match rest.find(',') {
                Some(comma) => (&rest[..comma], Some(&rest[comma..])),
                None => (rest, None),
            },
        };
        fields.push(field.trim());
        match end {
            Some(end) => rest = &end[1..],
            None => return fields,
        }
    }
}

/// A number, `None` for every way in which programs write a missing one, infinity for anything
/// beyond a real length or time.
///
/// # Errors
/// The text is neither.
pub(super) fn number(text: &str) -> Result<Option<f64>, ()> {
    let text = text.trim();
    if let Ok(value) = text.parse::<f64>() {
        let value = if value.abs() > MAX_MAGNITUDE {
            f64::INFINITY
        } else {
            value
        };
        return Ok((!value.is_nan()).then_some(value));
    }
    // `1.#QNAN` and the like come from old Microsoft libraries.
    let missing = text.is_empty()
        || text.contains('#')
        || ["nan", "-nan", "na", "n/a", "null", "none", "-", "--"]
            .iter()
            .any(|word| text.eq_ignore_ascii_case(word));
    if missing {
        return Ok(None);
    }
    if text.matches(',').count() == 1 && !text.contains('.') {
        return number(&text.replace(',', "."));
    }
    Err(())
}

/// Like [`number`], with the line at fault named.
///
/// # Errors
/// The text is neither a number nor a way to write a missing one.
pub(super) fn cell(
    text: &str,
    file: &str,
    line: usize,
    what: impl FnOnce() -> String,
) -> Result<Option<f64>, ImportError> {
    number(text).map_err(|()| {
        let text = text.trim().chars().take(40).collect();
        ImportErrorKind::BadNumber { what: what(), text }.at(file, Place::Line(line))
    })
}

/// Rows of a table of points, collected one by one.
pub(super) struct Rows<'f> {
    file: &'f str,
    points: usize,
    /// No real file needs more samples than it has bytes.
    budget: usize,
    frames: Vec<f64>,
    times: Vec<f64>,
    positions: Vec<[f64; 3]>,
    first_line: usize,
    partial: usize,
    absurd: usize,
    short: usize,
}

impl<'f> Rows<'f> {
    /// For a table of `points` points in a file of `bytes` bytes.
    pub(super) fn new(file: &'f str, points: usize, bytes: usize) -> Self {
        Self {
            file,
            points,
            budget: bytes,
            frames: Vec::new(),
            times: Vec::new(),
            positions: Vec::new(),
            first_line: 0,
            partial: 0,
            absurd: 0,
            short: 0,
        }
    }

    /// Adds a row whose points begin at the columns `columns` of `fields`; a missing frame number
    /// or time is NaN.
    ///
    /// # Errors
    /// A cell is not a number, or the rows hold more samples than the file has bytes.
    pub(super) fn push(
        &mut self,
        line: usize,
        (frame, time): (f64, f64),
        fields: &[&str],
        columns: impl Iterator<Item = [usize; 3]>,
        label: impl Fn(usize) -> String,
    ) -> Result<(), ImportError> {
        if self.positions.len() + self.points > self.budget {
            let kind = ImportErrorKind::TooMany {
                what: format!("samples of {} points a row", self.points),
                count: (self.positions.len() + self.points) as u64,
                limit: self.budget as u64,
            };
            return Err(kind.at(self.file, Place::Line(line)));
        }
        if self.frames.is_empty() {
            self.first_line = line;
        }
        let mut short = false;
        for (point, columns) in columns.enumerate() {
            let mut position = [None; 3];
            for (value, column) in position.iter_mut().zip(columns) {
                match fields.get(column) {
                    Some(text) => *value = cell(text, self.file, line, || label(point))?,
                    None => short = true,
                }
            }
            self.positions.push(match position {
                [Some(x), Some(y), Some(z)] if x.max(y).max(z).is_finite() => [x, y, z],
                [Some(_), Some(_), Some(_)] => {
                    self.absurd += 1;
                    MISSING
                }
                [None, None, None] => MISSING,
                _ => {
                    self.partial += 1;
                    MISSING
                }
            });
        }
        self.short += usize::from(short);
        self.frames.push(frame);
        self.times.push(time);
        Ok(())
    }

    /// How many rows there are.
    pub(super) fn len(&self) -> usize {
        self.frames.len()
    }

    /// A take of the rows, with frames that the numbering leaves out added as missing, and the
    /// frame rate that `stated` and the times give (NaN where neither does). The second value is
    /// the frame of each row.
    pub(super) fn finish(self, labels: Vec<String>, stated: Option<f64>) -> (RawTake, Vec<usize>) {
        let mut notices = Vec::new();
        if self.partial > 0 {
            let text = format!(
                "{} samples lack one or two coordinates: taken as missing",
                self.partial
            );
            notices.push(Notice::new(Place::File, text));
        }
        if self.absurd > 0 {
            let text = format!(
                "{} samples are infinite or absurdly far: taken as missing",
                self.absurd
            );
            notices.push(Notice::new(Place::File, text));
        }
        if self.short > 0 {
            let text = format!(
                "{} rows are too short: the rest taken as missing",
                self.short
            );
            notices.push(Notice::new(Place::File, text));
        }
        let rows = self.frames.len();
        let place = Place::Line(self.first_line.max(1));
        let frames = match number_frames(&self.frames) {
            Ok(frames) => frames,
            Err(why) => {
                notices.push(Notice::new(
                    place.clone(),
                    format!("{why}: rows taken as consecutive frames"),
                ));
                (0..rows).collect()
            }
        };
        let count = frames.last().map_or(0, |last| last + 1);
        if count > rows {
            let text = format!("{} frames are left out: added as missing", count - rows);
            notices.push(Notice::new(place.clone(), text));
        }
        let rate = rate(stated, &frames, &self.times, place, &mut notices);
        let mut take = RawTake::empty(labels, rate.unwrap_or(f64::NAN), 0);
        take.frame_count = count;
        take.positions = if count == rows {
            self.positions
        } else {
            let mut all = vec![MISSING; count * self.points];
            for (row, frame) in frames.iter().enumerate() {
                let (from, to) = (row * self.points, frame * self.points);
                all[to..to + self.points]
                    .copy_from_slice(&self.positions[from..from + self.points]);
            }
            all
        };
        take.first_frame = self
            .frames
            .first()
            .filter(|first| (0.0..=MAX_MAGNITUDE).contains(*first))
            .map_or(0, |first| *first as u64);
        take.notices = notices;
        (take, frames)
    }
}

/// Frame index of every row from the numbers in its first column.
///
/// # Errors
/// The numbers do not rise evenly, or leave out more frames than there are rows.
fn number_frames(numbers: &[f64]) -> Result<Vec<usize>, &'static str> {
    let steps = numbers.windows(2).map(|pair| pair[1] - pair[0]);
    let step = steps.clone().fold(f64::INFINITY, f64::min);
    if steps.clone().any(|step| step.is_nan() || step <= 0.0) {
        return Err("frame numbers do not rise");
    }
    if steps.clone().any(|other| (other / step).fract() != 0.0) {
        return Err("frame numbers do not rise evenly");
    }
    let mut frames = Vec::with_capacity(numbers.len());
    let mut frame = 0usize;
    frames.extend(numbers.first().map(|_| 0));
    for other in steps {
        let skip = other / step;
        if skip > 2.0 * numbers.len() as f64 {
            return Err("frame numbers leave out most frames");
        }
        frame += skip as usize;
        frames.push(frame);
    }
    if frame > 2 * numbers.len() {
        return Err("frame numbers leave out most frames");
    }
    Ok(frames)
}

/// The stated rate unless the times clearly tell another.
fn rate(
    stated: Option<f64>,
    frames: &[usize],
    times: &[f64],
    place: Place,
    notices: &mut Vec<Notice>,
) -> Option<f64> {
    let stated = stated.filter(|rate| usable_rate(*rate));
    let mut steps: Vec<f64> = frames
        .windows(2)
        .zip(times.windows(2))
        .map(|(frame, time)| (time[1] - time[0]) / (frame[1] - frame[0]) as f64)
        .filter(|step| *step > 0.0)
        .collect();
    steps.sort_by(f64::total_cmp);
    let middle = steps.get(steps.len() / 2).map(|step| 1.0 / step);
    let mean = match (times.first(), times.last(), frames.last()) {
        (Some(first), Some(last), Some(count)) => Some(*count as f64 / (last - first)),
        _ => None,
    };
    let (Some(middle), Some(mean)) = (middle, mean.filter(|rate| usable_rate(*rate))) else {
        return stated;
    };
    // Times are often rounded to milliseconds: only the mean is exact then, while the middle
    // one does not mind a last row that stands closer.
    let differs = |rate: f64, other: f64| (rate / other - 1.0).abs() > 0.1;
    match stated {
        Some(rate) if differs(middle, rate) && differs(mean, rate) && usable_rate(middle) => {
            let found = tidy(middle);
            let text =
                format!("a rate of {rate} Hz is stated, the times give {found} Hz: {found} taken");
            notices.push(Notice::new(place, text));
            Some(found)
        }
        Some(rate) => Some(rate),
        None => {
            let found = tidy(mean);
            notices.push(Notice::new(
                place,
                format!("no rate is stated: the times give {found} Hz"),
            ));
            Some(found)
        }
    }
}

/// Removes what the rounding of times adds to a rate.
fn tidy(rate: f64) -> f64 {
    let whole = rate.round();
    if (rate / whole - 1.0).abs() < 1e-6 {
        whole
    } else {
        (rate * 1e6).round() / 1e6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_any_encoding_is_read() {
        assert_eq!(decode(b"\xef\xbb\xbfa"), "a");
        assert_eq!(decode(b"\xff\xfea\0b\0"), "ab");
        assert_eq!(decode(b"\xfe\xff\0a\0b"), "ab");
        assert_eq!(decode(b"Kn\xf6chel"), "Knöchel");
        let numbered: Vec<_> = lines("a\r\nb\n\nc").collect();
        assert_eq!(numbered, [(1, "a"), (2, "b"), (3, ""), (4, "c")]);
        assert_eq!(lines("a\rb").count(), 2);
    }

    #[test]
    fn cells_are_numbers_or_missing() {
        for (text, value) in [
            ("1.5", Some(1.5)),
            (" -2.73E-01 ", Some(-0.273)),
            ("1,5", Some(1.5)),
            ("", None),
            ("NaN", None),
            ("nan", None),
            ("NAN", None),
            ("1.#QNAN", None),
            ("-1.#IND00", None),
            ("-inf", Some(f64::INFINITY)),
            ("1e999", Some(f64::INFINITY)),
            ("-2e12", Some(f64::INFINITY)),
        ] {
            assert_eq!(number(text), Ok(value), "{text}");
        }
        for text in ["x", "1.2.3", "1,2,3", "0x10"] {
            assert_eq!(number(text), Err(()), "{text}");
        }
    }

    #[test]
    fn csv_lines_are_split_at_commas_outside_quotes() {
        assert_eq!(csv_fields("a, b ,,"), ["a", "b", "", ""]);
        assert_eq!(csv_fields("\"a,b\",c"), ["a,b", "c"]);
        assert_eq!(csv_fields("\"open,c"), ["\"open", "c"]);
        assert_eq!(csv_fields(""), [""]);
        assert_eq!(csv_fields("\"a\"x,\"\""), ["a", ""]);
    }

    #[test]
    fn frame_numbers_give_indices_and_gaps() {
        assert_eq!(number_frames(&[5.0, 6.0, 8.0]), Ok(vec![0, 1, 3]));
        assert_eq!(number_frames(&[0.0, 10.0, 20.0]), Ok(vec![0, 1, 2]));
        assert_eq!(number_frames(&[7.0]), Ok(vec![0]));
        assert_eq!(number_frames(&[]), Ok(vec![]));
        assert!(number_frames(&[1.0, 1.0]).is_err());
        assert!(number_frames(&[1.0, f64::NAN, 3.0]).is_err());
        assert!(number_frames(&[1.0, 2.0, 1e15]).is_err());
        assert!(number_frames(&[1.0, 3.0, 6.0]).is_err());
    }

    #[test]
    fn the_rate_is_what_is_stated_unless_the_times_disagree() {
        let times = |step: f64| (0..20).map(|row| f64::from(row) * step).collect::<Vec<_>>();
        let frames: Vec<usize> = (0..20).collect();
        let mut notices = Vec::new();
        let mut rate =
            |stated, step| rate(stated, &frames, &times(step), Place::File, &mut notices);
        assert_eq!(rate(Some(250.0), 0.004), Some(250.0));
        assert_eq!(
            rate(Some(150.0), 0.007),
            Some(150.0),
            "rounded to milliseconds"
        );
        assert_eq!(rate(Some(250.0), 0.04), Some(25.0));
        assert_eq!(rate(None, 0.016667), Some(59.9988), "no more is known");
        assert_eq!(rate(None, 0.016_666_67), Some(60.0));
        assert_eq!(rate(Some(0.0), f64::NAN), None);
        assert_eq!(notices.len(), 3);
    }
}
