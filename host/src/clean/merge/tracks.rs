//! Fragments gathered into tracks, each of one marker.

use glam::DVec3;

use super::fragments::Fragment;
use crate::take::Take;

/// Fragments, and which belong together so far.
pub(super) struct Tracks<'a> {
    take: &'a Take,
    /// All fragments, unnamed ones first.
    pub fragments: Vec<Fragment>,
    /// `[fragments]`: its track.
    pub track_of: Vec<usize>,
    /// `[tracks]`: fragments in order of time; none once a track has joined another.
    pub members: Vec<Vec<usize>>,
    /// `[tracks]`: the named column that it is.
    pub named: Vec<Option<usize>>,
}

impl<'a> Tracks<'a> {
    /// A track for each unnamed fragment, and one for each named column with all its samples.
    pub fn new(take: &'a Take, unnamed: &[Fragment], named: &[usize]) -> Self {
        let mut tracks = Self {
            take,
            fragments: unnamed.to_vec(),
            track_of: (0..unnamed.len()).collect(),
            members: (0..unnamed.len()).map(|at| vec![at]).collect(),
            named: vec![None; unnamed.len()],
        };
        for &column in named {
            let mut members = Vec::new();
            for trace in take.traces(column) {
                members.push(tracks.fragments.len());
                tracks.track_of.push(tracks.members.len());
                tracks.fragments.push(Fragment {
                    column,
                    start: trace.start,
                    end: trace.end,
                });
            }
            tracks.members.push(members);
            tracks.named.push(Some(column));
        }
        tracks
    }

    pub fn take(&self) -> &'a Take {
        self.take
    }

    /// Tracks that have fragments.
    pub fn alive(&self) -> Vec<usize> {
        let all = 0..self.members.len();
        all.filter(|&track| !self.members[track].is_empty())
            .collect()
    }

    pub fn sample(&self, fragment: usize, frame: usize) -> DVec3 {
        self.take.trajectory(self.fragments[fragment].column)[frame]
    }

    /// The fragment of a track that begins at or before a frame last.
    fn last_begun(&self, track: usize, frame: usize) -> Option<usize> {
        let members = &self.members[track];
        let begun = members.partition_point(|&at| self.fragments[at].start <= frame);
        Some(members[begun.checked_sub(1)?])
    }

    /// Where a track is in a frame. Logarithmic in its fragments.
    pub fn position(&self, track: usize, frame: usize) -> Option<DVec3> {
        let fragment = self.last_begun(track, frame)?;
        (frame < self.fragments[fragment].end).then(|| self.sample(fragment, frame))
    }

    /// The frames nearest to `frame`, before and after it, in which a track is seen.
    pub fn sights(&self, track: usize, frame: usize) -> [Option<usize>; 2] {
        let members = &self.members[track];
        let begun = members.partition_point(|&at| self.fragments[at].start <= frame);
        let before = begun.checked_sub(1).map(|at| {
            let end = self.fragments[members[at]].end;
            (end - 1).min(frame)
        });
        let after = members.get(begun).map(|&at| self.fragments[at].start);
        [before, after]
    }

    /// Frames in which a track is seen.
    pub fn frame_count(&self, track: usize) -> usize {
        let members = self.members[track].iter();
        members.map(|&at| self.fragments[at].frame_count()).sum()
    }

    /// Whether two tracks are never seen together. Linear in the fragments of the one with fewer,
    /// logarithmic in those of the other.
    pub fn are_disjoint(&self, a: usize, b: usize) -> bool {
        let (few, many) = if self.members[a].len() < self.members[b].len() {
            (a, b)
        } else {
            (b, a)
        };
        self.members[few].iter().all(|&at| {
            let Fragment { start, end, .. } = self.fragments[at];
            // The last to begin before the end is the only one that can reach into it.
            self.last_begun(many, end - 1)
                .is_none_or(|other| self.fragments[other].end <= start)
        })
    }

    /// Fragments of a track that are seen together with one of another's.
    pub fn shared(&self, track: usize, other: usize) -> Vec<usize> {
        let meets = |&&at: &&usize| {
            let Fragment { start, end, .. } = self.fragments[at];
            let last = self.last_begun(other, end - 1);
            last.is_some_and(|other| self.fragments[other].end > start)
        };
        self.members[track].iter().filter(meets).copied().collect()
    }

    /// Makes a fragment a track of its own.
    pub fn part(&mut self, fragment: usize) {
        let track = self.track_of[fragment];
        self.members[track].retain(|&at| at != fragment);
        self.track_of[fragment] = self.members.len();
        self.members.push(vec![fragment]);
        self.named.push(None);
    }

    /// Makes two disjoint tracks one; returns which. A named one stays.
    pub fn join(&mut self, a: usize, b: usize) -> usize {
        let (kept, gone) = if self.named[b].is_some() || self.named[a].is_none() && b < a {
            (b, a)
        } else {
            (a, b)
        };
        let moved = std::mem::take(&mut self.members[gone]);
        for &fragment in &moved {
            self.track_of[fragment] = kept;
        }
        let fragments = &self.fragments;
        let members = &mut self.members[kept];
        members.extend(moved);
        members.sort_unstable_by_key(|&at| fragments[at].start);
        kept
    }

    /// Up to `count` frames of a track, spread evenly over what is seen of it.
    pub fn spread_frames(&self, track: usize, count: usize) -> Vec<usize> {
        let total = self.frame_count(track);
        let step = total.div_ceil(count).max(1);
        let mut frames = Vec::with_capacity(total.div_ceil(step));
        let mut skip = 0;
        for &at in &self.members[track] {
            let Fragment { start, end, .. } = self.fragments[at];
            let mut frame = start + skip;
            while frame < end {
                frames.push(frame);
                frame += step;
            }
            skip = frame - end;
        }
        frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fragment(start: usize, end: usize) -> Fragment {
        Fragment {
            column: 0,
            start,
            end,
        }
    }

    #[test]
    fn tracks_join_when_they_never_meet() {
        let path: Vec<DVec3> = (0..40).map(|frame| DVec3::X * f64::from(frame)).collect();
        let take = Take::new(vec!["*1".into()], 100.0, 40, path).unwrap();
        let parts = [(0, 10), (12, 20), (5, 15), (30, 40)].map(|(a, b)| fragment(a, b));
        let mut tracks = Tracks::new(&take, &parts, &[]);
        assert!(tracks.are_disjoint(0, 1) && !tracks.are_disjoint(0, 2));
        assert_eq!(tracks.join(1, 0), 0);
        assert!(!tracks.are_disjoint(2, 0) && tracks.are_disjoint(3, 0));
        assert_eq!(tracks.join(0, 3), 0);
        assert_eq!(tracks.alive(), [0, 2]);
        assert_eq!(tracks.frame_count(0), 28);
        assert_eq!(tracks.position(0, 13), Some(DVec3::X * 13.0));
        assert_eq!(tracks.position(0, 11), None);
        assert_eq!(tracks.sights(0, 25), [Some(19), Some(30)]);
        assert_eq!(tracks.sights(0, 39), [Some(39), None]);
        assert_eq!(tracks.spread_frames(0, 4), [0, 7, 16, 33]);
        assert_eq!(tracks.spread_frames(0, 100).len(), 28);
        assert_eq!(tracks.shared(0, 2), [0, 1], "2 lives from 5 to 15");
        tracks.part(1);
        assert_eq!(tracks.shared(0, 2), [0]);
        assert_eq!((tracks.track_of[1], tracks.frame_count(4)), (4, 8));
    }
}
