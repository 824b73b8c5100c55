//! Collects what a stage does, and prints it as TOML.

use core::fmt::{self, Write};

use sinew_stages::Probe;

use crate::counter::Counter;
use crate::stack;

const ROWS: usize = 12;
const NUMBERS: usize = 40;

/// Fewest, most and all instructions of something, and its deepest stack.
#[derive(Clone, Copy)]
struct Spread {
    name: &'static str,
    calls: u64,
    min: u64,
    max: u64,
    sum: u64,
    stack: usize,
}

/// The instructions of one part of a frame, for each of something.
#[derive(Clone, Copy)]
struct Per {
    name: &'static str,
    whole: &'static str,
    part: &'static str,
    divisor: u64,
}

/// A probe with room for so many rows; what does not fit is counted as lost.
pub struct Report {
    counter: Counter,
    spreads: [Option<Spread>; ROWS],
    pers: [Option<Per>; ROWS],
    numbers: [Option<(&'static str, u64)>; NUMBERS],
    lost: usize,
}

impl Report {
    /// Nothing measured yet.
    pub fn new(counter: Counter) -> Self {
        Self {
            counter,
            spreads: [None; ROWS],
            pers: [None; ROWS],
            numbers: [None; NUMBERS],
            lost: 0,
        }
    }

    fn mean(&self, name: &str) -> u64 {
        let spread = self.spreads.iter().flatten().find(|row| row.name == name);
        spread.map_or(0, |row| row.sum / row.calls.max(1))
    }

    /// One number a line.
    ///
    /// # Errors
    /// What `out` says; an error too where rows were lost.
    pub fn print(&self, out: &mut impl Write) -> fmt::Result {
        if self.lost > 0 {
            return Err(fmt::Error);
        }
        let rate = self.counter.milli_rate();
        writeln!(out, "milli_instructions_a_tick = {rate}")?;
        for row in self.spreads.iter().flatten() {
            let name = row.name;
            if row.calls > 1 {
                writeln!(out, "icount_{name}_min = {}", row.min)?;
                writeln!(out, "icount_{name}_max = {}", row.max)?;
                writeln!(out, "{name}_calls = {}", row.calls)?;
                writeln!(out, "icount_{name}_mean = {}", row.sum / row.calls)?;
            } else {
                writeln!(out, "icount_{name} = {}", row.sum)?;
            }
            writeln!(out, "bytes_stack_{name} = {}", row.stack)?;
        }
        for row in self.pers.iter().flatten() {
            let difference = self.mean(row.whole).saturating_sub(self.mean(row.part));
            writeln!(
                out,
                "icount_{} = {}",
                row.name,
                difference / row.divisor.max(1)
            )?;
        }
        for (name, value) in self.numbers.iter().flatten() {
            writeln!(out, "{name} = {value}")?;
        }
        Ok(())
    }
}

impl Probe for Report {
    fn count<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let ((result, instructions), depth) = stack::depth(|| self.counter.count(work));
        let mut rows = self.spreads.iter_mut();
        match rows.find(|row| row.is_none_or(|row| row.name == name)) {
            None => self.lost += 1,
            Some(row) => {
                let row = row.get_or_insert(Spread {
                    name,
                    calls: 0,
                    min: u64::MAX,
                    max: 0,
                    sum: 0,
                    stack: 0,
                });
                row.calls += 1;
                row.min = row.min.min(instructions);
                row.max = row.max.max(instructions);
                row.sum += instructions;
                row.stack = row.stack.max(depth);
            }
        }
        result
    }

    fn number(&mut self, name: &'static str, value: u64) {
        match self.numbers.iter_mut().find(|row| row.is_none()) {
            Some(row) => *row = Some((name, value)),
            None => self.lost += 1,
        }
    }

    fn per(&mut self, name: &'static str, whole: &'static str, part: &'static str, divisor: u64) {
        match self.pers.iter_mut().find(|row| row.is_none()) {
            Some(row) => {
                *row = Some(Per {
                    name,
                    whole,
                    part,
                    divisor,
                });
            }
            None => self.lost += 1,
        }
    }
}
