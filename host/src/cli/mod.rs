//! The `sinew` command: one file a subcommand, each thin over the library.
//!
//! Words for people go to standard error, `--json` puts one object on standard output. The exit
//! status is 0 when done, 1 when the data is at fault, 2 when the command line is.

mod bake;
mod clean;
mod cost;
mod demo;
mod inspect;
mod join;
mod live;
mod load;
mod markers;
mod play;
mod register;
mod rig;
mod rope;
mod say;
mod segment;
mod send;
mod solve;
mod studio;
mod track;
mod usable;
mod verify;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Real-time avatars: bake a body and its motion into one asset, check it, play it.
#[derive(Parser)]
#[command(name = "sinew", version, about, max_term_width = 100)]
#[command(after_help = "\
Examples:
  sinew demo                                       the whole way on the bundled body
  sinew inspect walk.bvh                           what a file holds
  sinew bake --mesh body.glb --motion walk.bvh --output body.sinew
  sinew play body.sinew --output body.gif
  sinew verify body.sinew && sinew cost body.sinew
  sinew rope take.c3d --output rope.c3d            a rope among a person's markers
  sinew solve take.c3d --output walk.bvh           markers to skeleton motion
  sinew register --mesh body.glb --markers clean.c3d --output fitted.glb
  sinew rig scan.obj --skeleton walk.bvh --output body.glb
  sinew join cut.obj --output body.glb             rigid parts to one skin
  sinew segment --mesh fitted.glb --markers clean.c3d --output parts.json
  sinew studio --mesh body.glb --motion walk.bvh --out capture

Lengths are metres, times seconds, Y is up. Exit status: 0 done, 1 the data is at fault, 2 usage.")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Put one JSON object on standard output.
    #[arg(long, global = true)]
    json: bool,
    /// Say nothing but errors on standard error.
    #[arg(long, short, global = true)]
    quiet: bool,
}

#[derive(Subcommand)]
enum Command {
    Demo(demo::Demo),
    Inspect(inspect::Inspect),
    Bake(Box<bake::Bake>),
    Clean(clean::Clean),
    Register(register::Register),
    Rig(rig::Rig),
    Join(join::Join),
    Segment(segment::Segment),
    Live(live::Live),
    Play(play::Play),
    Send(send::Send),
    Rope(Box<rope::Rope>),
    Verify(verify::Verify),
    Cost(cost::CostCommand),
    Solve(solve::Solve),
    Studio(Box<studio::Studio>),
    Track(track::Track),
}

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The data is at fault: exit status 1.
    Data(String),
    /// The command line is: exit status 2.
    Usage(String),
}

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Data(error.to_string())
    }
}

/// Runs the command line and returns its exit status.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = Arguments::parse();
    let say = say::Say::new(arguments.json, arguments.quiet);
    let done = match arguments.command {
        Command::Demo(command) => command.run(&say),
        Command::Inspect(command) => command.run(&say),
        Command::Bake(command) => command.run(&say),
        Command::Clean(command) => command.run(&say),
        Command::Register(command) => command.run(&say),
        Command::Rig(command) => command.run(&say),
        Command::Join(command) => command.run(&say),
        Command::Segment(command) => command.run(&say),
        Command::Live(command) => command.run(&say),
        Command::Play(command) => command.run(&say),
        Command::Send(command) => command.run(&say),
        Command::Rope(command) => command.run(&say),
        Command::Verify(command) => command.run(&say),
        Command::Cost(command) => command.run(&say),
        Command::Solve(command) => command.run(&say),
        Command::Studio(command) => command.run(&say),
        Command::Track(command) => command.run(&say),
    };
    match done {
        Ok(object) => {
            say.object(&object);
            ExitCode::SUCCESS
        }
        Err(Failure::Data(text)) => {
            say.error(&text);
            ExitCode::from(1)
        }
        Err(Failure::Usage(text)) => {
            say.error(&text);
            ExitCode::from(2)
        }
    }
}
