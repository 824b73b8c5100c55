//! Streams over loopback: what a bad network does to them, and what hostile datagrams do.

use std::net::{SocketAddr, UdpSocket};
use std::thread;
use std::time::{Duration, Instant};

use sinew_host::import::read_bvh;
use sinew_host::live::replay::{Faults, Network, Performer};
use sinew_host::live::session::{Receiver, VmcSession};
use sinew_host::live::{points, vmc};
use sinew_host::model::Motion;
use sinew_host::reference::unpack;
use sinew_tests::{Random, human, root};

const RATE: f64 = 120.0;

fn walk() -> Motion {
    let bytes = std::fs::read(root().join("examples/data/walk.bvh")).expect("walk.bvh");
    let raw = read_bvh(&bytes, "walk.bvh").expect("a motion");
    Motion::new(raw, "walk.bvh").expect("a sound motion").0
}

/// Sends `seconds` of the walk from a thread of its own.
fn send(to: SocketAddr, seconds: f64, faults: Faults) -> thread::JoinHandle<usize> {
    let performer = Performer::new(&walk()).expect("a human's motion");
    thread::spawn(move || {
        let socket = UdpSocket::bind(("127.0.0.1", 0)).expect("a socket");
        let mut network = Network::new(faults, 5);
        let began = Instant::now();
        let frames = (seconds * RATE) as u32;
        let mut sent = 0;
        for frame in 0..frames {
            let due = f64::from(frame) / RATE;
            thread::sleep(Duration::from_secs_f64(due).saturating_sub(began.elapsed()));
            for datagram in network.send(vmc::write(&performer.packet(due))) {
                sent += usize::from(socket.send_to(&datagram, to).is_ok());
            }
        }
        sent
    })
}

fn session(record: bool) -> VmcSession {
    let receiver = Receiver::bind(([127, 0, 0, 1], 0).into()).expect("a port");
    let asset = human::asset();
    let body = unpack(&asset.asset().expect("sound"));
    VmcSession::new(receiver, body.skeleton, Vec::new(), record)
}

#[test]
fn a_lossy_stream_moves_the_body_and_is_recorded() {
    let mut session = session(true);
    let to = session.receiver.address().expect("an address");
    let faults = Faults {
        lost: 0.05,
        doubled: 0.05,
        swapped: 0.05,
    };
    let sender = send(to, 2.0, faults);
    let began = Instant::now();
    let mut poses = 0;
    while !sender.is_finished() || began.elapsed() < Duration::from_secs_f64(2.1) {
        let pose = session.pose(Duration::from_millis(20)).expect("follows");
        if let Some(pose) = pose {
            assert!(pose.iter().all(|joint| joint.rotation.is_normalized()));
            session.shown();
            poses += 1;
        }
    }
    let sent = sender.join().expect("sends");
    let tally = &session.receiver.tally;
    assert_eq!(tally.datagrams as usize, sent);
    assert_eq!((tally.malformed, tally.restarts), (0, 0));
    // Doubled datagrams and late ones are told apart from new ones.
    assert!(
        tally.more > 0 && tally.late > 0 && tally.lost > 0,
        "{tally:?}"
    );
    assert!(poses > 60, "{poses} poses of {tally:?}");

    let actor = session.actor().motion().expect("bound");
    let recording = session.recording().expect("asked for");
    let recorded = recording.motion(actor).expect("poses");
    assert_eq!(recorded.skeleton.joints.len(), 23);
    assert!((1.5..2.1).contains(&recorded.clip.duration));
    // The actor's hips are where the sender had them.
    let performer = Performer::new(&walk()).expect("a human's motion");
    let hips = recorded.skeleton.find("Hips").expect("hips");
    let local = sinew_host::reference::pose::sample(&recorded.skeleton, &recorded.clip, 0.0);
    let near = (0..240).any(|frame| {
        let packet = performer.packet(f64::from(frame) / RATE);
        packet.bones[0].1.position.distance(local[hips].translation) < 1e-6
    });
    assert!(near, "{:?}", local[hips]);
}

#[test]
fn hostile_datagrams_are_refused_or_read_and_never_end_the_program() {
    let performer = Performer::new(&walk()).expect("a human's motion");
    let packet = performer.packet(0.5);
    let sound = vmc::write(&packet);
    assert_eq!(vmc::read(&sound).expect("sound").bones.len(), 22);
    let frame = points::Frame {
        number: 1,
        microseconds: 2,
        points: vec![
            points::Point {
                marker: Some(1),
                position: [0.0; 3]
            };
            40
        ],
    };
    let sound_points = points::write(&frame).expect("fits");
    let mut random = Random(11);
    for round in 0..100_000_usize {
        let mut bytes = match round % 3 {
            0 => sound.clone(),
            1 => sound_points.clone(),
            _ => (0..random.below(200))
                .map(|_| random.bits() as u8)
                .collect(),
        };
        for _ in 0..=random.below(6) {
            if !bytes.is_empty() {
                let at = random.below(bytes.len());
                bytes[at] = random.bits() as u8;
            }
        }
        bytes.truncate(random.below(bytes.len() + 1).max(bytes.len() * (round % 2)));
        if let Ok(found) = vmc::read(&bytes) {
            let finite = found.bones.iter().all(|(bone, placed)| {
                *bone < vmc::BONES.len()
                    && placed.position.is_finite()
                    && placed.rotation.is_normalized()
            });
            assert!(finite, "round {round}");
        }
        if let Ok(found) = points::read(&bytes) {
            let mut numbers = found.points.iter().flat_map(|point| point.position);
            assert!(numbers.all(f32::is_finite), "round {round}");
        }
    }
}

#[test]
fn a_flood_of_malformed_datagrams_is_counted() {
    let mut session = session(false);
    let to = session.receiver.address().expect("an address");
    let socket = UdpSocket::bind(("127.0.0.1", 0)).expect("a socket");
    for _ in 0..50 {
        socket.send_to(b"no bundle", to).expect("sends");
    }
    while session.receiver.tally.datagrams < 50 {
        let pose = session.pose(Duration::from_millis(200)).expect("goes on");
        assert_eq!(pose, None);
    }
    assert_eq!(session.receiver.tally.malformed, 50);
    assert!(session.receiver.last_error.is_some());
}
