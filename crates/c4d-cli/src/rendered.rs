//! [`RenderedImage`]: an image of a scene in memory.

use gs_core::{Camera, Image};

/// One image of a render.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderedImage {
    /// Index of the time among those rendered.
    pub frame: usize,
    /// Scene time.
    pub time: f32,
    /// The camera.
    pub camera: Camera,
    /// Name of the pass, as in `c4d render --passes`.
    pub pass: &'static str,
    /// Row-major, channels innermost: `[H,W,3]` for `rgb`, `[H,W,2]` for `flow` (pixels, NaN where
    /// nothing covers the pixel), else `[H,W,1]`.
    pub image: Image,
}
