//! Judges cleaning on captures whose truth is known, and on real ones of which stretches are hidden.
//!
//! ```text
//! cargo run --release -p sinew-tests --example judge_clean -- PART [--only TEXT] [--seeds 1,2,3]
//!
//! labels    table 1 of Park & Hodgins 2006: wrong labels, merges left to hand, ghosts
//! deleted   their table 2: a visible marker is deleted and rebuilt
//! gaps      stretches of 10 to 300 frames of each marker of real recordings are hidden
//! names     markers of real recordings exchange their names
//! sure      whether filled samples are as sure as they say
//! speed     300 s of 350 markers
//! ```

mod deleted;
mod gaps;
mod labels;
mod names;
mod speed;
mod sure;

/// What the command line asks for.
pub(crate) struct Options {
    /// Motions or files whose name does not hold this are left out.
    only: String,
    /// One virtual capture, or one set of placements, each.
    seeds: Vec<u64>,
}

fn main() {
    let mut words = std::env::args().skip(1);
    let part = words.next().unwrap_or_default();
    let mut options = Options {
        only: String::new(),
        seeds: Vec::new(),
    };
    while let Some(word) = words.next() {
        let value = words.next().unwrap_or_default();
        match word.as_str() {
            "--only" => options.only = value,
            "--seeds" => {
                let seeds = value.split(',').map(|seed| seed.parse::<u64>());
                let seeds: Result<Vec<u64>, _> = seeds.collect();
                options.seeds = seeds.expect("--seeds takes numbers, as in 1,2,3");
            }
            other => panic!("{other} is no option; there are --only and --seeds"),
        }
    }
    match part.as_str() {
        "labels" => labels::run(&options),
        "deleted" => deleted::run(&options),
        "gaps" => gaps::run(&options),
        "names" => names::run(&options),
        "sure" => sure::run(&options),
        "speed" => speed::run(),
        _ => eprintln!("say which part: labels, deleted, gaps, names, sure or speed"),
    }
}

impl Options {
    fn seeds_or(&self, default: &[u64]) -> Vec<u64> {
        if self.seeds.is_empty() {
            default.to_vec()
        } else {
            self.seeds.clone()
        }
    }

    fn wants(&self, name: &str) -> bool {
        name.contains(&self.only)
    }
}
