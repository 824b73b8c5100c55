//! Linear blend skinning against a copy of the data and plain `glam` loops, in one process.
//!
//! `cargo bench -p sinew-host --bench wall_skin`, and for the plain loops at their best
//! `RUSTFLAGS="-C target-cpu=native"` in front. A word after `--` picks cases by name.
//!
//! Every figure is a ratio within a round; the rounds are interleaved. `touch` copies positions
//! and normals once and reads every weight once. `hot` skins one body again and again, `streaming`
//! goes round so many that none stays in a cache. `packed` reads 16-bit shapes; `morphs` adds eight
//! targets that move a tenth of the body each, positions and normals; what they may cost is what
//! they add to the bytes, which is printed.

#[path = "wall_skin/body.rs"]
mod body;
#[path = "wall_skin/plain.rs"]
mod plain;

use std::hint::black_box;
use std::time::Instant;

use body::{Body, subdivided, with_influences, with_morphs};
use plain::Plain;
use sinew_core::asset::{Asset, Dims};
use sinew_core::deform::{Level, Output, SkinJob, SkinMode, VertexOrder, skin_blocks, skin_plain};
use sinew_core::math::Affine12;
use sinew_host::bake::{AssetBytes, BakeOptions, bake};

/// Bytes that no cache holds.
const STREAMED_BYTES: usize = 192 << 20;
const ROUNDS: usize = 101;

fn main() {
    let pattern = std::env::args().skip(1).find(|word| !word.starts_with('-'));
    let body = Body::load();
    println!(
        "ratio to touch: median (lower and upper quartile), fastest to fastest; median time; best level {:?}",
        Level::best()
    );
    for (size, body) in [("13k", body.clone()), ("54k", subdivided(&body))] {
        for influences in [4, 8] {
            for streaming in [false, true] {
                let heat = if streaming { "streaming" } else { "hot" };
                let name = format!("{size} {influences} influences {heat}");
                if pattern
                    .as_ref()
                    .is_none_or(|pattern| name.contains(pattern.as_str()))
                {
                    case(
                        &name,
                        &with_influences(&body, influences),
                        influences,
                        streaming,
                    );
                }
            }
        }
    }
}

/// One way to skin body number `.0`.
type Contestant<'a> = (&'static str, Box<dyn FnMut(usize) + 'a>);

fn case(name: &str, body: &Body, influences: usize, streaming: bool) {
    let start = Instant::now();
    let options = BakeOptions {
        centres: true,
        ..BakeOptions::default()
    };
    let baked = bake(&body.avatar, &options).expect("bakes");
    let baking = start.elapsed().as_secs_f64();
    let dims = baked.report.dims;
    let copies = if streaming {
        STREAMED_BYTES / (body.avatar.mesh.positions.len() * (48 + 4 * influences))
    } else {
        1
    };
    let assets: Vec<AssetBytes> = vec![baked.bytes; copies];
    let assets: Vec<Asset<'_>> = assets
        .iter()
        .map(|bytes| bytes.asset().expect("sound"))
        .collect();
    let plain: Vec<Plain> = vec![Plain::new(&body.avatar, influences); copies];
    let palette = body.palette();
    let room = || vec![vec![[0.0_f32; 3]; dims.vertex_count]; copies];
    println!(
        "\n{name}: {} vertices, {:.2} slots a block, {} of {} blocks rigid, baked with centres in {baking:.1} s, {copies} bodies",
        dims.vertex_count,
        dims.slot_count as f64 / dims.block_count as f64,
        dims.rigid_block_count,
        dims.block_count,
    );
    let packed_options = BakeOptions {
        quantised: true,
        ..BakeOptions::default()
    };
    let packed = bake(&body.avatar, &packed_options).expect("bakes").bytes;
    let packed = vec![packed; copies];
    let packed: Vec<Asset<'_>> = packed.iter().map(|b| b.asset().expect("sound")).collect();
    let morphed = bake(&with_morphs(body).avatar, &BakeOptions::default()).expect("bakes");
    let morph_rows = morphed.report.dims.morph_row_count;
    let morphed = vec![morphed.bytes; copies];
    let morphed: Vec<Asset<'_>> = morphed.iter().map(|b| b.asset().expect("sound")).collect();
    let row_bytes = morph_rows * (2 + 2 * 96);
    let plain_bytes = dims.block_count * 8 * 48 + dims.slot_count * 18;
    println!(
        "  bytes touched: {plain_bytes} without morphs, {:.2} times as many with",
        (plain_bytes + row_bytes) as f64 / plain_bytes as f64
    );
    let mut contestants: Vec<Contestant<'_>> = Vec::new();
    {
        let (mut positions, mut normals, plain) = (room(), room(), &plain);
        contestants.push((
            "touch",
            Box::new(move |at| plain[at].touch(&mut positions[at], &mut normals[at])),
        ));
    }
    {
        let (mut positions, mut normals, plain, palette) = (room(), room(), &plain, body.mat4());
        contestants.push((
            "glam Mat4",
            Box::new(move |at| plain[at].mat4(&palette, &mut positions[at], &mut normals[at])),
        ));
    }
    {
        let (mut positions, mut normals, plain, palette) = (room(), room(), &plain, body.affine());
        contestants.push((
            "glam Affine3A",
            Box::new(move |at| plain[at].affine(&palette, &mut positions[at], &mut normals[at])),
        ));
    }
    {
        let (mut positions, mut normals, plain, palette) = (room(), room(), &plain, &palette);
        contestants.push((
            "sinew plain path",
            Box::new(move |at| {
                let output = output(&dims, &mut positions[at], &mut normals[at]);
                skin_plain(
                    &plain[at].mesh(),
                    palette,
                    &mut output.in_order(VertexOrder::Block),
                );
            }),
        ));
    }
    let ways = levels().into_iter().flat_map(|(level_name, level)| {
        [VertexOrder::Block, VertexOrder::Source].map(|order| (level_name, level, order))
    });
    for (level_name, level, order) in ways {
        let name: &'static str = format!("sinew {level_name} {order:?}").leak();
        let (mut positions, mut normals, assets, palette) = (room(), room(), &assets, &palette);
        contestants.push((
            name,
            Box::new(move |at| {
                run(
                    &assets[at],
                    palette,
                    level,
                    order,
                    &mut positions[at],
                    &mut normals[at],
                );
            }),
        ));
    }
    for (name, mode) in [
        ("sinew dual quaternions", SkinMode::DualQuaternion),
        ("sinew centres", SkinMode::CentresOfRotation),
    ] {
        let (mut positions, mut normals, assets, palette) = (room(), room(), &assets, &palette);
        let duals = body.duals(&assets[0]);
        contestants.push((
            name,
            Box::new(move |at| {
                let output = output(&dims, &mut positions[at], &mut normals[at]);
                let job = SkinJob {
                    mode,
                    duals: &duals,
                    ..SkinJob::linear(palette)
                };
                let blocks = 0..dims.block_count;
                job.run(
                    &assets[at],
                    blocks,
                    &mut output.in_order(VertexOrder::Block),
                );
            }),
        ));
    }
    for (name, assets, weights) in [
        ("sinew packed", &packed, [0.0; 8]),
        ("sinew morphs", &morphed, [0.3; 8]),
    ] {
        let (mut positions, mut normals, palette) = (room(), room(), &palette);
        contestants.push((
            name,
            Box::new(move |at| {
                let output = output(&dims, &mut positions[at], &mut normals[at]);
                let job = SkinJob {
                    morph_weights: &weights,
                    ..SkinJob::linear(palette)
                };
                let mut output = output.in_order(VertexOrder::Block);
                job.run(&assets[at], 0..dims.block_count, &mut output);
                black_box(&mut output);
            }),
        ));
    }
    measure(&mut contestants, copies);
}

/// The best level, and below it those that other machines have.
fn levels() -> Vec<(&'static str, Level)> {
    let mut levels = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        let best = fearless_simd::Level::new();
        if let Some(token) = best.as_avx512() {
            levels.push(("AVX-512", Level::Simd(fearless_simd::Level::Avx512(token))));
        }
        if let Some(token) = best.as_avx2() {
            levels.push(("AVX2", Level::Simd(fearless_simd::Level::Avx2(token))));
        }
        if let Some(token) = best.as_sse2() {
            levels.push(("SSE2", Level::Simd(fearless_simd::Level::Sse2(token))));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    levels.push(("best", Level::best()));
    levels.push(("scalar", Level::Scalar));
    levels
}

fn run(
    asset: &Asset<'_>,
    palette: &[Affine12],
    level: Level,
    order: VertexOrder,
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
) {
    let mut output = output(asset.dims(), positions, normals).in_order(order);
    skin_blocks(
        asset,
        palette,
        0..asset.dims().block_count,
        level,
        &mut output,
    );
    black_box(&mut output);
}

fn output<'o>(
    dims: &Dims,
    positions: &'o mut [[f32; 3]],
    normals: &'o mut [[f32; 3]],
) -> Output<'o> {
    Output::separate(
        dims,
        positions.as_flattened_mut(),
        Some(normals.as_flattened_mut()),
    )
    .expect("fits")
}

fn measure(contestants: &mut [Contestant<'_>], copies: usize) {
    let mut seconds = vec![Vec::with_capacity(ROUNDS); contestants.len()];
    // Short stretches: what else the machine does then spoils few of them.
    let calls = if copies == 1 { 1 } else { 4 };
    let mut next = vec![0; contestants.len()];
    for _ in 0..ROUNDS {
        for ((_, work), (times, next)) in contestants
            .iter_mut()
            .zip(seconds.iter_mut().zip(&mut next))
        {
            if copies == 1 {
                work(0);
            }
            let start = Instant::now();
            for _ in 0..calls {
                work(*next);
                *next = (*next + 1) % copies;
            }
            times.push(start.elapsed().as_secs_f64() / calls as f64);
        }
    }
    let touch = seconds[0].clone();
    let fastest = touch.iter().copied().fold(f64::INFINITY, f64::min);
    for ((name, _), times) in contestants.iter().zip(&seconds) {
        let mut ratios: Vec<f64> = times
            .iter()
            .zip(&touch)
            .map(|(time, touch)| time / touch)
            .collect();
        ratios.sort_by(f64::total_cmp);
        let mut times = times.clone();
        times.sort_by(f64::total_cmp);
        println!(
            "  {name:22} {:6.2} ({:5.2} to {:5.2})   {:6.2}   {:8.1} us",
            ratios[ROUNDS / 2],
            ratios[ROUNDS / 4],
            ratios[3 * ROUNDS / 4],
            times[0] / fastest,
            times[ROUNDS / 2] * 1e6,
        );
    }
}
