//! Animated GIFs: one palette for the whole animation, dither that holds still, and only what
//! changes from frame to frame.

mod palette;

use std::path::Path;

use ::gif::{DisposalMethod, Encoder, EncodingError, Frame, Repeat};

pub use palette::Palette;

use super::atomic::AtomicFile;
use super::error::{ExportError, ExportErrorKind};
use super::render::{Image, Rgb};
use palette::Mixture;

/// Viewers show frames of less than 2 hundredths of a second at a tenth of a second.
const LEAST_SECONDS: f64 = 0.02;
/// A GIF counts a frame's hundredths of a second in 16 bits.
const MOST_SECONDS: f64 = 600.0;

/// Writes an animation that repeats forever; each frame shows for `frame_seconds`.
///
/// # Errors
/// There are no images, they differ in size or exceed 65,535 pixels a side, `frame_seconds` is
/// outside 0.02 to 600, or the file cannot be written.
pub fn write_gif(
    path: impl AsRef<Path>,
    images: &[Image],
    frame_seconds: f64,
) -> Result<(), ExportError> {
    let path = path.as_ref();
    let Some(first) = images.first() else {
        return Err(ExportErrorKind::Empty { what: "frame" }.at(path));
    };
    let palette = Palette::of(images);
    let mut writer = GifWriter::create(path, first.width, first.height, frame_seconds, palette)?;
    for image in images {
        writer.push(image)?;
    }
    writer.finish()
}

/// Writes an animation frame by frame, with a palette made from some of its frames.
///
/// The file appears only in [`GifWriter::finish`].
pub struct GifWriter {
    encoder: Encoder<AtomicFile>,
    path: std::path::PathBuf,
    width: usize,
    height: usize,
    palette: Palette,
    /// Last colours looked up, placed by a hash of the colour.
    recent: Vec<Option<(Rgb, Mixture)>>,
    /// What each pixel was asked to show when it was last painted, and what it shows.
    painted: Vec<(Rgb, u8)>,
    /// Painted, not yet written: it shows longer if the next frames change nothing.
    pending: Option<Frame<'static>>,
    frame_seconds: f64,
    frame_count: u32,
}

impl GifWriter {
    /// Opens `path` for frames of one size that show for `frame_seconds` each.
    ///
    /// # Errors
    /// A side is 0 or over 65,535 pixels, `frame_seconds` is outside 0.02 to 600, or the file
    /// cannot be created.
    pub fn create(
        path: impl AsRef<Path>,
        width: usize,
        height: usize,
        frame_seconds: f64,
        palette: Palette,
    ) -> Result<Self, ExportError> {
        let path = path.as_ref();
        let refuse = |what: &str, value: String, expected: String| {
            let what = what.to_owned();
            ExportErrorKind::OutOfRange { what, value, expected }.at(path)
        };
        let side = |what: &str, pixels: usize| {
            let size = u16::try_from(pixels).ok().filter(|&size| size > 0);
            size.ok_or_else(|| refuse(what, pixels.to_string(), "from 1 to 65535 pixels".into()))
        };
        let (columns, rows) = (side("the width", width)?, side("the height", height)?);
        if !(LEAST_SECONDS..=MOST_SECONDS).contains(&frame_seconds) {
            return Err(refuse(
                "the time of a frame",
                format!("{frame_seconds} s"),
                format!("from {LEAST_SECONDS} to {MOST_SECONDS} s"),
            ));
        }
        let file = AtomicFile::create(path)?;
        let mut encoder = Encoder::new(file, columns, rows, &palette.bytes())
            .map_err(|error| kind(error).at(path))?;
        encoder.set_repeat(Repeat::Infinite).map_err(|error| kind(error).at(path))?;
        Ok(Self {
            encoder,
            path: path.to_owned(),
            width,
            height,
            palette,
            recent: vec![None; 1 << 16],
            painted: Vec::new(),
            pending: None,
            frame_seconds,
            frame_count: 0,
        })
    }

    /// Appends a frame.
    ///
    /// # Errors
    /// Its size is not that of the animation, or the disk refuses.
    pub fn push(&mut self, image: &Image) -> Result<(), ExportError> {
        let pixels: &[Rgb] = image.rgb.as_chunks().0;
        if (image.width, image.height) != (self.width, self.height)
            || pixels.len() != self.width * self.height
        {
            return Err(ExportErrorKind::OutOfRange {
                what: format!("the size of frame {}", self.frame_count),
                value: format!("{} x {}", image.width, image.height),
                expected: format!("{} x {}, as that of the first", self.width, self.height),
            }
            .at(&self.path));
        }
        let delay = self.next_delay();
        let changed = self.changed(pixels);
        let area = self.area(&changed);
        // Nothing new: the frame before stays longer, if its counter has room.
        if let (Some(pending), None) = (&mut self.pending, area)
            && let Some(sum) = pending.delay.checked_add(delay)
        {
            pending.delay = sum;
            return Ok(());
        }
        let frame = self.paint(pixels, &changed, area.unwrap_or([0, 0, 1, 1]), delay);
        match self.pending.replace(frame) {
            Some(previous) => self.write(&previous),
            None => Ok(()),
        }
    }

    /// Publishes the file.
    ///
    /// # Errors
    /// No frame was pushed, or the disk refuses; then no file is left.
    pub fn finish(mut self) -> Result<(), ExportError> {
        let Some(last) = self.pending.take() else {
            return Err(ExportErrorKind::Empty { what: "frame" }.at(&self.path));
        };
        self.write(&last)?;
        let path = self.path;
        let file = self.encoder.into_inner();
        file.map_err(|error| kind(error).at(path))?.commit()
    }

    fn write(&mut self, frame: &Frame) -> Result<(), ExportError> {
        self.encoder.write_frame(frame).map_err(|error| kind(error).at(&self.path))
    }

    /// Hundredths of a second, rounded so that the sum over all frames stays true.
    fn next_delay(&mut self) -> u16 {
        let end = |frames: u32| (f64::from(frames) * self.frame_seconds * 100.0).round();
        let delay = end(self.frame_count + 1) - end(self.frame_count);
        self.frame_count += 1;
        delay as u16
    }

    /// Which pixels must be painted.
    fn changed(&self, pixels: &[Rgb]) -> Vec<bool> {
        if self.painted.is_empty() {
            return vec![true; pixels.len()];
        }
        let tolerance = self.palette.tolerance();
        let pairs = self.painted.iter().zip(pixels);
        let differs = |(&(old, _), &new): (&(Rgb, u8), &Rgb)| {
            old.iter().zip(new).any(|(&old, new)| old.abs_diff(new) > tolerance)
        };
        pairs.map(differs).collect()
    }

    /// First and last column and row, exclusive, around what changes.
    fn area(&self, changed: &[bool]) -> Option<[usize; 4]> {
        let mut area: Option<[usize; 4]> = None;
        for (y, row) in changed.chunks_exact(self.width).enumerate() {
            let Some(first) = row.iter().position(|&changed| changed) else {
                continue;
            };
            let last = row.iter().rposition(|&changed| changed).unwrap_or(first) + 1;
            let [left, top, right, _] = area.unwrap_or([first, y, last, y + 1]);
            area = Some([left.min(first), top, right.max(last), y + 1]);
        }
        area
    }

    fn paint(
        &mut self,
        pixels: &[Rgb],
        changed: &[bool],
        [left, top, right, bottom]: [usize; 4],
        delay: u16,
    ) -> Frame<'static> {
        self.painted.resize(pixels.len(), ([0; 3], 0));
        let first = self.frame_count == 1;
        let mut buffer = Vec::with_capacity((right - left) * (bottom - top));
        for y in top..bottom {
            for x in left..right {
                let at = y * self.width + x;
                let shown = self.painted[at].1;
                if changed[at] {
                    let index = self.mixture(pixels[at]).at(x, y);
                    self.painted[at] = (pixels[at], index);
                    let stays = index == shown && !first;
                    buffer.push(self.palette.transparent().filter(|_| stays).unwrap_or(index));
                } else {
                    buffer.push(self.palette.transparent().unwrap_or(shown));
                }
            }
        }
        // All sizes are within the animation's, which fits 16 bits.
        Frame {
            delay,
            dispose: DisposalMethod::Keep,
            transparent: self.palette.transparent().filter(|_| !first),
            left: left as u16,
            top: top as u16,
            width: (right - left) as u16,
            height: (bottom - top) as u16,
            buffer: buffer.into(),
            ..Frame::default()
        }
    }

    fn mixture(&mut self, color: Rgb) -> Mixture {
        let [r, g, b] = color.map(u32::from);
        let hash = (r << 16 | g << 8 | b).wrapping_mul(0x9E37_79B1) >> 16;
        let slot = &mut self.recent[hash as usize];
        match slot {
            Some((known, mixture)) if *known == color => *mixture,
            _ => slot.insert((color, self.palette.mixture(color))).1,
        }
    }
}

fn kind(error: EncodingError) -> ExportErrorKind {
    match error {
        EncodingError::Io(error) => error.into(),
        other => ExportErrorKind::Io(other.to_string()),
    }
}

#[cfg(test)]
mod tests;
