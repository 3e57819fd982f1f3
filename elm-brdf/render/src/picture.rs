//! Turns radiance into picture files: the display's curve, captions, PNG and OpenEXR.

use std::io::Cursor;
use std::path::Path;

use embedded_graphics::Drawable;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Size};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle, ascii};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::prelude::{Pixel, Point};
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};
use image::{ExtendedColorType, ImageEncoder, ImageFormat};

use crate::Rendering;
use crate::error::{Error, Result};

/// A picture in 8-bit sRGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bitmap {
    width: u32,
    height: u32,
    /// Red, green and blue of each pixel, row by row.
    bytes: Vec<u8>,
}

/// Height of a line at the foot.
fn line_height(font: &MonoFont<'_>) -> u32 {
    font.character_size.height * 3 / 2
}

/// A font that can be read in a picture of this width.
fn font(width: u32) -> &'static MonoFont<'static> {
    match width {
        0..320 => &ascii::FONT_5X8,
        320..640 => &ascii::FONT_6X13,
        640..1200 => &ascii::FONT_8X13,
        1200..1700 => &ascii::FONT_9X18,
        _ => &ascii::FONT_10X20,
    }
}

impl Bitmap {
    /// A picture of one colour.
    #[must_use]
    pub fn new(width: u32, height: u32, color: [u8; 3]) -> Self {
        Self {
            width,
            height,
            bytes: color.repeat(width as usize * height as usize),
        }
    }

    /// The picture as a display shows it, without words.
    #[must_use]
    pub fn display(rendering: &Rendering) -> Self {
        let bytes = rendering
            .pixels
            .iter()
            .flat_map(|pixel| pixel.map(|value| display(value * rendering.gain)))
            .collect();
        Self {
            width: rendering.width,
            height: rendering.height,
            bytes,
        }
    }

    /// The picture with its labels and its caption.
    #[must_use]
    pub(crate) fn captioned(rendering: &Rendering) -> Self {
        let mut picture = Self::display(rendering);
        for (label, [x, y]) in &rendering.labels {
            // Half of what the label takes, so that its ends stay inside.
            let half =
                f64::from(font(picture.width).character_size.width) * label.len() as f64 / 2.0;
            let x = x.min(f64::from(picture.width) - half).max(half);
            picture.write(label, [x as i32, *y as i32], Alignment::Center);
        }
        picture.caption(&rendering.caption);
        picture
    }

    /// Pixels across and down.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Red, green and blue of each pixel, row by row from the top.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Puts another picture into this one, its upper left corner at `x`, `y`; what does not fit is
    /// left out.
    pub fn place(&mut self, other: &Self, x: u32, y: u32) {
        let columns = other.width.min(self.width.saturating_sub(x)) as usize;
        let rows = other.height.min(self.height.saturating_sub(y)) as usize;
        for row in 0..rows {
            let from = 3 * row * other.width as usize;
            let to = 3 * ((y as usize + row) * self.width as usize + x as usize);
            self.bytes[to..to + 3 * columns]
                .copy_from_slice(&other.bytes[from..from + 3 * columns]);
        }
    }

    /// Writes words at the foot, in as many lines as they need.
    pub fn caption(&mut self, words: &str) {
        if words.is_empty() {
            return;
        }
        let font = font(self.width);
        let columns = (self.width / font.character_size.width)
            .saturating_sub(2)
            .max(1);
        let lines = wrap(words, columns as usize);
        let step = line_height(font);
        for (index, line) in lines.iter().rev().enumerate() {
            let y = self.height as i32 - (step as i32) * (index as i32 + 1);
            let x = font.character_size.width as i32;
            self.write(line, [x, y], Alignment::Left);
        }
    }

    /// Writes a line, white with a dark edge, so that it can be read on anything.
    fn write(&mut self, line: &str, [x, y]: [i32; 2], alignment: Alignment) {
        let font = font(self.width);
        // The font has ASCII only.
        let line: String = line
            .chars()
            .map(|c| if c.is_ascii() { c } else { '?' })
            .collect();
        let style = TextStyleBuilder::new()
            .alignment(alignment)
            .baseline(Baseline::Top)
            .build();
        let mut draw = |dx, dy, color| {
            let character = MonoTextStyle::new(font, color);
            let at = Point::new(x + dx, y + dy);
            // Drawing on this target cannot fail.
            let _ = Text::with_text_style(&line, at, character, style).draw(self);
        };
        for (dx, dy) in [
            (-1, -1),
            (0, -1),
            (1, -1),
            (-1, 0),
            (1, 0),
            (-1, 1),
            (0, 1),
            (1, 1),
        ] {
            draw(dx, dy, Rgb888::new(24, 24, 24));
        }
        draw(0, 0, Rgb888::new(240, 240, 240));
    }

    /// The bytes of a PNG file.
    ///
    /// # Errors
    /// [`Error::Encode`].
    pub fn png(&self) -> Result<Vec<u8>> {
        let mut png = Vec::new();
        image::codecs::png::PngEncoder::new(&mut png)
            .write_image(
                &self.bytes,
                self.width,
                self.height,
                ExtendedColorType::Rgb8,
            )
            .map_err(not_encoded)?;
        Ok(png)
    }
}

impl Rendering {
    /// The bytes of a picture file in one of the formats that [`format`](Self::format) gives: PNG in sRGB
    /// with its words, or OpenEXR in linear radiance without.
    ///
    /// # Errors
    /// [`Error::Encode`].
    pub fn encode(&self, format: ImageFormat) -> Result<Vec<u8>> {
        match format {
            ImageFormat::OpenExr => self.exr(),
            _ => Bitmap::captioned(self).png(),
        }
    }

    /// The format that a file's extension asks for, so that a wrong one is told before the work.
    ///
    /// # Errors
    /// [`Error::PictureFormat`].
    pub fn format(path: &Path) -> Result<ImageFormat> {
        match ImageFormat::from_path(path) {
            Ok(format @ (ImageFormat::Png | ImageFormat::OpenExr)) => Ok(format),
            _ => Err(Error::PictureFormat {
                path: path.to_owned(),
            }),
        }
    }

    fn exr(&self) -> Result<Vec<u8>> {
        let bytes: Vec<u8> = self
            .pixels
            .iter()
            .flatten()
            .flat_map(|&value| (value as f32).to_ne_bytes())
            .collect();
        let mut exr = Cursor::new(Vec::new());
        image::codecs::openexr::OpenExrEncoder::new(&mut exr)
            .write_image(&bytes, self.width, self.height, ExtendedColorType::Rgb32F)
            .map_err(not_encoded)?;
        Ok(exr.into_inner())
    }
}

fn not_encoded(error: image::ImageError) -> Error {
    Error::Encode {
        reason: error.to_string(),
    }
}

/// Linear light as an 8-bit sRGB value (IEC 61966-2-1).
fn display(linear: f64) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    };
    // What is no number stays none, and becomes 0 here.
    (255.0 * encoded).round() as u8
}

/// Breaks words into lines of at most `columns` characters, where there are blanks.
fn wrap(words: &str, columns: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= columns => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

impl OriginDimensions for Bitmap {
    fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }
}

impl DrawTarget for Bitmap {
    type Color = Rgb888;
    type Error = std::convert::Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Self::Error> {
        for Pixel(at, color) in pixels {
            let inside =
                (0..self.width as i32).contains(&at.x) && (0..self.height as i32).contains(&at.y);
            if inside {
                let start = 3 * (at.y as usize * self.width as usize + at.x as usize);
                let bytes = [color.r(), color.g(), color.b()];
                self.bytes[start..start + 3].copy_from_slice(&bytes);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_displays_curve_meets_the_standard_at_known_points() {
        // The curve meets 128 / 255 at 0.21586 and its two parts join at 0.04045.
        for (linear, expected) in [
            (0.0, 0),
            (1.0, 255),
            (7.0, 255),
            (-1.0, 0),
            (0.215_86, 128),
            (0.003_130_8, 10),
        ] {
            assert_eq!(display(linear), expected, "{linear}");
        }
        assert_eq!(display(f64::NAN), 0);
    }

    #[test]
    fn words_wrap_and_never_draw_outside() {
        assert_eq!(wrap("a bb ccc dddd", 6), ["a bb", "ccc", "dddd"]);
        let mut picture = Bitmap::new(40, 20, [0; 3]);
        picture.caption("far too long for so small a picture, in many lines");
        picture.write("outside", [-500, 500], Alignment::Center);
        assert!(picture.bytes().contains(&240));
        Bitmap::new(1, 1, [9; 3]).caption("x");
    }

    #[test]
    fn what_does_not_fit_is_left_out() {
        let mut sheet = Bitmap::new(3, 2, [0; 3]);
        sheet.place(&Bitmap::new(2, 2, [7; 3]), 2, 1);
        assert_eq!(sheet.bytes().iter().filter(|&&b| b == 7).count(), 3);
        sheet.place(&Bitmap::new(2, 2, [7; 3]), 9, 9);
    }
}
