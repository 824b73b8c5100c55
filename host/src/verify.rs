//! An asset against the oracle: what the core computes, and what it should.

use glam::DVec3;
use sinew_core::asset::Asset;
use sinew_core::deform::Level;
use sinew_core::frame::Input;

use crate::model::Avatar;
use crate::play::{Player, fingerprint, frame_times};
use crate::reference;
use crate::reference::correctives::Flesh;
use crate::reference::marked::Marked;

/// How far the core is from the oracle over all clips, at every sample and halfway between.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VerifyReport {
    /// Frames compared.
    pub frames: usize,
    /// Metres, mean over vertices and frames.
    pub mean_error: f64,
    /// Metres, largest.
    pub worst_error: f64,
    /// Where the largest is: clip, seconds, source vertex.
    pub worst_place: (usize, f64, usize),
    /// Radians, largest angle between normals.
    pub worst_normal: f64,
    /// Bodies of this height, metres.
    pub height: f64,
    /// See [`fingerprint`].
    pub fingerprint: u64,
    /// Whether one vertex at a time gives the same bits as the best instructions.
    pub levels_agree: bool,
    /// Vertices that the source order does not name exactly once.
    pub order_faults: usize,
}

impl VerifyReport {
    /// Whether the asset does what it should: the error within `limit` of a body of 1.8 m, the
    /// same bits at every level, every vertex once.
    #[must_use]
    pub fn passed(&self, limit: f64) -> bool {
        self.worst_error <= self.limit(limit) && self.levels_agree && self.order_faults == 0
    }

    /// Metres that a body of this height may be off, given those of a body of 1.8 m.
    #[must_use]
    pub fn limit(&self, limit: f64) -> f64 {
        limit * (self.height / 1.8).max(1e-3)
    }
}

/// Metres that the core may be off an oracle that plays the same asset: 32-bit arithmetic.
pub const CORE_LIMIT: f64 = 1e-5;

/// Metres that an asset may be off the body it was baked from: 16-bit weights and sparse keys too.
pub const BAKE_LIMIT: f64 = 2e-5;

/// Metres that a surface solved in each frame may be off its oracle: a solve rounds more.
pub const EXACT_LIMIT: f64 = 5e-5;

/// What an asset may be off, given what a skinned one may.
#[must_use]
pub fn limit_of(asset: &Asset<'_>, limit: f64) -> f64 {
    if asset.dims().laplacian.is_exact() {
        EXACT_LIMIT
    } else {
        limit
    }
}

/// Compares the core with the oracle playing `truth`: the body unpacked from the asset itself, or
/// the body it was baked from. `progress` is called with frames done and frames in all.
/// O(frames x vertices).
pub fn verify(
    asset: &Asset<'_>,
    truth: &Avatar,
    mut progress: impl FnMut(usize, usize),
) -> VerifyReport {
    let mut report = VerifyReport {
        height: height(&truth.mesh.positions),
        levels_agree: true,
        order_faults: order_faults(asset),
        ..VerifyReport::default()
    };
    // An asset that passed its check can be factored; if not, the skin stands in and fails.
    let marked = Marked::new(asset).ok().flatten();
    let mut flesh = asset.corrective().map(Flesh::new);
    let mut player = Player::new(*asset);
    let mut scalar = Player::new(*asset).with_level(Level::Scalar);
    let moments = moments(asset);
    for (done, &(clip, seconds)) in moments.iter().enumerate() {
        let input = match clip {
            Some(index) => Input::Clip {
                index,
                seconds: seconds as f32,
                looped: false,
            },
            None => Input::Rest,
        };
        player.step(&input);
        scalar.step(&input);
        let bits = |a: &[[f32; 3]], b: &[[f32; 3]]| {
            let (a, b) = (a.as_flattened().iter(), b.as_flattened());
            a.zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
        };
        report.levels_agree &= bits(player.positions(), scalar.positions())
            && bits(player.normals(), scalar.normals());
        let morphs = &truth.mesh.morphs;
        let (local, mut weights) = match clip {
            Some(index) => {
                // The core sees the time as `f32`, so the oracle must too.
                let seconds = f64::from(seconds as f32);
                let clip = &truth.clips[index];
                let local = reference::pose::sample(&truth.skeleton, clip, seconds);
                (local, reference::morph::sample(morphs, clip, seconds))
            }
            None => (truth.skeleton.rest(), reference::morph::rest(morphs)),
        };
        let model = reference::pose::model(&truth.skeleton, &local);
        if let Some(marked) = &marked {
            let (points, normals) = marked.surface(&model);
            compare(&mut report, &player, &points, &normals, (clip, seconds));
            progress(done + 1, moments.len());
            continue;
        }
        if let Some(flesh) = &mut flesh {
            let binds = truth.skin.binds.iter();
            let palette: Vec<_> = binds.map(|b| model[b.joint] * b.inverse_bind).collect();
            let predicted = flesh.step(&palette, FRAME);
            let usual = weights.len().saturating_sub(predicted.len());
            weights.splice(usual.., predicted);
        }
        let morphed =
            (!morphs.is_empty()).then(|| reference::morph::morphed(&truth.mesh, &weights));
        let mesh = morphed.as_ref().unwrap_or(&truth.mesh);
        let (points, normals) = reference::skin::linear_blend(mesh, &truth.skin, &model);
        compare(&mut report, &player, &points, &normals, (clip, seconds));
        progress(done + 1, moments.len());
    }
    report.frames = moments.len();
    report.mean_error /= (moments.len() * truth.mesh.positions.len()) as f64;
    report.fingerprint = fingerprint(asset, Level::best());
    report
}

/// Seconds between frames for what swings in time.
const FRAME: f64 = 1.0 / 60.0;

/// Adds the distances of a frame.
fn compare(
    report: &mut VerifyReport,
    player: &Player<'_>,
    points: &[DVec3],
    normals: &[DVec3],
    (clip, seconds): (Option<usize>, f64),
) {
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    for (vertex, (point, normal)) in points.iter().zip(normals).enumerate() {
        let error = wide(player.positions()[vertex]).distance(*point);
        report.mean_error += error;
        if error > report.worst_error {
            report.worst_error = error;
            report.worst_place = (clip.unwrap_or(0), seconds, vertex);
        }
        let angle = wide(player.normals()[vertex]).angle_between(*normal);
        report.worst_normal = report.worst_normal.max(angle);
    }
}

/// The rest pose, then every sample and every middle of two samples of every clip.
fn moments(asset: &Asset<'_>) -> Vec<(Option<usize>, f64)> {
    let mut moments = vec![(None, 0.0)];
    let clips = (0..asset.dims().clip_count).filter_map(|index| Some((index, asset.clip(index)?)));
    for (index, clip) in clips {
        let period = f64::from(clip.sample_period);
        let period = if period > 0.0 { period } else { DEFAULT_PERIOD };
        let times = frame_times(clip.duration.into(), 2.0 / period);
        moments.extend(times.into_iter().map(|time| (Some(index), time)));
    }
    moments
}

/// Seconds between frames of a clip that was not sampled evenly.
pub const DEFAULT_PERIOD: f64 = 1.0 / 30.0;

/// Metres from the lowest to the highest point.
#[must_use]
pub fn height(positions: &[DVec3]) -> f64 {
    let (low, high) = positions
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
            (low.min(p.y), high.max(p.y))
        });
    (high - low).max(0.0)
}

fn order_faults(asset: &Asset<'_>) -> usize {
    let mut seen = vec![0_usize; asset.dims().vertex_count];
    for &source in asset.source_order() {
        seen[source as usize] += 1;
    }
    seen.into_iter().filter(|&count| count != 1).count()
}
