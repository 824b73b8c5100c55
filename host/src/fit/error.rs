//! Why a motion cannot be fitted to a body.

use std::fmt;

/// One of the two skeletons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// Of the motion.
    Source,
    /// Of the body.
    Target,
}

impl fmt::Display for Which {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Source => "the motion's skeleton",
            Self::Target => "the body's skeleton",
        })
    }
}

/// Why a motion cannot be fitted to a body. Each carries the facts and ends with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A name in a map pair that is neither a joint nor a role.
    #[error(
        "{which} has no joint {name:?}{}; name a joint of it, or a role such as leftUpperLeg",
        near(.similar)
    )]
    UnknownJoint {
        /// Where it was looked for.
        which: Which,
        /// The name given.
        name: String,
        /// Names that resemble it.
        similar: Vec<String>,
    },
    /// Two map pairs that want the same thing.
    #[error("the map names {name:?} more than once; keep one of the pairs")]
    MappedTwice {
        /// Joint or role.
        name: String,
    },
    /// A map pair of two roles.
    #[error(
        "the map pair {source_name}={target_name} names no joint; name one on at least one side"
    )]
    NoJoint {
        /// Left of the sign.
        source_name: String,
        /// Right of it.
        target_name: String,
    },
    /// Several joints could play one role.
    #[error(
        "{which}: {:?} could each be {role}; choose one with --map {}",
        .candidates,
        example(*.which, .role, .candidates.first().map_or("JOINT", String::as_str))
    )]
    Ambiguous {
        /// Which skeleton.
        which: Which,
        /// Role by its VRM name.
        role: String,
        /// The joints, the first four.
        candidates: Vec<String>,
    },
    /// No joint plays a role without which nothing can be fitted.
    #[error(
        "{which}: no joint found for {}; name it with --map {}",
        .roles.join(", "),
        example(*.which, .roles.first().map_or("ROLE", String::as_str), "JOINT")
    )]
    MissingRole {
        /// Which skeleton.
        which: Which,
        /// Roles by their VRM names.
        roles: Vec<String>,
    },
    /// Legs and head that hang on different roots, or not on the joint named as hips.
    #[error(
        "{which}: its legs, arms and head do not all hang on one joint; give it one root, or name other hips"
    )]
    Apart {
        /// Which skeleton.
        which: Which,
    },
    /// The reference pose does not stand.
    #[error(
        "{which} does not stand upright in its reference pose (its spine leans {degrees:.0} degrees); {}",
        upright_remedy(*.which)
    )]
    NotUpright {
        /// Which skeleton.
        which: Which,
        /// From the vertical.
        degrees: f64,
    },
    /// Left and right hips coincide, or stand above each other.
    #[error(
        "{which}: its left and right hips do not show where it faces; check the joints that play leftUpperLeg and rightUpperLeg"
    )]
    NoFacing {
        /// Which skeleton.
        which: Which,
    },
    /// Legs without length.
    #[error(
        "{which}: its legs have no length; check the joints that play the upper leg, lower leg and foot"
    )]
    NoLegs {
        /// Which skeleton.
        which: Which,
    },
    /// A reference frame beyond the end of the clip.
    #[error("reference frame {frame} does not exist: the clip has {count}; choose a lower number")]
    NoSuchFrame {
        /// As asked for.
        frame: usize,
        /// Frames in the clip.
        count: usize,
    },
    /// Key times that would need more frames than a clip may have.
    #[error(
        "the clip lasts {seconds} s, at {period} s a frame more than {limit} frames; cut it, or correct its key times"
    )]
    TooLong {
        /// Time of its last key.
        seconds: f64,
        /// Seconds a frame.
        period: f64,
        /// Most frames accepted.
        limit: usize,
    },
    /// A correspondence that was made for two other skeletons.
    #[error("the correspondence is of other skeletons; make it from these two")]
    OtherSkeletons,
    /// NaN or infinity among the options.
    #[error("{what} is not finite; give a number")]
    NotFinite {
        /// Which option.
        what: String,
    },
}

fn near(similar: &[String]) -> String {
    if similar.is_empty() {
        return String::new();
    }
    format!(" (there is {})", similar.join(", "))
}

fn example(which: Which, role: &str, joint: &str) -> String {
    match which {
        Which::Source => format!("\"{joint}={role}\""),
        Which::Target => format!("\"{role}={joint}\""),
    }
}

fn upright_remedy(which: Which) -> &'static str {
    match which {
        Which::Source => {
            "if Z is up in its file, say so; else name a frame in which the actor stands as the reference"
        }
        Which::Target => "export the body standing, with Y up",
    }
}
