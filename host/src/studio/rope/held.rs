//! A rope in the hands of a body that moves: simulated, hidden by the body, seen by its cameras.

use glam::{DAffine3, DVec3};

use super::body::Capsule;
use super::motion::Draught;
use super::skip::{PALM, scale};
use super::{Motion, RopeModel, Scene, SceneError};
use crate::fit::humanoid::{Part, Role, Side};
use crate::fit::{Humanoid, Which};
use crate::model::Avatar;
use crate::spatial::Tree;
use crate::studio::body::Body;
use crate::studio::cameras::Camera;
use crate::studio::random::Random;
use crate::studio::{Shot, Surface};

/// Which hands hold the rope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    /// The first marker in the left hand, the last in the right.
    Both,
    /// The first marker in the left hand.
    Left,
    /// The first marker in the right hand.
    Right,
}

/// A rope in every frame of a filmed body.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldRope {
    /// `[frames][markers]`, metres: the truth.
    pub markers: Vec<Vec<DVec3>>,
    /// `[frames][markers]`, metres: what the cameras measure; `None` where too few see it.
    pub seen: Vec<Vec<Option<DVec3>>>,
}

/// A joint's part of the body, for a rope to slide on.
struct Obstacle {
    joint: usize,
    /// In the joint's space.
    a: DVec3,
    b: DVec3,
    radius: f64,
}

/// Thinner parts, metres, are fingers and face, which a rope does not feel.
const THINNEST: f64 = 0.025;

/// Capsules around the joints that carry the surface. O(vertices)
fn obstacles(avatar: &Avatar, held: &[usize]) -> Vec<Obstacle> {
    let skeleton = &avatar.skeleton;
    let model = skeleton.model(&skeleton.rest());
    let mut out = Vec::new();
    for joint in 0..skeleton.joints.len() {
        let is_held = std::iter::successors(Some(joint), |&j| skeleton.joints[j].parent)
            .any(|above| held.contains(&above));
        if is_held {
            continue;
        }
        let influences = avatar.skin.influences.iter();
        let own: Vec<DVec3> = influences
            .zip(&avatar.mesh.positions)
            .filter_map(|(list, position)| {
                let bind = &avatar.skin.binds[list.first()?.0 as usize];
                (bind.joint == joint).then(|| bind.inverse_bind.transform_point3(*position))
            })
            .collect();
        if own.len() < 12 {
            continue;
        }
        // Towards the child that is farthest: hips go to the spine, not to a thigh's side.
        let children =
            (0..skeleton.joints.len()).filter(|&c| skeleton.joints[c].parent == Some(joint));
        let inverse = model[joint].inverse();
        let ends = children.map(|c| inverse.transform_point3(model[c].translation));
        let middle = own.iter().sum::<DVec3>() / own.len() as f64;
        let tip = ends.fold(middle * 1.5, |best, end| {
            if end.length_squared() > best.length_squared() {
                end
            } else {
                best
            }
        });
        let capsule = Capsule {
            a: DVec3::ZERO,
            b: tip,
            radius: 0.0,
        };
        let away = own.iter().map(|p| p.distance(capsule.nearest_on_axis(*p)));
        let mut away: Vec<f64> = away.collect();
        away.sort_unstable_by(f64::total_cmp);
        let radius = away[away.len() / 2];
        if radius > THINNEST {
            out.push(Obstacle {
                joint,
                a: DVec3::ZERO,
                b: tip,
                radius,
            });
        }
    }
    out
}

fn capsules(obstacles: &[Obstacle], pose: &[DAffine3]) -> Vec<Capsule> {
    let placed = obstacles.iter().map(|one| Capsule {
        a: pose[one.joint].transform_point3(one.a),
        b: pose[one.joint].transform_point3(one.b),
        radius: one.radius,
    });
    placed.collect()
}

/// Where the hands grip: joint of the hand, the palm in its space, joints that do not push.
struct Hands {
    palms: [Option<(usize, DVec3)>; 2],
    arms: Vec<usize>,
}

impl Hands {
    fn new(avatar: &Avatar, grip: Grip) -> Result<Self, SceneError> {
        let skeleton = &avatar.skeleton;
        let human = Humanoid::new(skeleton, Which::Target).map_err(|_| SceneError::NoHuman)?;
        let joint = |side, part| {
            let found = human.roles.get(&Role::Limb(side, part)).copied();
            found.ok_or(SceneError::NoHuman)
        };
        let sides = match grip {
            Grip::Both => [Some(Side::Left), Some(Side::Right)],
            Grip::Left => [Some(Side::Left), None],
            Grip::Right => [Some(Side::Right), None],
        };
        let model = skeleton.model(&skeleton.rest());
        let mut hands = Self {
            palms: [None; 2],
            arms: Vec::new(),
        };
        for (palm, side) in hands.palms.iter_mut().zip(sides) {
            let Some(side) = side else {
                continue;
            };
            let (hand, fore) = (joint(side, Part::Hand)?, joint(side, Part::LowerArm)?);
            // The palm goes on where the forearm points.
            let along = model[hand].translation - model[fore].translation;
            let place = model[hand].translation + along.normalize_or(DVec3::NEG_Y) * PALM;
            *palm = Some((hand, model[hand].inverse().transform_point3(place)));
            hands.arms.push(fore);
        }
        Ok(hands)
    }

    fn at(&self, pose: &[DAffine3]) -> [Option<DVec3>; 2] {
        self.palms
            .map(|palm| palm.map(|(joint, place)| pose[joint].transform_point3(place)))
    }
}

impl Scene {
    /// A rope of the usual make in the hands of a body.
    #[must_use]
    pub fn held(model: RopeModel, seed: u64) -> Self {
        Self {
            model,
            people: true,
            ..Self::new(Motion::Ribbon, seed)
        }
    }
}

/// Simulates a rope in the hands of `body` and films it with the cameras of `shot`, frame by frame
/// of the body. O(frames x (vertices + markers x cameras x log triangles))
///
/// A skipping scene's rope is set in motion as its driver does; any other hangs until the body
/// moves it.
///
/// # Errors
/// A body without hands, a setting out of its range, a rope that flies apart.
pub fn hold(
    body: &Body<'_>,
    scene: &Scene,
    grip: Grip,
    shot: &Shot,
    progress: &dyn Fn(usize),
) -> Result<HeldRope, SceneError> {
    scene.check()?;
    let hands = Hands::new(body.avatar(), grip)?;
    let obstacles = obstacles(body.avatar(), &hands.arms);
    let start = body.performance().pose(0.0);
    let mut rope = scene.settled(hands.at(&start));
    let scale = scale(body.avatar());
    let driver = (scene.motion == Motion::Skipping).then(|| scene.driver());
    let rate = body.scene().rate;
    let steps = (scene.model.steps_per_second() / rate).ceil() as usize;
    let dt = 1.0 / (rate * steps as f64);
    let cameras = shot.ring.cameras().map_err(|_| SceneError::OutOfRange {
        name: "cameras",
        value: shot.ring.camera_count as f64,
        range: "a ring that can be built",
    })?;
    let mut surface = Surface::default();
    let mut tree: Option<Tree> = None;
    let mut random = Random::new(shot.seed ^ scene.seed.rotate_left(17) ^ 0x0520_9E0F);
    let mut held = HeldRope {
        markers: Vec::new(),
        seen: Vec::new(),
    };
    for frame in 0..body.frame_count() {
        let now = body.seconds(frame);
        let nodes = (0..scene.model.markers).map(|m| rope.positions[scene.model.marker_node(m)]);
        let markers: Vec<DVec3> = nodes.collect();
        body.surface_into(frame, &mut surface);
        let tree = match &mut tree {
            Some(tree) => {
                tree.refit(&surface.positions);
                tree
            }
            slot => slot.insert(Tree::new(&body.avatar().mesh.triangles, &surface.positions)),
        };
        let seen = markers.iter().map(|&marker| {
            let count = cameras.iter().filter(|c| sees(c, tree, marker)).count();
            let noise = random.normal3() * shot.noise;
            let missed = random.unit() < MISS;
            (count >= shot.keep_cameras && !missed).then_some(marker + noise)
        });
        held.seen.push(seen.collect());
        held.markers.push(markers);
        for step in 1..=steps {
            let t = now + step as f64 * dt;
            let pose = body.performance().pose(t);
            let draught = driver.as_ref().map_or(Draught::still(0.0), |driver| {
                driver.draught(t).scaled(scale)
            });
            rope.step(dt, hands.at(&pose), &capsules(&obstacles, &pose), &draught);
        }
        if rope
            .velocities
            .iter()
            .any(|v| !v.is_finite() || v.length() > 300.0)
        {
            return Err(SceneError::Unstable { seconds: now });
        }
        progress(frame + 1);
    }
    Ok(held)
}

/// Chance that a marker in sight is missed in a frame.
const MISS: f64 = 0.005;

/// Whether a camera has the marker in its picture and nothing in between.
fn sees(camera: &Camera, tree: &Tree, marker: DVec3) -> bool {
    let toward = (camera.position - marker).normalize_or_zero();
    camera.project(marker).is_some() && !tree.blocks(marker + toward * 0.01, camera.position)
}
