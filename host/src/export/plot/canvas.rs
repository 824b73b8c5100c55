//! Smooth lines, bars and dots inside a rectangle.

use glam::{DVec2, Vec2};

use super::super::render::{Image, Rgb, text};

/// How much of each pixel of a rectangle one series covers. The series is mixed over the picture
/// once, so that joints and crossings of its own do not show.
pub(super) struct Mask {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
    cover: Vec<f32>,
}

impl Mask {
    pub fn new([left, top, right, bottom]: [usize; 4]) -> Self {
        let (width, height) = (right.saturating_sub(left), bottom.saturating_sub(top));
        Self {
            left,
            top,
            width,
            height,
            cover: vec![0.0; width * height],
        }
    }

    /// A segment with round ends, in pixels of the picture.
    pub fn stroke(&mut self, from: DVec2, to: DVec2, radius: f32) {
        let corner = DVec2::new(self.left as f64, self.top as f64);
        let size = DVec2::new(self.width as f64, self.height as f64);
        let margin = f64::from(radius) + 1.0;
        let ends = clip(
            [from - corner, to - corner],
            DVec2::splat(-margin),
            size + margin,
        );
        let Some([from, to]) = ends.map(|ends| ends.map(|end| end.as_vec2())) else {
            return;
        };
        let reach = radius + 1.0;
        let columns = whole(
            from.x.min(to.x) - reach,
            from.x.max(to.x) + reach,
            self.width,
        );
        for x in columns {
            // Only the rows near the part of the segment that is near this column.
            let near = |x: f32| {
                let t = if to.x == from.x {
                    0.0
                } else {
                    (x - from.x) / (to.x - from.x)
                };
                from.y + (to.y - from.y) * t.clamp(0.0, 1.0)
            };
            let middle = x as f32 + 0.5;
            let (a, b) = if to.x == from.x {
                (from.y, to.y)
            } else {
                (near(middle - reach), near(middle + reach))
            };
            for y in whole(a.min(b) - reach, a.max(b) + reach, self.height) {
                let distance = text::distance(Vec2::new(middle, y as f32 + 0.5), [from, to]);
                let cover = (radius + 0.5 - distance).clamp(0.0, 1.0);
                let old = &mut self.cover[y * self.width + x];
                *old = old.max(cover);
            }
        }
    }

    /// An upright rectangle between two opposite corners, in pixels of the picture.
    pub fn bar(&mut self, a: DVec2, b: DVec2) {
        let corner = DVec2::new(self.left as f64, self.top as f64);
        let size = DVec2::new(self.width as f64, self.height as f64);
        let low = (a.min(b) - corner).clamp(DVec2::ZERO, size).as_vec2();
        let high = (a.max(b) - corner).clamp(DVec2::ZERO, size).as_vec2();
        let share = |low: f32, high: f32, pixel: usize| {
            (high.min(pixel as f32 + 1.0) - low.max(pixel as f32)).clamp(0.0, 1.0)
        };
        for y in whole(low.y, high.y, self.height) {
            for x in whole(low.x, high.x, self.width) {
                let cover = share(low.x, high.x, x) * share(low.y, high.y, y);
                let old = &mut self.cover[y * self.width + x];
                *old = (*old + cover).min(1.0);
            }
        }
    }

    pub fn paint(&self, image: &mut Image, color: Rgb) {
        for (index, &cover) in self.cover.iter().enumerate() {
            if cover > 0.0 {
                let x = self.left + index % self.width;
                let y = self.top + index / self.width;
                image.blend(x as i64, y as i64, color, cover);
            }
        }
    }
}

/// The pixels that an interval touches, cut to `0..size`.
fn whole(low: f32, high: f32, size: usize) -> std::ops::Range<usize> {
    let clamp = |value: f32| value.clamp(0.0, size as f32) as usize;
    clamp(low.floor())..clamp(high.ceil())
}

/// The part of a segment inside a box (Liang and Barsky 1984); none if it misses or is not finite.
fn clip([from, to]: [DVec2; 2], low: DVec2, high: DVec2) -> Option<[DVec2; 2]> {
    if !(from.is_finite() && to.is_finite()) {
        return None;
    }
    let along = to - from;
    let mut range = (0.0f64, 1.0f64);
    for axis in 0..2 {
        for (speed, room) in [
            (-along[axis], from[axis] - low[axis]),
            (along[axis], high[axis] - from[axis]),
        ] {
            if speed == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if speed > 0.0 {
                range.1 = range.1.min(room / speed);
            } else {
                range.0 = range.0.max(room / speed);
            }
        }
    }
    (range.0 <= range.1).then(|| [from + along * range.0, from + along * range.1])
}

/// Writes a line with its middle at column `x`.
pub(super) fn centred(image: &mut Image, x: f64, y: i64, scale: f32, color: Rgb, line: &str) {
    let left = x.round() as i64 - text::width(line, scale) / 2;
    text::draw(image, left, y, scale, color, line);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_line_covers_whole_pixels() {
        let mut mask = Mask::new([10, 20, 18, 26]);
        mask.stroke(DVec2::new(-1e9, 23.0), DVec2::new(1e9, 23.0), 1.0);
        for y in 0..6 {
            for x in 0..8 {
                let expected = if y == 2 || y == 3 { 1.0 } else { 0.0 };
                assert_eq!(mask.cover[y * 8 + x], expected, "{x} {y}");
            }
        }
        mask.stroke(DVec2::NAN, DVec2::ZERO, 1.0);
        mask.stroke(DVec2::ZERO, DVec2::splat(3.0), 1.0);
        let mut upright = Mask::new([0, 0, 6, 8]);
        upright.stroke(DVec2::new(3.0, -5.0), DVec2::new(3.0, 50.0), 1.0);
        for y in 0..8 {
            let row = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0];
            assert_eq!(upright.cover[y * 6..y * 6 + 6], row);
        }
    }

    #[test]
    fn a_bar_covers_its_area() {
        let mut mask = Mask::new([0, 0, 10, 10]);
        mask.bar(DVec2::new(2.25, 8.0), DVec2::new(4.75, 3.5));
        assert!((mask.cover.iter().sum::<f32>() - 2.5 * 4.5).abs() < 1e-5);
        assert_eq!(mask.cover[5 * 10 + 3], 1.0);
        assert_eq!(mask.cover[5 * 10 + 2], 0.75);
        assert_eq!(mask.cover[3 * 10 + 3], 0.5);
        let mut image = Image::new(10, 10, [0; 3]);
        mask.paint(&mut image, [200; 3]);
        assert_eq!(image.pixel(3, 5), [200; 3]);
        assert_eq!(image.pixel(3, 3), [100; 3]);
        assert_eq!(image.pixel(3, 2), [0; 3]);
    }
}
