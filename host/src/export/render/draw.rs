//! The stages put together, over bands of rows.

use std::num::NonZeroUsize;
use std::sync::Mutex;

use glam::{Vec2, Vec3};

use super::assemble::{Assembly, UNIT};
use super::backdrop::Backdrop;
use super::camera::{Camera, View};
use super::floor_shadow::FloorShadow;
use super::image::{Gamma, Image};
use super::overlay::{Capsule, capsules, sample_position};
use super::raster::{Band, NONE, Pattern};
use super::scene::{Quality, Scene};
use super::shade::{Fragment, Lights};
use super::shadow_map::ShadowMap;

/// Sides of a picture are cut to this many pixels.
const MOST_PIXELS: usize = 8192;

/// Pixel rows in a band: enough to amortise a triangle that spans bands, few enough that the
/// samples stay in the second-level cache.
const BAND_ROWS: usize = 16;

/// Draws a scene on all processor cores.
///
/// Sides are cut to 8192 pixels. Linear in triangles and in samples.
#[must_use]
pub fn render(scene: &Scene, camera: &Camera, width: usize, height: usize, quality: Quality) -> Image {
    let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    render_on(threads, scene, camera, width, height, quality)
}

/// Draws a scene on some threads; the pixels do not depend on how many. A caller that draws
/// several frames at once gives each one thread.
#[must_use]
pub fn render_on(
    threads: NonZeroUsize,
    scene: &Scene,
    camera: &Camera,
    width: usize,
    height: usize,
    quality: Quality,
) -> Image {
    let (width, height) = (width.min(MOST_PIXELS), height.min(MOST_PIXELS));
    let mut image = Image::new(width, height, [0; 3]);
    if width == 0 || height == 0 {
        return image;
    }
    let side = quality.side();
    let (columns, rows) = (width * side, height * side);
    let view = camera.view(width, height);
    let lights = Lights::new(&view, scene.key_light);
    let floor = scene.floor.map(|floor| floor.height).filter(|height| height.is_finite());

    let mut assembly = Assembly::default();
    let mut overlay = Vec::new();
    let mut shadow_map = None;
    let mut floor_shadow = None;
    let stages: Vec<Box<dyn FnOnce() + Send>> = vec![
        Box::new(|| {
            if let Some(height) = floor {
                floor_shadow = FloorShadow::new(scene, height, lights.key);
            }
        }),
        Box::new(|| shadow_map = ShadowMap::new(&scene.meshes, lights.key)),
        Box::new(|| {
            for mesh in &scene.meshes {
                assembly.add(mesh, &view, columns, rows);
            }
            overlay = capsules(scene, &view, columns, rows, side);
        }),
    ];
    for_each(threads, stages, |stage| stage());

    let frame = Frame {
        assembly: &assembly,
        overlay: &overlay,
        backdrop: Backdrop {
            view: &view,
            width,
            height,
            floor: floor.map(|height| (height, floor_shadow.as_ref())),
            stage: stage(&view),
        },
        lights: &lights,
        shadow_map: shadow_map.as_ref(),
        view: &view,
        side,
        columns,
        rows,
    };
    let (triangles, strokes) = frame.bins();
    let bands = image.rgb.chunks_mut(width * 3 * BAND_ROWS);
    let bands = bands.zip(triangles).zip(strokes).enumerate();
    for_each(threads, bands.collect(), |(index, ((pixels, triangles), strokes))| {
        frame.draw_band(index * BAND_ROWS, pixels, &triangles, &strokes);
    });
    image
}

/// The part of the floor that is shown: around what the camera looks at, out to about what it
/// sees of it.
fn stage(view: &View) -> (Vec2, f32) {
    let seen = view.eye.distance(view.target) * view.tan_x.max(view.tan_y);
    (Vec2::new(view.target.x, view.target.z), (seen * 1.2).max(1e-3))
}

/// Hands the items to the threads one by one.
fn for_each<T: Send>(threads: NonZeroUsize, items: Vec<T>, work: impl Fn(T) + Sync) {
    if threads.get() == 1 {
        items.into_iter().for_each(work);
        return;
    }
    let count = threads.get().min(items.len());
    let queue = Mutex::new(items.into_iter());
    // The lock is only held to take an item, which cannot panic.
    let next = || queue.lock().ok().and_then(|mut queue| queue.next());
    std::thread::scope(|scope| {
        for _ in 0..count {
            scope.spawn(|| {
                while let Some(item) = next() {
                    work(item);
                }
            });
        }
    });
}

/// All that the bands share.
struct Frame<'a> {
    assembly: &'a Assembly,
    overlay: &'a [Capsule],
    backdrop: Backdrop<'a>,
    lights: &'a Lights,
    shadow_map: Option<&'a ShadowMap>,
    view: &'a View,
    side: usize,
    columns: usize,
    rows: usize,
}

impl Frame<'_> {
    /// For each band, the triangles and the capsules that reach into it, in order.
    fn bins(&self) -> (Vec<Vec<u32>>, Vec<Vec<u32>>) {
        let band_rows = (BAND_ROWS * self.side) as i64;
        let count = self.rows.div_ceil(BAND_ROWS * self.side);
        let sort = |extents: &mut dyn Iterator<Item = (i64, i64)>| {
            let mut bins = vec![Vec::new(); count];
            for (id, (top, bottom)) in extents.enumerate() {
                let first = top.div_euclid(UNIT * band_rows).max(0);
                let last = bottom.div_euclid(UNIT * band_rows).min(count as i64 - 1);
                for band in first..=last {
                    bins[band as usize].push(id as u32);
                }
            }
            bins
        };
        let vertices = &self.assembly.vertices;
        let triangles = sort(&mut self.assembly.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.vertices.map(|vertex| vertices[vertex as usize].y);
            (i64::from(a.min(b).min(c)), i64::from(a.max(b).max(c)))
        }));
        let strokes = sort(&mut self.overlay.iter().map(|capsule| {
            let [_, top, _, bottom] = capsule.bounds();
            (top, bottom)
        }));
        (triangles, strokes)
    }

    /// Draws some pixel rows; `pixels` holds their bytes.
    fn draw_band(&self, first_row: usize, pixels: &mut [u8], triangles: &[u32], strokes: &[u32]) {
        let gamma = Gamma::get();
        let width = self.columns / self.side;
        let rows = pixels.len() / 3 / width;
        let pattern = Pattern::new(self.side);
        let mut surface = Band::new(pattern, self.columns);
        surface.reset(first_row * self.side, rows * self.side);
        for &id in triangles {
            let triangle = &self.assembly.triangles[id as usize];
            surface.draw(id, triangle, &self.assembly.vertices);
        }
        let mut overlay = Band::new(pattern, self.columns);
        if !strokes.is_empty() {
            overlay.reset(first_row * self.side, rows * self.side);
            for &id in strokes {
                self.overlay[id as usize].draw(id, &mut overlay);
            }
        }
        let scale = 1.0 / (self.side * self.side) as f32;
        for (index, pixel) in pixels.chunks_exact_mut(3).enumerate() {
            let (column, row) = (index % width, first_row + index / width);
            let behind = self.backdrop.color(column, row, gamma);
            let mut sum = Vec3::ZERO;
            for down in 0..self.side {
                for right in 0..self.side {
                    let sample = [column * self.side + right, row * self.side + down];
                    sum += self.sample(sample, behind, &surface, &overlay);
                }
            }
            pixel.copy_from_slice(&gamma.srgb((sum * scale).to_array()));
        }
    }

    /// Linear light at one sample.
    fn sample(&self, [column, row]: [usize; 2], behind: Vec3, surface: &Band, overlay: &Band) -> Vec3 {
        let cell = (row - surface.first_row) * self.columns + column;
        let mut color = behind;
        let mut nearness = 0.0;
        let id = surface.nearest[cell];
        if id != NONE {
            let triangle = &self.assembly.triangles[id as usize];
            let place = surface.pattern.position(column, row);
            let fragment = Fragment::new(self.assembly, triangle, place, self.view.eye);
            if !self.backdrop.hides(fragment.world) {
                color = fragment.light(self.lights, self.shadow_map);
                nearness = surface.nearness[cell];
            }
        }
        let Some(capsule) = overlay.nearest.get(cell).and_then(|&id| self.overlay.get(id as usize))
        else {
            return color;
        };
        let position = sample_position(overlay, column, row);
        let Some(entry) = capsule.entry(position) else {
            return color;
        };
        let half = Vec2::new(self.columns as f32, self.rows as f32) / 2.0;
        let ray = self.view.ray(position.x / half.x - 1.0, 1.0 - position.y / half.y);
        let world = self.view.eye + ray / entry.inverse_w;
        if self.backdrop.hides(world) {
            return color;
        }
        let alpha = if entry.inverse_w >= nearness { 1.0 } else { capsule.occluded_opacity };
        let normal = self.view.right * entry.normal.x
            + self.view.up * entry.normal.y
            + self.view.back * entry.normal.z;
        let lit = self.lights.surface(capsule.color, normal, world, 1.0);
        color.lerp(lit, alpha)
    }
}
