//! Damaged marker files: a typed error or a take, never a panic, never memory beyond the file's.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use sinew_host::export::{c3d::write_c3d, marker_csv::write_marker_csv, trc::write_trc};
use sinew_host::import::take::{RawEvent, RawTake, TakeOptions};
use sinew_host::import::{ImportError, c3d, marker_csv, motive_csv, trc};
use sinew_host::take::Take;

/// Counts the bytes that each thread allocates.
struct Counting;

thread_local! {
    static ALLOCATED: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATED.try_with(|sum| sum.set(sum.get().saturating_add(layout.size())));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let _ = ALLOCATED.try_with(|sum| sum.set(sum.get().saturating_add(size)));
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

type Parse = fn(&[u8], &str, &TakeOptions) -> Result<RawTake, ImportError>;

/// Reads `bytes` and checks everything that must hold whatever they are; true if there is a take.
fn survive(parse: Parse, bytes: &[u8]) -> bool {
    ALLOCATED.with(|sum| sum.set(0));
    let result = parse(bytes, "damaged", &TakeOptions::default());
    let allocated = ALLOCATED.with(Cell::get);
    assert!(
        allocated < 200 * bytes.len() + (1 << 20),
        "{allocated} bytes for {}",
        bytes.len()
    );
    match result {
        Ok(raw) => {
            assert_eq!(raw.positions.len(), raw.point_count() * raw.frame_count);
            assert_eq!(raw.kinds.len(), raw.point_count());
            assert!(raw.rate.is_finite() && raw.rate > 0.0);
            assert!(
                !raw.positions
                    .iter()
                    .flatten()
                    .any(|value| value.is_infinite())
            );
            let (take, _) = Take::from_raw(&raw).unwrap();
            assert!(take.marker_count() <= raw.point_count());
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with("damaged") && text.contains("; "), "{text}");
            false
        }
    }
}

/// A small sequence of numbers that look random (Marsaglia 2003, xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % limit as u64) as usize
    }
}

/// Truncates at every `step`-th length, then flips, replaces, cuts out and doubles bytes.
fn damage(parse: Parse, bytes: &[u8], step: usize, rounds: usize) {
    assert!(survive(parse, bytes), "the undamaged file is read");
    for len in (0..bytes.len()).step_by(step) {
        survive(parse, &bytes[..len]);
    }
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut read = 0;
    for round in 0..rounds {
        let mut damaged = bytes.to_vec();
        for _ in 0..=round % 6 {
            let at = random.below(damaged.len());
            match random.below(8) {
                0..=3 => damaged[at] ^= 1 << random.below(8),
                4 => damaged[at] = [0, 1, 127, 128, 255][random.below(5)],
                5 => damaged[at] = b"0123456789eE+-.,;\t\n\"# NaxyzXYZ"[random.below(30)],
                6 => drop(
                    damaged.drain(at..(at + 1 + random.below(20)).min(bytes.len() - 40).max(at)),
                ),
                _ => {
                    let part = damaged[at..(at + 1 + random.below(20)).min(damaged.len())].to_vec();
                    damaged.splice(at..at, part);
                }
            }
        }
        read += usize::from(survive(parse, &damaged));
    }
    eprintln!("{read} of {rounds} damaged files still hold a take");
    assert!(read > 0, "damage is small enough to get past the header");
}

fn small() -> RawTake {
    let text = "# unit: mm, up: +Z, rate: 100\nA_x,A_y,A_z,S:B_x,S:B_y,S:B_z,*3_x,*3_y,*3_z\n\
        1.5,2,900,4,5,1600,,,\n1,2.25,901,,,,7,8,1000\n1,2,902,4,5,1602,7,8.125,1003\n1,2,903,4,5,1603,7,8,1004\n";
    let mut take = marker_csv::parse(text.as_bytes(), "made", &TakeOptions::default()).unwrap();
    take.events.push(RawEvent {
        label: "Foot Strike".into(),
        context: "Left".into(),
        seconds: 0.5,
    });
    take
}

#[test]
fn damaged_c3d() {
    let mut bytes = Vec::new();
    write_c3d(&small(), &mut bytes).unwrap();
    damage(c3d::parse, &bytes, 1, 20_000);
    // What is left of a cut file is the beginning of the whole one.
    let whole = c3d::parse(&bytes, "whole", &TakeOptions::default()).unwrap();
    let mut read = 0;
    for len in 0..bytes.len() {
        let Ok(part) = c3d::parse(&bytes[..len], "part", &TakeOptions::default()) else {
            continue;
        };
        assert_eq!(part.labels, whole.labels, "{len}");
        let bits = |take: &RawTake, count: usize| -> Vec<u64> {
            let values = take.positions[..count].iter().flatten();
            values.map(|value| value.to_bits()).collect()
        };
        let count = part.positions.len();
        assert!(
            count > 0 && bits(&part, count) == bits(&whole, count),
            "{len}"
        );
        read += 1;
    }
    assert!(read > 100, "{read}");
    // Damage only where the structure is: header and parameters.
    let mut random = Random(7);
    for _ in 0..20_000 {
        let mut damaged = bytes.clone();
        for _ in 0..1 + random.below(3) {
            let at = if random.below(3) == 0 {
                random.below(24)
            } else {
                512 + random.below(700)
            };
            damaged[at] = random.below(256) as u8;
        }
        survive(c3d::parse, &damaged);
    }
}

#[test]
fn damaged_trc() {
    let mut bytes = Vec::new();
    write_trc(&small(), "a.trc", &mut bytes).unwrap();
    damage(trc::parse, &bytes, 1, 10_000);
}

#[test]
fn damaged_marker_csv() {
    let mut bytes = Vec::new();
    write_marker_csv(&small(), &mut bytes).unwrap();
    damage(marker_csv::parse, &bytes, 1, 10_000);
}

#[test]
fn damaged_motive_csv() {
    let text = "Format Version,1.23,Take Name,a,Export Frame Rate,120,Total Exported Frames,3,\
        Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global\n\n\
        ,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker\n\
        ,Name,B,B,B,B,B,B,B,B,B:1,B:1,B:1\n,ID,\"1\",\"1\",\"1\",\"1\",\"1\",\"1\",\"1\",\"1\",\"2\",\"2\",\"2\"\n\
        ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position,Position,Position\n\
        Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z\n\
        0,0.0,0,0,0,1,1,2,3,0.001,4,5,6\n1,0.008333,0,0,0,1,1,2,3,0.001,,,\n2,0.016667,,,,,,,,,4,5,6\n";
    damage(motive_csv::parse, text.as_bytes(), 1, 10_000);
}

#[test]
fn huge_counts_in_small_files() {
    let mut bytes = Vec::new();
    write_c3d(&small(), &mut bytes).unwrap();
    for (offset, value) in [
        (2, 65_535u16),
        (4, 65_535),
        (8, 65_535),
        (16, 65_535),
        (16, 0),
    ] {
        let mut damaged = bytes.clone();
        damaged[offset..offset + 2].copy_from_slice(&value.to_le_bytes());
        survive(c3d::parse, &damaged);
    }
    let mut text = Vec::new();
    write_trc(&small(), "a.trc", &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    for (from, to) in [
        ("\t4\t3\tmm", "\t999999999999\t3\tmm"),
        ("\t4\t3\tmm", "\t4\t999999999\tmm"),
        ("\n4\t", "\n4000000000\t"),
    ] {
        assert!(text.contains(from), "{from:?}");
        survive(trc::parse, text.replacen(from, to, 1).as_bytes());
    }
}
