//! The live marker tracker against recordings: trained on one part, run without names on another,
//! with hidden stretches, ghosts and missing frames, and judged by what was known.

use glam::DVec3;
use sinew_core::track::markers::{Config, Sample, Source};
use sinew_host::clean::fill::{FillOptions, fill};
use sinew_host::fit::live::MarkerModel;
use sinew_host::label::Labeller;
use sinew_host::take::Take;

use crate::Random;

/// Frames without names, and what is known about them.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Frames a second.
    pub rate: f64,
    /// `[frames][points]`, metres, shuffled.
    pub points: Vec<Vec<[f32; 3]>>,
    /// `[frames][points]`: marker of the model, `None` for a stranger.
    pub owners: Vec<Vec<Option<usize>>>,
    /// `[frames][markers]`: where the marker really was, where that is known.
    pub truth: Vec<Vec<Option<DVec3>>>,
    /// Labelled, with what was hidden missing: for the offline fill.
    pub broken: Take,
}

/// What happens to a take.
#[derive(Clone, Copy, Debug)]
pub struct Harm {
    /// Share of samples hidden, in stretches.
    pub hidden: f64,
    /// Longest stretch, seconds.
    pub longest: f64,
    /// Ghosts in a frame on average; each lives a tenth of a second.
    pub ghosts: f64,
    /// Stretches without any point in a minute, and the longest of them, seconds.
    pub blanks: f64,
    /// The longest of them, seconds.
    pub blank: f64,
    /// Chance and turn: the place and heading of the actor in the room.
    pub elsewhere: bool,
    /// Decides all that happens by chance.
    pub seed: u64,
}

impl Default for Harm {
    fn default() -> Self {
        Self {
            hidden: 0.05,
            longest: 1.0,
            ghosts: 1.0,
            blanks: 6.0,
            blank: 0.5,
            elsewhere: true,
            seed: 1,
        }
    }
}

/// Frames `from..to` of a take.
///
/// # Panics
/// If there are no such frames.
#[must_use]
pub fn cut(take: &Take, from: usize, to: usize) -> Take {
    let paths = (0..take.marker_count()).flat_map(|m| take.trajectory(m)[from..to].to_vec());
    Take::new(
        take.labels().to_vec(),
        take.rate(),
        to - from,
        paths.collect(),
    )
    .unwrap()
}

/// A take under harm, with its markers in the order of the model.
///
/// # Panics
/// Never.
#[must_use]
pub fn trial(take: &Take, labels: &[String], harm: &Harm) -> Trial {
    let mut random = Random(harm.seed);
    let frames = take.frame_count();
    let rate = take.rate();
    let of = |label: &String| take.labels().iter().position(|other| other == label);
    let columns: Vec<Option<usize>> = labels.iter().map(of).collect();
    // About the vertical by any angle, and to another place.
    let (turn, shift) = if harm.elsewhere {
        let angle = std::f64::consts::TAU * random.unit();
        (
            glam::DMat3::from_rotation_y(angle),
            DVec3::new(3.0 * random.unit(), 0.0, 3.0 * random.unit()),
        )
    } else {
        (glam::DMat3::IDENTITY, DVec3::ZERO)
    };
    let place = |p: DVec3| turn * p + shift;
    let truth: Vec<Vec<Option<DVec3>>> = (0..frames)
        .map(|frame| {
            let at = |column: &Option<usize>| take.position((*column)?, frame).map(place);
            columns.iter().map(at).collect()
        })
        .collect();
    let mut seen: Vec<Vec<bool>> = truth
        .iter()
        .map(|row| row.iter().map(Option::is_some).collect())
        .collect();
    // Hidden stretches.
    let longest = (harm.longest * rate) as usize;
    let mut to_hide = (harm.hidden * (frames * labels.len()) as f64) as usize;
    while to_hide > 0 && longest > 0 {
        let length = 1 + random.below(longest);
        let marker = random.below(labels.len());
        let start = random.below(frames);
        for row in seen.iter_mut().skip(start).take(length) {
            row[marker] = false;
        }
        to_hide = to_hide.saturating_sub(length);
    }
    let blanks = (harm.blanks * frames as f64 / rate / 60.0).round() as usize;
    for _ in 0..blanks {
        let length = 1 + random.below(((harm.blank * rate) as usize).max(1));
        let start = random.below(frames);
        for row in seen.iter_mut().skip(start).take(length) {
            row.fill(false);
        }
    }
    // Ghosts stand near a marker or anywhere around the body.
    let life = ((0.1 * rate) as usize).max(1);
    let mut ghosts: Vec<Vec<DVec3>> = vec![Vec::new(); frames];
    for _ in 0..(harm.ghosts * frames as f64 / life as f64) as usize {
        let start = random.below(frames);
        let near = truth[start][random.below(labels.len())];
        let Some(near) = near else { continue };
        let reach = if random.unit() < 0.5 { 0.06 } else { 1.0 };
        let mut spot = || (2.0 * random.unit() - 1.0) * reach;
        let offset = DVec3::new(spot(), spot(), spot());
        for (row, sight) in ghosts.iter_mut().zip(&seen).skip(start).take(life) {
            if sight.contains(&true) {
                row.push(near + offset);
            }
        }
    }
    let mut points = Vec::with_capacity(frames);
    let mut owners = Vec::with_capacity(frames);
    let mut paths = vec![DVec3::NAN; labels.len() * frames];
    for frame in 0..frames {
        let mut row: Vec<(Option<usize>, DVec3)> =
            ghosts[frame].iter().map(|g| (None, *g)).collect();
        for (marker, position) in truth[frame].iter().enumerate() {
            if let Some(position) = position.filter(|_| seen[frame][marker]) {
                row.push((Some(marker), position));
                paths[marker * frames + frame] = position;
            }
        }
        for at in (1..row.len()).rev() {
            row.swap(at, random.below(at + 1));
        }
        points.push(row.iter().map(|(_, p)| p.as_vec3().to_array()).collect());
        owners.push(row.iter().map(|(owner, _)| *owner).collect());
    }
    let broken = Take::new(labels.to_vec(), rate, frames, paths).unwrap();
    Trial {
        rate,
        points,
        owners,
        truth,
        broken,
    }
}

/// How a run went.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// Samples with a point: labelled rightly, as somebody else's or a stranger's, not at all.
    pub right: usize,
    /// Labelled with another marker's or a ghost's point.
    pub wrong: usize,
    /// A point was there and stayed without its label.
    pub missed: usize,
    /// Hidden samples for which a ghost or another marker was taken.
    pub haunted: usize,
    /// Errors of filled samples, metres; and of the offline fill on the same ones.
    pub live: Vec<f64>,
    /// As `live`, offline.
    pub offline: Vec<f64>,
    /// Hidden samples in a frame with points for which nothing was given.
    pub lost: usize,
    /// Most inner steps of a frame, and their sum.
    pub most_work: u32,
    /// Sum of all frames' work.
    pub all_work: u64,
    /// Frames until the set was first recognised.
    pub recognised: usize,
    /// Largest jump between two frames that the truth did not make, metres.
    pub jump: f64,
    /// `[frames]`: wrong and missed.
    pub course: Vec<(usize, usize)>,
    /// `[markers]`: wrong and missed.
    pub by_marker: Vec<(usize, usize)>,
}

impl Verdict {
    /// Share of samples with a point that were labelled rightly.
    #[must_use]
    pub fn right_share(&self) -> f64 {
        self.right as f64 / (self.right + self.wrong + self.missed).max(1) as f64
    }

    /// Mean error of filled samples, live and offline, metres.
    #[must_use]
    pub fn fill_means(&self) -> (f64, f64) {
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        (mean(&self.live), mean(&self.offline))
    }
}

/// Runs the core on a trial. `compare`: fill offline too.
///
/// # Panics
/// If the tracker breaks a promise: a point given twice, a number that is not finite.
#[must_use]
pub fn judge(trial: &Trial, model: &MarkerModel, compare: bool) -> Verdict {
    let core = model.model();
    let config = Config::new(trial.rate as f32, core.dims());
    let capacity = trial.points.iter().map(Vec::len).max().unwrap_or(0);
    let mut labeller = Labeller::new(core, config, capacity);
    let mut verdict = Verdict {
        by_marker: vec![(0, 0); model.labels.len()],
        ..Verdict::default()
    };
    let offline = compare.then(|| {
        let options = FillOptions {
            limit: f64::INFINITY,
            ..FillOptions::default()
        };
        fill(&trial.broken, &options, &|| {}).take
    });
    let mut samples: Vec<Sample> = Vec::new();
    let mut before: Vec<Option<(DVec3, DVec3)>> = vec![None; model.labels.len()];
    for (frame, points) in trial.points.iter().enumerate() {
        let report = labeller.step(points, &mut samples).unwrap();
        verdict.most_work = verdict.most_work.max(report.work);
        verdict.all_work += u64::from(report.work);
        if report.measured == 0 && verdict.right == 0 {
            verdict.recognised = frame + 1;
        }
        let owners = &trial.owners[frame];
        let mut used = vec![false; points.len()];
        let (mut wrong, mut missed) = (0, 0);
        for (marker, sample) in samples.iter().enumerate() {
            assert!(
                sample.position.iter().all(|x| x.is_finite()),
                "frame {frame}"
            );
            let there = owners.contains(&Some(marker));
            let truth = trial.truth[frame][marker];
            let given = match sample.source {
                Source::Measured(point) => {
                    let point = usize::from(point);
                    assert!(!used[point], "frame {frame}: a point is given twice");
                    used[point] = true;
                    Some(owners[point])
                }
                _ => None,
            };
            match (there, given) {
                (true, Some(owner)) if owner == Some(marker) => verdict.right += 1,
                (true, Some(_)) => wrong += 1,
                (true, None) => missed += 1,
                (false, Some(_)) => verdict.haunted += 1,
                (false, None) => {
                    let live = glam::Vec3::from_array(sample.position).as_dvec3();
                    if let Some(truth) = truth.filter(|_| !points.is_empty()) {
                        if sample.source == Source::Lost {
                            verdict.lost += 1;
                        } else if let Some(offline) = &offline
                            && let Some(position) = offline.position(marker, frame)
                        {
                            verdict.live.push(live.distance(truth));
                            verdict.offline.push(position.distance(truth));
                        } else if offline.is_none() {
                            verdict.live.push(live.distance(truth));
                        }
                    }
                }
            }
            if there && given != Some(Some(marker)) {
                let count = &mut verdict.by_marker[marker];
                if given.is_some() {
                    count.0 += 1;
                } else {
                    count.1 += 1;
                }
            }
            let shown = glam::Vec3::from_array(sample.position).as_dvec3();
            let now = truth.filter(|_| sample.source != Source::Lost);
            let now = now.map(|truth| (shown, truth));
            if let (Some((a, s)), Some((b, t))) = (before[marker], now) {
                verdict.jump = verdict.jump.max((b - a).distance(t - s));
            }
            before[marker] = now;
        }
        verdict.wrong += wrong;
        verdict.missed += missed;
        verdict.course.push((wrong, missed));
    }
    verdict
}
