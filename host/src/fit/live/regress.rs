//! What fills a marker: its regression, as the core reads it.

use std::collections::HashMap;

use sinew_core::asset::{LINK_NUMBERS, MARKER_NUMBERS};

use super::pairs::spread;
use crate::clean::fill::View;
use crate::clean::fill::regression::Model;
use crate::clean::neighbours::Neighbour;

/// Numbers of a marker, and of its links.
pub(super) type Row = ([f32; MARKER_NUMBERS], Vec<[f32; LINK_NUMBERS]>);

/// Seconds over which the error's course is measured.
const LAG: f64 = 0.1;
/// Bounds of its memory, seconds.
const MEMORY: [f64; 2] = [0.05, 2.0];
/// Least deviation of a fill, metres.
const LEAST_SIGMA: f64 = 0.3e-3;

/// Learns a marker from exactly these neighbours; `None` where too few frames show all of them.
pub(super) fn regress(view: &View<'_>, marker: usize, set: &[Neighbour]) -> Option<Row> {
    let model = Model::learn(view, marker, set)?;
    let sigma = model.variance.sqrt().max(LEAST_SIGMA);
    let mut numbers = [0.0; MARKER_NUMBERS];
    let home = model.home.as_vec3().to_array();
    numbers[..3].copy_from_slice(&home);
    numbers[3] = sigma as f32;
    numbers[4] = memory(&model, view.take.rate()) as f32;
    let links = set.iter().enumerate().map(|(at, neighbour)| {
        let mut link = [0.0; LINK_NUMBERS];
        link[..3].copy_from_slice(&model.shape[at].as_vec3().to_array());
        link[3] = model.weights[at] as f32;
        for (number, value) in link[4..13].iter_mut().zip(&model.coefficients[9 * at..]) {
            *number = *value as f32;
        }
        link[13] = neighbour.distance.max(1e-3) as f32;
        link[14] = spread(neighbour.distance, neighbour.variance) as f32;
        link
    });
    let links: Vec<_> = links.collect();
    let finite = links
        .iter()
        .flatten()
        .chain(&numbers)
        .all(|x| x.is_finite());
    finite.then_some((numbers, links))
}

/// Time in which the correlation of the error with itself falls to 1 / e.
fn memory(model: &Model, rate: f64) -> f64 {
    let at: HashMap<usize, _> = model
        .residuals
        .iter()
        .map(|(frame, _, r)| (*frame, *r))
        .collect();
    let measure = |lag: usize| {
        let (mut with, mut own) = (0.0, 0.0);
        for (frame, _, residual) in &model.residuals {
            if let Some(later) = at.get(&(frame + lag)) {
                with += residual.dot(*later);
                own += 0.5 * (residual.length_squared() + later.length_squared());
            }
        }
        (own > 0.0).then(|| with / own)
    };
    let lag = ((LAG * rate).round() as usize).max(1);
    let found = (1..=lag).rev().find_map(|lag| Some((lag, measure(lag)?)));
    let Some((lag, correlation)) = found else {
        return MEMORY[0];
    };
    let time = -(lag as f64 / rate) / correlation.clamp(1e-6, 0.999).ln();
    time.clamp(MEMORY[0], MEMORY[1])
}
