//! Reading sequences.

use super::SequenceError;
use super::hidden::{self, HiddenRows};
use super::source::{OtherEntries, Source};
use crate::axes::Axes;
use crate::error::IoError;
use crate::frame::{self, Frame};
use crate::frame_cache::FrameCache;
use crate::repair::{self, Damage, DamagedRows, Infinities, RepairReport};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange, nearest_rank};
use gs_deform::frames;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Options for opening a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SequenceOptions {
    /// Frames kept in memory, at least 2. Default 4: the two
    /// neighbours of a time, for two concurrent readers.
    pub cached_frames: usize,
    /// Treatment of damaged rows. [`Damage::Fail`] (default) and [`Damage::Keep`] read frames on
    /// demand. [`Damage::Drop`] reads all files once on opening; a row that is damaged in some
    /// frames is invisible there, a row that is damaged in all frames is dropped.
    pub damage: Damage,
    /// Axes of the files, for formats whose files use different axes (SPZ, glTF); `None` for those
    /// stated in each file, else those of its format.
    pub axes: Option<Axes>,
}

impl Default for SequenceOptions {
    fn default() -> Self {
        Self { cached_frames: 4, damage: Damage::Fail, axes: None }
    }
}

/// `n ≥ 2` frames with the same rows, frame `i` at time `i/(n−1)`; between frames as in
/// [`gs_deform::TabulatedScene`]. Frames are read on demand, and the most recent ones are cached.
#[derive(Debug)]
pub struct PlySequence {
    source: Source,
    others: OtherEntries,
    num_splats: usize,
    sh_degree: usize,
    damage: Damage,
    axes: Option<Axes>,
    /// Rows of the files that were kept, if damaged ones were dropped.
    kept: Option<Vec<usize>>,
    hidden: HiddenRows,
    repair: RepairReport,
    cache: FrameCache,
}

impl PlySequence {
    /// Opens a folder or a zip archive. Reads the headers of all frames and verifies that they have
    /// the same rows and SH degree. Nothing is extracted to disk.
    ///
    /// # Errors
    /// If there are fewer than two frames, numbers are missing, or a file differs from the first;
    /// the file is named.
    pub fn open(path: &Path, options: &SequenceOptions) -> Result<Self, IoError> {
        let (source, others) =
            if path.is_dir() { Source::folder(path)? } else { Source::zip(path)? };
        if source.len() < 2 {
            return Err(IoError::format(path)(SequenceError::TooShort { found: source.len() }));
        }
        let first = source.shape(0)?;
        for index in 1..source.len() {
            let other = source.shape(index)?;
            if (other.num_splats, other.sh_degree) != (first.num_splats, first.sh_degree) {
                return Err(IoError::format(&source.label(index))(SequenceError::Rows {
                    found: other.num_splats,
                    degree: other.sh_degree,
                    first: source.name(0),
                    expected: first.num_splats,
                    first_degree: first.sh_degree,
                }));
            }
        }
        let num_splats = usize::try_from(first.num_splats).map_err(|error| {
            IoError::content(&source.label(0), format!("{} rows: {error}", first.num_splats))
        })?;
        let mut sequence = Self {
            source,
            others,
            num_splats,
            sh_degree: first.sh_degree,
            damage: options.damage,
            axes: options.axes,
            kept: None,
            hidden: HiddenRows::default(),
            repair: RepairReport { rows: num_splats, ..RepairReport::default() },
            cache: FrameCache::new(options.cached_frames),
        };
        if options.damage == Damage::Drop {
            sequence.drop_damaged()?;
        }
        Ok(sequence)
    }

    /// Input files: the frames in order of time, or the archive.
    pub fn paths(&self) -> &[PathBuf] {
        self.source.paths()
    }

    /// Measures whether rows persist: median distance of a row's centre between two frames, divided
    /// by the distance of unrelated rows. Far below 1 for a scene; near 1 if each frame was sorted
    /// separately. Reads two frames.
    ///
    /// # Errors
    /// If one of them cannot be read.
    pub fn row_drift(&self) -> Result<f32, IoError> {
        let (first, second) = (self.frame(0)?, self.frame(1)?);
        let distance = |a: [f32; 3], b: [f32; 3]| {
            (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f32>().sqrt()
        };
        let median = |mut values: Vec<f32>| {
            values.retain(|value| value.is_finite());
            nearest_rank(&mut values, 0.5).unwrap_or(0.0)
        };
        let rows = self.num_splats;
        let moved = median((0..rows).map(|i| distance(first.means[i], second.means[i])).collect());
        // A stride coprime to most lengths mixes rows sufficiently.
        let other = |i: usize| (i * 7919 + rows / 2) % rows;
        let apart = (0..rows).map(|i| distance(first.means[i], first.means[other(i)])).collect();
        let apart = median(apart);
        Ok(if apart > 0.0 { moved / apart } else { 0.0 })
    }

    /// Names of entries of the folder that are not frames.
    pub fn ignored(&self) -> &[String] {
        &self.others.ignored
    }

    /// Note on the series used and those ignored, if the folder has several.
    pub fn series(&self) -> Option<&str> {
        self.others.series.as_deref()
    }

    /// Notes on reading the first frame, one sentence each. Reads that frame.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn notes(&self) -> Result<Vec<String>, IoError> {
        let frame = self.read_file(0)?;
        let assumption = frame.axes.and_then(|reading| reading.assumption());
        Ok(frame.notes.into_iter().chain(assumption).collect())
    }

    /// Rows of the files that were kept, if damaged ones were dropped.
    pub fn kept_rows(&self) -> Option<&[usize]> {
        self.kept.as_deref()
    }

    /// Rows damaged in at least one frame, and interpreted
    /// infinities, as far as frames were examined.
    pub fn repair(&self) -> RepairReport {
        self.repair
    }

    /// Finds rows that are damaged in some frame or in all.
    fn drop_damaged(&mut self) -> Result<(), IoError> {
        let mut seen = vec![false; self.num_splats];
        let mut first = None;
        let mut damaged = Vec::with_capacity(self.source.len());
        for index in 0..self.source.len() {
            let (splats, infinities) = self.read(index)?;
            self.repair.infinities.add(infinities);
            let rows = repair::count_damage(&splats, |_row| false).1;
            for &row in &rows {
                // A row counts once, by its first damage.
                if !std::mem::replace(&mut seen[row], true) {
                    first.get_or_insert_with(|| (self.source.label(index), row));
                    if repair::only_rotation_missing(&splats, row) {
                        self.repair.zero_quaternion += 1;
                    } else {
                        self.repair.not_finite += 1;
                    }
                }
            }
            damaged.push(rows);
        }
        let Some((path, row)) = first else { return Ok(()) };
        let (hidden, gone) = HiddenRows::of(&damaged);
        self.hidden = hidden;
        self.repair.hidden = self.repair.damaged() - gone.len();
        if gone.len() == self.num_splats {
            let source = DamagedRows { report: self.repair, first: row };
            return Err(IoError::Damaged { path, source });
        }
        if !gone.is_empty() {
            self.kept = Some(repair::without(self.num_splats, &gone));
            self.num_splats -= gone.len();
        }
        Ok(())
    }

    fn read_file(&self, index: usize) -> Result<Frame, IoError> {
        let label = self.source.label(index);
        let frame = frame::read(&self.source.read(index)?).map_err(IoError::format(&label))?;
        Ok(match self.axes {
            Some(axes) => frame.in_axes(axes),
            None => frame,
        })
    }

    /// All rows of a frame, with interpreted infinities replaced by finite values.
    fn read(&self, index: usize) -> Result<(Splats, Infinities), IoError> {
        let mut splats = self.read_file(index)?.splats;
        let rows = self.repair.rows;
        if (splats.len(), splats.sh_degree) != (rows, self.sh_degree) {
            return Err(IoError::format(&self.source.label(index))(SequenceError::Changed {
                found: splats.len(),
                degree: splats.sh_degree,
                expected: rows,
                first_degree: self.sh_degree,
            }));
        }
        let infinities = repair::replace_infinities(&mut splats);
        Ok((splats, infinities))
    }

    /// The kept rows of a frame, from the cache if possible.
    ///
    /// # Errors
    /// If the file cannot be read, has changed, or contains damaged rows where none are allowed.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn frame(&self, index: usize) -> Result<Arc<Splats>, IoError> {
        self.cache.get(index, || {
            let (mut splats, _) = self.read(index)?;
            for (other, rows) in self.hidden.of_frame(index) {
                let (stand_in, _) = self.read(other)?;
                hidden::hide(&mut splats, &stand_in, rows);
            }
            if self.damage == Damage::Fail {
                splats = repair::sanitize(splats, Damage::Fail)
                    .map_err(IoError::damaged(&self.source.label(index)))?
                    .splats;
            }
            Ok(match &self.kept {
                Some(kept) => splats.select(kept),
                None => splats,
            })
        })
    }

    fn evaluate(&self, t: f32, geometry_only: bool, out: &mut Splats) -> Result<(), SceneError> {
        frames::evaluate(self.source.len(), t, geometry_only, out, |index| {
            self.frame(index).map_err(|error| SceneError::Source {
                what: format!("frame {index} of the sequence"),
                source: error.into(),
            })
        })
    }
}

impl DynamicScene for PlySequence {
    fn num_splats(&self) -> usize {
        self.num_splats
    }

    fn sh_degree(&self) -> usize {
        self.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn num_frames(&self) -> Option<usize> {
        Some(self.source.len())
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, false, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, true, out)
    }
}
