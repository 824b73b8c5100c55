//! Clusters made into parts: connected, none too small, with borders where rigid motions meet.

use super::rigidity::Piece;

/// Rounds in which border pieces may change sides.
const ROUNDS: usize = 12;
/// What a side of a border costs, over what the mean piece deviates: keeps borders short.
const BORDER: f64 = 0.5;
/// A small region is a part if it leaves less than this part of what joining it would add.
const RIGID: f64 = 0.25;
/// Regions are cut finer while one deviates from a rigid motion by this many times what is asked.
const LOOSE: f64 = 3.0;

/// Regions of patches, while they change.
pub(super) struct Regions<'a> {
    pieces: &'a [Piece],
    areas: &'a [f64],
    beside: &'a [Vec<u32>],
    /// `[patches]`
    label: Vec<usize>,
    /// `[regions]`: emptied ones have no area.
    sums: Vec<Piece>,
    sizes: Vec<f64>,
    lefts: Vec<f64>,
}

impl<'a> Regions<'a> {
    /// The connected regions of clusters. O(patches frames)
    pub fn new(
        clusters: &[u32],
        pieces: &'a [Piece],
        areas: &'a [f64],
        beside: &'a [Vec<u32>],
    ) -> Self {
        let mut regions = Self {
            pieces,
            areas,
            beside,
            label: connected(clusters, beside),
            sums: Vec::new(),
            sizes: Vec::new(),
            lefts: Vec::new(),
        };
        regions.sum();
        regions
    }

    fn sum(&mut self) {
        let count = self.label.iter().max().map_or(0, |most| most + 1);
        let frame_count = self.pieces.first().map_or(0, Piece::frame_count);
        self.sums = vec![Piece::empty(frame_count); count];
        self.sizes = vec![0.0; count];
        for (patch, &label) in self.label.iter().enumerate() {
            self.sums[label].add(&self.pieces[patch]);
            self.sizes[label] += self.areas[patch];
        }
        self.lefts = self.sums.iter().map(Piece::left).collect();
    }

    /// Regions that are left.
    pub fn count(&self) -> usize {
        self.sizes.iter().filter(|size| **size > 0.0).count()
    }

    /// Share of the surface in regions below a share of it.
    pub fn share_below(&self, share: f64) -> f64 {
        let total: f64 = self.areas.iter().sum();
        let small = self.sizes.iter().filter(|size| **size < share * total);
        small.sum::<f64>() / total
    }

    /// `[patches]`: numbers without holes.
    pub fn labels(&self) -> Vec<u32> {
        let mut number = vec![u32::MAX; self.sizes.len()];
        let mut next = 0;
        let of = |&label: &usize| {
            if number[label] == u32::MAX {
                number[label] = next;
                next += 1;
            }
            number[label]
        };
        self.label.iter().map(of).collect()
    }

    /// Regions that touch, each pair once.
    fn pairs(&self) -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        for (patch, beside) in self.beside.iter().enumerate() {
            for &other in beside {
                let (a, b) = (self.label[patch], self.label[other as usize]);
                if a < b {
                    pairs.push((a, b));
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// What joining two regions adds to what rigid motions leave.
    fn loss(&self, a: usize, b: usize) -> f64 {
        let both = self.sums[a].with(&self.sums[b]).left();
        (both - self.lefts[a] - self.lefts[b]).max(0.0)
    }

    fn unite(&mut self, into: usize, from: usize) {
        let sum = self.sums[from].clone();
        self.sums[into].add(&sum);
        self.sums[from] = Piece::empty(sum.frame_count());
        self.sizes[into] += std::mem::take(&mut self.sizes[from]);
        self.lefts[into] = self.sums[into].left();
        self.lefts[from] = 0.0;
        for label in &mut self.label {
            if *label == from {
                *label = into;
            }
        }
    }

    /// Gives regions below a share of the surface, the smallest first, to the neighbour with which
    /// they move best; and those up to five times as large that are no more rigid by themselves
    /// than with it, such as the skin over a joint. Whole components stay.
    pub fn absorb(&mut self, share: f64) {
        let total: f64 = self.areas.iter().sum();
        let mut sound = vec![false; self.sizes.len()];
        loop {
            let pairs = self.pairs();
            let touches = |at: usize| pairs.iter().any(|&(a, b)| a == at || b == at);
            let small = (0..self.sizes.len()).filter(|&at| {
                let size = self.sizes[at];
                let limit = if sound[at] { share } else { 5.0 * share };
                size > 0.0 && size < limit * total && touches(at)
            });
            let Some(small) = small.min_by(|&a, &b| self.sizes[a].total_cmp(&self.sizes[b])) else {
                return;
            };
            let others = pairs.iter().filter_map(|&(a, b)| match small {
                _ if a == small => Some(b),
                _ if b == small => Some(a),
                _ => None,
            });
            let losses = others.map(|other| (self.loss(small, other), other));
            let Some((loss, into)) = losses.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                return;
            };
            if self.sizes[small] >= share * total && self.lefts[small] < RIGID * loss {
                sound[small] = true;
                continue;
            }
            self.unite(into, small);
            sound[into] = false;
        }
    }

    /// The patches of each region that is large enough to be a part and far from rigid.
    pub fn loose(&self, share: f64, apart: f64) -> Vec<Vec<usize>> {
        let total: f64 = self.areas.iter().sum();
        let is = |&region: &usize| {
            let (left, size) = (self.lefts[region], self.sizes[region]);
            size >= share * total && left > (LOOSE * apart).powi(2) * size
        };
        let patches = |region: usize| {
            (0..self.label.len())
                .filter(|&at| self.label[at] == region)
                .collect()
        };
        (0..self.sizes.len()).filter(is).map(patches).collect()
    }

    /// Joins the two neighbours that lose least by it, until there are `wanted`, or until joining
    /// any two would move the smaller by more than `apart` metres, root mean square.
    pub fn join(&mut self, wanted: Option<usize>, apart: f64) {
        let mut known: Vec<((usize, usize), f64)> = Vec::new();
        while self.count() > wanted.unwrap_or(1) {
            let pairs = self.pairs();
            known.retain(|(pair, _)| pairs.binary_search(pair).is_ok());
            for &(a, b) in &pairs {
                if !known.iter().any(|(pair, _)| *pair == (a, b)) {
                    let moved = self.loss(a, b) / self.sizes[a].min(self.sizes[b]);
                    known.push(((a, b), moved.sqrt()));
                }
            }
            let best = known.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            let Some(&((a, b), moved)) = best else { return };
            if wanted.is_none() && moved > apart {
                return;
            }
            let (into, from) = if self.sizes[a] >= self.sizes[b] {
                (a, b)
            } else {
                (b, a)
            };
            self.unite(into, from);
            known.retain(|((a, b), _)| ![*a, *b].iter().any(|at| *at == into || *at == from));
        }
    }

    /// Lets patches at borders go to the side with which they move better, and keeps parts whole.
    pub fn settle(&mut self) {
        for _ in 0..ROUNDS {
            let motions: Vec<_> = self.sums.iter().map(Piece::motions).collect();
            let unit = self.lefts.iter().sum::<f64>() / self.pieces.len() as f64;
            let mut moved = 0;
            for patch in 0..self.pieces.len() {
                let own = self.label[patch];
                let cost = |label: usize| {
                    let other = self.beside[patch]
                        .iter()
                        .filter(|&&at| self.label[at as usize] != label)
                        .count();
                    self.pieces[patch].left_by(&motions[label]) + BORDER * unit * other as f64
                };
                let sides = self.beside[patch].iter().map(|&at| self.label[at as usize]);
                let sides = sides.filter(|&label| label != own);
                let best = sides
                    .map(|label| (cost(label), label))
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((_, to)) = best.filter(|(found, _)| *found < cost(own))
                    && !self.is_last(patch)
                {
                    self.label[patch] = to;
                    moved += 1;
                }
            }
            let labels: Vec<u32> = self.label.iter().map(|&label| label as u32).collect();
            self.label = whole(&labels, self.areas, self.beside);
            self.sum();
            if moved == 0 {
                break;
            }
        }
    }

    fn is_last(&self, patch: usize) -> bool {
        self.label
            .iter()
            .filter(|label| **label == self.label[patch])
            .count()
            < 2
    }

    /// The same for single triangles along the borders; `piece` gives one in all frames.
    pub fn settle_finely(
        &self,
        labels: &mut Vec<u32>,
        beside: &[Vec<u32>],
        piece: &dyn Fn(usize) -> Piece,
    ) {
        let mut number = vec![None; self.sums.len()];
        for (patch, &label) in self.labels().iter().enumerate() {
            number[label as usize] = Some(self.label[patch]);
        }
        let motions: Vec<_> = self.sums.iter().map(Piece::motions).collect();
        let mean = self.lefts.iter().sum::<f64>() / labels.len() as f64;
        let mut pieces: Vec<Option<Piece>> = vec![None; labels.len()];
        for _ in 0..ROUNDS {
            let mut moved = false;
            for at in 0..labels.len() {
                let own = labels[at];
                if beside[at]
                    .iter()
                    .all(|&other| labels[other as usize] == own)
                {
                    continue;
                }
                let piece = pieces[at].get_or_insert_with(|| piece(at));
                let cost = |label: u32| {
                    let other = beside[at]
                        .iter()
                        .filter(|&&at| labels[at as usize] != label);
                    let border = BORDER * mean * other.count() as f64;
                    let motions = number[label as usize].map(|label: usize| &motions[label]);
                    motions.map_or(f64::INFINITY, |motions| piece.left_by(motions)) + border
                };
                let sides = beside[at].iter().map(|&other| labels[other as usize]);
                let best = sides
                    .map(|label| (cost(label), label))
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((_, to)) = best.filter(|(found, to)| *to != own && *found < cost(own)) {
                    labels[at] = to;
                    moved = true;
                }
            }
            if !moved {
                break;
            }
        }
        let whole = whole(labels, &vec![1.0; labels.len()], beside);
        *labels = whole.into_iter().map(|label| label as u32).collect();
    }
}

/// Connected regions of equal labels, numbered in order of their first cell.
fn connected(labels: &[u32], beside: &[Vec<u32>]) -> Vec<usize> {
    let mut region = vec![usize::MAX; labels.len()];
    let mut count = 0;
    for first in 0..labels.len() {
        if region[first] != usize::MAX {
            continue;
        }
        region[first] = count;
        let mut list = vec![first];
        let mut at = 0;
        while let Some(&cell) = list.get(at) {
            at += 1;
            for other in beside[cell].iter().map(|&other| other as usize) {
                if region[other] == usize::MAX && labels[other] == labels[cell] {
                    region[other] = count;
                    list.push(other);
                }
            }
        }
        count += 1;
    }
    region
}

/// Labels in which every part is connected: what is cut off from the largest piece of its part goes
/// to the neighbour with the longest border. Whole components of the surface stay.
fn whole(labels: &[u32], areas: &[f64], beside: &[Vec<u32>]) -> Vec<usize> {
    let mut label: Vec<u32> = labels.to_vec();
    for _ in 0..8 {
        let region = connected(&label, beside);
        let count = region.iter().max().map_or(0, |most| most + 1);
        let mut sizes = vec![0.0; count];
        let mut of = vec![0; count];
        for (cell, &at) in region.iter().enumerate() {
            sizes[at] += areas[cell];
            of[at] = label[cell];
        }
        let most = label.iter().max().map_or(0, |most| *most as usize + 1);
        let mut largest: Vec<Option<usize>> = vec![None; most];
        for at in 0..count {
            let best = &mut largest[of[at] as usize];
            if best.is_none_or(|best| sizes[at] > sizes[best]) {
                *best = Some(at);
            }
        }
        let mut borders: Vec<Vec<(u32, u32)>> = vec![Vec::new(); count];
        for (cell, &at) in region.iter().enumerate() {
            if largest[of[at] as usize] == Some(at) {
                continue;
            }
            for &other in &beside[cell] {
                let to = label[other as usize];
                if to != label[cell] {
                    match borders[at].iter_mut().find(|(known, _)| *known == to) {
                        Some((_, sides)) => *sides += 1,
                        None => borders[at].push((to, 1)),
                    }
                }
            }
        }
        let goes: Vec<Option<u32>> = borders
            .iter()
            .map(|borders| {
                borders
                    .iter()
                    .max_by_key(|border| border.1)
                    .map(|border| border.0)
            })
            .collect();
        if goes.iter().all(Option::is_none) {
            break;
        }
        for (cell, &at) in region.iter().enumerate() {
            if let Some(to) = goes[at] {
                label[cell] = to;
            }
        }
    }
    label.into_iter().map(|label| label as usize).collect()
}
