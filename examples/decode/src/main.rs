//! Reads compressed log messages from standard input and prints them as text.
//!
//! `decode ELF < LOG`: the firmware, which holds the texts, and what it sent.

use std::error::Error;
use std::io::Read;
use std::process::ExitCode;
use std::{env, fs, io};

use defmt_decoder::{DecodeError, Table};

fn main() -> ExitCode {
    let Some(elf) = env::args_os().nth(1) else {
        eprintln!("usage: decode ELF < LOG");
        return ExitCode::from(2);
    };
    let decoded = fs::read(&elf)
        .map_err(Into::into)
        .and_then(|elf| decode(&elf));
    match decoded {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}: {error}", elf.display());
            ExitCode::FAILURE
        }
    }
}

fn decode(elf: &[u8]) -> Result<(), Box<dyn Error>> {
    let table = Table::parse(elf)?.ok_or("no log messages in this firmware")?;
    let mut bytes = Vec::new();
    io::stdin().read_to_end(&mut bytes)?;
    let mut stream = table.new_stream_decoder();
    stream.received(&bytes);
    loop {
        match stream.decode() {
            Ok(frame) => {
                let level = frame.level().map_or("", |level| level.as_str());
                println!("{level:<5} {}", frame.display_message());
            }
            Err(DecodeError::UnexpectedEof) => return Ok(()),
            Err(DecodeError::Malformed) => return Err("a message that is none".into()),
        }
    }
}
