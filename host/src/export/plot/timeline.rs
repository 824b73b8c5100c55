//! When something lasted, one row each: the gaps of markers, the stances of feet.

use glam::DVec2;

use super::super::render::{Image, Rgb, text};
use super::axis::{Axis, range_of, widened};
use super::canvas::{Mask, centred};
use super::chart::x_numbers;
use super::{FAINT, GROUND, INK, SERIES_COLORS, text_scale};

/// Spans of time in named rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    /// Above the picture.
    pub title: String,
    /// Below the axis, with its unit.
    pub x_label: String,
    /// From the top.
    pub rows: Vec<TimelineRow>,
    /// Shown part of the axis; by default what the spans need.
    pub x_range: Option<[f64; 2]>,
}

/// One row of a [`Timeline`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimelineRow {
    /// On the left.
    pub name: String,
    /// Start and end of each span.
    pub spans: Vec<[f64; 2]>,
}

/// An empty row.
const TRACK: Rgb = [238, 240, 243];

impl Timeline {
    /// Draws the rows as high as they fit; where they are too low for their names, every second,
    /// third or later name is shown. Linear in spans and pixels.
    #[must_use]
    pub fn render(&self, width: usize, height: usize) -> Image {
        let mut image = Image::new(width, height, GROUND);
        let scale = text_scale(width);
        let line = text::height(scale);
        let margin = (6.0 * scale) as i64;
        let mut top = margin;
        if !self.title.is_empty() {
            let title = text::shorten(&self.title, scale * 1.15, width as i64 - 2 * margin);
            centred(
                &mut image,
                width as f64 / 2.0,
                top,
                scale * 1.15,
                INK,
                &title,
            );
            top += text::height(scale * 1.15) + margin;
        }
        let mut bottom = height as i64 - margin - line - margin;
        if !self.x_label.is_empty() {
            bottom -= line + margin;
        }
        let room = width as i64 / 4;
        let names = self
            .rows
            .iter()
            .map(|row| text::shorten(&row.name, scale, room));
        let names: Vec<String> = names.collect();
        let widest = names
            .iter()
            .map(|name| text::width(name, scale))
            .max()
            .unwrap_or(0);
        let left = margin + widest + margin;
        let right = width as i64 - 2 * margin;
        if right - left < 8 || bottom - top < 8 {
            return image;
        }
        let spans = self.rows.iter().flat_map(|row| row.spans.as_flattened());
        let range = self
            .x_range
            .map(widened)
            .or_else(|| range_of(spans.copied()));
        let [low, high] = range.unwrap_or([0.0, 1.0]);
        let axis = Axis {
            low,
            high,
            start: left as f64,
            end: right as f64,
        };

        let row_height =
            ((bottom - top) as f64 / self.rows.len().max(1) as f64).min(3.0 * line as f64);
        let bottom = top + (row_height * self.rows.len().max(1) as f64).ceil() as i64;
        x_numbers(&mut image, &axis, top, bottom, scale);
        let area = [left, top, right, bottom].map(|edge| edge.max(0) as usize);
        let mut tracks = Mask::new(area);
        let mut bars = Mask::new(area);
        let every = (line as f64 * 1.4 / row_height).ceil().max(1.0) as usize;
        for (index, (row, name)) in self.rows.iter().zip(&names).enumerate() {
            let start = top as f64 + row_height * index as f64;
            let (upper, lower) = (start + row_height * 0.14, start + row_height * 0.86);
            tracks.bar(DVec2::new(axis.start, upper), DVec2::new(axis.end, lower));
            for &[from, to] in &row.spans {
                let (from, to) = (axis.pixel(from.min(to)), axis.pixel(from.max(to)));
                if from.is_finite() && to.is_finite() {
                    // A single frame must not vanish.
                    let to = to.max(from + 1.0);
                    bars.bar(DVec2::new(from, upper), DVec2::new(to, lower));
                }
            }
            if index % every == 0 {
                let x = left - margin / 2 - text::width(name, scale);
                let y = (start + row_height / 2.0).round() as i64 - line / 2;
                text::draw(&mut image, x, y, scale, FAINT, name);
            }
        }
        tracks.paint(&mut image, TRACK);
        bars.paint(&mut image, SERIES_COLORS[1]);
        if self.rows.is_empty() {
            let middle = (left + right) as f64 / 2.0;
            centred(
                &mut image,
                middle,
                (top + bottom - line) / 2,
                scale,
                FAINT,
                "no data",
            );
        }
        if !self.x_label.is_empty() {
            let y = bottom + (6.0 * scale) as i64 + line + margin;
            let label = text::shorten(&self.x_label, scale, width as i64 - 2 * margin);
            centred(
                &mut image,
                (left + right) as f64 / 2.0,
                y,
                scale,
                INK,
                &label,
            );
        }
        image
    }
}
