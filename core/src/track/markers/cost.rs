//! What a frame costs at most.

use super::{MarkerDims, OFFERS, associate, fill, pace, recall, seed};

/// Most inner steps of a frame with at most `points` points and [`super::Config::search`]: a point
/// looked at, a distance compared, a term of a fit. Each is some twenty machine instructions on a
/// Cortex-M7; filters and output add a fixed few hundred a marker.
///
/// Every marker may look at every point, twice; two assignments, each with a limit and one search
/// beyond it; a fill of every marker; reviews of an eighth of them, each with an exchange; the
/// witnesses of a find, and the passes that recall a pose. All of that twice, once for the rival
/// labelling, and once the search for lost markers, which ends at its limit and the point at hand.
#[must_use]
pub const fn work_bound(dims: &MarkerDims, points: usize, search: u32) -> u32 {
    let (markers, neighbours) = (dims.marker_count, dims.neighbour_count);
    let offered = if markers * OFFERS < points {
        markers * OFFERS
    } else {
        points
    };
    let fit = fill::work(neighbours) as usize;
    let looks = 2 * markers * points;
    let assignment = associate::SEARCH as usize * markers + (markers + 1) * (OFFERS + offered);
    let exchange = 1 + 4 * neighbours * neighbours;
    let eviction = points * (1 + 2 * neighbours);
    let reviews = markers.div_ceil(pace::REVIEW) * (2 * fit + points + exchange + eviction);
    let recalled = recall::PASSES.len() * markers * (points + 1);
    let beyond = points * (neighbours + 3) + 2 * seed::WITNESSES * fit + recalled;
    let fills = markers * (fit + 1);
    let labelling = looks + 2 * assignment + reviews + fills + beyond;
    (points + 2 * labelling) as u32 + search
}
