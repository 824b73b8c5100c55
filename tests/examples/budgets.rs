//! Compares what the firmware in `examples/cortex-m` printed with what is committed.
//!
//! `budgets BOARD CASE HASH REPORT FRAME_ONLY [--check | --update]`: the board and the case's key in
//! `tests/budgets.toml`, the hash that the stage gave on this machine (`-` for one unknown), the file
//! with the output of the firmware `stage`, and the firmware `frame_only`.

use std::fmt::Write;
use std::process::ExitCode;
use std::{env, fs};

use sinew_tests::budgets::{Image, Report, Row, Verdict, compare, nested};
use sinew_tests::root;

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let (paths, mode) = match &arguments[..] {
        [board, case, hash, report, firmware] => ([board, case, hash, report, firmware], ""),
        [board, case, hash, report, firmware, mode] if mode == "--check" || mode == "--update" => {
            ([board, case, hash, report, firmware], mode.as_str())
        }
        _ => {
            eprintln!("usage: budgets BOARD CASE HASH REPORT FRAME_ONLY [--check | --update]");
            return ExitCode::from(2);
        }
    };
    match run(paths, mode) {
        Ok(faults) => {
            for fault in &faults {
                eprintln!("error: {fault}");
            }
            ExitCode::from(u8::from(!faults.is_empty()))
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Prints the comparison and returns what is wrong.
fn run(
    [board, case, hash, report, firmware]: [&String; 5],
    mode: &str,
) -> Result<Vec<String>, String> {
    let read = |path: &str| fs::read(path).map_err(|error| format!("{path}: {error}"));
    let parse = |path: &str| -> Result<toml::Table, String> {
        let text = String::from_utf8_lossy(&read(path)?).into_owned();
        text.parse().map_err(|error| format!("{path}: {error}"))
    };
    let key = &format!("{board}.{case}");
    let mut measured = Report::from_table(&parse(report)?);
    let image = Image::read(&read(firmware)?).map_err(|error| format!("{firmware}: {error}"))?;
    let asset_bytes = measured.numbers.get("bytes_asset").copied();
    let code = image.flash.saturating_sub(asset_bytes.unwrap_or(0));
    measured.numbers.insert("bytes_code".into(), code);

    let mut faults: Vec<String> = image
        .panics
        .iter()
        .map(|symbol| format!("{firmware} links a panic path: {symbol}"))
        .collect();
    if hash == "-" {
        println!("{key}: hash {}", measured.frames);
    } else if *hash == measured.frames {
        println!("{key}: hash {hash} as on this machine");
    } else {
        let found = &measured.frames;
        faults.push(format!(
            "the frames hash to {found}, on this machine to {hash}"
        ));
    }

    let path = root().join("tests/budgets.toml").display().to_string();
    let budgets = parse(&path).unwrap_or_default();
    if mode == "--update" {
        fs::write(&path, updated(&budgets, key, &measured)).map_err(|error| error.to_string())?;
        println!("{key}: written to tests/budgets.toml");
        return Ok(faults);
    }
    let Some(budget) = nested(&budgets, key) else {
        println!("{key}: no budget is committed in tests/budgets.toml");
        return Ok(faults);
    };
    let budget = Report::from_table(budget);
    if budget.compiler != measured.compiler {
        println!(
            "budgets are of rustc {}, this is {}: more is tolerated",
            budget.compiler, measured.compiler
        );
    }
    let rows = compare(&budget, &measured);
    print!("{}", table(key, &rows));
    if mode == "--check" {
        let bad = rows.iter().filter(|row| row.fails());
        faults.extend(bad.map(|row| {
            let (name, verdict) = (&row.name, row.verdict);
            format!("{name}: {verdict:?}; if it must be, commit it with run.sh --update")
        }));
    }
    Ok(faults)
}

fn table(key: &str, rows: &[Row]) -> String {
    let mut text = format!("{key:<26} {:>11} {:>11}  change\n", "measured", "budget");
    for row in rows {
        let number = |n: Option<u64>| n.map_or("-".into(), |n| n.to_string());
        let change = match (row.measured, row.budget) {
            (Some(found), Some(budget)) if budget > 0 => {
                format!("{:+.2} %", (found as f64 / budget as f64 - 1.0) * 100.0)
            }
            _ => String::new(),
        };
        let verdict = match row.verdict {
            Verdict::Kept => String::new(),
            other => format!("{other:?}"),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<26} {:>11} {:>11}  {change:>8} {verdict}",
            row.name,
            number(row.measured),
            number(row.budget)
        );
    }
    text
}

/// The file with one case's table replaced.
fn updated(budgets: &toml::Table, key: &str, measured: &Report) -> String {
    let mut tables: Vec<(String, String)> = budgets
        .iter()
        .flat_map(|(board, stages)| deeper(board, stages))
        .flat_map(|(stage, assets)| deeper(&stage, assets))
        .filter(|(other, _)| other != key)
        .filter_map(|(key, table)| Some((key, Report::from_table(table.as_table()?))))
        .map(|(key, report)| (key.clone(), report.to_table(&key)))
        .collect();
    tables.push((key.to_owned(), measured.to_table(key)));
    tables.sort();
    let tables: Vec<_> = tables.into_iter().map(|(_, table)| table).collect();
    format!("{HEAD}\n{}", tables.join("\n"))
}

/// The tables in a table, their names after its own.
fn deeper<'t>(name: &str, table: &'t toml::Value) -> Vec<(String, &'t toml::Value)> {
    let inner = table.as_table().into_iter().flatten();
    inner
        .map(|(inner, table)| (format!("{name}.{inner}"), table))
        .collect()
}

const HEAD: &str = "\
# What stages cost on a Cortex-M4F, M7 and M33 (QEMU's mps2-an386, -an500, -an505): instructions
# (icount_), and bytes of flash, RAM, stack and of types, by board, stage and asset.
# `examples/cortex-m/run.sh --check` fails above +2 %; where another compiler is in use, above
# +15 %. `--update` writes this file.
";
