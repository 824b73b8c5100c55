//! Two damped springs in each part that its acceleration shakes.
//!
//! Integrated by the trapezoidal rule, which is stable for any frequency and frame rate and adds no
//! damping of its own.

pub(super) const SPRINGS: usize = 2;
/// Numbers remembered of a part: place and velocity of its pivot and of each spring.
pub(super) const PART_STATE: usize = 6 + 6 * SPRINGS;

/// Steps of a spring in a frame.
const STEPS: usize = 2;
/// Accelerations beyond this are jumps, metres a second squared.
const LARGEST_ACCELERATION: f32 = 80.0;
/// What moves faster was put elsewhere, metres a second.
const FASTEST: f32 = 25.0;
/// A velocity that only the next frame will tell.
const UNKNOWN: f32 = 1e9;
/// Springs do not stretch further, metres.
const LONGEST_SPRING: f32 = 0.1;
const GRAVITY: f32 = 9.81;

/// Moves the springs of a part, which live in its rest space, and returns how they are stretched.
///
/// `springs`: angular frequency and damping ratio; `turn`: a direction of the room in rest space;
/// `now`: where the part's pivot is; seconds since the frame before, and whether this is the first.
#[inline]
pub(super) fn shake(
    springs: &[[f32; 2]; SPRINGS],
    turn: impl Fn([f32; 3]) -> [f32; 3],
    now: [f32; 3],
    (seconds, starts): (f32, bool),
    kept: &mut [f32; PART_STATE],
) -> [[f32; 3]; SPRINGS] {
    let [
        px,
        py,
        pz,
        vx,
        vy,
        vz,
        ax,
        ay,
        az,
        au,
        av,
        aw,
        cx,
        cy,
        cz,
        cu,
        cv,
        cw,
    ] = kept;
    let places = [(px, vx), (py, vy), (pz, vz)];
    let first = [(ax, au), (ay, av), (az, aw)];
    let second = [(cx, cu), (cy, cv), (cz, cw)];
    let acceleration = accelerate(places, now, (seconds, starts));
    // In the part, flesh feels the opposite of what the bone does, and its weight. What the weight
    // does at rest is in the rest shape already.
    let [x, y, z] = acceleration;
    let [x, y, z] = turn([-x, -y - GRAVITY, -z]);
    let pull = [x, y + GRAVITY, z];
    let step = seconds * (1.0 / STEPS as f32);
    let mut out = [[0.0; 3]; SPRINGS];
    for ((spring, &[frequency, damping]), out) in
        [first, second].into_iter().zip(springs).zip(&mut out)
    {
        let stiffness = frequency * frequency;
        let friction = damping * frequency * step + 0.25 * stiffness * step * step;
        let share = 1.0 / (1.0 + friction);
        for (((place, speed), pull), out) in spring.into_iter().zip(pull).zip(out) {
            if starts {
                (*place, *speed) = (pull * (1.0 / stiffness), 0.0);
            } else {
                for _ in 0..STEPS {
                    let before = *speed;
                    *speed =
                        (before * (1.0 - friction) + step * (pull - stiffness * *place)) * share;
                    *place += 0.5 * step * (before + *speed);
                }
            }
            let reached = place.clamp(-LONGEST_SPRING, LONGEST_SPRING);
            if reached != *place {
                (*place, *speed) = (reached, 0.0);
            }
            *out = *place;
        }
    }
    out
}

/// Acceleration of a place whose last place and velocity are kept, and updated.
#[inline]
fn accelerate(
    kept: [(&mut f32, &mut f32); 3],
    now: [f32; 3],
    (seconds, starts): (f32, bool),
) -> [f32; 3] {
    let mut out = [0.0; 3];
    if !starts && seconds <= 0.0 {
        return out;
    }
    let inverse = 1.0 / seconds;
    for (((place, velocity), now), out) in kept.into_iter().zip(now).zip(&mut out) {
        let reached = (now - *place) * inverse;
        *place = now;
        if starts {
            *velocity = UNKNOWN;
        } else if (-FASTEST..=FASTEST).contains(&reached) {
            if *velocity < UNKNOWN {
                let change = (reached - *velocity) * inverse;
                *out = change.clamp(-LARGEST_ACCELERATION, LARGEST_ACCELERATION);
            }
            *velocity = reached;
        }
    }
    out
}
