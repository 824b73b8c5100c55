//! Where markers do most good, for a surface whose motion is known.

use glam::{DQuat, DVec3};

use super::graph::Graph;
use super::rotations::{MarkerTarget, fit_rotation};
use super::{LaplaceError, Surface, SurfaceOptions};
use crate::reference::laplacian;

/// Height of feet above the lowest point, in parts of the whole height.
const FEET: f64 = 0.06;

/// How dense markers should stand at each vertex: twice as dense on feet, which the floor judges.
/// `[vertices]`. O(vertices)
#[must_use]
pub fn density(positions: &[DVec3]) -> Vec<f32> {
    let heights = positions.iter().map(|p| p.y);
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
        (low.min(y), high.max(y))
    });
    let on_feet = |p: &DVec3| p.y - low < FEET * (high - low);
    let density = positions.iter().map(|p| if on_feet(p) { 2.0 } else { 1.0 });
    density.collect()
}

/// Vertices for `count` markers where nothing is known of the motion: spread evenly, but for
/// [`density`]. Fewer where there are not as many vertices.
/// O(count edges log vertices) at worst
#[must_use]
pub fn spread(positions: &[DVec3], triangles: &[[u32; 3]], count: usize) -> Vec<u32> {
    let graph = Graph::new(positions, triangles);
    let density = density(positions);
    let first = (0..positions.len() as u32).find(|&v| !graph.row(v).is_empty());
    let Some(first) = first else {
        return Vec::new();
    };
    // The first choice is as far as possible from an arbitrary vertex, which is none itself.
    let mut distances = graph.distances(&[first]);
    let mut chosen = Vec::new();
    while chosen.len() < count {
        let reach = |vertex: usize| distances[vertex] * density[vertex];
        let far = (0..distances.len()).filter(|&v| !graph.row(v as u32).is_empty());
        let far = far.max_by(|&a, &b| reach(a).total_cmp(&reach(b)).then(b.cmp(&a)));
        let Some(far) = far.filter(|&vertex| distances[vertex] > 0.0) else {
            break;
        };
        chosen.push(far as u32);
        distances[far] = 0.0;
        graph.relax(&mut distances, std::iter::once(far as u32), |_, _| {});
    }
    chosen
}

/// Vertices for `count` markers on a surface whose shape in some poses is known: half of them
/// spread evenly, then round by round where the surface driven by those so far is farthest off.
///
/// `poses`: `[poses][vertices]`, metres. O(10 (factor + poses solve))
///
/// # Errors
/// As [`Surface::new`]; [`LaplaceError::PoseLength`] for a pose of other length.
pub fn suggest(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    poses: &[Vec<DVec3>],
    count: usize,
    options: &SurfaceOptions,
) -> Result<Vec<u32>, LaplaceError> {
    let needed = positions.len();
    if let Some(pose) = poses.iter().position(|pose| pose.len() != needed) {
        let found = poses[pose].len();
        return Err(LaplaceError::PoseLength {
            pose,
            found,
            needed,
        });
    }
    let graph = Graph::new(positions, triangles);
    let first = (0..needed as u32).find(|&v| !graph.row(v).is_empty());
    let first = first.ok_or(LaplaceError::NoSurface)?;
    let mut markers = graph.spread(&[first], count.div_ceil(2));
    let a_round = count.div_ceil(20);
    while markers.len() < count {
        let surface = Surface::new(positions.to_vec(), triangles, markers.clone(), options)?;
        let mut errors = vec![0.0; needed];
        for posed in poses {
            let targets: Vec<MarkerTarget> = markers
                .iter()
                .map(|&vertex| carried(&graph, positions, posed, vertex))
                .collect();
            let found = laplacian::positions(&surface, &targets);
            for ((error, found), truth) in errors.iter_mut().zip(found).zip(posed) {
                *error += found.distance_squared(*truth);
            }
        }
        // Positions are soft: a marker's own vertex may be off, and must not get a second one.
        markers.iter().for_each(|&v| errors[v as usize] = 0.0);
        let before = markers.len();
        // Markers of one round stay as far apart as markers are on average.
        let apart = mean_distance(&graph, &markers);
        for _ in 0..a_round.min(count - before) {
            let worst = (0..needed).max_by(|&a, &b| errors[a].total_cmp(&errors[b]));
            let Some(worst) = worst.filter(|&vertex| errors[vertex] > 0.0) else {
                break;
            };
            markers.push(worst as u32);
            for (error, distance) in errors.iter_mut().zip(graph.distances(&[worst as u32])) {
                if distance < apart {
                    *error = 0.0;
                }
            }
        }
        if markers.len() == before {
            break;
        }
    }
    Ok(markers)
}

/// Where a template carries a marker: its vertex, turned as the edges around it turn.
#[must_use]
pub fn carried(graph: &Graph, rest: &[DVec3], posed: &[DVec3], vertex: u32) -> MarkerTarget {
    let at = vertex as usize;
    let edges = graph.row(vertex).iter().map(|&(other, _)| {
        let other = other as usize;
        (rest[other] - rest[at], posed[other] - posed[at], 1.0)
    });
    let rotation: DQuat = fit_rotation(edges);
    MarkerTarget {
        position: posed[at],
        rotation,
    }
}

/// Mean distance of vertices from their nearest marker.
fn mean_distance(graph: &Graph, markers: &[u32]) -> f32 {
    let distances = graph.distances(markers);
    let near = distances.iter().filter(|distance| distance.is_finite());
    let (sum, count) = near.fold((0.0, 0_u32), |(sum, count), d| (sum + d, count + 1));
    sum / count.max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of 21 x 2 vertices, folded at one place: markers gather there.
    #[test]
    fn markers_go_where_the_surface_bends() {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for k in 0..21_u32 {
            let x = f64::from(k) * 0.05;
            positions.extend([DVec3::new(x, 0.0, 0.0), DVec3::new(x, 0.0, 0.1)]);
            if k < 20 {
                let a = 2 * k;
                triangles.extend([[a, a + 1, a + 3], [a, a + 3, a + 2]]);
            }
        }
        let fold = |p: &DVec3| match p.x - 0.7 {
            beyond if beyond > 0.0 => DVec3::new(0.7, beyond, p.z),
            _ => *p,
        };
        let posed: Vec<_> = positions.iter().map(fold).collect();
        let options = SurfaceOptions::default();
        let poses = [posed];
        let markers = suggest(&positions, &triangles, &poses, 12, &options).expect("suggests");
        assert_eq!(markers.len(), 12);
        let near = |&&v: &&u32| (positions[v as usize].x - 0.7).abs() < 0.16;
        assert!(markers[6..].iter().filter(near).count() >= 3, "{markers:?}");
        let short = suggest(&positions, &triangles, &[vec![]], 12, &options);
        assert!(matches!(
            short,
            Err(LaplaceError::PoseLength { found: 0, .. })
        ));
    }
}
