//! Layout and drawing of a [`Chart`].

use glam::DVec2;

use super::super::render::{Image, Rgb, text};
use super::axis::{Axis, nice_step, range_of, widened};
use super::canvas::{Mask, centred};
use super::{Chart, FAINT, GRID, GROUND, INK, SERIES_COLORS, Series, Style, text_scale};

pub(super) fn render(chart: &Chart, width: usize, height: usize) -> Image {
    let mut image = Image::new(width, height, GROUND);
    let scale = text_scale(width);
    let unit = f64::from(scale);
    let line = text::height(scale);
    let margin = (6.0 * unit) as i64;

    let mut top = margin;
    if !chart.title.is_empty() {
        let title = text::shorten(&chart.title, scale * 1.15, width as i64 - 2 * margin);
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
    top = legend(chart, &mut image, top, scale) + (4.0 * unit) as i64;

    let [x_low, x_high] = x_range(chart);
    let [y_low, y_high] = y_range(chart);
    let mut bottom = height as i64 - margin;
    if !chart.x_label.is_empty() {
        bottom -= line + margin;
    }
    // Names that do not fit side by side stand upright.
    let widest = chart
        .categories
        .iter()
        .map(|name| text::width(name, scale))
        .max();
    let room = width as f64 * 0.8 / (x_high - x_low).max(1.0);
    let upright = widest.is_some_and(|widest| widest as f64 + 3.0 * unit > room);
    let name_room = (height as i64 / 3).max(line);
    bottom -= margin
        + if upright {
            widest.unwrap_or(0).min(name_room)
        } else {
            line
        };

    let mut y_axis = Axis {
        low: y_low,
        high: y_high,
        start: bottom as f64,
        end: top as f64,
    };
    if chart.y_range.is_none() {
        // A round value at both ends.
        let step = nice_step(y_high - y_low, tick_count(&y_axis, 4.0 * line as f64));
        y_axis.low = (y_low / step + 1e-9).floor() * step;
        y_axis.high = (y_high / step - 1e-9).ceil() * step;
    }
    let y_ticks = y_axis.ticks(tick_count(&y_axis, 4.0 * line as f64));
    let labels: Vec<String> = y_ticks
        .values
        .iter()
        .map(|&value| y_ticks.label(value))
        .collect();
    let label_width = labels
        .iter()
        .map(|label| text::width(label, scale))
        .max()
        .unwrap_or(0);
    let mut left = margin + label_width + margin / 2;
    if !chart.y_label.is_empty() {
        left += line + margin;
    }
    let right = width as i64 - 2 * margin;
    if right - left < 8 || bottom - top < 8 {
        return image;
    }
    let x_axis = Axis {
        low: x_low,
        high: x_high,
        start: left as f64,
        end: right as f64,
    };

    for (&value, label) in y_ticks.values.iter().zip(&labels) {
        let y = y_axis.pixel(value).round() as i64;
        image.fill(left, y, right - left, 1, GRID);
        let x = left - margin / 2 - text::width(label, scale);
        text::draw(&mut image, x, y - line / 2, scale, FAINT, label);
    }
    if chart.categories.is_empty() {
        x_numbers(&mut image, &x_axis, top, bottom, scale);
    } else {
        names(
            chart,
            &mut image,
            &x_axis,
            bottom,
            scale,
            upright.then_some(name_room),
        );
    }
    if !chart.x_label.is_empty() {
        let label = text::shorten(&chart.x_label, scale, width as i64 - 2 * margin);
        let y = height as i64 - margin - line;
        centred(
            &mut image,
            (left + right) as f64 / 2.0,
            y,
            scale,
            INK,
            &label,
        );
    }
    if !chart.y_label.is_empty() {
        let label = text::shorten(&chart.y_label, scale, bottom - top + 2 * line);
        let start = (top + bottom + text::width(&label, scale)) / 2;
        text::draw_upward(&mut image, margin, start, scale, INK, &label);
    }

    let area = [left, top, right, bottom].map(|edge| edge.max(0) as usize);
    let mut bars = BarLayout::new(chart);
    for (series, color) in chart.series.iter().zip(colors(chart)) {
        let mut mask = Mask::new(area);
        draw(series, &x_axis, &y_axis, unit, &bars, &mut mask);
        mask.paint(&mut image, color);
        bars.drawn += usize::from(series.style == Style::Bars);
    }
    let base = y_axis.pixel(0.0f64.clamp(y_axis.low, y_axis.high)).round() as i64;
    image.fill(left, base, right - left, (unit / 2.0).round() as i64, FAINT);
    if !chart
        .series
        .iter()
        .any(|series| range_of(series.points.iter().map(|p| p[1])).is_some())
    {
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
    image
}

fn tick_count(axis: &Axis, pixels_each: f64) -> usize {
    ((axis.end - axis.start).abs() / pixels_each).clamp(2.0, 12.0) as usize
}

fn colors(chart: &Chart) -> impl Iterator<Item = Rgb> {
    let defaults = SERIES_COLORS.iter().cycle();
    chart
        .series
        .iter()
        .zip(defaults)
        .map(|(series, &default)| series.color.unwrap_or(default))
}

fn x_range(chart: &Chart) -> [f64; 2] {
    if let Some(range) = chart.x_range {
        return widened(range);
    }
    if !chart.categories.is_empty() {
        return [-0.5, chart.categories.len() as f64 - 0.5];
    }
    let all = chart.series.iter().flat_map(|series| &series.points);
    let range = range_of(all.map(|point| point[0])).unwrap_or([0.0, 1.0]);
    let half_bar = BarLayout::new(chart)
        .spacing
        .map_or(0.0, |spacing| spacing / 2.0);
    [range[0] - half_bar, range[1] + half_bar]
}

fn y_range(chart: &Chart) -> [f64; 2] {
    if let Some(range) = chart.y_range {
        return widened(range);
    }
    let all = chart.series.iter().flat_map(|series| &series.points);
    let finite = all.filter(|point| point[0].is_finite());
    let [low, high] = range_of(finite.map(|point| point[1])).unwrap_or([0.0, 1.0]);
    let bars = chart
        .series
        .iter()
        .any(|series| series.style == Style::Bars);
    let near_zero = |least: f64, most: f64| bars || least < 0.5 * most;
    if low >= 0.0 && near_zero(low, high) {
        [0.0, high]
    } else if high <= 0.0 && near_zero(-high, -low) {
        [low, 0.0]
    } else {
        [low, high]
    }
}

/// Names with a mark in their colours, in as many rows as needed; gives the row below.
fn legend(chart: &Chart, image: &mut Image, mut top: i64, scale: f32) -> i64 {
    let line = text::height(scale);
    let mark = 2 * line;
    let gap = line / 2;
    let width = image.width as i64;
    let mut rows: Vec<Vec<(String, Rgb, i64)>> = Vec::new();
    let mut used = i64::MAX;
    for (series, color) in chart.series.iter().zip(colors(chart)) {
        if series.name.is_empty() {
            continue;
        }
        let name = text::shorten(&series.name, scale, width / 2);
        let wide = mark + gap + text::width(&name, scale) + 2 * line;
        if used.saturating_add(wide) > width - 2 * line {
            rows.push(Vec::new());
            used = 0;
        }
        used += wide;
        if let Some(row) = rows.last_mut() {
            row.push((name, color, wide));
        }
    }
    for row in rows {
        let total: i64 = row.iter().map(|entry| entry.2).sum::<i64>() - 2 * line;
        let mut x = (width - total) / 2;
        for (name, color, wide) in row {
            let thick = (line / 3).max(2);
            image.fill(x, top + (line - thick) / 2, mark, thick, color);
            text::draw(image, x + mark + gap, top, scale, INK, &name);
            x += wide;
        }
        top += line + line / 2 + 2;
    }
    top
}

/// Numbers below an x axis, and faint lines above them.
pub(super) fn x_numbers(image: &mut Image, axis: &Axis, top: i64, bottom: i64, scale: f32) {
    let sample = axis.ticks(5);
    let widest = sample
        .values
        .iter()
        .map(|&value| text::width(&sample.label(value), scale))
        .max();
    let room = (widest.unwrap_or(0) as f64 * 2.0).max(40.0 * f64::from(scale));
    let ticks = axis.ticks(tick_count(axis, room));
    let below = bottom + (6.0 * scale) as i64;
    for &value in &ticks.values {
        let x = axis.pixel(value);
        image.fill(x.round() as i64, top, 1, bottom - top, GRID);
        centred(image, x, below, scale, FAINT, &ticks.label(value));
    }
}

/// Category names; upright within some pixels if given, and then only as many as fit.
fn names(
    chart: &Chart,
    image: &mut Image,
    axis: &Axis,
    bottom: i64,
    scale: f32,
    upright: Option<i64>,
) {
    let below = bottom + (6.0 * scale) as i64;
    let line = text::height(scale);
    let apart = (axis.pixel(1.0) - axis.pixel(0.0)).max(1e-6);
    let every = if upright.is_some() {
        (line as f64 * 1.4 / apart).ceil().max(1.0)
    } else {
        1.0
    };
    for (index, name) in chart.categories.iter().enumerate().step_by(every as usize) {
        let x = axis.pixel(index as f64);
        if !(x >= axis.start && x <= axis.end) {
            continue;
        }
        match upright {
            Some(room) => {
                let name = text::shorten(name, scale, room);
                let start = below + text::width(&name, scale);
                let left = x.round() as i64 - line / 2;
                text::draw_upward(image, left, start, scale, FAINT, &name);
            }
            None => centred(image, x, below, scale, FAINT, name),
        }
    }
}

/// Where the bars of several series stand beside each other.
struct BarLayout {
    /// How many series have bars.
    count: usize,
    /// Of these, how many are drawn.
    drawn: usize,
    /// Least distance between two bars of a series, in x; absent without bars.
    spacing: Option<f64>,
}

impl BarLayout {
    fn new(chart: &Chart) -> Self {
        let bars = || {
            chart
                .series
                .iter()
                .filter(|series| series.style == Style::Bars)
        };
        let mut least = f64::INFINITY;
        for series in bars() {
            let mut xs: Vec<f64> = series.points.iter().map(|point| point[0]).collect();
            xs.retain(|x| x.is_finite());
            xs.sort_unstable_by(f64::total_cmp);
            let steps = xs.windows(2).map(|pair| pair[1] - pair[0]);
            least = steps.filter(|&step| step > 0.0).fold(least, f64::min);
        }
        let count = bars().count();
        let spacing = if least.is_finite() { least } else { 1.0 };
        Self {
            count,
            drawn: 0,
            spacing: (count > 0).then_some(spacing),
        }
    }

    /// Left and right edge of the bar at `x` in the current series.
    fn edges(&self, x: f64) -> [f64; 2] {
        let group = self.spacing.unwrap_or(1.0) * 0.8;
        let each = group / self.count.max(1) as f64;
        let left = x - group / 2.0 + each * self.drawn as f64;
        [left, left + each]
    }
}

fn draw(series: &Series, x: &Axis, y: &Axis, unit: f64, bars: &BarLayout, mask: &mut Mask) {
    let radius = (0.55 * unit).max(0.75) as f32;
    let place = |point: [f64; 2]| DVec2::new(x.pixel(point[0]), y.pixel(point[1]));
    match series.style {
        Style::Bars => {
            for &[value, height] in &series.points {
                if value.is_finite() && height.is_finite() {
                    let [left, right] = bars.edges(value);
                    mask.bar(place([left, 0.0]), place([right, height]));
                }
            }
        }
        Style::Dots => {
            for &point in &series.points {
                mask.stroke(place(point), place(point), radius * 2.2);
            }
        }
        Style::Line | Style::Step => {
            let places: Vec<DVec2> = series.points.iter().map(|&point| place(point)).collect();
            for piece in places.split(|place| !place.is_finite()) {
                let piece = thinned(piece);
                if let [single] = piece[..] {
                    mask.stroke(single, single, radius * 1.5);
                }
                for pair in piece.windows(2) {
                    let [from, to] = [pair[0], pair[1]];
                    if series.style == Style::Step {
                        let corner = DVec2::new(to.x, from.y);
                        mask.stroke(from, corner, radius);
                        mask.stroke(corner, to, radius);
                    } else {
                        mask.stroke(from, to, radius);
                    }
                }
            }
        }
    }
}

/// Keeps of all points in a row that fall into the same column of pixels the first, the lowest,
/// the highest and the last: the picture stays the same, and its cost that of its width.
fn thinned(places: &[DVec2]) -> Vec<DVec2> {
    let mut kept = Vec::new();
    for column in places.chunk_by(|a, b| a.x.floor() == b.x.floor()) {
        if column.len() <= 4 {
            kept.extend_from_slice(column);
            continue;
        }
        let by_height = |a: &usize, b: &usize| column[*a].y.total_cmp(&column[*b].y);
        let low = (0..column.len()).min_by(by_height).unwrap_or(0);
        let high = (0..column.len()).max_by(by_height).unwrap_or(0);
        let mut indices = [0, low, high, column.len() - 1];
        indices.sort_unstable();
        kept.extend(indices.map(|index| column[index]));
    }
    kept
}
