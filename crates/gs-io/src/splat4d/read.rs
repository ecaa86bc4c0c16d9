//! Reading `.splat4d` files as scenes.

use super::Splat4dError;
use super::decode::{self, Cursor, Fixed, Grids};
use super::value::Attribute;
use crate::archive::decompress;
use crate::content::magic::SPLAT4D;
use crate::error::IoError;
use crate::frame_cache::FrameCache;
use crate::fs::read_bytes;
use crate::repair::{Damage, DamagedRows, RepairReport, TRANSPARENT_LOGIT};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, quat};
use gs_deform::frames;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

#[derive(Deserialize)]
struct HeaderJson {
    n: u32,
    t: u32,
    fps: f64,
    steps: StepsJson,
    static_section: Section,
    gops: Vec<Gop>,
    /// Written by this crate; other writers do not write this key, other readers ignore it.
    #[serde(default)]
    c4d_up: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct StepsJson {
    pos: f64,
    scale_log: f64,
    rgb: f64,
    alpha: f64,
    rot: f64,
    base_pos: f64,
    base_scale_log: f64,
}

#[derive(Deserialize)]
struct Section {
    offset: u64,
    len: u64,
}

#[derive(Deserialize)]
struct Gop {
    offset: u64,
    len: u64,
    f0: u32,
    f1: u32,
}

/// Bytes before the JSON.
const FRONT: usize = 12;
/// Largest number of frames of a clip: days of video.
const MAX_FRAMES: u32 = 1 << 24;
/// Largest grid step; 32-bit multiples of it are finite in single precision.
const MAX_STEP: f64 = 1e20;
/// Limits of the decompressed size of a group of frames, bytes per byte of the group and of the
/// whole file. Groups without motion compress to almost nothing.
const GROUP_RATIO: u64 = 256;
const FILE_RATIO: u64 = 64;
/// Limit of the decompressed size of all groups together, bytes per byte of
/// the file, which bounds the time for opening.
const TOTAL_RATIO: u64 = 2048;

/// Consecutive frames that are decoded together.
#[derive(Debug, Clone)]
struct Span {
    bytes: Range<usize>,
    frames: Range<usize>,
}

/// A `.splat4d` clip: `n` frames with persistent rows at times `i/(n−1)`, linear between them as in
/// [`gs_deform::TabulatedScene`]. Keeps the compressed file, one decompressed group of frames and
/// the most recently used frames in memory.
#[derive(Debug)]
pub struct Splat4dScene {
    bytes: Vec<u8>,
    grids: Grids,
    fixed: Fixed,
    spans: Vec<Span>,
    num_frames: usize,
    /// Rows of the file that were kept, if damaged ones were dropped.
    kept: Option<Vec<usize>>,
    /// Whether some rows have to be made invisible in frames in which they have no rotation.
    hides: bool,
    cursor: Mutex<Cursor>,
    cache: FrameCache,
}

/// A `.splat4d` scene and its properties.
#[derive(Debug)]
#[non_exhaustive]
pub struct OpenedClip {
    /// The scene, times 0 to 1.
    pub scene: Splat4dScene,
    /// Rows without rotation in some frame; if they have one in a different frame,
    /// they are invisible only in the frames without.
    pub repair: RepairReport,
    /// Frames per second.
    pub fps: f64,
    /// The world's upward direction (about unit length), if the file was written by this crate.
    pub up: Option<[f64; 3]>,
}

/// Reads a scene. Every group of frames is decompressed once, so that an opened scene can be
/// evaluated at every time. Opacities of 0 and 255 get the finite logits of 0.001 and 0.999.
///
/// # Errors
/// If the bytes are not a `.splat4d` of version 1, a part is missing or inconsistent with the
/// header, or rows have no rotation and `damage` is [`Damage::Fail`].
pub fn read(bytes: Vec<u8>, damage: Damage) -> Result<OpenedClip, Splat4dError> {
    let header = header(&bytes)?;
    let n = header.n as usize;
    let grids = grids(&header.steps)?;
    let Section { offset, len } = header.static_section;
    let section = within(&bytes, offset, len, || "static section".to_owned())?;
    let spans = spans(&header, &bytes)?;
    let mut room = decompress::limit(section.len());
    let fixed = decode::fixed(&bytes[section], n, &grids, &mut room)?;
    let mut scene = Splat4dScene {
        num_frames: header.t as usize,
        bytes,
        grids,
        fixed,
        spans,
        kept: None,
        hides: false,
        cursor: Mutex::default(),
        cache: FrameCache::new(4),
    };
    let frames_lost = scene.frames_without_rotation()?;
    let damaged = frames_lost.iter().filter(|&&frames| frames > 0).count();
    let gone = frames_lost.iter().filter(|&&frames| frames == header.t).count();
    let repair = RepairReport {
        rows: n,
        zero_quaternion: damaged,
        hidden: if damage == Damage::Drop { damaged - gone } else { 0 },
        ..RepairReport::default()
    };
    if let Some(first) = frames_lost.iter().position(|&frames| frames > 0)
        && damage != Damage::Keep
    {
        if damage == Damage::Fail || gone == n {
            return Err(DamagedRows { report: repair, first }.into());
        }
        scene.hides = repair.hidden > 0;
        scene.kept =
            (gone > 0).then(|| (0..n).filter(|&row| frames_lost[row] < header.t).collect());
    }
    let length = |up: &[f64; 3]| up.iter().map(|c| c * c).sum::<f64>().sqrt();
    let up = header.c4d_up.filter(|up| (0.5..2.0).contains(&length(up)));
    Ok(OpenedClip { scene, repair, fps: header.fps, up })
}

/// Reads a file.
///
/// # Errors
/// If it cannot be read, or as [`read`].
pub fn open(path: &Path, damage: Damage) -> Result<OpenedClip, IoError> {
    read(read_bytes(path)?, damage).map_err(IoError::format(path))
}

fn header(bytes: &[u8]) -> Result<HeaderJson, Splat4dError> {
    let damaged = |what: String| Splat4dError::Header(what);
    let rest = bytes.strip_prefix(&SPLAT4D).ok_or(Splat4dError::Magic)?;
    let cut = || damaged("it is truncated".to_owned());
    let (front, rest) = rest.split_first_chunk::<{ FRONT - 4 }>().ok_or_else(cut)?;
    let [v0, v1, _, _, l0, l1, l2, l3] = *front;
    let version = u16::from_le_bytes([v0, v1]);
    if version != 1 {
        return Err(Splat4dError::Version { found: version });
    }
    let json = rest.get(..u32::from_le_bytes([l0, l1, l2, l3]) as usize).ok_or_else(cut)?;
    let header: HeaderJson =
        serde_json::from_slice(json).map_err(|error| damaged(error.to_string()))?;
    if header.n == 0 || header.t == 0 || header.t > MAX_FRAMES {
        return Err(damaged(format!(
            "{} splats and {} frames; expected at least one of each, at most {MAX_FRAMES} frames",
            header.n, header.t
        )));
    }
    Ok(header)
}

fn grids(steps: &StepsJson) -> Result<Grids, Splat4dError> {
    let grids = Grids {
        moving: [steps.pos, steps.rot, steps.rgb, steps.alpha, steps.scale_log],
        fixed_pos: steps.base_pos,
        fixed_scale: steps.base_scale_log,
    };
    let mut all = grids.moving.iter().chain([&grids.fixed_pos, &grids.fixed_scale]);
    match all.find(|step| !(**step > 0.0 && **step <= MAX_STEP)) {
        Some(step) => Err(Splat4dError::Header(format!(
            "a grid has steps of {step}; expected above 0, at most {MAX_STEP:.0e}"
        ))),
        None => Ok(grids),
    }
}

/// The groups of frames, which must be in order, without
/// missing frames and without overlapping bytes.
fn spans(header: &HeaderJson, bytes: &[u8]) -> Result<Vec<Span>, Splat4dError> {
    let (mut frame, mut free) = (0, 0);
    let mut spans = Vec::with_capacity(header.gops.len());
    for (index, gop) in header.gops.iter().enumerate() {
        if gop.f0 != frame || gop.f1 < gop.f0 || gop.f1 >= header.t {
            return Err(Splat4dError::Header(format!(
                "group {index} has frames {} to {}; expected to start at {frame}, of {} frames",
                gop.f0, gop.f1, header.t
            )));
        }
        let bytes = within(bytes, gop.offset, gop.len, || format!("group {index} of frames"))?;
        if bytes.start < free {
            return Err(Splat4dError::Header(format!(
                "group {index} begins at byte {}, before the end of the last at {free}",
                bytes.start
            )));
        }
        frame = gop.f1 + 1;
        free = bytes.end;
        spans.push(Span { bytes, frames: gop.f0 as usize..frame as usize });
    }
    if frame != header.t {
        return Err(Splat4dError::Header(format!(
            "groups have {frame} frames, expected {}",
            header.t
        )));
    }
    Ok(spans)
}

/// The byte range of a part, if it is inside the file.
fn within(
    bytes: &[u8],
    offset: u64,
    len: u64,
    part: impl FnOnce() -> String,
) -> Result<Range<usize>, Splat4dError> {
    let end = offset.saturating_add(len);
    match (usize::try_from(offset), usize::try_from(end)) {
        (Ok(start), Ok(end)) if end <= bytes.len() => Ok(start..end),
        _ => Err(Splat4dError::Truncated { part: part(), end, found: bytes.len() }),
    }
}

impl Splat4dScene {
    /// Decompresses every group once and counts the frames in which
    /// each row of the file has no rotation, `[N]`.
    fn frames_without_rotation(&self) -> Result<Vec<u32>, Splat4dError> {
        let changing = &self.fixed.changing;
        // At most 2²⁴ frames.
        let all = u32::try_from(self.num_frames).unwrap_or(u32::MAX);
        let missing = |q: &[f32; 4]| if *q == [0.0; 4] { all } else { 0 };
        let mut lost: Vec<u32> = self.fixed.base.quats.iter().map(missing).collect();
        let turning = &changing[Attribute::Rot as usize];
        for &row in turning {
            lost[row as usize] = 0;
        }
        let mut total = decompress::FREE + TOTAL_RATIO * self.bytes.len() as u64;
        let mut cursor = Cursor::default();
        for (index, span) in self.spans.iter().enumerate() {
            let room = self.room(span).min(total);
            let mut left = room;
            let bytes = &self.bytes[span.bytes.clone()];
            cursor.enter(bytes, index, span.frames.len(), changing, &mut left)?;
            total -= room - left;
            let looked_at = if turning.is_empty() { 0 } else { span.frames.len() };
            for frame in 0..looked_at {
                cursor.advance(frame);
                for row in cursor.without_rotation(changing) {
                    lost[row] += 1;
                }
            }
        }
        Ok(lost)
    }

    /// Limit of the decompressed size of a group, bytes.
    fn room(&self, span: &Span) -> u64 {
        let own = GROUP_RATIO * span.bytes.len() as u64;
        decompress::FREE.max(own + FILE_RATIO * self.bytes.len() as u64)
    }

    /// A frame.
    fn frame(&self, index: usize) -> Result<Arc<Splats>, SceneError> {
        self.cache.get(index, || self.decode(index)).map_err(|error| SceneError::Source {
            what: format!("frame {index} of the .splat4d"),
            source: error.into(),
        })
    }

    fn decode(&self, index: usize) -> Result<Splats, Splat4dError> {
        let group = self.spans.partition_point(|span| span.frames.end <= index);
        let span = &self.spans[group];
        let frame = index - span.frames.start;
        let mut splats = self.fixed.base.clone();
        let mut cursor = self.cursor.lock().unwrap_or_else(PoisonError::into_inner);
        if !cursor.is_before(group, frame) {
            let bytes = &self.bytes[span.bytes.clone()];
            let changing = &self.fixed.changing;
            cursor.enter(bytes, group, span.frames.len(), changing, &mut self.room(span))?;
        }
        cursor.advance(frame);
        cursor.put(&self.fixed, &self.grids, &mut splats);
        drop(cursor);
        if self.hides {
            self.hide(&mut splats);
        }
        Ok(match &self.kept {
            Some(kept) => splats.select(kept),
            None => splats,
        })
    }

    /// Makes rows without a rotation invisible, with the rotation of the first frame.
    fn hide(&self, splats: &mut Splats) {
        for &row in &self.fixed.changing[Attribute::Rot as usize] {
            let row = row as usize;
            if splats.quats[row] == [0.0; 4] {
                let first = self.fixed.base.quats[row];
                splats.quats[row] = if first == [0.0; 4] { quat::IDENTITY } else { first };
                splats.opacity_logits[row] = TRANSPARENT_LOGIT;
            }
        }
    }

    fn evaluate(&self, t: f32, geometry_only: bool, out: &mut Splats) -> Result<(), SceneError> {
        frames::evaluate(self.num_frames, t, geometry_only, out, |index| self.frame(index))
    }
}

impl DynamicScene for Splat4dScene {
    fn num_splats(&self) -> usize {
        self.kept.as_ref().map_or(self.fixed.base.len(), Vec::len)
    }

    fn sh_degree(&self) -> usize {
        0
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn num_frames(&self) -> Option<usize> {
        Some(self.num_frames)
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, false, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, true, out)
    }

    fn fades(&self) -> bool {
        self.hides || !self.fixed.changing[Attribute::Alpha as usize].is_empty()
    }
}
