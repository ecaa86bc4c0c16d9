//! [`DescentImage`]: one supervised image, the input of a step of Adam.

/// Rectangle of an image, pixels; (0, 0) is the top left pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Crop {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// An edited splat that is visible in an image.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Row among the image's splats.
    pub local: u32,
    /// Row among the edited splats.
    pub row: u32,
    /// Unit vector from the camera centre to the splat, world frame.
    pub towards: [f32; 3],
    /// Colour towards the camera before refinement, RGB, not clamped at 0.
    pub color: [f32; 3],
    /// Whether this image constrains the splat's colour. If false, residuals of the pixel are
    /// attributed to splats that are not visible in frame 1.
    pub is_constrained: bool,
}

/// One supervised image for a [`crate::DescentEngine`]: the targets of its render, in the crop that
/// edited splats reach. Its content is the same in every step with the same `index`.
#[derive(Debug, Clone, Copy)]
pub struct DescentImage<'a> {
    /// Index of the image, stable over the run.
    pub index: usize,
    /// `[W, H]` of the whole image, pixels; losses are means over it.
    pub size: [usize; 2],
    /// The rectangle of the arrays below, whose shape is `h` = its height by `w` = its width.
    pub crop: Crop,
    /// Render without offsets, RGB, 0 to 1, `[h,w,3]`.
    pub original: &'a [f32],
    /// Target where [`DescentImage::FORE`] is set, RGB, 0 to 1, `[h,w,3]`.
    pub warp: &'a [f32],
    /// Bits [`DescentImage::FORE`], [`DescentImage::BACK`] and [`DescentImage::LIVE`], `[h,w]`.
    pub flags: &'a [u8],
    /// The visible edited splats, ascending by row, each once.
    pub entries: &'a [Entry],
}

impl DescentImage<'_> {
    /// Pixel bit: `warp` supervises (L1 and SSIM).
    pub const FORE: u8 = 1;
    /// Pixel bit: `original` supervises (L1).
    pub const BACK: u8 = 2;
    /// Pixel bit: an edited splat is visible. Elsewhere the render is `original` for any offsets.
    pub const LIVE: u8 = 4;
}
