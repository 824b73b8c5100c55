use glam::{DMat3, DVec3};

use super::*;

/// Fourteen markers on a body that turns, flies and stretches a little.
fn body(frames: usize) -> Take {
    let home = |at: usize| {
        let angle = 2.4 * at as f64;
        DVec3::new(0.15 * angle.cos(), 0.05 * at as f64, 0.1 * angle.sin())
    };
    let positions = (0..14).flat_map(|at| {
        (0..frames).map(move |frame| {
            let time = frame as f64 / 100.0;
            let turn = DMat3::from_rotation_y(2.0 * time) * DMat3::from_rotation_x(0.5 * time);
            let soft = 0.004 * DVec3::new((5.0 * time + at as f64).sin(), 0.0, (3.0 * time).cos());
            turn * (home(at) + soft) + DVec3::new(time, time.sin(), 0.0)
        })
    });
    let labels = (0..14).map(|at| format!("C{at}")).collect();
    Take::new(labels, 100.0, frames, positions.collect()).unwrap()
}

fn found(take: &Take) -> Misnamed {
    find(take, &|_| ())
}

#[test]
fn a_sound_take_has_no_exchange() {
    assert!(found(&body(400)).is_empty());
    assert!(found(&Take::new(Vec::new(), 100.0, 0, Vec::new()).unwrap()).is_empty());
    let few = Take::new(vec!["A".into()], 100.0, 3, vec![DVec3::ZERO; 3]).unwrap();
    assert!(found(&few).is_empty());
}

#[test]
fn an_exchange_is_found_to_the_frame_and_undone() {
    let truth = body(400);
    let mut take = truth.clone();
    let made = |frames: Range<usize>| Exchange {
        columns: [3, 6],
        frames,
        before: 0.0,
        after: 0.0,
        odds: 0.0,
    };
    exchange(&mut take, &made(120..260));
    let misnamed = found(&take);
    assert_eq!(misnamed.exchanges.len(), 1, "{misnamed:?}");
    let one = &misnamed.exchanges[0];
    assert_eq!((one.columns, one.frames.clone()), ([3, 6], 120..260));
    assert!(
        one.before > 0.1 && one.after < 0.02 && one.odds > 50.0,
        "{one:?}"
    );
    misnamed.undo(&mut take);
    assert_eq!(take, truth);
}

#[test]
fn a_name_that_goes_over_behind_a_gap_is_found() {
    let truth = body(400);
    let mut take = truth.clone();
    // Marker 5 is out of sight from 200 to 240 and then sits on marker 9, whose name is missing.
    for frame in 200..300 {
        take.set_position(5, frame, (frame >= 240).then(|| truth.trajectory(9)[frame]));
        take.set_position(9, frame, None);
    }
    let misnamed = found(&take);
    assert_eq!(misnamed.exchanges.len(), 1, "{misnamed:?}");
    misnamed.undo(&mut take);
    for frame in 240..300 {
        assert_eq!(take.position(9, frame), truth.position(9, frame));
        assert_eq!(take.position(5, frame), None);
    }
}

#[test]
fn a_brief_sight_far_from_its_marker_is_stray() {
    let truth = body(400);
    let mut take = truth.clone();
    for frame in 100..130 {
        let ghost = truth.trajectory(2)[frame] + DVec3::X * 0.4;
        take.set_position(2, frame, (110..115).contains(&frame).then_some(ghost));
    }
    let misnamed = found(&take);
    assert!(misnamed.exchanges.is_empty(), "{misnamed:?}");
    assert_eq!(misnamed.strays.len(), 1);
    let one = &misnamed.strays[0];
    assert_eq!((one.column, one.frames.clone()), (2, 110..115));
    assert!(one.distance > 0.3);
    misnamed.undo(&mut take);
    assert_eq!(take.position(2, 112), None);
}
