//! `sinew send`: a recording as a live stream.

use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};

use super::say::Say;
use super::{Failure, load};
use crate::live::replay::{Faults, Network, Performer, points as point_frame};
use crate::live::{points, vmc};

/// Replay a motion (.bvh, as VMC) or a marker capture (.c3d, .trc, .csv, as points) over UDP.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew send walk.bvh                              to port 39539 of this machine, 120 a second
  sinew send take.c3d --unlabelled --seconds 10
  sinew send walk.bvh --lose 5 --double 5 --swap 5 what a bad network does, in per cent")]
pub(crate) struct Send {
    /// The recording; it repeats.
    file: PathBuf,
    #[command(flatten)]
    reading: load::Reading,
    /// Where to; 127.0.0.1:39539 for motion, 127.0.0.1:39600 for points without it.
    #[arg(long)]
    to: Option<SocketAddr>,
    /// Frames a second.
    #[arg(long, default_value_t = 120.0)]
    rate: f64,
    /// End after so many seconds; without it, after one round.
    #[arg(long)]
    seconds: Option<f64>,
    /// Points without labels, in another order each frame.
    #[arg(long)]
    unlabelled: bool,
    /// Datagrams that never arrive, per cent.
    #[arg(long, default_value_t = 0.0)]
    lose: f64,
    /// Datagrams that arrive twice, per cent.
    #[arg(long, default_value_t = 0.0)]
    double: f64,
    /// Datagrams that arrive after the next one, per cent.
    #[arg(long, default_value_t = 0.0)]
    swap: f64,
    /// Which datagrams those are.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl Send {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        if !(self.rate > 0.0 && self.rate <= 10_000.0) {
            return Err(Failure::Usage("--rate must lie between 0 and 10000".into()));
        }
        let part = |name: &str, per_cent: f64| {
            let fits = (0.0..=100.0).contains(&per_cent);
            fits.then_some(per_cent / 100.0)
                .ok_or_else(|| Failure::Usage(format!("--{name} lies between 0 and 100")))
        };
        let faults = Faults {
            lost: part("lose", self.lose)?,
            doubled: part("double", self.double)?,
            swapped: part("swap", self.swap)?,
        };
        let (loaded, notices) = load::any(&self.file, self.reading)?;
        say.notices(&self.file.display().to_string(), &notices);
        match loaded {
            load::Loaded::Motion(motion) => {
                let performer = Performer::new(&motion)?;
                let round = performer.duration();
                self.send(vmc::PORT, round, faults, say, |_, sent| {
                    Ok(vmc::write(&performer.packet(sent)))
                })
            }
            load::Loaded::Take(take) => {
                let round = take.frame_count() as f64 / self.rate;
                let labelled = !self.unlabelled;
                self.send(points::PORT, round, faults, say, |number, sent| {
                    let frame = point_frame(&take, number, (sent * 1e6) as u64, labelled);
                    Ok(points::write(&frame)?)
                })
            }
            _ => Err(Failure::Usage(format!(
                "{}: give a motion (.bvh) or a marker capture (.c3d, .trc, .csv)",
                self.file.display()
            ))),
        }
    }

    fn send(
        &self,
        port: u16,
        round: f64,
        faults: Faults,
        say: &Say,
        datagram: impl Fn(u32, f64) -> Result<Vec<u8>, Failure>,
    ) -> Result<Value, Failure> {
        let to = self.to.unwrap_or(SocketAddr::from(([127, 0, 0, 1], port)));
        let from = SocketAddr::from(match to {
            SocketAddr::V4(_) => ([0, 0, 0, 0], 0),
            SocketAddr::V6(_) => return Err(Failure::Usage("--to takes an IPv4 address".into())),
        });
        let failed = |error| Failure::Data(format!("{to}: {error}"));
        let socket = UdpSocket::bind(from).map_err(failed)?;
        let seconds = self.seconds.unwrap_or(round);
        let count = (seconds * self.rate).round().max(1.0) as u32;
        say.line(format!("{count} frames to {to}"));
        let bar = say.progress("sending", count as usize);
        let mut network = Network::new(faults, self.seed);
        let (began, mut sent) = (Instant::now(), 0_u64);
        for number in 0..count {
            let due = f64::from(number) / self.rate;
            let left = due - began.elapsed().as_secs_f64();
            if left > 0.0 {
                std::thread::sleep(Duration::from_secs_f64(left));
            }
            for datagram in network.send(datagram(number, due)?) {
                // Nobody listening yet is no reason to end.
                sent += u64::from(socket.send_to(&datagram, to).is_ok());
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        say.line(format!("sent {sent} datagrams"));
        Ok(json!({ "frames": count, "datagrams": sent, "to": to.to_string() }))
    }
}
