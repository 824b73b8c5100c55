//! Committed measurements of the firmware in `examples/cortex-m`, and what may become of them.
//!
//! A report is what the firmware prints: TOML, one number a line. Numbers whose names start with
//! `icount_` (instructions) or `bytes_` have a budget in `tests/budgets.toml`, a table for each board,
//! stage and asset.

use std::collections::BTreeMap;
use std::fmt::Write;

use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

/// Numbers may grow by this part of their budget.
pub const TOLERANCE: f64 = 0.02;

/// The same where another compiler measured the budget than is in use.
pub const OTHER_COMPILER_TOLERANCE: f64 = 0.15;

/// What one run of the firmware printed, or what is committed of an earlier one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Version of the compiler.
    pub compiler: String,
    /// CRC-32 of the asset, in hexadecimal. Empty in budgets.
    pub asset: String,
    /// Hash of the frames, in hexadecimal. Empty in budgets.
    pub frames: String,
    /// Numbers with a budget, by name.
    pub numbers: BTreeMap<String, u64>,
}

impl Report {
    /// Reads a table of the budgets or what the firmware printed.
    #[must_use]
    pub fn from_table(table: &toml::Table) -> Self {
        let text = |name: &str| {
            let value = table.get(name).and_then(toml::Value::as_str);
            value.unwrap_or_default().to_owned()
        };
        let gated = |name: &str| name.starts_with("icount_") || name.starts_with("bytes_");
        Self {
            compiler: text("compiler"),
            asset: text("asset"),
            frames: text("fingerprint"),
            numbers: table
                .iter()
                .filter(|(name, _)| gated(name))
                .filter_map(|(name, value)| {
                    let number = u64::try_from(value.as_integer()?).ok()?;
                    Some((name.clone(), number))
                })
                .collect(),
        }
    }

    /// Its table in `tests/budgets.toml`.
    #[must_use]
    pub fn to_table(&self, key: &str) -> String {
        let mut text = format!("[{key}]\ncompiler = \"{}\"\n", self.compiler);
        for (name, number) in &self.numbers {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name} = {number}");
        }
        text
    }
}

/// Committed hashes of an asset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fingerprints {
    /// CRC-32 of the file.
    pub asset: String,
    /// Of all that the stage puts out.
    pub frames: String,
}

impl Fingerprints {
    /// Those of the case `key`, `stage.asset`, in the text of `tests/golden/fingerprints.toml`.
    #[must_use]
    pub fn of(text: &str, key: &str) -> Option<Self> {
        let table: toml::Table = text.parse().ok()?;
        let table = nested(&table, key)?;
        let text = |name: &str| Some(table.get(name)?.as_str()?.to_owned());
        Some(Self {
            asset: text("asset")?,
            frames: text("frames")?,
        })
    }

    /// The table of that case.
    #[must_use]
    pub fn to_table(&self, key: &str) -> String {
        let Self { asset, frames } = self;
        format!("\n[{key}]\nasset = \"{asset}\"\nframes = \"{frames}\"\n")
    }
}

/// The table inside tables that `key` names, its parts joined by dots.
#[must_use]
pub fn nested<'t>(table: &'t toml::Table, key: &str) -> Option<&'t toml::Table> {
    key.split('.')
        .try_fold(table, |table, part| table.get(part)?.as_table())
}

/// How a number stands against its budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Within the tolerance.
    Kept,
    /// Lower by more than the tolerance: the budget should follow.
    Better,
    /// Higher by more than the tolerance.
    Exceeded,
    /// Measured, without a budget.
    New,
    /// A budget that nothing was measured for.
    Missing,
}

/// A number beside its budget.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// What.
    pub name: String,
    /// Committed.
    pub budget: Option<u64>,
    /// Found now.
    pub measured: Option<u64>,
    /// What to think of it.
    pub verdict: Verdict,
}

impl Row {
    /// Whether this fails a check.
    #[must_use]
    pub fn fails(&self) -> bool {
        matches!(
            self.verdict,
            Verdict::Exceeded | Verdict::New | Verdict::Missing
        )
    }
}

/// Every number of either, by name.
#[must_use]
pub fn compare(budget: &Report, measured: &Report) -> Vec<Row> {
    let tolerance = if budget.compiler == measured.compiler {
        TOLERANCE
    } else {
        OTHER_COMPILER_TOLERANCE
    };
    let mut names: Vec<_> = budget
        .numbers
        .keys()
        .chain(measured.numbers.keys())
        .collect();
    names.sort();
    names.dedup();
    let row = |name: &String| {
        let (committed, found) = (budget.numbers.get(name), measured.numbers.get(name));
        let verdict = match (committed, found) {
            (Some(&committed), Some(&found)) => {
                // What is inlined where depends a little on the folder that is built in.
                let layout = name == "bytes_code" || name.starts_with("bytes_stack");
                let tolerance = if layout {
                    OTHER_COMPILER_TOLERANCE
                } else {
                    tolerance
                };
                let (committed, found) = (committed as f64, found as f64);
                if found > committed * (1.0 + tolerance) {
                    Verdict::Exceeded
                } else if found < committed * (1.0 - tolerance) {
                    Verdict::Better
                } else {
                    Verdict::Kept
                }
            }
            (None, _) => Verdict::New,
            (_, None) => Verdict::Missing,
        };
        Row {
            name: name.clone(),
            budget: committed.copied(),
            measured: found.copied(),
            verdict,
        }
    };
    names.into_iter().map(row).collect()
}

/// What a firmware's file says about itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Image {
    /// Bytes in flash, the asset included.
    pub flash: u64,
    /// Symbols of the panic machinery: none in a firmware that cannot panic.
    pub panics: Vec<String>,
}

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// The reason why it is not one, or that its symbols were stripped.
    pub fn read(elf: &[u8]) -> Result<Self, String> {
        let file = object::File::parse(elf).map_err(|error| error.to_string())?;
        let in_flash = [
            SectionKind::Text,
            SectionKind::ReadOnlyData,
            SectionKind::Data,
        ];
        let sections = file.sections();
        let flash = sections.filter(|section| in_flash.contains(&section.kind()));
        let names: Vec<_> = file
            .symbols()
            .filter_map(|symbol| symbol.name().ok())
            .collect();
        if names.is_empty() {
            return Err("it has no symbols: build it without stripping".into());
        }
        let panics = names.into_iter().filter(|name| is_panic(name));
        Ok(Self {
            flash: flash.map(|section| section.size()).sum(),
            panics: panics.map(str::to_owned).collect(),
        })
    }
}

/// Whether a mangled symbol belongs to the panic machinery of `core`.
fn is_panic(name: &str) -> bool {
    [
        "panicking",
        "rust_begin_unwind",
        "unwrap_failed",
        "expect_failed",
        "slice_index_fail",
    ]
    .iter()
    .any(|part| name.contains(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(compiler: &str, numbers: &[(&str, u64)]) -> Report {
        Report {
            compiler: compiler.into(),
            numbers: numbers.iter().map(|&(name, n)| (name.into(), n)).collect(),
            ..Report::default()
        }
    }

    #[test]
    fn two_parts_in_a_hundred_more_are_kept_and_three_are_not() {
        let budget = report(
            "1",
            &[("icount_a", 1000), ("icount_b", 1000), ("icount_c", 1000)],
        );
        let found = report(
            "1",
            &[("icount_a", 1020), ("icount_b", 1021), ("icount_c", 979)],
        );
        let verdicts: Vec<_> = compare(&budget, &found)
            .iter()
            .map(|row| row.verdict)
            .collect();
        assert_eq!(
            verdicts,
            [Verdict::Kept, Verdict::Exceeded, Verdict::Better]
        );
        let found = report(
            "2",
            &[("icount_a", 1150), ("icount_b", 1151), ("icount_d", 1)],
        );
        let rows = compare(&budget, &found);
        let verdicts: Vec<_> = rows.iter().map(|row| row.verdict).collect();
        assert_eq!(
            verdicts,
            [
                Verdict::Kept,
                Verdict::Exceeded,
                Verdict::Missing,
                Verdict::New
            ]
        );
        assert!(!rows[0].fails() && rows[1].fails() && rows[2].fails() && rows[3].fails());
    }

    #[test]
    fn a_table_survives_writing_and_reading() {
        let mut wanted = report("1.95.0", &[("bytes_asset", 7), ("icount_load", 9)]);
        let text = wanted.to_table("m7.skin.arm") + "joints = 3\n";
        let table: toml::Table = text.parse().unwrap();
        let read = Report::from_table(nested(&table, "m7.skin.arm").unwrap());
        assert_eq!(read, wanted);
        wanted.numbers.clear();
        assert_ne!(read, wanted);
    }

    #[test]
    fn what_is_no_elf_file_is_refused_and_panics_are_known_by_name() {
        assert!(Image::read(b"not an ELF file").is_err());
        assert!(is_panic("_ZN4core9panicking5panic17h0123456789abcdefE"));
        assert!(is_panic("_RNvNtCs1_4core9panicking9panic_fmt"));
        assert!(!is_panic(
            "_RNvNtNtCs1_10sinew_core6deform4skin11skin_blocks"
        ));
    }
}
