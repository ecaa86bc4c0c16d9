//! Float images.

use thiserror::Error;

/// Interleaved float image, row-major, `[height, width, channels]`;
/// values are linear in the channel's quantity.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Image {
    /// Columns, pixels.
    pub width: usize,
    /// Rows, pixels.
    pub height: usize,
    /// Channels per pixel.
    pub channels: usize,
    /// `height · width · channels` values `[H,W,C]`, row-major from the top left.
    pub data: Vec<f32>,
}

/// The number of values does not match the image size.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("image: {found} values, expected {width}×{height}×{channels}")]
pub struct ImageError {
    found: usize,
    width: usize,
    height: usize,
    channels: usize,
}

impl Image {
    /// All zero.
    pub fn zeros(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, data: vec![0.0; width * height * channels] }
    }

    /// Image from `[height, width, channels]` values.
    ///
    /// # Errors
    /// If the number of values differs from `height · width · channels`.
    pub fn from_data(
        width: usize,
        height: usize,
        channels: usize,
        data: Vec<f32>,
    ) -> Result<Self, ImageError> {
        if data.len() == width * height * channels {
            Ok(Self { width, height, channels, data })
        } else {
            Err(ImageError { found: data.len(), width, height, channels })
        }
    }

    /// Values of the pixel in column `x`, row `y`.
    ///
    /// # Panics
    /// Outside the image.
    pub fn pixel(&self, x: usize, y: usize) -> &[f32] {
        let start = (y * self.width + x) * self.channels;
        &self.data[start..start + self.channels]
    }

    /// Mutable values of the pixel in column `x`, row `y`.
    ///
    /// # Panics
    /// Outside the image.
    pub fn pixel_mut(&mut self, x: usize, y: usize) -> &mut [f32] {
        let start = (y * self.width + x) * self.channels;
        &mut self.data[start..start + self.channels]
    }

    /// 8-bit values, `round(255·clamp(v, 0, 1))`, as the reference saves PNGs; NaN becomes 0.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 0..=255 first"
    )]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.data.iter().map(|&value| (value.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
    }
}
