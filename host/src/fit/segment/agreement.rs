//! How well two segmentations of one surface agree.

use std::collections::BTreeMap;

/// Agreement of two segmentations, by area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Adjusted Rand index: 1 for the same parts, about 0 for parts at random (Hubert & Arabie
    /// 1985).
    pub rand: f64,
    /// Share of the surface that lies in parts matched one to one, the largest overlaps first.
    pub matched: f64,
}

impl Agreement {
    /// Compares labels `[cells]`, each cell counting by its weight. The index is that of a million
    /// equal pieces. O(cells log parts)
    #[must_use]
    pub fn new(a: &[u32], b: &[u32], weights: &[f64]) -> Self {
        const PIECES: f64 = 1e6;
        let total: f64 = weights.iter().sum();
        let mut both: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        let (mut of_a, mut of_b) = (BTreeMap::new(), BTreeMap::new());
        for ((&a, &b), weight) in a.iter().zip(b).zip(weights) {
            let weight = weight / total * PIECES;
            *both.entry((a, b)).or_default() += weight;
            *of_a.entry(a).or_insert(0.0) += weight;
            *of_b.entry(b).or_insert(0.0) += weight;
        }
        let pairs = |count: &f64| (count * (count - 1.0) / 2.0).max(0.0);
        let sum: f64 = both.values().map(pairs).sum();
        let (in_a, in_b): (f64, f64) = (
            of_a.values().map(pairs).sum(),
            of_b.values().map(pairs).sum(),
        );
        let by_chance = in_a * in_b / pairs(&PIECES);
        let most = f64::midpoint(in_a, in_b);
        let rand = if most > by_chance {
            (sum - by_chance) / (most - by_chance)
        } else {
            1.0
        };
        let mut overlaps: Vec<((u32, u32), f64)> = both.into_iter().collect();
        overlaps.sort_by(|a, b| b.1.total_cmp(&a.1));
        let (mut taken_a, mut taken_b, mut matched) = (Vec::new(), Vec::new(), 0.0);
        for ((a, b), weight) in overlaps {
            if !taken_a.contains(&a) && !taken_b.contains(&b) {
                taken_a.push(a);
                taken_b.push(b);
                matched += weight / PIECES;
            }
        }
        Self { rand, matched }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn renamed_parts_agree_and_crossed_ones_do_not() {
        let a = [0, 0, 1, 1, 2, 2];
        let same = Agreement::new(&a, &[7, 7, 3, 3, 5, 5], &[1.0; 6]);
        assert!((same.rand - 1.0).abs() < 1e-4 && (same.matched - 1.0).abs() < 1e-9);
        let crossed = Agreement::new(&[0, 0, 1, 1], &[0, 1, 0, 1], &[1.0; 4]);
        assert!(crossed.rand.abs() < 1e-4 && (crossed.matched - 0.5).abs() < 1e-9);
        let weighty = Agreement::new(&[0, 0, 1], &[0, 0, 0], &[1.0, 1.0, 2.0]);
        assert!((weighty.matched - 0.5).abs() < 1e-9);
    }
}
