//! Distances through a solid.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::{NONE, Solid};

impl Solid {
    /// Distance through the inside from seeds (cell, metres already gone, mark), metres, with the
    /// mark of the nearest seed; infinite where no way leads. O(cells log cells)
    ///
    /// Fast marching with upwind differences (Sethian 1996): distances are those of straight lines
    /// where one is free, up to a part of a cell.
    #[must_use]
    pub fn march(&self, seeds: &[(u32, f64, u32)]) -> (Vec<f32>, Vec<u32>) {
        let mut distance = vec![f32::INFINITY; self.len()];
        let mut mark = vec![NONE; self.len()];
        let mut queue = BinaryHeap::new();
        for &(cell, gone, own) in seeds {
            let (gone, at) = (gone as f32, cell as usize);
            if gone < distance[at] {
                (distance[at], mark[at]) = (gone, own);
                queue.push(Reverse((gone.to_bits(), cell)));
            }
        }
        let mut done = vec![false; self.len()];
        while let Some(Reverse((_, cell))) = queue.pop() {
            if std::mem::replace(&mut done[cell as usize], true) {
                continue;
            }
            for next in self.neighbours(cell) {
                if done[next as usize] {
                    continue;
                }
                let (candidate, from) = self.upwind(next, &distance);
                if candidate < distance[next as usize] {
                    distance[next as usize] = candidate;
                    mark[next as usize] = mark[from as usize];
                    queue.push(Reverse((candidate.to_bits(), next)));
                }
            }
        }
        (distance, mark)
    }

    /// The distance whose gradient over the nearest neighbour along each axis is one, and the nearest
    /// neighbour of all: the way comes mostly through it, however little another one shortens it.
    fn upwind(&self, cell: u32, distance: &[f32]) -> (f32, u32) {
        let around = &self.neighbours[cell as usize];
        let of = |next: u32| {
            let gone = distance.get(next as usize).copied();
            (gone.unwrap_or(f32::INFINITY), next)
        };
        let nearer = |a: (f32, u32), b: (f32, u32)| if b.0 < a.0 { b } else { a };
        let mut near = [0, 1, 2].map(|axis| nearer(of(around[2 * axis]), of(around[2 * axis + 1])));
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let from = near[0].1;
        let near = near.map(|(gone, _)| gone);
        let step = self.size as f32;
        let mut best = near[0] + step;
        let (mut sum, mut squares) = (near[0], near[0] * near[0]);
        for (count, &next) in [2.0, 3.0].iter().zip(&near[1..]) {
            if next >= best {
                break;
            }
            sum += next;
            squares += next * next;
            let under = sum * sum - count * (squares - step * step);
            if under < 0.0 {
                break;
            }
            best = (sum + under.sqrt()) / count;
        }
        (best, from)
    }

    /// Distance of every cell from the outside, metres. O(cells log cells)
    #[must_use]
    pub fn depth(&self) -> Vec<f32> {
        let outer = (0..self.len() as u32).filter(|&cell| self.neighbours(cell).count() < 6);
        let seeds: Vec<_> = outer.map(|cell| (cell, 0.5 * self.size, 0)).collect();
        self.march(&seeds).0
    }
}
