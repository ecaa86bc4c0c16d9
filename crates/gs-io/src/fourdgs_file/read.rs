//! Reading `.4dgs` files as scenes.

use super::FourdgsError;
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::repair::{self, Sanitized};
use crate::scene_kind::SceneKind;
use fourdgs::GaussianSet;
use gs_core::{Splats, activation, sh};
use gs_deform::{FadeLimits, Polynomial, PolynomialScene};
use std::path::Path;

/// The supported temporal model.
const BIRTH: &str = "gaussian-birth";
/// Largest number of bytes that rows may take in memory per byte of the file. Streams are
/// compressed, and static data compress well.
const MAX_GROWTH: u64 = 320;
/// Smallest size of a row in memory, bytes.
const ROW: u64 = 64;
/// Frames per second for commands without a given number of frames, and the largest number of
/// frames.
const FPS: f64 = 30.0;
const MAX_FRAMES: f64 = 10_000.0;
/// Opacities are clamped to this distance from 0 and 1, so that their logits are finite.
const OPACITY_MARGIN: f32 = 1e-6;
/// Levels of a byte of SH: coefficient = 8·b/255 − 4.
const SH_RANGE: f32 = 8.0;

/// Opens a `.4dgs` file.
///
/// # Errors
/// If the file cannot be read, is damaged, or has an unsupported temporal model.
pub fn open(path: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let wrong = |error: FourdgsError| IoError::format(path)(error);
    let damaged = |error: String| wrong(FourdgsError::Damaged(error));
    let bytes = read_bytes(path)?;
    let model = fourdgs::keyframe_delta_file::peek_temporal_model(&bytes)
        .map_err(|error| damaged(error.to_string()))?;
    if model != BIRTH {
        return Err(wrong(FourdgsError::TemporalModel { found: model, expected: BIRTH }));
    }
    let read_options = fourdgs::ReadOptions { recover_truncated: false, max_sh_band: 3 };
    let scene = fourdgs::read_from(&bytes[..], &read_options)
        .map_err(|error| damaged(error.to_string()))?;
    let rows = scene.gaussians.count() as u64;
    if rows == 0 {
        return Err(wrong(FourdgsError::Empty));
    }
    if rows.saturating_mul(ROW) > (bytes.len() as u64).saturating_mul(MAX_GROWTH) {
        return Err(wrong(FourdgsError::Rows { rows, bytes: bytes.len() }));
    }
    let duration = scene.duration_sec;
    if !(duration.is_finite() && duration > 0.0) {
        return Err(wrong(FourdgsError::Duration { seconds: duration }));
    }
    let mut notes = Vec::new();
    if !scene.audio_sources.is_empty() {
        notes.push("its sound is ignored".to_owned());
    }
    if scene.metadata.iter().any(says_linear) {
        notes.push("its colours are in linear light; they are shown as stored".to_owned());
    }
    if scene.gaussians.object_id.iter().flatten().any(|&id| id != 0) {
        return Err(wrong(FourdgsError::Tracks));
    }
    let (splats, motions, windows) = rows_of(&scene.gaussians);
    let broken = |row: usize| {
        let motion: &Polynomial = &motions[row];
        let values = motion.velocity[0].iter().chain([&motion.centre]);
        !values.into_iter().all(|value| value.is_finite())
            || motion.width.is_nan()
            || windows[row].iter().any(|time| time.is_nan())
    };
    let Sanitized { splats, kept, report } =
        repair::sanitize_with(splats, options.damage, broken).map_err(IoError::damaged(path))?;
    let (motions, windows) = match kept {
        None => (motions, windows),
        Some(kept) => kept.into_iter().map(|row| (motions[row], windows[row])).unzip(),
    };
    #[expect(clippy::cast_possible_truncation, reason = "a threshold")]
    let cutoff = (scene.header.cutoff as f32).next_down().max(0.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let frames = (duration * FPS).round().clamp(2.0, MAX_FRAMES) as usize;
    let facts = vec![
        ("motion", "linear".to_owned()),
        ("seconds", duration.to_string()),
        ("written by", scene.header.library.clone()),
    ];
    let scene = PolynomialScene::new(splats, motions)
        .and_then(|scene| scene.with_windows(windows))
        .map_err(IoError::format(path))?
        .with_fade_limits(FadeLimits { floor: 0.0, cutoff })
        .with_clock(0.0, duration.next_down())
        .with_frames(frames);
    Ok(OpenedScene {
        facts,
        notes,
        repair: report,
        // The format has no frames; with this rate the clip has the duration stated in the file.
        fps: Some(frames as f64 / duration),
        ..OpenedScene::new(SceneKind::Fourdgs, scene, vec![path.to_owned()])
    })
}

/// Whether the metadata declare linear-light colours.
fn says_linear(metadata: &fourdgs::Metadata) -> bool {
    metadata.entries.iter().any(|(key, value)| key == "color_space" && value == "linear")
}

/// Splats, their motions per second, and their windows in seconds.
fn rows_of(set: &GaussianSet) -> (Splats, Vec<Polynomial>, Vec<[f32; 2]>) {
    let n = set.count();
    let three = |values: &[f32], row: usize| [0, 1, 2].map(|k| values[3 * row + k]);
    let higher = set.sh.as_ref().map_or(0, |_| set.sh_coefficients);
    let sh_degree = sh::degree_of(higher + 1).unwrap_or(0);
    let higher = sh::num_coeffs(sh_degree) - 1;
    let mut splats = Splats::with_capacity(n, sh_degree);
    let (mut motions, mut windows) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for row in 0..n {
        splats.means.push(three(&set.positions, row));
        let [x, y, z, w] = [0, 1, 2, 3].map(|k| set.rotations[4 * row + k]);
        splats.quats.push([w, x, y, z]);
        splats.log_scales.push(three(&set.scales, row).map(f32::ln));
        let [r, g, b, alpha] = [0, 1, 2, 3].map(|k| set.colors[4 * row + k]);
        let opacity = alpha.clamp(OPACITY_MARGIN, 1.0 - OPACITY_MARGIN);
        splats.opacity_logits.push(activation::logit(opacity));
        splats.sh.push(sh::dc_from_rgb([r, g, b]));
        let bytes = set.sh.as_deref().unwrap_or_default();
        for k in 0..higher {
            let level = |channel: usize| bytes[(3 * row + channel) * set.sh_coefficients + k];
            let coefficient = |byte: u8| f32::from(byte) * SH_RANGE / 255.0 - SH_RANGE / 2.0;
            splats.sh.push([0, 1, 2].map(|channel| coefficient(level(channel))));
        }
        motions.push(Polynomial {
            velocity: [three(&set.motions, row), [0.0; 3], [0.0; 3]],
            omega: [0.0; 4],
            centre: set.mu_t[row],
            width: std::f32::consts::SQRT_2 * set.sigma_t[row].max(f32::MIN_POSITIVE),
        });
        windows.push([set.win_lo[row], set.win_hi[row]]);
    }
    (splats, motions, windows)
}
