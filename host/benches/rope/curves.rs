//! How the error grows as the rate falls and the noise rises.

use std::path::Path;

use sinew_host::export::plot::{Chart, Series, Style};
use sinew_host::export::png::write_png;

use super::gaps::score;
use super::scenes::{CASES, Case, Way, film};

const RATES: [f64; 6] = [25.0, 30.0, 50.0, 60.0, 100.0, 120.0];
const NOISES: [f64; 4] = [0.25, 0.5, 1.0, 2.0];
/// Seconds of the gaps, whatever the rate.
const GAP: f64 = 0.3;

pub fn print(thorough: bool) {
    let (rates, noises) = if thorough {
        (&RATES[..], &NOISES[..])
    } else {
        (&RATES[4..5], &NOISES[1..2])
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    println!("\nOne interior marker missing for {GAP} s: mean mm");
    for case in CASES.iter().filter(|case| case.moderate) {
        let by_rate = rates.iter().map(|&rate| (rate, means(case, rate, 0.5)));
        draw(
            case,
            "frames a second",
            by_rate.collect(),
            &folder.join(file(case, "rate")),
        );
        let by_noise = noises
            .iter()
            .map(|&noise| (noise, means(case, 100.0, noise)));
        draw(
            case,
            "noise of a coordinate, mm",
            by_noise.collect(),
            &folder.join(file(case, "noise")),
        );
    }
}

fn file(case: &Case, what: &str) -> String {
    format!("rope_{}_{what}.png", case.name.replace([',', ' '], "_"))
}

fn means(case: &Case, rate: f64, noise_mm: f64) -> [f64; 3] {
    let take = film(case, rate, 1);
    let length = (GAP * rate).round() as usize;
    score(&take, 1e-3 * noise_mm, length, 1, false).map(|score| score.mean())
}

fn draw(case: &Case, x_label: &str, points: Vec<(f64, [f64; 3])>, path: &Path) {
    println!("{}, {x_label}", case.name);
    for (x, means) in &points {
        println!(
            "{x:>8} | {:7.2} {:7.2} {:7.2}",
            means[0], means[1], means[2]
        );
    }
    let series = Way::ALL.iter().enumerate().map(|(at, way)| {
        let line = points.iter().map(|(x, means)| [*x, means[at]]);
        Series::new(way.name(), Style::Line, line.collect())
    });
    let chart = Chart {
        title: format!("{}: one marker missing for {GAP} s", case.name),
        x_label: x_label.into(),
        y_label: "mean error, mm".into(),
        series: series.collect(),
        ..Chart::default()
    };
    write_png(path, &chart.render(900, 500)).expect("a writable folder");
    println!("  drawn: {}", path.display());
}
