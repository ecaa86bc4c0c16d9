//! Constants of the image formation, the only place that states them.
//!
//! They are those of the tile rasteriser that 3DGS, 4DGS and Swift4D scenes were trained with
//! (Kerbl et al. 2023). A scene looks as it was trained only with these values. Shaders cannot
//! import Rust: tests of `gs-raster-wgpu` and `gs-player` compare the constants of the WGSL and
//! GLSL sources with [`CONSTANTS`].

/// Side of a square tile, pixels. The image depends on it, because splats are clipped to whole
/// tiles.
pub const TILE_SIZE: u32 = 16;
/// Near plane of the cameras of training, world units; the default of [`crate::Camera::near`],
/// which owns the value of a view. Other cameras have one that follows the scene's size
/// ([`crate::Extent::near_plane`]).
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
/// A pixel ends before the first splat that would bring its transmittance below this.
pub const TRANSMITTANCE_THRESHOLD: f32 = 1e-4;
/// Added to the camera depth that the projected centre is divided by, in near planes: 1e-7 world
/// units at [`NEAR_PLANE`].
pub const EPS_DIVIDE: f64 = 1e-7 / NEAR_PLANE;
/// Floor of a quaternion's norm when it is normalised.
pub const MIN_QUAT_NORM: f32 = 1e-12;

/// Name and value of every constant above that shaders state too, for comparison with them. The
/// lengths among the others, near plane and [`EPS_DIVIDE`], they are given.
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
