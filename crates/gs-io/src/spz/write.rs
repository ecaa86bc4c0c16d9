//! SPZ out.

use super::quantize::{MAX_FIXED, color, fixed, harmonic, log_scale, smallest_three};
use super::{FLIPS, FRACTIONAL_BITS, HEADER, HEADER_4, MARK, flip_point, flip_quat};
use crate::bytes8::unorm8;
use crate::losses::Losses;
use gs_core::{Splats, sh};
use std::io::{self, Write};

/// Effort of the compressors: the reference encoder's own.
const ZSTD_LEVEL: i32 = 12;

/// How to write SPZ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteOptions {
    /// 3 (gzip; the version most players read) or 4 (zstd). Default 4.
    pub version: u32,
    /// SH degree of the file, at most that of the splats; `None` keeps theirs.
    pub sh_degree: Option<usize>,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { version: 4, sh_degree: None }
    }
}

/// Writes an SPZ frame and says what it does not keep. Scenes beyond ±2048 units get fewer bits of fraction, so that all of
/// them fits, but for floaters beyond ±32768.
///
/// # Errors
/// If the arrays of `splats` disagree, there are none or too many, or the version is another
/// ([`io::ErrorKind::InvalidInput`]); if writing fails.
pub fn write(splats: &Splats, options: &WriteOptions, out: &mut impl Write) -> io::Result<Losses> {
    let invalid = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
    splats.check_shapes().map_err(|error| invalid(error.to_string()))?;
    let num_splats = u32::try_from(splats.len()).ok().filter(|&count| count > 0);
    let num_splats =
        num_splats.ok_or_else(|| invalid(format!("{} splats, expected 1 to 2³²", splats.len())))?;
    let degree = options.sh_degree.map_or(splats.sh_degree, |degree| degree.min(splats.sh_degree));
    let bits = fractional_bits(splats);
    let parts = parts(splats, degree, bits);
    let mut header = Vec::with_capacity(HEADER_4);
    header.extend_from_slice(&MARK);
    header.extend_from_slice(&options.version.to_le_bytes());
    header.extend_from_slice(&num_splats.to_le_bytes());
    header.push(u8::try_from(degree).map_err(io::Error::other)?);
    header.extend_from_slice(&[bits, 0, 0]);
    match options.version {
        3 => {
            debug_assert_eq!(header.len(), HEADER, "as the layout says");
            let level = flate2::Compression::default();
            let mut gzip = flate2::GzBuilder::new().mtime(0).write(out, level);
            gzip.write_all(&header)?;
            for part in &parts {
                gzip.write_all(part)?;
            }
            gzip.finish()?;
        }
        4 => write_4(header, &parts, out)?,
        other => return Err(invalid(format!("SPZ version {other}, expected 3 or 4"))),
    }
    Ok(losses(splats, degree, bits))
}

fn write_4(mut header: Vec<u8>, parts: &[Vec<u8>; 6], out: &mut impl Write) -> io::Result<()> {
    let present = parts.iter().filter(|part| !part.is_empty());
    let packed = present
        .map(|part| Ok((part.len(), zstd::bulk::compress(part, ZSTD_LEVEL)?)))
        .collect::<io::Result<Vec<_>>>()?;
    if let Some(count) = header.last_mut() {
        *count = u8::try_from(packed.len()).map_err(io::Error::other)?;
    }
    let table = u32::try_from(HEADER_4).map_err(io::Error::other)?;
    header.extend_from_slice(&table.to_le_bytes());
    header.resize(HEADER_4, 0);
    for (length, stream) in &packed {
        header.extend_from_slice(&(stream.len() as u64).to_le_bytes());
        header.extend_from_slice(&(*length as u64).to_le_bytes());
    }
    out.write_all(&header)?;
    packed.iter().try_for_each(|(_, stream)| out.write_all(stream))
}

/// Bits of fraction that are given up for splats far away, however few: 1/256 units are left.
const LEAST_FOR_FEW: u8 = 8;
/// Share of the splats, far away, that do not cost the others more bits than that: floaters.
const FEW: f64 = 0.001;

/// Whether a finite centre lies beyond what `bits` of fraction leave room for.
fn is_beyond(mean: &[f32; 3], bits: u8) -> bool {
    let scale = (1_u32 << bits) as f32;
    mean.iter().any(|value| value.is_finite() && value.abs() * scale > MAX_FIXED)
}

/// The most bits, up to the usual 12, with which all centres fit; below [`LEAST_FOR_FEW`], all but a [`FEW`].
fn fractional_bits(splats: &Splats) -> u8 {
    let beyond = |bits: u8| splats.means.iter().filter(|mean| is_beyond(mean, bits)).count();
    let few = |count: usize| count as f64 <= FEW * splats.len() as f64;
    (0..=FRACTIONAL_BITS)
        .rev()
        .find(|&bits| match beyond(bits) {
            0 => true,
            count => bits <= LEAST_FOR_FEW && few(count),
        })
        .unwrap_or(0)
}

fn parts(splats: &Splats, degree: usize, bits: u8) -> [Vec<u8>; 6] {
    let coeffs = sh::num_coeffs(degree);
    let rows = 0..splats.len();
    let means = splats.means.iter().flat_map(|&mean| flip_point(mean));
    let scales = splats.log_scales.iter().flatten();
    let rotations = splats.quats.iter().flat_map(|&q| {
        let [w, x, y, z] = flip_quat(q);
        smallest_three([x, y, z, w])
    });
    let dc = rows.clone().flat_map(|i| splats.sh_of(i)[0]);
    let rest = rows.clone().flat_map(|i| {
        splats.sh_of(i)[1..coeffs].iter().enumerate().flat_map(|(k, rgb)| {
            let degree = if k < 3 { 1 } else { 2 };
            rgb.map(|value| harmonic(FLIPS[k + 1] * value, degree))
        })
    });
    [
        means.flat_map(|value| fixed(value, bits)).collect(),
        rows.clone().map(|i| unorm8(splats.opacity(i))).collect(),
        dc.map(color).collect(),
        scales.map(|&value| log_scale(value)).collect(),
        rotations.collect(),
        rest.collect(),
    ]
}

fn losses(splats: &Splats, degree: usize, bits: u8) -> Losses {
    let mut losses = Losses::none();
    if degree < splats.sh_degree {
        losses.push(format!("SH degree {} becomes {degree}", splats.sh_degree));
    }
    let half = 0.5 / f64::from(1_u32 << bits);
    losses.push(format!("positions are rounded by at most {half:.1e} units"));
    if bits < FRACTIONAL_BITS {
        losses.push(format!("the scene reaches beyond ±2048 units: positions have {bits} bits of fraction instead of {FRACTIONAL_BITS}, which some players do not expect; scale the scene down if one shows it wrong"));
    }
    let beyond = splats.means.iter().filter(|mean| is_beyond(mean, bits)).count();
    if beyond > 0 {
        losses.push(format!(
            "{beyond} splats beyond ±{:.0} units are moved to there",
            f64::from(MAX_FIXED) / f64::from(1_u32 << bits)
        ));
    }
    losses
        .push("scales are within 3.2 %, rotations within 0.3°, colours and opacities have 8 bits");
    if degree > 0 {
        losses.push("SH coefficients have 5 bits (degree 1) or 4 bits (above), clipped to ±1");
    }
    let outside = |value: &f32| !(-10.03..=5.97).contains(value);
    let clipped = splats.log_scales.iter().filter(|row| row.iter().any(outside)).count();
    if clipped > 0 {
        losses.push(format!("scales of {clipped} splats outside e⁻¹⁰ to e^5.9 units are clipped"));
    }
    losses
}
