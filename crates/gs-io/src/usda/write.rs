//! Writing OpenUSD.

use crate::clip::{Clip, Hemispheres, ValidRows, dropped_sentence};
use crate::error::IoError;
use crate::format_losses::FormatLosses;
use crate::fs::{AtomicFile, Existing};
use gs_core::{Splats, sh};
use rayon::prelude::*;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufReader, BufWriter, Seek as _, Write};
use std::path::Path;

/// Default limit of the text's size, bytes; few tools open larger files.
pub const SIZE_LIMIT: u64 = 1_000_000_000;

/// Average number of bytes per number with punctuation.
const BYTES_PER_NUMBER: u64 = 12;

/// Buffer of temporary files, bytes.
const BUFFER: usize = 1 << 20;

/// Options for writing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WriteOptions {
    /// The scene's upward direction, world frame. Default +y, which needs no transform.
    pub up: [f64; 3],
    /// SH degree of the file; that of the scene if `None`. Default `None`.
    pub sh_degree: Option<usize>,
    /// Largest estimated size of the text, bytes; larger ones are rejected. Default [`SIZE_LIMIT`].
    pub size_limit: u64,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { up: [0.0, 1.0, 0.0], sh_degree: None, size_limit: SIZE_LIMIT }
    }
}

/// Result of writing a clip.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Splats written.
    pub num_splats: usize,
    /// Attributes with time samples.
    pub sampled: Vec<&'static str>,
    /// Losses of the file.
    pub losses: FormatLosses,
}

/// Attribute of a splat, named as in the schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Attribute {
    Positions,
    Orientations,
    Scales,
    Opacities,
    Radiance,
}

impl Attribute {
    const ALL: [Self; 5] =
        [Self::Positions, Self::Orientations, Self::Scales, Self::Opacities, Self::Radiance];

    fn name(self) -> &'static str {
        match self {
            Self::Positions => "positions",
            Self::Orientations => "orientations",
            Self::Scales => "scales",
            Self::Opacities => "opacities",
            Self::Radiance => "radiance:sphericalHarmonicsCoefficients",
        }
    }

    fn kind(self) -> &'static str {
        match self {
            Self::Positions => "point3f[]",
            Self::Orientations => "quatf[]",
            Self::Scales | Self::Radiance => "float3[]",
            Self::Opacities => "float[]",
        }
    }

    fn numbers(self, sh_degree: usize) -> u64 {
        match self {
            Self::Positions | Self::Scales => 3,
            Self::Orientations => 4,
            Self::Opacities => 1,
            Self::Radiance => 3 * sh::num_coeffs(sh_degree) as u64,
        }
    }
}

/// Writes the clip. The scene is evaluated twice per frame; `progress` is called with the number of
/// finished evaluations and their total. One frame and its text are in memory. USD groups time
/// samples by attribute: the text of each changing attribute is first written to an unnamed
/// temporary file in the folder of `path`.
///
/// # Errors
/// If there are no frames, splats or frames per second, the up direction has no length, the text
/// would be larger than the limit, the scene cannot be evaluated, or the file cannot be written.
pub fn write(
    path: &Path,
    clip: &Clip<'_>,
    options: &WriteOptions,
    existing: Existing,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<WriteReport, IoError> {
    clip.check(path)?;
    let rotation = rotation_to_y(options.up)
        .ok_or_else(|| IoError::content(path, "the upward direction has no length"))?;
    let mut file = AtomicFile::create(path, existing)?;
    let degree = options.sh_degree.unwrap_or(clip.scene.sh_degree()).min(clip.scene.sh_degree());
    let frames = clip.times.len();

    let mut pass = FirstPass::new(clip.scene.num_splats());
    clip.each_frame(path, |index, splats| {
        pass.add(splats);
        progress(index + 1, 2 * frames);
        Ok(())
    })?;
    let rows = pass.valid.rows(path)?;
    let sampled = |attribute: Attribute| pass.changes[attribute as usize];
    let estimate: u64 = Attribute::ALL
        .into_iter()
        .map(|a| if sampled(a) { frames as u64 } else { 1 } * a.numbers(degree))
        .sum::<u64>()
        * rows.len() as u64
        * BYTES_PER_NUMBER;
    if estimate > options.size_limit {
        let gigabytes = estimate as f64 / 1e9;
        return Err(IoError::Unfit {
            path: path.to_owned(),
            what: format!(
                "the file would be a text of about {gigabytes:.1} GB, too large for most tools"
            ),
        });
    }

    let failed = IoError::write;
    let mut samples = Vec::new();
    for attribute in Attribute::ALL.into_iter().filter(|&a| sampled(a)) {
        samples.push((attribute, temporary_file(path).map_err(failed(path))?));
    }
    let mut hemispheres = Hemispheres::default();
    if samples.is_empty() {
        // The evaluations that are not needed count as done.
        (frames..2 * frames).for_each(|done| progress(done + 1, 2 * frames));
    } else {
        clip.each_frame(path, |index, splats| {
            hemispheres.follow(splats);
            for (attribute, file) in &mut samples {
                write!(file, "            {index}: ").map_err(failed(path))?;
                write_array(file, *attribute, splats, &hemispheres, &rows, degree)
                    .map_err(failed(path))?;
                file.write_all(b",\n").map_err(failed(path))?;
            }
            progress(frames + index + 1, 2 * frames);
            Ok(())
        })?;
    }

    file.write_all(head(clip, &rotation, degree).as_bytes()).map_err(failed(path))?;
    let mut text = String::new();
    pass.write_extents(clip, &mut text);
    file.write_all(text.as_bytes()).map_err(failed(path))?;
    let mut hemispheres = Hemispheres::default();
    hemispheres.follow(&pass.first);
    let mut samples = samples.into_iter().peekable();
    for attribute in Attribute::ALL {
        let (kind, name) = (attribute.kind(), attribute.name());
        if let Some((_, samples)) = samples.next_if(|(sampled, _)| *sampled == attribute) {
            writeln!(file, "        {kind} {name}.timeSamples = {{").map_err(failed(path))?;
            append(&mut file, samples).map_err(failed(path))?;
            file.write_all(b"        }\n").map_err(failed(path))?;
        } else {
            write!(file, "        {kind} {name} = ").map_err(failed(path))?;
            write_array(&mut file, attribute, &pass.first, &hemispheres, &rows, degree)
                .map_err(failed(path))?;
            file.write_all(b"\n").map_err(failed(path))?;
        }
    }
    file.write_all(b"    }\n}\n").map_err(failed(path))?;
    file.commit()?;
    Ok(WriteReport {
        num_splats: rows.len(),
        sampled: Attribute::ALL.into_iter().filter(|&a| sampled(a)).map(Attribute::name).collect(),
        losses: losses(clip, degree, rows.len()),
    })
}

/// An unnamed file in the folder of `path`.
fn temporary_file(path: &Path) -> std::io::Result<BufWriter<File>> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let file = tempfile::tempfile_in(folder.unwrap_or(Path::new(".")))?;
    Ok(BufWriter::with_capacity(BUFFER, file))
}

/// Copies all that was written to `from`.
fn append(to: &mut impl Write, from: BufWriter<File>) -> std::io::Result<()> {
    let mut from = from.into_inner().map_err(std::io::IntoInnerError::into_error)?;
    from.rewind()?;
    std::io::copy(&mut BufReader::with_capacity(BUFFER, from), to)?;
    Ok(())
}

fn losses(clip: &Clip<'_>, degree: usize, written: usize) -> FormatLosses {
    let mut losses = FormatLosses::none();
    let stored = clip.scene.sh_degree();
    if degree < stored {
        losses.push(format!("SH degree {stored} becomes {degree}"));
    }
    losses.push(
        "colours are written as displayed (sRGB), although the schema specifies linear \
                light: renderers that convert them show brighter colours",
    );
    if clip.times.len() > 1 {
        losses.push("between frames, USD interpolates linearly");
    }
    if let Some(sentence) =
        dropped_sentence(clip.scene.num_splats() - written, clip.scene.num_splats())
    {
        losses.push(sentence);
    }
    losses
}

/// The text before the per-splat attributes.
fn head(clip: &Clip<'_>, rotation: &[[f64; 3]; 3], degree: usize) -> String {
    // USD multiplies row vectors: the rows of its matrix are the columns of the rotation.
    let row = |k: usize| format!("({}, {}, {}, 0)", rotation[0][k], rotation[1][k], rotation[2][k]);
    format!(
        r#"#usda 1.0
(
    defaultPrim = "World"
    endTimeCode = {last}
    framesPerSecond = {fps}
    metersPerUnit = 1
    startTimeCode = 0
    timeCodesPerSecond = {fps}
    upAxis = "Y"
)

def Xform "World"
{{
    matrix4d xformOp:transform = ( {x}, {y}, {z}, (0, 0, 0, 1) )
    uniform token[] xformOpOrder = ["xformOp:transform"]

    def ParticleField3DGaussianSplat "Splats" (
        customData = {{
            string colorSpace = "srgb_rec709_display"
            string creator = "c4d"
        }}
    )
    {{
        uniform int radiance:sphericalHarmonicsDegree = {degree}
"#,
        last = clip.times.len() - 1,
        fps = clip.fps,
        x = row(0),
        y = row(1),
        z = row(2),
    )
}

/// The shortest rotation that takes `up` to +y, rows first. Exact for axes.
fn rotation_to_y(up: [f64; 3]) -> Option<[[f64; 3]; 3]> {
    let length = up.iter().map(|c| c * c).sum::<f64>().sqrt();
    if !(length.is_finite() && length > 0.0) {
        return None;
    }
    let [x, y, z] = up.map(|c| c / length);
    if y < -1.0 + 1e-9 {
        // Rotation by 180° about x.
        return Some([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
    }
    let k = 1.0 / (1.0 + y);
    // `+ 0.0` converts −0 to 0.
    Some(
        [[1.0 - x * x * k, -x, -x * z * k], [x, y, z], [-x * z * k, -z, 1.0 - z * z * k]]
            .map(|row| row.map(|c| c + 0.0)),
    )
}

/// First pass over the clip.
struct FirstPass {
    valid: ValidRows,
    first: Splats,
    changes: [bool; 5],
    /// Box of each frame, three standard deviations around every usable splat.
    extents: Vec<[[f32; 3]; 2]>,
}

impl FirstPass {
    fn new(num_splats: usize) -> Self {
        Self {
            valid: ValidRows::new(num_splats),
            first: Splats::default(),
            changes: [false; 5],
            extents: Vec::new(),
        }
    }

    fn add(&mut self, splats: &Splats) {
        self.valid.add(splats);
        if self.extents.is_empty() {
            self.first.clone_from(splats);
        } else {
            let first = &self.first;
            let pairs = [
                (first.means.as_flattened(), splats.means.as_flattened()),
                (first.quats.as_flattened(), splats.quats.as_flattened()),
                (first.log_scales.as_flattened(), splats.log_scales.as_flattened()),
                (first.opacity_logits.as_slice(), splats.opacity_logits.as_slice()),
                (first.sh.as_flattened(), splats.sh.as_flattened()),
            ];
            for (changes, (first, now)) in self.changes.iter_mut().zip(pairs) {
                *changes = *changes || differ(first, now);
            }
        }
        let empty = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        let extent = (0..splats.len())
            .into_par_iter()
            .filter(|&row| splats.is_finite(row))
            .fold(
                || empty,
                |mut extent, row| {
                    let largest = splats.scale(row).into_iter().fold(0.0, f32::max);
                    let reach = 3.0 * largest.min(f32::MAX / 3.0);
                    for (k, centre) in splats.means[row].into_iter().enumerate() {
                        extent[0][k] = extent[0][k].min(centre - reach).max(f32::MIN);
                        extent[1][k] = extent[1][k].max(centre + reach).min(f32::MAX);
                    }
                    extent
                },
            )
            .reduce(
                || empty,
                |a, b| {
                    let k = [0, 1, 2];
                    [k.map(|k| a[0][k].min(b[0][k])), k.map(|k| a[1][k].max(b[1][k]))]
                },
            );
        self.extents.push(extent);
    }

    fn write_extents(&self, clip: &Clip<'_>, text: &mut String) {
        let write = |text: &mut String, [min, max]: [[f32; 3]; 2]| {
            text.push('[');
            tuple(text, &min);
            text.push_str(", ");
            tuple(text, &max);
            text.push(']');
        };
        if clip.times.len() == 1 || self.changes[..3] == [false; 3] {
            text.push_str("        float3[] extent = ");
            write(text, self.extents[0]);
            text.push('\n');
            return;
        }
        text.push_str("        float3[] extent.timeSamples = {\n");
        for (index, &extent) in self.extents.iter().enumerate() {
            let _ = write!(text, "            {index}: ");
            write(text, extent);
            text.push_str(",\n");
        }
        text.push_str("        }\n");
    }
}

/// Whether any values differ; the lengths are equal.
fn differ(a: &[f32], b: &[f32]) -> bool {
    const PIECE: usize = 1 << 14;
    a.par_chunks(PIECE).zip(b.par_chunks(PIECE)).any(|(a, b)| a != b)
}

/// Writes one attribute of all rows, `[a, b, …]`.
fn write_array(
    file: &mut impl Write,
    attribute: Attribute,
    splats: &Splats,
    hemispheres: &Hemispheres,
    rows: &[usize],
    degree: usize,
) -> std::io::Result<()> {
    const ROWS_PER_PIECE: usize = 4096;
    let bytes_per_row = usize::try_from(attribute.numbers(degree) * BYTES_PER_NUMBER).unwrap_or(0);
    let pieces: Vec<String> = rows
        .par_chunks(ROWS_PER_PIECE)
        .map(|rows| {
            let mut text = String::with_capacity(rows.len() * bytes_per_row);
            for &row in rows {
                match attribute {
                    Attribute::Positions => tuple(&mut text, &splats.means[row]),
                    Attribute::Orientations => tuple(&mut text, &hemispheres.get(row)),
                    Attribute::Scales => {
                        tuple(&mut text, &splats.scale(row).map(|scale| scale.min(f32::MAX)));
                    }
                    Attribute::Opacities => number(&mut text, splats.opacity(row)),
                    Attribute::Radiance => {
                        let kept = &splats.sh_of(row)[..sh::num_coeffs(degree)];
                        for (i, rgb) in kept.iter().enumerate() {
                            if i > 0 {
                                text.push(',');
                            }
                            tuple(&mut text, rgb);
                        }
                    }
                }
                text.push(',');
            }
            text
        })
        .collect();
    file.write_all(b"[")?;
    for (i, piece) in pieces.iter().enumerate() {
        let last = i + 1 == pieces.len();
        file.write_all(if last { &piece.as_bytes()[..piece.len() - 1] } else { piece.as_bytes() })?;
    }
    file.write_all(b"]")
}

fn tuple(text: &mut String, values: &[f32]) {
    text.push('(');
    for (i, &value) in values.iter().enumerate() {
        if i > 0 {
            text.push(',');
        }
        number(text, value);
    }
    text.push(')');
}

/// The shortest decimal that reads back to the same bits.
fn number(text: &mut String, value: f32) {
    let mut digits = zmij::Buffer::new();
    let digits = digits.format(value);
    let end = match digits.as_bytes() {
        [whole @ .., b'.', b'0'] => whole.len(),
        all => all.len(),
    };
    text.push_str(&digits[..end]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_is_rotated_to_y() {
        for up in
            [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 2.0], [-1.0, 0.0, 0.0], [0.3, -0.5, 0.7]]
        {
            let rotation = rotation_to_y(up).unwrap();
            let length = up.iter().map(|c| c * c).sum::<f64>().sqrt();
            for (k, expected) in [0.0, length, 0.0].into_iter().enumerate() {
                let rotated: f64 = (0..3).map(|c| rotation[k][c] * up[c]).sum();
                assert!((rotated - expected).abs() < 1e-12, "{up:?}: {rotated}");
            }
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                let dot: f64 = (0..3).map(|c| rotation[a][c] * rotation[b][c]).sum();
                assert!(dot.abs() < 1e-12, "a rotation");
            }
        }
        assert_eq!(rotation_to_y([0.0; 3]), None, "no direction");
        assert_eq!(rotation_to_y([f64::NAN; 3]), None, "NaN");
    }

    #[test]
    fn numbers_round_trip() {
        for value in [0.0, -0.0, 1.0, 0.1, -3.402_823_5e38, 1e-45, 1.234_567_9e-5, 16_777_216.0] {
            let mut text = String::new();
            number(&mut text, value);
            assert_eq!(text.parse::<f32>().unwrap().to_bits(), value.to_bits(), "{text}");
            assert!(text.len() < 16, "{text}");
        }
    }
}
