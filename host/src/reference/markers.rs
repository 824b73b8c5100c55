//! Where a marker's neighbours expect it, in `f64`: an exact absolute orientation, then the
//! regression.

use glam::{DMat3, DVec3};
use sinew_core::asset::MarkerTables;

use crate::clean::rigid::Rigid;

/// Place of a marker from those of its neighbours, metres; `None` where fewer than three are
/// placed. `place`: of a marker that is measured. Horn 1987; Park & Hodgins 2006, section 4.3.
///
/// # Panics
/// If the marker does not exist.
#[must_use]
pub fn expect(
    tables: &MarkerTables<'_>,
    marker: usize,
    place: impl Fn(usize) -> Option<DVec3>,
) -> Option<DVec3> {
    let count = tables.neighbours.len() / tables.markers.len();
    let rows = marker * count..(marker + 1) * count;
    let links = tables.neighbours[rows.clone()]
        .iter()
        .zip(&tables.links[rows]);
    let known: Vec<(DVec3, DVec3, &[f32; 16])> = links
        .filter_map(|(&index, link)| {
            let shape = DVec3::new(link[0].into(), link[1].into(), link[2].into());
            Some((shape, place(usize::from(index))?, link))
        })
        .collect();
    if known.len() < 3 {
        return None;
    }
    let pairs = known
        .iter()
        .map(|(shape, place, link)| (*shape, *place, f64::from(link[3])));
    let pose = Rigid::fit(pairs)?;
    let back = pose.inverse();
    let [x, y, z, ..] = tables.markers[marker].map(f64::from);
    let mut local = DVec3::new(x, y, z);
    for (shape, place, link) in &known {
        let gain: Vec<f64> = link[4..13].iter().map(|&g| f64::from(g)).collect();
        local += DMat3::from_cols_slice(&gain) * (back.apply(*place) - *shape);
    }
    Some(pose.apply(local))
}
