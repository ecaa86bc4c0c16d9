//! Reading checkpoints.

use super::{Gaussian4dError, tuple};
use crate::cfg_args::{self, CfgArgs, Value};
use crate::error::IoError;
use crate::fs::text;
use crate::fs::{list_names, read_bytes};
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::pth;
use crate::repair::{self, Sanitized};
use crate::scene_kind::SceneKind;
use gs_deform::{Gaussian4dScene, Gaussians4d};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Names of parameter groups that identify this method's optimiser.
const MARKS: [&[u8]; 2] = [b"scaling_t", b"rotation_r"];
/// Number of bytes at the start of a file that are searched for them.
const HEAD: u64 = 1 << 18;
/// Best checkpoint by the trainer's own measure.
const BEST: &str = "chkpnt_best.pth";

/// Whether the first bytes of a PyTorch archive indicate such a checkpoint.
pub(crate) fn is_checkpoint(start: &[u8]) -> bool {
    MARKS.iter().all(|mark| start.windows(mark.len()).any(|window| window == *mark))
}

/// The newest checkpoint of a folder, or the requested one; `None` if there is none.
fn checkpoint_of(dir: &Path, wanted: Option<u64>) -> Result<Option<(PathBuf, String)>, IoError> {
    let number = |name: &str| -> Option<u64> {
        name.strip_prefix("chkpnt")?.strip_suffix(".pth")?.parse().ok()
    };
    let names = list_names(dir)?;
    let mut found: Vec<(u64, &String)> =
        names.iter().filter_map(|name| Some((number(name)?, name))).collect();
    found.sort();
    let chosen = match wanted {
        Some(wanted) => found.iter().find(|(number, _)| *number == wanted),
        None => found.last(),
    };
    Ok(match (chosen, wanted) {
        (Some((number, name)), _) => Some((dir.join(name), number.to_string())),
        (None, None) if names.iter().any(|name| name == BEST) => {
            Some((dir.join(BEST), "best".to_owned()))
        }
        _ => None,
    })
}

/// Whether a folder contains such a checkpoint.
pub(crate) fn looks_like_model(dir: &Path) -> bool {
    let Ok(Some((path, _))) = checkpoint_of(dir, None) else { return false };
    let mut start = Vec::new();
    crate::fs::open_file(&path)
        .and_then(|file| file.take(HEAD).read_to_end(&mut start))
        .is_ok_and(|_| is_checkpoint(&start))
}

/// Opens a checkpoint, or the newest of a model folder.
///
/// # Errors
/// If the file cannot be read or is of a different kind, or the time range is not given.
pub fn open(given: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let (path, mut facts) = if given.is_dir() {
        let (path, name) = checkpoint_of(given, options.iteration)?.ok_or_else(|| {
            let what = match options.iteration {
                Some(wanted) => format!("has no chkpnt{wanted}.pth; choose a different iteration"),
                None => "contains no chkpnt*.pth; use the folder that training wrote".to_owned(),
            };
            IoError::content(given, what)
        })?;
        (path, vec![("iteration", name)])
    } else {
        (given.to_owned(), Vec::new())
    };
    let bytes = read_bytes(&path)?;
    let tensors =
        pth::read(&bytes).and_then(pth::Root::into_state_dict).map_err(IoError::format(&path))?;
    let (mut gaussians, mut notes) = tuple::gaussians(tensors).map_err(IoError::format(&path))?;
    let (cfg, cfg_path) = read_cfg(&path)?;
    let number = |name: &str| cfg.get(name).and_then(Value::as_f64);
    gaussians.prefilter_var = number("prefilter_var").filter(|var| *var > 0.0).unwrap_or(0.0);
    let ratio = number("frame_ratio").filter(|ratio| *ratio > 0.0).unwrap_or(1.0);
    let [start, end] = options
        .time_duration
        .ok_or_else(|| unknown_times(&gaussians, ratio))
        .map_err(IoError::format(&path))?;
    if !(start.is_finite() && end.is_finite() && start < end) {
        return Err(IoError::format(&path)(Gaussian4dError::TimeRange { start, end }));
    }
    if ratio != 1.0 {
        notes
            .push(format!("frame_ratio = {ratio}: time_duration is divided by it, as in training"));
    }
    let mixed = !gaussians.right_quats.is_empty();
    facts.push(("times of training", format!("{start} to {end}")));
    facts.push((
        "motion",
        if mixed { "linear" } else { "none: rot_4d is off, so splats only fade" }.to_owned(),
    ));
    if !gaussians.waves.is_empty() {
        facts.push(("colour", "changes with time (4D spherical harmonics)".to_owned()));
    }
    let gaussians = without_damage(&path, gaussians, options)?;
    let (gaussians, report) = gaussians;
    let scene = Gaussian4dScene::new(gaussians, start / ratio, end / ratio)
        .map_err(IoError::format(&path))?;
    notes.push(
        "view dependence is evaluated at a splat's current position; the method's own renderer \
        uses its position at its own time"
            .to_owned(),
    );
    let background = cfg.get("white_background").and_then(Value::as_bool);
    let mut files = vec![path];
    files.extend(cfg_path);
    Ok(OpenedScene {
        facts,
        notes,
        repair: report,
        background: background.map(|white| if white { [1.0; 3] } else { [0.0; 3] }),
        ..OpenedScene::new(SceneKind::Gaussian4d, scene, files)
    })
}

/// Error for a missing time range.
fn unknown_times(gaussians: &Gaussians4d, ratio: f64) -> Gaussian4dError {
    let finite = || gaussians.times.iter().copied().filter(|time| time.is_finite());
    let first = f64::from(finite().fold(f32::INFINITY, f32::min)) * ratio;
    let last = f64::from(finite().fold(f32::NEG_INFINITY, f32::max)) * ratio;
    Gaussian4dError::UnknownTimes { first, last }
}

fn read_cfg(checkpoint: &Path) -> Result<(CfgArgs, Option<PathBuf>), IoError> {
    let path = checkpoint.with_file_name("cfg_args");
    if !path.is_file() {
        return Ok((CfgArgs::default(), None));
    }
    match cfg_args::parse(&text::decode(&read_bytes(&path)?)) {
        Ok(cfg) => Ok((cfg, Some(path))),
        Err(source) => Err(IoError::format(&path)(source)),
    }
}

/// Drops, keeps or rejects damaged rows.
fn without_damage(
    path: &Path,
    gaussians: Gaussians4d,
    options: &OpenOptions,
) -> Result<(Gaussians4d, repair::RepairReport), IoError> {
    let Gaussians4d {
        splats,
        mut times,
        mut log_scales_t,
        mut right_quats,
        mut waves,
        prefilter_var,
    } = gaussians;
    let coeffs = 2 * splats.sh_coeffs();
    let broken = |row: usize| {
        let right = right_quats.get(row).copied().unwrap_or([1.0; 4]);
        let waves = waves.get(row * coeffs..(row + 1) * coeffs).unwrap_or_default();
        let mut values = [times[row], log_scales_t[row]].into_iter().chain(right);
        !values.all(f32::is_finite)
            || right == [0.0; 4]
            || !waves.as_flattened().iter().all(|value| value.is_finite())
    };
    let Sanitized { splats, kept, report } =
        repair::sanitize_with(splats, options.damage, broken).map_err(IoError::damaged(path))?;
    if let Some(kept) = kept {
        let pick = |values: &[f32]| kept.iter().map(|&row| values[row]).collect();
        (times, log_scales_t) = (pick(&times), pick(&log_scales_t));
        if !right_quats.is_empty() {
            right_quats = kept.iter().map(|&row| right_quats[row]).collect();
        }
        if !waves.is_empty() {
            let rows = kept.iter().map(|&row| &waves[row * coeffs..(row + 1) * coeffs]);
            waves = rows.flatten().copied().collect();
        }
    }
    let gaussians = Gaussians4d { splats, times, log_scales_t, right_quats, waves, prefilter_var };
    Ok((gaussians, report))
}
