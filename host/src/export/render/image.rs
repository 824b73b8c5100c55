//! An 8-bit picture and the conversions between its sRGB values and linear light.

use std::sync::OnceLock;

/// An sRGB colour.
pub type Rgb = [u8; 3];

/// A picture: `rgb` holds `[height x width x 3]` sRGB bytes, top row first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[height x width x 3]`.
    pub rgb: Vec<u8>,
}

impl Image {
    /// A picture of one colour.
    #[must_use]
    pub fn new(width: usize, height: usize, color: Rgb) -> Self {
        Self {
            width,
            height,
            rgb: color.repeat(width * height),
        }
    }

    /// The colour at column `x` and row `y`.
    ///
    /// # Panics
    /// Outside the picture.
    #[must_use]
    pub fn pixel(&self, x: usize, y: usize) -> Rgb {
        assert!(x < self.width && y < self.height);
        let at = (y * self.width + x) * 3;
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    /// Mixes `color` over a pixel; `alpha` from 0 (no change) to 1. Outside the picture it does
    /// nothing.
    ///
    /// Mixes in sRGB: text and thin lines look evenly heavy on light and dark grounds that way.
    pub fn blend(&mut self, x: i64, y: i64, color: Rgb, alpha: f32) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else {
            return;
        };
        if x >= self.width || y >= self.height {
            return;
        }
        let at = (y * self.width + x) * 3;
        for (old, new) in self.rgb[at..at + 3].iter_mut().zip(color) {
            let mixed = f32::from(*old) + (f32::from(new) - f32::from(*old)) * alpha;
            *old = (mixed + 0.5) as u8;
        }
    }

    /// Fills columns `x..x + width` of rows `y..y + height`, cut to the picture.
    pub fn fill(&mut self, x: i64, y: i64, width: i64, height: i64, color: Rgb) {
        let clamp = |value: i64, size: usize| value.clamp(0, size as i64) as usize;
        let columns = clamp(x, self.width)..clamp(x + width, self.width);
        for row in clamp(y, self.height)..clamp(y + height, self.height) {
            let row = row * self.width;
            for pixel in self.rgb[(row + columns.start) * 3..(row + columns.end) * 3]
                .chunks_exact_mut(3)
            {
                pixel.copy_from_slice(&color);
            }
        }
    }

    /// Copies `other` with its top left corner at column `x`, row `y`; what lies outside is cut.
    pub fn paste(&mut self, other: &Image, x: usize, y: usize) {
        let columns = other.width.min(self.width.saturating_sub(x));
        let rows = other.height.min(self.height.saturating_sub(y));
        for row in 0..rows {
            let from = row * other.width * 3;
            let to = ((y + row) * self.width + x) * 3;
            self.rgb[to..to + columns * 3].copy_from_slice(&other.rgb[from..from + columns * 3]);
        }
    }
}

/// Conversion tables between sRGB bytes and linear light (IEC 61966-2-1).
pub(super) struct Gamma {
    to_linear: [f32; 256],
    /// Indexed by the square root of linear light, which spaces the entries about evenly.
    to_srgb: Vec<u8>,
}

const STEPS: usize = 4096;

impl Gamma {
    pub(super) fn get() -> &'static Self {
        static TABLES: OnceLock<Gamma> = OnceLock::new();
        TABLES.get_or_init(|| {
            let mut to_linear = [0.0; 256];
            for (byte, linear) in to_linear.iter_mut().enumerate() {
                let s = byte as f64 / 255.0;
                *linear = if s <= 0.04045 {
                    s / 12.92
                } else {
                    ((s + 0.055) / 1.055).powf(2.4)
                } as f32;
            }
            let to_srgb = (0..=STEPS).map(|step| {
                let linear = (step as f64 / STEPS as f64).powi(2);
                let s = if linear <= 0.003_130_8 {
                    linear * 12.92
                } else {
                    1.055 * linear.powf(1.0 / 2.4) - 0.055
                };
                (s * 255.0).round() as u8
            });
            Gamma {
                to_linear,
                to_srgb: to_srgb.collect(),
            }
        })
    }

    /// Linear light of an sRGB colour.
    pub(super) fn linear(&self, color: Rgb) -> [f32; 3] {
        color.map(|byte| self.to_linear[usize::from(byte)])
    }

    /// The sRGB colour of linear light, cut to 0..1.
    pub(super) fn srgb(&self, linear: [f32; 3]) -> Rgb {
        // NaN becomes 0 in the conversion to an integer.
        linear.map(|value| {
            let step = value.clamp(0.0, 1.0).sqrt() * STEPS as f32 + 0.5;
            self.to_srgb[step as usize]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_round_trips_every_byte() {
        let gamma = Gamma::get();
        for byte in 0..=255 {
            assert_eq!(gamma.srgb(gamma.linear([byte; 3])), [byte; 3]);
        }
        assert_eq!(gamma.srgb([-1.0, 2.0, f32::NAN]), [0, 255, 0]);
        // A quarter of the light is sRGB 137, not 64.
        assert_eq!(gamma.srgb([0.25; 3]), [137; 3]);
    }

    #[test]
    fn drawing_is_cut_at_the_border() {
        let mut image = Image::new(3, 2, [0; 3]);
        image.fill(-5, 1, 6, 10, [9; 3]);
        image.blend(2, 0, [200, 100, 0], 0.5);
        image.blend(3, 0, [255; 3], 1.0);
        image.blend(-1, 0, [255; 3], 1.0);
        assert_eq!(image.rgb[..9], [0, 0, 0, 0, 0, 0, 100, 50, 0]);
        assert_eq!(image.rgb[9..], [9, 9, 9, 0, 0, 0, 0, 0, 0]);
        let mut large = Image::new(4, 2, [1; 3]);
        large.paste(&image, 2, 1);
        assert_eq!(large.pixel(1, 1), [1; 3]);
        assert_eq!(large.pixel(2, 1), [0; 3]);
        large.paste(&image, 9, 9);
    }
}
