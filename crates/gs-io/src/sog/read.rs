//! Reading SOG.

use super::SogError;
use crate::archive::Archive;
use crate::archive::decompress;
use crate::bytes8::{ends_note, largest_from, logit_of, smallest_three_rad};
use crate::frame::{Frame, FrameFormat};
use crate::fs::text;
use crate::plane::{FIRST_SLOT, PALETTE_ROW, Plane};
use crate::tsog;
use gs_core::nearest_rank;
use gs_core::sh::num_coeffs;
use gs_core::{Precision, RowPrecision, Splats};
use serde::Deserialize;
use std::io::Cursor;
use std::sync::Arc;

/// Largest gap between codebook values, in median gaps, that is
/// used as a bound of the rounding error.
const WIDEST_GAP: f32 = 8.0;

#[derive(Debug, Deserialize)]
struct Meta {
    #[serde(default)]
    version: u32,
    #[serde(default)]
    count: u64,
    means: Means,
    scales: Coded,
    quats: Files,
    sh0: Coded,
    #[serde(rename = "shN")]
    sh_n: Option<Palette>,
}

#[derive(Debug, Deserialize)]
struct Means {
    mins: [f32; 3],
    maxs: [f32; 3],
    files: [String; 2],
}

#[derive(Debug, Deserialize)]
struct Coded {
    #[serde(default)]
    codebook: Vec<f32>,
    files: [String; 1],
}

#[derive(Debug, Deserialize)]
struct Files {
    files: [String; 1],
}

#[derive(Debug, Deserialize)]
struct Palette {
    #[serde(default)]
    bands: usize,
    #[serde(default)]
    codebook: Vec<f32>,
    files: [String; 2],
}

fn damaged(what: impl Into<String>) -> SogError {
    SogError::damaged(what)
}

/// Reads a SOG archive.
///
/// # Errors
/// If it is a different kind of archive, damaged, or of version 1.
pub fn read(bytes: &[u8]) -> Result<Frame, SogError> {
    let mut archive = Archive::open(Cursor::new(bytes)).map_err(damaged)?;
    let name = archive
        .names()
        .iter()
        .find(|name| *name == "meta.json" || name.ends_with("/meta.json"))
        .cloned()
        .ok_or_else(|| {
            damaged("a zip archive without meta.json; expected SOG, or a zip of numbered frames as a scene")
        })?;
    let folder = name[..name.len() - "meta.json".len()].to_owned();
    let limit = decompress::limit(bytes.len());
    let meta = archive.read(&name, limit).map_err(damaged)?;
    let archive = std::cell::RefCell::new(archive);
    read_planes(&meta, &|plane| archive.borrow_mut().read(&format!("{folder}{plane}"), limit))
}

/// Reads `meta.json`; `plane` returns the bytes of a file named there, or an error message.
pub(crate) fn read_planes(
    meta: &[u8],
    plane: &dyn Fn(&str) -> Result<Vec<u8>, String>,
) -> Result<Frame, SogError> {
    if tsog::is_timed(meta) {
        return Err(SogError::Timed);
    }
    let meta: Meta = serde_json::from_slice(&text::json(meta))
        .map_err(|error| damaged(format!("meta.json: {error}")))?;
    if meta.version != 2 {
        return Err(SogError::Version { found: meta.version.max(1) });
    }
    let names = [
        &meta.means.files[0],
        &meta.means.files[1],
        &meta.scales.files[0],
        &meta.quats.files[0],
        &meta.sh0.files[0],
    ];
    let packed = names.map(|name| plane(name).map_err(damaged));
    let packed = packed.into_iter().collect::<Result<Vec<_>, _>>()?;
    // A plane of one colour takes only a few bytes, so the limit applies to all planes together.
    let limit = decompress::limit(packed.iter().map(Vec::len).sum());
    let planes = packed
        .iter()
        .map(|bytes| Plane::decode(bytes, limit).map_err(damaged))
        .collect::<Result<Vec<_>, _>>()?;
    let [low, high, scales, quats, colors] = &planes[..] else {
        return Err(damaged("planes are missing"));
    };
    let count = usize::try_from(meta.count).unwrap_or(usize::MAX);
    if count == 0 {
        return Err(SogError::Empty);
    }
    if let Some(short) = planes.iter().map(Plane::len).find(|&pixels| pixels < count) {
        return Err(damaged(format!("{count} splats in a plane of {short} pixels")));
    }
    let [scale_book, color_book] = [&meta.scales.codebook, &meta.sh0.codebook].map(|b| Book::of(b));
    let (scale_book, color_book) = (scale_book?, color_book?);
    let harmonics = match &meta.sh_n {
        Some(palette) => Some(Harmonics::of(palette, count, limit, plane)?),
        None => None,
    };
    let sh_degree = harmonics.as_ref().map_or(0, |harmonics| harmonics.degree);

    let mut splats = Splats::with_capacity(count, sh_degree);
    let mut precision = Vec::with_capacity(count);
    let mut bad_slots = 0;
    for i in 0..count {
        let [l, h] = [low.at(i), high.at(i)];
        let (mean, mean_off) = meta.means.at(l, h);
        splats.means.push(mean);
        let scale = scales.at(i);
        splats.log_scales.push([0, 1, 2].map(|axis| scale_book.values[usize::from(scale[axis])]));
        let [a, b, c, slot] = quats.at(i);
        let others =
            [a, b, c].map(|byte| (f32::from(byte) / 255.0 - 0.5) * std::f32::consts::SQRT_2);
        if slot < FIRST_SLOT {
            bad_slots += 1;
            splats.quats.push(gs_core::quat::IDENTITY);
        } else {
            splats.quats.push(largest_from(others, usize::from(slot - FIRST_SLOT)));
        }
        let [r, g, b, alpha] = colors.at(i);
        splats.opacity_logits.push(logit_of(alpha));
        splats.sh.push([r, g, b].map(|byte| color_book.values[usize::from(byte)]));
        if let Some(harmonics) = &harmonics {
            splats.sh.extend(harmonics.of_splat(i));
        }
        // WebP encoders clear the colour of pixels with alpha 0, so the
        // colour of an invisible splat is unknown.
        let color_off = |byte: u8| {
            if alpha == 0 { f32::INFINITY } else { color_book.off[usize::from(byte)] }
        };
        precision.push(RowPrecision {
            means: mean_off,
            rotation_rad: 1.1 * smallest_three_rad(std::f32::consts::SQRT_2 / 255.0),
            log_scales: [0, 1, 2].map(|axis| scale_book.off[usize::from(scale[axis])]),
            opacity: 1.1 / 255.0,
            sh_dc: [r, g, b].map(color_off),
            // Palettes are fitted to the scene, so the error of a splat's entry is unknown.
            sh_rest: [f32::INFINITY; 3],
            ..RowPrecision::EXACT
        });
    }
    let mut notes: Vec<String> =
        ends_note((0..count).map(|i| colors.at(i)[3])).into_iter().collect();
    if bad_slots > 0 {
        notes.push(format!("{bad_slots} damaged rotations were read as the identity"));
    }
    Ok(Frame {
        splats,
        format: FrameFormat::Sog,
        axes: None,
        precision: Some(Arc::new(Precision::by_chunk(precision, 1))),
        notes,
        comments: Vec::new(),
    })
}

impl Means {
    /// A centre and its largest error.
    fn at(&self, low: [u8; 4], high: [u8; 4]) -> ([f32; 3], [f32; 3]) {
        let (mut mean, mut off) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let width = self.maxs[axis] - self.mins[axis];
            let unit = f32::from(u16::from_le_bytes([low[axis], high[axis]])) / 65535.0;
            let log = self.mins[axis] + width * unit;
            mean[axis] = log.abs().exp_m1().copysign(log);
            // A whole step, because some writers truncate and some round.
            off[axis] = 1.1 * width.abs() / 65535.0 * (mean[axis].abs() + 1.0);
        }
        (mean, off)
    }
}

/// 256 values, and the largest rounding error of each.
struct Book {
    values: [f32; 256],
    off: [f32; 256],
}

impl Book {
    fn of(codebook: &[f32]) -> Result<Self, SogError> {
        let values: [f32; 256] = codebook.try_into().map_err(|_error| {
            damaged(format!("a codebook of {} values, expected 256", codebook.len()))
        })?;
        let mut sorted = values;
        sorted.sort_by(f32::total_cmp);
        // A written value is closest to its codebook value, hence within the wider adjacent gap.
        // Unusually wide gaps are limited, because otherwise they would contain a codebook value.
        let mut gaps: Vec<f32> = sorted.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps.retain(|gap| *gap > 0.0);
        let widest = WIDEST_GAP * nearest_rank(&mut gaps, 0.5).unwrap_or(0.0);
        let gap = |value: f32| {
            let below = sorted.iter().rev().find(|&&other| other < value);
            let above = sorted.iter().find(|&&other| other > value);
            let gaps = [below, above].map(|other| other.map_or(0.0, |other| (other - value).abs()));
            gaps[0].max(gaps[1]).min(widest)
        };
        Ok(Self { values, off: values.map(gap) })
    }
}

/// SH above degree 0.
struct Harmonics {
    degree: usize,
    codebook: Book,
    centroids: Plane,
    labels: Plane,
}

impl Harmonics {
    fn of(
        palette: &Palette,
        count: usize,
        limit: u64,
        plane: &dyn Fn(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Self, SogError> {
        if !(1..=3).contains(&palette.bands) {
            return Err(damaged(format!("{} bands of SH, expected 1 to 3", palette.bands)));
        }
        let [centroids, labels] = &palette.files;
        let centroids =
            Plane::decode(&plane(centroids).map_err(damaged)?, limit).map_err(damaged)?;
        let labels = Plane::decode(&plane(labels).map_err(damaged)?, limit).map_err(damaged)?;
        let width = PALETTE_ROW * (num_coeffs(palette.bands) - 1);
        if centroids.width() != width || labels.len() < count {
            return Err(damaged(format!(
                "SH planes {} pixels wide and of {} pixels, expected {width} and {count}",
                centroids.width(),
                labels.len()
            )));
        }
        let codebook = Book::of(&palette.codebook)?;
        Ok(Self { degree: palette.bands, codebook, centroids, labels })
    }

    /// Coefficients of degree 1 and above; zeros beyond the palette.
    fn of_splat(&self, i: usize) -> impl Iterator<Item = [f32; 3]> + '_ {
        let [low, high, ..] = self.labels.at(i);
        let label = usize::from(u16::from_le_bytes([low, high]));
        let higher = num_coeffs(self.degree) - 1;
        let start = (label / PALETTE_ROW) * self.centroids.width() + (label % PALETTE_ROW) * higher;
        (start..start + higher).map(|at| {
            if at >= self.centroids.len() {
                return [0.0; 3];
            }
            let [r, g, b, _] = self.centroids.at(at);
            [r, g, b].map(|byte| self.codebook.values[usize::from(byte)])
        })
    }
}
