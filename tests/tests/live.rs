//! Live marker labelling: learned by the host, run by the core, judged by what was known.

use std::sync::OnceLock;

use glam::DVec3;
use sinew_core::track::markers::{Config, Phase, Source, work_bound};
use sinew_host::fit::live::{LearnError, LearnOptions, MarkerModel, learn};
use sinew_host::label::{Labeller, label};
use sinew_host::reference::markers::expect;
use sinew_host::studio::MarkerLayout;
use sinew_host::take::Take;
use sinew_tests::live::{Harm, cut, judge, trial};
use sinew_tests::marker_film::{self, truth};
use sinew_tests::{Random, human};

/// A set of 53 learned from three seconds of walking, and the second after them.
fn walk() -> &'static (MarkerModel, Take) {
    static WALK: OnceLock<(MarkerModel, Take)> = OnceLock::new();
    WALK.get_or_init(|| {
        let body = human::avatar();
        let film = truth(&body, &body.clips[0], MarkerLayout::Standard53, 120.0, 5.0);
        let (lesson, test) = (cut(&film, 0, 400), cut(&film, 400, film.frame_count()));
        let model = learn(&[lesson], &LearnOptions::default(), &|| ()).unwrap();
        (model, test)
    })
}

#[test]
fn a_clean_walk_is_never_labelled_wrongly_in_any_order_and_place() {
    let (model, test) = walk();
    let calm = Harm {
        hidden: 0.0,
        ghosts: 0.0,
        blanks: 0.0,
        ..Harm::default()
    };
    let verdict = judge(&trial(test, &model.labels, &calm), model, false);
    assert_eq!(verdict.wrong, 0);
    assert!(verdict.right_share() >= 0.9, "{}", verdict.right_share());
}

#[test]
fn work_stays_within_its_bound_whatever_the_points_are() {
    let (model, _) = walk();
    let core = model.model();
    let config = Config::new(120.0, core.dims());
    let bound = work_bound(core.dims(), 80, config.search);
    let mut labeller = Labeller::new(core, config, 80);
    let (mut random, mut samples) = (Random(5), Vec::new());
    for frame in 0..300 {
        // Points close together, so that every search looks at all of them; some unusable.
        let size = [0.05, 0.5, 2.0][frame % 3];
        let points: Vec<[f32; 3]> = (0..frame % 100)
            .map(|_| [(); 3].map(|()| (size * random.unit()) as f32))
            .chain([[f32::NAN; 3], [1e9, 0.0, 0.0]])
            .collect();
        let report = labeller.step(&points, &mut samples).unwrap();
        assert!(report.work <= bound, "{} > {bound}", report.work);
        assert!(report.unusable == 2 || report.surplus > 0);
        assert!(samples.iter().flat_map(|s| s.position).all(f32::is_finite));
    }
}

#[test]
fn expectations_agree_with_the_oracle() {
    let (model, test) = walk();
    let core = model.model();
    let (mut worst, mut count): (f64, usize) = (0.0, 0);
    for frame in (0..test.frame_count()).step_by(20) {
        for marker in 0..model.labels.len() {
            let of = |index: usize| {
                let label = &model.labels[index];
                test.labels().iter().position(|other| other == label)
            };
            let place = |index: usize| test.position(of(index)?, frame);
            let single = |index| Some(place(index)?.as_vec3().to_array());
            let Some(found) = core.expect(marker, single) else {
                continue;
            };
            let exact = expect(&model.tables(), marker, place).unwrap();
            count += 1;
            let found = DVec3::new(found[0].into(), found[1].into(), found[2].into());
            worst = worst.max(found.distance(exact));
        }
    }
    assert!(count > 300, "{count}");
    // The core takes two steps towards the rotation that the oracle decomposes a matrix for.
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn the_set_is_lost_with_all_points_and_found_again() {
    let (model, test) = walk();
    let core = model.model();
    let mut labeller = Labeller::new(core, Config::new(120.0, core.dims()), 64);
    let mut samples = Vec::new();
    let points = |frame: usize| -> Vec<[f32; 3]> {
        test.seen(frame)
            .map(|(_, p)| p.as_vec3().to_array())
            .collect()
    };
    for frame in 0..20 {
        labeller.step(&points(frame), &mut samples).unwrap();
    }
    for _ in 0..60 {
        labeller.step(&[], &mut samples).unwrap();
    }
    assert!(samples.iter().all(|sample| sample.source == Source::Lost));
    let mut report = labeller.step(&points(80), &mut samples).unwrap();
    for frame in 81..90 {
        report = labeller.step(&points(frame), &mut samples).unwrap();
    }
    assert_eq!(report.phase, Phase::Tracking);
    assert!(report.measured >= 50, "{report:?}");
}

#[test]
fn a_marker_set_survives_the_asset() {
    let (model, test) = walk();
    let bytes = marker_film::asset(test, std::slice::from_ref(test));
    let back = MarkerModel::of(&bytes.asset().unwrap()).unwrap();
    assert_eq!(back.labels.len(), model.labels.len());
    let config = Config::new(120.0, back.model().dims());
    let labelled = label(test, &back.labels, back.model(), config, &|_| ()).unwrap();
    assert_eq!(labelled.take.marker_count(), back.labels.len());
    assert_eq!(labelled.reports.len(), test.frame_count());
}

#[test]
fn takes_that_teach_nothing_are_refused() {
    let still = |count: usize, frames: usize| {
        let labels = (0..count).map(|i| format!("M{i}")).collect();
        let paths = (0..count)
            .flat_map(|i| vec![DVec3::X * i as f64; frames])
            .collect();
        Take::new(labels, 100.0, frames, paths).unwrap()
    };
    let refuse = |takes: &[Take]| learn(takes, &LearnOptions::default(), &|| ()).unwrap_err();
    assert!(matches!(refuse(&[]), LearnError::Frames { .. }));
    assert!(matches!(refuse(&[still(8, 5)]), LearnError::Frames { .. }));
    assert!(matches!(
        refuse(&[still(3, 99)]),
        LearnError::Markers { .. }
    ));
}
