//! A surface cut into patches, small pieces that are taken for rigid, and how these turn.

use glam::{DMat3, DVec3};

use super::SegmentError;
use crate::fit::laplace::rotations::fit_rotation;

/// Up to this many triangles, each is a patch of its own, as published.
const SINGLE: usize = 3000;
/// Patches of larger surfaces.
const COUNT: usize = 1500;

/// Patches of a surface.
#[derive(Clone, Debug)]
pub(super) struct Patches {
    /// `[triangles]`: patch of each.
    pub of_triangle: Vec<u32>,
    /// `[patches]`: square metres.
    pub areas: Vec<f64>,
    /// `[patches]`: patches beside each, ascending.
    pub beside: Vec<Vec<u32>>,
    /// `[patches]`: its triangles.
    pub triangles: Vec<Vec<u32>>,
}

/// `[triangles]`: triangles that share an edge.
pub(super) fn neighbours(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for (at, &[a, b, c]) in triangles.iter().enumerate() {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            edges.push(([a.min(b), a.max(b)], at as u32));
        }
    }
    edges.sort_unstable();
    let mut beside = vec![Vec::new(); triangles.len()];
    for shared in edges.chunk_by(|a, b| a.0 == b.0) {
        for (_, one) in shared {
            let others = shared
                .iter()
                .map(|edge| edge.1)
                .filter(|other| other != one);
            beside[*one as usize].extend(others);
        }
    }
    beside
}

impl Patches {
    /// Single triangles, or about 1500 patches of like area. O(triangles log triangles)
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]], beside: &[Vec<u32>]) -> Self {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|at| positions[at as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        let own: Vec<f64> = triangles.iter().map(area).collect();
        let of_triangle = if triangles.len() <= SINGLE {
            (0..triangles.len() as u32).collect()
        } else {
            grow(&own, beside)
        };
        let count = of_triangle
            .iter()
            .max()
            .map_or(0, |most| *most as usize + 1);
        let mut patches = Self {
            areas: vec![0.0; count],
            beside: vec![Vec::new(); count],
            triangles: vec![Vec::new(); count],
            of_triangle,
        };
        for (triangle, &patch) in patches.of_triangle.iter().enumerate() {
            patches.areas[patch as usize] += own[triangle];
            patches.triangles[patch as usize].push(triangle as u32);
            let others = beside[triangle]
                .iter()
                .map(|&other| patches.of_triangle[other as usize]);
            patches.beside[patch as usize].extend(others.filter(|&other| other != patch));
        }
        for beside in &mut patches.beside {
            beside.sort_unstable();
            beside.dedup();
        }
        patches
    }

    /// Turns `[patches]` from one shape to another; `None` where a corner is missing (NaN).
    pub fn turns(
        &self,
        triangles: &[[u32; 3]],
        rest: &[DVec3],
        posed: &[DVec3],
    ) -> Vec<Option<DMat3>> {
        let turn = |list: &Vec<u32>| {
            let edges = list.iter().flat_map(|&at| {
                let [a, b, c] = triangles[at as usize].map(|at| at as usize);
                let frame = |p: &[DVec3]| {
                    let (x, y) = (p[b] - p[a], p[c] - p[a]);
                    let normal = x.cross(y);
                    // As long as the edges are.
                    [x, y, y - x, normal / normal.length().sqrt().max(1e-12)]
                };
                let (rest, posed) = (frame(rest), frame(posed));
                [0, 1, 2, 3].map(|at| (rest[at], posed[at], 1.0))
            });
            let edges: Vec<_> = edges.filter(|edge| edge.1.is_finite()).collect();
            (!edges.is_empty()).then(|| DMat3::from_quat(fit_rotation(edges)))
        };
        self.triangles.iter().map(turn).collect()
    }
}

/// Rings around seeds that stand evenly in the order of the triangles, by area.
fn grow(areas: &[f64], beside: &[Vec<u32>]) -> Vec<u32> {
    let step = areas.iter().sum::<f64>() / COUNT as f64;
    let mut patch = vec![u32::MAX; areas.len()];
    let mut queue = Vec::new();
    let (mut left, mut count) = (step / 2.0, 0);
    let mut plant = |at: usize, patch: &mut Vec<u32>, queue: &mut Vec<u32>| {
        patch[at] = count;
        count += 1;
        queue.push(at as u32);
    };
    for (at, area) in areas.iter().enumerate() {
        left -= area;
        if left < 0.0 {
            plant(at, &mut patch, &mut queue);
            left += step * (-left / step).ceil();
        }
    }
    let mut next = 0;
    loop {
        while let Some(&at) = queue.get(next) {
            next += 1;
            for &other in &beside[at as usize] {
                if patch[other as usize] == u32::MAX {
                    patch[other as usize] = patch[at as usize];
                    queue.push(other);
                }
            }
        }
        // A component without a seed gets one.
        match patch.iter().position(|&at| at == u32::MAX) {
            Some(at) => plant(at, &mut patch, &mut queue),
            None => return patch,
        }
    }
}

/// Checks a surface and its frames against each other.
pub(super) fn check(
    rest: &[DVec3],
    triangles: &[[u32; 3]],
    frames: &[Vec<DVec3>],
) -> Result<(), SegmentError> {
    const NEEDED: usize = 4;
    if triangles.len() < NEEDED {
        return Err(SegmentError::NoSurface {
            triangles: triangles.len(),
            needed: NEEDED,
        });
    }
    let count = rest.len();
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&point) = corners.iter().find(|&&at| at as usize >= count) {
            return Err(SegmentError::BadTriangle {
                triangle,
                point,
                count,
            });
        }
        if let Some(&point) = corners.iter().find(|&&at| !rest[at as usize].is_finite()) {
            let point = point as usize;
            return Err(SegmentError::BadPoint { point });
        }
    }
    match frames.iter().position(|frame| frame.len() != count) {
        Some(frame) => Err(SegmentError::FrameLength {
            frame,
            found: frames[frame].len(),
            needed: count,
        }),
        None => Ok(()),
    }
}
