//! One palette for a whole animation, and how a colour is mixed from it.

use std::collections::{HashMap, HashSet};

use super::super::render::{Image, Rgb};

/// Frames that are looked at to choose colours, spread over the animation.
const SAMPLED_FRAMES: usize = 16;
/// Pixels that are looked at in each of them, about.
const SAMPLED_PIXELS: usize = 200_000;
const REFINEMENTS: usize = 4;

/// The colours of a GIF.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Palette {
    /// At most 256.
    colors: Vec<Rgb>,
    /// The entry that leaves a pixel as it was; absent when all 256 are needed for colours.
    transparent: Option<u8>,
    /// Every colour of the animation is in it.
    exact: bool,
}

impl Palette {
    /// Chooses up to 255 colours for all of `images`: exactly theirs if they have no more than
    /// 256, else by splitting the sampled colours where they vary most (median cut, Heckbert 1982,
    /// with the variance criterion of Wu 1991) and a few steps of k-means.
    #[must_use]
    pub fn of(images: &[Image]) -> Self {
        match distinct(images) {
            Some(colors) => {
                let transparent = u8::try_from(colors.len()).ok();
                Self {
                    colors,
                    transparent,
                    exact: true,
                }
            }
            None => Self {
                colors: quantise(histogram(images), 255),
                transparent: Some(255),
                exact: false,
            },
        }
    }

    /// The colours, without the transparent entry.
    #[must_use]
    pub fn colors(&self) -> &[Rgb] {
        &self.colors
    }

    /// The entry that leaves a pixel as it was, if there is room for one.
    pub(super) fn transparent(&self) -> Option<u8> {
        self.transparent
    }

    /// By how much a channel may differ from the painted colour before a pixel is painted again.
    pub(super) fn tolerance(&self) -> u8 {
        if self.exact { 0 } else { 2 }
    }

    /// Red, green, blue of all entries, and of the transparent one.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let mut bytes = self.colors.as_flattened().to_vec();
        if self.transparent.is_some() {
            bytes.extend([0; 3]);
        }
        bytes
    }

    /// How to paint `color`.
    pub(super) fn mixture(&self, color: Rgb) -> Mixture {
        let wanted = point(color);
        let mut nearest = 0;
        let mut least = f32::INFINITY;
        for (index, &entry) in self.colors.iter().enumerate() {
            let error = square(sub(point(entry), wanted));
            if error < least {
                (nearest, least) = (index, error);
            }
        }
        let mut best = Mixture {
            dark: nearest as u8,
            light: nearest as u8,
            darkness: 0,
        };
        if least == 0.0 {
            return best;
        }
        let first = point(self.colors[nearest]);
        for (index, &entry) in self.colors.iter().enumerate() {
            let along = sub(point(entry), first);
            let length = square(along);
            if index == nearest || length == 0.0 {
                continue;
            }
            // Shares of the Bayer matrix's 64 steps.
            let share = dot(sub(wanted, first), along) / length;
            let share = (share.clamp(0.0, 0.5) * 64.0).round() / 64.0;
            let mixed = [0, 1, 2].map(|k| first[k] + along[k] * share);
            // Far-apart colours mix to the right mean, but look coarse and compress badly.
            let contrast = share * (1.0 - share) * length;
            let error = square(sub(mixed, wanted)) + contrast * length / COARSE;
            if error < least {
                least = error;
                let other_is_darker = along.iter().sum::<f32>() < 0.0;
                let steps = (share * 64.0) as u8;
                best = if other_is_darker {
                    Mixture { dark: index as u8, light: nearest as u8, darkness: steps }
                } else {
                    Mixture { dark: nearest as u8, light: index as u8, darkness: 64 - steps }
                };
            }
        }
        best
    }
}

/// Squared distance of two entries at which their contrast is as bad as an error of its size.
const COARSE: f32 = 1024.0;

/// Two entries that look like a third colour when painted side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mixture {
    dark: u8,
    light: u8,
    /// Of 64 pixels, this many are dark.
    darkness: u8,
}

impl Mixture {
    /// The entry for the pixel at column `x`, row `y`, by Bayer's 8 x 8 matrix: the same in every
    /// frame, so that a still surface does not flicker.
    pub fn at(self, x: usize, y: usize) -> u8 {
        if bayer(x, y) < self.darkness { self.dark } else { self.light }
    }
}

/// Bayer 1973: the bits of x ^ y and y, interleaved and reversed.
fn bayer(x: usize, y: usize) -> u8 {
    let mixed = x ^ y;
    let bit = |value: usize, place: usize| (value >> place & 1) as u8;
    (0..3).fold(0, |rank, place| {
        rank | bit(mixed, place) << (5 - 2 * place) | bit(y, place) << (4 - 2 * place)
    })
}

/// A colour with its channels weighted by how much the eye notices them.
fn point(color: Rgb) -> [f32; 3] {
    const WEIGHTS: [f32; 3] = [0.85, 1.2, 0.6];
    [0, 1, 2].map(|k| f32::from(color[k]) * WEIGHTS[k])
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn square(a: [f32; 3]) -> f32 {
    dot(a, a)
}

/// All colours in ascending order, unless there are more than 256.
fn distinct(images: &[Image]) -> Option<Vec<Rgb>> {
    let mut seen = HashSet::new();
    let mut last = None;
    for image in images {
        for &color in image.rgb.as_chunks().0 {
            if last != Some(color) && seen.insert(color) && seen.len() > 256 {
                return None;
            }
            last = Some(color);
        }
    }
    let mut colors: Vec<Rgb> = seen.into_iter().collect();
    colors.sort_unstable();
    Some(colors)
}

/// A group of similar colours of the samples.
struct Bin {
    color: Rgb,
    point: [f32; 3],
    weight: f32,
}

/// The colours of some pixels of some frames, in ascending order.
fn histogram(images: &[Image]) -> Vec<Bin> {
    let frames = images.len().div_ceil(SAMPLED_FRAMES).max(1);
    let mut counts: HashMap<Rgb, u32> = HashMap::new();
    for image in images.iter().step_by(frames) {
        let pixels = image.rgb.as_chunks::<3>().0;
        // An odd step does not run down the columns of a picture of even width.
        let step = (pixels.len() / SAMPLED_PIXELS) | 1;
        for color in pixels.iter().step_by(step) {
            // The lowest bit would double the work for no visible gain.
            *counts.entry(color.map(|byte| byte & !1 | byte >> 7)).or_default() += 1;
        }
    }
    let mut bins: Vec<Bin> = counts
        .into_iter()
        .map(|(color, count)| Bin {
            color,
            point: point(color),
            // The root keeps a wide background from taking most entries.
            weight: (count as f32).sqrt(),
        })
        .collect();
    bins.sort_unstable_by_key(|bin| bin.color);
    bins
}

/// Chooses `count` colours that represent the bins.
fn quantise(mut bins: Vec<Bin>, count: usize) -> Vec<Rgb> {
    let mut boxes = vec![Spread::of(&bins, 0..bins.len())];
    while boxes.len() < count {
        let widest = boxes.iter().enumerate().max_by(|a, b| a.1.error.total_cmp(&b.1.error));
        let Some((index, _)) = widest.filter(|(_, widest)| widest.error > 0.0) else {
            break;
        };
        let Spread { range, axis, mean, .. } = boxes.swap_remove(index);
        let part = &mut bins[range.clone()];
        part.sort_unstable_by(|a, b| {
            a.point[axis].total_cmp(&b.point[axis]).then(a.color.cmp(&b.color))
        });
        let below = part.partition_point(|bin| bin.point[axis] < mean[axis]);
        // Rounding can put the mean at or below the least value.
        let middle = range.start + below.clamp(1, part.len() - 1);
        boxes.push(Spread::of(&bins, range.start..middle));
        boxes.push(Spread::of(&bins, middle..range.end));
    }
    let mut means: Vec<[f32; 3]> = boxes.iter().map(|part| part.mean).collect();
    for _ in 0..REFINEMENTS {
        refine(&bins, &mut means);
    }
    let unit = point([1; 3]);
    let color = |mean: [f32; 3]| [0, 1, 2].map(|k| (mean[k] / unit[k]).round() as u8);
    let mut colors: Vec<Rgb> = means.into_iter().map(color).collect();
    colors.sort_unstable();
    colors.dedup();
    colors
}

/// Mean and spread of some bins.
struct Spread {
    range: std::ops::Range<usize>,
    mean: [f32; 3],
    /// Along which they vary most.
    axis: usize,
    /// Weighted sum of squares along that axis.
    error: f32,
}

impl Spread {
    fn of(bins: &[Bin], range: std::ops::Range<usize>) -> Self {
        let part = &bins[range.clone()];
        let total: f32 = part.iter().map(|bin| bin.weight).sum();
        let sum = |value: &dyn Fn(&Bin) -> f32| {
            part.iter().map(|bin| value(bin) * bin.weight).sum::<f32>()
        };
        let mean = [0, 1, 2].map(|k| sum(&|bin| bin.point[k]) / total.max(f32::MIN_POSITIVE));
        let errors = [0, 1, 2].map(|k| sum(&|bin| (bin.point[k] - mean[k]).powi(2)));
        let axis = (0..3).max_by(|&a, &b| errors[a].total_cmp(&errors[b])).unwrap_or(0);
        // One bin cannot be split, whatever rounding says about its spread.
        let error = if part.len() < 2 { 0.0 } else { errors[axis] };
        Self {
            range,
            mean,
            axis,
            error,
        }
    }
}

/// One step of k-means (Lloyd 1982).
fn refine(bins: &[Bin], means: &mut [[f32; 3]]) {
    let mut sums = vec![([0.0; 3], 0.0); means.len()];
    for bin in bins {
        let mut nearest = 0;
        let mut least = f32::INFINITY;
        for (index, &mean) in means.iter().enumerate() {
            let error = square(sub(mean, bin.point));
            if error < least {
                (nearest, least) = (index, error);
            }
        }
        let (sum, weight) = &mut sums[nearest];
        for (sum, value) in sum.iter_mut().zip(bin.point) {
            *sum += value * bin.weight;
        }
        *weight += bin.weight;
    }
    for (mean, (sum, weight)) in means.iter_mut().zip(sums) {
        if weight > 0.0 {
            *mean = sum.map(|value| value / weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(colors: &[Rgb]) -> Image {
        Image {
            width: colors.len(),
            height: 1,
            rgb: colors.as_flattened().to_vec(),
        }
    }

    #[test]
    fn up_to_256_colours_are_kept_exactly() {
        for count in [1, 2, 255, 256] {
            let colors: Vec<Rgb> = (0..count).map(|k| [k as u8, 7, (k / 2) as u8]).collect();
            let palette = Palette::of(&[image(&colors), image(&colors[..1])]);
            assert_eq!(palette.colors(), colors);
            assert_eq!(palette.transparent(), u8::try_from(count).ok());
            for (index, &color) in colors.iter().enumerate() {
                assert_eq!(palette.mixture(color).at(3, 5), index as u8);
            }
        }
    }

    #[test]
    fn more_colours_are_chosen_near_the_pictures_own() {
        let colors: Vec<Rgb> = (0..1000).map(|k| [(k % 250) as u8, (k / 4) as u8, 128]).collect();
        let palette = Palette::of(&[image(&colors)]);
        assert!(palette.colors().len() > 200 && palette.colors().len() <= 255);
        assert_eq!(palette.transparent(), Some(255));
        let worst = colors.iter().map(|&color| {
            let errors = palette.colors().iter().map(|&entry| square(sub(point(color), point(entry))));
            errors.fold(f32::INFINITY, f32::min).sqrt()
        });
        assert!(worst.fold(0.0, f32::max) < 16.0);
    }

    #[test]
    fn a_colour_between_two_entries_is_mixed_to_its_mean() {
        let palette = Palette {
            colors: vec![[100; 3], [108; 3], [255, 0, 0]],
            transparent: None,
            exact: false,
        };
        for wanted in [100, 101, 103, 104, 106, 108] {
            let mixture = palette.mixture([wanted; 3]);
            let mut sum = 0;
            for y in 0..8 {
                for x in 0..8 {
                    sum += i32::from(palette.colors[usize::from(mixture.at(x, y))][0]);
                }
            }
            assert_eq!(sum, 64 * i32::from(wanted), "{wanted}");
        }
    }

    #[test]
    fn the_matrix_holds_every_rank_once() {
        let mut ranks: Vec<u8> = (0..64).map(|k| bayer(k % 8, k / 8)).collect();
        assert_eq!(ranks[..4], [0, 32, 8, 40]);
        ranks.sort_unstable();
        assert_eq!(ranks, (0..64).collect::<Vec<u8>>());
    }
}
