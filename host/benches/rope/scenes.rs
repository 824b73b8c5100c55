//! Virtual ropes, and what the methods make of them.

use glam::DVec3;
use sinew_core::track::rope::Method;
use sinew_host::fit::rope::{
    FollowOptions, PointFrames, RepairOptions, Trace, both_ways, follow, repair,
};
use sinew_host::studio::rope::{Capture, Disturbance, Label, Motion, Scene, Take};

/// A rope that swings at a tempo.
#[derive(Clone, Copy)]
pub struct Case {
    pub name: &'static str,
    pub motion: Motion,
    pub tempo: f64,
    /// Whether the bars for moderate motion hold for it.
    pub moderate: bool,
}

pub const CASES: [Case; 6] = [
    Case {
        name: "ribbon, moderate",
        motion: Motion::Ribbon,
        tempo: 0.6,
        moderate: true,
    },
    Case {
        name: "jumping rope, moderate",
        motion: Motion::Turned,
        tempo: 0.6,
        moderate: true,
    },
    Case {
        name: "ribbon, brisk",
        motion: Motion::Ribbon,
        tempo: 1.0,
        moderate: false,
    },
    Case {
        name: "jumping rope, brisk",
        motion: Motion::Turned,
        tempo: 1.0,
        moderate: false,
    },
    Case {
        name: "whip",
        motion: Motion::Whip,
        tempo: 1.0,
        moderate: false,
    },
    Case {
        name: "free fall",
        motion: Motion::FreeFall,
        tempo: 1.0,
        moderate: false,
    },
];

pub fn film(case: &Case, rate: f64, seed: u64) -> Take {
    let mut scene = Scene::new(case.motion, seed);
    scene.rate = rate;
    scene.tempo = case.tempo;
    if case.motion != Motion::FreeFall {
        scene.seconds = 8.0;
    }
    scene.film().expect("a stable rope")
}

/// Points without labels, and the label of each.
pub fn frames(capture: &Capture) -> PointFrames {
    let points = capture.frames.iter().map(|f| f.points.clone()).collect();
    PointFrames::new(capture.rate, points)
}

/// What a method gives, with the markers in the truth's order.
pub fn run(capture: &Capture, method: Way) -> Trace {
    let frames = frames(capture);
    let rope = capture.frames[0].labels.iter();
    let markers = rope.filter(|label| matches!(label, Label::Rope(_))).count();
    let options = FollowOptions {
        method: match method {
            Way::Published => Method::Published,
            _ => Method::Joint,
        },
        markers: Some(markers),
        ..FollowOptions::default()
    };
    let mut trace = follow(&frames, &options).expect("the rope is found");
    if method == Way::TwoSided {
        let both = both_ways(&frames, &[trace]).expect("followed before");
        trace = repair(&both[0], &RepairOptions::default());
    }
    align(&mut trace, capture);
    trace
}

/// The chain may run either way.
fn align(trace: &mut Trace, capture: &Capture) {
    let labels = &capture.frames[trace.start].labels;
    let samples = trace.frames[trace.start].iter().enumerate();
    let right = samples.filter_map(|(marker, sample)| {
        let Label::Rope(truth) = labels[sample.point()?] else {
            return None;
        };
        Some((marker as i64, truth as i64))
    });
    let slope: i64 = right
        .clone()
        .zip(right.skip(1))
        .map(|(a, b)| b.1 - a.1)
        .sum();
    if slope < 0 {
        for frame in &mut trace.frames {
            frame.reverse();
        }
    }
}

/// How a gap is filled.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Way {
    Published,
    Live,
    TwoSided,
}

impl Way {
    pub const ALL: [Self; 3] = [Self::Published, Self::Live, Self::TwoSided];

    pub fn name(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Live => "live",
            Self::TwoSided => "two-sided",
        }
    }
}

/// A capture with noise alone, from which `hidden` markers are held back.
pub fn capture(take: &Take, noise: f64, hidden: &dyn Fn(usize, usize) -> bool) -> Capture {
    let how = Disturbance {
        noise,
        ..Disturbance::noise_only(1)
    };
    let mut capture = take.capture(&how);
    for (number, frame) in capture.frames.iter_mut().enumerate() {
        let keep: Vec<bool> = frame
            .labels
            .iter()
            .map(|label| !matches!(label, Label::Rope(marker) if hidden(number, *marker)))
            .collect();
        let mut kept = keep.iter();
        frame.points.retain(|_| *kept.next().unwrap());
        let mut kept = keep.iter();
        frame.labels.retain(|_| *kept.next().unwrap());
    }
    capture
}

pub fn error(trace: &Trace, take: &Take, frame: usize, marker: usize) -> f64 {
    let truth: DVec3 = take.rope[frame][marker];
    trace.frames[frame][marker].position.distance(truth)
}
