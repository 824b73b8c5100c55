//! A held rope among a body's markers, as takes.

use glam::DVec3;

use super::HeldRope;
use crate::fit::rope::separate::marker_names;
use crate::studio::random::Random;
use crate::take::{Take, TakeError};

impl HeldRope {
    /// Adds the measured points to an unlabelled take: each unbroken run becomes a trajectory of
    /// its own, and the columns say nothing about markers.
    ///
    /// # Errors
    /// The take has another number of frames.
    pub fn beside_unlabelled(&self, take: &Take, seed: u64) -> Result<Take, TakeError> {
        let frames = take.frame_count();
        let mut runs: Vec<(usize, usize, usize)> = Vec::new();
        for marker in 0..self.markers.first().map_or(0, Vec::len) {
            let seen = |frame: usize| self.seen[frame][marker].is_some();
            let mut frame = 0;
            while frame < self.seen.len() {
                if seen(frame) {
                    let end = (frame..self.seen.len()).find(|&f| !seen(f));
                    let end = end.unwrap_or(self.seen.len());
                    runs.push((frame, end, marker));
                    frame = end;
                }
                frame += 1;
            }
        }
        // Runs that begin together come in an order of chance.
        let mut random = Random::new(seed ^ 0xC01);
        for i in (1..runs.len()).rev() {
            runs.swap(i, random.index(i + 1));
        }
        runs.sort_by_key(|run| run.0);
        let mut columns: Vec<(usize, Vec<DVec3>)> = Vec::new();
        for (start, end, marker) in runs {
            let free = columns.iter().position(|(until, _)| *until < start);
            let column = free.unwrap_or_else(|| {
                columns.push((0, vec![DVec3::NAN; frames]));
                columns.len() - 1
            });
            for frame in start..end {
                if let Some(position) = self.seen[frame][marker] {
                    columns[column].1[frame] = position;
                }
            }
            columns[column].0 = end;
        }
        let first = take.marker_count();
        let labels = (0..columns.len())
            .map(|k| format!("*{}", first + k + 1))
            .collect();
        join(
            take,
            labels,
            columns.into_iter().flat_map(|(_, column)| column),
        )
    }

    /// Adds the measured points under their names.
    ///
    /// # Errors
    /// The take has another number of frames.
    pub fn beside_labelled(&self, take: &Take) -> Result<Take, TakeError> {
        self.named(take, |frame, marker| {
            self.seen[frame][marker].unwrap_or(DVec3::NAN)
        })
    }

    /// Adds where every marker really was.
    ///
    /// # Errors
    /// The take has another number of frames.
    pub fn beside_truth(&self, take: &Take) -> Result<Take, TakeError> {
        self.named(take, |frame, marker| self.markers[frame][marker])
    }

    fn named(&self, take: &Take, at: impl Fn(usize, usize) -> DVec3) -> Result<Take, TakeError> {
        let markers = self.markers.first().map_or(0, Vec::len);
        let all = (0..markers).flat_map(|m| (0..self.markers.len()).map(move |f| (f, m)));
        join(
            take,
            marker_names(0, markers),
            all.map(|(frame, marker)| at(frame, marker)),
        )
    }
}

fn join(
    take: &Take,
    labels: Vec<String>,
    samples: impl Iterator<Item = DVec3>,
) -> Result<Take, TakeError> {
    let labels = [take.labels().to_vec(), labels].concat();
    let own = (0..take.marker_count()).flat_map(|m| take.trajectory(m).iter().copied());
    take.with_trajectories(labels, own.chain(samples).collect())
}
