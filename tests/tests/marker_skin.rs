//! Skin from dense markers: the core against the `f64` oracle, hostile input, the asset.

use glam::{DMat3, DQuat, DVec3};
use sinew_core::Level;
use sinew_core::asset::{Asset, AssetError, MarkerMode, crc32};
use sinew_core::deform::parts::ExactBudget;
use sinew_host::bake::write::MarkerSkinData;
use sinew_host::bake::{AssetBytes, BakeOptions, bake_with};
use sinew_host::fit::parts::measure::{measure, recommended};
use sinew_host::fit::parts::{
    Glued, Learnt, MarkerPlayer, Mode, Options, PartsFitError, Segments, glue, learn, marker_frame,
};
use sinew_host::model::Avatar;
use sinew_host::reference;
use sinew_tests::laplacian::{baseline, jointed_tube, on_tube};

const MODES: [Mode; 3] = [Mode::Exact, Mode::Collapsed, Mode::Hybrid];
const RINGS: u32 = 31;
const SIDES: u32 = 16;

/// A tube of 0.6 m with two joints, bent and bulging, and markers on it.
struct Arm {
    body: Avatar,
    glued: Vec<Glued>,
    rest: Vec<DVec3>,
}

impl Arm {
    fn new() -> Self {
        let body = jointed_tube(RINGS, SIDES, 0.22, 0.16);
        let markers = (0..RINGS).step_by(3).flat_map(|ring| {
            // Rows of four, every second row turned by half.
            (0..4).map(move |side| ring * SIDES + (4 * side + 2 * (ring / 3 % 2)) % SIDES)
        });
        let glued: Vec<Glued> = markers
            .filter(|&vertex| vertex + SIDES < RINGS * SIDES)
            .map(|vertex| on_tube(vertex, SIDES))
            .collect();
        let positions = &body.mesh.positions;
        let rest = glued.iter().map(|marker| marker.on(positions)).collect();
        Self { body, glued, rest }
    }

    /// The true surface at a time: bends, turns, bulges, and moves through the room.
    fn surface(&self, time: f64) -> Vec<DVec3> {
        let bend = DMat3::from_rotation_x(1.1 * (1.3 * time).sin())
            * DMat3::from_rotation_y(0.6 * (0.9 * time).cos());
        let room = DQuat::from_rotation_y(0.4 * time) * DQuat::from_rotation_z(0.3 * time.sin());
        let shift = DVec3::new(0.3 * time, 0.1 * time.sin(), -0.2 * time);
        let bulge = 0.006 * (1.0 + (1.3 * time).sin());
        let vertices = self.body.mesh.positions.iter().zip(&self.body.mesh.normals);
        vertices
            .zip(&self.body.skin.influences)
            .map(|((&p, &n), row)| {
                let swell = bulge * (-((p.y - 0.15) / 0.07).powi(2)).exp() * (1.0 + n.x);
                let p = p + n * swell;
                let moved: DVec3 = row
                    .iter()
                    .map(|&(bind, weight)| {
                        let elbow = DVec3::Y * 0.3;
                        weight
                            * if bind == 0 {
                                p
                            } else {
                                bend * (p - elbow) + elbow
                            }
                    })
                    .sum();
                room * moved + shift
            })
            .collect()
    }

    fn markers(&self, time: f64) -> Vec<DVec3> {
        let surface = self.surface(time);
        self.glued
            .iter()
            .map(|marker| marker.on(&surface))
            .collect()
    }

    fn frames(&self) -> Vec<Vec<DVec3>> {
        (0..60)
            .map(|frame| self.markers(0.17 * f64::from(frame)))
            .collect()
    }

    fn learnt(&self) -> Learnt {
        let segments = Segments::of_rig(&self.body, &self.glued);
        assert_eq!(segments.part_count(), 2);
        let glued = (&self.glued[..], &self.rest[..]);
        learn(
            &self.body.mesh,
            &segments,
            glued,
            &self.frames(),
            &Options::default(),
        )
        .expect("learns")
    }
}

fn distances(found: &[[f32; 3]], truth: &[DVec3]) -> (f64, f64) {
    let off = found
        .iter()
        .zip(truth)
        .map(|(a, b)| DVec3::from_array(a.map(f64::from)).distance(*b));
    let off: Vec<f64> = off.collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    (mean, off.iter().copied().fold(0.0, f64::max))
}

#[test]
fn the_core_agrees_with_the_oracle_in_every_mode() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    for mode in MODES {
        let switches = if mode == Mode::Exact {
            &[(true, true), (true, false), (false, true), (false, false)][..]
        } else {
            &[(true, true)][..]
        };
        for &(quadratic, residual) in switches {
            let budget = ExactBudget {
                quadratic,
                residual_parts: if residual { usize::MAX } else { 0 },
            };
            let mut player = learnt.player(mode).expect("sound").with_budget(budget);
            for time in [0.0, 1.25, 7.9] {
                let markers = arm.markers(time);
                player.step(&marker_frame(&markers));
                let terms = (quadratic, residual);
                let oracle =
                    reference::parts::positions(&learnt.rig, learnt.mode(mode), &markers, terms);
                let (_, most) = distances(player.positions(), &oracle);
                assert!(most < 2e-5, "{mode:?} {terms:?}: {most}");
            }
        }
    }
}

#[test]
fn unseen_motion_is_followed_and_residuals_help() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    let error = |mode, budget| {
        let mut player = learnt.player(mode).expect("sound").with_budget(budget);
        let times = (0..20).map(|k| 0.3 + 0.41 * f64::from(k));
        let mut worst = 0.0_f64;
        let sum: f64 = times
            .map(|time| {
                player.step(&marker_frame(&arm.markers(time)));
                let (mean, most) = distances(player.positions(), &arm.surface(time));
                worst = worst.max(most);
                mean / 20.0
            })
            .sum();
        assert!(worst < 0.04, "{mode:?}: {worst}");
        sum
    };
    let rigid = error(
        Mode::Exact,
        ExactBudget {
            quadratic: false,
            residual_parts: 0,
        },
    );
    let exact = error(Mode::Exact, ExactBudget::UNLIMITED);
    let collapsed = error(Mode::Collapsed, ExactBudget::UNLIMITED);
    let hybrid = error(Mode::Hybrid, ExactBudget::UNLIMITED);
    println!("rigid {rigid:.5} exact {exact:.5} collapsed {collapsed:.5} hybrid {hybrid:.5} m");
    assert!(exact < 0.6 * rigid);
    assert!(hybrid < exact && collapsed < exact + 0.15e-3);
}

#[test]
fn normals_follow_the_surface_in_every_mode() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    for mode in MODES {
        let mut player = learnt.player(mode).expect("sound");
        player.step(&marker_frame(&arm.markers(2.1)));
        let at = |v: u32| DVec3::from_array(player.positions()[v as usize].map(f64::from));
        let mut sums = vec![DVec3::ZERO; player.positions().len()];
        for &[a, b, c] in &arm.body.mesh.triangles {
            let normal = (at(b) - at(a)).cross(at(c) - at(a));
            for v in [a, b, c] {
                sums[v as usize] += normal;
            }
        }
        // The rims have triangles on one side only.
        let inner = (2 * SIDES) as usize..((RINGS - 2) * SIDES) as usize;
        let angles: Vec<f64> = inner
            .map(|v| {
                let normal = DVec3::from_array(player.normals()[v].map(f64::from));
                normal.angle_between(sums[v]).to_degrees()
            })
            .collect();
        let mean = angles.iter().sum::<f64>() / angles.len() as f64;
        println!("{mode:?}: {mean:.2} degrees");
        assert!(mean < 3.0, "{mode:?}: {mean}");
    }
}

#[test]
fn every_level_gives_the_same_bits() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    for mode in MODES {
        let mut seen = Vec::new();
        for level in [Level::Scalar, Level::best(), Level::Simd(baseline())] {
            let mut player = learnt.player(mode).expect("sound").with_level(level);
            for time in [0.4, 0.6] {
                player.step(&marker_frame(&arm.markers(time)));
            }
            let rows = player.positions().iter().chain(player.normals()).flatten();
            seen.push(rows.map(|x| x.to_bits()).collect::<Vec<_>>());
        }
        assert!(seen.windows(2).all(|pair| pair[0] == pair[1]), "{mode:?}");
    }
}

#[test]
fn missing_and_hostile_markers_neither_jump_nor_spoil_what_follows() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    for mode in MODES {
        let mut player = learnt.player(mode).expect("sound");
        for frame in 0..5 {
            player.step(&marker_frame(&arm.markers(0.02 * f64::from(frame))));
        }
        let truth = arm.surface(0.1);
        let mut markers = marker_frame(&arm.markers(0.1));
        for at in [3, 4, 9, 17] {
            markers[at] = [f32::NAN, 0.0, 0.0];
        }
        markers[20][1] = f32::INFINITY;
        player.step(&markers);
        assert_eq!(player.report().0.held_markers, 5);
        let (_, most) = distances(player.positions(), &truth);
        assert!(most < 0.02, "{mode:?}: {most}");
        // A marker that jumps away by a metre is held to what was learnt.
        let mut markers = marker_frame(&arm.markers(0.12));
        markers[12][0] += 1.0;
        player.step(&markers);
        assert_eq!(player.report().0.limited_markers, 1);
        player.step(&[]);
        assert_eq!(player.report().0.held_parts, 2);
        for number in [1e30, -1e30, f32::MAX, f32::NAN, 1e-40, 9.9e5] {
            player.step(&vec![[number, -number, number]; arm.glued.len()]);
            let all = player.positions().iter().chain(player.normals()).flatten();
            assert!(all.clone().all(|x| x.is_finite()), "{mode:?} {number}");
        }
        player.step(&marker_frame(&arm.markers(0.14)));
        player.step(&marker_frame(&arm.markers(0.14)));
        let (mean, _) = distances(player.positions(), &arm.surface(0.14));
        assert!(mean < 2e-3, "{mode:?} recovers: {mean}");
    }
}

#[test]
fn a_budget_of_residual_parts_reaches_all_in_turn() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    let markers = marker_frame(&arm.markers(3.0));
    let mut whole = learnt.player(Mode::Exact).expect("sound");
    whole.step(&markers);
    let budget = ExactBudget {
        residual_parts: 1,
        ..ExactBudget::UNLIMITED
    };
    let mut sliced = learnt
        .player(Mode::Exact)
        .expect("sound")
        .with_budget(budget);
    sliced.step(&markers);
    let report = sliced.report().1;
    assert_eq!((report.solved_parts, report.skipped_parts), (1, 1));
    assert_ne!(sliced.positions(), whole.positions());
    sliced.step(&markers);
    let (_, most) = distances(
        sliced.positions(),
        &whole
            .positions()
            .iter()
            .map(|p| DVec3::from_array(p.map(f64::from)))
            .collect::<Vec<_>>(),
    );
    assert!(most < 1e-6, "{most}");
}

fn baked(arm: &Arm, learnt: &Learnt, mode: Mode) -> AssetBytes {
    let skin = MarkerSkinData {
        names: (0..arm.glued.len()).map(|at| format!("M{at:03}")).collect(),
        rig: learnt.rig.clone(),
        mode: learnt.mode(mode).clone(),
    };
    let baked = bake_with(&arm.body, &BakeOptions::default(), Some(&skin), None);
    baked.expect("bakes").bytes
}

#[test]
fn an_asset_holds_the_skin_and_plays_it_alike() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    for mode in MODES {
        let bytes = baked(&arm, &learnt, mode);
        let asset = bytes.asset().expect("sound");
        let skin = asset.marker_skin().expect("has markers");
        assert_eq!(asset.marker_name(2), "M002");
        assert!(matches!(
            (&skin.mode, mode),
            (MarkerMode::Exact(_), Mode::Exact)
                | (MarkerMode::Collapsed(_), Mode::Collapsed)
                | (MarkerMode::Hybrid(_), Mode::Hybrid)
        ));
        let (mut ours, mut theirs) = (learnt.player(mode).expect("sound"), MarkerPlayer::of(skin));
        let markers = marker_frame(&arm.markers(5.0));
        ours.step(&markers);
        theirs.step(&markers);
        assert_eq!(ours.positions(), theirs.positions());
        assert_eq!(
            bytes,
            baked(&arm, &learnt, mode),
            "the same input, the same bytes"
        );
    }
}

#[test]
fn flipped_bits_of_the_skin_are_refused_or_harmless() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    let mut random = sinew_tests::Random(7);
    for mode in MODES {
        let sound = baked(&arm, &learnt, mode).as_slice().to_vec();
        for _ in 0..150 {
            let mut bytes = sound.clone();
            let at = 32 + random.below(bytes.len() - 32);
            bytes[at] ^= 1 << random.below(8);
            let checksum = crc32(&bytes[20..]);
            bytes[16..20].copy_from_slice(&checksum.to_le_bytes());
            let bytes = AssetBytes::new(&bytes);
            let asset: Result<Asset<'_>, AssetError> = bytes.asset();
            if let Some(skin) = asset.ok().and_then(|asset| asset.marker_skin()) {
                let mut player = MarkerPlayer::of(skin);
                player.step(&marker_frame(&arm.markers(1.0)));
            }
        }
    }
}

#[test]
fn markers_in_the_room_are_glued_where_they_were() {
    let arm = Arm::new();
    let turn = DQuat::from_rotation_y(2.0);
    let away: Vec<DVec3> = arm
        .rest
        .iter()
        .map(|&p| {
            turn * (p + 0.004 * DVec3::new(p.x, 0.0, p.z).normalize()) + DVec3::new(3.0, 0.0, 1.0)
        })
        .collect();
    let fitted = glue::fit(&arm.body.mesh, &away).expect("glues");
    assert!(fitted.mean_distance < 0.006, "{}", fitted.mean_distance);
    let far: Vec<DVec3> = away.iter().map(|p| *p * 3.0).collect();
    let error = glue::fit(&arm.body.mesh, &far).expect_err("another pose");
    assert!(matches!(error, PartsFitError::OtherPose { .. }), "{error}");
}

#[test]
fn modes_are_measured_on_markers_and_frames_held_out() {
    let arm = Arm::new();
    let segments = Segments::of_rig(&arm.body, &arm.glued);
    let glued = (&arm.glued[..], &arm.rest[..]);
    let scores = measure(
        &arm.body.mesh,
        &segments,
        glued,
        &arm.frames(),
        &Options::default(),
    );
    let scores = scores.expect("measures");
    for score in &scores {
        println!("{score:?}");
        assert!(score.mean < 6e-3 && score.max < 0.04, "{score:?}");
    }
    assert!(recommended(&scores).is_some());
    let cost = |mode| {
        scores
            .iter()
            .find(|s| s.mode == mode)
            .expect("all")
            .multiply_adds
    };
    assert!(cost(Mode::Collapsed) < cost(Mode::Exact));
}

#[test]
fn too_little_to_learn_from_is_said() {
    let arm = Arm::new();
    let segments = Segments::of_rig(&arm.body, &arm.glued);
    let glued = (&arm.glued[..], &arm.rest[..]);
    let frames = arm.frames();
    let options = Options::default();
    let learn = |glued, frames: &[Vec<DVec3>]| {
        learn(&arm.body.mesh, &segments, glued, frames, &options).expect_err("refused")
    };
    let error = learn(glued, &frames[..3]);
    assert!(
        matches!(error, PartsFitError::TooFew { found: 3, .. }),
        "{error}"
    );
    let mut holed = frames.clone();
    holed[4][2] = DVec3::NAN;
    let error = learn(glued, &holed);
    assert_eq!(
        error,
        PartsFitError::Missing {
            frame: 4,
            marker: 2
        }
    );
    let mut beside = arm.glued.clone();
    beside[1].vertices[0] = 1_000_000;
    let error = learn((&beside, &arm.rest), &frames);
    assert!(
        matches!(error, PartsFitError::Glue { marker: 1, .. }),
        "{error}"
    );
}
