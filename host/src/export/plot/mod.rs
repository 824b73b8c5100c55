//! Simple charts for reports, drawn on the same [`Image`] as everything else.
//!
//! [`Chart`] shows numbers over numbers or over named categories; [`Timeline`] shows when something
//! lasted, such as the gaps of each marker.

mod axis;
mod canvas;
mod chart;
mod timeline;

pub use timeline::{Timeline, TimelineRow};

use super::render::{Image, Rgb};

const GROUND: Rgb = [255; 3];
const INK: Rgb = [58, 64, 74];
const FAINT: Rgb = [120, 127, 138];
const GRID: Rgb = [228, 231, 236];

/// Colours of series without one of their own (Okabe and Ito 2008): they stay apart for the
/// colour-blind.
pub const SERIES_COLORS: [Rgb; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [90, 90, 90],
];

/// How a series is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// Straight from point to point.
    #[default]
    Line,
    /// Each value holds until the next point.
    Step,
    /// A bar from zero at each point; several such series stand side by side.
    Bars,
    /// A dot at each point.
    Dots,
}

/// Values to draw in one colour.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// For the legend; a series without a name is left out of it.
    pub name: String,
    /// Line, step, bars or dots.
    pub style: Style,
    /// x and y; a point that is not finite breaks the line.
    pub points: Vec<[f64; 2]>,
    /// By default the next of [`SERIES_COLORS`].
    pub color: Option<Rgb>,
}

impl Series {
    /// A series with a default colour.
    #[must_use]
    pub fn new(name: impl Into<String>, style: Style, points: Vec<[f64; 2]>) -> Self {
        Self {
            name: name.into(),
            style,
            points,
            color: None,
        }
    }
}

/// Numbers over numbers, or over categories.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Above the chart.
    pub title: String,
    /// Below the x axis, with its unit.
    pub x_label: String,
    /// Beside the y axis, with its unit.
    pub y_label: String,
    /// Drawn in this order.
    pub series: Vec<Series>,
    /// Names for x = 0, 1, 2 and so on, in place of numbers.
    pub categories: Vec<String>,
    /// Shown part of the x axis; by default all of the data.
    pub x_range: Option<[f64; 2]>,
    /// Shown part of the y axis; by default all of the data, from zero where zero is near.
    pub y_range: Option<[f64; 2]>,
}

impl Chart {
    /// Draws the chart. Linear in points and pixels.
    #[must_use]
    pub fn render(&self, width: usize, height: usize) -> Image {
        chart::render(self, width, height)
    }
}

/// Size of a font unit in pixels for a picture of this width.
fn text_scale(width: usize) -> f32 {
    (width as f32 / 450.0).clamp(1.0, 2.0)
}

#[cfg(test)]
mod tests;
