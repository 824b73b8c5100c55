//! Scans through the `sinew` command: markers, templates, marker files, faults.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

mod command;

use command::{Folder, object, sinew, words};
use glam::{DQuat, DVec3};

/// What a command that must fail on its data says.
fn refused(arguments: &[&str]) -> String {
    let output = sinew(arguments);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output));
    words(&output)
}

const RINGS: usize = 31;
const SIDES: usize = 12;

/// An arm of 0.6 m along x, thicker at the shoulder, with a thumb's bump so that it has a front.
fn arm() -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let angle = std::f64::consts::TAU * side as f64 / SIDES as f64;
            let along = ring as f64 / (RINGS - 1) as f64;
            let bump = if ring > 24 && side < 2 { 0.03 } else { 0.0 };
            let radius = 0.06 - 0.025 * along + bump;
            positions.push(DVec3::new(
                0.6 * along,
                1.0 + radius * angle.cos(),
                radius * angle.sin(),
            ));
            if ring + 1 < RINGS {
                let (low, next) = (ring * SIDES + side, ring * SIDES + (side + 1) % SIDES);
                triangles.push([low, next, next + SIDES]);
                triangles.push([low, next + SIDES, low + SIDES]);
            }
        }
    }
    (positions, triangles)
}

fn obj(positions: &[DVec3], triangles: &[[usize; 3]]) -> String {
    let mut text = String::new();
    for p in positions {
        let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
    }
    for [a, b, c] in triangles.iter().map(|t| t.map(|v| v + 1)) {
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    text
}

/// The elbow bends by `angle` in the middle.
fn bent(p: DVec3, angle: f64) -> DVec3 {
    let elbow = DVec3::new(0.3, 1.0, 0.0);
    let share = ((p.x - 0.24) / 0.12).clamp(0.0, 1.0);
    elbow + DQuat::from_rotation_z(share * angle) * (p - elbow)
}

/// A TRC of some of the arm's vertices, which start at rest and bend by 1.2 rad and back.
fn trc(vertices: &[usize], positions: &[DVec3], frames: usize) -> String {
    let names: Vec<String> = vertices.iter().map(|v| format!("M{v}")).collect();
    let count = vertices.len();
    let mut text = format!(
        "PathFileType\t4\t(X/Y/Z)\tarm.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\t\
         OrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t{frames}\t{count}\tm\t100\t1\t{frames}\n\
         Frame#\tTime\t{}\n\t\t{}\n\n",
        names.join("\t\t\t"),
        (1..=count)
            .map(|k| format!("X{k}\tY{k}\tZ{k}"))
            .collect::<Vec<_>>()
            .join("\t"),
    );
    for frame in 0..frames {
        let phase = frame as f64 / (frames - 1) as f64 * std::f64::consts::TAU;
        let angle = 0.6 * (1.0 - phase.cos());
        let _ = write!(text, "{}\t{:.4}", frame + 1, frame as f64 / 100.0);
        for &v in vertices {
            let p = bent(positions[v], angle);
            let _ = write!(text, "\t{:.6}\t{:.6}\t{:.6}", p.x, p.y, p.z);
        }
        text.push('\n');
    }
    text
}

fn markers() -> Vec<usize> {
    [0, 4, 8, 12, 14, 16, 18, 20, 24, 28, 30]
        .iter()
        .flat_map(|ring| [ring * SIDES, ring * SIDES + 4, ring * SIDES + 8])
        .collect()
}

#[test]
fn an_arm_follows_its_markers_and_verifies() {
    let folder = Folder::new("laplacian-arm");
    let (positions, triangles) = arm();
    let scan = folder.write("arm.obj", obj(&positions, &triangles));
    let take = folder.write("arm.trc", trc(&markers(), &positions, 101));
    let (asset, pairs, picture) = (
        folder.path("arm.sinew"),
        folder.path("pairs.txt"),
        folder.path("arm.png"),
    );
    for exact in [false, true] {
        let mut arguments = vec![
            "bake",
            "--mode",
            "laplacian",
            "--mesh",
            &scan,
            "--markers",
            &take,
            "--output",
            &asset,
            "--save-pairs",
            &pairs,
            "--picture",
            &picture,
            "--pose-frame",
            "0",
        ];
        if exact {
            arguments.push("--exact");
        }
        let baked = object(&arguments);
        assert_eq!(baked["laplacian"]["markers"], 33, "{baked:#}");
        assert_eq!(baked["laplacian"]["retargeted"], false);
        assert_eq!(baked["error"]["passed"], true, "{:#}", baked["error"]);
        assert!(fs::metadata(&picture).expect("a picture").len() > 10_000);
        object(&["verify", &asset]);
        let npy = folder.path("arm.npy");
        object(&["play", &asset, "--output", &npy]);
        let bytes = fs::read(&npy).expect("written");
        let numbers = &bytes[bytes.len() - 101 * positions.len() * 12..];
        let number =
            |at: usize| f32::from_le_bytes(numbers[4 * at..][..4].try_into().expect("four"));
        let mut sum = 0.0;
        for (v, p) in positions.iter().enumerate() {
            let at = 3 * (50 * positions.len() + v);
            let found = DVec3::new(
                number(at).into(),
                number(at + 1).into(),
                number(at + 2).into(),
            );
            sum += found.distance(bent(*p, 1.2));
        }
        let mean = sum / positions.len() as f64;
        // Rotations are fitted to markers 4 cm apart on a limb that bends within 12 cm.
        assert!(mean < 15e-3, "exact {exact}: {mean}");
    }
    // The marker file gives the same pairs back, and a person may drop a line.
    let text = fs::read_to_string(&pairs).expect("written");
    let fewer = text
        .lines()
        .filter(|line| !line.starts_with("M0,"))
        .collect::<Vec<_>>()
        .join("\n");
    let fewer = folder.write("fewer.txt", &fewer);
    let baked = object(&[
        "bake",
        "--mode",
        "laplacian",
        "--mesh",
        &scan,
        "--markers",
        &take,
        "--output",
        &asset,
        "--pairs",
        &fewer,
    ]);
    assert_eq!(baked["laplacian"]["markers"], 32);
}

#[test]
fn faults_of_scans_and_marker_files_are_named() {
    let folder = Folder::new("laplacian-faults");
    let (mut positions, mut triangles) = arm();
    let take = folder.write("arm.trc", trc(&markers(), &positions, 21));
    let first = positions.len();
    positions.extend([0.0, 0.02, 0.04].map(|x| DVec3::new(0.3 + x, 1.1, x * x)));
    triangles.push([first, first + 1, first + 2]);
    let scan = folder.write("loose.obj", obj(&positions, &triangles));
    let asset = folder.path("out.sinew");
    let bake = |more: &[&str]| {
        let common = [
            "bake",
            "--mode",
            "laplacian",
            "--mesh",
            &scan,
            "--output",
            &asset,
        ];
        [&common, more]
            .concat()
            .into_iter()
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    fn strs(arguments: &[String]) -> Vec<&str> {
        arguments.iter().map(String::as_str).collect()
    }
    let said = refused(&strs(&bake(&["--markers", &take, "--pose-frame", "0"])));
    assert!(
        said.contains("3 vertices from vertex 372 on") && said.contains("--attach"),
        "{said}"
    );
    assert!(!Path::new(&asset).exists());
    let attached = object(&strs(&bake(&[
        "--markers",
        &take,
        "--pose-frame",
        "0",
        "--attach",
    ])));
    assert_eq!(attached["laplacian"]["attached_components"], 1);
    let dusted = object(&strs(&bake(&[
        "--markers",
        &take,
        "--pose-frame",
        "0",
        "--dust",
        "10",
    ])));
    assert_eq!(dusted["vertices"], positions.len());
    let bad = folder.write(
        "bad.txt",
        "marker,vertex,x,y,z\nM0,0,0,0,0\nM99999,3,0,0,0\n",
    );
    let said = refused(&strs(&bake(&["--markers", &take, "--pairs", &bad])));
    assert!(said.contains("line 3") && said.contains("M99999"), "{said}");
    let usage = sinew(&strs(&bake(&[])));
    assert_eq!(usage.status.code(), Some(2), "{}", words(&usage));
}

#[test]
fn a_folder_of_meshes_is_a_template() {
    let folder = Folder::new("laplacian-sequence");
    let (positions, triangles) = arm();
    let scan = folder.write("arm.obj", obj(&positions, &triangles));
    fs::create_dir(folder.path("frames")).expect("a folder");
    for frame in 0..30 {
        let angle = 1.2 * f64::from(frame) / 29.0;
        let posed: Vec<DVec3> = positions.iter().map(|p| bent(*p, angle)).collect();
        folder.write(&format!("frames/{frame:03}.obj"), obj(&posed, &triangles));
    }
    let (frames, asset) = (folder.path("frames"), folder.path("arm.sinew"));
    let baked = object(&[
        "bake",
        "--mode",
        "laplacian",
        "--mesh",
        &scan,
        "--template",
        &frames,
        "--output",
        &asset,
        "--marker-count",
        "30",
        "--pose-frame",
        "0",
    ]);
    assert_eq!(baked["laplacian"]["markers"], 30);
    assert!(
        baked["laplacian"]["marker_misfit_mm"]
            .as_f64()
            .expect("a number")
            < 0.1
    );
}
