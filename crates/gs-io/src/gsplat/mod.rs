//! Checkpoints of gsplat's trainers (`ckpt_*.pt`): a dictionary `splats` with `means`,
//! `scales`, `quats`, `opacities`, `sh0`, `shN`. With `times`, `durations` and
//! `velocities` it is a dynamic scene ([`crate::freetime`]).

use crate::frame::FrameError;
use crate::pth::{self, Layers};
use gs_core::{Splats, sh};

/// Unsupported parameters that affect the appearance.
const UNSUPPORTED: [&str; 3] = ["features", "colors", "color_velocities"];
/// Number of bytes at the start of a file that are searched for names.
const HEAD: usize = 1 << 16;

/// Contents of a checkpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Contents {
    /// One frame.
    Still,
    /// Splats with times and velocities.
    Moving,
}

/// Contents according to the first bytes of a PyTorch archive, which
/// contain the names; `None` for other archives.
pub(crate) fn contents(start: &[u8]) -> Option<Contents> {
    let start = &start[..start.len().min(HEAD)];
    let has = |name: &str| {
        // Encoding of text in pickles: length, then bytes.
        let mut written = vec![b'X'];
        written.extend(u32::try_from(name.len()).unwrap_or_default().to_le_bytes());
        written.extend(name.bytes());
        start.windows(written.len()).any(|window| window == written)
    };
    if !["means", "quats", "scales", "sh0"].into_iter().all(has) {
        return None;
    }
    let moves = has("times") || has("durations") || has("velocities");
    Some(if moves { Contents::Moving } else { Contents::Still })
}

/// Reads a checkpoint of one frame.
///
/// # Errors
/// If the bytes are of another kind, or a dynamic scene.
pub(crate) fn read(bytes: &[u8]) -> Result<Splats, FrameError> {
    let damaged = |what: String| FrameError::damaged("gsplat checkpoint", what);
    let tensors = pth::read(bytes)
        .and_then(pth::Root::into_state_dict)
        .map_err(|error| damaged(error.to_string()))?;
    let layers = Layers::new(pth::beside(tensors, &["means"]));
    if layers.has("times") {
        return Err(FrameError::Moving { what: "FreeTimeGS" });
    }
    splats(&layers).map_err(damaged)
}

/// One value per splat, `[N]` or `[N, 1]`.
pub(crate) fn column(layers: &Layers<'_>, name: &str, n: usize) -> Result<Vec<f32>, String> {
    let tensor = layers.need(name)?;
    match *tensor.shape() {
        [rows] | [rows, 1] if rows == n => Ok(tensor.to_f32s()),
        ref shape => Err(format!("`{name}` has shape {shape:?}, expected [{n}] or [{n}, 1]")),
    }
}

/// The splats of a checkpoint.
pub(crate) fn splats(layers: &Layers<'_>) -> Result<Splats, String> {
    if let Some(name) = UNSUPPORTED.iter().find(|name| layers.has(name)) {
        return Err(format!(
            "contains `{name}`: colours other than spherical harmonics are not supported; train \
            with SH colours (sh0, shN)"
        ));
    }
    let &[n, 3] = layers.need("means")?.shape() else {
        return Err(format!(
            "`means` has shape {:?}, expected [splats, 3]",
            layers.need("means")?.shape()
        ));
    };
    if n == 0 {
        return Err("contains no splats".to_owned());
    }
    let three = |name: &str| layers.values(name, &[n, 3]);
    let (means, log_scales) = (three("means")?, three("scales")?);
    let quats = layers.values("quats", &[n, 4])?;
    let opacity_logits = column(layers, "opacities", n)?;
    let dc = layers.values("sh0", &[n, 1, 3])?;
    let rest = layers.need("shN")?;
    let &[rows, higher, 3] = rest.shape() else {
        return Err(format!("`shN` has shape {:?}, expected [{n}, coefficients, 3]", rest.shape()));
    };
    let sh_degree = sh::degree_of(higher + 1).filter(|_| rows == n).ok_or_else(|| {
        format!(
            "`shN` has shape [{rows}, {higher}, 3], expected [{n}, K, 3] with K = 0, 3, 8 or 15 (SH degree 0 to 3)"
        )
    })?;
    let rest = rest.to_f32s();
    let mut coefficients = Vec::with_capacity(n * (higher + 1));
    for row in 0..n {
        coefficients.push([dc[3 * row], dc[3 * row + 1], dc[3 * row + 2]]);
        let own = &rest[3 * higher * row..3 * higher * (row + 1)];
        coefficients.extend_from_slice(own.as_chunks::<3>().0);
    }
    Ok(Splats {
        means: means.as_chunks::<3>().0.to_vec(),
        quats: quats.as_chunks::<4>().0.to_vec(),
        log_scales: log_scales.as_chunks::<3>().0.to_vec(),
        opacity_logits,
        sh: coefficients,
        sh_degree,
    })
}
