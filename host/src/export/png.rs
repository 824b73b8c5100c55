//! PNG files and contact sheets.

use std::path::Path;

use super::atomic::write_atomic;
use super::error::{ExportError, ExportErrorKind};
use super::render::{Image, Rgb, text};

/// Writes an 8-bit RGB picture.
///
/// # Errors
/// The picture has no pixels, or the file cannot be written.
pub fn write_png(path: impl AsRef<Path>, image: &Image) -> Result<(), ExportError> {
    write_atomic(path, |out| {
        let size = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        if image.rgb.is_empty() {
            return Err(ExportErrorKind::Empty { what: "pixel" });
        }
        let mut encoder = ::png::Encoder::new(out, size(image.width), size(image.height));
        encoder.set_color(::png::ColorType::Rgb);
        encoder.set_depth(::png::BitDepth::Eight);
        encoder.set_source_srgb(::png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header().map_err(kind)?;
        writer.write_image_data(&image.rgb).map_err(kind)?;
        writer.finish().map_err(kind)
    })
}

fn kind(error: ::png::EncodingError) -> ExportErrorKind {
    match error {
        ::png::EncodingError::IoError(error) => error.into(),
        other => ExportErrorKind::Io(other.to_string()),
    }
}

/// Pictures in rows of `columns`, each with its caption below; missing captions are empty.
///
/// Cells have the size of the largest picture.
#[must_use]
pub fn contact_sheet(images: &[Image], columns: usize, captions: &[&str]) -> Image {
    const GROUND: Rgb = [255; 3];
    const INK: Rgb = [58, 64, 74];
    const GAP: usize = 8;
    if images.is_empty() {
        return Image::default();
    }
    let columns = columns.clamp(1, images.len());
    let widest = images.iter().map(|image| image.width).max().unwrap_or(0);
    let tallest = images.iter().map(|image| image.height).max().unwrap_or(0);
    let scale = (widest as f32 / 240.0).clamp(1.0, 2.0);
    let strip = if captions.is_empty() { 0 } else { (13.0 * scale) as usize };
    let (cell_width, cell_height) = (widest + GAP, tallest + strip + GAP);
    let rows = images.len().div_ceil(columns);
    let mut sheet = Image::new(columns * cell_width + GAP, rows * cell_height + GAP, GROUND);
    for (index, image) in images.iter().enumerate() {
        let x = index % columns * cell_width + GAP;
        let y = index / columns * cell_height + GAP;
        sheet.paste(image, x + (widest - image.width) / 2, y + tallest - image.height);
        if let Some(caption) = captions.get(index) {
            let caption = text::shorten(caption, scale, widest as i64);
            let indent = (widest as i64 - text::width(&caption, scale)) / 2;
            let top = (y + tallest) as i64 + (3.0 * scale) as i64;
            text::draw(&mut sheet, x as i64 + indent.max(0), top, scale, INK, &caption);
        }
    }
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::test_folder::TestFolder;

    #[test]
    fn png_decodes_to_the_same_pixels() {
        let folder = TestFolder::new();
        let mut image = Image::new(5, 3, [10, 20, 30]);
        image.fill(1, 1, 2, 1, [200, 0, 255]);
        write_png(folder.path("a.png"), &image).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(folder.path("a.png")).unwrap());
        let mut reader = ::png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((info.width, info.height), (5, 3));
        assert_eq!(bytes, image.rgb);
        let error = write_png(folder.path("b.png"), &Image::default()).unwrap_err();
        assert_eq!(error.kind, ExportErrorKind::Empty { what: "pixel" });
        assert_eq!(folder.names(), ["a.png"]);
    }

    #[test]
    fn sheet_places_pictures_row_by_row() {
        let colors = [[255, 0, 0], [0, 255, 0], [0, 0, 255]];
        let images = colors.map(|color| Image::new(10, 6, color));
        let sheet = contact_sheet(&images, 2, &[]);
        assert_eq!((sheet.width, sheet.height), (2 * 18 + 8, 2 * 14 + 8));
        assert_eq!(sheet.pixel(8, 8), colors[0]);
        assert_eq!(sheet.pixel(26, 8), colors[1]);
        assert_eq!(sheet.pixel(8, 22), colors[2]);
        assert_eq!(sheet.pixel(7, 8), [255; 3]);
        assert_eq!(sheet.pixel(26, 22), [255; 3]);
        let with_captions = contact_sheet(&images, 9, &["a"]);
        assert_eq!((with_captions.width, with_captions.height), (3 * 18 + 8, 8 + 27));
        assert_eq!(contact_sheet(&[], 3, &[]), Image::default());
    }
}
