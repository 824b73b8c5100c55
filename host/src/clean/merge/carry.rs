//! Where a track that is out of sight should be: carried by its neighbours.
//!
//! The neighbours are carried from one frame to the other rigidly (equation 2 of Park & Hodgins
//! 2006, with the track's last sight as the reference pose, as skin deforms less since then than
//! since the beginning); what is left of them bends and stretches the place between them. How far
//! they still are from where they should be tells how sure the place is.

use glam::{DMat3, DVec3};

use super::super::linear::Cholesky;
use super::super::rigid::Rigid;
use super::rings::Ring;
use super::tracks::Tracks;

/// Fewest neighbours that fix a rigid motion.
const LEAST: usize = 3;
/// Neighbours used.
const MOST: usize = 12;
/// Neighbours from which on stretching is learned.
const STRETCHED: usize = 6;
/// Weight of no stretching, over the spread of the neighbours.
const RIDGE: f64 = 0.15;
/// Least deviation, over spacing: what the noise of a capture leaves of any place.
const FLOOR: f64 = 0.01;

/// How much further from where it should be the carried track is than the neighbours that were
/// fitted are, in bending skin.
const BEYOND: f64 = 1.7;

/// An expected place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub position: DVec3,
    /// Standard deviation an axis, metres.
    pub sigma: f64,
    /// How many neighbours stand behind it.
    pub support: usize,
}

/// A neighbour in both frames.
struct Pair {
    from: DVec3,
    to: DVec3,
    weight: f64,
    left: DVec3,
}

/// Where a track at `origin` in frame `from` should be in frame `to`; `None` unless three
/// neighbours are seen in both.
pub(super) fn carry(
    tracks: &Tracks<'_>,
    ring: &Ring,
    origin: DVec3,
    from: usize,
    to: usize,
) -> Option<Place> {
    let mut pairs: Vec<Pair> = Vec::with_capacity(MOST);
    for &(other, weight) in &ring.members {
        let Some(a) = tracks.position(other, from) else {
            continue;
        };
        let Some(b) = tracks.position(other, to) else {
            continue;
        };
        pairs.push(Pair {
            from: a,
            to: b,
            weight,
            left: DVec3::ZERO,
        });
        if pairs.len() == MOST {
            break;
        }
    }
    if pairs.len() < LEAST {
        return None;
    }
    let floor = FLOOR * ring.spacing;
    let mut motion = Rigid::IDENTITY;
    let mut spread = 0.0;
    for round in 0..2 {
        motion = Rigid::fit(pairs.iter().map(|p| (p.from, p.to, p.weight)))?;
        for pair in &mut pairs {
            pair.left = pair.to - motion.apply(pair.from);
        }
        spread = mean_square(&pairs).max(floor * floor);
        if round == 0 {
            // Neighbours of another part of the body, or that wear a wrong label, lose their say.
            for pair in &mut pairs {
                pair.weight /= 1.0 + pair.left.length_squared() / (3.0 * spread);
            }
        }
    }
    let place = motion.apply(origin);
    let stretch = (pairs.len() >= STRETCHED)
        .then(|| stretch(&mut pairs, &motion, place))
        .flatten();
    if stretch.is_some() {
        spread = 0.5 * (spread + mean_square(&pairs));
    }
    let count = pairs.len() as f64;
    // A motion has six degrees of freedom, a point three: two points' worth is spent on the fit.
    let sigma = BEYOND * (spread * count / (count - 2.0) + floor * floor).sqrt();
    Some(Place {
        position: place + stretch.unwrap_or(DVec3::ZERO),
        sigma,
        support: pairs.len(),
    })
}

/// Weighted mean square an axis of what is left.
fn mean_square(pairs: &[Pair]) -> f64 {
    let total: f64 = pairs.iter().map(|pair| pair.weight).sum();
    let sum = pairs.iter().map(|p| p.weight * p.left.length_squared());
    sum.sum::<f64>() / (3.0 * total)
}

/// What the neighbours' remainders, as a ridge-damped linear function of the place, are at
/// `place`; it is taken off the remainders.
fn stretch(pairs: &mut [Pair], motion: &Rigid, place: DVec3) -> Option<DVec3> {
    let total: f64 = pairs.iter().map(|pair| pair.weight).sum();
    let at = |pair: &Pair| motion.apply(pair.from);
    let middle = pairs.iter().map(|p| p.weight * at(p)).sum::<DVec3>() / total;
    let mut gram = DMat3::ZERO;
    let mut right = DMat3::ZERO;
    for pair in pairs.iter() {
        let arm = at(pair) - middle;
        gram += outer(arm, arm) * pair.weight;
        right += outer(pair.left, arm) * pair.weight;
    }
    let trace = gram.x_axis.x + gram.y_axis.y + gram.z_axis.z;
    let mut matrix = vec![0.0; 9];
    for row in 0..3 {
        for column in 0..3 {
            matrix[3 * row + column] = gram.col(column)[row];
        }
        matrix[4 * row] += RIDGE * trace / 3.0 + 1e-12;
    }
    let factor = Cholesky::new(3, matrix)?;
    let apply = |arm: DVec3| {
        let mut solved = arm.to_array();
        factor.solve(&mut solved, 1);
        right * DVec3::from(solved)
    };
    for pair in pairs.iter_mut() {
        pair.left -= apply(motion.apply(pair.from) - middle);
    }
    Some(apply(place - middle))
}

/// `a b'`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Where a track should be in a frame in which it is not seen: carried from its last and its next
/// sight, the surer counting more.
pub(super) fn expect(
    tracks: &Tracks<'_>,
    ring: &Ring,
    track: usize,
    frame: usize,
) -> Option<Place> {
    let mut found: Option<Place> = None;
    for from in tracks.sights(track, frame).into_iter().flatten() {
        let Some(origin) = tracks.position(track, from) else {
            continue;
        };
        let Some(place) = carry(tracks, ring, origin, from, frame) else {
            continue;
        };
        found = Some(match found {
            None => place,
            Some(other) => {
                let [a, b] = [other, place].map(|place| place.sigma.powi(-2));
                Place {
                    position: (other.position * a + place.position * b) / (a + b),
                    // Both may be wrong alike: two agree as one does.
                    sigma: (2.0 / (a + b)).sqrt(),
                    support: other.support.min(place.support),
                }
            }
        });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::fragments::Fragment;
    use super::*;
    use crate::take::Take;

    #[test]
    fn a_hexagon_carries_its_middle() {
        // Markers 0 to 5 move by +Y and stretch along X; marker 6 is seen only before.
        let corner = |at: usize| {
            let angle = std::f64::consts::TAU * at as f64 / 6.0;
            0.05 * DVec3::new(angle.cos(), 0.0, angle.sin())
        };
        let moved = |p: DVec3| DVec3::new(1.04 * p.x, p.y + 1.0, p.z);
        let middle = DVec3::new(0.02, 0.0, 0.0);
        let mut positions: Vec<DVec3> = (0..6)
            .flat_map(|at| [corner(at), moved(corner(at))])
            .collect();
        positions.extend([middle, DVec3::NAN]);
        let labels = (0..7).map(|at| format!("*{at}")).collect();
        let take = Take::new(labels, 100.0, 2, positions).unwrap();
        let fragments: Vec<Fragment> = (0..7)
            .map(|column| Fragment {
                column,
                start: 0,
                end: if column == 6 { 1 } else { 2 },
            })
            .collect();
        let tracks = Tracks::new(&take, &fragments, &[]);
        let ring = |count: usize| Ring {
            members: (0..count).map(|at| (at, 1.0)).collect(),
            spacing: 0.05,
        };
        let place = expect(&tracks, &ring(6), 6, 1).unwrap();
        assert!(place.position.distance(moved(middle)) < 2e-4, "{place:?}");
        assert_eq!(place.support, 6);
        assert!(place.sigma < 3e-3);
        assert_eq!(expect(&tracks, &ring(2), 6, 1), None, "two fix no motion");
        let rigid = expect(&tracks, &ring(3), 6, 1).unwrap();
        assert!(rigid.position.distance(moved(middle)) < 3e-3);
    }
}
