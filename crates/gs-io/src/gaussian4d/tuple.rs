//! The tuple of parameters: the meaning of each position.

use super::Gaussian4dError;
use crate::pth::{Layers, Tensor};
use gs_core::{Splats, sh};
use gs_deform::Gaussians4d;

/// Positions in the tuple, which is nested in a tuple with the iteration.
mod tuple_path {
    pub(super) const MEANS: &str = "0.1";
    pub(super) const DC: &str = "0.2";
    pub(super) const REST: &str = "0.3";
    pub(super) const LOG_SCALES: &str = "0.4";
    pub(super) const QUATS: &str = "0.5";
    pub(super) const OPACITIES: &str = "0.6";
    pub(super) const TIMES: &str = "0.13";
    pub(super) const LOG_SCALES_T: &str = "0.14";
    pub(super) const RIGHT_QUATS: &str = "0.15";
    pub(super) const ENV_MAP: &str = "0.17";
}

/// Coefficients of SH of degree 3, alone and with two cosine terms in time.
const SH_COEFFS: usize = 16;
const TIME_VARYING_COEFFS: usize = 3 * SH_COEFFS;
/// Number of coefficients allocated without 4D SH; those after the first 16 are never used.
const PADDED_COEFFS: usize = 33;

/// The Gaussians, and notes for the user.
pub(super) fn gaussians(
    tensors: Vec<(String, Tensor<'_>)>,
) -> Result<(Gaussians4d, Vec<String>), Gaussian4dError> {
    let layers = Layers::new(tensors);
    let means = layers.get(tuple_path::MEANS).map(Tensor::shape);
    let Some(&[n, 3]) = means else {
        return Err(Gaussian4dError::Parameters(format!(
            "is not a checkpoint of native 4D Gaussians: its second part has shape {:?}, expected [N, 3] (centres); it has {}",
            means.unwrap_or_default(),
            layers.summary()
        )));
    };
    if !layers.has(tuple_path::TIMES) {
        return Err(Gaussian4dError::Still);
    }
    if n == 0 {
        return Err(Gaussian4dError::Empty);
    }
    let named = |what: &str, path: &str, shape: &[usize]| {
        layers.values(path, shape).map_err(|error| {
            Gaussian4dError::Parameters(format!(
                "{what}: {error}; it may be of a different version of 4D Gaussian Splatting"
            ))
        })
    };
    let means = named("centres", tuple_path::MEANS, &[n, 3])?;
    let log_scales = named("scales", tuple_path::LOG_SCALES, &[n, 3])?;
    let quats = named("rotations", tuple_path::QUATS, &[n, 4])?;
    let opacity_logits = named("opacities", tuple_path::OPACITIES, &[n, 1])?;
    let times = named("times", tuple_path::TIMES, &[n, 1])?;
    let log_scales_t = named("extents in time", tuple_path::LOG_SCALES_T, &[n, 1])?;
    // Empty or missing if space and time are not mixed.
    let right_quats = match layers.get(tuple_path::RIGHT_QUATS).filter(|tensor| !tensor.is_empty())
    {
        Some(_) => named("right rotations", tuple_path::RIGHT_QUATS, &[n, 4])?,
        None => Vec::new(),
    };
    let mut notes = Vec::new();
    if layers.get(tuple_path::ENV_MAP).is_some_and(|map| !map.is_empty()) {
        notes.push("its environment map is ignored: only splats are drawn".to_owned());
    }
    let dc = named("base colours", tuple_path::DC, &[n, 1, 3])?;
    let rest = layers.need(tuple_path::REST)?;
    let &[rows, higher, 3] = rest.shape() else {
        let what = format!("colours have shape {:?}, expected [{n}, K − 1, 3]", rest.shape());
        return Err(Gaussian4dError::Parameters(what));
    };
    let stored = higher + 1;
    let (kept, time_varying) = match stored {
        _ if rows != n => (None, false),
        TIME_VARYING_COEFFS => (Some(SH_COEFFS), true),
        PADDED_COEFFS => (Some(SH_COEFFS), false),
        _ => (sh::degree_of(stored).map(sh::num_coeffs), false),
    };
    let kept = kept.ok_or_else(|| {
        Gaussian4dError::Parameters(format!(
            "colours have shape [{rows}, {higher}, 3], expected [{n}, K − 1, 3] with K = {TIME_VARYING_COEFFS} (4D SH), {PADDED_COEFFS}, or 1, 4, 9 or {SH_COEFFS} (3D SH)"
        ))
    })?;
    let rest = rest.to_f32s();
    let (mut coefficients, mut waves) = (Vec::with_capacity(n * kept), Vec::new());
    for row in 0..n {
        coefficients.push([dc[3 * row], dc[3 * row + 1], dc[3 * row + 2]]);
        let own = rest[3 * higher * row..3 * higher * (row + 1)].as_chunks::<3>().0;
        coefficients.extend_from_slice(&own[..kept - 1]);
        if time_varying {
            waves.extend_from_slice(&own[kept - 1..]);
        }
    }
    let splats = Splats {
        means: means.as_chunks::<3>().0.to_vec(),
        quats: quats.as_chunks::<4>().0.to_vec(),
        log_scales: log_scales.as_chunks::<3>().0.to_vec(),
        opacity_logits,
        sh: coefficients,
        sh_degree: sh::degree_of(kept).unwrap_or_default(),
    };
    let right_quats = right_quats.as_chunks::<4>().0.to_vec();
    let gaussians =
        Gaussians4d { splats, times, log_scales_t, right_quats, waves, prefilter_var: 0.0 };
    Ok((gaussians, notes))
}
