//! `sinew live`: a body follows a stream.

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::say::Say;
use super::{Failure, load};
use crate::export::bvh::{BvhStyle, write_bvh};
use crate::export::c3d::write_c3d;
use crate::export::marker_csv::write_marker_csv;
use crate::export::write_atomic;
use crate::live::session::{Receiver, VmcSession};
use crate::live::{clock::Latencies, points, vmc};
use crate::play::{Player, core_transform};
use crate::reference;
use crate::take::Take;

/// Drive a body by motion that arrives over UDP.
#[derive(Args)]
#[command(after_help = "\
Examples:
  sinew live body.sinew                            VMC on port 39539 of this machine
  sinew live body.sinew --bind 0.0.0.0 --record take.bvh
  sinew live --protocol points --record take.c3d   raw points, see host/README.md
  sinew send walk.bvh                              a sender to try it with

It ends after --seconds, when nothing has come for --idle seconds, or when Enter is pressed; a
recording is written then. A recording ends in .bvh (VMC) or in .c3d or .csv (points).")]
pub(crate) struct Live {
    /// The asset; needed for VMC.
    asset: Option<PathBuf>,
    /// What is spoken.
    #[arg(long, value_enum, default_value_t = Protocol::Vmc)]
    protocol: Protocol,
    /// Address to listen on; 0.0.0.0 for a studio's network.
    #[arg(long, default_value = "127.0.0.1")]
    bind: IpAddr,
    /// Port; 39539 for VMC and 39600 for points without it.
    #[arg(long)]
    port: Option<u16>,
    /// Join joints by hand, as SOURCE=TARGET.
    #[arg(long = "map", value_name = "SOURCE=TARGET", value_parser = load::pair)]
    pairs: Vec<(String, String)>,
    /// Keep the take.
    #[arg(long)]
    record: Option<PathBuf>,
    /// End after so many seconds.
    #[arg(long)]
    seconds: Option<f64>,
    /// End when nothing has come for so many seconds, once something has.
    #[arg(long, default_value_t = 5.0)]
    idle: f64,
}

/// A stream's protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Protocol {
    /// Virtual Motion Capture: joint rotations.
    Vmc,
    /// Raw points.
    Points,
}

/// For how long a socket is waited for before anything else is looked at.
const WAIT: Duration = Duration::from_millis(20);

impl Live {
    pub fn run(self, say: &Say) -> Result<Value, Failure> {
        let ending = self.record.as_deref().map(ending).unwrap_or_default();
        let suits = match self.protocol {
            Protocol::Vmc => ["", "bvh"].contains(&ending.as_str()),
            Protocol::Points => ["", "c3d", "csv"].contains(&ending.as_str()),
        };
        if !suits {
            let text = "a recording ends in .bvh (vmc), or in .c3d or .csv (points)";
            return Err(Failure::Usage(format!(".{ending}: {text}")));
        }
        let port = self.port.unwrap_or(match self.protocol {
            Protocol::Vmc => vmc::PORT,
            Protocol::Points => points::PORT,
        });
        let address = SocketAddr::new(self.bind, port);
        let receiver = Receiver::bind(address).map_err(|error| {
            Failure::Data(format!("{address}: {error}; give another --port or --bind"))
        })?;
        say.line(format!("listening on {address}; press Enter to end"));
        match self.protocol {
            Protocol::Vmc => self.vmc(receiver, say),
            Protocol::Points => self.points(receiver, say),
        }
    }

    fn vmc(self, receiver: Receiver, say: &Say) -> Result<Value, Failure> {
        let Some(path) = &self.asset else {
            return Err(Failure::Usage("vmc moves a body: give an asset".into()));
        };
        let bytes = load::asset(path)?;
        let asset = bytes.asset().map_err(|error| load::fault(path, &error))?;
        let body = reference::unpack(&asset);
        let mut player = Player::new(asset);
        let record = self.record.is_some();
        let mut session = VmcSession::new(receiver, body.skeleton, self.pairs.clone(), record);
        let mut watch = Watch::new(self.seconds, self.idle, say);
        let (mut shown, mut flagged) = (0_u64, 0_u64);
        let mut last = std::time::Instant::now();
        while watch.goes_on(session.receiver.tally.frames, || {
            status(&session.receiver, &session.latencies)
        }) {
            if let Some(pose) = session.pose(WAIT)? {
                let pose: Vec<_> = pose.iter().map(core_transform).collect();
                player.set_elapsed(last.elapsed().as_secs_f64());
                last = std::time::Instant::now();
                let report = player.step(&sinew_core::frame::Input::Pose(&pose));
                flagged += u64::from(!report.flags.is_empty());
                session.shown();
                shown += 1;
            }
        }
        watch.end();
        let missing = session.actor().missing();
        if shown == 0 && session.receiver.tally.datagrams > 0 {
            let why = match &session.receiver.last_error {
                Some(error) => format!("the last fault: {error}"),
                None => format!("bones that never came: {}", missing.join(", ")),
            };
            say.line(format!("no pose could be shown; {why}"));
        }
        let mut kept = 0;
        if let (Some(path), Some(motion)) = (&self.record, session.actor().motion()) {
            let motion = session.recording().and_then(|r| r.motion(motion));
            if let Some(motion) = motion {
                kept = session.recording().map_or(0, |recording| recording.len());
                write_atomic(path, |out| write_bvh(&motion, BvhStyle::default(), out))?;
                say.line(format!("wrote {} ({kept} poses)", path.display()));
            }
        }
        let mut object = summary(&session.receiver, &session.latencies);
        object["shown"] = shown.into();
        object["flagged"] = flagged.into();
        object["recorded"] = kept.into();
        Ok(object)
    }

    fn points(self, mut receiver: Receiver, say: &Say) -> Result<Value, Failure> {
        let mut latencies = Latencies::default();
        let mut watch = Watch::new(self.seconds, self.idle, say);
        let mut frames = Vec::new();
        while watch.goes_on(receiver.tally.frames, || status(&receiver, &latencies)) {
            if let Some((frame, arrival)) = receiver.points(Some(WAIT))? {
                latencies.add(receiver.now() - arrival.at + arrival.late_by);
                if self.record.is_some() {
                    frames.push((arrival.sent, frame));
                }
            }
        }
        watch.end();
        if let Some(path) = self.record.as_deref().filter(|_| !frames.is_empty()) {
            let take = take(&frames)?;
            let raw = take.to_raw();
            write_atomic(path, |out| match ending(path).as_str() {
                "csv" => write_marker_csv(&raw, out),
                _ => write_c3d(&raw, out),
            })?;
            let count = take.frame_count();
            say.line(format!("wrote {} ({count} frames)", path.display()));
        }
        let mut object = summary(&receiver, &latencies);
        object["recorded"] = frames.len().into();
        Ok(object)
    }
}

fn ending(path: &Path) -> String {
    let ending = path.extension().unwrap_or_default();
    ending.to_string_lossy().to_lowercase()
}

/// Frames on an even grid at the stream's usual rate; frames that never came are gaps.
fn take(frames: &[(f64, points::Frame)]) -> Result<Take, Failure> {
    let first = frames.first().map_or(0.0, |(sent, _)| *sent);
    let mut gaps: Vec<f64> = frames
        .windows(2)
        .map(|pair| pair[1].0 - pair[0].0)
        .collect();
    gaps.sort_by(f64::total_cmp);
    let usual = gaps.get(gaps.len() / 2).copied().unwrap_or(0.01).max(1e-4);
    let rate = (1.0 / usual).round().max(1.0);
    let place = |sent: f64| ((sent - first) * rate).round() as usize;
    let count = frames.last().map_or(0, |(sent, _)| place(*sent)) + 1;
    if count > 10_000_000 {
        let text = "the sender's clock jumped; the take cannot be laid on an even grid";
        return Err(Failure::Data(text.into()));
    }
    // Unlabelled points are columns by their order, as capture systems write them.
    let mut names: Vec<String> = Vec::new();
    let mut rows: Vec<Vec<glam::DVec3>> = Vec::new();
    for (sent, frame) in frames {
        for (order, point) in frame.points.iter().enumerate() {
            let name = match point.marker {
                Some(marker) => format!("M{marker:03}"),
                None => format!("Unlabeled:{order}"),
            };
            let column = names.iter().position(|known| *known == name);
            let column = column.unwrap_or_else(|| {
                names.push(name);
                rows.push(vec![glam::DVec3::NAN; count]);
                names.len() - 1
            });
            rows[column][place(*sent).min(count - 1)] =
                glam::Vec3::from_array(point.position).as_dvec3();
        }
    }
    let take = Take::new(names, rate, count, rows.concat());
    take.map_err(|error| Failure::Data(error.to_string()))
}

/// When to end, and a line a second meanwhile.
struct Watch<'s> {
    began: Instant,
    last_frame: Option<Instant>,
    frames: u64,
    seconds: Option<f64>,
    idle: f64,
    told: u64,
    say: &'s Say,
    enter: std::sync::mpsc::Receiver<()>,
}

impl<'s> Watch<'s> {
    fn new(seconds: Option<f64>, idle: f64, say: &'s Say) -> Self {
        let (pressed, enter) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            // An input that is closed, as in a script, is no wish to end.
            if std::io::stdin()
                .read_line(&mut line)
                .is_ok_and(|length| length > 0)
            {
                let _ = pressed.send(());
            }
        });
        Self {
            began: Instant::now(),
            last_frame: None,
            frames: 0,
            seconds,
            idle,
            told: 0,
            say,
            enter,
        }
    }

    fn goes_on(&mut self, frames: u64, status: impl Fn() -> String) -> bool {
        if frames > self.frames {
            self.frames = frames;
            self.last_frame = Some(Instant::now());
        }
        let so_far = self.began.elapsed().as_secs_f64();
        if so_far as u64 > self.told {
            self.told = so_far as u64;
            self.say.transient(&status());
        }
        let quiet = self.last_frame.map(|last| last.elapsed().as_secs_f64());
        self.seconds.is_none_or(|seconds| so_far < seconds)
            && quiet.is_none_or(|quiet| quiet < self.idle)
            && self.enter.try_recv().is_err()
    }

    fn end(&self) {
        self.say.transient("");
    }
}

fn status(receiver: &Receiver, latencies: &Latencies) -> String {
    let tally = &receiver.tally;
    format!(
        "{} frames, {} lost, {} late, {} malformed; latency {:.1} ms, 99 %: {:.1} ms",
        tally.frames,
        tally.lost,
        tally.late + tally.stale,
        tally.malformed,
        1e3 * latencies.within(0.5),
        1e3 * latencies.within(0.99),
    )
}

fn summary(receiver: &Receiver, latencies: &Latencies) -> Value {
    let tally = &receiver.tally;
    json!({
        "datagrams": tally.datagrams,
        "bytes": tally.bytes,
        "malformed": tally.malformed,
        "late": tally.late,
        "stale": tally.stale,
        "repeated": tally.more,
        "lost": tally.lost,
        "frames": tally.frames,
        "restarts": tally.restarts,
        "latency_ms": {
            "median": 1e3 * latencies.within(0.5),
            "p99": 1e3 * latencies.within(0.99),
            "max": 1e3 * latencies.largest(),
        },
    })
}
