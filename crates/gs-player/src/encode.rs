//! Encodes one or two scenes over time as a compressed payload.

use crate::axis_permutation::AxisPermutation;
use crate::options::EncodeOptions;
use crate::overlay::{Annotations, Overlay};
use crate::pack::{self, Entry, Label};
use crate::row_groups::{self, RowGroups, SceneRows};
use crate::tracks::{self, Tracks};
use crate::{MAX_FRAMES, PlayerError};
use flate2::{Compression, write::GzEncoder};
use gs_core::{DynamicScene, Splats, quat, sh};
use serde::Serialize;
use std::io::Write;

/// First bytes of the payload, before compression.
pub const MAGIC: &[u8; 8] = b"C4DPLAY1";
/// Bits of each coordinate in the order of rows.
const MORTON_BITS: u32 = 20;

/// A scene and optionally its edited version, encoded for a page.
#[derive(Debug)]
pub struct Encoded {
    /// The payload, gzip.
    pub payload: Vec<u8>,
    /// Contents and losses.
    pub report: EncodeReport,
    /// Overlays of the payload.
    pub(crate) overlays: Vec<Overlay>,
}

/// Counts, errors and sizes of an encoded payload.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct EncodeReport {
    /// Number of frames.
    pub frames: usize,
    /// Splats of the first scene that are drawn.
    pub first: usize,
    /// Splats of the second scene that are drawn; 0 without one.
    pub second: usize,
    /// Splats that both scenes share, stored once.
    pub shared: usize,
    /// Splats with the same motion but different appearance, whose motion is stored once.
    pub same_motion: usize,
    /// Stored splats whose position, rotation or size changes over time.
    pub moving: usize,
    /// Rows omitted because a value is not finite, or the quaternion is zero, in some frame.
    pub not_finite: usize,
    /// Rows omitted because their opacity is always below 1/255, so that they draw nothing.
    pub invisible: usize,
    /// Centres outside the range of the grid, clamped to it.
    pub clamped: usize,
    /// SH degree of the scenes, and the degree stored.
    pub sh_degree: (usize, usize),
    /// Largest error of a coordinate, world units: of static splats, and of moving splats.
    pub position_error: (f64, f64),
    /// Bytes before and after compression.
    pub bytes: (usize, usize),
}

#[derive(Serialize)]
struct Header<'a> {
    version: u32,
    frames: usize,
    /// Rows of `a`, `same_motion`, `shared`, `b`.
    groups: [usize; 4],
    sh_degree: usize,
    origin: [f64; 3],
    attributes: &'a [Entry<'a>],
}

/// Encodes `first` and, if given, `second` at `times`, which become evenly spaced frames.
/// `progress` is called with the number of finished evaluations and their total.
///
/// # Errors
/// If there is no frame, no visible splat, an option out of range, or a scene cannot be evaluated.
/// Invalid rows are omitted and counted.
pub fn encode(
    first: &dyn DynamicScene,
    second: Option<&dyn DynamicScene>,
    times: &[f32],
    options: &EncodeOptions,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Encoded, PlayerError> {
    encode_annotated(first, second, times, options, &Annotations::default(), progress)
}

/// As [`encode()`], with overlays and row numbers.
///
/// # Errors
/// As [`encode()`], and if an overlay does not fit the scenes.
pub fn encode_annotated(
    first: &dyn DynamicScene,
    second: Option<&dyn DynamicScene>,
    times: &[f32],
    options: &EncodeOptions,
    annotations: &Annotations<'_>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Encoded, PlayerError> {
    options.check()?;
    let rows = [first.num_splats(), second.map_or(0, DynamicScene::num_splats)];
    annotations.check(rows)?;
    if times.is_empty() {
        return Err(PlayerError::NoFrames);
    }
    if times.len() > MAX_FRAMES {
        return Err(PlayerError::TooManyFrames { found: times.len() });
    }
    let scenes: Vec<&dyn DynamicScene> = std::iter::once(first).chain(second).collect();
    let available = scenes.iter().map(|scene| scene.sh_degree()).max().unwrap_or(0);
    let degree = options.sh_degree.min(available);
    let total = 2 * scenes.len() * times.len();
    let mut done = 0;
    let mut step = || {
        done += 1;
        progress(done, total);
    };
    let mut analyzed = Vec::new();
    for scene in &scenes {
        analyzed.push(SceneRows::analyze(*scene, times, sh::num_coeffs(degree), &mut step)?);
    }
    let groups = row_groups::group(&analyzed[0], analyzed.get(1));
    let [not_finite, invisible] = [
        analyzed.iter().map(|rows| rows.not_finite).sum(),
        analyzed.iter().map(|rows| rows.invisible).sum(),
    ];
    if groups.counts().iter().sum::<usize>() == 0 {
        let rows = scenes.iter().map(|scene| scene.num_splats()).sum();
        return Err(PlayerError::NothingVisible { rows, not_finite });
    }
    let (origin, size) = row_groups::trimmed_box(&analyzed.iter().collect::<Vec<_>>());
    drop(analyzed);
    let position_step = size / options.position_steps;
    let mut recorder = Recorder::new(&groups, degree, origin, position_step, options);
    let mut splats = Splats::default();
    #[expect(clippy::cast_possible_truncation, reason = "at most MAX_FRAMES")]
    let last_frame = (times.len() - 1) as u32;
    for (frame, &time) in (0..=last_frame).zip(times) {
        row_groups::evaluate(first, time, &mut splats)?;
        recorder.first(&groups, &splats, frame);
        step();
        if let Some(second) = second {
            row_groups::evaluate(second, time, &mut splats)?;
            recorder.second(&groups, &splats, frame);
            step();
        }
    }
    let clamped = recorder.clamped;
    let [a, same_motion, shared, b] = groups.counts();
    recorder.annotate(&groups, annotations);
    let (raw, moving) = recorder.finish(&groups, times.len(), degree)?;
    let mut compressed = GzEncoder::new(Vec::new(), Compression::best());
    compressed.write_all(&raw)?;
    let payload = compressed.finish()?;
    let report = EncodeReport {
        frames: times.len(),
        first: a + same_motion + shared,
        second: if second.is_some() { same_motion + shared + b } else { 0 },
        shared,
        same_motion,
        moving,
        not_finite,
        invisible,
        clamped,
        sh_degree: (available, degree),
        position_error: (position_step / 2.0, position_step * options.tolerance),
        bytes: (raw.len(), payload.len()),
    };
    Ok(Encoded { payload, report, overlays: annotations.overlays.to_vec() })
}

/// The tracks of all attributes while frames are added.
struct Recorder {
    position: Tracks,
    rotation: Tracks,
    scale: Tracks,
    opacity: Tracks,
    color: Tracks,
    shading: Option<Tracks>,
    /// Names and values of constant attributes of the appearances.
    annotations: Vec<(String, Tracks)>,
    options: EncodeOptions,
    origin: [f64; 3],
    position_step: f64,
    permutations: Vec<AxisPermutation>,
    permutation_of: Vec<u8>,
    /// Rotation of the previous frame after its permutation, which determines the sign of the next.
    last_quat: Vec<[f64; 4]>,
    clamped: usize,
}

impl Recorder {
    fn new(
        groups: &RowGroups,
        degree: usize,
        origin: [f64; 3],
        position_step: f64,
        options: &EncodeOptions,
    ) -> Self {
        let [a, same_motion, shared, b] = groups.counts();
        let rows = a + same_motion + shared + b;
        let appearances = rows + same_motion;
        let tracks = |rows, channels| Tracks::new(rows, channels, options.tolerance);
        let rest = sh::num_coeffs(degree) - 1;
        Self {
            position: tracks(rows, 3),
            // The real part of the first frame is implied, which can add
            // an error of one step to the rounding.
            rotation: Tracks::new(rows, 4, options.tolerance.max(1.5)),
            scale: tracks(rows, 3),
            opacity: tracks(appearances, 1),
            color: tracks(appearances, 3),
            shading: (rest > 0).then(|| tracks(appearances, 3 * rest)),
            annotations: Vec::new(),
            options: *options,
            origin,
            position_step,
            permutations: AxisPermutation::all(),
            permutation_of: vec![0; rows],
            last_quat: vec![[0.0; 4]; rows],
            clamped: 0,
        }
    }

    /// Adds a frame of the first scene.
    fn first(&mut self, groups: &RowGroups, splats: &Splats, frame: u32) {
        let same_motion = groups.same_motion.iter().map(|pair| pair.0);
        let shared = groups.shared.iter().map(|pair| pair.0);
        for (row, splat) in groups.a.iter().copied().chain(same_motion).chain(shared).enumerate() {
            self.geometry(row, splats, splat, frame);
            self.appearance(row, splats, splat, frame);
        }
    }

    /// Adds a frame of the second scene: only the rows that the first does not share.
    fn second(&mut self, groups: &RowGroups, splats: &Splats, frame: u32) {
        let [a, same_motion, shared, _] = groups.counts();
        for (i, pair) in groups.same_motion.iter().enumerate() {
            self.appearance(a + same_motion + shared + i, splats, pair.1, frame);
        }
        for (i, &splat) in groups.b.iter().enumerate() {
            self.geometry(a + same_motion + shared + i, splats, splat, frame);
            self.appearance(a + 2 * same_motion + shared + i, splats, splat, frame);
        }
    }

    fn geometry(&mut self, row: usize, splats: &Splats, splat: usize, frame: u32) {
        let mean = [0, 1, 2].map(|axis| {
            (f64::from(splats.means[splat][axis]) - self.origin[axis]) / self.position_step
        });
        if frame == 0 && mean.iter().any(|&value| tracks::is_beyond(value)) {
            self.clamped += 1;
        }
        let mut rotation = quat::normalize(splats.quats[splat].map(f64::from));
        if frame == 0 {
            self.permutation_of[row] = AxisPermutation::best(&self.permutations, rotation);
            self.last_quat[row] = [1.0, 0.0, 0.0, 0.0];
        }
        let axis_permutation = &self.permutations[usize::from(self.permutation_of[row])];
        rotation = quat::align(axis_permutation.rotate(rotation), self.last_quat[row]);
        if frame == 0 {
            rotation = quat::align(rotation, [1.0, 0.0, 0.0, 0.0]);
        }
        self.last_quat[row] = rotation;
        let rotation = rotation.map(|component| component / self.options.rotation_step);
        let scale = axis_permutation
            .permute(splats.log_scales[splat])
            .map(|value| f64::from(value) / self.options.scale_step);
        record(&mut self.position, row, frame, &mean);
        if frame == 0 {
            let [_, x, y, z] = rotation.map(tracks::round);
            let w = implied_real([x, y, z], self.options.rotation_step);
            self.rotation.start(row, &[w, x, y, z]);
        } else {
            record(&mut self.rotation, row, frame, &rotation);
        }
        record(&mut self.scale, row, frame, &scale);
    }

    fn appearance(&mut self, row: usize, splats: &Splats, splat: usize, frame: u32) {
        let opacity = gs_core::activation::sigmoid(f64::from(splats.opacity_logits[splat]));
        record(&mut self.opacity, row, frame, &[opacity / self.options.opacity_step]);
        let coeffs = splats.sh_of(splat);
        let c0 = f64::from(sh::C0);
        let color = coeffs[0].map(|dc| (0.5 + c0 * f64::from(dc)) / self.options.color_step);
        record(&mut self.color, row, frame, &color);
        if let Some(shading) = &mut self.shading {
            let mut values = vec![0.0; shading.channels];
            for (value, coeff) in values.iter_mut().zip(coeffs[1..].iter().flatten()) {
                *value = f64::from(*coeff) / self.options.shading_step;
            }
            record(shading, row, frame, &values);
        }
    }

    /// Adds the annotations, which do not change over time.
    fn annotate(&mut self, groups: &RowGroups, annotations: &Annotations<'_>) {
        let appearances = groups.appearances();
        let mut add =
            |name: String, channels: usize, values: &dyn Fn([Option<usize>; 2]) -> [i32; 2]| {
                let mut tracks = Tracks::new(appearances.len(), channels, self.options.tolerance);
                for (row, appearance) in appearances.iter().enumerate() {
                    tracks.start(row, &values(*appearance)[..channels]);
                }
                self.annotations.push((name, tracks));
            };
        for overlay in annotations.overlays {
            let entry = |scene: usize, row: usize| i32::from(overlay.entries[scene][row]);
            add(overlay.attribute(), 1, &|[first, second]| {
                let shown = second.map(|row| entry(1, row)).or(first.map(|row| entry(0, row)));
                [shown.unwrap_or(0), 0]
            });
        }
        if annotations.row_numbers {
            let number = |row: Option<usize>| row.and_then(|row| i32::try_from(row).ok());
            add("row".to_owned(), 2, &|appearance| appearance.map(|row| number(row).unwrap_or(-1)));
        }
    }

    /// Sorts the rows and writes all streams. Also counts the geometry rows that move.
    fn finish(
        mut self,
        groups: &RowGroups,
        frames: usize,
        degree: usize,
    ) -> Result<(Vec<u8>, usize), PlayerError> {
        #[expect(clippy::cast_possible_truncation, reason = "at most MAX_FRAMES")]
        let last_frame = (frames - 1) as u32;
        let geometry = [&mut self.position, &mut self.rotation, &mut self.scale];
        let appearances = [Some(&mut self.opacity), Some(&mut self.color), self.shading.as_mut()];
        for tracks in geometry.into_iter().chain(appearances.into_iter().flatten()) {
            tracks.finish(last_frame);
        }
        let moves: Vec<bool> = (0..self.permutation_of.len())
            .map(|row| [&self.position, &self.rotation, &self.scale].iter().any(|t| t.moves(row)))
            .collect();
        let (rows, appearances) = order(groups, &self.position.base, &moves);
        let options = &self.options;
        let mut streams = Vec::new();
        let mut attributes = Vec::new();
        for (label, tracks) in [
            (Label::of("position", "geometry", 0, self.position_step), &self.position),
            (Label::of("rotation", "geometry", 1, options.rotation_step), &self.rotation),
            (Label::of("scale", "geometry", 0, options.scale_step), &self.scale),
            (Label::of("opacity", "appearance", 0, options.opacity_step), &self.opacity),
            (Label::of("color", "appearance", 0, options.color_step), &self.color),
        ] {
            let order = if label.table == "geometry" { &rows } else { &appearances };
            attributes.push(pack::write(label, tracks, order, &mut streams));
        }
        if let Some(shading) = &self.shading {
            let label = Label::of("shading", "appearance", 0, options.shading_step);
            attributes.push(pack::write(label, shading, &appearances, &mut streams));
        }
        for (name, tracks) in &self.annotations {
            attributes.push(pack::write(
                Label::of(name, "appearance", 0, 1.0),
                tracks,
                &appearances,
                &mut streams,
            ));
        }
        let header = serde_json::to_vec(&Header {
            version: 2,
            frames,
            groups: groups.counts(),
            sh_degree: degree,
            origin: self.origin,
            attributes: &attributes,
        })?;
        let mut raw = MAGIC.to_vec();
        #[expect(clippy::cast_possible_truncation, reason = "the header is a few kilobytes")]
        raw.extend((header.len() as u32).to_le_bytes());
        raw.extend(header);
        raw.append(&mut streams);
        Ok((raw, moves.iter().filter(|moves| **moves).count()))
    }
}

/// Adds a value: rounded for the first frame, exact for later ones.
fn record(tracks: &mut Tracks, row: usize, frame: u32, values: &[f64]) {
    if frame == 0 {
        let mut rounded = [0_i32; 45];
        for (stored, value) in rounded.iter_mut().zip(values) {
            *stored = tracks::round(*value);
        }
        tracks.start(row, &rounded[..values.len()]);
    } else {
        #[expect(clippy::cast_possible_truncation, reason = "rows are counted in 32 bits")]
        tracks.push(row as u32, frame, values);
    }
}

/// Real part of a unit quaternion from the others, in steps.
fn implied_real(imaginary: [i32; 3], step: f64) -> i32 {
    let one = 1.0 / step;
    let rest: f64 = imaginary.iter().map(|&part| f64::from(part) * f64::from(part)).sum();
    tracks::round((one * one - rest).max(0.0).sqrt())
}

/// Order of the geometry rows and of the appearances. Within each group, moving rows precede static
/// ones, so that the player uploads few ranges, and spatial neighbours are adjacent.
fn order(groups: &RowGroups, positions: &[i32], moves: &[bool]) -> (Vec<usize>, Vec<usize>) {
    let codes = morton(positions);
    let mut rows: Vec<usize> = Vec::with_capacity(moves.len());
    let mut start = 0;
    for count in groups.counts() {
        let mut group: Vec<usize> = (start..start + count).collect();
        group.sort_by_key(|&row| (!moves[row], codes[row], row));
        rows.extend(group);
        start += count;
    }
    let [a, same_motion, shared, _] = groups.counts();
    let second = a + same_motion + shared;
    let mut appearances: Vec<usize> = rows[..second].to_vec();
    // Appearances of `same_motion` in the second scene, in the order of their geometry, then `b`.
    appearances.extend(rows[a..a + same_motion].iter().map(|row| row - a + second));
    appearances.extend(rows[second..].iter().map(|row| row + same_motion));
    (rows, appearances)
}

/// Positions along the Morton curve of their box (interleaved bits).
fn morton(positions: &[i32]) -> Vec<u64> {
    let rows = || positions.chunks_exact(3);
    let bound =
        |axis: usize, f: fn(i32, i32) -> i32| rows().map(|p| p[axis]).reduce(f).unwrap_or(0);
    let low = [0, 1, 2].map(|axis| bound(axis, i32::min));
    let high = [0, 1, 2].map(|axis| bound(axis, i32::max));
    let widest = (0..3).map(|axis| high[axis].abs_diff(low[axis])).max().unwrap_or(0);
    let shift = (u32::BITS - widest.leading_zeros()).saturating_sub(MORTON_BITS);
    rows()
        .map(|p| {
            let mut code = 0_u64;
            for bit in 0..MORTON_BITS {
                for (place, axis) in (3 * bit..).zip(0..3) {
                    let part = u64::from(p[axis].abs_diff(low[axis]) >> shift >> bit & 1);
                    code |= part << place;
                }
            }
            code
        })
        .collect()
}
