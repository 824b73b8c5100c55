//! The point of a surface that lies nearest.

use glam::DVec3;

use super::tree::Tree;

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Index of the triangle in the source's order.
    pub triangle: usize,
    /// Weights of its corners, at least 0; they sum to 1.
    pub barycentric: [f64; 3],
    /// Where it lies, metres.
    pub position: DVec3,
    /// How far it is, metres.
    pub distance: f64,
}

impl Tree {
    /// The nearest point of all triangles that `may` accepts (by index in the source's order);
    /// `None` without any, or for a point that is not finite. O(log triangles) as a rule.
    #[must_use]
    pub fn closest(&self, point: DVec3, may: impl Fn(usize) -> bool) -> Option<Nearest> {
        if self.nodes.is_empty() || !point.is_finite() {
            return None;
        }
        let mut best: Option<Nearest> = None;
        let mut limit = f64::INFINITY;
        // Depth is the logarithm of the triangle count (halving), below 64.
        let mut stack = [(0_u32, 0.0); 64];
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let (at, away) = stack[len];
            if away >= limit {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.count == 0 {
                let of = |child: u32| (child, self.nodes[child as usize].away_squared(point));
                let (a, b) = (of(node.first), of(node.right));
                // The nearer one is looked at first.
                (stack[len], stack[len + 1]) = if a.1 < b.1 { (b, a) } else { (a, b) };
                len += 2;
                continue;
            }
            for at in node.first as usize..(node.first + node.count) as usize {
                let triangle = self.source[at] as usize;
                let barycentric = closest_on(&self.corners[at], point);
                let position = combine(&self.corners[at], barycentric);
                let away = position.distance_squared(point);
                if away < limit && may(triangle) {
                    limit = away;
                    best = Some(Nearest {
                        triangle,
                        barycentric,
                        position,
                        distance: away.sqrt(),
                    });
                }
            }
        }
        best
    }
}

fn combine(corners: &[DVec3; 3], weights: [f64; 3]) -> DVec3 {
    let [a, b, c] = *corners;
    a * weights[0] + b * weights[1] + c * weights[2]
}

/// Corner weights of the point of a triangle that is nearest to `point` (Ericson, *Real-Time
/// Collision Detection*, 2005, section 5.1.5).
fn closest_on(corners: &[DVec3; 3], point: DVec3) -> [f64; 3] {
    let [a, b, c] = *corners;
    let (ab, ac) = (b - a, c - a);
    let part = |over: f64, under: f64| if under > 0.0 { over / under } else { 0.0 };
    let ap = point - a;
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = part(d1, d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = part(d2, d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    let (e, f) = (d4 - d3, d5 - d6);
    if va <= 0.0 && e >= 0.0 && f >= 0.0 {
        let w = part(e, e + f);
        return [0.0, 1.0 - w, w];
    }
    let whole = va + vb + vc;
    let (v, w) = (part(vb, whole), part(vc, whole));
    [1.0 - v - w, v, w]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studio::random::Random;

    #[test]
    fn every_region_of_a_triangle_by_hand() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let at = |x, y| closest_on(&corners, DVec3::new(x, y, 0.7));
        assert_eq!(at(-1.0, -1.0), [1.0, 0.0, 0.0]);
        assert_eq!(at(2.0, -0.5), [0.0, 1.0, 0.0]);
        assert_eq!(at(-0.5, 3.0), [0.0, 0.0, 1.0]);
        assert_eq!(at(0.25, -1.0), [0.75, 0.25, 0.0]);
        assert_eq!(at(-1.0, 0.25), [0.75, 0.0, 0.25]);
        assert_eq!(at(1.0, 1.0), [0.0, 0.5, 0.5]);
        assert_eq!(at(0.25, 0.5), [0.25, 0.25, 0.5]);
        // A triangle without extent is a point.
        assert_eq!(
            closest_on(&[DVec3::ONE; 3], DVec3::ZERO)
                .iter()
                .sum::<f64>(),
            1.0
        );
    }

    #[test]
    fn the_tree_agrees_with_every_triangle_by_itself() {
        let mut random = Random::new(5);
        let positions: Vec<DVec3> = (0..600).map(|_| random.normal3()).collect();
        let triangles: Vec<[u32; 3]> = (0..200).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let tree = Tree::new(&triangles, &positions);
        for _ in 0..300 {
            let point = 2.0 * random.normal3();
            let odd = |triangle: usize| triangle % 2 == 1;
            let slow = triangles.iter().enumerate().filter(|(at, _)| odd(*at));
            let slow = slow
                .map(|(_, t)| {
                    let corners = t.map(|at| positions[at as usize]);
                    combine(&corners, closest_on(&corners, point)).distance(point)
                })
                .fold(f64::INFINITY, f64::min);
            let found = tree.closest(point, odd).unwrap();
            assert!((found.distance - slow).abs() < 1e-12 && odd(found.triangle));
        }
        assert_eq!(tree.closest(DVec3::NAN, |_| true), None);
        assert_eq!(tree.closest(DVec3::ZERO, |_| false), None);
        assert_eq!(Tree::new(&[], &[]).closest(DVec3::ZERO, |_| true), None);
    }
}
