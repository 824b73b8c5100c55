//! How well ropes are followed and repaired, on virtual ropes whose truth is known:
//! `cargo bench -p sinew-host --bench rope`.
//!
//! Prints the tables of Porter 2012, Figure 4.4 (gaps of 10 to 100 frames, 1 to 5 neighbours), for
//! the published method, the live one and the two-sided repair; the share of wrong assignments
//! among a person's markers; the failure of Figure 4.3; and draws the curves of rate and noise.
//! Everything follows from seeds: two runs print the same numbers.
//!
//! `-- gaps`, `-- body`, `-- failure`, `-- curves` run a part.

mod body;
mod curves;
mod failure;
mod gaps;
mod scenes;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    // Cargo passes `--bench` when it benchmarks; as a test, one scene of each shows that it runs.
    let thorough = arguments.iter().any(|argument| argument == "--bench");
    let parts: Vec<&String> = arguments.iter().filter(|a| !a.starts_with('-')).collect();
    let wanted = |part: &str| parts.is_empty() || parts.iter().any(|p| *p == part);
    if wanted("gaps") {
        gaps::print(thorough);
    }
    if wanted("body") {
        body::print(thorough);
    }
    if wanted("failure") {
        failure::print();
    }
    if wanted("curves") {
        curves::print(thorough);
    }
}
