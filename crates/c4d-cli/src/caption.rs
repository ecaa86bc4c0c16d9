//! Text on images: titles and legends.

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::{MonoTextStyle, ascii::FONT_9X18};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::text::{Baseline, Text};
use embedded_graphics::{Drawable, Pixel};
use gs_core::Image;
use std::convert::Infallible;

/// A colour, 0 to 1.
pub(crate) type Rgb = [f32; 3];

/// Height of a line of text with its margins, pixels.
const LINE: usize = 28;
/// Width of a character, pixels.
const CHARACTER: usize = 9;
/// Space around text, pixels.
const MARGIN: usize = 6;
/// Side of a swatch, pixels.
const SWATCH: usize = 16;

/// An image of three channels on which text is drawn.
struct Canvas<'a>(&'a mut Image);

impl OriginDimensions for Canvas<'_> {
    fn size(&self) -> Size {
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        Size::new(side(self.0.width), side(self.0.height))
    }
}

impl DrawTarget for Canvas<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, color) in pixels {
            let (Ok(x), Ok(y)) = (usize::try_from(at.x), usize::try_from(at.y)) else { continue };
            if x < self.0.width && y < self.0.height {
                let rgb = [color.r(), color.g(), color.b()].map(|value| f32::from(value) / 255.0);
                self.0.pixel_mut(x, y).copy_from_slice(&rgb);
            }
        }
        Ok(())
    }
}

/// The image below a line with its title.
pub(crate) fn titled(image: &Image, title: &str) -> Image {
    let mut out = Image::zeros(image.width, image.height + LINE, 3);
    out.data[LINE * image.width * 3..].copy_from_slice(&image.data);
    write(&mut out, title, (MARGIN, MARGIN));
    out
}

/// The image above a legend of coloured squares and labels.
pub(crate) fn with_legend(image: &Image, entries: &[(Rgb, String)]) -> Image {
    let mut out = Image::zeros(image.width, image.height + LINE, 3);
    out.data[..image.data.len()].copy_from_slice(&image.data);
    let top = image.height + MARGIN;
    let mut left = MARGIN;
    for (color, text) in entries {
        for y in top..top + SWATCH {
            for x in left..(left + SWATCH).min(out.width) {
                out.pixel_mut(x, y).copy_from_slice(color);
            }
        }
        write(&mut out, text, (left + SWATCH + MARGIN, top));
        left += SWATCH + 4 * MARGIN + text.chars().count() * CHARACTER;
    }
    out
}

/// Writes white text with its upper left corner at `at`, clipped to the image.
fn write(image: &mut Image, text: &str, at: (usize, usize)) {
    let coordinate = |pixels: usize| i32::try_from(pixels).unwrap_or(i32::MAX);
    let style = MonoTextStyle::new(&FONT_9X18, Rgb888::WHITE);
    let at = Point::new(coordinate(at.0), coordinate(at.1));
    let drawn = Text::with_baseline(text, at, style, Baseline::Top).draw(&mut Canvas(image));
    // Drawing on an image cannot fail.
    let Ok(_) = drawn;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_swatches_are_drawn_next_to_the_image() {
        let image = Image::from_data(80, 2, 3, vec![0.5; 480]).unwrap();
        let titled = titled(&image, "ab");
        assert_eq!((titled.width, titled.height), (80, 2 + LINE), "a line more");
        assert_eq!(titled.pixel(0, LINE), [0.5; 3], "the image is below it");
        let white = titled.data.chunks(3).filter(|pixel| *pixel == [1.0; 3]).count();
        assert!((10..100).contains(&white), "two letters: {white} pixels");

        let entries = [([1.0, 0.0, 0.0], "x".to_owned()), ([0.0, 1.0, 0.0], "far".to_owned())];
        let keyed = with_legend(&image, &entries);
        assert_eq!(keyed.pixel(MARGIN, 2 + MARGIN), [1.0, 0.0, 0.0], "first swatch");
        let green = keyed.data.chunks(3).filter(|pixel| *pixel == [0.0, 1.0, 0.0]).count();
        assert_eq!(green, SWATCH * SWATCH, "second swatch");
        // Text that does not fit is clipped.
        with_legend(&image, &[([1.0; 3], "long ".repeat(40))]);
    }
}
