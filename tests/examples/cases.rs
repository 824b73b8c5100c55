//! Writes the assets of all cases to a folder and prints a line for each: its key and its file.
//!
//! `cases FOLDER`

use std::path::PathBuf;
use std::process::ExitCode;
use std::{env, fs};

fn main() -> ExitCode {
    let Some(folder) = env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: cases FOLDER");
        return ExitCode::from(2);
    };
    match write(&folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}: {error}", folder.display());
            ExitCode::FAILURE
        }
    }
}

fn write(folder: &std::path::Path) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    for case in sinew_tests::cases::all() {
        let file = folder.join(format!("{}.sinew", case.key()));
        fs::write(&file, case.asset.as_slice())?;
        println!("{} {}", case.key(), file.display());
    }
    Ok(())
}
