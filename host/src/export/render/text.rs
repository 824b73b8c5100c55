//! Labels in a tiny built-in font.
//!
//! The glyphs are drawn on a 5 x 7 grid with two more rows for descenders (`font.txt`). Neighbouring
//! dots are joined by round strokes, so that the font has smooth edges at any size.

use std::sync::OnceLock;

use glam::Vec2;

use super::{Image, Rgb};

/// Glyphs beyond ASCII, in the order of the font sheet; behind them stands the replacement box.
const EXTRA: &str = "°±×µ²³–…→σ";
const SHEET: &str = include_str!("font.txt");
const COLUMNS: usize = 5;
const ROWS: usize = 9;
/// Between two glyphs, in grid units.
const GAP: f32 = 1.25;
/// Rows of a capital letter.
const CAPITAL: f32 = 7.0;

/// A stroke between two dots, in grid units from the glyph's top left corner.
type Stroke = [Vec2; 2];

struct Glyph {
    strokes: Vec<Stroke>,
    /// Grid units.
    width: f32,
}

fn glyphs() -> &'static Vec<Glyph> {
    static GLYPHS: OnceLock<Vec<Glyph>> = OnceLock::new();
    GLYPHS.get_or_init(|| {
        let lines: Vec<&str> = SHEET.lines().filter(|line| !line.is_empty()).collect();
        let strips = lines.chunks_exact(ROWS);
        strips
            .flat_map(|strip| {
                let rows: Vec<Vec<&str>> = strip.iter().map(|row| row.split(' ').collect()).collect();
                (0..rows[0].len()).map(move |glyph| {
                    let dot = |x: usize, y: usize| {
                        let row = rows.get(y).and_then(|row| row.get(glyph));
                        row.is_some_and(|row| row.as_bytes().get(x) == Some(&b'#'))
                    };
                    Glyph::new(dot)
                })
            })
            .collect()
    })
}

impl Glyph {
    /// Cuts off the empty columns on both sides; a blank glyph keeps some width.
    fn new(dot: impl Fn(usize, usize) -> bool) -> Self {
        let inked = |&x: &usize| (0..ROWS).any(|y| dot(x, y));
        let (Some(first), Some(last)) = ((0..COLUMNS).find(inked), (0..COLUMNS).rfind(inked)) else {
            return Self {
                strokes: Vec::new(),
                width: 2.5,
            };
        };
        Self {
            strokes: strokes(|x, y| dot(x + first, y)),
            width: (last - first + 1) as f32,
        }
    }
}

/// Joins each dot to its neighbours; diagonally only where no other dot leads around the corner.
fn strokes(dot: impl Fn(usize, usize) -> bool) -> Vec<Stroke> {
    let centre = |x: usize, y: usize| Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
    let mut strokes = Vec::new();
    for y in 0..ROWS {
        for x in 0..COLUMNS {
            let right = dot(x + 1, y);
            let below = dot(x, y + 1);
            if dot(x, y) {
                let here = centre(x, y);
                strokes.push([here, here]);
                if right {
                    strokes.push([here, centre(x + 1, y)]);
                }
                if below {
                    strokes.push([here, centre(x, y + 1)]);
                }
                if dot(x + 1, y + 1) && !right && !below {
                    strokes.push([here, centre(x + 1, y + 1)]);
                }
            } else if right && below && !dot(x + 1, y + 1) {
                strokes.push([centre(x + 1, y), centre(x, y + 1)]);
            }
        }
    }
    strokes
}

fn glyph(character: char) -> &'static Glyph {
    let glyphs = glyphs();
    let ascii = usize::from(b'~' - b' ') + 1;
    let index = match character {
        ' '..='~' => character as usize - usize::from(b' '),
        'μ' => return glyph('µ'),
        '−' => return glyph('–'),
        _ => {
            let extra = EXTRA.chars().position(|known| known == character);
            ascii + extra.unwrap_or_else(|| EXTRA.chars().count())
        }
    };
    &glyphs[index]
}

/// Each glyph of a line and its left edge in grid units. Digits are equally wide, so that numbers
/// that change from frame to frame hold still.
fn layout(text: &str) -> impl Iterator<Item = (&'static Glyph, f32)> {
    let mut pen = 0.0;
    text.chars().map(move |character| {
        let glyph = glyph(character);
        let width = if character.is_ascii_digit() { COLUMNS as f32 } else { glyph.width };
        let left = pen + (width - glyph.width) / 2.0;
        pen += width + GAP;
        (glyph, left)
    })
}

/// Pixels from the first to the last inked column of a line.
#[must_use]
pub fn width(text: &str, scale: f32) -> i64 {
    let right = layout(text).last().map_or(0.0, |(glyph, left)| left + glyph.width);
    (right * scale).ceil() as i64
}

/// Pixels from the top of a capital letter to its foot.
#[must_use]
pub fn height(scale: f32) -> i64 {
    (CAPITAL * scale).ceil() as i64
}

/// Writes one line with the top left corner of its first capital letter at column `x`, row `y`.
///
/// `scale` is the size of a grid unit in pixels: a capital letter is 7 units high and mostly 5
/// wide. Characters that the font lacks appear as a box.
pub fn draw(image: &mut Image, x: i64, y: i64, scale: f32, color: Rgb, text: &str) {
    line(text, scale, |along, down, cover| {
        image.blend(x + along, y + down, color, cover);
    });
}

/// Writes one line that reads upward, with the top of its letters on the left: column `x`, and row
/// `y` at the start of the text.
pub fn draw_upward(image: &mut Image, x: i64, y: i64, scale: f32, color: Rgb, text: &str) {
    line(text, scale, |along, down, cover| {
        image.blend(x + down, y - along, color, cover);
    });
}

/// Calls `ink` with the offset and the cover of each inked pixel.
fn line(text: &str, scale: f32, mut ink: impl FnMut(i64, i64, f32)) {
    if !(scale > 0.0 && scale < 100.0) {
        return;
    }
    // Below two pixels a grid unit, full-width strokes would close the letters.
    let half_width = (0.42 * scale).max(0.5);
    for (glyph, left) in layout(text) {
        let left = left * scale;
        let first = (left - 1.0).floor() as i64;
        let last = (left + glyph.width * scale + 1.0).ceil() as i64;
        for row in -1..=(ROWS as f32 * scale).ceil() as i64 {
            for column in first..=last {
                let pixel = Vec2::new(column as f32 + 0.5 - left, row as f32 + 0.5) / scale;
                let distances = glyph.strokes.iter().map(|&stroke| distance(pixel, stroke));
                let distance = distances.fold(f32::INFINITY, f32::min) * scale;
                let cover = (half_width + 0.5 - distance).clamp(0.0, 1.0);
                if cover > 0.0 {
                    ink(column, row, cover);
                }
            }
        }
    }
}

/// From a point to a segment.
pub(crate) fn distance(point: Vec2, [from, to]: [Vec2; 2]) -> f32 {
    let along = to - from;
    let square = along.length_squared();
    let t = if square > 0.0 {
        ((point - from).dot(along) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    point.distance(from + along * t)
}

/// Writes a caption into the lower left corner, on a light band where the picture is busy; cut at
/// the right edge with an ellipsis.
pub fn caption(image: &mut Image, text: &str) {
    const INK: Rgb = [58, 64, 74];
    const GROUND: Rgb = [250, 250, 251];
    let scale = (image.width as f32 / 360.0).clamp(1.0, 2.0);
    let margin = (4.0 * scale) as i64;
    let text = shorten(text, scale, image.width as i64 - 3 * margin);
    let (wide, high) = (width(&text, scale), height(scale));
    let top = image.height as i64 - 2 * margin - high;
    for y in top..top + high + margin {
        for x in margin..margin + wide + margin {
            image.blend(x, y, GROUND, 0.7);
        }
    }
    draw(image, margin + margin / 2, top + margin / 2, scale, INK, &text);
}

/// The text, or as much of it as fits into some pixels, with an ellipsis.
#[must_use]
pub fn shorten(text: &str, scale: f32, pixels: i64) -> String {
    let mut shorter = text.to_owned();
    while width(&shorter, scale) > pixels && shorter.pop().is_some() {
        if shorter.ends_with('…') {
            shorter.pop();
        }
        shorter.pop();
        shorter.push('…');
        if shorter == "…" {
            break;
        }
    }
    shorter
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sheet_holds_every_glyph() {
        let needed = usize::from(b'~' - b' ') + 1 + EXTRA.chars().count() + 1;
        assert!(glyphs().len() >= needed);
        for line in SHEET.lines().filter(|line| !line.is_empty()) {
            assert!(line.split(' ').all(|cell| cell.len() == COLUMNS), "{line}");
        }
        for character in ('!'..='~').chain(EXTRA.chars()) {
            assert!(!glyph(character).strokes.is_empty(), "{character}");
        }
        assert!(glyph(' ').strokes.is_empty());
        assert!(std::ptr::eq(glyph('\u{4e2d}'), glyph('\n')), "both the box");
        assert_eq!(glyph('\n').width, 5.0);
    }

    #[test]
    fn an_l_is_a_column_and_a_foot() {
        let mut image = Image::new(7, 8, [255; 3]);
        draw(&mut image, 1, 0, 1.0, [0; 3], "L");
        let ink = |x, y| image.pixel(x, y)[0] < 10;
        let expected = |x: usize, y: usize| y < 7 && (x == 1 || (y == 6 && (1..=5).contains(&x)));
        for y in 0..8 {
            for x in 0..7 {
                assert_eq!(ink(x, y), expected(x, y), "{x} {y}");
            }
        }
        let mut upward = Image::new(8, 7, [255; 3]);
        draw_upward(&mut upward, 0, 5, 1.0, [0; 3], "L");
        assert_eq!(upward.pixel(6, 5), image.pixel(1, 6));
        assert_eq!(upward.pixel(6, 1), image.pixel(5, 6));
    }

    #[test]
    fn long_text_is_shortened_to_fit() {
        // Three letters of 5 and two gaps of 1.25 are 17.5 wide.
        assert_eq!(width("abc", 1.0), 18);
        assert_eq!(width("il", 1.0), 8);
        assert_eq!(width("11", 1.0), width("88", 1.0) - 1, "centred in equal cells");
        assert_eq!(width("", 1.0), 0);
        assert_eq!(shorten("abc", 1.0, 18), "abc");
        assert_eq!(shorten("abc", 1.0, 17), "a…");
        assert_eq!(shorten("abcdefgh", 1.0, 24), "abc…");
        assert_eq!(shorten("abc", 1.0, 0), "…");
        let mut tiny = Image::new(3, 3, [0; 3]);
        caption(&mut tiny, "far too long");
        caption(&mut Image::default(), "nothing");
    }
}
