//! Segmentation: a person with 41 markers skips; drop-outs, ghosts, occlusion.

use sinew_host::fit::rope::Trace;
use sinew_host::studio::rope::{Capture, Disturbance, Label, Motion, Scene};

use super::scenes::{Way, run};

/// Samples by what the tracker made of them.
#[derive(Default)]
struct Count {
    measured: usize,
    /// Of another marker of the rope, of the body, of nobody.
    wrong: [usize; 3],
    missed: usize,
    seen: usize,
}

impl Count {
    fn add(&mut self, trace: &Trace, capture: &Capture) {
        for (frame, samples) in capture.frames.iter().zip(&trace.frames) {
            let is_rope = |label: &&Label| matches!(label, Label::Rope(_));
            self.seen += frame.labels.iter().filter(is_rope).count();
            for (marker, sample) in samples.iter().enumerate() {
                let Some(point) = sample.point() else {
                    let own = Label::Rope(marker);
                    self.missed += usize::from(frame.labels.contains(&own));
                    continue;
                };
                self.measured += 1;
                match frame.labels[point] {
                    Label::Rope(truth) if truth == marker => {}
                    Label::Rope(_) => self.wrong[0] += 1,
                    Label::Body(_) => self.wrong[1] += 1,
                    Label::Ghost => self.wrong[2] += 1,
                }
            }
        }
    }

    fn percent(&self, count: usize) -> f64 {
        100.0 * count as f64 / self.measured.max(1) as f64
    }
}

pub fn print(thorough: bool) {
    println!(
        "\nSegmentation: skipping, 25 rope and 41 body markers, 100 Hz, 12 cameras, 0.5 mm noise,"
    );
    println!(
        "5 % drop-outs in bursts, 5 % ghosts, occlusion by the body, points merged below 8 mm"
    );
    println!(
        "{:>10} {:>5} {:>8} | wrong %  (rope, body, ghost) | visible but not taken %",
        "", "seed", "samples"
    );
    let seeds = if thorough { 1..=6 } else { 1..=1 };
    for way in Way::ALL {
        let mut total = Count::default();
        for seed in seeds.clone() {
            let mut scene = Scene::new(Motion::Skipping, seed);
            scene.people = true;
            if !thorough {
                scene.seconds = 2.0;
            }
            let take = scene.film().expect("a stable rope");
            let how = Disturbance {
                cameras: 12,
                ..Disturbance::rough(seed)
            };
            let capture = take.capture(&how);
            let trace = run(&capture, way);
            let mut one = Count::default();
            one.add(&trace, &capture);
            line(way, &seed.to_string(), &one);
            total.add(&trace, &capture);
        }
        line(way, "all", &total);
    }
}

fn line(way: Way, seed: &str, count: &Count) {
    let wrong = count.wrong.iter().sum();
    println!(
        "{:>10} {seed:>5} {:>8} | {:7.3}  ({:.3}, {:.3}, {:.3}) | {:.2}",
        way.name(),
        count.measured,
        count.percent(wrong),
        count.percent(count.wrong[0]),
        count.percent(count.wrong[1]),
        count.percent(count.wrong[2]),
        100.0 * count.missed as f64 / count.seen.max(1) as f64,
    );
}
