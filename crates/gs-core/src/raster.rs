//! [`Rasterizer`]: prepare once, composite whenever colours change, differentiate.

use crate::{Camera, CameraError, Footprint, Image, Real, Splats, SplatsError, TileSet};
use thiserror::Error;

/// Settings of a render besides splats and camera. None of them affects the prepared state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderParams {
    /// Background colour, 0 to 1, added to RGB only, as `T_final · background`. Default black.
    pub background: [f64; 3],
    /// Whether to composite the splats' own colours (SH evaluated towards the camera). Default
    /// true; if false, SH is not read.
    pub rgb: bool,
    /// Whether to composite camera depth. Default true.
    pub depth: bool,
    /// Which derivative to compute (backward only). Default [`GradientConvention::Reference`].
    pub gradients: GradientConvention,
}

impl Default for RenderParams {
    fn default() -> Self {
        Self {
            background: [0.0; 3],
            rgb: true,
            depth: true,
            gradients: GradientConvention::Reference,
        }
    }
}

/// Two conventions for the backward pass. They differ where alpha is capped at 0.99, where the
/// guard band of the projection is active, and by a damping term in the inverse of the covariance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GradientConvention {
    /// The gradients of the reference kernels, with which published models were trained.
    #[default]
    Reference,
    /// The true derivative, with all discrete decisions (lists, order, skips, stops) held fixed.
    Exact,
}

/// Images composited for one camera: row-major, channels innermost. A plane that was not requested
/// is empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RenderOutput<F = f32> {
    /// `W`, columns.
    pub width: usize,
    /// `H`, rows.
    pub height: usize,
    /// `F`, the caller's channels per pixel.
    pub num_features: usize,
    /// `Σ f α T + T_final·background`, `[H,W,3]`; empty without [`RenderParams::rgb`].
    pub rgb: Vec<F>,
    /// `1 − T_final`, `[H,W]`.
    pub alpha: Vec<F>,
    /// `Σ z α T`, camera depth in world units, **not** divided by alpha, `[H,W]`; empty without
    /// [`RenderParams::depth`].
    pub depth: Vec<F>,
    /// `Σ f α T` of the caller's channels, no background, `[H,W,F]`.
    pub features: Vec<F>,
}

impl<F: Real> RenderOutput<F> {
    fn image_of(&self, values: &[F], channels: usize) -> Image {
        let data: Vec<f32> = values.iter().map(|value| value.as_f32()).collect();
        if data.is_empty() {
            return Image::default();
        }
        Image { width: self.width, height: self.height, channels, data }
    }

    /// Copy of `rgb` as an image of 3 channels (an empty image if it was not requested).
    pub fn rgb_image(&self) -> Image {
        self.image_of(&self.rgb, 3)
    }

    /// Copy of `alpha` as an image of 1 channel.
    pub fn alpha_image(&self) -> Image {
        self.image_of(&self.alpha, 1)
    }

    /// Copy of `depth` as an image of 1 channel (an empty image if it was not requested).
    pub fn depth_image(&self) -> Image {
        self.image_of(&self.depth, 1)
    }

    /// Copy of `features` as an image of `num_features` channels (an empty image if there are
    /// none).
    pub fn features_image(&self) -> Image {
        self.image_of(&self.features, self.num_features)
    }
}

/// `∂L/∂output`, planes as in [`RenderOutput`]. An empty plane means zero.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UpstreamGrads<F = f32> {
    /// With respect to colour, `[H,W,3]`.
    pub v_rgb: Vec<F>,
    /// With respect to alpha, `[H,W]`.
    pub v_alpha: Vec<F>,
    /// With respect to depth, per world unit, `[H,W]`.
    pub v_depth: Vec<F>,
    /// With respect to the caller's channels, `[H,W,F]`.
    pub v_features: Vec<F>,
}

/// `∂L/∂parameter` of the **stored** parameters (activations differentiated too), arrays as in
/// [`Splats`].
///
/// Rows of splats that draw nothing are exactly zero. Arrays that a call does not compute are left
/// empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RenderGrads<F = f32> {
    /// With respect to the centre, world frame, per world unit, `[N,3]`.
    pub v_means: Vec<[F; 3]>,
    /// With respect to the raw quaternion `wxyz`, `[N,4]`.
    pub v_quats: Vec<[F; 4]>,
    /// With respect to the logarithms of the standard deviations, `[N,3]`.
    pub v_log_scales: Vec<[F; 3]>,
    /// With respect to the opacity logit, `[N]`.
    pub v_opacity_logits: Vec<F>,
    /// With respect to the SH coefficients, `[N,K,3]`.
    pub v_sh: Vec<[F; 3]>,
    /// With respect to the caller's features, `[N,F]`, flat.
    pub v_features: Vec<F>,
    /// With respect to the projected centre, per pixel, `[N,2]`. The densification statistic of
    /// 3DGS is the norm of this times `(W/2, H/2)`.
    pub v_means2d: Vec<[F; 2]>,
}

/// Error of a rasteriser.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The camera is invalid.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The splats' arrays have inconsistent lengths.
    #[error(transparent)]
    Splats(#[from] SplatsError),
    /// The shape of an argument does not match the prepared state.
    #[error("rasteriser: `{what}` has {found} values, expected {expected}")]
    Shape {
        /// Name of the argument.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Values needed.
        expected: usize,
    },
    /// A backward pass without the forward pass it differentiates.
    #[error("rasteriser: backward without a preceding forward on the same prepared state")]
    NoForward,
    /// The device failed or ran out of memory.
    #[error("rasteriser: {0}")]
    Device(String),
}

/// Verifies that `tiles` belongs to an image of the size of `camera`.
///
/// # Errors
/// [`RasterError::Shape`] if it does not.
pub fn check_tiles(tiles: &TileSet, camera: &Camera) -> Result<(), RasterError> {
    let expected = TileSet::new(camera.width as usize, camera.height as usize);
    if tiles.size() == expected.size() {
        return Ok(());
    }
    let (found, expected) = (tiles.flags().len(), expected.flags().len());
    Err(RasterError::Shape { what: "tiles", found, expected })
}

/// A differentiable splat rasteriser: prepare (geometry, camera) → forward (colours, opacities,
/// features) → backward.
///
/// The prepared state owns what depends on geometry and camera alone (projection, depth
/// order, tile lists), the memory of every later stage, and what the last forward pass keeps
/// for its backward pass, including device buffers. It stays valid while `means`, `quats`,
/// `log_scales` and the camera are unchanged: SH, opacities and features may change between
/// forward passes without a new `prepare`, and the image is the same as after a new one. (A
/// splat whose opacity was NaN at `prepare` stays culled.)
///
/// The `_into` methods reuse the memory of their output argument; nothing is read back from a
/// device except the requested planes.
pub trait Rasterizer<F: Real = f32> {
    /// Geometry projected for one camera, ready to composite.
    type Prepared;

    /// Projects, culls, sorts and bins.
    ///
    /// # Errors
    /// If the camera or the splats' shapes are malformed, or the device fails. Splats with invalid
    /// values are culled and are not an error.
    fn prepare(&self, splats: &Splats<F>, camera: &Camera) -> Result<Self::Prepared, RasterError>;

    /// As [`Rasterizer::prepare`], reusing the memory of an earlier prepared state.
    ///
    /// # Errors
    /// As [`Rasterizer::prepare`].
    fn prepare_into(
        &self,
        splats: &Splats<F>,
        camera: &Camera,
        prepared: &mut Self::Prepared,
    ) -> Result<(), RasterError>;

    /// As [`Rasterizer::prepare_into`], for the pixels of `tiles` only: every later pass may treat
    /// other tiles as if no splat reached them. Their upstream gradients must be zero.
    ///
    /// The default prepares the whole image.
    ///
    /// # Errors
    /// As [`Rasterizer::prepare`], or if `tiles` belongs to an image of a different size.
    fn prepare_tiles_into(
        &self,
        splats: &Splats<F>,
        camera: &Camera,
        tiles: &TileSet,
        prepared: &mut Self::Prepared,
    ) -> Result<(), RasterError> {
        check_tiles(tiles, camera)?;
        self.prepare_into(splats, camera, prepared)
    }

    /// [`Rasterizer::prepare_tiles_into`], freshly allocated.
    ///
    /// # Errors
    /// As [`Rasterizer::prepare_tiles_into`].
    fn prepare_tiles(
        &self,
        splats: &Splats<F>,
        camera: &Camera,
        tiles: &TileSet,
    ) -> Result<Self::Prepared, RasterError> {
        let mut prepared = self.unprepared(camera)?;
        self.prepare_tiles_into(splats, camera, tiles, &mut prepared)?;
        Ok(prepared)
    }

    /// A prepared state of no splats, for the memory of [`Rasterizer::prepare_into`] and
    /// [`Rasterizer::prepare_tiles_into`].
    ///
    /// # Errors
    /// If the camera is malformed, or the device fails.
    fn unprepared(&self, camera: &Camera) -> Result<Self::Prepared, RasterError> {
        self.prepare(&Splats::default(), camera)
    }

    /// The part of the image that splat `row` can reach from `camera`, and its depth; `None` if it
    /// draws nothing. Never smaller than what a forward pass would draw, for any opacity. Lets
    /// callers skip splats that cannot affect their result.
    ///
    /// The default follows [`crate::image_formation`]; rasterisers with a different image formation
    /// override it.
    ///
    /// # Panics
    /// If `row` is out of range.
    fn footprint(&self, splats: &Splats<F>, row: usize, camera: &Camera) -> Option<Footprint> {
        Footprint::of(splats, row, camera)
    }

    /// Composites the splats' colours and depth (as `params` selects) and
    /// `features` (`[N,F]`, flat; empty for none).
    ///
    /// # Errors
    /// If shapes differ from those of the prepared state, or the device fails.
    fn forward_into(
        &self,
        prepared: &mut Self::Prepared,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
        output: &mut RenderOutput<F>,
    ) -> Result<(), RasterError>;

    /// Gradients of every parameter, of the **last forward pass** of `prepared`; pass the same
    /// `splats`, `features` and `params`.
    ///
    /// # Errors
    /// If there was no forward pass, shapes differ from it, or the device fails.
    fn backward_into(
        &self,
        prepared: &mut Self::Prepared,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
        upstream: &UpstreamGrads<F>,
        grads: &mut RenderGrads<F>,
    ) -> Result<(), RasterError>;

    /// As [`Rasterizer::backward_into`] for SH and features alone, with geometry and opacity held
    /// fixed: fills `v_sh` and `v_features` in one front-to-back pass and leaves the other arrays
    /// empty. `v_alpha` and `v_depth` are not read.
    ///
    /// With one feature and a pixel mask as `v_features`, `v_features` of the result is the weight
    /// of the mask in each splat, `Σ_p m_p α T`.
    ///
    /// # Errors
    /// As [`Rasterizer::backward_into`].
    fn backward_colors_into(
        &self,
        prepared: &mut Self::Prepared,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
        upstream: &UpstreamGrads<F>,
        grads: &mut RenderGrads<F>,
    ) -> Result<(), RasterError>;

    /// Sums of pixel values per splat, `Σ_p plane_p α T`: `planes.v_features` has `channels` planes
    /// (`[H,W,F]`; its other arrays are not read), and `sums.v_features` is set to `[N,F]`. Unlike
    /// [`Rasterizer::backward_colors_into`] it needs no forward pass; it invalidates the last one.
    ///
    /// # Errors
    /// As [`Rasterizer::forward_into`].
    fn lift_into(
        &self,
        prepared: &mut Self::Prepared,
        splats: &Splats<F>,
        planes: &UpstreamGrads<F>,
        channels: usize,
        sums: &mut RenderGrads<F>,
    ) -> Result<(), RasterError> {
        let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
        let features = vec![F::zero(); splats.len() * channels];
        self.forward_into(prepared, splats, &features, &params, &mut RenderOutput::default())?;
        self.backward_colors_into(prepared, splats, &features, &params, planes, sums)
    }

    /// [`Rasterizer::forward_into`], freshly allocated.
    ///
    /// # Errors
    /// As [`Rasterizer::forward_into`].
    fn forward(
        &self,
        prepared: &mut Self::Prepared,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
    ) -> Result<RenderOutput<F>, RasterError> {
        let mut output = RenderOutput::default();
        self.forward_into(prepared, splats, features, params, &mut output)?;
        Ok(output)
    }

    /// [`Rasterizer::backward_into`], freshly allocated.
    ///
    /// # Errors
    /// As [`Rasterizer::backward_into`].
    fn backward(
        &self,
        prepared: &mut Self::Prepared,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
        upstream: &UpstreamGrads<F>,
    ) -> Result<RenderGrads<F>, RasterError> {
        let mut grads = RenderGrads::default();
        self.backward_into(prepared, splats, features, params, upstream, &mut grads)?;
        Ok(grads)
    }

    /// [`Rasterizer::backward_colors_into`], freshly allocated.
    ///
    /// # Errors
    /// As [`Rasterizer::backward_colors_into`].
    fn backward_colors(
        &self,
        prepared: &mut Self::Prepared,
        splats: &Splats<F>,
        features: &[F],
        params: &RenderParams,
        upstream: &UpstreamGrads<F>,
    ) -> Result<RenderGrads<F>, RasterError> {
        let mut grads = RenderGrads::default();
        self.backward_colors_into(prepared, splats, features, params, upstream, &mut grads)?;
        Ok(grads)
    }
}
