//! What a frame costs at most.

use super::associate::CANDIDATES;
use super::others::MOST_SOUGHT;

/// Most inner steps of a tracking frame: a point looked at, a pair of proposals compared, a path
/// extended. Each is under 40 machine instructions on a Cortex-M7; filling and filtering add a
/// fixed few hundred a trace.
///
/// A search over at most all points for each followed stranger and two for each trace; two chains with two passes over all pairs of
/// candidates; two matchings whose every search settles at most one point a trace, each after
/// looking at all that it has reached; the search for a lost rope with three looks a link.
#[must_use]
pub const fn work_bound(traces: usize, points: usize) -> u32 {
    let reach = if traces * CANDIDATES < points {
        traces * CANDIDATES
    } else {
        points
    };
    let searches = (points + MOST_SOUGHT + 2 * traces) * points;
    let chains = 2 * 2 * traces * CANDIDATES * CANDIDATES;
    let matchings = 2 * traces * traces * (CANDIDATES + reach);
    let lost = (2 * 2 * traces + 1) * points;
    (searches + chains + matchings + lost) as u32
}

/// Most inner steps of the one frame that ends the start: six chains from every point.
#[must_use]
pub const fn start_work_bound(traces: usize, points: usize) -> u32 {
    let chain = (2 * 2 * traces + 1) * points;
    (points * points + points * (points + 6 * chain)) as u32
}
