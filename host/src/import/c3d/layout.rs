//! Where the samples stand and how many there are.
//!
//! Enters: the header and the parameters, which often contradict each other. Leaves: one
//! [`Layout`] that lies within the file. The length of the file is the judge: of all combinations
//! of contradicting statements, the first whose samples end in the file's last block is taken.

use super::bytes::{ByteOrder, Bytes};
use super::parameters::Parameters;
use crate::import::{ImportError, ImportErrorKind, Notice};

/// Size of a block; all pointers of the format count blocks from 1.
pub(super) const BLOCK: usize = 512;

/// The first 24 bytes of the file, as stored.
pub(super) struct Header {
    points: u16,
    analog_words: u16,
    first_frame: u16,
    last_frame: u16,
    pub scale: f64,
    data_block: u16,
    samples_per_frame: u16,
    pub rate: f64,
}

impl Header {
    /// Reads the header, `None` where the file is shorter.
    pub(super) fn read(bytes: Bytes<'_>, order: ByteOrder) -> Option<Self> {
        let word = |offset| bytes.array(offset).map(|word| order.word(word));
        let real = |offset| bytes.array(offset).map(|real| order.real(real));
        Some(Self {
            points: word(2)?,
            analog_words: word(4)?,
            first_frame: word(6)?,
            last_frame: word(8)?,
            scale: real(12)?,
            data_block: word(16)?,
            samples_per_frame: word(18)?,
            rate: real(20)?,
        })
    }

    /// First byte of the data, `None` where the header does not say.
    pub(super) fn data_start(&self) -> Option<usize> {
        block_start(u64::from(self.data_block))
    }

    /// True if the numbers could come from a real file; tells byte orders apart.
    pub(super) fn is_plausible(&self, file_len: usize) -> bool {
        let rate = (1e-2..1e5).contains(&self.rate);
        rate && self.data_start().is_some_and(|start| start <= file_len)
    }
}

/// What to read, from where.
#[derive(Debug)]
pub(super) struct Layout {
    /// Real samples (4 bytes) or integers (2 bytes).
    pub real: bool,
    pub points: usize,
    /// Analog values that follow the points of each frame.
    pub analog_words: usize,
    /// Whole frames in the file.
    pub frames: usize,
    pub first_frame: u64,
    /// First byte of the data.
    pub start: usize,
    pub channel_count: u32,
    pub samples_per_frame: u32,
}

impl Layout {
    /// Bytes of one coordinate.
    pub(super) fn word(&self) -> usize {
        if self.real { 4 } else { 2 }
    }

    /// Bytes of one frame, points and analog values.
    pub(super) fn frame_bytes(&self) -> usize {
        (self.points * 4 + self.analog_words) * self.word()
    }
}

/// Statements about one number, the most trusted first, without repetition.
struct Claims<T> {
    what: &'static str,
    list: Vec<(T, &'static str)>,
}

impl<T: PartialEq + Copy + std::fmt::Display> Claims<T> {
    fn new(what: &'static str) -> Self {
        Self {
            what,
            list: Vec::new(),
        }
    }

    fn add(&mut self, value: Option<T>, source: &'static str) {
        if let Some(value) = value
            && self.list.iter().all(|(other, _)| *other != value)
        {
            self.list.push((value, source));
        }
    }

    fn report(&self, taken: T, bytes: Bytes<'_>, notices: &mut Vec<Notice>) {
        if self.list.len() > 1 {
            let all: Vec<String> = self
                .list
                .iter()
                .map(|(value, source)| format!("{source} says {value}"))
                .collect();
            let text = format!("{}: {}; {taken} taken", self.what, all.join(", "));
            notices.push(Notice::new(bytes.place(0), text));
        }
    }
}

/// Finds the layout.
///
/// # Errors
/// No points, frames or data position can be made out, or not one whole frame is there.
pub(super) fn find(
    bytes: Bytes<'_>,
    header: &Header,
    parameters: &Parameters<'_>,
    section_end: usize,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<Layout, ImportError> {
    let count = |group, name| {
        parameters
            .find(group, name)
            .and_then(|found| found.count(0))
    };
    let number = |group, name| {
        parameters
            .find(group, name)
            .and_then(|found| found.number(0))
    };

    let mut real = Claims::new("number format");
    real.add(
        number("POINT", "SCALE").and_then(scale_format),
        "POINT:SCALE",
    );
    real.add(scale_format(header.scale), "the header");

    let mut points = Claims::new("points");
    points.add(
        count("POINT", "USED").map(|used| used as usize),
        "POINT:USED",
    );
    points.add(Some(usize::from(header.points)), "the header");

    let ratio = number("ANALOG", "RATE")
        .zip(number("POINT", "RATE"))
        .map(|(analog, point)| (analog / point).round())
        .filter(|ratio| (1.0..=65535.0).contains(ratio))
        .map(|ratio| ratio as usize);
    let channels = count("ANALOG", "USED").map(|used| used as usize);
    let mut analog = Claims::new("analog values a frame");
    analog.add(Some(usize::from(header.analog_words)), "the header");
    let words = match (channels, ratio) {
        (Some(0), _) => Some(0),
        (Some(channels), Some(ratio)) => channels.checked_mul(ratio),
        _ => None,
    };
    analog.add(words, "the ANALOG group");

    let mut start = Claims::new("first byte of the data");
    let inside = |at: &usize| *at >= BLOCK && *at < bytes.data.len();
    start.add(header.data_start().filter(inside), "the header");
    let pointer = count("POINT", "DATA_START").and_then(block_start);
    start.add(pointer.filter(inside), "POINT:DATA_START");
    if start.list.is_empty() {
        let after = section_end.next_multiple_of(BLOCK);
        start.add(Some(after), "the end of the parameters");
        let text =
            format!("neither header nor POINT:DATA_START say where the data is: byte {after}");
        notices.push(Notice::new(bytes.place(16), text));
    }

    let (first_frame, frames) = frame_claims(header, parameters);

    if real.list.is_empty() {
        let kind = ImportErrorKind::OutOfRange {
            what: "the scale of the points (header and POINT:SCALE)".into(),
            value: header.scale.to_string(),
            expected: "a finite number other than 0".into(),
        };
        return Err(kind.at(file, bytes.place(12)));
    }

    let mut layouts = combinations(&real, &points, &analog, &start, &frames);
    let choice = best(bytes.data.len(), &layouts);
    let mut layout = layouts.swap_remove(choice);
    layout.first_frame = first_frame;
    if real.list.len() > 1 {
        let text = format!(
            "header and POINT:SCALE differ in sign: {} taken",
            if layout.real {
                "real numbers"
            } else {
                "integers"
            }
        );
        notices.push(Notice::new(bytes.place(12), text));
    }
    points.report(layout.points, bytes, notices);
    analog.report(layout.analog_words, bytes, notices);
    start.report(layout.start, bytes, notices);

    let available = bytes.data.len().saturating_sub(layout.start);
    let there = available.checked_div(layout.frame_bytes());
    match (frames.list.is_empty(), there) {
        (_, None) => layout.frames = 0,
        (true, Some(0)) => {
            let what = "a frame count (TRIAL, POINT:FRAMES or header)".into();
            return Err(ImportErrorKind::Missing { what }.at(file, bytes.place(6)));
        }
        (true, Some(there)) => {
            layout.frames = there - padding_frames(bytes, &layout, there);
            let text = format!(
                "no frame count is stated: {} taken from the length",
                layout.frames
            );
            notices.push(Notice::new(bytes.place(6), text));
        }
        (false, Some(0)) => {
            let kind = ImportErrorKind::Truncated {
                what: "the first frame of points (bytes)".into(),
                needed: layout.frame_bytes() as u64,
                found: available as u64,
            };
            return Err(kind.at(file, bytes.place(layout.start)));
        }
        (false, Some(there)) if layout.frames > there => {
            let text = format!(
                "the file ends early: {} frames announced, {there} whole frames are there",
                layout.frames
            );
            notices.push(Notice::new(bytes.place(bytes.data.len()), text));
            layout.frames = there;
        }
        (false, Some(_)) => frames.report(layout.frames, bytes, notices),
    }

    // Channels and samples only describe what is skipped.
    let samples = match header.samples_per_frame {
        0 => ratio.unwrap_or(1),
        samples => usize::from(samples),
    };
    layout.samples_per_frame = samples as u32;
    layout.channel_count = (layout.analog_words / samples.max(1)) as u32;
    Ok(layout)
}

/// True for real numbers (a negative scale), `None` where the scale is unusable.
fn scale_format(scale: f64) -> Option<bool> {
    (scale.is_finite() && scale != 0.0).then_some(scale < 0.0)
}

fn block_start(block: u64) -> Option<usize> {
    let before = usize::try_from(block.checked_sub(1)?).ok()?;
    before.checked_mul(BLOCK)
}

/// First frame number and claims on the frame count.
fn frame_claims(header: &Header, parameters: &Parameters<'_>) -> (u64, Claims<usize>) {
    // Two 16-bit words, the lower first.
    let field = |name| {
        let field = parameters.find("TRIAL", name)?;
        Some(field.count(0)? | field.count(1).unwrap_or(0) << 16)
    };
    let trial = field("ACTUAL_START_FIELD").zip(field("ACTUAL_END_FIELD"));
    let first_frame = trial.map_or(u64::from(header.first_frame), |(first, _)| first);

    // 65535 is what a longer take is cut to in 16 bits: no statement at all.
    let whole = |value: &u64| *value > 0 && *value != 65535;
    let long = parameters
        .find("POINT", "LONG_FRAMES")
        .and_then(|found| found.count(0));
    let short = parameters
        .find("POINT", "FRAMES")
        .and_then(|found| found.count(0));
    let (first, last) = (u64::from(header.first_frame), u64::from(header.last_frame));
    let saturated = last == 65535 && short.is_none_or(|frames| frames == 65535);

    let mut frames = Claims::new("frames");
    let mut add = |value: Option<u64>, source| {
        let value = value.filter(|value| *value > 0);
        frames.add(value.and_then(|value| usize::try_from(value).ok()), source);
    };
    add(
        trial.and_then(|(first, last)| (last + 1).checked_sub(first)),
        "the TRIAL group",
    );
    add(long, "POINT:LONG_FRAMES");
    add(short.filter(whole), "POINT:FRAMES");
    if !saturated && (first, last) != (0, 0) {
        add((last + 1).checked_sub(first), "the header");
    }
    if !saturated {
        add(short, "POINT:FRAMES");
    }
    (first_frame, frames)
}

/// Every combination of claims, the most trusted first.
fn combinations(
    real: &Claims<bool>,
    points: &Claims<usize>,
    analog: &Claims<usize>,
    start: &Claims<usize>,
    frames: &Claims<usize>,
) -> Vec<Layout> {
    // Without a claim on frames, one frame stands for all.
    let one = [(1, "")];
    let frames = if frames.list.is_empty() {
        &one
    } else {
        &frames.list[..]
    };
    let mut all = Vec::new();
    for &(start, _) in &start.list {
        for &(real, _) in &real.list {
            for &(points, _) in &points.list {
                for &(analog_words, _) in &analog.list {
                    all.extend(frames.iter().map(|&(frames, _)| Layout {
                        real,
                        points,
                        analog_words,
                        frames,
                        first_frame: 0,
                        start,
                        channel_count: 0,
                        samples_per_frame: 0,
                    }));
                }
            }
        }
    }
    all
}

/// The first layout that ends in the file's last block, else the first that fits into the file,
/// else the first.
fn best(file_len: usize, layouts: &[Layout]) -> usize {
    let rest = |layout: &Layout| {
        let needed = layout.frames.saturating_mul(layout.frame_bytes());
        file_len.saturating_sub(layout.start).checked_sub(needed)
    };
    let ends_with_file = layouts
        .iter()
        .position(|layout| rest(layout).is_some_and(|rest| rest < BLOCK));
    let fits = || layouts.iter().position(|layout| rest(layout).is_some());
    ends_with_file.or_else(fits).unwrap_or(0)
}

/// Frames at the end that are only the zeros which fill the last block.
fn padding_frames(bytes: Bytes<'_>, layout: &Layout, there: usize) -> usize {
    let frame_bytes = layout.frame_bytes();
    (0..there)
        .take_while(|back| {
            let end = layout.start + (there - back) * frame_bytes;
            let begin = end - frame_bytes;
            bytes.data.len() - begin < BLOCK && bytes.data[begin..end].iter().all(|byte| *byte == 0)
        })
        .count()
}
