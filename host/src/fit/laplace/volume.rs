//! Volume that a surface loses under extreme bends, and how to give it back.
//!
//! The paper states the loss and leaves it, since a constraint on volume makes the solve non-linear
//! (de Aguiar et al. 2007, section 5). Here poses are corrected beforehand, where time does not
//! matter, and the collapsed surface is fitted to what comes out: at run time it stays a fixed sum.

use glam::DVec3;

use super::graph::Graph;

/// Volume inside a mesh, cubic metres; holes are closed by cones to the middle of all vertices.
/// O(triangles)
#[must_use]
pub fn volume(positions: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let middle = positions.iter().sum::<DVec3>() / positions.len().max(1) as f64;
    let corner = |v: u32| positions[v as usize] - middle;
    let six_times = triangles
        .iter()
        .map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))));
    six_times.sum::<f64>() / 6.0
}

/// Part of the volume at rest that is missing in each pose: `[poses]`, negative where there is
/// more. O(poses x triangles)
#[must_use]
pub fn losses(rest: &[DVec3], triangles: &[[u32; 3]], poses: &[Vec<DVec3>]) -> Vec<f64> {
    let whole = volume(rest, triangles);
    let loss = |pose: &Vec<DVec3>| 1.0 - volume(pose, triangles) / whole;
    poses.iter().map(loss).collect()
}

/// Largest offset of a vertex, metres.
const LARGEST_OFFSET: f64 = 0.03;

/// Rounds in which the places that swell are smoothed.
const SMOOTHING: usize = 12;

/// Gives posed surfaces their volume at rest back.
#[derive(Debug)]
pub struct Restorer<'m> {
    triangles: &'m [[u32; 3]],
    graph: Graph,
    /// `[vertices]`: area around each at rest.
    areas: Vec<f64>,
    whole: f64,
}

impl<'m> Restorer<'m> {
    /// `rest` `[vertices]`, metres. O(triangles log triangles)
    #[must_use]
    pub fn new(rest: &[DVec3], triangles: &'m [[u32; 3]]) -> Self {
        Self {
            triangles,
            graph: Graph::new(rest, triangles),
            areas: around(rest, triangles).0,
            whole: volume(rest, triangles),
        }
    }

    /// Swells a pose, most where its surface has shrunk, until its volume is that at rest or an
    /// offset is 3 cm. A pose that has lost nothing stays as it is. O(triangles)
    pub fn restore(&self, pose: &mut [DVec3]) {
        let (areas, normals) = around(pose, self.triangles);
        let shrunk = areas.iter().zip(&self.areas);
        let mut part: Vec<f64> = shrunk
            .map(|(now, rest)| {
                if *rest > 0.0 {
                    (1.0 - now / rest).max(0.0)
                } else {
                    0.0
                }
            })
            .collect();
        for _ in 0..SMOOTHING {
            let smooth = |(vertex, own): (u32, &f64)| {
                let row = self.graph.row(vertex);
                let sum: f64 = row.iter().map(|&(other, _)| part[other as usize]).sum();
                (own + sum) / (1 + row.len()) as f64
            };
            part = (0_u32..).zip(&part).map(smooth).collect();
        }
        let most = part.iter().copied().fold(0.0, f64::max);
        if most < 1e-6 {
            return;
        }
        let start = pose.to_vec();
        let mut amount = 0.0;
        for _ in 0..4 {
            let missing = self.whole - volume(pose, self.triangles);
            if missing <= 0.0 && amount == 0.0 {
                return;
            }
            // The volume grows by area times offset.
            let gain: f64 = areas
                .iter()
                .zip(&part)
                .map(|(area, part)| area * part)
                .sum();
            amount = (amount + missing / gain.max(1e-9)).clamp(0.0, LARGEST_OFFSET / most);
            for ((to, from), (part, normal)) in
                pose.iter_mut().zip(&start).zip(part.iter().zip(&normals))
            {
                *to = *from + amount * part * *normal;
            }
        }
    }
}

/// A third of the area of the triangles around each vertex, and their mean normal.
fn around(positions: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<f64>, Vec<DVec3>) {
    let mut areas = vec![0.0; positions.len()];
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|v| positions[v as usize]);
        let twice = (b - a).cross(c - a);
        for &vertex in corners {
            areas[vertex as usize] += twice.length() / 6.0;
            normals[vertex as usize] += twice;
        }
    }
    for normal in &mut normals {
        *normal = normal.normalize_or_zero();
    }
    (areas, normals)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let (rings, sides) = (16_u32, 24_u32);
        let mut positions = vec![DVec3::Y, DVec3::NEG_Y];
        for ring in 1..rings {
            for side in 0..sides {
                let (a, b) = (
                    std::f64::consts::PI * f64::from(ring) / f64::from(rings),
                    std::f64::consts::TAU * f64::from(side) / f64::from(sides),
                );
                positions.push(DVec3::new(a.sin() * b.cos(), a.cos(), -a.sin() * b.sin()));
            }
        }
        let at = |ring: u32, side: u32| 2 + (ring - 1) * sides + side % sides;
        let mut triangles = Vec::new();
        for side in 0..sides {
            triangles.push([0, at(1, side), at(1, side + 1)]);
            triangles.push([1, at(rings - 1, side + 1), at(rings - 1, side)]);
            for ring in 1..rings - 1 {
                let (a, b) = (at(ring, side), at(ring, side + 1));
                let (c, d) = (at(ring + 1, side), at(ring + 1, side + 1));
                triangles.extend([[a, c, d], [a, d, b]]);
            }
        }
        (positions, triangles)
    }

    #[test]
    fn a_pinched_ball_gets_its_volume_back_where_it_was_pinched() {
        let (rest, triangles) = ball();
        let full = 4.0 / 3.0 * std::f64::consts::PI;
        let part = volume(&rest, &triangles) / full;
        assert!(
            (0.97..1.0).contains(&part),
            "corners lie on the ball: {part}"
        );
        let pinch = |p: &DVec3| {
            let width = 1.0 - 0.02 * (-16.0 * p.y * p.y).exp();
            DVec3::new(p.x * width, p.y, p.z * width)
        };
        let mut pose: Vec<DVec3> = rest.iter().map(pinch).collect();
        let before = losses(&rest, &triangles, std::slice::from_ref(&pose))[0];
        assert!(before > 0.01, "{before}");
        Restorer::new(&rest, &triangles).restore(&mut pose);
        let after = losses(&rest, &triangles, std::slice::from_ref(&pose))[0];
        assert!(after.abs() < 0.1 * before, "{before} {after}");
        assert!(pose[0].distance(rest[0]) < 2e-3, "the pole was not pinched");
        let mut still = rest.clone();
        Restorer::new(&rest, &triangles).restore(&mut still);
        assert_eq!(still, rest);
    }
}
