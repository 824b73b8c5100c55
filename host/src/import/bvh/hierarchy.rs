//! The `HIERARCHY` section: words in, joints in file order out.

use glam::DVec3;

use super::cursor::Cursor;
use crate::import::text::{Names, excerpt, number, trim};
use crate::import::{ImportError, ImportErrorKind, Notice, Place};

/// What one number of a motion row sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    /// Along this axis.
    Position(usize),
    /// About this axis, degrees.
    Rotation(usize),
}

/// A joint in the file's own unit and axes.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub name: String,
    pub parent: Option<usize>,
    pub offset: DVec3,
    /// First number of a motion row that belongs to the joint.
    pub first_column: usize,
    /// What those numbers set, in the file's order.
    pub slots: Vec<Slot>,
    line: usize,
    has_offset: bool,
    has_channels: bool,
}

/// The section, and where the motion starts.
#[derive(Debug, Default)]
pub(super) struct Hierarchy {
    /// Parents come before their children.
    pub joints: Vec<Joint>,
    /// (joint, offset)
    pub end_sites: Vec<(usize, DVec3)>,
    /// Numbers in a motion row.
    pub column_count: usize,
}

/// Real joints have three position and three rotation channels at most.
const MAX_CHANNELS: u64 = 6;

/// A block that is open.
enum Open {
    Joint(usize),
    EndSite { line: usize, offset: Option<DVec3> },
}

/// Reads up to and with the word `MOTION`; returns the rest of the text and its first line's
/// number. O(bytes), with an explicit stack: nesting may be as deep as the file is long.
pub(super) fn read<'a>(
    text: &'a [u8],
    file: &str,
    notices: &mut Vec<Notice>,
) -> Result<(Hierarchy, &'a [u8], usize), ImportError> {
    let mut names = Names::default();
    let mut reader = Reader {
        cursor: Cursor::new(text),
        hierarchy: Hierarchy::default(),
        stack: Vec::new(),
    };
    let ended = reader.run(&mut names);
    let Reader {
        cursor, hierarchy, ..
    } = reader;
    ended.map_err(|(line, kind)| kind.at(file, Place::Line(line)))?;
    names.notice(notices);
    notice_repeated_names(&hierarchy.joints, notices);
    Ok((hierarchy, cursor.rest, cursor.line))
}

type Fault = (usize, ImportErrorKind);

struct Reader<'a> {
    cursor: Cursor<'a>,
    hierarchy: Hierarchy,
    stack: Vec<Open>,
}

impl Reader<'_> {
    fn run(&mut self, names: &mut Names) -> Result<(), Fault> {
        let start = self.cursor.rest;
        match self.cursor.word() {
            Some(word) if word.eq_ignore_ascii_case(b"HIERARCHY") => {}
            _ => {
                let kind = ImportErrorKind::NotThisFormat {
                    expected: "a BVH file, which starts with HIERARCHY",
                    found: excerpt(trim(start)),
                };
                return Err((self.cursor.line, kind));
            }
        }
        loop {
            let Some(word) = self.cursor.word() else {
                return Err(self.early_end());
            };
            let line = self.cursor.line;
            let at = |kind| (line, kind);
            match word.to_ascii_uppercase().as_slice() {
                b"ROOT" => self.open_joint("ROOT", line, names)?,
                b"JOINT" => self.open_joint("JOINT", line, names)?,
                b"END" => self.open_end_site(line)?,
                b"OFFSET" => self.offset(line)?,
                b"CHANNELS" => self.channels(line)?,
                b"}" => self.close(line)?,
                b"MOTION" if self.stack.is_empty() => return self.finish(),
                b"MOTION" => return Err(self.unclosed()),
                b"{" => {
                    return Err(at(ImportErrorKind::Contradiction {
                        what: "an opening brace where no joint starts".into(),
                    }));
                }
                // The last word of a file that was cut.
                _ if self.cursor.rest.is_empty() => return Err(self.early_end()),
                _ => {
                    return Err(at(ImportErrorKind::NotThisFormat {
                        expected: "a BVH hierarchy",
                        found: format!("the word {}", excerpt(word)),
                    }));
                }
            }
        }
    }

    fn finish(&self) -> Result<(), Fault> {
        if self.hierarchy.joints.is_empty() {
            let what = "a ROOT joint".to_owned();
            return Err((self.cursor.line, ImportErrorKind::Missing { what }));
        }
        Ok(())
    }

    fn early_end(&self) -> Fault {
        if !self.stack.is_empty() {
            return self.unclosed();
        }
        let what = "the MOTION section".to_owned();
        (self.cursor.line, ImportErrorKind::Missing { what })
    }

    fn unclosed(&self) -> Fault {
        let (line, what) = match self.stack.last() {
            Some(&Open::Joint(joint)) => {
                let joint = &self.hierarchy.joints[joint];
                (joint.line, format!("joint {:?}", joint.name))
            }
            Some(&Open::EndSite { line, .. }) => (line, "the End Site".to_owned()),
            None => (self.cursor.line, "the hierarchy".to_owned()),
        };
        (line, ImportErrorKind::Unclosed { what })
    }

    fn open_joint(&mut self, keyword: &str, line: usize, names: &mut Names) -> Result<(), Fault> {
        let name = names.read(self.cursor.name(), line);
        let contradiction = |what| Err((line, ImportErrorKind::Contradiction { what }));
        let parent = match (keyword, self.stack.last()) {
            ("ROOT", None) => None,
            ("ROOT", Some(_)) => {
                return contradiction(format!("ROOT {name:?} stands inside another joint"));
            }
            (_, Some(&Open::Joint(parent))) => Some(parent),
            (_, Some(Open::EndSite { .. })) => {
                return contradiction(format!("JOINT {name:?} stands inside an End Site"));
            }
            (_, None) => return contradiction(format!("JOINT {name:?} stands outside any ROOT")),
        };
        self.brace(line, || format!("the opening brace of joint {name:?}"))?;
        self.stack.push(Open::Joint(self.hierarchy.joints.len()));
        self.hierarchy.joints.push(Joint {
            name,
            parent,
            offset: DVec3::ZERO,
            first_column: 0,
            slots: Vec::new(),
            line,
            has_offset: false,
            has_channels: false,
        });
        Ok(())
    }

    fn open_end_site(&mut self, line: usize) -> Result<(), Fault> {
        // "Site", and a name that some programs add, carry nothing.
        self.cursor.name();
        if !matches!(self.stack.last(), Some(Open::Joint(_))) {
            let what = "an End Site stands outside any joint".to_owned();
            return Err((line, ImportErrorKind::Contradiction { what }));
        }
        self.brace(line, || "the opening brace of the End Site".into())?;
        self.stack.push(Open::EndSite { line, offset: None });
        Ok(())
    }

    fn brace(&mut self, line: usize, what: impl Fn() -> String) -> Result<(), Fault> {
        match self.cursor.word() {
            Some(b"{") => Ok(()),
            _ => Err((line, ImportErrorKind::Missing { what: what() })),
        }
    }

    /// Name of the innermost open block, for messages.
    fn owner(&self) -> String {
        match self.stack.last() {
            Some(&Open::Joint(joint)) => format!("joint {:?}", self.hierarchy.joints[joint].name),
            Some(Open::EndSite { .. }) => "the End Site".to_owned(),
            None => "no joint".to_owned(),
        }
    }

    fn offset(&mut self, line: usize) -> Result<(), Fault> {
        let mut offset = [0.0; 3];
        for (value, axis) in offset.iter_mut().zip(["X", "Y", "Z"]) {
            let word = self.cursor.word();
            let what = || format!("{axis} of the OFFSET of {}", self.owner());
            *value = match word {
                None => return Err(self.early_end()),
                Some(b"{" | b"}") => Err(ImportErrorKind::Missing { what: what() }),
                Some(word) => number(word, what),
            }
            .map_err(|kind| (self.cursor.line, kind))?;
        }
        let offset = DVec3::from_array(offset);
        let repeated = match self.stack.last_mut() {
            None => true,
            Some(Open::EndSite { offset: stated, .. }) => stated.replace(offset).is_some(),
            Some(&mut Open::Joint(joint)) => {
                let joint = &mut self.hierarchy.joints[joint];
                joint.offset = offset;
                std::mem::replace(&mut joint.has_offset, true)
            }
        };
        if repeated {
            let what = format!("a second OFFSET, or one that belongs to {}", self.owner());
            return Err((line, ImportErrorKind::Contradiction { what }));
        }
        Ok(())
    }

    fn channels(&mut self, line: usize) -> Result<(), Fault> {
        let owner = self.owner();
        let at = |kind| (line, kind);
        let Some(word) = self.cursor.word() else {
            return Err(self.early_end());
        };
        let count = std::str::from_utf8(word).ok().and_then(|t| t.parse().ok());
        let Some(count) = count else {
            return Err(at(ImportErrorKind::BadNumber {
                what: format!("the channel count of {owner}"),
                text: String::from_utf8_lossy(word).into_owned(),
            }));
        };
        if count > MAX_CHANNELS {
            return Err(at(ImportErrorKind::TooMany {
                what: format!("channels of {owner}"),
                count,
                limit: MAX_CHANNELS,
            }));
        }
        let mut slots = Vec::new();
        for _ in 0..count {
            let Some(word) = self.cursor.word() else {
                return Err(self.early_end());
            };
            let Some(slot) = slot_of(word) else {
                let found = excerpt(word);
                return Err(at(ImportErrorKind::Contradiction {
                    what: format!(
                        "{owner} announces {count} channels, but what stands after {} of them is {found}",
                        slots.len()
                    ),
                }));
            };
            if matches!(slot, Slot::Position(_)) && slots.contains(&slot) {
                let what = format!("{owner} has the channel {} twice", excerpt(word));
                return Err(at(ImportErrorKind::Contradiction { what }));
            }
            slots.push(slot);
        }
        let Some(&Open::Joint(joint)) = self.stack.last() else {
            let what = format!("CHANNELS that belong to {owner}");
            return Err(at(ImportErrorKind::Contradiction { what }));
        };
        let joint = &mut self.hierarchy.joints[joint];
        if std::mem::replace(&mut joint.has_channels, true) {
            let what = format!("{owner} has CHANNELS twice");
            return Err(at(ImportErrorKind::Contradiction { what }));
        }
        joint.first_column = self.hierarchy.column_count;
        self.hierarchy.column_count += slots.len();
        joint.slots = slots;
        Ok(())
    }

    fn close(&mut self, line: usize) -> Result<(), Fault> {
        let missing = |what| Err((line, ImportErrorKind::Missing { what }));
        match self.stack.pop() {
            None => {
                let what = "a closing brace without an opening one".to_owned();
                Err((line, ImportErrorKind::Contradiction { what }))
            }
            Some(Open::Joint(joint)) => {
                let joint = &self.hierarchy.joints[joint];
                if joint.has_offset {
                    return Ok(());
                }
                missing(format!("the OFFSET of joint {:?}", joint.name))
            }
            Some(Open::EndSite { offset, .. }) => {
                let Some(offset) = offset else {
                    return missing("the OFFSET of the End Site".into());
                };
                if let Some(&Open::Joint(joint)) = self.stack.last() {
                    self.hierarchy.end_sites.push((joint, offset));
                }
                Ok(())
            }
        }
    }
}

fn slot_of(word: &[u8]) -> Option<Slot> {
    let (axis, kind) = word.split_first()?;
    let axis = match axis.to_ascii_uppercase() {
        b'X' => 0,
        b'Y' => 1,
        b'Z' => 2,
        _ => return None,
    };
    if kind.eq_ignore_ascii_case(b"position") {
        Some(Slot::Position(axis))
    } else if kind.eq_ignore_ascii_case(b"rotation") {
        Some(Slot::Rotation(axis))
    } else {
        None
    }
}

fn notice_repeated_names(joints: &[Joint], notices: &mut Vec<Notice>) {
    let mut seen = std::collections::HashSet::with_capacity(joints.len());
    let mut repeated = joints
        .iter()
        .filter(|joint| !seen.insert(joint.name.as_str()));
    if let Some(first) = repeated.next() {
        let count = 1 + repeated.count();
        let text = format!(
            "{count} joints repeat the name of an earlier one, such as {:?}; all are kept",
            first.name
        );
        notices.push(Notice::new(Place::Line(first.line), text));
    }
}
