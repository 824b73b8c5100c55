//! An asset in which every joint is a marker on the bundled body: a stage plays its clip as what a
//! capture system would see, and labels it with the marker set in the same asset.

use glam::{DAffine3, DVec3};
use sinew_host::bake::{AssetBytes, BakeOptions, bake_with};
use sinew_host::fit::live::{LearnOptions, learn};
use sinew_host::import::{
    Channel, Interpolation, RawAvatar, RawClip, RawJoint, RawMesh, RawPrimitive, RawSkeleton,
    RawSkin, RawTrack, Transform,
};
use sinew_host::model::{Avatar, Clip};
use sinew_host::studio::{Body, Direction, FleshOptions, MarkerLayout, MarkerSet, Scene};
use sinew_host::take::Take;

/// Where the markers of a layout really are while the body moves, metres; the actor's place and
/// heading follow from the clip.
///
/// # Panics
/// Where the studio refuses the body.
#[must_use]
pub fn truth(body: &Avatar, clip: &Clip, layout: MarkerLayout, rate: f64, seconds: f64) -> Take {
    let scene = Scene {
        rate,
        direction: Direction {
            seconds: Some(seconds),
            ..Direction::default()
        },
        flesh: FleshOptions::default(),
    };
    let film = Body::new(body, clip, scene).expect("the studio films the body");
    let set = MarkerSet::new(body, layout, 1).expect("the body takes the markers");
    let frames = film.frame_count();
    let count = set.markers.len();
    let mut paths = vec![DVec3::NAN; count * frames];
    for frame in 0..frames {
        for (marker, place) in set.positions(&film.surface(frame)).into_iter().enumerate() {
            paths[marker * frames + frame] = place;
        }
    }
    let names = set.markers.iter().map(|marker| marker.name.clone());
    Take::new(names.collect(), rate, frames, paths).expect("a sound take")
}

/// The film of a take with a marker set learned from others.
///
/// # Panics
/// Where the set cannot be learned or the asset not written.
#[must_use]
pub fn asset(film: &Take, lessons: &[Take]) -> AssetBytes {
    let model = learn(lessons, &LearnOptions::default(), &|| ()).expect("the set is learned");
    let order = model.labels.iter().map(|label| {
        let same = |other: &String| other == label;
        film.labels().iter().position(same).expect("filmed too")
    });
    let order: Vec<usize> = order.collect();
    let times: Vec<f64> = (0..film.frame_count())
        .map(|frame| film.seconds(frame))
        .collect();
    let track = |(joint, &marker): (usize, &usize)| RawTrack {
        joint,
        channel: Channel::Translation,
        interpolation: Interpolation::Linear,
        times: times.clone(),
        values: film
            .trajectory(marker)
            .iter()
            .map(|p| [p.x, p.y, p.z, 0.0])
            .collect(),
    };
    let joints = model.labels.iter().map(|label| RawJoint {
        name: label.clone(),
        parent: None,
        rest: Transform::IDENTITY,
    });
    let raw = RawAvatar {
        mesh: RawMesh {
            name: "markers".into(),
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            primitives: vec![RawPrimitive {
                name: "one".into(),
                corners: vec![0, 1, 2],
                polygon_sizes: vec![3],
            }],
            ..RawMesh::default()
        },
        skeleton: RawSkeleton {
            joints: joints.collect(),
        },
        skin: RawSkin {
            joints: vec![0],
            inverse_bind: vec![DAffine3::IDENTITY],
            influences: vec![vec![(0, 1.0)]; 3],
        },
        clips: vec![RawClip {
            name: "film".into(),
            tracks: order.iter().enumerate().map(track).collect(),
            sample_period: Some(1.0 / film.rate()),
            ..RawClip::default()
        }],
        notices: Vec::new(),
    };
    let (avatar, _) = Avatar::new(raw, "markers").expect("a sound avatar");
    let baked = bake_with(&avatar, &BakeOptions::default(), None, Some(&model));
    baked.expect("bakes").bytes
}
