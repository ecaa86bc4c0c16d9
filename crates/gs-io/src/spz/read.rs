//! Reading SPZ.

use super::SpzError;
use super::layout::{
    COLOR_SCALE, EXTENSION_AXES, FLAG_ANTIALIASED, FLAG_EXTENSIONS, HEADER, HEADER_4,
    LOG_SCALE_MIN, LOG_SCALE_STEPS, USUAL_AXES,
};
use super::quantize::{
    FIRST_THREE_COMPONENT, MAX_FIXED, bucket, from_color, from_first_three, from_fixed,
    from_harmonic, from_log_scale, from_smallest_three, smallest_three_component, used_bits,
};
use crate::archive::decompress;
use crate::axes::{self, Axes, AxesReading};
use crate::bytes8::{ends_note, logit_of, smallest_three_rad};
use crate::content::magic::SPZ;
use crate::frame::{Frame, FrameFormat, Shape};
use gs_core::sh::{MAX_DEGREE, num_coeffs};
use gs_core::{Precision, RowPrecision, Splats};
use rayon::prelude::*;
use std::sync::Arc;

/// Allowance for the rounding of other writers, in half steps.
const SLACK: f32 = 1.1;
/// Highest SH degree the format has.
const FORMAT_DEGREE: usize = 4;

#[derive(Debug, Clone, Copy)]
struct Header {
    version: u32,
    num_splats: usize,
    /// As in the file, up to 4.
    degree: usize,
    fractional_bits: u8,
    flags: u8,
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, SpzError> {
        if bytes.len() < HEADER || !bytes.starts_with(&SPZ) {
            return Err(SpzError::Truncated {
                part: "the header",
                expected: HEADER as u128,
                found: bytes.len() as u128,
            });
        }
        let word = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[at + i]));
        let (version, num_splats) = (word(4), word(8));
        if !(2..=4).contains(&version) {
            return Err(SpzError::Version { found: version });
        }
        let (degree, fractional_bits) = (usize::from(bytes[12]), bytes[13]);
        if degree > FORMAT_DEGREE {
            return Err(SpzError::damaged(format!("SH degree {degree}, expected 0 to 4")));
        }
        if fractional_bits > 23 {
            let what = format!("{fractional_bits} bits of fraction, expected at most 23");
            return Err(SpzError::damaged(what));
        }
        if num_splats == 0 {
            return Err(SpzError::Empty);
        }
        let num_splats = usize::try_from(num_splats)
            .map_err(|error| SpzError::damaged(format!("{num_splats} splats: {error}")))?;
        Ok(Self { version, num_splats, degree, fractional_bits, flags: bytes[14] })
    }

    /// Bytes per splat of centres, opacities, colours, scales,
    /// rotations, SH, in the order of the data.
    fn widths(&self) -> [usize; 6] {
        [9, 1, 3, 3, if self.version == 2 { 3 } else { 4 }, 3 * (self.coeffs() - 1)]
    }

    fn coeffs(&self) -> usize {
        (self.degree + 1) * (self.degree + 1)
    }

    /// The axes stated in the extension records: `u32` type, `u32` number of bytes, then those
    /// bytes, one record after the other. A truncated record ends the list.
    fn axes(&self, mut records: &[u8]) -> Option<Axes> {
        if self.flags & FLAG_EXTENSIONS == 0 {
            return None;
        }
        let word = |bytes: &[u8]| bytes.first_chunk().map(|&word| u32::from_le_bytes(word));
        while let (Some(kind), Some(length)) = (word(records), word(records.get(4..)?)) {
            let body = records.get(8..)?;
            let (payload, rest) = body.split_at_checked(usize::try_from(length).ok()?)?;
            if kind == EXTENSION_AXES {
                return word(payload).and_then(Axes::from_code);
            }
            records = rest;
        }
        None
    }
}

/// Size of the frame, from its first bytes.
pub(crate) fn shape(start: &[u8]) -> Result<Shape, SpzError> {
    let header = if start.starts_with(&SPZ) {
        Header::parse(start)?
    } else {
        Header::parse(&decompress::gunzip_start(start, HEADER as u64))?
    };
    Ok(Shape {
        format: FrameFormat::Spz(header.version),
        num_splats: header.num_splats as u64,
        sh_degree: header.degree.min(MAX_DEGREE),
    })
}

/// Reads an SPZ frame, version 2, 3 or 4, and converts it to the axes of PLYs from those stated in
/// the file, else from [`Axes::RUB`]; [`Frame::axes`] has the original axes.
///
/// # Errors
/// If it is of a different kind or version, truncated, or decompresses to more than plausible for its
/// size.
pub fn read(bytes: &[u8]) -> Result<Frame, SpzError> {
    let (layout, mut frame, stated) = read_stored(bytes)?;
    let axes = stated.unwrap_or(USUAL_AXES[0]);
    frame.precision = Some(Arc::new(layout.precision(&frame.splats.quats)));
    axes::convert(&mut frame.splats, axes, Axes::PLY);
    frame.axes = Some(AxesReading { axes, stated: stated.is_some(), usual: &USUAL_AXES });
    Ok(frame)
}

/// A frame in the axes of the file, and the axes stated there.
fn read_stored(bytes: &[u8]) -> Result<(Layout, Frame, Option<Axes>), SpzError> {
    if bytes.starts_with(&SPZ) {
        let header = Header::parse(bytes)?;
        if header.version < 4 {
            let what = format!("version {} without gzip, expected a gzip stream", header.version);
            return Err(SpzError::damaged(what));
        }
        let streams = streams_4(bytes, &header)?;
        let stated = header.axes(bytes.get(HEADER_4..table_offset(bytes)).unwrap_or_default());
        let (layout, frame) = decode(&header, &streams.each_ref().map(Vec::as_slice));
        return Ok((layout, frame, stated));
    }
    let unpacked = decompress::gunzip(bytes).map_err(SpzError::damaged)?;
    let header = Header::parse(&unpacked)?;
    let mut rest = &unpacked[HEADER..];
    let mut parts: [&[u8]; 6] = [&[]; 6];
    for (part, width) in parts.iter_mut().zip(header.widths()) {
        let length = width as u128 * header.num_splats as u128;
        let Some((found, after)) =
            usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length))
        else {
            return Err(SpzError::Truncated {
                part: "the data",
                expected: length,
                found: rest.len() as u128,
            });
        };
        (*part, rest) = (found, after);
    }
    let (layout, frame) = decode(&header, &parts);
    Ok((layout, frame, header.axes(rest)))
}

/// Where the table of streams of version 4 starts.
fn table_offset(bytes: &[u8]) -> usize {
    u32::from_le_bytes([16, 17, 18, 19].map(|at: usize| bytes[at])) as usize
}

/// The decompressed streams of version 4; empty for those absent from the file.
fn streams_4(bytes: &[u8], header: &Header) -> Result<[Vec<u8>; 6], SpzError> {
    let truncated =
        |part, expected: u128| SpzError::Truncated { part, expected, found: bytes.len() as u128 };
    if bytes.len() < HEADER_4 {
        return Err(truncated("the header", HEADER_4 as u128));
    }
    let count = usize::from(bytes[15]);
    let table = table_offset(bytes);
    let data = table.saturating_add(16 * count);
    let entries = bytes.get(table..data).ok_or_else(|| truncated("the table", data as u128))?;
    let mut rest = &bytes[data..];
    let mut streams: [Vec<u8>; 6] = std::array::from_fn(|_| Vec::new());
    let wanted = header.widths().map(|width| width as u64 * header.num_splats as u64);
    let present = wanted.iter().filter(|&&length| length > 0).count();
    if count < present {
        let what = format!("{count} streams, expected {present}");
        return Err(SpzError::damaged(what));
    }
    let mut entries = entries.as_chunks::<16>().0.iter();
    for (stream, length) in streams.iter_mut().zip(wanted).filter(|(_, length)| *length > 0) {
        let Some(entry) = entries.next() else { break };
        let half = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| entry[at + i]));
        let (packed, unpacked) = (half(0), half(8));
        if unpacked != length {
            let what = format!("a stream of {unpacked} bytes, expected {length}");
            return Err(SpzError::damaged(what));
        }
        let (source, after) = usize::try_from(packed)
            .ok()
            .and_then(|packed| rest.split_at_checked(packed))
            .ok_or_else(|| SpzError::Truncated {
                part: "a stream",
                expected: u128::from(packed),
                found: rest.len() as u128,
            })?;
        *stream = decompress::unzstd(source, length).map_err(SpzError::damaged)?;
        rest = after;
    }
    Ok(streams)
}

/// Properties that determine the precision of a file.
struct Layout {
    header: Header,
    /// Bits of SH coefficients of degree 1 and of higher degrees, if any are non-zero.
    sh_bits: [Option<u32>; 2],
}

/// Decodes `parts`, whose lengths match the header, in the axes of the file.
fn decode(header: &Header, parts: &[&[u8]; 6]) -> (Layout, Frame) {
    let [means, opacities, colors, scales, rotations, harmonics] = parts;
    let degree = header.degree.min(MAX_DEGREE);
    let bits = header.fractional_bits;
    let mean = |bytes: &[u8; 9]| {
        let axis = |i: usize| from_fixed([bytes[3 * i], bytes[3 * i + 1], bytes[3 * i + 2]], bits);
        [axis(0), axis(1), axis(2)]
    };
    let wxyz = |[x, y, z, w]: [f32; 4]| [w, x, y, z];
    let quats: Vec<[f32; 4]> = if header.version == 2 {
        rotations.as_chunks::<3>().0.par_iter().map(|q| wxyz(from_first_three(*q))).collect()
    } else {
        rotations.as_chunks::<4>().0.par_iter().map(|q| wxyz(from_smallest_three(*q))).collect()
    };
    let (coeffs, stored) = (num_coeffs(degree), header.coeffs() - 1);
    let mut sh = vec![[0.0; 3]; header.num_splats * coeffs];
    sh.par_chunks_exact_mut(coeffs).enumerate().for_each(|(row, out)| {
        out[0] = [0, 1, 2].map(|channel| from_color(colors[3 * row + channel]));
        for k in 1..coeffs {
            let at = 3 * (row * stored + k - 1);
            out[k] = [0, 1, 2].map(|channel| from_harmonic(harmonics[at + channel]));
        }
    });
    let mut notes: Vec<String> = ends_note(opacities.iter().copied()).into_iter().collect();
    if header.degree > degree {
        notes.push(format!("SH degree {} was cut to {degree}", header.degree));
    }
    if header.flags & FLAG_ANTIALIASED != 0 {
        notes.push(
            "the file states that its splats were trained with antialiasing (a mip \
                   filter), which is not supported: small and distant splats look brighter and \
                   larger than in viewers with it"
                .to_owned(),
        );
    }
    let of_rows = |first: usize, last: usize| {
        harmonics.chunks_exact((3 * stored).max(1)).flat_map(move |row| {
            row.get(3 * first..3 * last.min(stored)).unwrap_or_default().iter().copied()
        })
    };
    let sh_bits = [used_bits(of_rows(0, 3)), used_bits(of_rows(3, 15))];
    let frame = Frame {
        splats: Splats {
            means: means.as_chunks::<9>().0.par_iter().map(mean).collect(),
            log_scales: scales
                .as_chunks::<3>()
                .0
                .par_iter()
                .map(|s| s.map(from_log_scale))
                .collect(),
            opacity_logits: opacities.par_iter().map(|&byte| logit_of(byte)).collect(),
            quats,
            sh,
            sh_degree: degree,
        },
        format: FrameFormat::Spz(header.version),
        precision: None,
        axes: None,
        notes,
        comments: Vec::new(),
    };
    (Layout { header: *header, sh_bits }, frame)
}

impl Layout {
    /// Precision of the rows with rotations `quats`.
    fn precision(&self, quats: &[[f32; 4]]) -> Precision {
        let degree = self.header.degree.min(MAX_DEGREE);
        let sh_precision = |of: usize| {
            let bits = self.sh_bits[usize::from(of > 1)].filter(|_| of <= degree);
            bits.map_or(f32::INFINITY, |bits| SLACK * (bucket(bits) / 2.0 + 0.5) / 128.0)
        };
        let unit = (1_u32 << self.header.fractional_bits) as f32;
        let row = RowPrecision {
            means: [(SLACK * 0.5 + 4.0 * f32::EPSILON * MAX_FIXED.sqrt()) / unit; 3],
            rotation_rad: SLACK * smallest_three_rad(smallest_three_component()),
            log_scales: [SLACK * 0.5 / LOG_SCALE_STEPS; 3],
            log_scale_range: [LOG_SCALE_MIN, LOG_SCALE_MIN + 255.0 / LOG_SCALE_STEPS],
            opacity: SLACK * 0.5 / 255.0,
            sh_dc: [SLACK * 0.5 / 255.0 / COLOR_SCALE; 3],
            sh_dc_range: [-0.5 / COLOR_SCALE, 0.5 / COLOR_SCALE],
            sh_rest: [1, 2, 3].map(sh_precision),
            // Symmetric, because a conversion of axes may change the sign.
            sh_rest_range: [-1.0, 1.0],
        };
        if self.header.version != 2 {
            return Precision::uniform(row);
        }
        // w is computed from the other three, so its error grows as it gets smaller.
        let off = 3.0_f32.sqrt() * FIRST_THREE_COMPONENT;
        let by_row = quats.iter().map(|q| {
            let w_off = (off / q[0].max(f32::MIN_POSITIVE)).min((2.0 * off).sqrt());
            RowPrecision { rotation_rad: SLACK * 2.0 * off.hypot(w_off), ..row }
        });
        Precision::by_chunk(by_row.collect(), 1)
    }
}
