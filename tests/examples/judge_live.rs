//! Judges the live marker tracker: learned from one part of a take, run without names on another,
//! with hidden stretches, ghosts and frames without any point.
//!
//!     cargo run --release -p sinew-tests --example judge_live [-- NAME]
//!
//! Without a name: the real takes of `../shared/data`, and studio captures of 41 to 350 markers.

use sinew_host::clean::exchange;
use sinew_host::fit::live::{LearnOptions, learn};
use sinew_host::import::take::{LengthUnit, TakeOptions, read_take};
use sinew_host::studio::MarkerLayout;
use sinew_host::take::Take;
use sinew_tests::live::{Harm, cut, judge, trial};
use sinew_tests::marker_film::truth;
use sinew_tests::{human, shared};

const FILES: [(&str, Option<LengthUnit>); 5] = [
    ("c3d/cmu_02_05.c3d", None),
    ("c3d/freeform_53mk_gappy.c3d", None),
    ("c3d/vicon_walking2.c3d", None),
    ("face/cheeks_41mk_60hz.csv", Some(LengthUnit::Centimetre)),
    ("trc/marker_flip_dropjump.trc", None),
];

fn main() {
    let wanted = std::env::args().nth(1).unwrap_or_default();
    println!(
        "{:36} {:>7} {:>7} {:>7} {:>7} {:>7} {:>5} {:>6} {:>6} {:>6} {:>6}",
        "take",
        "markers",
        "right%",
        "wrong%",
        "missed%",
        "haunted",
        "lost",
        "live",
        "offl",
        "work",
        "most"
    );
    for (file, unit) in FILES {
        let name = file.rsplit('/').next().unwrap_or(file);
        if !file.contains(&wanted) {
            continue;
        }
        let Some(path) = shared(file) else { continue };
        let options = TakeOptions {
            unit,
            ..TakeOptions::default()
        };
        let raw = read_take(&path, &options).unwrap();
        let mut take = Take::from_raw(&raw).unwrap().0;
        // What the recording itself names wrongly is no truth.
        exchange::find(&take, &|_| ()).undo(&mut take);
        let half = take.frame_count() / 2;
        let (first, second) = (cut(&take, 0, half), cut(&take, half, take.frame_count()));
        row(
            &format!("{name}, 2nd half"),
            std::slice::from_ref(&first),
            &second,
        );
        row(
            &format!("{name}, 1st half"),
            std::slice::from_ref(&second),
            &first,
        );
    }
    for (name, layout) in [
        ("studio 41", MarkerLayout::Standard41),
        ("studio 53", MarkerLayout::Standard53),
        ("studio 120", MarkerLayout::Dense(120)),
        ("studio 350", MarkerLayout::Dense(350)),
    ] {
        if !name.contains(&wanted) {
            continue;
        }
        let body = human::avatar();
        let film = |clip: usize| truth(&body, &body.clips[clip], layout, 120.0, 8.0);
        let (walk, kneel) = (film(0), film(1));
        let half = kneel.frame_count() / 2;
        let lessons = [walk, cut(&kneel, 0, half)];
        row(name, &lessons, &cut(&kneel, half, kneel.frame_count()));
    }
}

/// Two seeds of harm.
fn row(name: &str, lessons: &[Take], test: &Take) {
    let model = match learn(lessons, &LearnOptions::default(), &|| {}) {
        Ok(model) => model,
        Err(error) => {
            println!("{name}: {error}");
            return;
        }
    };
    for seed in 1..=2 {
        let harm = Harm {
            seed,
            ..Harm::default()
        };
        let trial = trial(test, &model.labels, &harm);
        let verdict = judge(&trial, &model, true);
        let all = (verdict.right + verdict.wrong + verdict.missed).max(1) as f64;
        let (live, offline) = verdict.fill_means();
        println!(
            "{:36} {:>7} {:>7.3} {:>7.3} {:>7.3} {:>7} {:>5} {:>6.2} {:>6.2} {:>6} {:>6}",
            format!("{name}, seed {seed}"),
            model.labels.len(),
            100.0 * verdict.right_share(),
            100.0 * verdict.wrong as f64 / all,
            100.0 * verdict.missed as f64 / all,
            verdict.haunted,
            verdict.lost,
            1000.0 * live,
            1000.0 * offline,
            verdict.all_work / trial.points.len().max(1) as u64,
            verdict.most_work,
        );
    }
}
