//! Where a marker that is out of sight should be: carried by its neighbours.

use glam::DVec3;

use super::super::rigid::Rigid;

/// Labelled positions: `[markers x frames]`, NaN where missing.
#[derive(Clone, Copy)]
pub(super) struct Labelled<'a> {
    pub positions: &'a [DVec3],
    pub frames: usize,
}

impl Labelled<'_> {
    pub fn at(&self, marker: usize, frame: usize) -> DVec3 {
        self.positions[marker * self.frames + frame]
    }
}

/// Fewest neighbours that fix a rigid motion.
pub(super) const LEAST: usize = 3;

/// Where `marker`, seen in frame `from`, should be in frame `to`, and how many neighbours say so:
/// they are carried rigidly from one to the other (equation 2, with the marker's last sight as the
/// reference pose, as skin deforms less in a moment than from the reference pose). `None` unless
/// three neighbours are seen in both.
pub(super) fn carry(
    labelled: &Labelled<'_>,
    ring: &[(usize, f64)],
    marker: usize,
    from: usize,
    to: usize,
) -> Option<(DVec3, usize)> {
    let shared = ring.iter().filter_map(|&(neighbour, weight)| {
        let (a, b) = (labelled.at(neighbour, from), labelled.at(neighbour, to));
        (!a.is_nan() && !b.is_nan()).then_some((a, b, weight))
    });
    let support = shared.clone().count();
    let origin = labelled.at(marker, from);
    if support < LEAST || origin.is_nan() {
        return None;
    }
    let motion = Rigid::fit(shared)?;
    Some((motion.apply(origin), support))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_carries_its_middle() {
        // Markers 0 to 2 move by +Y; marker 3 is seen only before.
        let corners = [DVec3::X, DVec3::Z, -DVec3::X];
        let mut positions: Vec<DVec3> = corners.iter().flat_map(|p| [*p, *p + DVec3::Y]).collect();
        positions.extend([DVec3::ZERO, DVec3::NAN]);
        let labelled = Labelled {
            positions: &positions,
            frames: 2,
        };
        let ring = [(0, 1.0), (1, 1.0), (2, 1.0)];
        let (found, support) = carry(&labelled, &ring, 3, 0, 1).unwrap();
        assert!(found.distance(DVec3::Y) < 1e-8);
        assert_eq!(support, 3);
        assert_eq!(carry(&labelled, &ring[..2], 3, 0, 1), None);
        assert_eq!(carry(&labelled, &ring, 3, 1, 0), None);
    }
}
