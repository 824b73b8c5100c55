//! What a joint's name says: the table of the common rigs, and the general forms around it.

use super::humanoid::{Finger, Side};

/// What a name says about its joint. Weak meanings depend on what else the skeleton holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Meaning {
    Head,
    Neck,
    Clavicle,
    UpperArm,
    LowerArm,
    Hand,
    UpperLeg,
    LowerLeg,
    Foot,
    Toes,
    /// The upper leg, unless something else is (CMU and Mixamo: the lower leg).
    WeakLeg,
    /// The upper leg, unless something else is (a pelvis stub).
    WeakHip,
    /// The upper arm, unless something else is.
    WeakArm,
    /// The upper arm (mocapbank), unless something else is (CMU, Mixamo: the clavicle).
    WeakShoulder,
    Finger(Finger),
}

/// Names without side, separators, numbers and case, as the rigs spell them: CMU and its BVH
/// conversions, Acclaim, mocapbank, Mixamo, MakeHuman, VRM, Unreal, Biped, Rigify, DAZ, SMPL, Xsens.
const TABLE: &[(&str, Meaning)] = &[
    ("head", Meaning::Head),
    ("skull", Meaning::Head),
    ("neck", Meaning::Neck),
    ("upperneck", Meaning::Neck),
    ("lowerneck", Meaning::Neck),
    ("clavicle", Meaning::Clavicle),
    ("collar", Meaning::Clavicle),
    ("collarbone", Meaning::Clavicle),
    ("upperarm", Meaning::UpperArm),
    ("uparm", Meaning::UpperArm),
    ("armupper", Meaning::UpperArm),
    ("humerus", Meaning::UpperArm),
    ("bicep", Meaning::UpperArm),
    ("arm", Meaning::WeakArm),
    ("shoulder", Meaning::WeakShoulder),
    ("shldr", Meaning::WeakShoulder),
    ("forearm", Meaning::LowerArm),
    ("lowerarm", Meaning::LowerArm),
    ("lowarm", Meaning::LowerArm),
    ("armlower", Meaning::LowerArm),
    ("elbow", Meaning::LowerArm),
    ("radius", Meaning::LowerArm),
    ("hand", Meaning::Hand),
    ("wrist", Meaning::Hand),
    ("upperleg", Meaning::UpperLeg),
    ("upleg", Meaning::UpperLeg),
    ("legupper", Meaning::UpperLeg),
    ("thigh", Meaning::UpperLeg),
    ("femur", Meaning::UpperLeg),
    ("leg", Meaning::WeakLeg),
    ("hip", Meaning::WeakHip),
    ("lowerleg", Meaning::LowerLeg),
    ("lowleg", Meaning::LowerLeg),
    ("leglower", Meaning::LowerLeg),
    ("shin", Meaning::LowerLeg),
    ("calf", Meaning::LowerLeg),
    ("knee", Meaning::LowerLeg),
    ("tibia", Meaning::LowerLeg),
    ("foot", Meaning::Foot),
    ("ankle", Meaning::Foot),
    ("toebase", Meaning::Toes),
    ("toes", Meaning::Toes),
    ("toe", Meaning::Toes),
    ("ball", Meaning::Toes),
    ("thumb", Meaning::Finger(Finger::Thumb)),
    ("index", Meaning::Finger(Finger::Index)),
    ("middle", Meaning::Finger(Finger::Middle)),
    ("mid", Meaning::Finger(Finger::Middle)),
    ("ring", Meaning::Finger(Finger::Ring)),
    ("little", Meaning::Finger(Finger::Little)),
    ("pinky", Meaning::Finger(Finger::Little)),
    ("fingers", Meaning::Finger(Finger::All)),
];

/// Words that mark a joint as a helper beside the one that its other words name.
const HELPERS: &[&str] = &[
    "end",
    "nub",
    "site",
    "tip",
    "effector",
    "ik",
    "pole",
    "target",
    "twist",
    "roll",
    "helper",
    "socket",
    "goal",
    "ctrl",
    "metacarpal",
];

/// Words that some rigs put before every name.
const PREFIXES: &[&str] = &[
    "mixamorig",
    "bip",
    "biped",
    "valve",
    "j",
    "c",
    "cc",
    "base",
    "def",
    "org",
    "character",
    "b",
];

/// A name in parts.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Name {
    pub side: Option<Side>,
    /// Its words in lower case, without side, numbers and what all names share.
    pub words: Vec<String>,
    pub numbers: Vec<u32>,
}

/// The names of a skeleton in parts. O(letters)
pub(super) fn parse<'a>(names: impl Iterator<Item = &'a str>) -> Vec<Name> {
    let mut all: Vec<Vec<String>> = names.map(words).collect();
    drop_shared(&mut all);
    all.into_iter().map(name).collect()
}

/// Splits at separators, at changes between letters and digits, and before capitals.
fn words(name: &str) -> Vec<String> {
    // What stands before a colon or bar is a namespace ("mixamorig:Hips", "Armature|Hips").
    let name = name.rsplit([':', '|']).next().unwrap_or_default();
    split(name, true)
}

/// Lower-case words: split at separators, before a capital that ends or begins a small word, and if
/// `at_digits` between letters and digits.
pub(super) fn split(name: &str, at_digits: bool) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut words: Vec<String> = Vec::new();
    let mut open = false;
    for (at, &letter) in letters.iter().enumerate() {
        if !letter.is_alphanumeric() {
            open = false;
            continue;
        }
        if let Some(&before) = at.checked_sub(1).and_then(|before| letters.get(before)) {
            let next_small = letters.get(at + 1).is_some_and(|next| next.is_lowercase());
            let capital = letter.is_uppercase() && (before.is_lowercase() || next_small);
            if capital || at_digits && letter.is_numeric() != before.is_numeric() {
                open = false;
            }
        }
        if !open {
            words.push(String::new());
            open = true;
        }
        if let Some(word) = words.last_mut() {
            word.extend(letter.to_lowercase());
        }
    }
    words
}

/// Most shared words to remove from either end.
const MOST_SHARED: usize = 4;

/// Removes first and last words that nearly every name has, such as "bip 01" or "jnt".
fn drop_shared(all: &mut [Vec<String>]) {
    let many = (all.len() * 9).div_ceil(10).max(3);
    for last in [false, true] {
        for _ in 0..MOST_SHARED {
            let edge = |words: &Vec<String>| {
                let word = if last { words.last() } else { words.first() };
                word.filter(|word| words.len() > 1 && side(word).is_none())
                    .cloned()
            };
            let Some(shared) = all.get(all.len() / 2).and_then(edge) else {
                break;
            };
            if all
                .iter()
                .filter(|words| edge(words).as_ref() == Some(&shared))
                .count()
                < many
            {
                break;
            }
            for words in all
                .iter_mut()
                .filter(|words| edge(words).as_ref() == Some(&shared))
            {
                words.remove(if last { words.len() - 1 } else { 0 });
            }
        }
    }
}

fn name(mut words: Vec<String>) -> Name {
    while words.len() > 1 && PREFIXES.contains(&words[0].as_str()) {
        words.remove(0);
        if words.len() > 1 && words[0].parse::<u32>().is_ok() {
            words.remove(0);
        }
    }
    let mut parts = Name::default();
    for word in words {
        if let Ok(number) = word.parse() {
            parts.numbers.push(number);
            continue;
        }
        if let Some((side, rest)) = side(&word).filter(|_| parts.side.is_none()) {
            parts.side = Some(side);
            if !rest.is_empty() {
                parts.words.push(rest.to_owned());
            }
            continue;
        }
        parts.words.push(word);
    }
    parts
}

/// "l", "left" or "leftfoot": the side and what follows.
fn side(word: &str) -> Option<(Side, &str)> {
    match word {
        "l" => return Some((Side::Left, "")),
        "r" => return Some((Side::Right, "")),
        _ => {}
    }
    let left = word.strip_prefix("left").map(|rest| (Side::Left, rest));
    let right = || word.strip_prefix("right").map(|rest| (Side::Right, rest));
    left.or_else(right)
}

impl Name {
    /// The side and meaning, where the name has one.
    pub fn meaning(&self) -> Option<(Option<Side>, Meaning)> {
        if self
            .words
            .iter()
            .any(|word| HELPERS.contains(&word.as_str()))
        {
            // The thumb's first joint is its metacarpal; that of other fingers lies in the palm.
            if !(self.has("metacarpal") && self.has("thumb")) {
                return None;
            }
        }
        if let Some(finger) = self.finger() {
            return Some((self.side, Meaning::Finger(finger)));
        }
        // DAZ splits its limbs into a bending and a twisting part.
        let key: String = self
            .words
            .iter()
            .filter(|word| *word != "bend")
            .map(String::as_str)
            .collect();
        if let Some(meaning) = look_up(&key) {
            // MakeHuman's "toe3-1": one of five.
            let one_of_five = meaning == Meaning::Toes && self.numbers.len() > 1;
            return (!one_of_five).then_some((self.side, meaning));
        }
        // Acclaim writes the side as one small letter: "lfemur".
        if self.side.is_none() {
            let side = match key.chars().next()? {
                'l' => Side::Left,
                'r' => Side::Right,
                _ => return None,
            };
            return look_up(&key[1..]).map(|meaning| (Some(side), meaning));
        }
        None
    }

    fn has(&self, word: &str) -> bool {
        self.words.iter().any(|own| own == word)
    }

    fn finger(&self) -> Option<Finger> {
        const FIVE: [Finger; 5] = [
            Finger::Thumb,
            Finger::Index,
            Finger::Middle,
            Finger::Ring,
            Finger::Little,
        ];
        if self.has("finger") && !self.has("base") {
            match self.numbers[..] {
                // MakeHuman's "finger2-1": the first joint of the second finger.
                [finger, _] => return FIVE.get((finger as usize).checked_sub(1)?).copied(),
                // "LeftHandFinger1": all fingers but the thumb.
                [_] if self.words.len() <= 2 => return Some(Finger::All),
                _ => {}
            }
        }
        self.words.iter().find_map(|word| match look_up(word) {
            Some(Meaning::Finger(finger)) => Some(finger),
            _ => None,
        })
    }
}

fn look_up(key: &str) -> Option<Meaning> {
    TABLE
        .iter()
        .find(|(name, _)| *name == key)
        .map(|&(_, meaning)| meaning)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Meaning::*;

    fn meaning(name: &str) -> Option<(Option<Side>, Meaning)> {
        parse([name].into_iter())[0].meaning()
    }

    #[test]
    fn usual_spellings_of_one_joint() {
        for name in [
            "LeftForeArm",
            "leftLowerArm",
            "left_elbow",
            "lForeArm",
            "lowerarm_l",
            "forearm.L",
            "mixamorig:LeftForeArm",
            "Bip01 L Forearm",
            "lradius",
            "J_Bip_L_LowerArm",
            "leftforearm",
            "L_Elbow",
            "lowerarm01.L",
            "DEF-forearm.L",
            "lForearmBend",
            "ValveBiped.Bip01_L_Forearm",
            "Armature|Left Fore-Arm",
        ] {
            assert_eq!(meaning(name), Some((Some(Side::Left), LowerArm)), "{name}");
        }
    }

    #[test]
    fn usual_spellings_of_others() {
        let right = Some(Side::Right);
        for (name, expected) in [
            ("RightUpLeg", UpperLeg),
            ("thigh_r", UpperLeg),
            ("rfemur", UpperLeg),
            ("RightLeg", WeakLeg),
            ("RightHip", WeakHip),
            ("RightToeBase", Toes),
            ("rtoes", Toes),
            ("right_shoulder", WeakShoulder),
            ("RThumb", Finger(super::Finger::Thumb)),
            ("RightHandIndex1", Finger(super::Finger::Index)),
            ("f_pinky.01.R", Finger(super::Finger::Little)),
            ("finger3-2.R", Finger(super::Finger::Middle)),
            ("rightThumbMetacarpal", Finger(super::Finger::Thumb)),
            ("RFingers", Finger(super::Finger::All)),
            ("RightHandFinger1", Finger(super::Finger::All)),
        ] {
            assert_eq!(meaning(name), Some((right, expected)), "{name}");
        }
        assert_eq!(meaning("Head"), Some((None, Head)));
    }

    #[test]
    fn helpers_and_the_unknown_mean_nothing() {
        for name in [
            "LeftFoot_End",
            "upperarm_twist_01_l",
            "HeadTop_End",
            "ik_hand_l",
            "LHipJoint",
            "LeftFingerBase",
            "toe2-1.L",
            "LowerBack",
            "Spine1",
            "root",
            "",
            "L5",
            "_",
            "リグ",
            "index_metacarpal_l",
        ] {
            assert_eq!(meaning(name), None, "{name}");
        }
    }

    #[test]
    fn shared_words_are_dropped() {
        let names = parse(["x_rig_hip_l_jnt", "x_rig_knee_l_jnt", "x_rig_head_jnt"].into_iter());
        assert_eq!(names[1].meaning(), Some((Some(Side::Left), LowerLeg)));
        assert_eq!(names[2].words, ["head"]);
    }
}
