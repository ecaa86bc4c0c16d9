//! Reading `.splatv` files as scenes.

use super::SplatvError;
use super::row::{BYTES, Row};
use crate::content::magic::SPLATV;
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::repair::{self, Damage, RepairReport, Sanitized};
use gs_core::Splats;
use gs_deform::PolynomialScene;
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
struct Part {
    #[serde(rename = "type")]
    kind: String,
    size: u64,
    /// Written by this crate; other writers do not write this key, other readers ignore it.
    #[serde(default)]
    c4d_up: Option<[f64; 3]>,
}

/// A `.splatv` scene and its properties.
#[derive(Debug)]
#[non_exhaustive]
pub struct OpenedClip {
    /// The scene, times 0 to 1.
    pub scene: PolynomialScene,
    /// Damaged rows.
    pub repair: RepairReport,
    /// The world's upward direction (about unit length), if the file was written by this crate.
    pub up: Option<[f64; 3]>,
}

/// Reads a scene. Rows of zeros are padding. Sizes of zero are flat splats
/// ([`repair::FLAT_LOG_SCALE`]); opacities of 0 and 255 become 10⁻⁶ and 1 − 10⁻⁶, so that all
/// stored parameters are finite.
///
/// # Errors
/// If the bytes are not a `.splatv` or contain no splats, or if rows are damaged and `damage` is
/// [`Damage::Fail`].
pub fn read(bytes: &[u8], damage: Damage) -> Result<OpenedClip, SplatvError> {
    let rest = bytes.strip_prefix(&SPLATV).ok_or(SplatvError::Magic)?;
    let cut = || SplatvError::Header("it is truncated".to_owned());
    let (length, rest) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
    let length = u32::from_le_bytes(*length) as usize;
    let (header, payload) = rest.split_at_checked(length).ok_or_else(cut)?;
    let parts: Vec<Part> =
        serde_json::from_slice(header).map_err(|error| SplatvError::Header(error.to_string()))?;
    let mut start = 0_usize;
    let (mut splats, mut up) = (None, None);
    for part in parts {
        let size = usize::try_from(part.size).unwrap_or(usize::MAX);
        if part.kind == "splat" {
            let from = payload.get(start..).unwrap_or_default();
            // Some files omit the padding that the header includes in the size.
            splats = Some(&from[..from.len().min(size)]);
            let length = |up: &[f64; 3]| up.iter().map(|c| c * c).sum::<f64>().sqrt();
            up = part.c4d_up.filter(|up| (0.5..2.0).contains(&length(up)));
            break;
        }
        start = start.saturating_add(size);
    }
    let data = splats.ok_or_else(|| SplatvError::Header("it lists no splats".to_owned()))?;
    let (rows, odd) = data.as_chunks::<BYTES>();
    if !odd.is_empty() {
        return Err(SplatvError::Truncated { found: data.len() });
    }

    let mut splats = Splats::with_capacity(rows.len(), 0);
    let (mut motions, mut broken) = (Vec::with_capacity(rows.len()), Vec::new());
    for bytes in rows.iter().filter(|bytes| **bytes != [0; BYTES]) {
        let row = Row::from_bytes(bytes);
        splats.means.push(row.mean);
        splats.quats.push(row.quat);
        splats.log_scales.push(row.log_scale());
        splats.opacity_logits.push(row.opacity_logit());
        splats.sh.push(row.sh_dc());
        motions.push(row.motion);
        broken.push(row.motion_is_damaged());
    }
    if splats.is_empty() {
        return Err(SplatvError::Empty);
    }
    let Sanitized { splats: rest, kept, report: repair } =
        repair::sanitize_with(splats, damage, |row| broken[row])?;
    if let Some(kept) = kept {
        motions = kept.into_iter().map(|row| motions[row]).collect();
    }
    let scene = PolynomialScene::new(rest, motions)
        .map_err(|error| SplatvError::Header(error.to_string()))?;
    Ok(OpenedClip { scene, repair, up })
}

/// Reads a file.
///
/// # Errors
/// If it cannot be read, or as [`read`].
pub fn open(path: &Path, damage: Damage) -> Result<OpenedClip, IoError> {
    read(&read_bytes(path)?, damage).map_err(IoError::format(path))
}
