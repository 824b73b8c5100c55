//! Where a marker stands among the markers most rigid with it, whatever a part of the labels says.

use glam::DVec3;

use super::super::fill::in_parallel;
use super::super::rigid::Rigid;
use crate::take::Take;

/// Neighbours that carry a place, and fewest that do.
const SET: usize = 10;
const LEAST: usize = 4;
/// Frames learned from.
const FRAMES: usize = 400;
/// Least deviation of a place an axis, metres: markers and skin shift.
const FLOOR: f64 = 3e-3;
/// Median of the absolute value of a normal variable, inversely.
const MAD: f64 = 1.4826;
/// Rounds that weigh neighbours down which stand elsewhere.
const ROUNDS: usize = 3;
/// Degrees of freedom of the distribution of places: poses beyond those learned are common.
const FREEDOM: f64 = 4.0;

/// Places of all named markers.
pub(super) struct Places {
    markers: Vec<usize>,
    /// `[markers of the take]`; `None` where too little is seen.
    own: Vec<Option<Own>>,
}

/// The place of one marker.
struct Own {
    members: Vec<Member>,
    home: DVec3,
    /// Standard deviation an axis, metres.
    sigma: f64,
}

struct Member {
    marker: usize,
    /// In the local frame; NaN as long as it is not known.
    shape: DVec3,
    weight: f64,
}

/// Where a marker is expected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub position: DVec3,
    /// Standard deviation an axis, metres.
    pub sigma: f64,
}

impl Places {
    pub fn learn(take: &Take, markers: &[usize]) -> Self {
        let learned = in_parallel(markers, |marker| Own::learn(take, markers, marker));
        let mut own: Vec<Option<Own>> = (0..take.marker_count()).map(|_| None).collect();
        for (&marker, learned) in markers.iter().zip(learned) {
            own[marker] = learned;
        }
        Self {
            markers: markers.to_vec(),
            own,
        }
    }

    /// Named markers whose place is known.
    pub fn markers(&self) -> impl Iterator<Item = usize> + '_ {
        let all = self.markers.iter().copied();
        all.filter(|&marker| self.own[marker].is_some())
    }

    /// Where the others expect a marker; `except` has no say.
    pub fn expect(&self, take: &Take, marker: usize, frame: usize, except: usize) -> Option<Place> {
        let own = self.own[marker].as_ref()?;
        let (pose, spread) = own.pose(take, frame, except)?;
        Some(Place {
            position: pose.apply(own.home),
            sigma: (own.sigma * own.sigma + spread).sqrt(),
        })
    }
}

/// Logarithm of the density of a sight at a place, but for what all places share.
pub(super) fn log_density(place: &Place, seen: DVec3) -> f64 {
    let square = place.position.distance_squared(seen) / (FREEDOM * place.sigma * place.sigma);
    -0.5 * (FREEDOM + 3.0) * square.ln_1p() - 3.0 * place.sigma.ln()
}

impl Own {
    fn learn(take: &Take, markers: &[usize], marker: usize) -> Option<Self> {
        let seen: Vec<usize> = take.traces(marker).flatten().collect();
        let step = seen.len().div_ceil(FRAMES).max(1);
        let frames: Vec<usize> = seen.into_iter().step_by(step).collect();
        let ranked = rank(take, markers, marker, &frames);
        if ranked.len() < LEAST {
            return None;
        }
        // The frame in which most neighbours are seen at their usual distances.
        let usual = |frame: usize| {
            let here = take.trajectory(marker)[frame];
            let shows = |one: &&Ranked| {
                let distance = take.trajectory(one.marker)[frame].distance(here);
                (distance - one.distance).abs() < 2.0 * one.spread + FLOOR
            };
            ranked.iter().filter(shows).count()
        };
        let reference = frames.iter().copied().max_by_key(|&frame| usual(frame))?;
        let members = ranked.iter().map(|one| Member {
            marker: one.marker,
            shape: take.trajectory(one.marker)[reference],
            weight: (one.spread * one.spread + FLOOR * FLOOR).recip(),
        });
        let mut own = Self {
            members: members.collect(),
            home: take.trajectory(marker)[reference],
            sigma: FLOOR,
        };
        for _ in 0..2 {
            own.refine(take, marker, &frames)?;
        }
        Some(own)
    }

    /// Medians of all places in the local frame.
    fn refine(&mut self, take: &Take, marker: usize, frames: &[usize]) -> Option<()> {
        let mut homes = Vec::with_capacity(frames.len());
        let mut shapes: Vec<Vec<DVec3>> = vec![Vec::new(); self.members.len()];
        for &frame in frames {
            let Some((pose, _)) = self.pose(take, frame, marker) else {
                continue;
            };
            let local = pose.inverse();
            homes.push(local.apply(take.trajectory(marker)[frame]));
            for (shape, member) in shapes.iter_mut().zip(&self.members) {
                let place = take.trajectory(member.marker)[frame];
                if !place.is_nan() {
                    shape.push(local.apply(place));
                }
            }
        }
        if homes.len() < 2 * LEAST {
            return None;
        }
        self.home = middle(&mut homes);
        let mut away: Vec<f64> = homes
            .iter()
            .flat_map(|home| (*home - self.home).abs().to_array())
            .collect();
        self.sigma = (MAD * median(&mut away)).max(FLOOR);
        for (member, shape) in self.members.iter_mut().zip(&mut shapes) {
            if !shape.is_empty() {
                member.shape = middle(shape);
            }
        }
        Some(())
    }

    /// From the local frame to the take's space, and the variance an axis that it leaves.
    fn pose(&self, take: &Take, frame: usize, except: usize) -> Option<(Rigid, f64)> {
        let mut pairs: Vec<(DVec3, DVec3, f64, f64)> = Vec::with_capacity(SET);
        for member in &self.members {
            let place = take.trajectory(member.marker)[frame];
            if member.marker != except && !place.is_nan() && !member.shape.is_nan() {
                pairs.push((member.shape, place, member.weight, 1.0));
            }
        }
        if pairs.len() < LEAST {
            return None;
        }
        let mut pose = Rigid::IDENTITY;
        let mut spread = 0.0;
        for _ in 0..ROUNDS {
            pose = Rigid::fit(pairs.iter().map(|&(from, to, w, say)| (from, to, w * say)))?;
            let (mut sum, mut total) = (0.0, 0.0);
            for (from, to, weight, say) in &mut pairs {
                // Squared, in deviations of this neighbour.
                let left = pose.apply(*from).distance_squared(*to) * *weight / 3.0;
                sum += *say * left;
                total += *say * *weight;
                *say = (1.0 + left / FREEDOM).recip();
            }
            spread = sum / total;
        }
        Some((pose, spread))
    }
}

struct Ranked {
    marker: usize,
    distance: f64,
    spread: f64,
}

/// The markers whose distance varies least, by medians.
fn rank(take: &Take, markers: &[usize], marker: usize, frames: &[usize]) -> Vec<Ranked> {
    let own = take.trajectory(marker);
    let need = (frames.len() / 10).max(2 * LEAST);
    let mut ranked: Vec<Ranked> = Vec::new();
    for &other in markers.iter().filter(|&&other| other != marker) {
        let path = take.trajectory(other);
        let distances = frames.iter().map(|&frame| own[frame].distance(path[frame]));
        let mut distances: Vec<f64> = distances.filter(|distance| !distance.is_nan()).collect();
        if distances.len() < need {
            continue;
        }
        let distance = median(&mut distances);
        for value in &mut distances {
            *value = (*value - distance).abs();
        }
        ranked.push(Ranked {
            marker: other,
            distance,
            spread: MAD * median(&mut distances),
        });
    }
    let score = |one: &Ranked| one.spread.powi(2) + (0.02 * one.distance).powi(2);
    ranked.sort_by(|a, b| score(a).total_cmp(&score(b)).then(a.marker.cmp(&b.marker)));
    ranked.truncate(SET);
    ranked
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The median of each coordinate.
fn middle(points: &mut [DVec3]) -> DVec3 {
    let along = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
        median(&mut values)
    };
    DVec3::new(along(0), along(1), along(2))
}
