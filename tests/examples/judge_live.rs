//! Judges the live marker tracker on the real takes of `../shared/data`.
//!
//!     cargo run --release -p sinew-tests --example judge_live [-- NAME [--course]]

use sinew_host::fit::live::{LearnOptions, learn};
use sinew_host::import::take::{LengthUnit, TakeOptions, read_take};
use sinew_host::take::Take;
use sinew_tests::live::{Harm, cut, judge, trial};
use sinew_tests::shared;

const FILES: [(&str, Option<LengthUnit>); 5] = [
    ("c3d/cmu_02_05.c3d", None),
    ("c3d/freeform_53mk_gappy.c3d", None),
    ("c3d/vicon_walking2.c3d", None),
    ("face/cheeks_41mk_60hz.csv", Some(LengthUnit::Centimetre)),
    ("trc/marker_flip_dropjump.trc", None),
];

fn studio() -> Vec<(String, Take, Take)> {
    use sinew_host::studio::MarkerLayout;
    let body = sinew_tests::human::avatar();
    let mut all = Vec::new();
    for (name, layout) in [("set41", MarkerLayout::Standard41), ("set53", MarkerLayout::Standard53), ("dense120", MarkerLayout::Dense(120)), ("dense350", MarkerLayout::Dense(350))] {
        let film = |clip: usize| sinew_tests::marker_film::truth(&body, &body.clips[clip], layout, 120.0, 8.0);
        let (walk, kneel) = (film(0), film(1));
        let half = kneel.frame_count() / 2;
        // Learned from the walk and half of the kneeling.
        let lesson = join(&walk, &cut(&kneel, 0, half));
        all.push((format!("studio_{name}"), lesson, cut(&kneel, half, kneel.frame_count())));
    }
    all
}

fn join(a: &Take, b: &Take) -> Take {
    let mut paths = Vec::new();
    for marker in 0..a.marker_count() {
        paths.extend_from_slice(a.trajectory(marker));
        paths.extend_from_slice(b.trajectory(marker));
    }
    Take::new(a.labels().to_vec(), a.rate(), a.frame_count() + b.frame_count(), paths).unwrap()
}

fn main() {
    if std::env::args().any(|a| a == "studio") {
        for (name, lesson, test) in studio() {
            let model = learn(&[lesson], &LearnOptions::default(), &|| {}).unwrap();
            for seed in 1..=2 {
                let trial = trial(&test, &model.labels, &Harm { seed, ..Harm::default() });
                dump(&trial, &model, &format!("{}/{name}_{seed}.bin", std::env::var("LAB").unwrap()));
            }
        }
        return;
    }
    let wanted = std::env::args().nth(1).unwrap_or_default();
    let detail = std::env::args().any(|argument| argument == "--course");
    println!(
        "{:32} {:>4} {:>7} {:>7} {:>7} {:>7} {:>6} {:>6} {:>6} {:>6} {:>5} {:>6} {:>6} {:>6}",
        "take, half",
        "mk",
        "right%",
        "wrong%",
        "missed%",
        "haunted",
        "lost",
        "live",
        "offl",
        "jump",
        "first",
        "work",
        "most",
        "bound"
    );
    for (file, unit) in FILES {
        if !file.contains(&wanted) {
            continue;
        }
        let Some(path) = shared(file) else { continue };
        let options = TakeOptions {
            unit,
            ..TakeOptions::default()
        };
        let raw = read_take(&path, &options).unwrap();
        let take = Take::from_raw(&raw).unwrap().0;
        let half = take.frame_count() / 2;
        for (name, train, test) in [
            ("2nd", (0, half), (half, take.frame_count())),
            ("1st", (half, take.frame_count()), (0, half)),
        ] {
            let model = match learn(
                &[cut(&take, train.0, train.1)],
                &LearnOptions::default(),
                &|| {},
            ) {
                Ok(model) => model,
                Err(error) => {
                    println!("{file} {name}: {error}");
                    continue;
                }
            };
            let test = cut(&take, test.0, test.1);
            for seed in 1..=2 {
                let harm = Harm {
                    seed,
                    ..Harm::default()
                };
                let trial = trial(&test, &model.labels, &harm);
                let start = std::time::Instant::now();
                if let Ok(folder) = std::env::var("LAB") {
                    dump(
                        &trial,
                        &model,
                        &format!(
                            "{folder}/{}_{name}_{seed}.bin",
                            file.rsplit('/').next().unwrap()
                        ),
                    );
                    continue;
                }
                let verdict = judge(&trial, &model, true);
                let _ = start;
                let all = (verdict.right + verdict.wrong + verdict.missed).max(1) as f64;
                let (live, offline) = verdict.fill_means();
                println!(
                    "{:32} {:>4} {:>7.3} {:>7.3} {:>7.3} {:>7} {:>6} {:>6.2} {:>6.2} {:>6.1} {:>5} {:>6} {:>6}",
                    format!("{} {name} {seed}", file.rsplit('/').next().unwrap()),
                    model.labels.len(),
                    100.0 * verdict.right_share(),
                    100.0 * verdict.wrong as f64 / all,
                    100.0 * verdict.missed as f64 / all,
                    verdict.haunted,
                    verdict.lost,
                    1000.0 * live,
                    1000.0 * offline,
                    1000.0 * verdict.jump,
                    verdict.recognised,
                    verdict.all_work / trial.points.len().max(1) as u64,
                    verdict.most_work,
                );
                if detail {
                    for (frame, (wrong, missed)) in verdict.course.iter().enumerate() {
                        if wrong + missed > 0 {
                            print!("{frame}:{wrong}/{missed}({}) ", trial.points[frame].len());
                        }
                    }
                    println!();
                    for (label, (wrong, missed)) in model.labels.iter().zip(&verdict.by_marker) {
                        if wrong + missed > 0 {
                            print!("{label}:{wrong}/{missed} ");
                        }
                    }
                    println!();
                }
            }
        }
    }
}

fn dump(trial: &sinew_tests::live::Trial, model: &sinew_host::fit::live::MarkerModel, path: &str) {
    let mut w: Vec<u32> = Vec::new();
    w.extend([
        model.labels.len() as u32,
        (model.neighbours.len() / model.labels.len()) as u32,
        model.seeds.len() as u32,
        trial.points.len() as u32,
    ]);
    w.push((trial.rate as f32).to_bits());
    w.extend(model.markers.iter().flatten().map(|x| x.to_bits()));
    w.extend(model.neighbours.iter().map(|x| u32::from(*x)));
    w.extend(model.links.iter().flatten().map(|x| x.to_bits()));
    w.extend(model.seed_markers.iter().map(|x| u32::from(*x)));
    w.extend(model.seeds.iter().flatten().map(|x| x.to_bits()));
    let options = sinew_host::clean::fill::FillOptions {
        limit: f64::INFINITY,
        ..Default::default()
    };
    let offline = sinew_host::clean::fill::fill(&trial.broken, &options, &|| {}).take;
    for frame in 0..trial.points.len() {
        w.push(trial.points[frame].len() as u32);
        for (p, o) in trial.points[frame].iter().zip(&trial.owners[frame]) {
            w.extend(p.map(f32::to_bits));
            w.push(o.map_or(u32::MAX, |o| o as u32));
        }
        for (marker, t) in trial.truth[frame].iter().enumerate() {
            let t = t.map_or([f32::NAN; 3], |t| t.as_vec3().to_array());
            w.extend(t.map(f32::to_bits));
            let o = offline
                .position(marker, frame)
                .map_or([f32::NAN; 3], |t| t.as_vec3().to_array());
            w.extend(o.map(f32::to_bits));
        }
    }
    let bytes: Vec<u8> = w.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(path, bytes).unwrap();
    let mut names = model.labels.join("\n");
    names.push('\n');
    std::fs::write(format!("{path}.txt"), names).unwrap();
}
