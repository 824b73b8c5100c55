use std::num::NonZeroUsize;

use glam::DVec3;

use super::*;

const RED: Rgb = [220, 30, 20];
const BLUE: Rgb = [20, 60, 220];

/// Looks from z = 2 at the origin; the picture shows x and y from -1 to 1 at z = 0.
fn front() -> Camera {
    Camera {
        eye: DVec3::new(0.0, 0.0, 2.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        vertical_fov: 2.0 * 0.5f64.atan(),
    }
}

/// Corners of an upright rectangle.
fn rectangle(low: [f32; 2], high: [f32; 2], z: f32) -> [[f32; 3]; 4] {
    let [left, bottom] = low;
    let [right, top] = high;
    [
        [left, bottom, z],
        [right, bottom, z],
        [right, top, z],
        [left, top, z],
    ]
}

const TWO: &[[u32; 3]] = &[[0, 1, 2], [0, 2, 3]];

fn mesh<'a>(positions: &'a [[f32; 3]], triangles: &'a [[u32; 3]], color: Rgb) -> Mesh<'a> {
    Mesh {
        positions,
        normals: None,
        triangles,
        colors: Colors::Uniform(color),
    }
}

fn without_floor(meshes: Vec<Mesh>) -> Scene {
    Scene {
        meshes,
        floor: None,
        ..Scene::default()
    }
}

/// `R`, `B` or `.` for reddish, bluish and other pixels.
fn hue(image: &Image, x: usize, y: usize) -> char {
    let [r, g, b] = image.pixel(x, y).map(i32::from);
    match () {
        () if r > g + 40 && r > b + 40 => 'R',
        () if b > g + 40 && b > r + 40 => 'B',
        () => '.',
    }
}

fn hues(image: &Image) -> String {
    let row = |y| {
        (0..image.width)
            .map(|x| hue(image, x, y))
            .collect::<String>()
    };
    (0..image.height)
        .map(row)
        .collect::<Vec<String>>()
        .join("/")
}

#[test]
fn a_rectangle_covers_its_pixels() {
    // Of eight pixels across 2 m: columns 2 to 4, rows 1 to 5.
    let corners = rectangle([-0.5, -0.5], [0.25, 0.75], 0.0);
    let scene = without_floor(vec![mesh(&corners, TWO, RED)]);
    for quality in [Quality::Draft, Quality::Good, Quality::Best] {
        let image = render(&scene, &front(), 8, 8, quality);
        let inside = "..RRR...";
        let expected = [
            "........", inside, inside, inside, inside, inside, "........", "........",
        ];
        assert_eq!(hues(&image), expected.join("/"), "{quality:?}");
    }
}

#[test]
fn a_half_covered_pixel_is_half_as_bright() {
    // The right edge runs through the middle of a pixel; so four times as many samples agree.
    let black = rectangle([-1.0, -1.0], [0.125, 1.0], 0.0);
    let scene = without_floor(vec![mesh(&black, TWO, [0; 3])]);
    let good = render(&scene, &front(), 8, 8, Quality::Good);
    let best = render(&scene, &front(), 8, 8, Quality::Best);
    let background = f64::from(good.pixel(6, 4)[0]);
    let half = f64::from(good.pixel(4, 4)[0]);
    // Half the light is 0.735 of the sRGB value; the black surface still has a little gloss.
    assert!(
        (half / background - 0.735).abs() < 0.05,
        "{half} of {background}"
    );
    assert!(good.pixel(4, 4)[0].abs_diff(best.pixel(4, 4)[0]) <= 2);
}

#[test]
fn the_nearer_surface_wins_in_any_order() {
    let near = rectangle([-0.5, -1.0], [0.5, 1.0], 0.3);
    let far = rectangle([-2.0, -2.0], [2.0, 2.0], -0.2);
    let meshes = [mesh(&near, TWO, RED), mesh(&far, TWO, BLUE)];
    let one = render(
        &without_floor(meshes.to_vec()),
        &front(),
        8,
        8,
        Quality::Draft,
    );
    let reversed = meshes.iter().rev().copied().collect();
    let other = render(&without_floor(reversed), &front(), 8, 8, Quality::Draft);
    assert_eq!(one, other);
    assert!(hues(&one).starts_with("BBRRRRBB/"), "{}", hues(&one));
}

#[test]
fn what_passes_the_eye_is_cut_at_the_near_plane() {
    // A strip 1 m below the eye from far ahead to far behind: it fills the lower half, sample by
    // sample, and its part behind the eye does not show in the upper half.
    let strip = [
        [-1e4, -1.0, -1e4],
        [1e4, -1.0, -1e4],
        [1e4, -1.0, 1e4],
        [-1e4, -1.0, 1e4],
    ];
    let scene = without_floor(vec![mesh(&strip, TWO, RED)]);
    let image = render(&scene, &front(), 16, 16, Quality::Good);
    let upper = "................";
    let lower = "RRRRRRRRRRRRRRRR";
    let rows = hues(&image);
    let rows: Vec<&str> = rows.split('/').collect();
    assert_eq!(rows[..8], [upper; 8]);
    assert_eq!(rows[8..], [lower; 8]);

    // One corner behind the eye and to the side.
    let slanted = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.2, 0.1, 3.0]];
    let scene = without_floor(vec![mesh(&slanted, &[[0, 1, 2]], RED)]);
    let image = render(&scene, &front(), 16, 16, Quality::Good);
    assert!(hues(&image).contains('R'));
}

#[test]
fn pixels_do_not_depend_on_threads_or_winding() {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for k in 0..40u32 {
        let angle = k as f32 * 0.7;
        positions.push([angle.cos() * 0.6, k as f32 * 0.02, angle.sin() * 0.6]);
        if k >= 2 {
            triangles.push([k - 2, k - 1, k]);
        }
    }
    let normals: Vec<[f32; 3]> = positions.iter().map(|&[x, _, z]| [x, 0.2, z]).collect();
    let mut surface = mesh(&positions, &triangles, [200, 180, 160]);
    surface.normals = Some(&normals);
    let scene = Scene {
        meshes: vec![surface],
        points: vec![Points {
            positions: &positions,
            radius: 0.03,
            colors: Colors::Uniform(RED),
            occluded_opacity: 0.3,
        }],
        ..Scene::default()
    };
    let camera = Camera::framing(scene.bounds(), 0.4, 0.3, 1.5);
    let draw = |scene: &Scene, threads| {
        render_on(
            NonZeroUsize::new(threads).unwrap(),
            scene,
            &camera,
            150,
            100,
            Quality::Good,
        )
    };
    let one = draw(&scene, 1);
    for threads in [2, 3, 16] {
        assert!(one == draw(&scene, threads), "{threads} threads");
    }
    let turned: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let mut other = scene.clone();
    other.meshes[0].triangles = &turned;
    let turned = draw(&other, 1);
    let differing = one
        .rgb
        .iter()
        .zip(&turned.rgb)
        .filter(|(a, b)| a.abs_diff(**b) > 2)
        .count();
    assert_eq!(differing, 0, "the winding only decides rounding");
}

#[test]
fn broken_meshes_are_left_out() {
    let good = rectangle([-0.5, -0.5], [0.5, 0.5], 0.0);
    let mut positions = good.to_vec();
    positions.extend([
        [f32::NAN, 0.0, 0.0],
        [f32::INFINITY, 0.0, 0.0],
        [1e38, -1e38, 1e38],
    ]);
    let triangles = [
        [0, 1, 2],
        [0, 2, 3],
        [0, 1, 4],
        [1, 5, 2],
        [0, 0, 0],
        [0, 1, 1],
        [0, 1, 99],
        [u32::MAX; 3],
    ];
    let normals = [[f32::NAN; 3], [0.0; 3]];
    let mut broken = mesh(&positions, &triangles, RED);
    let camera = front();
    let whole = without_floor(vec![mesh(&good, TWO, RED)]);
    let expected = render(&whole, &camera, 20, 20, Quality::Draft);
    let image = render(
        &without_floor(vec![broken]),
        &camera,
        20,
        20,
        Quality::Draft,
    );
    assert_eq!(hues(&image), hues(&expected));

    broken.normals = Some(&normals);
    broken.colors = Colors::PerVertex(&[]);
    let scene = Scene {
        meshes: vec![broken, mesh(&[], &[], RED), mesh(&[], TWO, RED)],
        points: vec![Points {
            positions: &positions,
            radius: f32::NAN,
            colors: Colors::PerVertex(&[]),
            occluded_opacity: f32::NAN,
        }],
        lines: vec![Lines {
            segments: &[
                [[0.0; 3], [f32::NAN; 3]],
                [[0.0; 3], [1e38; 3]],
                [[0.0, 0.0, 9.0]; 2],
            ],
            radius: 1e30,
            colors: Colors::Uniform(RED),
            occluded_opacity: 2.0,
        }],
        floor: Some(Floor { height: f32::NAN }),
        key_light: Some([0.0; 3]),
    };
    for (width, height) in [(0, 0), (0, 5), (1, 1), (3, 50), (70, 2)] {
        let image = render(&scene, &camera, width, height, Quality::Good);
        assert_eq!(image.rgb.len(), width * height * 3);
    }
    let nowhere = Camera {
        eye: DVec3::NAN,
        ..camera
    };
    let _ = render(&scene, &nowhere, 8, 8, Quality::Draft);
    let far = Camera {
        eye: DVec3::splat(1e300),
        ..camera
    };
    let _ = render(&scene, &far, 8, 8, Quality::Draft);
    let inside = Camera {
        eye: camera.target,
        ..camera
    };
    let _ = render(&scene, &inside, 8, 8, Quality::Draft);
}

#[test]
fn triangles_have_their_own_colours_and_vertices_mix_theirs() {
    let corners = rectangle([-1.0, -1.0], [1.0, 1.0], 0.0);
    let mut parts = mesh(&corners, TWO, RED);
    parts.colors = Colors::PerTriangle(&[RED, BLUE]);
    let image = render(&without_floor(vec![parts]), &front(), 8, 8, Quality::Draft);
    assert_eq!((hue(&image, 6, 6), hue(&image, 1, 1)), ('R', 'B'));
    let mut mixed = mesh(&corners, TWO, RED);
    mixed.colors = Colors::PerVertex(&[RED, BLUE, BLUE, RED]);
    let image = render(&without_floor(vec![mixed]), &front(), 8, 8, Quality::Draft);
    assert!(
        hues(&image)
            .split('/')
            .all(|row| row.starts_with("RR") && row.ends_with("BB"))
    );
    let [red, _, blue] = image.pixel(4, 4);
    assert!(red.abs_diff(blue) < 40, "about half of each: {red} {blue}");
}

#[test]
fn markers_show_through_as_much_as_asked() {
    let wall = rectangle([-1.0, -1.0], [0.0, 1.0], 0.5);
    let behind = [[-0.3, 0.0, 0.0], [0.3, 0.0, 0.0]];
    let picture = |occluded_opacity| {
        let scene = Scene {
            points: vec![Points {
                positions: &behind,
                radius: 0.15,
                colors: Colors::Uniform(RED),
                occluded_opacity,
            }],
            ..without_floor(vec![mesh(&wall, TWO, [200; 3])])
        };
        render(&scene, &front(), 40, 40, Quality::Good)
    };
    let redness = |image: &Image, x| {
        let [r, _, b] = image.pixel(x, 20);
        i32::from(r) - i32::from(b)
    };
    let (hidden, faint, full) = (picture(0.0), picture(0.5), picture(1.0));
    assert!(redness(&hidden, 14) < 20 && redness(&hidden, 26) > 80);
    assert!(redness(&faint, 14) > redness(&hidden, 14) + 20);
    assert!(redness(&full, 14) > redness(&faint, 14) + 20);
}

#[test]
fn lines_join_their_ends_and_are_never_thinner_than_a_pixel() {
    let segments = [
        [[-0.5, 0.01, 0.0], [0.5, 0.01, 0.0]],
        [[0.0, -0.9, 0.0], [0.0, -0.9, 0.0]],
    ];
    let scene = Scene {
        lines: vec![Lines {
            segments: &segments,
            radius: 1e-6,
            colors: Colors::PerVertex(&[RED, BLUE]),
            occluded_opacity: 0.0,
        }],
        ..without_floor(Vec::new())
    };
    let image = render(&scene, &front(), 41, 41, Quality::Good);
    for x in 11..30 {
        assert_eq!(hue(&image, x, 20), 'R', "{x}");
    }
    assert_eq!((hue(&image, 5, 20), hue(&image, 35, 20)), ('.', '.'));
    assert_eq!(hue(&image, 20, 38), 'B');
}

#[test]
fn the_floor_hides_what_is_below_and_carries_the_shadow() {
    let board = [
        [-0.3, 0.15, -0.3],
        [0.3, 0.15, -0.3],
        [0.3, 0.15, 0.3],
        [-0.3, 0.15, 0.3],
    ];
    let camera = Camera {
        eye: DVec3::new(0.0, 2.0, 2.0),
        target: DVec3::new(0.0, 0.0, 0.0),
        up: DVec3::Y,
        vertical_fov: 0.8,
    };
    let draw = |height: f32, camera: &Camera| {
        let scene = Scene {
            meshes: vec![mesh(&board, TWO, RED)],
            floor: Some(Floor { height }),
            ..Scene::default()
        };
        render(&scene, camera, 64, 64, Quality::Good)
    };
    let above = draw(0.0, &camera);
    let sunk = draw(0.2, &camera);
    assert_eq!(hue(&above, 32, 32), 'R');
    assert!(!hues(&sunk).contains('R'), "hidden");
    let from_below = Camera {
        eye: DVec3::new(0.0, -2.0, 2.0),
        ..camera
    };
    assert_eq!(
        hue(&draw(0.2, &from_below), 32, 32),
        'R',
        "the floor is not there from below"
    );

    // The light comes from the left: just right of the board the floor is darker.
    let empty = render(&Scene::default(), &camera, 64, 64, Quality::Good);
    let right = (0..64).rfind(|&x| hue(&above, x, 32) == 'R').unwrap() + 2;
    assert!(above.pixel(right, 32)[0] + 15 < empty.pixel(right, 32)[0]);
    assert!(above.pixel(1, 60)[0].abs_diff(empty.pixel(1, 60)[0]) <= 1);
}

#[test]
fn a_roof_shades_the_wall_behind_it() {
    let wall = rectangle([-1.0, -1.0], [1.0, 1.0], 0.0);
    let roof = [
        [-1.0, 0.5, 0.0],
        [1.0, 0.5, 0.0],
        [1.0, 0.5, 0.6],
        [-1.0, 0.5, 0.6],
    ];
    let light = Some([0.0, 1.0, 1.0]);
    let lit = Scene {
        key_light: light,
        ..without_floor(vec![mesh(&wall, TWO, [200; 3])])
    };
    let mut shaded = lit.clone();
    shaded.meshes.push(mesh(&roof, TWO, [200; 3]));
    let [lit, shaded] = [lit, shaded].map(|scene| render(&scene, &front(), 40, 40, Quality::Good));
    // Light at 45 degrees: the shadow reaches 0.6 m below the roof, to y = -0.1 or row 22.
    assert!(shaded.pixel(20, 18)[0] + 30 < lit.pixel(20, 18)[0]);
    assert!(shaded.pixel(20, 26)[0].abs_diff(lit.pixel(20, 26)[0]) <= 1);
}
