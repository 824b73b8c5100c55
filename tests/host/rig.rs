//! Bodies without a rig, and bodies in parts, through the `sinew` command.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

mod command;

use command::{Folder, object, sinew, words};

fn data(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/data");
    folder.join(name).display().to_string()
}

/// A tube along y from one height to another, open at both ends, as a group of an OBJ; vertices are
/// numbered from `first`.
fn tube(name: &str, low: f64, high: f64, first: usize) -> String {
    const SIDES: usize = 12;
    const RINGS: usize = 8;
    let mut text = format!("g {name}\n");
    for ring in 0..RINGS {
        let y = low + (high - low) * ring as f64 / (RINGS - 1) as f64;
        for side in 0..SIDES {
            let angle = std::f64::consts::TAU * side as f64 / SIDES as f64;
            let _ = writeln!(text, "v {} {y} {}", 0.05 * angle.sin(), 0.05 * angle.cos());
        }
    }
    for ring in 0..RINGS - 1 {
        for side in 0..SIDES {
            let [a, b] = [side, (side + 1) % SIDES].map(|s| first + ring * SIDES + s);
            let _ = writeln!(text, "f {a} {b} {} {}", b + SIDES, a + SIDES);
        }
    }
    text
}

fn parts() -> String {
    tube("shin", 0.0, 0.3, 1) + &tube("thigh", 0.33, 0.6, 97)
}

#[test]
fn a_body_gets_a_rig_and_an_asset() {
    let folder = Folder::new("rig");
    let output = folder.path("body.glb");
    let picture = folder.path("rig.png");
    let done = object(&[
        "rig",
        &data("human.glb"),
        "--skeleton",
        &data("walk.bvh"),
        "--influences",
        "3",
        "--picture",
        &picture,
        "--output",
        &output,
    ]);
    assert_eq!(done["joints"].as_array().map(Vec::len), Some(13));
    assert_eq!(done["vertices"], 13_380);
    assert!((done["height_m"].as_f64().expect("a height") - 1.73).abs() < 0.02);
    assert_eq!(&fs::read(&picture).expect("a picture")[1..4], b"PNG");
    let asset = folder.path("body.sinew");
    let baked = object(&[
        "bake",
        "--mesh",
        &output,
        "--motion",
        &data("walk.bvh"),
        "--output",
        &asset,
    ]);
    assert_eq!(
        (baked["joints"].clone(), baked["clips"].clone()),
        (13.into(), 1.into())
    );
    let again = folder.path("again.sinew");
    object(&[
        "bake",
        "--mesh",
        &data("human.glb"),
        "--auto-rig",
        "--motion",
        &data("walk.bvh"),
        "--output",
        &again,
    ]);
    assert!(fs::metadata(&again).is_ok());
}

#[test]
fn parts_become_one_body() {
    let folder = Folder::new("join");
    let cut = folder.write("cut.obj", parts());
    let output = folder.path("leg.glb");
    let done = object(&["join", &cut, "--output", &output]);
    assert_eq!(
        (done["parts"].clone(), done["open_borders"].clone()),
        (2.into(), 2.into())
    );
    assert_eq!(done["is_human"], false);
    let width = done["gaps"][0]["width_m"].as_f64().expect("a width");
    assert!((width - 0.03).abs() < 1e-9, "{width}");
    object(&["inspect", &output]);
}

#[test]
fn faults_are_named_and_nothing_is_written() {
    let folder = Folder::new("rig-faults");
    let output = folder.path("out.glb");
    let flat = folder.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let cut = folder.write("cut.obj", parts());
    let far = folder.write("far.obj", tube("a", 0.0, 0.3, 1) + &tube("b", 0.9, 1.2, 97));
    let one = folder.write("one.obj", tube("a", 0.0, 0.3, 1));
    let nan = folder.write("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
    let (walk, human) = (data("walk.bvh"), data("human.glb"));
    let hand = data("hand.glb");
    for (status, arguments, said) in [
        (
            2,
            vec!["rig", &cut, "--output", &output],
            "--skeleton is needed",
        ),
        (
            2,
            vec!["rig", &human, "--output", "out.obj"],
            "give a .glb to write",
        ),
        (
            2,
            vec!["rig", &human, "--skeleton", &cut, "--output", &output],
            "a skeleton is needed",
        ),
        (
            2,
            vec!["rig", &human, "--influences", "9", "--output", &output],
            "1..=8",
        ),
        (
            1,
            vec!["rig", &flat, "--skeleton", &walk, "--output", &output],
            "encloses nothing",
        ),
        (
            1,
            vec!["rig", &cut, "--skeleton", &walk, "--output", &output],
            "can be found in the mesh",
        ),
        (
            1,
            vec!["rig", &human, "--skeleton", &hand, "--output", &output],
            "no joint found for",
        ),
        (
            1,
            vec!["rig", &nan, "--skeleton", &walk, "--output", &output],
            "nan.obj",
        ),
        (
            1,
            vec!["rig", "none.obj", "--skeleton", &walk, "--output", &output],
            "none.obj",
        ),
        (
            1,
            vec!["join", &one, "--output", &output],
            "give one whose parts are groups",
        ),
        (
            1,
            vec!["join", &far, "--output", &output],
            "faces another part",
        ),
        (
            2,
            vec!["join", &far, "--gap=-1", "--output", &output],
            "--gap",
        ),
        (
            2,
            vec!["bake", "--mesh", &cut, "--auto-rig", "--output", &output],
            "give a --motion",
        ),
    ] {
        let done = sinew(&arguments);
        let words = words(&done);
        assert_eq!(done.status.code(), Some(status), "{arguments:?}: {words}");
        assert!(words.contains(said), "{arguments:?}: {words}");
        assert!(
            fs::metadata(&output).is_err(),
            "{arguments:?} wrote something"
        );
    }
}
