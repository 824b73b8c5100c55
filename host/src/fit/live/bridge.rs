//! Makes every marker reachable: one that is sought needs three neighbours among those found.
//!
//! On dense sets the most rigid neighbours of a forearm are all on the forearm, and nothing leads
//! there from the trunk.

use super::pairs::Pairs;
use crate::clean::neighbours::Neighbour;

/// Found neighbours by which a marker is found.
const NEEDED: usize = 3;
/// Neighbours that stay whatever happens.
const KEPT: usize = 4;

/// Walks out from four found markers; where nothing more can be reached, the marker that is
/// nearest to what is found gets its weakest neighbours exchanged for found ones.
pub(super) fn reach(sets: &mut [Vec<Neighbour>], pairs: &Pairs, start: [usize; 4]) {
    let mut found = vec![false; sets.len()];
    for marker in start {
        found[marker] = true;
    }
    loop {
        let mut grew = false;
        for marker in 0..sets.len() {
            let known = sets[marker].iter().filter(|n| found[n.marker]).count();
            if !found[marker] && known >= NEEDED {
                (found[marker], grew) = (true, true);
            }
        }
        if grew {
            continue;
        }
        // The lost marker that holds best to three found ones.
        let mut best: Option<(f64, usize, Vec<Neighbour>)> = None;
        for marker in (0..sets.len()).filter(|&marker| !found[marker]) {
            let partners = pairs.rank(marker).iter().filter(|n| found[n.marker]);
            let partners: Vec<Neighbour> = partners.take(NEEDED).copied().collect();
            if partners.len() < NEEDED {
                continue;
            }
            let looseness: f64 = partners.iter().map(|n| n.variance).sum();
            if best.as_ref().is_none_or(|best| looseness < best.0) {
                best = Some((looseness, marker, partners));
            }
        }
        let Some((_, marker, partners)) = best else {
            return;
        };
        let set = &mut sets[marker];
        for partner in partners {
            if set.iter().any(|n| n.marker == partner.marker) {
                continue;
            }
            // The weakest that is not itself needed here.
            let weakest = (KEPT.min(set.len() - 1)..set.len())
                .rev()
                .find(|&at| !found[set[at].marker]);
            if let Some(at) = weakest {
                set[at] = partner;
            }
        }
        found[marker] = true;
    }
}
