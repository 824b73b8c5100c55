//! C3D files: points over time, stored as integers or reals in one of three byte orders.
//!
//! Enters: the bytes of a file. Leaves: a [`RawTake`] with every point of every whole frame in
//! source units and axes. Analog samples are skipped. Sources: *The C3D File Format User Guide*
//! (c3d.org), and how the files of twenty years break it.

mod bytes;
mod data;
mod labels;
mod layout;
mod parameters;

use self::bytes::{ByteOrder, Bytes};
use self::layout::{BLOCK, Header};
use self::parameters::{MAX_SECTION, Parameters};
use super::take::{
    Analog, LengthUnit, RawTake, Stated, TakeOptions, UpAxis, median_extent, settle, settle_rate,
    usable_rate,
};
use super::{ImportError, ImportErrorKind, Notice, Place};

/// Largest number of faulty parameters that are named one by one.
const NAMED_FAULTS: usize = 8;

/// Reads a C3D file; `file` names it in errors.
///
/// Time and memory are linear in `content`, whatever its header announces.
///
/// # Errors
/// It is not C3D, its byte order or layout cannot be made out, not one whole frame is there, or
/// no frame rate is stated. Everything else is repaired and said in [`RawTake::notices`].
pub fn parse(content: &[u8], file: &str, options: &TakeOptions) -> Result<RawTake, ImportError> {
    let mut notices = Vec::new();
    let bytes = find_header(content, file, &mut notices)?;
    let (section, first_bytes) = find_section(bytes, file)?;
    let (order, header) = find_order(bytes, first_bytes, section, file, &mut notices)?;

    // The data bounds the parameters, because writers have let the two overlap. The block count
    // of the section is often 0 and only serves where nothing else is known.
    let limit = header
        .data_start()
        .filter(|start| *start > section)
        .unwrap_or(section + MAX_SECTION);
    let parameters = Parameters::read(bytes, order, section + 4, limit);
    report_faults(&parameters, bytes, section, &mut notices);
    let section_end = parameters
        .end
        .max(section + usize::from(first_bytes[2]) * BLOCK);

    let layout = layout::find(bytes, &header, &parameters, section_end, file, &mut notices)?;
    let rate = find_rate(&header, &parameters, bytes, &mut notices);
    let rate = settle_rate(rate, options, file, "a frame rate (POINT:RATE and header)")?;

    let mut take = RawTake::empty(Vec::new(), rate, 0);
    take.notices = notices;
    take.first_frame = layout.first_frame;
    (take.labels, take.kinds) = labels::find(&parameters, layout.points, &mut take.notices);
    take.events = labels::events(&parameters);
    take.analog = (layout.analog_words > 0).then_some(Analog {
        channel_count: layout.channel_count,
        samples_per_frame: layout.samples_per_frame,
    });
    if layout.points == 0 {
        take.notice(bytes.place(2), "the file holds no points");
    }
    let unit = parameters.find("POINT", "UNITS");
    let unit_text = unit.and_then(|unit| unit.texts().into_iter().find(|text| !text.is_empty()));

    let scale = match find_scales(&header, &parameters) {
        (Some(stated), Some(copy)) if (stated / copy - 1.0).abs() > 1e-6 => {
            data::read(bytes, order, &layout, 1.0, &mut take);
            let known = options
                .unit
                .or(unit_text.as_deref().and_then(LengthUnit::parse));
            settle_scale(
                &mut take,
                layout.real,
                (stated, copy),
                known,
                bytes.place(12),
            )
        }
        (stated, copy) => {
            let scale = stated.or(copy).unwrap_or(1.0);
            data::read(bytes, order, &layout, scale, &mut take);
            scale
        }
    };
    take.scale = Some(if layout.real { -scale } else { scale } as f32);
    let absurd = data::drop_absurd(&mut take);
    if absurd > 0 {
        let text = format!("{absurd} samples are infinite or absurdly far: taken as missing");
        take.notice(bytes.place(layout.start), text);
    }

    let screen = |name| Some(parameters.find("POINT", name)?.texts().first()?.to_owned());
    let stated = Stated {
        unit_place: unit.map(|unit| bytes.place(unit.offset)),
        unit: unit_text,
        up: screen("Y_SCREEN").and_then(|text| UpAxis::parse(&text)),
        usual_up: Some(UpAxis::PlusZ),
    };
    settle(&mut take, &stated, options);
    Ok(take)
}

/// Skips zeros before the header, which some writers leave, and checks its mark.
fn find_header<'a>(
    content: &'a [u8],
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<Bytes<'a>, ImportError> {
    if content.is_empty() {
        return Err(ImportErrorKind::Empty.at(file, Place::File));
    }
    let skipped = content
        .iter()
        .position(|byte| *byte != 0)
        .unwrap_or(content.len());
    let bytes = Bytes {
        data: &content[skipped..],
        skipped,
    };
    if bytes.data.get(1) != Some(&0x50) {
        let start: Vec<String> = content
            .iter()
            .take(4)
            .map(|byte| format!("{byte:02x}"))
            .collect();
        let kind = ImportErrorKind::NotThisFormat {
            expected: "a C3D file (its second byte is 50 hexadecimal)",
            found: format!("it begins with {}", start.join(" ")),
        };
        return Err(kind.at(file, Place::Byte(0)));
    }
    if skipped > 0 {
        notices.push(Notice::new(
            Place::Byte(0),
            format!("{skipped} zero bytes stand before the header"),
        ));
    }
    if bytes.data.len() < BLOCK {
        return Err(
            truncated("the header (bytes)", BLOCK, bytes.data.len()).at(file, bytes.place(0))
        );
    }
    Ok(bytes)
}

fn truncated(what: &str, needed: usize, found: usize) -> ImportErrorKind {
    ImportErrorKind::Truncated {
        what: what.into(),
        needed: needed as u64,
        found: found as u64,
    }
}

/// Offset and first four bytes of the parameter section.
fn find_section(bytes: Bytes<'_>, file: &str) -> Result<(usize, [u8; 4]), ImportError> {
    let block = usize::from(bytes.data[0]);
    if block < 2 {
        let kind = ImportErrorKind::OutOfRange {
            what: "the block of the parameter section".into(),
            value: block.to_string(),
            expected: "2 or more".into(),
        };
        return Err(kind.at(file, bytes.place(0)));
    }
    let section = (block - 1) * BLOCK;
    match bytes.array(section) {
        Some(first) => Ok((section, first)),
        None => {
            let found = bytes.data.len();
            Err(
                truncated("the parameter section (bytes)", section + 4, found)
                    .at(file, bytes.place(section)),
            )
        }
    }
}

/// The byte order that byte 4 of the section states, or else the only one that makes sense.
fn find_order(
    bytes: Bytes<'_>,
    first_bytes: [u8; 4],
    section: usize,
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<(ByteOrder, Header), ImportError> {
    let read = |order| {
        Header::read(bytes, order).ok_or_else(|| {
            truncated("the header (bytes)", BLOCK, bytes.data.len()).at(file, bytes.place(0))
        })
    };
    let mark = first_bytes[3];
    let stated = match mark {
        84 => Some(ByteOrder::Intel),
        85 => Some(ByteOrder::Dec),
        86 => Some(ByteOrder::Sgi),
        _ => None,
    };
    if let Some(order) = stated {
        return Ok((order, read(order)?));
    }
    for order in ByteOrder::ALL {
        let header = read(order)?;
        if header.is_plausible(bytes.data.len()) {
            let text = format!(
                "the processor byte is {mark}, not 84, 85 or 86: read as {}",
                order.name()
            );
            notices.push(Notice::new(bytes.place(section + 3), text));
            return Ok((order, header));
        }
    }
    let kind = ImportErrorKind::OutOfRange {
        what: "the processor byte".into(),
        value: mark.to_string(),
        expected: "84 (Intel), 85 (DEC) or 86 (SGI/MIPS)".into(),
    };
    Err(kind.at(file, bytes.place(section + 3)))
}

fn report_faults(
    parameters: &Parameters<'_>,
    bytes: Bytes<'_>,
    section: usize,
    notices: &mut Vec<Notice>,
) {
    for (offset, fault) in parameters.faults.iter().take(NAMED_FAULTS) {
        notices.push(Notice::new(
            bytes.place(*offset),
            format!("parameter {fault}"),
        ));
    }
    let more = parameters.faults.len().saturating_sub(NAMED_FAULTS);
    if more > 0 {
        notices.push(Notice::new(
            bytes.place(section),
            format!("{more} more faulty parameters"),
        ));
    }
    if !parameters.has_group("POINT") {
        let text = "there is no POINT group: everything is taken from the header";
        notices.push(Notice::new(bytes.place(section), text));
    }
}

fn find_rate(
    header: &Header,
    parameters: &Parameters<'_>,
    bytes: Bytes<'_>,
    notices: &mut Vec<Notice>,
) -> Option<f64> {
    let stated = parameters
        .find("POINT", "RATE")
        .and_then(|rate| rate.number(0));
    let stated = stated.filter(|rate| usable_rate(*rate));
    let fallback = usable_rate(header.rate).then_some(header.rate);
    if let (Some(rate), Some(other)) = (stated, fallback)
        && (rate / other - 1.0).abs() > 1e-6
    {
        let text = format!("POINT:RATE says {rate} Hz, the header {other} Hz: {rate} taken");
        notices.push(Notice::new(bytes.place(20), text));
    }
    stated.or(fallback)
}

/// The usable scales: POINT:SCALE and the header's copy of it, both above 0.
fn find_scales(header: &Header, parameters: &Parameters<'_>) -> (Option<f64>, Option<f64>) {
    let usable = |scale: f64| (scale.is_finite() && scale != 0.0).then_some(scale.abs());
    let stated = parameters.find("POINT", "SCALE");
    let stated = stated.and_then(|scale| scale.number(0));
    (stated.and_then(usable), usable(header.scale))
}

/// Scales what was read in steps, where the file states two different scales; gives the one used.
fn settle_scale(
    take: &mut RawTake,
    real: bool,
    (stated, copy): (f64, f64),
    unit: Option<LengthUnit>,
    place: Place,
) -> f64 {
    let both = format!("POINT:SCALE is {stated}, the header says {copy}");
    let (scale, why) = if real {
        (stated, "it only scales residuals")
    } else {
        let scale = likely_scale(median_extent(take), unit, stated, copy);
        (scale, "it gives the size that is nearer to a person's")
    };
    if !real {
        for value in take.positions.iter_mut().flatten() {
            *value *= scale;
        }
    }
    for residual in take
        .residuals
        .iter_mut()
        .filter(|residual| **residual > 0.0)
    {
        *residual = (f64::from(*residual) * scale) as f32;
    }
    take.notice(place, format!("{both}: {scale} taken, because {why}"));
    scale
}

/// Of two scales the one that brings `extent` steps nearer to 1.7 m, by ratio; the first where
/// nothing tells.
fn likely_scale(extent: Option<f64>, unit: Option<LengthUnit>, first: f64, second: f64) -> f64 {
    let (Some(extent), Some(unit)) = (extent, unit) else {
        return first;
    };
    let distance = |scale: f64| (extent * scale * unit.metres() / 1.7).ln().abs();
    if distance(second) < distance(first) {
        second
    } else {
        first
    }
}

#[cfg(test)]
mod tests;
