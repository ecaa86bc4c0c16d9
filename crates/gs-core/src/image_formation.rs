//! Constants of the image formation; no other file defines them.
//!
//! They are those of the tile rasteriser that 3DGS, 4DGS and Swift4D scenes were trained with
//! (Kerbl et al. 2023); with other values a scene looks different from its training images. Shaders
//! cannot import Rust: tests of `gs-raster-wgpu` and `gs-player` compare the constants of the WGSL
//! and GLSL sources with [`CONSTANTS`].

/// Side of a square tile, pixels. The image depends on it, because splats are clipped to whole
/// tiles.
pub const TILE_SIZE: u32 = 16;
/// Near plane of training cameras, world units; default of [`crate::Camera::near`], the value of
/// each view. Other cameras use one derived from the scene's size ([`crate::Extent::near_plane`]).
pub const NEAR_PLANE: f64 = 0.2;
/// Low-pass filter: added to the diagonal of the projected covariance, pixels².
pub const EPS2D: f32 = 0.3;
/// Half side of the square that a splat is clipped to, in standard deviations along its longest
/// projected axis.
pub const EXTENT_SIGMAS: f32 = 3.0;
/// Floor of the discriminant of the projected covariance's eigenvalues, pixels⁴. It widens the
/// clipping square of nearly round splats.
pub const MIN_DISCRIMINANT: f32 = 0.1;
/// Guard band: `|x/z|` and `|y/z|` of a splat's centre are clamped to this many half fields of view
/// in the projection's Jacobian.
pub const GUARD_BAND: f32 = 1.3;
/// Upper bound of the alpha of one splat at one pixel.
pub const MAX_ALPHA: f32 = 0.99;
/// A splat is not drawn at pixels where its alpha is below this.
pub const ALPHA_THRESHOLD: f32 = 1.0 / 255.0;
/// Compositing of a pixel stops before the first splat that
/// would bring its transmittance below this.
pub const TRANSMITTANCE_THRESHOLD: f32 = 1e-4;
/// Added to the camera depth before the perspective division, in near
/// planes: 1e-7 world units at [`NEAR_PLANE`].
pub const EPS_DIVIDE: f64 = 1e-7 / NEAR_PLANE;
/// Floor of a quaternion's norm when it is normalised.
pub const MIN_QUAT_NORM: f32 = 1e-12;

/// Name and value of every constant above that shaders define too, for comparison with their
/// sources. The two lengths, near plane and [`EPS_DIVIDE`], are passed to shaders as uniforms.
pub const CONSTANTS: &[(&str, f32)] = &[
    ("TILE_SIZE", TILE_SIZE as f32),
    ("EPS2D", EPS2D),
    ("EXTENT_SIGMAS", EXTENT_SIGMAS),
    ("MIN_DISCRIMINANT", MIN_DISCRIMINANT),
    ("GUARD_BAND", GUARD_BAND),
    ("MAX_ALPHA", MAX_ALPHA),
    ("ALPHA_THRESHOLD", ALPHA_THRESHOLD),
    ("TRANSMITTANCE_THRESHOLD", TRANSMITTANCE_THRESHOLD),
    ("MIN_QUAT_NORM", MIN_QUAT_NORM),
];
