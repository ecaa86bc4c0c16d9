//! [`Rgb8`]: an 8-bit image.

/// An 8-bit image, RGB, row-major.
#[derive(Debug, Clone, Copy)]
pub struct Rgb8<'a> {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// RGB, 0 to 255, `[height, width, 3]`.
    pub pixels: &'a [u8],
}
