//! Rounds of merging: the surest pairs of tracks first, short gaps before long ones.

use super::super::fill::in_parallel;
use super::choose::{Level, choose};
use super::links::{Pair, all, compare, within};
use super::rings::{rings, touches};
use super::tracks::Tracks;
use super::{MergeOptions, Progress};

/// Seconds that may lie between two tracks, in turn: what is merged over short gaps carries what
/// is merged over longer ones. At last any.
const WINDOWS: [f64; 3] = [0.1, 0.5, 2.0];

/// From the sure to the likely. The last is used once all windows are done.
const LEVELS: [Level; 3] = [level(4.0, 5.0, 0.6), level(2.5, 3.0, 1.0), level(1.0, 1.5, 1.0)];
const LAST: [Level; 2] = [level(0.0, 0.0, 1.0), level(-2.0, 2.0, 1.5)];

const fn level(odds: f64, margin: f64, factor: f64) -> Level {
    Level {
        odds,
        margin,
        factor,
    }
}

/// Odds, and difference to a rival's, below which a merge is doubtful.
pub(super) const DOUBTFUL: [f64; 2] = [2.0, 1.5];

/// A merge as it was decided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Joined {
    /// First fragment of the track that was taken in.
    pub fragment: usize,
    pub pair: Pair,
    /// Odds of the best rival.
    pub rival: f64,
}

/// Merges until nothing more can be decided. The tracks that are left are markers or ghosts.
pub(super) fn run(tracks: &mut Tracks<'_>, options: &MergeOptions, progress: &Progress<'_>) -> Vec<Joined> {
    let mut joined = Vec::new();
    if tracks.fragments.len() < 2 {
        return joined;
    }
    let touches = touches(tracks);
    let rate = tracks.take().rate();
    let windows = WINDOWS.map(|seconds| Some((seconds * rate).ceil() as usize));
    let steps = (windows.len() + 1) * LEVELS.len() + LAST.len();
    let mut step = 0;
    for window in windows.into_iter().chain([None]) {
        for level in LEVELS {
            while round(tracks, &touches, options, window, level, &mut joined) {}
            step += 1;
            progress(step as f64 / steps as f64);
        }
    }
    for level in LAST {
        while round(tracks, &touches, options, None, level, &mut joined) {
            // What became sure by it comes first.
            for level in LEVELS {
                while round(tracks, &touches, options, None, level, &mut joined) {}
            }
        }
        step += 1;
        progress(step as f64 / steps as f64);
    }
    joined
}

/// One round; false if it decided nothing.
fn round(
    tracks: &mut Tracks<'_>,
    touches: &[Vec<usize>],
    options: &MergeOptions,
    window: Option<usize>,
    level: Level,
    joined: &mut Vec<Joined>,
) -> bool {
    let rings = rings(tracks, touches);
    let candidates = match window {
        Some(window) => within(tracks, &rings, window),
        None => all(tracks, &rings),
    };
    let every: Vec<usize> = (0..candidates.len()).collect();
    let pairs = in_parallel(&every, |at| {
        let (a, b) = candidates[at];
        compare(tracks, &rings, a, b)
    });
    let pairs: Vec<Pair> = pairs.into_iter().flatten().collect();
    let near = |pair: &Pair| {
        pair.mean <= level.factor * options.mean && pair.worst <= level.factor * options.every
    };
    let mut any = false;
    for (pair, rival) in choose(tracks, &pairs, near, level) {
        let Some(&fragment) = tracks.members[pair.guest].first() else {
            continue;
        };
        // Earlier merges of this round may have moved either, or filled the place.
        let Some(&host) = tracks.members[pair.host].first() else {
            continue;
        };
        let (host, guest) = (tracks.track_of[host], tracks.track_of[fragment]);
        if host != guest && tracks.are_disjoint(host, guest) {
            tracks.join(host, guest);
            joined.push(Joined {
                fragment,
                pair,
                rival,
            });
            any = true;
        }
    }
    any
}

pub(super) fn debug_pairs(tracks: &Tracks<'_>) {
    let touches = touches(tracks);
    let rings = rings(tracks, &touches);
    let text = std::env::var("DEBUG_PAIRS").unwrap_or_default();
    for pair in text.split(',').filter(|t| !t.is_empty()) {
        // column:frame-column:frame
        let ids: Vec<usize> = pair.split('-').map(|one| {
            let mut it = one.split(':').map(|x| x.parse::<usize>().unwrap());
            let (c, f) = (it.next().unwrap(), it.next().unwrap());
            let at = tracks.fragments.iter().position(|g| g.column == c && g.start <= f && f < g.end).unwrap();
            tracks.track_of[at]
        }).collect();
        let (a, b) = (ids[0], ids[1]);
        eprintln!("pair {pair}: tracks {a} {b} disjoint {} frames {} {} {:?}", tracks.are_disjoint(a, b), tracks.frame_count(a), tracks.frame_count(b), compare(tracks, &rings, a, b));
        eprintln!("  in all: {}", all(tracks, &rings).contains(&(a.min(b), a.max(b))));
        for track in [a, b] {
            eprintln!("  track {track} fragments {:?}", tracks.members[track].iter().map(|&m| (tracks.fragments[m].start, tracks.fragments[m].end)).collect::<Vec<_>>());
        }
        for other in tracks.alive() {
            for one in [a, b] {
                if other != one && tracks.are_disjoint(other, one) && let Some(p) = compare(tracks, &rings, one, other) && p.odds > -4.0 { eprintln!("  rival {one} {other} {p:?}"); }
            }
        }
        for (x, y) in [(a, b), (b, a)] {
            for at in &tracks.members[y] {
                let f = tracks.fragments[*at];
                for frame in [f.start, f.end - 1] {
                    eprintln!("   expect {x} at {frame}: {:?} from {:?} vs {:?}", super::carry::expect(tracks, &rings[x], x, frame).map(|p| (p.position.distance(tracks.sample(*at, frame)), p.sigma, p.support)), tracks.sights(x, frame), rings[x].spacing);
                }
            }
        }
    }
}
