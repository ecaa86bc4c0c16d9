//! Reading `.tsog` archives as scenes.

use super::TsogError;
use super::meta::{META, Meta, Playback, Timeline, is_meta};
use super::rows::{self, Rows};
use crate::archive::{Archive, decompress};
use crate::error::IoError;
use crate::fs::read_bytes;
use crate::open_options::OpenOptions;
use crate::opened_scene::OpenedScene;
use crate::plane::Plane;
use crate::repair::{self, Sanitized};
use crate::scene_kind::SceneKind;
use gs_core::DynamicScene;
use gs_deform::{PolynomialScene, StaticScene};
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

/// Largest plausible number of splats per byte; real archives have about a tenth.
const MAX_SPLATS_PER_BYTE: u64 = 4;
/// Chunk of a lossy WebP image, and its offset in the file.
const LOSSY: &[u8] = b"VP8 ";
const LOSSY_AT: usize = 12;

/// Opens a `.tsog` archive.
///
/// # Errors
/// If the file cannot be read, is damaged, or has a different version, profile or timeline.
pub fn open(path: &Path, options: &OpenOptions) -> Result<OpenedScene, IoError> {
    let wrong = |what: String| IoError::format(path)(TsogError::Meta(what));
    let bytes = read_bytes(path)?;
    let damaged = |what: String| IoError::format(path)(TsogError::Damaged(what));
    let mut archive = Archive::open(Cursor::new(&bytes[..])).map_err(damaged)?;
    let name = archive.names().iter().find(|name| is_meta(name));
    let name = name.cloned().ok_or_else(|| damaged(format!("without {META}")))?;
    let folder = name[..name.len() - META.len()].to_owned();
    let limit = decompress::limit(bytes.len());
    let meta = archive.read(&name, limit).map_err(damaged)?;
    let meta = Meta::parse(&meta).map_err(wrong)?;
    if meta.count > MAX_SPLATS_PER_BYTE.saturating_mul(bytes.len() as u64) {
        return Err(damaged(format!("{} splats in {} bytes", meta.count, bytes.len())));
    }
    let timeline = meta.timeline().map_err(wrong)?;
    let velocities = meta.velocities().map_err(wrong)?;
    let playback = meta.playback(&timeline).map_err(wrong)?;
    // Planes of one colour take only a few bytes; the limit applies to each of them.
    let mut plane = |name: &str| {
        let bytes = archive.read(&format!("{folder}{name}"), limit)?;
        if bytes.get(LOSSY_AT..LOSSY_AT + LOSSY.len()) == Some(LOSSY) {
            return Err(format!("the plane `{name}` is lossy WebP, expected lossless"));
        }
        Plane::decode(&bytes, limit)
    };
    let Rows { splats, motions, frames } =
        rows::decode(&meta, &timeline, velocities.as_ref(), &mut plane).map_err(damaged)?;
    let broken = |row: usize| {
        let motion = &motions[row];
        !motion.velocity[0].iter().chain([&motion.centre]).all(|value| value.is_finite())
    };
    let Sanitized { splats, kept, report } =
        repair::sanitize_with(splats, options.damage, broken).map_err(IoError::damaged(path))?;
    let kept = kept.unwrap_or_else(|| (0..motions.len()).collect());
    let mut facts = vec![(
        "timeline",
        match &timeline {
            Timeline::Static => "none: nothing moves".to_owned(),
            Timeline::Discrete { .. } => "discrete: each splat is visible in one frame".to_owned(),
            Timeline::Continuous { .. } => "continuous".to_owned(),
        },
    )];
    if let Some(Playback { frames, seconds }) = playback {
        let motion = if velocities.is_some() { "linear" } else { "none" };
        facts.push(("motion", motion.to_owned()));
        facts.push(("frames", frames.to_string()));
        facts.push(("seconds", seconds.to_string()));
    }
    let scene: Arc<dyn DynamicScene> = match playback {
        None => Arc::new(StaticScene::new(splats).map_err(IoError::format(path))?),
        Some(Playback { frames: count, .. }) => {
            let motions = kept.iter().map(|&row| motions[row]).collect();
            let scene = PolynomialScene::new(splats, motions)
                .map_err(IoError::format(path))?
                .with_frames(count);
            if frames.is_empty() {
                Arc::new(scene)
            } else {
                let window = |&row: &usize| {
                    let frame = f32::from(frames[row]);
                    [frame, frame + 1.0]
                };
                let windows = kept.iter().map(window).collect();
                // Time 1 is within the last frame.
                let scene = scene.with_windows(windows).map_err(IoError::format(path))?;
                Arc::new(scene.with_clock(0.0, (count as f64).next_down()))
            }
        }
    };
    let sound = meta.has_sound().then(|| "its sound is ignored".to_owned());
    Ok(OpenedScene {
        facts,
        notes: sound.into_iter().collect(),
        repair: report,
        fps: playback.map(|playback| playback.frames as f64 / playback.seconds),
        ..OpenedScene::shared(SceneKind::Tsog, scene, vec![path.to_owned()])
    })
}
