//! The `sinew` command as a user meets it: results, exit statuses, and nothing half-written.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

mod command;

use command::{Folder, object, sinew, words};
use serde_json::Value;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../examples/data")
        .join(name)
}

impl Folder {
    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).expect("readable");
        entries
            .map(|entry| {
                entry
                    .expect("an entry")
                    .file_name()
                    .to_string_lossy()
                    .into()
            })
            .collect()
    }
}

fn status(output: &Output) -> i32 {
    output.status.code().expect("ended by itself")
}

fn text(path: PathBuf) -> String {
    path.display().to_string()
}

#[test]
fn bake_verify_cost_and_play_agree() {
    let folder = Folder::new("way");
    let asset = folder.path("human.sinew");
    let (body, walk) = (text(data("human.glb")), text(data("walk.bvh")));
    let baked = object(&[
        "bake", "--mesh", &body, "--motion", &walk, "--output", &asset,
    ]);
    assert_eq!(baked["vertices"], 13380);
    assert!(
        baked["error"]["worst_error_mm"].as_f64().expect("a number") < 0.02,
        "{baked}"
    );
    let verified = object(&["verify", &asset]);
    assert_eq!(verified["passed"], true);
    assert_eq!(verified["fingerprint"], baked["error"]["fingerprint"]);
    assert_eq!(object(&["cost", &asset])["frame"], baked["cost"]["frame"]);
    let inspected = object(&["inspect", &asset]);
    assert_eq!(inspected["kind"], "asset");
    assert_eq!(inspected["clips"][0]["name"], "walk");

    let npy = folder.path("walk.npy");
    let played = object(&["play", &asset, "--output", &npy, "--rate", "5"]);
    let frames = played["frames"].as_u64().expect("a count");
    let bytes = fs::read(&npy).expect("written");
    assert_eq!(bytes.len() as u64 % 64, (frames * 13380 * 12) % 64);
    assert!(bytes.starts_with(b"\x93NUMPY"));

    // What is exported is a body again, with the clip.
    let glb = folder.path("walk.glb");
    object(&["play", &asset, "--output", &glb]);
    let again = object(&["inspect", &glb]);
    assert_eq!(again["vertices"], 13380);
    assert_eq!(again["clips"][0]["name"], "walk");

    let sheet = folder.path("walk.png");
    object(&["play", &asset, "--output", &sheet, "--size", "64"]);
    assert!(fs::read(&sheet).expect("written").starts_with(b"\x89PNG"));
    let gif = folder.path("walk.gif");
    object(&[
        "play", &asset, "--output", &gif, "--size", "48", "--rate", "5",
    ]);
    assert!(fs::read(&gif).expect("written").starts_with(b"GIF89a"));
    assert_eq!(
        folder.names().len(),
        5,
        "temporary files left: {:?}",
        folder.names()
    );
}

#[test]
fn a_simplified_body_plays_in_every_mode_and_at_every_level() {
    let folder = Folder::new("modes");
    let (body, walk) = (text(data("human.glb")), text(data("walk.bvh")));
    let asset = folder.path("small.sinew");
    let common = [
        "bake", "--mesh", &body, "--motion", &walk, "--output", &asset,
    ];
    let more = "--vertices 400 --levels 200 --influences 4 --quantise --centres";
    let more: Vec<&str> = more.split(' ').collect();
    let baked = object(&[&common[..], &more].concat());
    assert!(baked["vertices"].as_u64() <= Some(400));
    assert!(baked["packed"]["position_m"].as_f64() < Some(1e-4));
    assert!(baked["levels"][0]["vertices"].as_u64() <= Some(200));
    for mode in ["linear", "dual", "centres"] {
        let glb = folder.path("walk.glb");
        let arguments = [
            "play", &asset, "--mode", mode, "--level", "1", "--output", &glb,
        ];
        object(&[&arguments[..], &["--rate", "2", "--exact-normals"]].concat());
        let again = object(&["inspect", &glb]);
        assert_eq!(again["vertices"], baked["levels"][0]["vertices"]);
        let npy = folder.path("walk.npy");
        let arguments = ["play", &asset, "--mode", mode, "--output", &npy];
        object(&[&arguments[..], &["--rate", "2", "--blocks", "1000"]].concat());
    }
    let far = sinew(&[
        "play",
        &asset,
        "--level",
        "2",
        "--output",
        &folder.path("x.npy"),
    ]);
    assert_eq!(status(&far), 2);
    assert!(words(&far).contains("the asset holds 2"), "{}", words(&far));
}

#[test]
fn baking_twice_gives_the_same_bytes() {
    let folder = Folder::new("twice");
    let body = text(data("hand.glb"));
    let (one, two) = (folder.path("1.sinew"), folder.path("2.sinew"));
    object(&["bake", "--mesh", &body, "--output", &one]);
    object(&["bake", "--mesh", &body, "--output", &two]);
    assert_eq!(
        fs::read(one).expect("written"),
        fs::read(two).expect("written")
    );
}

#[test]
fn data_at_fault_ends_with_1_and_names_place_and_remedy() {
    let folder = Folder::new("fault");
    let walk = fs::read(data("walk.bvh")).expect("bundled");
    let walk = String::from_utf8(walk).expect("text");
    let glb = fs::read(data("hand.glb")).expect("bundled");
    let nan = walk.replacen("Frame Time:", "Frame Time: nan #", 1);
    let cases = [
        ("empty.bvh", Vec::new(), "empty"),
        ("garbage.bvh", vec![0x9C; 500], "garbage.bvh"),
        ("nan.bvh", nan.into_bytes(), "nan.bvh:"),
        ("open.bvh", walk.as_bytes()[..300].to_vec(), "open.bvh"),
        ("cut.glb", glb[..glb.len() / 2].to_vec(), "cut.glb"),
        ("short.glb", b"glTF".to_vec(), "short.glb"),
        ("bad.sinew", vec![7; 4096], "sinew bake"),
    ];
    for (name, bytes, expected) in cases {
        let file = folder.write(name, &bytes);
        let output = sinew(&["inspect", &file]);
        let said = words(&output);
        assert_eq!(status(&output), 1, "{name}: {said}");
        assert!(
            said.contains(expected) && said.contains("; "),
            "{name}: {said}"
        );
        assert!(!said.contains("panicked"), "{name}: {said}");
    }
    let output = sinew(&["inspect", &folder.path("absent.glb")]);
    assert_eq!(status(&output), 1);
    assert!(words(&output).contains("absent.glb"));
}

#[test]
fn a_failed_bake_leaves_an_older_output_alone() {
    let folder = Folder::new("older");
    let output = folder.write("body.sinew", b"precious");
    let broken = folder.write(
        "broken.glb",
        &fs::read(data("hand.glb")).expect("bundled")[..999],
    );
    let run = sinew(&["bake", "--mesh", &broken, "--output", &output]);
    assert_eq!(status(&run), 1);
    let body = text(data("hand.glb"));
    let nowhere = folder.path("no/such/folder/x.sinew");
    assert_eq!(
        status(&sinew(&["bake", "--mesh", &body, "--output", &nowhere])),
        1
    );
    assert_eq!(fs::read(&output).expect("still there"), b"precious");
    assert_eq!(folder.names().len(), 2, "{:?}", folder.names());
}

#[test]
fn wrong_usage_ends_with_2() {
    let folder = Folder::new("usage");
    let body = text(data("hand.glb"));
    let asset = folder.path("hand.sinew");
    object(&["bake", "--mesh", &body, "--output", &asset]);
    let odd = folder.write("notes.txt", b"hello");
    let motion = text(data("walk.bvh"));
    let out = folder.path("x.npy");
    for arguments in [
        vec!["nonsense"],
        vec!["bake", "--mesh", &body],
        vec!["inspect", &odd],
        vec!["bake", "--mesh", &motion, "--output", &out],
        vec!["play", &asset, "--output", &odd],
        vec!["play", &asset, "--clip", "7", "--output", &out],
        vec!["play", &asset, "--rate", "-3", "--output", &out],
        vec![
            "bake", "--mesh", &body, "--motion", &motion, "--map", "hips", "--output", &out,
        ],
    ] {
        let output = sinew(&arguments);
        assert_eq!(status(&output), 2, "{arguments:?}: {}", words(&output));
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn every_command_has_help_with_an_example() {
    for command in [
        "demo", "inspect", "bake", "play", "verify", "cost", "studio",
    ] {
        let output = sinew(&[command, "--help"]);
        let help = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(status(&output), 0);
        assert!(help.contains(&format!("sinew {command}")), "{help}");
    }
}

#[test]
fn studio_writes_a_capture_with_its_truth() {
    let folder = Folder::new("studio");
    let out = folder.path("capture");
    let (mesh, motion) = (text(data("human.glb")), text(data("walk.bvh")));
    let arguments = [
        "studio",
        "--mesh",
        &mesh,
        "--motion",
        &motion,
        "--out",
        &out,
        "--markers",
        "set41",
        "--cameras",
        "8",
        "--seconds",
        "0.5",
    ];
    let first = object(&arguments);
    assert_eq!(first["statistics"]["markers"], 41);
    assert_eq!(first["statistics"]["frames"], 61);
    assert_eq!(first, object(&arguments), "the same again");
    let description = fs::read(Path::new(&out).join("studio.json")).expect("written");
    let description: Value = serde_json::from_slice(&description).expect("JSON");
    assert_eq!(description["cameras"].as_array().map(Vec::len), Some(8));
    let truth = object(&["inspect", &format!("{out}/truth.c3d")]);
    assert!(truth.to_string().contains("LKNE"), "{truth}");
    for name in [
        "capture.c3d",
        "labelled.c3d",
        "markers.png",
        "cameras.png",
        "visible.png",
    ] {
        assert!(Path::new(&out).join(name).exists(), "{name}");
    }
    let mut many = arguments;
    many[10] = "99";
    let refused = sinew(&many);
    assert_eq!(status(&refused), 1, "{}", words(&refused));
    assert!(
        words(&refused).contains("between 2 and 32"),
        "{}",
        words(&refused)
    );
}
