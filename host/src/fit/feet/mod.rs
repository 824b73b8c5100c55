//! Feet that stand where they stood: contacts of the source are held on the target's floor.
//!
//! Rotations alone put a foot only roughly where it belongs on a body of other proportions; it
//! slides and sinks in. Here heel and ball of each foot are held on the floor as long as they stand
//! in the source ([`contact`]), the leg follows by inverse kinematics, and the hips sink where a leg
//! would be too short. Between contacts the correction fades from one to the next over the whole
//! step, so that nothing jumps; soles and toes never go below the floor. After Kovar, Schreiner and
//! Gleicher, *Footskate Cleanup for Motion Capture Editing* (2002).

use glam::{DAffine3, DQuat, DVec3};

use crate::fit::Side;
use crate::fit::humanoid::{Humanoid, SIDES};
use crate::model::{Avatar, Channel, Clip, Interpolation, Motion, Track, Transform};
use crate::reference::aim::two_bone;
use crate::reference::pose::sample;

pub mod contact;
pub mod sole;

use contact::{Contacts, contacts};
use sole::Sole;

/// The hips sink and rise over so much to either side, seconds.
const SINK: f64 = 0.12;
/// A leg is not stretched beyond this share of its length.
const STRETCH: f64 = 0.999;

/// What holding the feet did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeetReport {
    /// Contacts of each side that were held.
    pub contacts: Vec<(Side, Contacts)>,
    /// Farthest that a standing heel or ball is from its place on the floor, metres, sideways.
    pub slide: f64,
    /// The same in height.
    pub height: f64,
    /// Deepest that a sole goes below the floor, metres; 0 where none does.
    pub depth: f64,
    /// Farthest that the hips sank, metres.
    pub sink: f64,
}

/// Holds the feet of a clip that was carried over from `source`. `human` are the roles of `body`,
/// `source_human` those of the motion. Bodies without feet come back unchanged. O(frames x joints)
#[must_use]
pub fn hold(
    body: &Avatar,
    human: &Humanoid,
    clip: &Clip,
    source: &Motion,
    source_human: &Humanoid,
) -> (Clip, FeetReport) {
    let mut report = FeetReport::default();
    let longest = clip.tracks.iter().max_by_key(|track| track.times.len());
    let Some(times) = longest.map(|track| track.times.clone()) else {
        return (clip.clone(), report);
    };
    let mut legs: Vec<Leg> = SIDES
        .into_iter()
        .filter_map(|side| {
            let sole = Sole::new(body, human, side)?;
            let contacts = contacts(source, source_human, side, &times);
            Some(Leg::new(side, sole, contacts))
        })
        .collect();
    if legs.is_empty() {
        return (clip.clone(), report);
    }
    let mut poses: Vec<Vec<Transform>> = times
        .iter()
        .map(|&time| sample(&body.skeleton, clip, time))
        .collect();
    let models: Vec<Vec<DAffine3>> = poses.iter().map(|pose| body.skeleton.model(pose)).collect();
    for leg in &mut legs {
        leg.plan(&models, &times);
    }
    let drops = drops(&legs, &models, &times);
    report.sink = drops.iter().copied().fold(0.0, f64::max);
    for (frame, pose) in poses.iter_mut().enumerate() {
        lower(body, human, pose, &models[frame], drops[frame]);
        for leg in &legs {
            leg.bend(body, pose, frame);
        }
        let model = body.skeleton.model(pose);
        for leg in &legs {
            leg.measure(&model, frame, &mut report);
        }
    }
    report.contacts = legs
        .into_iter()
        .map(|leg| (leg.side, leg.contacts))
        .collect();
    (rewritten(body, human, clip, &times, &poses), report)
}

/// Moves the hips down in model space.
fn lower(body: &Avatar, human: &Humanoid, pose: &mut [Transform], model: &[DAffine3], drop: f64) {
    let parent = body.skeleton.joints[human.hips].parent;
    let above = parent.map_or(DAffine3::IDENTITY, |parent| model[parent]);
    let down = above.matrix3.inverse() * (DVec3::NEG_Y * drop);
    pose[human.hips].translation += down;
}

/// How far the hips must sink in each frame so that both legs reach, smoothed but never less.
fn drops(legs: &[Leg], models: &[Vec<DAffine3>], times: &[f64]) -> Vec<f64> {
    let needed = |frame: usize| {
        let of = |leg: &Leg| {
            let [hip, knee, ankle] = leg.sole.leg.map(|joint| models[frame][joint].translation);
            let length = STRETCH * (hip.distance(knee) + knee.distance(ankle));
            let to = leg.goals[frame].place - hip;
            let flat = to.x.hypot(to.z);
            let most = (length * length - flat * flat).max(0.0).sqrt();
            (-to.y - most).max(0.0)
        };
        legs.iter().map(of).fold(0.0, f64::max)
    };
    let needed: Vec<f64> = (0..models.len()).map(needed).collect();
    if needed.iter().all(|&drop| drop == 0.0) {
        return needed;
    }
    let around = |frame: usize| {
        let from = times.partition_point(|&time| time < times[frame] - SINK);
        let to = times.partition_point(|&time| time <= times[frame] + SINK);
        from..to
    };
    let widest: Vec<f64> = (0..needed.len())
        .map(|frame| needed[around(frame)].iter().copied().fold(0.0, f64::max))
        .collect();
    (0..needed.len())
        .map(|frame| {
            let near = &widest[around(frame)];
            near.iter().sum::<f64>() / near.len() as f64
        })
        .collect()
}

/// Where a foot is to be.
#[derive(Clone, Copy, Debug)]
struct Goal {
    /// Of the ankle, metres.
    place: DVec3,
    /// Of the foot, model space.
    turn: DQuat,
}

struct Leg {
    side: Side,
    sole: Sole,
    contacts: Contacts,
    /// `[frames]`: where heel and ball stand, where they do.
    anchors: Vec<[Option<DVec3>; 2]>,
    /// `[frames]`
    goals: Vec<Goal>,
}

/// What is added to a foot's pose.
#[derive(Clone, Copy)]
struct Correction {
    shift: DVec3,
    turn: DQuat,
}

impl Leg {
    fn new(side: Side, sole: Sole, contacts: Contacts) -> Self {
        Self {
            side,
            sole,
            contacts,
            anchors: Vec::new(),
            goals: Vec::new(),
        }
    }

    /// Finds the places of contacts and the goals of all frames.
    fn plan(&mut self, models: &[Vec<DAffine3>], times: &[f64]) {
        let ankle = self.sole.leg[2];
        let feet: Vec<Goal> = models
            .iter()
            .map(|model| Goal {
                place: model[ankle].translation,
                turn: rotation(&model[ankle]),
            })
            .collect();
        self.anchors = self.anchor(&feet);
        // First the turns: a foot that stands on heel and ball lies flat on both.
        let flat = |(foot, anchors): (&Goal, &[Option<DVec3>; 2])| {
            let [Some(heel), Some(ball)] = *anchors else {
                return None;
            };
            let along = self.along(foot.turn).try_normalize()?;
            let to = (ball - heel).try_normalize()?;
            Some(DQuat::from_rotation_arc(along, to))
        };
        let known: Vec<Option<DQuat>> = feet.iter().zip(&self.anchors).map(flat).collect();
        let mut turns = spread(&known, times, DQuat::IDENTITY, |a, b, t| a.slerp(b, t));
        // Where one end stands alone, the other is not below it.
        for (turn, (foot, anchors)) in turns.iter_mut().zip(feet.iter().zip(&self.anchors)) {
            let along = self.along(*turn * foot.turn).normalize_or_zero();
            let below = match *anchors {
                [Some(_), None] => along.y < 0.0,
                [None, Some(_)] => along.y > 0.0,
                _ => false,
            };
            let level = DVec3::new(along.x, 0.0, along.z).try_normalize();
            if let (true, Some(level)) = (below, level) {
                *turn = DQuat::from_rotation_arc(along, level) * *turn;
            }
        }
        // Then the places: the ball stays exactly, the heel where it stands alone.
        let known: Vec<Option<DVec3>> = (0..feet.len())
            .map(|frame| {
                let turn = turns[frame] * feet[frame].turn;
                let held = |point: usize| {
                    let anchor = self.anchors[frame][point]?;
                    Some(anchor - turn * self.sole.stand[point] - feet[frame].place)
                };
                held(1).or_else(|| held(0))
            })
            .collect();
        let shifts = spread(&known, times, DVec3::ZERO, |a, b, t| a.lerp(b, t));
        self.goals = feet
            .iter()
            .zip(turns.iter().zip(&shifts))
            .map(|(foot, (&turn, &shift))| self.above_floor(foot, Correction { shift, turn }))
            .collect();
    }

    /// From heel to ball, metres.
    fn along(&self, turn: DQuat) -> DVec3 {
        let [heel, ball] = self.sole.stand;
        turn * (ball - heel)
    }

    /// Places of the contacts on the floor: one a stance, the ball's by its mean, the heel's behind
    /// it.
    fn anchor(&self, feet: &[Goal]) -> Vec<[Option<DVec3>; 2]> {
        let mut anchors = vec![[None; 2]; feet.len()];
        let [heel, ball] = self.sole.stand;
        let length = (ball - heel).length();
        let standing: Vec<[bool; 2]> = (0..feet.len())
            .map(|frame| self.contacts.at(frame))
            .collect();
        let mut first = 0;
        while first < feet.len() {
            if standing[first] == [false; 2] {
                first += 1;
                continue;
            }
            let stance = standing[first..].iter().take_while(|on| **on != [false; 2]);
            let frames = first..first + stance.count();
            let mean = |point: usize| {
                let on = frames.clone().filter(|&frame| standing[frame][point]);
                let all: Vec<DVec3> = on
                    .map(|frame| feet[frame].place + feet[frame].turn * self.sole.stand[point])
                    .collect();
                let middle = all.iter().sum::<DVec3>() / all.len().max(1) as f64;
                (!all.is_empty()).then_some(DVec3::new(middle.x, 0.0, middle.z))
            };
            let both = frames.clone().filter(|&frame| standing[frame] == [true; 2]);
            let behind: DVec3 = both.map(|frame| feet[frame].turn * (heel - ball)).sum();
            let behind = DVec3::new(behind.x, 0.0, behind.z).try_normalize();
            let ball_at = mean(1);
            let heel_at = match (ball_at, behind) {
                (Some(ball), Some(behind)) => Some(ball + behind * length),
                _ => mean(0),
            };
            for frame in frames.clone() {
                let on = standing[frame];
                anchors[frame] = [heel_at.filter(|_| on[0]), ball_at.filter(|_| on[1])];
            }
            first = frames.end;
        }
        anchors
    }

    /// A foot after its correction, lifted so far that heel and ball are not below the floor.
    fn above_floor(&self, foot: &Goal, by: Correction) -> Goal {
        let turn = (by.turn * foot.turn).normalize();
        let place = foot.place + by.shift;
        let lowest = self.sole.stand.map(|point| (place + turn * point).y);
        let lift = -lowest[0].min(lowest[1]).min(0.0);
        Goal {
            place: place + lift * DVec3::Y,
            turn,
        }
    }

    /// Bends the leg to its goal, and the toes so that their tip is not below the floor.
    fn bend(&self, body: &Avatar, pose: &mut [Transform], frame: usize) {
        let goal = self.goals[frame];
        let [hip, knee, ankle] = self.sole.leg;
        let joints = &body.skeleton.joints;
        let model = body.skeleton.model(pose);
        let places = self.sole.leg.map(|joint| model[joint].translation);
        if let Some([upper, lower]) = two_bone(places, goal.place, None) {
            let turned = [
                (hip, DQuat::IDENTITY, upper * rotation(&model[hip])),
                (knee, upper, lower * rotation(&model[knee])),
                (ankle, lower, goal.turn),
            ];
            for (joint, before, own) in turned {
                let parent = joints[joint].parent;
                let above = parent.map_or(DQuat::IDENTITY, |parent| rotation(&model[parent]));
                pose[joint].rotation = ((before * above).inverse() * own).normalize();
            }
        }
        let Some(toes) = self.sole.toes else { return };
        let model = body.skeleton.model(pose);
        let (at, turn) = (model[toes].translation, rotation(&model[toes]));
        let arm = model[toes].transform_point3(self.sole.tip) - at;
        let flat = DVec3::new(arm.x, 0.0, arm.z);
        if let (true, Some(ahead)) = (at.y + arm.y < 0.0, flat.try_normalize()) {
            let rise = (-at.y / arm.length()).clamp(-1.0, 1.0);
            let to = ahead * (1.0 - rise * rise).sqrt() + DVec3::Y * rise;
            let by = DQuat::from_rotation_arc(arm.normalize(), to);
            let parent = joints[toes].parent;
            let above = parent.map_or(DQuat::IDENTITY, |parent| rotation(&model[parent]));
            pose[toes].rotation = (above.inverse() * (by * turn)).normalize();
        }
    }

    fn measure(&self, model: &[DAffine3], frame: usize, report: &mut FeetReport) {
        let ankle = &model[self.sole.leg[2]];
        for (point, anchor) in self.sole.stand.iter().zip(self.anchors[frame]) {
            let at = ankle.transform_point3(*point);
            report.depth = report.depth.max(-at.y);
            if let Some(anchor) = anchor {
                let away = at - anchor;
                report.slide = report.slide.max(away.x.hypot(away.z));
                report.height = report.height.max(away.y.abs());
            }
        }
    }
}

fn rotation(matrix: &DAffine3) -> DQuat {
    crate::model::nearest_rotation(&matrix.matrix3)
}

/// What is known in some frames, carried from each to the next over all frames between; before the
/// first and after the last it stays. `otherwise` where nothing is known.
fn spread<T: Copy>(
    known: &[Option<T>],
    times: &[f64],
    otherwise: T,
    mix: impl Fn(T, T, f64) -> T,
) -> Vec<T> {
    let mut out = vec![otherwise; known.len()];
    let mut last: Option<(usize, T)> = None;
    for (frame, value) in known.iter().enumerate() {
        let Some(value) = *value else { continue };
        let from = last.map_or(0, |(at, _)| at + 1);
        for between in from..frame {
            out[between] = last.map_or(value, |(at, before)| {
                let t = (times[between] - times[at]) / (times[frame] - times[at]);
                mix(before, value, t * t * (3.0 - 2.0 * t))
            });
        }
        out[frame] = value;
        last = Some((frame, value));
    }
    if let Some((at, value)) = last {
        out[at + 1..].fill(value);
    }
    out
}

/// The clip with the tracks of hips and legs anew.
fn rewritten(
    body: &Avatar,
    human: &Humanoid,
    clip: &Clip,
    times: &[f64],
    poses: &[Vec<Transform>],
) -> Clip {
    let mut wanted = vec![(human.hips, Channel::Translation)];
    for side in SIDES {
        if let Some(sole) = Sole::new(body, human, side) {
            let joints = sole.leg.into_iter().chain(sole.toes);
            wanted.extend(joints.map(|joint| (joint, Channel::Rotation)));
        }
    }
    let mut clip = clip.clone();
    clip.tracks
        .retain(|track| !wanted.contains(&(track.joint, track.channel)));
    for (joint, channel) in wanted {
        let mut last = DQuat::IDENTITY;
        let value = |pose: &Vec<Transform>| match channel {
            Channel::Rotation => {
                let turn = pose[joint].rotation;
                last = if turn.dot(last) < 0.0 { -turn } else { turn };
                last.to_array()
            }
            _ => pose[joint].translation.extend(0.0).to_array(),
        };
        clip.tracks.push(Track {
            joint,
            channel,
            interpolation: Interpolation::Linear,
            times: times.to_vec(),
            values: poses.iter().map(value).collect(),
        });
    }
    clip.tracks
        .sort_by_key(|track| (track.joint, track.channel));
    clip
}
