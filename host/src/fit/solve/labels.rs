//! What a marker's label says: the tables of the standard sets.
//!
//! Plug-in Gait and its relatives (Vicon), CMU's 41, OptiTrack's Baseline 37 and 41 and its
//! forerunners, Helen Hayes and Cleveland Clinic names (Motion Analysis, OpenSim), IOR. A subject's
//! prefix ("Takeo:"), separators, case and the place of the side's letter do not matter.

use super::template::Bone;
use crate::fit::Side;
use crate::fit::names::split;

/// A place on the template.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// What carries it.
    pub bone: Bone,
    /// On the skin of the template's left side, metres.
    pub at: [f64; 3],
    /// Standard deviation, metres.
    pub spread: f64,
}

/// A named place of a standard marker set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    /// Name without side, as Plug-in Gait spells it where it can.
    pub name: &'static str,
    /// Half of the body; `None` on the middle line.
    pub side: Option<Side>,
    /// Where it is expected.
    pub place: Place,
}

struct Entry {
    /// All spellings, lower case, without separators and side; the first names it.
    names: &'static [&'static str],
    /// Whether there is one on each side.
    paired: bool,
    place: Place,
}

const fn mid(names: &'static [&'static str], bone: Bone, at: [f64; 3], spread: f64) -> Entry {
    let place = Place { bone, at, spread };
    Entry {
        names,
        paired: false,
        place,
    }
}

const fn pair(names: &'static [&'static str], bone: Bone, at: [f64; 3], spread: f64) -> Entry {
    let place = Place { bone, at, spread };
    Entry {
        names,
        paired: true,
        place,
    }
}

/// Bony landmarks, markers that are placed by eye, and such whose place is open.
const BONY: f64 = 0.012;
const NEAR: f64 = 0.03;
const LOOSE: f64 = 0.08;

#[rustfmt::skip]
const TABLE: &[Entry] = &[
    // Pelvis.
    pair(&["ASI", "asis", "fwt", "waistfront", "iasis"], Bone::Hips, [0.122, 1.00, 0.088], 0.025),
    pair(&["PSI", "psis", "bwt", "waistback", "ipsis"], Bone::Hips, [0.05, 1.02, -0.098], 0.025),
    mid(&["SACR", "sacrum", "vsac", "vsacral", "sacral", "sac"], Bone::Hips, [0.0, 1.01, -0.108], 0.025),
    pair(&["MWT", "iliaccrest", "icrest", "ilcrest"], Bone::Hips, [0.155, 1.03, -0.01], NEAR),
    pair(&["HJC", "hjcreg", "hipcenter", "hipcentre", "hipjc"], Bone::Hips, [0.088, 0.915, 0.005], 0.01),
    // Legs.
    pair(&["GTR", "hip", "trochanter", "grtroc", "gt"], Bone::UpLeg, [0.165, 0.92, -0.01], 0.05),
    pair(&["THI", "thigh", "th1", "th2", "th3", "th4", "th5", "thigh1", "thigh2", "thigh3", "thigh4", "thigh5",
        "thighupper", "thighfront", "thighrear", "qua"], Bone::UpLeg, [0.14, 0.70, 0.02], LOOSE),
    pair(&["KNE", "knee", "kneeout", "lfc", "latknee", "kneelat", "kneelateral", "lek", "lknelateral"],
        Bone::UpLeg, [0.135, 0.49, 0.0], BONY),
    pair(&["KNM", "kni", "kneein", "mfc", "medknee", "kneemed", "kneemedial", "mkn", "mek", "kneei"],
        Bone::UpLeg, [0.041, 0.49, 0.0], BONY),
    pair(&["KJC", "kneejc"], Bone::UpLeg, [0.088, 0.49, 0.005], 0.01),
    pair(&["TIB", "tibia", "shn", "shin", "shank", "sha", "tb1", "tb2", "tb3", "shankupper", "shankfront",
        "shankrear", "sh1", "sh2", "sh3", "sh4", "shankantsup"], Bone::Leg, [0.13, 0.31, 0.02], LOOSE),
    pair(&["TT", "tibialtub", "tibtub"], Bone::Leg, [0.088, 0.44, 0.05], NEAR),
    pair(&["ANK", "ankle", "ankleout", "lmal", "latankle", "anklelat", "anklelateral", "lm"],
        Bone::Leg, [0.123, 0.08, 0.0], BONY),
    pair(&["MMA", "mmal", "anklein", "medankle", "anklemed", "anklemedial", "man", "med", "mal"],
        Bone::Leg, [0.053, 0.085, 0.005], BONY),
    pair(&["AJC", "anklejc"], Bone::Leg, [0.088, 0.08, 0.005], 0.01),
    pair(&["HEE", "heel", "hel", "cal", "calc", "calcaneus"], Bone::Foot, [0.09, 0.04, -0.055], 0.02),
    pair(&["TOE", "mt2", "toe2", "midfoot", "dmt2"], Bone::Foot, [0.105, 0.04, 0.135], NEAR),
    pair(&["MT5", "5meta", "toeout", "mth5", "toelat", "vmh", "dmt5"], Bone::Foot, [0.140, 0.03, 0.095], 0.02),
    pair(&["MT1", "1meta", "toein", "mth1", "toemed", "fmh", "dmt1"], Bone::Foot, [0.065, 0.035, 0.135], 0.02),
    pair(&["MFS", "midfootsup"], Bone::Foot, [0.09, 0.07, 0.06], NEAR),
    pair(&["MFL", "midfootlat"], Bone::Foot, [0.13, 0.03, 0.04], NEAR),
    pair(&["TIP", "toetip", "bigtoe", "hallux"], Bone::Toes, [0.095, 0.03, 0.19], NEAR),
    // Trunk.
    mid(&["C7", "backtop", "spinec7"], Bone::Chest, [0.0, 1.485, -0.075], 0.02),
    mid(&["T10", "backmid", "t8"], Bone::Chest, [0.0, 1.25, -0.12], 0.04),
    mid(&["CLAV", "cla", "ij", "jugularnotch", "cv7"], Bone::Chest, [0.0, 1.42, 0.045], 0.02),
    mid(&["STRN", "strn", "sternum", "px", "xiphoid", "chest", "chestlow"], Bone::Chest, [0.0, 1.27, 0.09], 0.04),
    pair(&["BAC", "bak", "back", "off", "scap", "scapula"], Bone::Chest, [0.09, 1.36, -0.12], LOOSE),
    pair(&["STE", "sternum"], Bone::Chest, [0.04, 1.40, 0.05], NEAR),
    mid(&["LUM", "l5", "l4", "l1", "lumbar"], Bone::Hips, [0.0, 1.08, -0.11], LOOSE),
    // Head.
    pair(&["FHD", "headfront", "hdf"], Bone::Head, [0.065, 1.68, 0.095], NEAR),
    pair(&["BHD", "headback", "hdb"], Bone::Head, [0.065, 1.67, -0.08], NEAR),
    pair(&["TEMP", "temple", "ear", "hed", "headside"], Bone::Head, [0.075, 1.65, 0.02], NEAR),
    mid(&["ARIEL", "tophead", "headtop", "htop", "vertex", "head", "thead"], Bone::Head, [0.0, 1.77, 0.01], NEAR),
    mid(&["FORE", "forehead", "headfront", "fronthead"], Bone::Head, [0.0, 1.69, 0.11], NEAR),
    mid(&["REAR", "rearhead", "backhead", "headback"], Bone::Head, [0.0, 1.68, -0.095], NEAR),
    mid(&["HSD", "headside"], Bone::Head, [0.07, 1.66, 0.0], LOOSE),
    // Arms.
    pair(&["SHO", "shoulder", "acr", "acromion", "acromium", "shouldertop", "shouldr", "sh"],
        Bone::Shoulder, [0.183, 1.458, -0.01], 0.02),
    pair(&["FSH", "shoulderfront"], Bone::Shoulder, [0.165, 1.43, 0.055], 0.04),
    pair(&["BSH", "shoulderback"], Bone::Shoulder, [0.16, 1.44, -0.075], 0.04),
    pair(&["UPA", "uarmhigh", "uarm", "upperarm", "bicep", "biceps", "humerus", "ua1", "ua2", "ua3", "arm"],
        Bone::Arm, [0.32, 1.45, -0.015], LOOSE),
    pair(&["ELB", "elbow", "elbowout", "lel", "elbowlat", "latelbow", "elblat"], Bone::Arm, [0.46, 1.443, -0.015], 0.02),
    pair(&["ELM", "iel", "elbowin", "mel", "elbowmed", "medelbow", "elbmed"], Bone::Arm, [0.46, 1.377, -0.015], 0.02),
    pair(&["FRM", "fra", "farm", "forearm", "lowerarm", "larm"], Bone::ForeArm, [0.60, 1.44, -0.015], LOOSE),
    pair(&["WRA", "iwr", "wristin", "wrir", "wristradius", "faradius", "wristmed", "rad", "wristthumb"],
        Bone::ForeArm, [0.705, 1.41, 0.013], 0.02),
    pair(&["WRB", "owr", "wristout", "wriu", "wristulna", "faulna", "wristlat", "uln", "wristpinky"],
        Bone::ForeArm, [0.705, 1.41, -0.043], 0.02),
    pair(&["WRI", "wrist", "wr"], Bone::ForeArm, [0.705, 1.433, -0.015], NEAR),
    pair(&["FIN", "handout", "hand", "hnd", "mcp3", "finger"], Bone::Hand, [0.79, 1.428, -0.015], NEAR),
    pair(&["IHAND", "handin", "mcp1"], Bone::Hand, [0.79, 1.425, 0.02], NEAR),
    pair(&["OHAND", "mcp5", "pinky"], Bone::Hand, [0.78, 1.425, -0.05], NEAR),
    pair(&["THM", "thumb", "thmb"], Bone::Hand, [0.76, 1.40, 0.05], 0.04),
];

/// The landmark that a label names. O(letters x table)
#[must_use]
pub fn landmark(label: &str) -> Option<Landmark> {
    let plain = label.rsplit(':').next().unwrap_or(label);
    let words = split(plain, false);
    let whole: String = words.concat();
    if let Some(found) = find(&whole, None) {
        return Some(found);
    }
    // A side as a word of its own, wherever it stands: "R.Knee", "WaistLFront", "Left_Heel".
    for (at, word) in words.iter().enumerate() {
        let side = match word.as_str() {
            "l" | "left" => Side::Left,
            "r" | "right" => Side::Right,
            _ => continue,
        };
        let rest: String = [&words[..at], &words[at + 1..]].concat().concat();
        if let Some(found) = find(&rest, Some(side)) {
            return Some(found);
        }
    }
    // Or as the first or last letters: "LASI", "leftknee", "ankle_l".
    let sides = [
        ("left", Side::Left),
        ("right", Side::Right),
        ("l", Side::Left),
        ("r", Side::Right),
    ];
    sides.into_iter().find_map(|(mark, side)| {
        let rest = whole.strip_prefix(mark).or(whole.strip_suffix(mark))?;
        find(rest, Some(side))
    })
}

fn find(name: &str, side: Option<Side>) -> Option<Landmark> {
    let entry = TABLE.iter().find(|entry| {
        let mut names = entry.names.iter();
        entry.paired == side.is_some() && names.any(|known| known.eq_ignore_ascii_case(name))
    })?;
    Some(Landmark {
        name: entry.names[0],
        side,
        place: entry.place,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_of_many_sets_are_known() {
        let (left, right) = (Some(Side::Left), Some(Side::Right));
        for (label, name, side) in [
            ("TakeoMonday:RBWT", "PSI", right),
            ("LASI", "ASI", left),
            ("R.ASIS", "ASI", right),
            ("V.Sacral", "SACR", None),
            ("Skeleton 001:WaistLFront", "ASI", left),
            ("LKneeOut", "KNE", left),
            ("RUArmHigh", "UPA", right),
            ("HeadTop", "ARIEL", None),
            ("BackRight", "BAC", right),
            ("LShoulderTop", "SHO", left),
            ("R_elbow_med", "ELM", right),
            ("r_5meta", "MT5", right),
            ("L.Wrist.Lat", "WRB", left),
            ("Top.Head", "ARIEL", None),
            ("RLFC", "KNE", right),
            ("LLMAL", "ANK", left),
            ("RRAD", "WRA", right),
            ("STRN", "STRN", None),
            ("R_Sternum", "STE", right),
            ("C7", "C7", None),
            ("T10", "T10", None),
            ("LHEE", "HEE", left),
            ("ankle_l", "ANK", left),
            ("RTH3", "THI", right),
        ] {
            let found = landmark(label).unwrap_or_else(|| panic!("{label}"));
            assert_eq!((found.name, found.side), (name, side), "{label}");
        }
        for label in ["*12", "Foot_Marker1", "", "Sync", "Unlabeled:3", "RKNE#2"] {
            assert_eq!(landmark(label), None, "{label}");
        }
    }

    #[test]
    fn no_spelling_is_listed_twice() {
        for (at, entry) in TABLE.iter().enumerate() {
            for name in entry.names {
                let others = TABLE.iter().enumerate().filter(|(other, row)| {
                    *other != at
                        && row.paired == entry.paired
                        && row.names.iter().any(|n| n.eq_ignore_ascii_case(name))
                });
                assert_eq!(others.count(), 0, "{name}");
            }
        }
    }
}
