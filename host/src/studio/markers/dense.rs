//! Evenly spread markers: farthest points along the surface, then relaxed.

use glam::DVec3;

use super::Marker;
use super::geodesic::Ways;
use super::landmarks;
use crate::fit::{Part, Role, Side};
use crate::model::Avatar;
use crate::spatial::{Tree, weld};
use crate::studio::StudioError;
use crate::studio::anatomy::Anatomy;
use crate::studio::random::Random;

/// Most markers of a set.
const MOST: usize = 20_000;
/// Rounds of moving each marker to the middle of its cell (Lloyd 1982).
const ROUNDS: usize = 12;
/// A vertex must see this share of the sky to carry a marker: none deep in folds.
const OPEN: f64 = 0.42;

/// `count` markers at random places that are nowhere crowded.
pub(super) fn place(avatar: &Avatar, count: usize, seed: u64) -> Result<Vec<Marker>, StudioError> {
    let mesh = &avatar.mesh;
    let (triangles, positions) = (&mesh.triangles, &mesh.positions);
    let tree = Tree::new(triangles, positions);
    let welded = weld(positions);
    let anatomy = Anatomy::new(avatar).ok();
    let wanted = resolution(avatar, anatomy.as_ref(), &tree);

    // The triangles of each vertex; a vertex without one carries nothing.
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); positions.len()];
    for (triangle, corners) in triangles.iter().enumerate() {
        for &corner in corners {
            around[welded[corner as usize] as usize].push(triangle as u32);
        }
    }
    let may = |vertex: usize| wanted[vertex] > 0.0 && !around[vertex].is_empty();
    let free: Vec<usize> = (0..positions.len()).filter(|&vertex| may(vertex)).collect();
    if count > free.len().min(MOST) || count == 0 {
        return Err(StudioError::TooManyMarkers {
            wanted: count,
            room: free.len().min(MOST),
        });
    }
    let ways = Ways::new(triangles, positions, &welded, &wanted.map_floor());
    let mut random = Random::new(seed ^ 0x5EED_0F3A);
    let tips = anatomy
        .iter()
        .flat_map(|anatomy| landmarks::tips(anatomy, &tree));
    let tips = tips.map(|hit| welded[heaviest(&triangles[hit.triangle], &hit.barycentric)]);
    let mut sites: Vec<u32> = tips.filter(|&tip| may(tip as usize)).take(count).collect();
    let fixed = sites.len();
    if sites.is_empty() {
        sites.push(free[random.index(free.len())] as u32);
    }
    spread(&ways, &free, count, &mut sites, positions.len());
    relax(&ways, &free, fixed, &mut sites, positions, &wanted.values);

    let name = |index: usize| format!("M{:0width$}", index + 1, width = digits(count));
    let markers = sites.iter().enumerate().map(|(index, &site)| {
        let triangle = around[site as usize][random.index(around[site as usize].len())] as usize;
        let vertices = triangles[triangle];
        // Glued by hand: not quite where it was meant to be.
        let off = if index < fixed { 0.0 } else { 0.33 };
        let share = [random.range(0.0, off), random.range(0.0, off)];
        let mut shares = share.into_iter();
        let mut barycentric = vertices.map(|corner| {
            if welded[corner as usize] == site {
                0.0
            } else {
                shares.next().unwrap_or(0.0)
            }
        });
        let rest = 1.0 - barycentric.iter().sum::<f64>();
        let own = vertices
            .iter()
            .position(|&corner| welded[corner as usize] == site);
        barycentric[own.unwrap_or(0)] += rest;
        Marker {
            name: name(index),
            triangle,
            vertices,
            barycentric,
        }
    });
    Ok(markers.collect())
}

fn digits(count: usize) -> usize {
    count.to_string().len().max(3)
}

fn heaviest(corners: &[u32; 3], weights: &[f64; 3]) -> usize {
    let at = (0..3).max_by(|&a, &b| weights[a].total_cmp(&weights[b]));
    corners[at.unwrap_or(0)] as usize
}

/// Adds the vertex furthest from all sites until there are `count` (Gonzalez 1985).
fn spread(ways: &Ways, free: &[usize], count: usize, sites: &mut Vec<u32>, vertex_count: usize) {
    let mut distances = vec![f64::INFINITY; vertex_count];
    let mut nearest = vec![0; vertex_count];
    ways.spread(
        sites.iter().map(|&site| (site, 0)),
        &mut distances,
        &mut nearest,
    );
    while sites.len() < count {
        let furthest = free
            .iter()
            .max_by(|&&a, &&b| distances[a].total_cmp(&distances[b]));
        let Some(&furthest) = furthest else { return };
        sites.push(furthest as u32);
        ways.spread([(furthest as u32, 0)], &mut distances, &mut nearest);
    }
}

/// Moves sites from `fixed` on to the middles of their cells.
fn relax(
    ways: &Ways,
    free: &[usize],
    fixed: usize,
    sites: &mut [u32],
    positions: &[DVec3],
    wanted: &[f64],
) {
    for _ in 0..ROUNDS {
        let mut distances = vec![f64::INFINITY; positions.len()];
        let mut nearest = vec![u32::MAX; positions.len()];
        let numbered = sites
            .iter()
            .enumerate()
            .map(|(number, &site)| (site, number as u32));
        ways.spread(numbered, &mut distances, &mut nearest);
        let mut sums = vec![(DVec3::ZERO, 0.0); sites.len()];
        for &vertex in free {
            if let Some((sum, weight)) = sums.get_mut(nearest[vertex] as usize) {
                *sum += positions[vertex] * wanted[vertex];
                *weight += wanted[vertex];
            }
        }
        let mut best = vec![(f64::INFINITY, u32::MAX); sites.len()];
        for &vertex in free {
            let cell = nearest[vertex] as usize;
            if let Some(&(sum, weight)) = sums.get(cell) {
                let away = positions[vertex].distance_squared(sum / weight);
                if away < best[cell].0 {
                    best[cell] = (away, vertex as u32);
                }
            }
        }
        for (site, (_, vertex)) in sites.iter_mut().zip(best).skip(fixed) {
            if vertex != u32::MAX {
                *site = vertex;
            }
        }
    }
}

/// `[vertices]`: how densely markers are wanted; 1 on the trunk, 0 where none shall be.
struct Resolution {
    values: Vec<f64>,
}

impl Resolution {
    /// Never 0, so that lengths stay lengths where no marker is wanted.
    fn map_floor(&self) -> Vec<f64> {
        self.values.iter().map(|value| value.max(0.3)).collect()
    }
}

impl std::ops::Index<usize> for Resolution {
    type Output = f64;
    fn index(&self, vertex: usize) -> &f64 {
        &self.values[vertex]
    }
}

fn resolution(avatar: &Avatar, anatomy: Option<&Anatomy>, tree: &Tree) -> Resolution {
    let (positions, normals) = (&avatar.mesh.positions, &avatar.mesh.normals);
    let size = anatomy.map_or(1.0, |anatomy| anatomy.scale);
    let values = (0..positions.len()).map(|vertex| {
        let zone = anatomy.map_or(1.0, |anatomy| zone(anatomy, avatar, vertex));
        let open = || openness(tree, positions[vertex], normals[vertex], size) >= OPEN;
        if zone > 0.0 && open() { zone } else { 0.0 }
    });
    Resolution {
        values: values.collect(),
    }
}

/// How densely a part of the body wants markers.
fn zone(anatomy: &Anatomy, avatar: &Avatar, vertex: usize) -> f64 {
    let (position, normal) = (avatar.mesh.positions[vertex], avatar.mesh.normals[vertex]);
    let heaviest = avatar.skin.influences[vertex].first();
    let Some(&(bind, _)) = heaviest else {
        return 0.0;
    };
    let joint = avatar.skin.binds[bind as usize].joint;
    let size = anatomy.scale;
    if let Some(&head) = anatomy.human.roles.get(&Role::Head)
        && anatomy.is_below(joint, head)
    {
        let offset = (position - anatomy.at(head)) / size;
        let (height, depth) = (offset.dot(anatomy.up), offset.dot(anatomy.front));
        // Skull, not face: above the brow, or behind the ears and above the nape.
        let skull = height > 0.10 || (depth < -0.02 && height > 0.02);
        return if skull { 0.75 } else { 0.0 };
    }
    for side in [Side::Left, Side::Right] {
        let within = |part| {
            anatomy
                .limb(side, part)
                .is_some_and(|top| anatomy.is_below(joint, top))
        };
        if within(Part::Hand) {
            // The palm's bone alone, not what bends: fingers carry no markers.
            return if anatomy.limb(side, Part::Hand) == Some(joint) {
                0.7
            } else {
                0.0
            };
        }
        if within(Part::Foot) {
            let sole = normal.dot(anatomy.up) < -0.4;
            return if sole {
                0.0
            } else if within(Part::Toes) {
                0.5
            } else {
                0.8
            };
        }
        if within(Part::UpperArm) {
            return 1.15;
        }
    }
    1.0
}

/// Share of directions around a normal in which 0.25 m of air lie over the skin.
fn openness(tree: &Tree, position: DVec3, normal: DVec3, size: f64) -> f64 {
    const RAYS: usize = 24;
    let (x, y) = normal.any_orthonormal_pair();
    let from = position + normal * (2e-3 * size);
    let free = (0..RAYS).filter(|&ray| {
        // A spiral over the half sphere, weighted by the cosine (Vogel 1979).
        let radius = ((ray as f64 + 0.5) / RAYS as f64).sqrt();
        let turn = ray as f64 * std::f64::consts::TAU * 0.618_033_988_749_895;
        let height = (1.0 - radius * radius).sqrt();
        let direction = x * (radius * turn.cos()) + y * (radius * turn.sin()) + normal * height;
        !tree.blocks(from, from + direction * (0.25 * size))
    });
    free.count() as f64 / RAYS as f64
}
