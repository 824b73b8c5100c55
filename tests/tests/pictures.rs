//! Pictures of a real body: what must show shows where it must, and an animation stays small.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use sinew_host::export::gif::write_gif;
use sinew_host::export::npy::NpyWriter;
use sinew_host::export::plot::{Chart, Series, Style};
use sinew_host::export::png::{contact_sheet, write_png};
use sinew_host::export::render::{
    Camera, Colors, Image, Mesh, Points, Quality, Rgb, Scene, render, render_on, text,
};
use sinew_tests::{root, shared};

struct Body {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// The group `body` of the MakeHuman base mesh, in metres, standing on y = 0.
fn body() -> Option<Body> {
    let text = std::fs::read_to_string(shared("mesh/makehuman_base.obj")?).unwrap();
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let mut next = || words.next().unwrap().parse::<f32>().unwrap() * 0.1;
                positions.push([next(), next(), next()]);
            }
            Some("g") => inside = words.next() == Some("body"),
            Some("f") if inside => {
                let index =
                    |word: &str| word.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
                let corners: Vec<u32> = words.map(index).collect();
                triangles
                    .extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
            }
            _ => {}
        }
    }
    let count = triangles.as_flattened().iter().max().unwrap() + 1;
    positions.truncate(count as usize);
    let lowest = positions
        .iter()
        .map(|position| position[1])
        .fold(f32::INFINITY, f32::min);
    for position in &mut positions {
        position[1] -= lowest;
    }
    Some(Body {
        positions,
        triangles,
    })
}

impl Body {
    fn mesh<'a>(&'a self, colors: Colors<'a>) -> Mesh<'a> {
        Mesh {
            positions: &self.positions,
            normals: None,
            triangles: &self.triangles,
            colors,
        }
    }

    fn scene(&self) -> Scene<'_> {
        Scene {
            meshes: vec![self.mesh(Colors::Uniform([206, 180, 160]))],
            ..Scene::default()
        }
    }

    /// A walk on the spot: legs and arms swing about the x axis.
    fn swung(&self, phase: f32) -> Self {
        let mut positions = self.positions.clone();
        for [x, y, z] in &mut positions {
            let side = x.signum();
            let leg = ((0.85 - *y) / 0.3).clamp(0.0, 1.0);
            let arm = ((x.abs() - 0.17) / 0.12).clamp(0.0, 1.0) * (1.0 - leg);
            for (centre, angle) in [(0.85, 0.45 * leg), (1.35, -0.5 * arm)] {
                let (sin, cos) = (angle * side * phase.sin()).sin_cos();
                (*y, *z) = (
                    centre + (*y - centre) * cos - *z * sin,
                    (*y - centre) * sin + *z * cos,
                );
            }
        }
        Self {
            positions,
            triangles: self.triangles.clone(),
        }
    }
}

/// Rows, exclusive, that differ from the empty stage.
fn rows_shown(image: &Image, empty: &Image) -> std::ops::Range<usize> {
    let differs = |&y: &usize| {
        let row = y * image.width * 3..(y + 1) * image.width * 3;
        let pairs = image.rgb[row.clone()].iter().zip(&empty.rgb[row]);
        pairs.into_iter().any(|(a, b)| a.abs_diff(*b) > 12)
    };
    let first = (0..image.height).find(differs).unwrap();
    first..(0..image.height).rfind(differs).unwrap() + 1
}

#[test]
fn a_body_fills_the_frame_and_does_not_depend_on_threads() {
    let Some(body) = body() else { return };
    let scene = body.scene();
    let camera = Camera::framing(scene.bounds(), 0.5, 0.15, 1.0);
    let threads = |count| NonZeroUsize::new(count).unwrap();
    let image = render_on(threads(1), &scene, &camera, 200, 200, Quality::Good);
    assert!(image == render_on(threads(3), &scene, &camera, 200, 200, Quality::Good));

    let empty = render(&Scene::default(), &camera, 200, 200, Quality::Good);
    let rows = rows_shown(&image, &empty);
    assert!(rows.start > 4 && rows.end < 196, "{rows:?}");
    assert!(rows.len() > 160, "{rows:?}");
}

#[test]
fn an_animation_of_a_body_is_small() {
    let Some(body) = body() else { return };
    let frames: Vec<Body> = (0..12).map(|k| body.swung(k as f32 * 0.5)).collect();
    let bounds = frames.iter().map(|frame| frame.scene().bounds());
    let bounds = bounds.reduce(|one, other| one.union(other)).unwrap();
    let camera = Camera::framing(bounds, 0.6, 0.2, 1.0);
    let images: Vec<Image> = frames
        .iter()
        .map(|frame| render(&frame.scene(), &camera, 240, 240, Quality::Good))
        .collect();
    let path = std::env::temp_dir().join(format!("sinew-walk-{}.gif", std::process::id()));
    write_gif(&path, &images, 1.0 / 30.0).unwrap();
    let bytes = std::fs::metadata(&path).unwrap().len();
    std::fs::remove_file(&path).unwrap();
    // A frame has 57,600 pixels; a fifth of a byte for each is what 2.5 MB allow 90 at 360 x 360.
    assert!(bytes < 12 * 57_600 / 5, "{bytes} bytes");
}

/// Run with `cargo test -p sinew-tests --test pictures -- --ignored`, then look at `out/pictures`
/// and run `tests/python/check_export.py`.
#[test]
#[ignore = "writes pictures to look at"]
fn pictures_to_look_at() {
    let Some(body) = body() else { return };
    let folder = root().join("out/pictures");
    std::fs::create_dir_all(&folder).unwrap();
    let path = |name: &str| -> PathBuf { Path::new(&folder).join(name) };
    let scene = body.scene();
    let camera = Camera::framing(scene.bounds(), 0.5, 0.2, 1.0);
    let mut image = render(&scene, &camera, 640, 640, Quality::Best);
    text::caption(&mut image, "13,380 vertices, rest pose");
    write_png(path("body.png"), &image).unwrap();

    let heat = |&[_, y, _]: &[f32; 3]| -> Rgb {
        let t = (y / 1.7).clamp(0.0, 1.0);
        [
            (255.0 * t) as u8,
            (200.0 - 80.0 * t) as u8,
            (255.0 - 255.0 * t) as u8,
        ]
    };
    let heat: Vec<Rgb> = body.positions.iter().map(heat).collect();
    let markers: Vec<[f32; 3]> = body.positions.iter().step_by(60).copied().collect();
    let marked = Scene {
        meshes: vec![body.mesh(Colors::PerVertex(&heat))],
        points: vec![Points {
            positions: &markers,
            radius: 0.009,
            colors: Colors::Uniform([40, 40, 48]),
            occluded_opacity: 0.0,
        }],
        ..Scene::default()
    };
    let cells: Vec<Image> = (0..6)
        .map(|k| {
            let camera = Camera::framing(marked.bounds(), f64::from(k), 0.15, 0.75);
            render(&marked, &camera, 240, 320, Quality::Best)
        })
        .collect();
    let captions = ["0 rad", "1 rad", "2 rad", "3 rad", "4 rad", "5 rad"];
    write_png(path("sheet.png"), &contact_sheet(&cells, 3, &captions)).unwrap();

    let count = 90;
    let frames: Vec<Body> = (0..count)
        .map(|k| body.swung(k as f32 / count as f32 * std::f32::consts::TAU * 3.0))
        .collect();
    let bounds = frames.iter().map(|frame| frame.scene().bounds());
    let camera = Camera::framing(bounds.reduce(|a, b| a.union(b)).unwrap(), 0.6, 0.2, 1.0);
    let images: Vec<Image> = frames
        .iter()
        .map(|frame| render(&frame.scene(), &camera, 360, 360, Quality::Good))
        .collect();
    write_gif(path("walk.gif"), &images, 1.0 / 30.0).unwrap();
    write_png(path("walk_45.png"), &images[45]).unwrap();

    let mut array = NpyWriter::create(path("walk.npy"), &[count, body.positions.len(), 3]).unwrap();
    for frame in &frames {
        array.push(frame.positions.as_flattened()).unwrap();
    }
    array.finish().unwrap();

    let height = |frame: &Body| f64::from(frame.positions[0][1]);
    let points = frames
        .iter()
        .enumerate()
        .map(|(k, frame)| [k as f64 / 30.0, height(frame)]);
    let chart = Chart {
        title: "Height of vertex 0".into(),
        x_label: "Time (s)".into(),
        y_label: "m".into(),
        series: vec![Series::new("vertex 0", Style::Line, points.collect())],
        ..Chart::default()
    };
    write_png(path("chart.png"), &chart.render(900, 500)).unwrap();
}
