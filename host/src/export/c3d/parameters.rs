//! The parameter section of a C3D file.

use super::{TEXTS, last_frame, word};
use crate::export::ExportErrorKind;
use crate::import::take::{PointKind, RawEvent, RawTake, UpAxis};

/// The parameter section without its padding; byte 2, the block count, is left 0.
pub(super) fn write(
    take: &RawTake,
    scale: f32,
    data_block: usize,
) -> Result<Vec<u8>, ExportErrorKind> {
    let mut section = Section(vec![1, 0x50, 0, 84]);
    section.group(1, "POINT", "3-D point parameters");
    section.word(1, "USED", take.point_count() as u64);
    section.real(1, "SCALE", -scale);
    section.real(1, "RATE", take.rate as f32);
    section.word(1, "DATA_START", data_block as u64);
    section.word(1, "FRAMES", take.frame_count as u64);
    if take.frame_count > 65_535 {
        section.real(1, "LONG_FRAMES", take.frame_count as f32);
    }
    section.texts(1, "UNITS", &[take.unit.symbol()])?;
    let (right, up) = screen(take.up);
    section.texts(1, "X_SCREEN", &[right])?;
    section.texts(1, "Y_SCREEN", &[up])?;
    let labels: Vec<&str> = take.labels.iter().map(String::as_str).collect();
    section.long_texts(1, "LABELS", &labels)?;
    section.long_texts(1, "DESCRIPTIONS", &vec![" "; labels.len()])?;
    kinds(take, &mut section)?;

    section.group(2, "ANALOG", "Analog data parameters");
    section.word(2, "USED", 0);
    section.real(2, "GEN_SCALE", 1.0);
    section.real(2, "RATE", take.rate as f32);
    for name in ["LABELS", "DESCRIPTIONS", "UNITS"] {
        section.texts(2, name, &[])?;
    }
    section.entry(2, "SCALE", 4, &[0], &[]);
    section.entry(2, "OFFSET", 2, &[0], &[]);
    section.group(3, "FORCE_PLATFORM", "Force platform parameters");
    section.word(3, "USED", 0);

    section.group(4, "TRIAL", "Trial parameters");
    for (name, frame) in [
        ("ACTUAL_START_FIELD", take.first_frame),
        ("ACTUAL_END_FIELD", last_frame(take)),
    ] {
        let frame = u32::try_from(frame).unwrap_or(u32::MAX);
        section.entry(4, name, 2, &[2], &frame.to_le_bytes());
    }
    if !take.events.is_empty() {
        section.group(5, "EVENT", "Events");
        section.word(5, "USED", take.events.len() as u64);
        let column = |text: fn(&RawEvent) -> &str| take.events.iter().map(text).collect();
        let labels: Vec<&str> = column(|event| &event.label);
        let contexts: Vec<&str> = column(|event| &event.context);
        section.texts(5, "LABELS", &labels)?;
        section.texts(5, "CONTEXTS", &contexts)?;
        // Minutes, then seconds.
        let times = take.events.iter().flat_map(|event| {
            let minutes = (event.seconds / 60.0).trunc();
            [minutes as f32, (event.seconds - minutes * 60.0) as f32]
        });
        let times: Vec<u8> = times.flat_map(f32::to_le_bytes).collect();
        section.entry(5, "TIMES", 4, &[2, take.events.len() as u8], &times);
    }
    section.0.push(0);
    Ok(section.0)
}

/// Names the points that are no positions, the way Vicon does.
fn kinds(take: &RawTake, section: &mut Section) -> Result<(), ExportErrorKind> {
    const GROUPS: [(PointKind, &str, &str); 6] = [
        (PointKind::Angle, "ANGLES", "ANGLE"),
        (PointKind::Force, "FORCES", "FORCE"),
        (PointKind::Moment, "MOMENTS", "MOMENT"),
        (PointKind::Power, "POWERS", "POWER"),
        (PointKind::Scalar, "SCALARS", "SCALAR"),
        (PointKind::Model, "MODELED_MARKERS", "MODELED_MARKER"),
    ];
    let mut used = Vec::new();
    for (kind, name, single) in GROUPS {
        let members = take
            .kinds
            .iter()
            .zip(&take.labels)
            .filter(|(other, _)| **other == kind);
        let labels: Vec<&str> = members.map(|(_, label)| label.as_str()).collect();
        if !labels.is_empty() {
            section.long_texts(1, name, &labels)?;
            used.extend([name, single]);
        }
    }
    if used.is_empty() {
        Ok(())
    } else {
        section.pairs(1, "TYPE_GROUPS", &used)
    }
}

/// POINT:X_SCREEN and POINT:Y_SCREEN: a horizontal axis, and the one that points up.
fn screen(up: UpAxis) -> (&'static str, &'static str) {
    let right = if matches!(up, UpAxis::PlusX | UpAxis::MinusX) {
        "+Z"
    } else {
        "+X"
    };
    (right, up.symbol())
}

/// A parameter section under construction.
struct Section(Vec<u8>);

impl Section {
    fn group(&mut self, number: u8, name: &str, description: &str) {
        self.0.extend([name.len() as u8, number.wrapping_neg()]);
        self.0.extend(name.as_bytes());
        self.0.extend((3 + description.len() as u16).to_le_bytes());
        self.0.push(description.len() as u8);
        self.0.extend(description.as_bytes());
    }

    /// One parameter; the caller keeps `value` below 32 KiB and `dimensions` in step with it.
    fn entry(&mut self, group: u8, name: &str, kind: i8, dimensions: &[u8], value: &[u8]) {
        self.0.extend([name.len() as u8, group]);
        self.0.extend(name.as_bytes());
        let step = 2 + 1 + 1 + dimensions.len() + value.len() + 1;
        self.0.extend((step as u16).to_le_bytes());
        self.0.extend([kind as u8, dimensions.len() as u8]);
        self.0.extend(dimensions);
        self.0.extend(value);
        self.0.push(0);
    }

    fn word(&mut self, group: u8, name: &str, value: u64) {
        self.entry(group, name, 2, &[], &word(value));
    }

    fn real(&mut self, group: u8, name: &str, value: f32) {
        self.entry(group, name, 4, &[], &value.to_le_bytes());
    }

    /// Up to 255 texts as one parameter, padded with blanks to one length.
    fn texts(&mut self, group: u8, name: &str, texts: &[&str]) -> Result<(), ExportErrorKind> {
        let letters = longest(texts)?;
        self.entry(
            group,
            name,
            -1,
            &[letters as u8, texts.len() as u8],
            &padded(texts, letters),
        );
        Ok(())
    }

    /// Any number of texts: `NAME`, then `NAME2`, `NAME3` and so on.
    fn long_texts(&mut self, group: u8, name: &str, texts: &[&str]) -> Result<(), ExportErrorKind> {
        self.texts(group, name, &texts[..texts.len().min(TEXTS)])?;
        for (number, part) in texts.chunks(TEXTS).enumerate().skip(1) {
            self.texts(group, &format!("{name}{}", number + 1), part)?;
        }
        Ok(())
    }

    /// Pairs of texts as an array of three dimensions.
    fn pairs(&mut self, group: u8, name: &str, texts: &[&str]) -> Result<(), ExportErrorKind> {
        let letters = longest(texts)?;
        let dimensions = [letters as u8, 2, (texts.len() / 2) as u8];
        self.entry(group, name, -1, &dimensions, &padded(texts, letters));
        Ok(())
    }
}

/// Length of the longest text; 255 of them must stay below the 32 KiB that a step may span.
fn longest(texts: &[&str]) -> Result<usize, ExportErrorKind> {
    const LIMIT: usize = 127;
    let Some(longest) = texts.iter().max_by_key(|text| text.len()) else {
        return Ok(0);
    };
    if longest.len() > LIMIT {
        return Err(ExportErrorKind::OutOfRange {
            what: format!("the label {longest:?}"),
            value: format!("{} bytes long", longest.len()),
            expected: format!("at most {LIMIT} bytes long"),
        });
    }
    Ok(longest.len().max(1))
}

fn padded(texts: &[&str], letters: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(texts.len() * letters);
    for text in texts {
        bytes.extend(text.as_bytes());
        bytes.resize(bytes.len() + letters - text.len(), b' ');
    }
    bytes
}
