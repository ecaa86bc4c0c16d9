//! Writing SPZ.

use super::layout::{EXTENSION_AXES, FLAG_EXTENSIONS, FRACTIONAL_BITS, HEADER, HEADER_4, SH_BITS};
use super::quantize::{
    MAX_FIXED, color, fixed, from_harmonic, harmonic, log_scale, smallest_three,
};
use crate::axes::{self, Axes};
use crate::bytes8::unorm8;
use crate::content::magic::SPZ;
use crate::format_losses::FormatLosses;
use crate::sh_error::ShError;
use gs_core::{Splats, sh};
use std::io::{self, Write};

/// Compression level, as in the reference encoder.
const ZSTD_LEVEL: i32 = 12;

/// Options for writing SPZ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteOptions {
    /// 3 (gzip) or 4 (zstd, slightly smaller, supported by few viewers). Default 3.
    pub version: u32,
    /// SH degree of the file, at most that of the splats; `None` keeps theirs.
    pub sh_degree: Option<usize>,
    /// Axes of the file, stated in an extension record, which most readers skip. Default
    /// [`Axes::RUB`], as in the specification.
    pub axes: Axes,
    /// Bits of SH coefficients of degree 1 and of the degrees above, 1 to 8 each. Fewer bits
    /// compress better. Default 5 and 4, as in the reference encoder.
    pub sh_bits: [u32; 2],
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { version: 3, sh_degree: None, axes: Axes::RUB, sh_bits: SH_BITS }
    }
}

/// Writes an SPZ frame and returns the losses. Scenes beyond ±2048 units get fewer fractional bits,
/// so that all splats fit, except floaters beyond ±32768.
///
/// # Errors
/// If the arrays of `splats` have inconsistent lengths, there are none or too many, or an option is
/// out of range ([`io::ErrorKind::InvalidInput`]); if writing fails.
pub fn write(
    splats: &Splats,
    options: &WriteOptions,
    out: &mut impl Write,
) -> io::Result<FormatLosses> {
    let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
    splats.check_shapes().map_err(|error| invalid(error.to_string()))?;
    let num_splats = u32::try_from(splats.len()).ok().filter(|&count| count > 0);
    let num_splats =
        num_splats.ok_or_else(|| invalid(format!("{} splats, expected 1 to 2³²", splats.len())))?;
    if let Some(bits) = options.sh_bits.iter().find(|bits| !(1..=8).contains(*bits)) {
        return Err(invalid(format!("{bits} bits per SH coefficient, expected 1 to 8")));
    }
    let degree = options.sh_degree.map_or(splats.sh_degree, |degree| degree.min(splats.sh_degree));
    let bits = fractional_bits(splats);
    let mut converted = splats.clone();
    axes::convert(&mut converted, Axes::PLY, options.axes);
    let parts = parts(&converted, degree, bits, options.sh_bits);
    let record = [EXTENSION_AXES, 4, options.axes.code()].map(u32::to_le_bytes).concat();
    let mut header = Vec::with_capacity(HEADER_4);
    header.extend_from_slice(&SPZ);
    header.extend_from_slice(&options.version.to_le_bytes());
    header.extend_from_slice(&num_splats.to_le_bytes());
    header.push(u8::try_from(degree).map_err(io::Error::other)?);
    header.extend_from_slice(&[bits, FLAG_EXTENSIONS, 0]);
    match options.version {
        3 => {
            debug_assert_eq!(header.len(), HEADER, "as the layout says");
            let level = flate2::Compression::default();
            let mut gzip = flate2::GzBuilder::new().mtime(0).write(out, level);
            gzip.write_all(&header)?;
            for part in &parts {
                gzip.write_all(part)?;
            }
            gzip.write_all(&record)?;
            gzip.finish()?;
        }
        4 => write_4(header, &record, &parts, out)?,
        other => return Err(invalid(format!("SPZ version {other}, expected 3 or 4"))),
    }
    Ok(losses(splats, &converted, degree, bits, &parts[5], options))
}

fn write_4(
    mut header: Vec<u8>,
    records: &[u8],
    parts: &[Vec<u8>; 6],
    out: &mut impl Write,
) -> io::Result<()> {
    let present = parts.iter().filter(|part| !part.is_empty());
    let packed = present
        .map(|part| Ok((part.len(), zstd::bulk::compress(part, ZSTD_LEVEL)?)))
        .collect::<io::Result<Vec<_>>>()?;
    if let Some(count) = header.last_mut() {
        *count = u8::try_from(packed.len()).map_err(io::Error::other)?;
    }
    let table = u32::try_from(HEADER_4 + records.len()).map_err(io::Error::other)?;
    header.extend_from_slice(&table.to_le_bytes());
    header.resize(HEADER_4, 0);
    header.extend_from_slice(records);
    for (length, stream) in &packed {
        header.extend_from_slice(&(stream.len() as u64).to_le_bytes());
        header.extend_from_slice(&(*length as u64).to_le_bytes());
    }
    out.write_all(&header)?;
    packed.iter().try_for_each(|(_, stream)| out.write_all(stream))
}

/// Smallest number of fractional bits for the sake of a few distant splats: a step of 1/256 units.
const MIN_BITS_WITH_OUTLIERS: u8 = 8;
/// Number of steps across a scene below which more fractional bits are
/// used; a pixel of a large image is several steps.
const STEPS: f32 = 16_384.0;
/// Bits of a centre without its sign.
const MAX_FRACTIONAL_BITS: u8 = 23;
/// Share of distant splats (floaters) that may be clamped rather
/// than reduce the fractional bits further.
const OUTLIER_SHARE: f64 = 0.001;

/// Whether a finite centre is out of range with `bits` fractional bits.
fn is_beyond(mean: &[f32; 3], bits: u8) -> bool {
    let scale = (1_u32 << bits) as f32;
    mean.iter().any(|value| value.is_finite() && value.abs() * scale > MAX_FIXED)
}

/// Fractional bits with which all centres fit: usually 12, fewer for larger scenes
/// (below [`MIN_BITS_WITH_OUTLIERS`], all but a share of [`OUTLIER_SHARE`] have to fit), more for
/// scenes so small that steps of 1/4096 would be visible.
fn fractional_bits(splats: &Splats) -> u8 {
    let beyond = |bits: u8| splats.means.iter().filter(|mean| is_beyond(mean, bits)).count();
    let are_outliers = |count: usize| count as f64 <= OUTLIER_SHARE * splats.len() as f64;
    (0..=FRACTIONAL_BITS.max(fine_bits(splats)))
        .rev()
        .find(|&bits| match beyond(bits) {
            0 => true,
            count => bits <= MIN_BITS_WITH_OUTLIERS && are_outliers(count),
        })
        .unwrap_or(0)
}

/// The streams of splats in the axes of the file.
fn parts(splats: &Splats, degree: usize, bits: u8, sh_bits: [u32; 2]) -> [Vec<u8>; 6] {
    let coeffs = sh::num_coeffs(degree);
    let rows = 0..splats.len();
    let means = splats.means.iter().flatten();
    let scales = splats.log_scales.iter().flatten();
    let rotations = splats.quats.iter().flat_map(|&[w, x, y, z]| smallest_three([x, y, z, w]));
    let dc = rows.clone().flat_map(|i| splats.sh_of(i)[0]);
    let rest = rows.clone().flat_map(|i| {
        splats.sh_of(i)[1..coeffs].iter().enumerate().flat_map(|(k, rgb)| {
            let bits = sh_bits[usize::from(k >= 3)];
            rgb.map(|value| harmonic(value, bits))
        })
    });
    [
        means.flat_map(|&value| fixed(value, bits)).collect(),
        rows.clone().map(|i| unorm8(splats.opacity(i))).collect(),
        dc.map(color).collect(),
        scales.map(|&value| log_scale(value)).collect(),
        rotations.collect(),
        rest.collect(),
    ]
}

/// Colour error of `harmonics`, the SH bytes of `converted`.
fn sh_error(converted: &Splats, degree: usize, harmonics: &[u8]) -> ShError {
    let mut error = ShError::default();
    let stored = sh::num_coeffs(degree) - 1;
    let mut read = Vec::with_capacity(stored);
    for i in 0..converted.len() {
        read.clear();
        let bytes = harmonics.get(3 * stored * i..3 * stored * (i + 1)).unwrap_or_default();
        read.extend(bytes.as_chunks::<3>().0.iter().map(|rgb| rgb.map(from_harmonic)));
        error.add(&converted.sh_of(i)[1..], &read);
    }
    error
}

/// Fractional bits with which the scene is at least [`STEPS`] steps wide.
fn fine_bits(splats: &Splats) -> u8 {
    let (min, max) = splats.bounds().unwrap_or_default();
    let width = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f32::max);
    let enough = |bits: &u8| width * (1_u32 << *bits) as f32 >= STEPS;
    if width > 0.0 {
        (0..=MAX_FRACTIONAL_BITS).find(enough).unwrap_or(MAX_FRACTIONAL_BITS)
    } else {
        0
    }
}

fn losses(
    splats: &Splats,
    converted: &Splats,
    degree: usize,
    bits: u8,
    harmonics: &[u8],
    options: &WriteOptions,
) -> FormatLosses {
    let mut losses = FormatLosses::none();
    if degree < splats.sh_degree {
        losses.push(format!("SH degree {} becomes {degree}", splats.sh_degree));
    }
    let half = 0.5 / f64::from(1_u32 << bits);
    losses.push(format!("positions are rounded by at most {half:.1e} units"));
    if bits > FRACTIONAL_BITS {
        losses.push(format!(
            "the scene is small: positions have {bits} fractional bits instead of \
                            {FRACTIONAL_BITS}; players that ignore the header show it at the \
                            wrong size"
        ));
    }
    if bits < FRACTIONAL_BITS {
        losses.push(format!(
            "the scene extends beyond ±2048 units: positions have {bits} \
                            fractional bits instead of {FRACTIONAL_BITS}, which some players do \
                            not support; scale the scene down if it looks wrong"
        ));
    }
    let beyond = splats.means.iter().filter(|mean| is_beyond(mean, bits)).count();
    if beyond > 0 {
        losses.push(format!(
            "{beyond} splats beyond ±{:.0} units are clamped",
            f64::from(MAX_FIXED) / f64::from(1_u32 << bits)
        ));
    }
    losses
        .push("scales are within 3.2 %, rotations within 0.3°, colours and opacities have 8 bits");
    if splats.sh_degree > 0 {
        let [first, above] = options.sh_bits;
        let kept = match degree {
            0 => "no SH is stored".to_owned(),
            1 => format!("SH coefficients have {first} bits, clipped to ±1"),
            _ => format!(
                "SH coefficients have {first} bits (degree 1) and {above} (above), clipped to ±1"
            ),
        };
        losses.push(format!(
            "{kept}: colours are off by {}",
            sh_error(converted, degree, harmonics).in_steps()
        ));
    }
    if options.version >= 4 {
        losses.push(
            "viewers for version 3 (including three.js and Spark at the time of writing) \
                    cannot open version 4: --spz-version 3",
        );
    }
    losses.push(match options.axes {
        Axes::RUB => "axes are RUB, as specified for SPZ; splat-transform 3 and gsply ignore the \
                     axes and show the file upside down: use --spz-axes ply for them"
            .to_owned(),
        Axes::PLY => "axes are those of the PLY, as in splat-transform 3 and gsply; tools that \
                     follow the SPZ specification show the file upside down: use --spz-axes rub \
                     for them"
            .to_owned(),
        other => format!(
            "axes are {other}; tools that ignore the axes record show the file \
                         rotated"
        ),
    });
    let outside = |value: &f32| !(-10.03..=5.97).contains(value);
    let clipped = splats.log_scales.iter().filter(|row| row.iter().any(outside)).count();
    if clipped > 0 {
        losses.push(format!("scales of {clipped} splats outside e⁻¹⁰ to e^5.9 units are clipped"));
    }
    losses
}
