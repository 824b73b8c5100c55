use super::*;
use crate::export::test_folder::TestFolder;

/// Frames as a viewer shows them, with their delays in hundredths of a second.
fn play(path: &Path) -> Vec<(Vec<Rgb>, u16)> {
    let mut options = ::gif::DecodeOptions::new();
    options.set_color_output(::gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(std::fs::File::open(path).unwrap()).unwrap();
    let width = usize::from(decoder.width());
    let mut canvas = vec![[0; 3]; width * usize::from(decoder.height())];
    let mut frames = Vec::new();
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert!(frame.palette.is_none(), "one palette for all");
        let pixels: &[[u8; 4]] = frame.buffer.as_chunks().0;
        for (index, &[r, g, b, alpha]) in pixels.iter().enumerate() {
            let x = usize::from(frame.left) + index % usize::from(frame.width);
            let y = usize::from(frame.top) + index / usize::from(frame.width);
            if alpha > 0 {
                canvas[y * width + x] = [r, g, b];
            }
        }
        frames.push((canvas.clone(), frame.delay));
    }
    assert_eq!(decoder.repeat(), Repeat::Infinite);
    frames
}

/// A square that moves over a background of `shades` colours.
fn moving_square(shades: usize) -> Vec<Image> {
    let frame = |k: i64| {
        let mut image = Image::new(40, 30, [250; 3]);
        for x in 0..40 {
            let shade = (x as usize * shades / 40) as u8;
            image.fill(x, 0, 1, 30, [shade, 255 - shade, 100]);
        }
        image.fill(3 * k, 2 * k, 8, 6, [200, 30, 20]);
        image
    };
    (0..5).map(frame).collect()
}

#[test]
fn few_colours_come_back_exactly() {
    let folder = TestFolder::new();
    let images = moving_square(20);
    write_gif(folder.path("a.gif"), &images, 0.04).unwrap();
    let frames = play(&folder.path("a.gif"));
    assert_eq!(frames.len(), images.len());
    for ((pixels, delay), image) in frames.iter().zip(&images) {
        assert_eq!(pixels.as_flattened(), image.rgb);
        assert_eq!(*delay, 4);
    }
}

#[test]
fn all_256_colours_come_back_exactly_without_a_transparent_one() {
    let folder = TestFolder::new();
    let mut first = Image::new(16, 16, [0; 3]);
    for (index, byte) in first.rgb.chunks_exact_mut(3).enumerate() {
        byte.copy_from_slice(&[index as u8, 255 - index as u8, 9]);
    }
    let mut second = first.clone();
    second.rgb.copy_within(0..30, 60);
    let images = [first, second];
    write_gif(folder.path("a.gif"), &images, 0.1).unwrap();
    for ((pixels, _), image) in play(&folder.path("a.gif")).iter().zip(&images) {
        assert_eq!(pixels.as_flattened(), image.rgb);
    }
}

#[test]
fn many_colours_stay_close_and_do_not_flicker() {
    let folder = TestFolder::new();
    let frame = |k: usize| {
        let mut image = Image::new(64, 64, [0; 3]);
        for y in 0..64u8 {
            for x in 0..64u8 {
                image.fill(i64::from(x), i64::from(y), 1, 1, [x * 4, y * 4, 128]);
            }
        }
        image.fill(k as i64 * 4, 0, 4, 4, [255, 0, 0]);
        image
    };
    let images: Vec<Image> = (0..4).map(frame).collect();
    write_gif(folder.path("a.gif"), &images, 0.05).unwrap();
    let frames = play(&folder.path("a.gif"));
    for ((pixels, _), image) in frames.iter().zip(&images) {
        let errors = pixels.as_flattened().iter().zip(&image.rgb);
        let sum: u64 = errors.map(|(&a, &b)| u64::from(a.abs_diff(b))).sum();
        assert!((sum as f64 / image.rgb.len() as f64) < 6.0, "{sum}");
        assert_eq!(pixels[64 * 10..], frames[0].0[64 * 10..], "the still part");
    }
}

#[test]
fn delays_add_up_and_still_frames_merge() {
    let folder = TestFolder::new();
    let images = moving_square(20);
    write_gif(folder.path("a.gif"), &images, 1.0 / 30.0).unwrap();
    let delays: Vec<u16> = play(&folder.path("a.gif")).iter().map(|frame| frame.1).collect();
    assert_eq!(delays, [3, 4, 3, 3, 4]);

    let still = vec![images[0].clone(); 4];
    write_gif(folder.path("b.gif"), &still, 0.05).unwrap();
    let frames = play(&folder.path("b.gif"));
    assert_eq!((frames.len(), frames[0].1), (1, 20));
    // 600 s are 60,000 hundredths; a second such frame does not fit the counter.
    write_gif(folder.path("c.gif"), &still[..2], 600.0).unwrap();
    let frames = play(&folder.path("c.gif"));
    assert_eq!(frames.len(), 2);
    assert_eq!(frames[0].0, frames[1].0);
}

#[test]
fn what_cannot_be_written_is_refused_and_leaves_nothing() {
    let folder = TestFolder::new();
    let path = folder.path("a.gif");
    let image = Image::new(4, 4, [1; 3]);
    let error = |images: &[Image], seconds| write_gif(&path, images, seconds).unwrap_err().kind;
    assert_eq!(error(&[], 0.1), ExportErrorKind::Empty { what: "frame" });
    for seconds in [0.0, 0.01, f64::NAN, 1e9] {
        let kind = error(std::slice::from_ref(&image), seconds);
        assert!(matches!(kind, ExportErrorKind::OutOfRange { .. }), "{seconds}");
    }
    let empty = error(&[Image::default()], 0.1);
    assert!(matches!(empty, ExportErrorKind::OutOfRange { .. }));
    let wide = error(&[Image::new(70_000, 1, [0; 3])], 0.1);
    assert!(matches!(wide, ExportErrorKind::OutOfRange { .. }));
    let mixed = error(&[image, Image::new(4, 5, [1; 3])], 0.1);
    let kind = ExportErrorKind::OutOfRange {
        what: "the size of frame 1".into(),
        value: "4 x 5".into(),
        expected: "4 x 4, as that of the first".into(),
    };
    assert_eq!(mixed, kind);
    assert!(folder.names().is_empty());
}
