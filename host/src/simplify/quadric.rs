//! Squared distances from planes, summed.

use std::ops::AddAssign;

use glam::DVec3;

use super::surface::Surface;

/// Planes of borders and seams weigh more than those of triangles of the same size.
const BORDER_WEIGHT: f64 = 10.0;

/// `sum of weight (n x + d)^2` as the symmetric matrix that it is.
#[derive(Clone, Copy, Debug, Default)]
struct Quadric {
    /// xx, yy, zz, xy, xz, yz.
    square: [f64; 6],
    linear: DVec3,
    constant: f64,
}

impl Quadric {
    /// Distance from the plane through a point with this unit normal.
    fn plane(normal: DVec3, point: DVec3, weight: f64) -> Self {
        let d = -normal.dot(point);
        let DVec3 { x, y, z } = normal;
        Self {
            square: [x * x, y * y, z * z, x * y, x * z, y * z].map(|value| weight * value),
            linear: weight * d * normal,
            constant: weight * d * d,
        }
    }

    fn at(&self, DVec3 { x, y, z }: DVec3) -> f64 {
        let [xx, yy, zz, xy, xz, yz] = self.square;
        let square = xx * x * x + yy * y * y + zz * z * z;
        let mixed = xy * x * y + xz * x * z + yz * y * z;
        let linear = self.linear.dot(DVec3::new(x, y, z));
        square + 2.0 * (mixed + linear) + self.constant
    }
}

impl AddAssign for Quadric {
    fn add_assign(&mut self, other: Self) {
        for (sum, value) in self.square.iter_mut().zip(other.square) {
            *sum += value;
        }
        self.linear += other.linear;
        self.constant += other.constant;
    }
}

/// Quadrics of all points in all poses.
pub(super) struct Quadrics<'p> {
    poses: &'p [Vec<DVec3>],
    /// `[points x poses]`
    quadrics: Vec<Quadric>,
    /// `[points]`: sum of all planes' weights in all poses.
    weights: Vec<f64>,
    /// `[points]`: a vertex at each.
    vertices: Vec<u32>,
}

impl<'p> Quadrics<'p> {
    /// From the planes of triangles, weighted by area, and of planes that stand on borders and
    /// seams.
    pub fn new(surface: &Surface, poses: &'p [Vec<DVec3>]) -> Self {
        let points = surface.point_count();
        let mut quadrics = vec![Quadric::default(); points * poses.len()];
        let mut weights = vec![0.0; points];
        for (index, pose) in poses.iter().enumerate() {
            let mut add = |point: u32, quadric: Quadric, weight: f64| {
                quadrics[point as usize * poses.len() + index] += quadric;
                weights[point as usize] += weight;
            };
            for (corners, _) in surface.triangles() {
                let [a, b, c] = corners.map(|vertex| pose[vertex as usize]);
                let doubled = (b - a).cross(c - a);
                let Some(normal) = doubled.try_normalize() else {
                    continue;
                };
                let weight = doubled.length() / 2.0;
                let points = corners.map(|vertex| surface.point(vertex));
                for point in points {
                    add(point, Quadric::plane(normal, a, weight), weight);
                }
                for side in 0..3 {
                    let ends = [points[side], points[(side + 1) % 3]];
                    let [from, to] = [corners[side], corners[(side + 1) % 3]];
                    if !surface.is_crease(from, to) {
                        continue;
                    }
                    let (from, to) = (pose[from as usize], pose[to as usize]);
                    if let Some(upright) = (to - from).cross(normal).try_normalize() {
                        let weight = BORDER_WEIGHT * from.distance_squared(to);
                        for end in ends {
                            add(end, Quadric::plane(upright, from, weight), 0.0);
                        }
                    }
                }
            }
        }
        Self {
            poses,
            quadrics,
            weights,
            vertices: (0..points as u32).map(|p| surface.vertex_at(p)).collect(),
        }
    }

    /// Of both ends' planes, when they are where `to` is; weighted square metres.
    pub fn cost(&self, from: u32, to: u32) -> f64 {
        let vertex = self.vertices[to as usize] as usize;
        let of = |point: u32| {
            let first = point as usize * self.poses.len();
            let quadrics = &self.quadrics[first..first + self.poses.len()];
            let poses = quadrics.iter().zip(self.poses);
            poses
                .map(|(quadric, pose)| quadric.at(pose[vertex]))
                .sum::<f64>()
        };
        of(from) + of(to)
    }

    /// The same over its weight: square metres.
    pub fn mean_square(&self, from: u32, to: u32) -> f64 {
        let weight = self.weights[from as usize] + self.weights[to as usize];
        self.cost(from, to).max(0.0) / weight.max(f64::MIN_POSITIVE)
    }

    pub fn merge(&mut self, from: u32, to: u32) {
        for pose in 0..self.poses.len() {
            let taken = self.quadrics[from as usize * self.poses.len() + pose];
            self.quadrics[to as usize * self.poses.len() + pose] += taken;
        }
        self.weights[to as usize] += self.weights[from as usize];
    }
}
