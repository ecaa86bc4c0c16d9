//! Writing `.splat4d`.

use super::WriteOptions;
use super::header::{Chunk, Header};
use super::tracks::{self, Tracks};
use super::value::{Attribute, Steps};
use super::value_ranges::ValueRanges;
use crate::clip::{Clip, Hemispheres, ValidRows, dropped_sentence};
use crate::error::IoError;
use crate::format_losses::FormatLosses;
use crate::fs::{AtomicFile, Existing};
use std::io::Write;
use std::path::Path;

/// Number of passes over the frames of a clip: `progress` of [`write()`]
/// counts up to this many times their number.
pub const PASSES: usize = 2;

/// Result of writing a clip.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Bound of each coordinate, world units.
    pub position_bound: f64,
    /// Splats written.
    pub num_splats: usize,
    /// Splats whose position changes by more than its bound.
    pub moving: usize,
    /// Bytes of the file.
    pub bytes: u64,
    /// Losses of the file.
    pub losses: FormatLosses,
}

/// Writes the clip. The scene is evaluated [`PASSES`] times per frame; `progress` is called with
/// the number of finished evaluations.
///
/// Memory besides one frame: about 200 bytes per splat, the symbols of one group of
/// frames (one byte per changing value, rarely two) and the compressed file,
/// because its header comes first and contains all offsets.
///
/// # Errors
/// If there are no frames, splats or frames per second, an option is out of range, positions exceed
/// the range of the grid, the scene cannot be evaluated, or the file cannot be written.
pub fn write(
    path: &Path,
    clip: &Clip<'_>,
    options: &WriteOptions,
    existing: Existing,
    progress: &mut dyn FnMut(usize),
) -> Result<WriteReport, IoError> {
    clip.check(path)?;
    options.check(path)?;
    let mut file = AtomicFile::create(path, existing)?;

    let mut ranges = ValueRanges::new(clip.scene.num_splats());
    let mut valid = ValidRows::new(clip.scene.num_splats());
    let mut hemispheres = Hemispheres::default();
    clip.each_frame(path, |index, splats| {
        hemispheres.follow(splats);
        valid.add(splats);
        ranges.add(splats, &hemispheres);
        progress(index + 1);
        Ok(())
    })?;
    let rows = valid.rows(path)?;
    let position_bound = options.tolerance * ranges.size(&rows);
    let steps = Steps::new(options, position_bound);
    ranges.check_range(path, &steps, &rows)?;
    let order = ranges.order(&rows, &steps);

    let mut tracks = Tracks::new(&order, steps);
    let mut hemispheres = Hemispheres::default();
    let (mut fixed, mut chunks) = (Vec::new(), Vec::new());
    clip.each_frame(path, |index, splats| {
        hemispheres.follow(splats);
        if index == 0 {
            fixed = tracks::static_section(&order, &ranges, splats, &hemispheres, &steps)
                .map_err(IoError::write(path))?;
        }
        tracks.push(splats, &hemispheres, index % options.gop == 0);
        if (index + 1) % options.gop == 0 || index + 1 == clip.times.len() {
            let first = index - index % options.gop;
            let bytes = tracks.take_chunk().map_err(IoError::write(path))?;
            chunks.push(Chunk { first, last: index, bytes });
        }
        progress(clip.times.len() + index + 1);
        Ok(())
    })?;

    let header = Header { clip, options, steps: &steps, order: &order, aabb: ranges.bounds(&rows) };
    let header = header.bytes(fixed.len(), &chunks);
    let bytes =
        (header.len() + fixed.len() + chunks.iter().map(|c| c.bytes.len()).sum::<usize>()) as u64;
    let parts = std::iter::once(&header).chain([&fixed]).chain(chunks.iter().map(|c| &c.bytes));
    for part in parts {
        file.write_all(part).map_err(IoError::write(path))?;
    }
    file.commit()?;
    Ok(WriteReport {
        position_bound,
        num_splats: rows.len(),
        moving: order.dynamic_count(Attribute::Pos),
        bytes,
        losses: losses(clip, options, position_bound, rows.len()),
    })
}

fn losses(
    clip: &Clip<'_>,
    options: &WriteOptions,
    position_bound: f64,
    written: usize,
) -> FormatLosses {
    let mut losses = FormatLosses::none();
    let degree = clip.scene.sh_degree();
    if degree > 0 {
        losses.push(format!("SH degree {degree} becomes 0: colour no longer depends on the view"));
    }
    losses.push(format!(
        "positions are within {position_bound:.3e} scene units ({} of the scene's size), sizes within {} %",
        options.tolerance,
        100.0 * options.scale
    ));
    losses.push(format!(
        "8-bit colour within {} and opacity within {} of 255 steps; rotations have 8 bits per \
        component, within {} of 128 steps",
        options.rgb, options.alpha, options.rot
    ));
    if let Some(sentence) =
        dropped_sentence(clip.scene.num_splats() - written, clip.scene.num_splats())
    {
        losses.push(sentence);
    }
    losses
}
