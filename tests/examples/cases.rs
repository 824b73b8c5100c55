//! Writes the assets of cases to a folder and prints a line for each: its key, its file, and the
//! hash of what its stage puts out on this machine. Those hashes are also written to
//! `FOLDER/fingerprints.toml`, in the form of `tests/golden/fingerprints.toml`.
//!
//! `cases FOLDER [CASE...]`: all cases where none is named.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs};

use sinew_core::deform::Level;
use sinew_tests::cases;

fn main() -> ExitCode {
    let mut arguments = env::args().skip(1);
    let Some(folder) = arguments.next().map(PathBuf::from) else {
        eprintln!("usage: cases FOLDER [CASE...]");
        return ExitCode::from(2);
    };
    match write(&folder, &arguments.collect::<Vec<_>>()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}: {error}", folder.display());
            ExitCode::FAILURE
        }
    }
}

fn write(folder: &Path, wanted: &[String]) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut hashes = String::new();
    for case in cases::only(wanted) {
        let file = folder.join(format!("{}.sinew", case.key()));
        fs::write(&file, case.asset.as_slice())?;
        let hash = case.fingerprints(Level::Scalar);
        hashes.push_str(&hash.to_table(&case.key()));
        println!("{} {} {}", case.key(), file.display(), hash.frames);
    }
    fs::write(folder.join("fingerprints.toml"), hashes)
}
