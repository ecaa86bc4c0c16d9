//! `.splat4d` version 1: one streamable file with a bound on every error.
//!
//! ```text
//! 0   4  "SP4D"
//! 4   2  u16 version = 1
//! 6   2  u16 flags
//! 8   4  u32 length of the JSON header
//! 12  …  JSON header, static section, one chunk per group of frames
//! ```
//!
//! Little-endian. Every value is put on a grid whose step is twice its bound. What stays within its bound of one value through the
//! whole clip is stored once, on a grid twice as fine; of the rest each group of frames (GOP) stores its first frame and the
//! differences from frame to frame. A value keeps its grid point until it would violate the bound, so that noise costs nothing and
//! nothing flickers. Symbols are unsigned (zigzag), split into byte planes and compressed with zstd.
//!
//! Kept: positions, sizes, rotations, base colour, opacity. Not kept: view-dependent colour.

mod decode;
mod header;
mod read;
mod streams;
mod survey;
mod symbols;
mod tracks;
mod value;

pub use read::{Read, Splat4dError, Splat4dScene, open, read};

use crate::atomic::{AtomicFile, Existing};
use crate::clip::{Clip, Hemispheres, SoundRows, dropped_sentence, robust_size};
use crate::error::IoError;
use crate::losses::Losses;
use header::{Chunk, Header};
use std::io::Write;
use std::path::Path;
use survey::Survey;
use tracks::Tracks;
use value::Steps;

/// First four bytes.
pub(crate) const MAGIC: [u8; 4] = *b"SP4D";

/// Frames of a clip are visited this often: `progress` of [`write()`] counts up to this many times their number.
pub const PASSES: usize = 2;

/// Default position bound as a share of the scene's size: a fifth of a pixel where the scene fills a thousand.
pub const DEFAULT_TOLERANCE: f64 = 2e-4;

/// Largest errors of the decoded values, at every splat and frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Of each coordinate, as a share of the scene's size: the diagonal of the box around the middle 98 % of what moves (of
    /// everything, if nothing does). Default [`DEFAULT_TOLERANCE`].
    pub tolerance: f64,
    /// Of sizes, relative. Default 0.02.
    pub scale: f64,
    /// Of each colour channel, steps of 255, besides the rounding to 8 bits. Default 2.
    pub rgb: u8,
    /// Of opacity, steps of 255, besides the rounding to 8 bits. Default 2.
    pub alpha: u8,
    /// Of each component of the unit quaternion, steps of 1/128, besides the rounding to 8 bits. Default 0.
    pub rot: u8,
    /// Frames from one that can be decoded alone to the next. Default 30.
    pub gop: usize,
    /// The world's upward direction, noted for our own reader. Default none.
    pub up: Option<[f64; 3]>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            tolerance: DEFAULT_TOLERANCE,
            scale: 0.02,
            rgb: 2,
            alpha: 2,
            rot: 0,
            gop: 30,
            up: None,
        }
    }
}

/// What was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Bound of each coordinate, world units.
    pub position_bound: f64,
    /// Splats written.
    pub num_splats: usize,
    /// Splats whose position changes by more than its bound.
    pub moving: usize,
    /// Bytes of the file.
    pub bytes: u64,
    /// What the file does not keep.
    pub losses: Losses,
}

/// Writes the clip. The scene is evaluated [`PASSES`] times per frame; `progress` hears the number of evaluations done.
///
/// Memory besides one frame: about 200 bytes a splat, the symbols of one group of frames (one byte per changing value, seldom two)
/// and the compressed file, whose header comes first and holds the places of everything.
///
/// # Errors
/// If there are no frames, splats or frames per second, an option is out of range, positions are so far out that the grid cannot
/// number them, the scene cannot be evaluated, or the file cannot be written.
pub fn write(
    path: impl AsRef<Path>,
    clip: &Clip<'_>,
    options: &Options,
    existing: Existing,
    progress: &mut dyn FnMut(usize),
) -> Result<Report, IoError> {
    let path = path.as_ref();
    clip.check(path)?;
    options.check(path)?;
    let mut file = AtomicFile::create(path, existing)?;

    let mut survey = Survey::new(clip.scene.num_splats());
    let mut sound = SoundRows::new(clip.scene.num_splats());
    let mut hemispheres = Hemispheres::default();
    clip.each_frame(path, |index, splats| {
        hemispheres.follow(splats);
        sound.see(splats);
        survey.see(splats, &hemispheres);
        progress(index + 1);
        Ok(())
    })?;
    let rows = sound.rows(path)?;
    let position_bound = options.tolerance * survey.size(&rows);
    let steps = Steps::new(options, position_bound);
    steps.check_range(path, &survey, &rows)?;
    let order = survey.order(&rows, &steps);

    let mut tracks = Tracks::new(&order, steps);
    let mut hemispheres = Hemispheres::default();
    let (mut fixed, mut chunks) = (Vec::new(), Vec::new());
    clip.each_frame(path, |index, splats| {
        hemispheres.follow(splats);
        if index == 0 {
            fixed = tracks::static_section(&order, &survey, splats, &hemispheres, &steps)
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

    let header = Header { clip, options, steps: &steps, order: &order, aabb: survey.bounds(&rows) };
    let header = header.place(fixed.len(), &chunks);
    let bytes =
        (header.len() + fixed.len() + chunks.iter().map(|c| c.bytes.len()).sum::<usize>()) as u64;
    let parts = std::iter::once(&header).chain([&fixed]).chain(chunks.iter().map(|c| &c.bytes));
    for part in parts {
        file.write_all(part).map_err(IoError::write(path))?;
    }
    file.commit()?;
    Ok(Report {
        position_bound,
        num_splats: rows.len(),
        moving: order.dynamic_count(value::Attribute::Pos),
        bytes,
        losses: losses(clip, options, position_bound, rows.len()),
    })
}

impl Options {
    fn check(&self, path: &Path) -> Result<(), IoError> {
        let share = |value: f64| value.is_finite() && value > 0.0 && value <= 1.0;
        let wrong = if !share(self.tolerance) {
            format!("tolerance {}", self.tolerance)
        } else if !share(self.scale) {
            format!("relative size error {}", self.scale)
        } else if self.gop == 0 {
            "groups of 0 frames".to_owned()
        } else {
            return Ok(());
        };
        Err(IoError::content(
            path,
            format!("{wrong}; expected above 0, at most 1 (groups: at least 1)"),
        ))
    }
}

fn losses(clip: &Clip<'_>, options: &Options, position_bound: f64, written: usize) -> Losses {
    let mut losses = Losses::none();
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
        "8-bit colour within {} and opacity within {} of 255 steps; rotations have 8 bits a component, within {} of 128 steps",
        options.rgb, options.alpha, options.rot
    ));
    if let Some(sentence) =
        dropped_sentence(clip.scene.num_splats() - written, clip.scene.num_splats())
    {
        losses.push(sentence);
    }
    losses
}

/// Size of what moves, else of everything.
fn size_of(first: &[[f32; 3]], moved: &[bool]) -> f64 {
    let whole = robust_size(first);
    let moving: Vec<[f32; 3]> =
        first.iter().zip(moved).filter(|(_, moved)| **moved).map(|(mean, _)| *mean).collect();
    if moving.len() >= MIN_MOVING.max(first.len() / 100) { robust_size(&moving) } else { whole }
}

/// Fewer moving splats than this, or than one in a hundred, do not decide the scene's size.
const MIN_MOVING: usize = 50;
