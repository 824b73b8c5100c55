//! Draws one frame of the asset's first clip into a framebuffer, as a firmware with a display would,
//! and writes that to a PNG file on the machine that emulates the board.
//!
//! Triangles are drawn from the farthest to the nearest, so no depth buffer is needed; the light
//! comes from the viewer.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hio};
use embedded_graphics::framebuffer::{Framebuffer, buffer_size};
use embedded_graphics::image::GetPixel;
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::{LittleEndian, RawU16};
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Line, PrimitiveStyle, Triangle};
use sinew_core::asset::{Asset, Dims};
use sinew_core::deform::Output;
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, state_len, workspace_len};
use sinew_cortex_m::{ASSET, png};

const DIMS: Dims = Dims::of(ASSET);
const WIDTH: usize = 240;
const HEIGHT: usize = 320;
/// Seconds into the clip.
const SECONDS: f32 = 0.4;
/// Pixels a metre, and where the origin of the floor lies.
const SCALE: f32 = 150.0;
const FLOOR: [f32; 2] = [120.0, 296.0];

type Picture = Framebuffer<
    Rgb565,
    RawU16,
    LittleEndian,
    WIDTH,
    HEIGHT,
    { buffer_size::<Rgb565>(WIDTH, HEIGHT) },
>;

#[entry]
fn main() -> ! {
    static mut STATE: State<[f32; state_len(&DIMS)]> = State::new();
    static mut WORKSPACE: Workspace<[f32; workspace_len(&DIMS)]> = Workspace::new();
    static mut POSITIONS: [f32; 3 * DIMS.vertex_count] = [0.0; 3 * DIMS.vertex_count];
    static mut NEAR: [(f32, u32); DIMS.triangle_count] = [(0.0, 0); DIMS.triangle_count];
    static mut PICTURE: Picture = Picture::new();

    let drawn = frame(STATE, WORKSPACE, POSITIONS).and_then(|asset| {
        draw(&asset, POSITIONS, NEAR, PICTURE);
        png::write(env!("SINEW_PICTURE"), WIDTH, HEIGHT, |x, y| {
            let colour = PICTURE.pixel(Point::new(x as i32, y as i32));
            let colour = colour.unwrap_or(Rgb565::BLACK);
            [colour.r() << 3, colour.g() << 2, colour.b() << 3]
        })
    });
    let status = match drawn {
        Ok(()) => debug::EXIT_SUCCESS,
        Err(reason) => {
            if let Ok(mut out) = hio::hstderr() {
                let _ = writeln!(out, "{reason}");
            }
            debug::EXIT_FAILURE
        }
    };
    loop {
        debug::exit(status);
    }
}

fn frame(
    state: &mut State<[f32; state_len(&DIMS)]>,
    workspace: &mut Workspace<[f32; workspace_len(&DIMS)]>,
    positions: &mut [f32],
) -> Result<Asset<'static>, &'static str> {
    let asset = Asset::new_checked(ASSET).map_err(|_| "the asset is not sound")?;
    let mut output = Output::separate(&DIMS, positions, None).map_err(|_| "too few positions")?;
    let mut avatar = Avatar::new(&asset, state, workspace).map_err(|_| "too little memory")?;
    let input = Input::Clip {
        index: 0,
        seconds: SECONDS,
        looped: true,
    };
    let report = avatar.step(&input, Budget::UNLIMITED, &mut output);
    if report.flags.is_empty() {
        Ok(asset)
    } else {
        Err("the asset has no clip")
    }
}

fn draw(asset: &Asset<'_>, positions: &[f32], near: &mut [(f32, u32)], picture: &mut Picture) {
    let background = Rgb565::new(27, 55, 28);
    let _ = picture.clear(background);
    let points = positions.as_chunks::<3>().0;
    let order = asset.source_order();
    let corner = |vertex: u32| {
        let source = order.get(vertex as usize).copied().unwrap_or(0);
        points.get(source as usize).copied().unwrap_or_default()
    };
    let middle = middle(points);
    floor(picture, middle);
    for (at, (row, corners)) in near.iter_mut().zip(asset.triangles().iter()).enumerate() {
        let depth = corners
            .iter()
            .map(|&vertex| view(corner(vertex), middle)[2])
            .sum();
        *row = (depth, at as u32);
    }
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let triangle = |at: u32| asset.triangles().get(at as usize);
    for &(_, at) in near.iter() {
        let Some(corners) = triangle(at) else {
            continue;
        };
        let [a, b, c] = corners.map(|vertex| view(corner(vertex), middle));
        let (ab, ac) = (minus(b, a), minus(c, a));
        let normal = [
            ab[1] * ac[2] - ab[2] * ac[1],
            ab[2] * ac[0] - ab[0] * ac[2],
            ab[0] * ac[1] - ab[1] * ac[0],
        ];
        let length = normal.iter().map(|x| x * x).sum::<f32>();
        if normal[2] <= 0.0 {
            continue;
        }
        let light = normal[2] * normal[2] / length.max(1e-12);
        let shade = |full: f32| (full * (0.3 + 0.7 * light)) as u8;
        let colour = Rgb565::new(shade(29.0), shade(47.0), shade(19.0));
        let [a, b, c] = [a, b, c].map(pixel);
        let _ = Triangle::new(a, b, c)
            .into_styled(PrimitiveStyle::with_fill(colour))
            .draw(picture);
    }
}

/// Lines half a metre apart.
fn floor(picture: &mut Picture, middle: [f32; 3]) {
    let style = PrimitiveStyle::with_stroke(Rgb565::new(22, 45, 23), 1);
    for line in -4..=4_i8 {
        let at = f32::from(line) * 0.5;
        for ends in [[[at, -2.0], [at, 2.0]], [[-2.0, at], [2.0, at]]] {
            let [start, end] =
                ends.map(|[x, z]| pixel(view([middle[0] + x, 0.0, middle[2] + z], middle)));
            let _ = Line::new(start, end).into_styled(style).draw(picture);
        }
    }
}

/// Above which point of the floor the body stands.
fn middle(points: &[[f32; 3]]) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for point in points {
        for (sum, x) in sum.iter_mut().zip(point) {
            *sum += x;
        }
    }
    let count = points.len().max(1) as f32;
    [sum[0] / count, 0.0, sum[2] / count]
}

/// From half left and a little above: to the right, up, towards the viewer.
fn view(point: [f32; 3], middle: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = minus(point, middle);
    let (right, forward) = (0.8 * x + 0.6 * z, -0.6 * x + 0.8 * z);
    [right, 0.96 * y - 0.28 * forward, 0.28 * y + 0.96 * forward]
}

fn pixel([right, up, _]: [f32; 3]) -> Point {
    let round = |x: f32| (x + 0.5) as i32;
    Point::new(
        round(FLOOR[0] + SCALE * right),
        round(FLOOR[1] - SCALE * up),
    )
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    if let Ok(mut out) = hio::hstderr() {
        let _ = writeln!(out, "{info}");
    }
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
