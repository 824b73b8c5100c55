//! A socket to poses: what a receiver does between two frames of a body.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use super::actor::{Actor, Follower, Recording};
use super::clock::{Clock, Latencies, Missing, Verdict};
use super::{LARGEST_DATAGRAM, LiveError, points, vmc};
use crate::model::{Skeleton, Transform};

/// A pose that came longer ago than this is not shown as new, seconds.
pub const ALLOWED: f64 = 0.05;

/// What came in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Datagrams.
    pub datagrams: u64,
    /// Bytes in them.
    pub bytes: u64,
    /// Datagrams that could not be read.
    pub malformed: u64,
    /// Datagrams of older frames than the newest.
    pub late: u64,
    /// Datagrams that took too long.
    pub stale: u64,
    /// Frames that came more than once, or in several datagrams.
    pub more: u64,
    /// Frames that never came, by the sender's clock.
    pub lost: u64,
    /// Frames used.
    pub frames: u64,
    /// How often the sender started again.
    pub restarts: u64,
}

/// Waits for datagrams and judges them.
#[derive(Debug)]
pub struct Receiver {
    socket: UdpSocket,
    began: Instant,
    clock: Clock,
    missing: Missing,
    buffer: Vec<u8>,
    /// So far.
    pub tally: Tally,
    /// Why the last malformed datagram was.
    pub last_error: Option<LiveError>,
}

/// When a datagram came, seconds since the receiver began, and how late it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Seconds.
    pub at: f64,
    /// Seconds longer on its way than the quickest.
    pub late_by: f64,
    /// The sender's time, seconds.
    pub sent: f64,
    /// What it is to the newest frame.
    pub verdict: Verdict,
}

impl Receiver {
    /// Listens on an address; port 0 takes any.
    ///
    /// # Errors
    /// The system's, where the address cannot be had.
    pub fn bind(address: SocketAddr) -> std::io::Result<Self> {
        Ok(Self {
            socket: UdpSocket::bind(address)?,
            began: Instant::now(),
            clock: Clock::new(ALLOWED),
            missing: Missing::default(),
            buffer: vec![0; LARGEST_DATAGRAM],
            tally: Tally::default(),
            last_error: None,
        })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// The system's.
    pub fn address(&self) -> std::io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Seconds since it began.
    #[must_use]
    pub fn now(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// The next datagram that `read` understands, with the sender's time that `read` gives, and
    /// whether it is new. `wait`: for how long at most; `None` takes only what is there already.
    ///
    /// # Errors
    /// The system's, where the socket fails.
    fn next<T>(
        &mut self,
        wait: Option<Duration>,
        read: impl Fn(&[u8], f64) -> Result<(T, f64), LiveError>,
    ) -> std::io::Result<Option<(T, Arrival)>> {
        self.socket.set_nonblocking(wait.is_none())?;
        if let Some(wait) = wait {
            let wait = wait.max(Duration::from_millis(1));
            self.socket.set_read_timeout(Some(wait))?;
        }
        loop {
            let length = match self.socket.recv_from(&mut self.buffer) {
                Ok((length, _)) => length,
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Ok(None),
                    // Somebody before us refused a datagram: that is no fault of the socket.
                    ErrorKind::Interrupted | ErrorKind::ConnectionReset => continue,
                    _ => return Err(error),
                },
            };
            let at = self.now();
            self.tally.datagrams += 1;
            self.tally.bytes += length as u64;
            match read(&self.buffer[..length], at) {
                Err(error) => {
                    self.tally.malformed += 1;
                    self.last_error = Some(error);
                    // A flood of them must not keep the caller from its other work.
                    if wait.is_some() {
                        return Ok(None);
                    }
                }
                Ok((found, sent)) => {
                    let (verdict, late_by) = self.clock.judge(sent, at);
                    self.tally.restarts = self.clock.restarts;
                    match verdict {
                        Verdict::Late => self.tally.late += 1,
                        Verdict::Stale => self.tally.stale += 1,
                        Verdict::More => self.tally.more += 1,
                        Verdict::New => {
                            self.tally.frames += 1;
                            self.missing.frame(sent);
                            self.tally.lost = self.missing.count();
                        }
                    }
                    let arrival = Arrival {
                        at,
                        late_by,
                        sent,
                        verdict,
                    };
                    return Ok(Some((found, arrival)));
                }
            }
        }
    }

    /// The next frame of raw points that is new.
    ///
    /// # Errors
    /// The system's.
    pub fn points(
        &mut self,
        wait: Option<Duration>,
    ) -> std::io::Result<Option<(points::Frame, Arrival)>> {
        let next = self.next(wait, |bytes, _| {
            let frame = points::read(bytes)?;
            #[allow(clippy::cast_precision_loss, reason = "a microsecond in 140 years")]
            let sent = frame.microseconds as f64 * 1e-6;
            Ok((frame, sent))
        })?;
        Ok(next.filter(|(_, arrival)| arrival.verdict == Verdict::New))
    }
}

/// Follows an actor over the Virtual Motion Capture protocol.
#[derive(Debug)]
pub struct VmcSession {
    /// Where datagrams come in.
    pub receiver: Receiver,
    actor: Actor,
    target: Skeleton,
    pairs: Vec<(String, String)>,
    follower: Option<Follower>,
    first: Option<f64>,
    pending: Option<Arrival>,
    recording: Option<Recording>,
    /// From a datagram's coming to its pose being handed out, and what it was late by before.
    pub latencies: Latencies,
}

impl VmcSession {
    /// Nothing received yet. `pairs` overrule which joint follows which.
    #[must_use]
    pub fn new(
        receiver: Receiver,
        target: Skeleton,
        pairs: Vec<(String, String)>,
        record: bool,
    ) -> Self {
        Self {
            receiver,
            actor: Actor::default(),
            target,
            pairs,
            follower: None,
            first: None,
            pending: None,
            recording: record.then(Recording::default),
            latencies: Latencies::default(),
        }
    }

    /// The actor so far.
    #[must_use]
    pub fn actor(&self) -> &Actor {
        &self.actor
    }

    /// What was recorded.
    #[must_use]
    pub fn recording(&self) -> Option<&Recording> {
        self.recording.as_ref()
    }

    /// Takes in all that has come, waiting for the first for up to `wait`, and gives the body's
    /// newest pose if it is new. The caller shows it and then calls [`Self::shown`].
    ///
    /// # Errors
    /// The system's; a skeleton that cannot be followed.
    pub fn pose(&mut self, wait: Duration) -> Result<Option<Vec<Transform>>, SessionError> {
        let mut wait = Some(wait);
        loop {
            let next = self.receiver.next(wait.take(), |bytes, at| {
                let packet = vmc::read(bytes)?;
                // Senders without a clock send as they go.
                let sent = packet.time.unwrap_or(at);
                Ok((packet, sent))
            })?;
            let Some((packet, arrival)) = next else {
                break;
            };
            if !matches!(arrival.verdict, Verdict::New | Verdict::More) {
                continue;
            }
            if packet.tracked == Some(false) {
                continue;
            }
            // The frame before is whole now.
            let first = *self.first.get_or_insert(arrival.sent);
            if self.follower.is_none() && arrival.sent > first && self.actor.missing().is_empty() {
                self.actor.bind();
                if let Some(motion) = self.actor.motion() {
                    self.follower = Some(Follower::new(motion, &self.target, &self.pairs)?);
                }
            }
            self.actor.take(&packet);
            if !packet.bones.is_empty() || packet.root.is_some() {
                self.pending = Some(arrival);
            }
        }
        let (Some(follower), Some(motion)) = (&self.follower, self.actor.motion()) else {
            return Ok(None);
        };
        let Some(arrival) = self.pending else {
            return Ok(None);
        };
        let own = self.actor.pose();
        let pose = follower.pose(motion, &own)?;
        if let Some(recording) = &mut self.recording {
            recording.push(arrival.sent, own);
        }
        Ok(Some(pose))
    }

    /// The pose handed out last is on the body now.
    pub fn shown(&mut self) {
        if let Some(arrival) = self.pending.take() {
            let latency = self.receiver.now() - arrival.at + arrival.late_by;
            self.latencies.add(latency);
        }
    }
}

/// Why a session ends.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The socket.
    #[error("the socket: {0}")]
    Socket(#[from] std::io::Error),
    /// The stream.
    #[error(transparent)]
    Stream(#[from] LiveError),
}
