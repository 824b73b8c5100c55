//! Constellations of four: the whole set from nothing, and lost groups from what is found.
//!
//! A seed has six distances and a handedness, so four points that match it are rarely others.
//! Where some of its markers are found, only the rest is looked for.

use glam::Vec3;

use super::Frame;
use super::associate::contradiction;
use super::fill::{self, expect, placed};
use super::pace::square;
use super::recall::Recall;
use super::state::NONE;

/// Markers that make a find believable, where there are so many points.
const ENOUGH: usize = 8;
/// Markers that are compared with their fill before a find is believed.
pub(super) const WITNESSES: usize = 16;

/// What a search came to.
enum Search {
    None,
    /// Points of the four, in the seed's order.
    One([usize; 4]),
    /// More than one way.
    Ambiguous,
    /// The budget ended before it was over.
    Unfinished,
}

/// A seed and where its markers are, those found first.
struct Seed {
    markers: [usize; 4],
    /// Points of found markers.
    fixed: [Option<usize>; 4],
    /// Place in the asset's row.
    places: [usize; 4],
    rings: [[Ring; 4]; 4],
    volume: f32,
}

/// Squared distances that count as one distance.
#[derive(Clone, Copy, Default)]
struct Ring {
    least: f32,
    most: f32,
    reach: f32,
}

impl Ring {
    fn new(distance: f32, tolerance: f32) -> Self {
        let (near, far) = ((distance - tolerance).max(0.0), distance + tolerance);
        Self {
            least: near * near,
            most: far * far,
            reach: far,
        }
    }

    #[inline]
    fn holds(&self, a: Vec3, b: Vec3) -> bool {
        let distance2 = a.distance_squared(b);
        distance2 >= self.least && distance2 <= self.most
    }
}

impl Frame<'_, '_> {
    fn seed(&self, seed: usize) -> Option<Seed> {
        let (markers, &[ab, ac, bc, ad, bd, cd, tolerance, volume]) = self.model.seed(seed)?;
        let distances = [
            [0.0, ab, ac, ad],
            [ab, 0.0, bc, bd],
            [ac, bc, 0.0, cd],
            [ad, bd, cd, 0.0],
        ];
        let all = markers.map(usize::from);
        // What little speaks for may have to give way.
        let points = all.map(|marker| {
            let trace = self.trace(marker);
            (trace.is_measured() && !trace.is_weak).then_some(usize::from(trace.point))
        });
        let mut places = [0; 4];
        let mut next = 0;
        for wanted in [true, false] {
            for (place, point) in points.iter().enumerate() {
                if point.is_some() == wanted
                    && let Some(slot) = places.get_mut(next)
                {
                    *slot = place;
                    next += 1;
                }
            }
        }
        let pick = |place: usize| place & 3;
        let rings =
            places.map(|i| places.map(|j| Ring::new(distances[pick(i)][pick(j)], tolerance)));
        Some(Seed {
            markers: places.map(|place| all[pick(place)]),
            fixed: places.map(|place| points[pick(place)]),
            places,
            rings,
            volume,
        })
    }

    /// Tries seed after seed, point after point, until the set is found or the frame's work
    /// reaches `budget`; the next frame goes on from there.
    pub(super) fn recognise(&mut self, budget: u32) {
        let seeds = self.model.dims().seed_count;
        // Once round at most, so that a frame with few points ends early.
        for _ in 0..=seeds {
            let index = self.course.seed;
            while self.course.first < self.points.len() {
                if self.points.work >= budget {
                    return;
                }
                let first = self.course.first;
                self.course.first += 1;
                let Some(seed) = self.seed(index) else {
                    break;
                };
                if let Search::One(points) = self.search(&seed, first..first + 1, budget, false)
                    && self.believe(&seed, points, budget)
                {
                    self.course.is_tracking = true;
                    self.course.poor = 0;
                    return;
                }
            }
            self.course.first = 0;
            self.course.seed = if index + 1 < seeds { index + 1 } else { 0 };
        }
    }

    /// Looks for the lost markers of seeds that have at least `found` found ones; whether any was
    /// found. `blindly`: where nothing tells a group from its mirror image, too.
    pub(super) fn complete(&mut self, found: usize, blindly: bool, budget: u32) -> bool {
        let mut any = false;
        for _ in 0..self.model.dims().seed_count {
            if self.points.work >= budget {
                break;
            }
            self.course.turn += 1;
            if self.course.turn >= self.model.dims().seed_count {
                self.course.turn = 0;
            }
            let markers = self
                .model
                .seed(self.course.turn)
                .map(|(markers, _)| markers);
            let mut markers = markers.unwrap_or_default().into_iter().map(usize::from);
            let traces = &*self.traces;
            if !markers.any(|marker| traces.get(marker).is_some_and(|trace| self.is_lost(trace))) {
                continue;
            }
            let Some(seed) = self.seed(self.course.turn) else {
                continue;
            };
            let known = seed.fixed.iter().flatten().count();
            let open = |marker: &usize| {
                let trace = self.trace(*marker);
                trace.is_weak || self.is_lost(&trace)
            };
            let lost = |marker: &usize| self.is_lost(&self.trace(*marker));
            let missing = seed.markers.iter().skip(known);
            if known < found || !missing.clone().all(open) || !missing.clone().any(lost) {
                continue;
            }
            let all = 0..self.points.len();
            if let Search::One(points) = self.search(&seed, all, budget, true)
                && self.fits(&seed, points, known, blindly)
            {
                for &marker in seed.markers.iter().skip(known) {
                    self.drop_point(marker);
                }
                for (&marker, point) in seed.markers.iter().zip(points).skip(known) {
                    let owner = usize::from(self.points.at(point).owner);
                    if owner < self.traces.len() {
                        self.lose(owner);
                    }
                    self.begin(marker, point);
                }
                any = true;
            }
        }
        any
    }

    /// Whether the found neighbours of the new ones agree. Where neither a found marker of the seed
    /// nor handedness tells left from right, there must be some.
    fn fits(&self, seed: &Seed, points: [usize; 4], known: usize, blindly: bool) -> bool {
        let mut asked = 0;
        for (&marker, point) in seed.markers.iter().zip(points).skip(known) {
            let position = self.points.at(point).position;
            let (against, count) = contradiction(self.model, self.traces, marker, position, NONE);
            if against > 4.0 * count as f32 {
                return false;
            }
            asked += count;
        }
        blindly || known >= 2 || seed.volume != 0.0 || asked >= 4
    }

    /// Points that match a seed. `firsts`: those for its first marker, where that is not found.
    fn search(
        &mut self,
        seed: &Seed,
        firsts: core::ops::Range<usize>,
        budget: u32,
        unique: bool,
    ) -> Search {
        let mut found = Search::None;
        let [
            [_, to_b, to_c, to_d],
            [_, _, b_to_c, b_to_d],
            [_, _, _, c_to_d],
            _,
        ] = seed.rings;
        let free = |frame: &Self, level: usize, at: usize| {
            let owner = frame.points.at(at).owner;
            seed.fixed[level & 3].is_some()
                || owner == NONE
                || frame.trace(usize::from(owner)).is_weak
        };
        let range =
            |frame: &Self, level: usize, centre: Vec3, ring: &Ring| match seed.fixed[level & 3] {
                Some(at) => at..at + 1,
                None => frame.points.window(centre, ring.reach),
            };
        let firsts = seed.fixed[0].map_or(firsts, |at| at..at + 1);
        for a in firsts {
            if !free(self, 0, a) {
                continue;
            }
            let pa = self.points.at(a).position;
            for b in range(self, 1, pa, &to_b) {
                self.points.work += 1;
                let pb = self.points.at(b).position;
                if b == a || !to_b.holds(pa, pb) || !free(self, 1, b) {
                    continue;
                }
                for c in range(self, 2, pa, &to_c) {
                    self.points.work += 1;
                    let pc = self.points.at(c).position;
                    if !to_c.holds(pa, pc) || !b_to_c.holds(pb, pc) || !free(self, 2, c) {
                        continue;
                    }
                    for d in range(self, 3, pa, &to_d) {
                        self.points.work += 1;
                        let pd = self.points.at(d).position;
                        if !to_d.holds(pa, pd) || !b_to_d.holds(pb, pd) || !c_to_d.holds(pc, pd) {
                            continue;
                        }
                        let distinct = c != a && c != b && d != a && d != b && d != c;
                        let points = [a, b, c, d];
                        if distinct && free(self, 3, d) && self.is_handed(seed, points) {
                            if !unique {
                                return Search::One(points);
                            }
                            if let Search::One(_) = found {
                                return Search::Ambiguous;
                            }
                            found = Search::One(points);
                        }
                    }
                    if self.points.work >= budget {
                        return Search::Unfinished;
                    }
                }
            }
        }
        found
    }

    /// Whether four points have at least a third of a seed's volume on its side, where it has one.
    fn is_handed(&self, seed: &Seed, points: [usize; 4]) -> bool {
        let mut corners = [Vec3::ZERO; 4];
        for (place, point) in seed.places.iter().zip(points) {
            corners[place & 3] = self.points.at(point).position;
        }
        let [a, b, c, d] = corners;
        let found = (b - a).cross(c - a).dot(d - a);
        let volume = seed.volume;
        volume == 0.0 || 3.0 * found * volume > volume * volume
    }

    /// Places four markers and all that follow from them; takes it back if they are too few or if
    /// their fills disagree, as those of a mirror image do.
    fn believe(&mut self, seed: &Seed, points: [usize; 4], budget: u32) -> bool {
        for (&marker, point) in seed.markers.iter().zip(points) {
            self.begin(marker, point);
        }
        match self.recall() {
            Recall::Found => {
                self.seek(budget, true, 0);
                return true;
            }
            Recall::Contradicted => {
                self.clear();
                return false;
            }
            Recall::Unknown => {}
        }
        // Only what the four lead to: a group turned over leads nowhere.
        let possible = self.points.len().min(self.traces.len());
        let enough = (possible / 2).clamp(4, ENOUGH);
        self.seek(budget, false, enough);
        if self.measured() >= enough || seed.volume != 0.0 {
            self.seek(budget, true, 0);
            let measured = self.measured();
            if (2 * measured >= possible || measured >= enough) && self.witness() {
                return true;
            }
        }
        self.clear();
        false
    }

    /// Takes all labels of the frame back.
    fn clear(&mut self) {
        for point in self.points.all_mut() {
            point.owner = NONE;
        }
        for trace in self.traces.iter_mut() {
            trace.point = NONE;
            trace.is_placed = false;
        }
    }

    /// Whether three quarters of some markers are about where their fill expects them.
    fn witness(&mut self) -> bool {
        let (mut asked, mut agreed) = (0, 0);
        let stride = self.traces.len().div_ceil(2 * WITNESSES).max(1);
        for marker in (0..self.traces.len()).step_by(stride) {
            let trace = self.trace(marker);
            if !trace.is_measured() {
                continue;
            }
            self.points.work += fill::work(self.model.dims().neighbour_count);
            let found = expect(self.model, placed(self.traces), marker, None);
            let Some(found) = found.filter(|found| found.share > 0.4) else {
                continue;
            };
            let own = self.model.marker(marker);
            let miss = found.to_local(trace.position) - found.local;
            asked += 1;
            if miss.length_squared() < square(5.0 * own.sigma + 0.03) {
                agreed += 1;
            }
        }
        4 * agreed >= 3 * asked
    }
}
