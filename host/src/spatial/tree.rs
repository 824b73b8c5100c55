//! A tree of boxes over the triangles of a moving surface.
//!
//! Built once over the rest shape; each frame the boxes are fitted again to the moved vertices
//! ([`Tree::refit`], linear), which keeps rays cheap because neighbours on a skin stay neighbours.

use glam::DVec3;

/// Corner weight by which a ray may miss a triangle: rays along an edge, as in the plane of symmetry
/// of a body, must not slip between its two triangles.
const EDGE: f64 = 1e-9;
/// Triangles in a leaf.
const LEAF: usize = 4;

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    low: DVec3,
    high: DVec3,
    /// First triangle of a leaf, or the left child; the right child follows its left subtree.
    pub(super) first: u32,
    /// Right child of an inner node.
    pub(super) right: u32,
    /// Triangles of a leaf; 0 for an inner node.
    pub(super) count: u32,
}

/// A bounding volume hierarchy over triangles.
#[derive(Clone, Debug)]
pub struct Tree {
    pub(super) nodes: Vec<Node>,
    /// Vertex indices, in leaf order.
    triangles: Vec<[u32; 3]>,
    /// `[triangles]`: index in the source's order.
    pub(super) source: Vec<u32>,
    /// `[triangles x 3]`: corners, in leaf order.
    pub(super) corners: Vec<[DVec3; 3]>,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// In units of the ray's direction.
    pub distance: f64,
    /// Index of the triangle in the source's order.
    pub triangle: usize,
    /// Weights of its corners.
    pub barycentric: [f64; 3],
}

impl Tree {
    /// Over triangles with all indices below `positions.len()`. Halves by the median along the
    /// longest side; O(triangles log triangles).
    #[must_use]
    pub fn new(triangles: &[[u32; 3]], positions: &[DVec3]) -> Self {
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let centres: Vec<DVec3> = triangles
            .iter()
            .map(|t| t.map(|at| positions[at as usize]).iter().sum::<DVec3>() / 3.0)
            .collect();
        let mut nodes = Vec::new();
        if !order.is_empty() {
            split(&mut nodes, &mut order, 0, &centres);
        }
        let sorted: Vec<[u32; 3]> = order.iter().map(|&at| triangles[at as usize]).collect();
        let mut tree = Self {
            nodes,
            corners: vec![[DVec3::ZERO; 3]; sorted.len()],
            triangles: sorted,
            source: order,
        };
        tree.refit(positions);
        tree
    }

    /// Follows the vertices to new positions. O(triangles)
    pub fn refit(&mut self, positions: &[DVec3]) {
        for (corners, triangle) in self.corners.iter_mut().zip(&self.triangles) {
            *corners = triangle.map(|at| positions[at as usize]);
        }
        // Children stand after their parent, so one pass from the back is enough.
        for at in (0..self.nodes.len()).rev() {
            let node = self.nodes[at];
            let (low, high) = if node.count == 0 {
                let (a, b) = (
                    self.nodes[node.first as usize],
                    self.nodes[node.right as usize],
                );
                (a.low.min(b.low), a.high.max(b.high))
            } else {
                let range = node.first as usize..(node.first + node.count) as usize;
                let points = self.corners[range].as_flattened();
                let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
                let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
                (low, high)
            };
            (self.nodes[at].low, self.nodes[at].high) = (low, high);
        }
    }

    /// Whether a triangle stands between two points. O(log triangles) as a rule.
    #[must_use]
    pub fn blocks(&self, from: DVec3, to: DVec3) -> bool {
        self.walk(from, to - from, 1.0, |_| false).is_some()
    }

    /// The first triangle along a ray, seen from either side.
    #[must_use]
    pub fn first_hit(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        self.walk(origin, direction, f64::INFINITY, |_| true)
    }

    /// Hits nearer than `limit`; `more` says whether a nearer one than this is wanted.
    fn walk(
        &self,
        origin: DVec3,
        direction: DVec3,
        limit: f64,
        more: impl Fn(Hit) -> bool,
    ) -> Option<Hit> {
        if self.nodes.is_empty() || !(origin + direction).is_finite() {
            return None;
        }
        let inverse = direction.recip();
        let mut best: Option<Hit> = None;
        let mut limit = limit;
        // Depth is the logarithm of the triangle count (halving), below 64.
        let mut stack = [0u32; 64];
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let node = self.nodes[stack[len] as usize];
            if !node.meets(origin, inverse, limit) {
                continue;
            }
            if node.count == 0 {
                stack[len] = node.right;
                stack[len + 1] = node.first;
                len += 2;
                continue;
            }
            for at in node.first as usize..(node.first + node.count) as usize {
                let Some((distance, barycentric)) = meet(&self.corners[at], origin, direction)
                else {
                    continue;
                };
                if distance < limit {
                    let hit = Hit {
                        distance,
                        triangle: self.source[at] as usize,
                        barycentric,
                    };
                    if !more(hit) {
                        return Some(hit);
                    }
                    limit = distance;
                    best = Some(hit);
                }
            }
        }
        best
    }
}

/// Appends the subtree over `order` and returns its index.
fn split(nodes: &mut Vec<Node>, order: &mut [u32], first: u32, centres: &[DVec3]) -> u32 {
    let index = nodes.len();
    nodes.push(Node {
        low: DVec3::ZERO,
        high: DVec3::ZERO,
        first,
        right: 0,
        count: order.len() as u32,
    });
    if order.len() <= LEAF {
        return index as u32;
    }
    let of = |at: u32| centres[at as usize];
    let low = order
        .iter()
        .map(|&at| of(at))
        .fold(DVec3::INFINITY, DVec3::min);
    let high = order
        .iter()
        .map(|&at| of(at))
        .fold(DVec3::NEG_INFINITY, DVec3::max);
    let axis = (high - low).max_position();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&a, &b| {
        of(a)[axis].total_cmp(&of(b)[axis]).then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(middle);
    let left = split(nodes, left, first, centres);
    let right = split(nodes, right, first + middle as u32, centres);
    let node = &mut nodes[index];
    (node.first, node.right, node.count) = (left, right, 0);
    index as u32
}

impl Node {
    /// Squared distance of a point from the box, square metres.
    pub(super) fn away_squared(&self, point: DVec3) -> f64 {
        (point.clamp(self.low, self.high) - point).length_squared()
    }

    /// Slab test (Kay and Kajiya 1986). A ray along a face counts as meeting it.
    fn meets(&self, origin: DVec3, inverse: DVec3, limit: f64) -> bool {
        let a = (self.low - origin) * inverse;
        let b = (self.high - origin) * inverse;
        let (mut near, mut far) = (0.0, limit);
        for axis in 0..3 {
            let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
            // Within a face's plane, zero times infinity is no number, and no bound either.
            if !(a[axis].is_nan() || b[axis].is_nan()) {
                near = if low > near { low } else { near };
                far = if high < far { high } else { far };
            }
        }
        near <= far
    }
}

/// Distance and corner weights where a ray meets a triangle (Möller and Trumbore 1997).
fn meet(corners: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 3])> {
    let [a, b, c] = *corners;
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let t = origin - a;
    let u = t.dot(p) / determinant;
    if u < -EDGE {
        return None;
    }
    let q = t.cross(ab);
    let v = direction.dot(q) / determinant;
    if v < -EDGE || u + v > 1.0 + EDGE {
        return None;
    }
    let distance = ac.dot(q) / determinant;
    (distance > 0.0).then_some((distance, [1.0 - u - v, u, v]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studio::random::Random;

    /// A square of two triangles at height z.
    fn square(z: f64) -> (Vec<[u32; 3]>, Vec<DVec3>) {
        let corner = |x, y| DVec3::new(x, y, z);
        let positions = vec![
            corner(0.0, 0.0),
            corner(1.0, 0.0),
            corner(1.0, 1.0),
            corner(0.0, 1.0),
        ];
        (vec![[0, 1, 2], [0, 2, 3]], positions)
    }

    #[test]
    fn a_plane_blocks_what_is_behind_it_and_nothing_beside_it() {
        let (triangles, positions) = square(1.0);
        let mut tree = Tree::new(&triangles, &positions);
        let eye = DVec3::new(0.5, 0.4, 3.0);
        assert!(tree.blocks(DVec3::new(0.5, 0.4, 0.0), eye));
        assert!(!tree.blocks(DVec3::new(0.5, 0.4, 1.5), eye), "in front");
        assert!(
            !tree.blocks(DVec3::new(5.0, 0.4, 0.0), eye),
            "past the edge"
        );
        assert!(
            !tree.blocks(DVec3::new(0.5, 0.4, 0.0), DVec3::new(0.5, 0.4, 0.9)),
            "before it"
        );
        let moved: Vec<DVec3> = positions.iter().map(|p| *p + DVec3::X * 4.0).collect();
        tree.refit(&moved);
        assert!(!tree.blocks(DVec3::new(0.5, 0.4, 0.0), eye), "it went away");
        assert!(tree.blocks(DVec3::new(4.5, 0.4, 0.0), DVec3::new(4.5, 0.4, 3.0)));
    }

    #[test]
    fn the_first_hit_names_triangle_and_place() {
        let (triangles, positions) = square(2.0);
        let tree = Tree::new(&triangles, &positions);
        let hit = tree
            .first_hit(DVec3::new(0.25, 0.75, 0.0), DVec3::Z)
            .unwrap();
        assert_eq!((hit.distance, hit.triangle), (2.0, 1));
        let edge = tree.first_hit(DVec3::new(0.3, 0.3, 0.0), DVec3::Z);
        assert!(edge.is_some(), "along the diagonal");
        let face = tree.first_hit(DVec3::new(0.0, 0.5, 0.0), DVec3::Z);
        assert!(face.is_some(), "in the plane of a box's face");
        assert_eq!(hit.barycentric, [0.25, 0.25, 0.5]);
        assert_eq!(
            tree.first_hit(DVec3::new(0.25, 0.75, 0.0), DVec3::NEG_Z),
            None
        );
    }

    #[test]
    fn the_tree_agrees_with_every_triangle_by_itself() {
        let mut random = Random::new(3);
        let positions: Vec<DVec3> = (0..600).map(|_| random.normal3()).collect();
        let triangles: Vec<[u32; 3]> = (0..200).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let small: Vec<DVec3> = (0..600)
            .map(|at| positions[at / 3 * 3] + 0.3 * (positions[at] - positions[at / 3 * 3]))
            .collect();
        let mut tree = Tree::new(&triangles, &positions);
        tree.refit(&small);
        let mut blocked = 0;
        for _ in 0..500 {
            let (from, to) = (2.0 * random.normal3(), 2.0 * random.normal3());
            let corners = |t: &[u32; 3]| t.map(|at| small[at as usize]);
            let slow = triangles.iter().any(|t| {
                meet(&corners(t), from, to - from).is_some_and(|(distance, _)| distance < 1.0)
            });
            assert_eq!(tree.blocks(from, to), slow);
            blocked += usize::from(slow);
        }
        assert!((50..450).contains(&blocked), "{blocked}");
    }

    #[test]
    fn nothing_is_hit_without_triangles_or_with_nonsense() {
        let tree = Tree::new(&[], &[]);
        assert!(!tree.blocks(DVec3::ZERO, DVec3::ONE));
        let (triangles, positions) = square(0.0);
        let tree = Tree::new(&triangles, &positions);
        assert_eq!(tree.first_hit(DVec3::NAN, DVec3::Z), None);
        assert_eq!(tree.first_hit(DVec3::NEG_Z, DVec3::ZERO), None);
    }
}
