//! Open borders, and which stretches of them face each other.

use std::collections::BTreeMap;

use glam::DVec3;

use super::Shell;
use crate::fit::laplace::nearest::Nearest;

/// A closed line of open edges, in the direction of their triangles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Border {
    /// Each once.
    pub vertices: Vec<u32>,
}

impl Border {
    /// Its edges.
    pub fn edges(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        let next = self.vertices.iter().cycle().skip(1);
        self.vertices.iter().zip(next).map(|(&a, &b)| [a, b])
    }

    /// Mean of its vertices.
    #[must_use]
    pub fn centre(&self, shell: &Shell) -> DVec3 {
        let places = self.vertices.iter().map(|&v| shell.positions[v as usize]);
        places.sum::<DVec3>() / self.vertices.len() as f64
    }

    fn length(&self, shell: &Shell) -> f64 {
        let at = |v: u32| shell.positions[v as usize];
        self.edges().map(|[a, b]| at(a).distance(at(b))).sum()
    }
}

/// The borders of a surface, each in its triangles' direction. Where borders touch in a vertex they
/// are told apart somehow. O(triangles log triangles)
#[must_use]
pub fn loops(shell: &Shell) -> Vec<Border> {
    let mut edges: Vec<[u32; 2]> = shell
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .collect();
    edges.sort_unstable();
    let is_open = |&[a, b]: &[u32; 2]| edges.binary_search(&[b, a]).is_err();
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for [a, b] in edges.iter().filter(|edge| is_open(edge)) {
        next.entry(*a).or_default().push(*b);
    }
    let mut found = Vec::new();
    while let Some((&first, _)) = next.iter().next() {
        let mut line = vec![first];
        let mut at = first;
        while let Some(onward) = next.get_mut(&at) {
            let to = onward.pop();
            if onward.is_empty() {
                next.remove(&at);
            }
            let Some(to) = to else {
                break;
            };
            // A vertex passed before closes a loop of its own.
            if let Some(start) = line.iter().position(|&v| v == to) {
                let vertices: Vec<u32> = line.drain(start..).collect();
                if vertices.len() > 2 {
                    found.push(Border { vertices });
                }
                if line.is_empty() {
                    break;
                }
            }
            line.push(to);
            at = to;
        }
    }
    found
}

/// Two stretches of borders that face each other; both run the same way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Face {
    /// Vertices of each; a closed loop begins and ends with the same vertex. The first runs along
    /// its triangles, the second against them.
    pub sides: [Vec<u32>; 2],
    part: [u32; 2],
}

impl Face {
    /// The parts on both sides, the smaller number first.
    #[must_use]
    pub fn parts(&self) -> [u32; 2] {
        let [a, b] = self.part;
        [a.min(b), a.max(b)]
    }

    /// Whether the stretches are whole loops.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.sides
            .iter()
            .all(|side| side.len() > 1 && side.first() == side.last())
    }
}

/// A stretch of a border that faces one other border.
#[derive(Clone, Debug)]
struct Stretch {
    border: usize,
    toward: usize,
    vertices: Vec<u32>,
    closed: bool,
}

/// Finds the stretches that face each other, at most `gap` metres apart; by default a border looks as
/// far as its own radius. O(border vertices log border vertices + stretches^2)
#[must_use]
pub fn facing(shell: &Shell, borders: &[Border], gap: Option<f64>) -> Vec<Face> {
    let part = |border: &Border| shell.part_of[border.vertices[0] as usize];
    let parts: Vec<u32> = borders.iter().map(part).collect();
    // One search structure for what is not of a part.
    let mut others: BTreeMap<u32, (Nearest, Vec<usize>)> = BTreeMap::new();
    for &own in &parts {
        others.entry(own).or_insert_with(|| {
            let (mut places, mut border_of) = (Vec::new(), Vec::new());
            for (at, border) in borders
                .iter()
                .enumerate()
                .filter(|&(at, _)| parts[at] != own)
            {
                for &vertex in &border.vertices {
                    places.push(shell.positions[vertex as usize]);
                    border_of.push(at);
                }
            }
            (Nearest::new(&places), border_of)
        });
    }
    let mut stretches = Vec::new();
    for (at, border) in borders.iter().enumerate() {
        let (nearest, border_of) = &others[&parts[at]];
        let radius = border.length(shell) / std::f64::consts::TAU;
        let reach = gap.unwrap_or(radius);
        let toward = |&vertex: &u32| {
            let (index, distance) = nearest.find(shell.positions[vertex as usize])?;
            (distance <= reach).then(|| border_of[index as usize])
        };
        let toward: Vec<Option<usize>> = border.vertices.iter().map(toward).collect();
        stretches.extend(split(at, border, toward));
    }
    pair(shell, borders, &parts, &stretches)
}

/// Cuts a border where it begins to face another one; stretches of one or two vertices go to the
/// neighbour before them.
fn split(own: usize, border: &Border, mut toward: Vec<Option<usize>>) -> Vec<Stretch> {
    const SHORT: usize = 2;
    let count = toward.len();
    let starts = |toward: &[Option<usize>]| -> Vec<usize> {
        (0..count)
            .filter(|&at| toward[at] != toward[(at + count - 1) % count])
            .collect()
    };
    for _ in 0..count {
        let starts = starts(&toward);
        let length =
            |k: usize| (starts[(k + 1) % starts.len()] + count - starts[k] - 1) % count + 1;
        let short = (0..starts.len()).filter(|&k| starts.len() > 1 && length(k) <= SHORT);
        let Some(k) = short.min_by_key(|&k| length(k)) else {
            break;
        };
        let before = toward[(starts[k] + count - 1) % count];
        for step in 0..length(k) {
            toward[(starts[k] + step) % count] = before;
        }
    }
    let starts = starts(&toward);
    if starts.is_empty() {
        let whole = toward[0].map(|toward| Stretch {
            border: own,
            toward,
            vertices: border.vertices.clone(),
            closed: true,
        });
        return whole.into_iter().collect();
    }
    let stretch = |k: usize| {
        let (start, end) = (starts[k], starts[(k + 1) % starts.len()]);
        let length = (end + count - start - 1) % count + 1;
        Some(Stretch {
            border: own,
            toward: toward[start]?,
            vertices: (0..length)
                .map(|step| border.vertices[(start + step) % count])
                .collect(),
            closed: false,
        })
    };
    (0..starts.len()).filter_map(stretch).collect()
}

/// Stretches that face each other's borders, nearest pairs first.
fn pair(shell: &Shell, borders: &[Border], parts: &[u32], stretches: &[Stretch]) -> Vec<Face> {
    let at = |v: u32| shell.positions[v as usize];
    let distance = |a: &Stretch, b: &Stretch| {
        let nearest = |&v: &u32| {
            let all = b.vertices.iter().map(|&other| at(v).distance(at(other)));
            all.fold(f64::INFINITY, f64::min)
        };
        a.vertices.iter().map(nearest).sum::<f64>() / a.vertices.len() as f64
    };
    let mut pairs = Vec::new();
    for (i, a) in stretches.iter().enumerate() {
        for (j, b) in stretches.iter().enumerate().skip(i + 1) {
            if a.toward == b.border && b.toward == a.border {
                pairs.push((distance(a, b).max(distance(b, a)), i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut taken = vec![false; stretches.len()];
    let mut faces = Vec::new();
    for (_, i, j) in pairs {
        if taken[i] || taken[j] {
            continue;
        }
        (taken[i], taken[j]) = (true, true);
        let (a, b) = (&stretches[i], &stretches[j]);
        let mut sides = [a.vertices.clone(), b.vertices.clone()];
        sides[1].reverse();
        if a.closed && b.closed {
            close(shell, &mut sides);
        } else {
            // A whole loop that faces a part of another one opens where that part ends.
            for (k, whole, other) in [(0, a.closed, 1), (1, b.closed, 0)] {
                if whole {
                    let ends = [sides[other][0], sides[other][sides[other].len() - 1]];
                    open(shell, &mut sides[k], ends.map(at));
                }
            }
        }
        faces.push(Face {
            sides,
            part: [parts[a.border], parts[b.border]],
        });
    }
    debug_assert!(faces.len() <= borders.len().max(stretches.len()));
    faces
}

/// Lets both loops begin at their nearest pair of vertices, and end where they began.
fn close(shell: &Shell, sides: &mut [Vec<u32>; 2]) {
    let at = |v: u32| shell.positions[v as usize];
    let pairs = (0..sides[0].len()).flat_map(|i| (0..sides[1].len()).map(move |j| (i, j)));
    let distance = |&(i, j): &(usize, usize)| at(sides[0][i]).distance_squared(at(sides[1][j]));
    let nearest = pairs.min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let (i, j) = nearest.unwrap_or_default();
    sides[0].rotate_left(i);
    sides[1].rotate_left(j);
    for side in sides {
        side.push(side[0]);
    }
}

/// Lets a loop begin nearest to the middle of two places.
fn open(shell: &Shell, side: &mut [u32], ends: [DVec3; 2]) {
    let middle = (ends[0] + ends[1]) / 2.0;
    let away = |&i: &usize| shell.positions[side[i] as usize].distance_squared(middle);
    let first = (0..side.len()).min_by(|a, b| away(a).total_cmp(&away(b)));
    side.rotate_left(first.unwrap_or(0));
}
