//! [`Plane`]: an image of one pixel per splat, as in SOG and TSOG.

use image::ImageDecoder;
use std::io::Cursor;

/// Palette entries in a row of the plane of centroids.
pub(crate) const PALETTE_ROW: usize = 64;
/// Alpha of a quaternion whose largest component is w.
pub(crate) const FIRST_SLOT: u8 = 252;

/// A decoded plane, RGBA.
pub(crate) struct Plane {
    pixels: Vec<u8>,
    width: usize,
}

impl Plane {
    /// Decodes a WebP image of at most `limit` bytes of pixels; the error is a message.
    pub(crate) fn decode(bytes: &[u8], limit: u64) -> Result<Self, String> {
        let failed = |error: image::ImageError| format!("a plane is not a WebP image: {error}");
        let decoder = image::codecs::webp::WebPDecoder::new(Cursor::new(bytes)).map_err(failed)?;
        let (width, height) = decoder.dimensions();
        let pixels = u64::from(width) * u64::from(height);
        if pixels * 4 > limit {
            return Err(format!(
                "a plane of {width}×{height} pixels, more than the file can contain"
            ));
        }
        let pixels = image::DynamicImage::from_decoder(decoder).map_err(failed)?.into_rgba8();
        Ok(Self { pixels: pixels.into_raw(), width: width as usize })
    }

    /// The pixel with this index, in rows from the top left.
    pub(crate) fn at(&self, i: usize) -> [u8; 4] {
        self.pixels.as_chunks::<4>().0[i]
    }

    /// Number of pixels.
    pub(crate) fn len(&self) -> usize {
        self.pixels.len() / 4
    }

    pub(crate) fn width(&self) -> usize {
        self.width
    }
}
