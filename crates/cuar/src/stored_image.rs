//! Supervised images as bytes, so that a resumed run can reuse them.

use crate::{
    SupervisionStats, ViewTime,
    descent_image::{Crop, Entry},
    sample::{Made, Sample},
};
use gs_core::Splats;

/// The image of a view and time in little-endian bytes; `None` stands for an image without edited
/// splats.
pub(crate) fn encode<P>(made: Option<&Made<P>>) -> Vec<u8> {
    let Some(made) = made else { return Vec::new() };
    let Sample { crop, original, warp, flags, entries, splats, .. } = &made.sample;
    let mut out = Vec::with_capacity(made.sample.bytes() + 256);
    let SupervisionStats { live, masked, surface, splat_colors, rejections } = made.stats;
    let mut counts = vec![u64::from(made.floored), live, masked, surface, splat_colors];
    counts.extend(rejections);
    counts.extend([crop.x, crop.y, crop.width, crop.height].map(|value| value as u64));
    counts.extend([entries.len(), splats.len(), splats.sh_degree].map(|value| value as u64));
    out.extend(counts.into_iter().flat_map(u64::to_le_bytes));
    let mut floats =
        |values: &[f32]| out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    floats(original);
    floats(warp);
    floats(splats.means.as_flattened());
    floats(splats.quats.as_flattened());
    floats(splats.log_scales.as_flattened());
    floats(&splats.opacity_logits);
    floats(splats.sh.as_flattened());
    out.extend_from_slice(flags);
    for (entry, uncertain) in entries.iter().zip(&made.uncertain) {
        let Entry { local, row, towards, color, is_constrained } = entry;
        out.extend(local.to_le_bytes().into_iter().chain(row.to_le_bytes()));
        out.extend(towards.iter().chain(color).flat_map(|value| value.to_le_bytes()));
        out.extend([u8::from(*is_constrained), u8::from(*uncertain)]);
    }
    out
}

/// Numbers in the header of [`encode`].
const COUNTS: usize = 18;
/// Bytes of an entry.
const ENTRY: usize = 2 * 4 + 6 * 4 + 2;

/// Inverse of [`encode`], for the view and time `at`; `None` if the bytes are malformed. `num_rows`
/// is the number of edited splats.
#[expect(clippy::option_option, reason = "an image that shows nothing is known, too")]
pub(crate) fn decode<P>(bytes: &[u8], at: ViewTime, num_rows: usize) -> Option<Option<Made<P>>> {
    if bytes.is_empty() {
        return Some(None);
    }
    let (head, body) = bytes.split_at_checked(COUNTS * 8)?;
    let head: Vec<u64> = head.as_chunks::<8>().0.iter().map(|b| u64::from_le_bytes(*b)).collect();
    let [floored, live, masked, surface, splat_colors, d0, d1, d2, d3, d4, d5, rest @ ..] =
        &head[..]
    else {
        return None;
    };
    let sizes: Vec<usize> =
        rest.iter().map(|&value| usize::try_from(value).ok()).collect::<Option<_>>()?;
    let [x, y, width, height, num_entries, num_splats, sh_degree] = sizes[..] else { return None };
    let pixels = width.checked_mul(height).filter(|&pixels| pixels <= body.len())?;
    if sh_degree > 3 || num_splats > body.len() || num_entries > body.len() {
        return None;
    }
    let coeffs = gs_core::sh::num_coeffs(sh_degree);
    let mut rest = body;
    let mut floats = |count: usize| -> Option<Vec<f32>> {
        let (part, tail) = rest.split_at_checked(count * 4)?;
        rest = tail;
        Some(part.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
    };
    let (original, warp) = (floats(pixels * 3)?, floats(pixels * 3)?);
    let splats = Splats {
        means: floats(num_splats * 3)?.as_chunks::<3>().0.to_vec(),
        quats: floats(num_splats * 4)?.as_chunks::<4>().0.to_vec(),
        log_scales: floats(num_splats * 3)?.as_chunks::<3>().0.to_vec(),
        opacity_logits: floats(num_splats)?,
        sh: floats(num_splats * coeffs * 3)?.as_chunks::<3>().0.to_vec(),
        sh_degree,
    };
    let (flags, entries_bytes) = rest.split_at_checked(pixels)?;
    let (chunks, left) = entries_bytes.as_chunks::<ENTRY>();
    if chunks.len() != num_entries || !left.is_empty() {
        return None;
    }
    let (mut entries, mut uncertain) = (Vec::with_capacity(num_entries), Vec::new());
    for chunk in chunks {
        let (words, bits) = chunk.as_chunks::<4>();
        let float = |k: usize| f32::from_le_bytes(words[k]);
        let (local, row) = (u32::from_le_bytes(words[0]), u32::from_le_bytes(words[1]));
        if local as usize >= num_splats || row as usize >= num_rows {
            return None;
        }
        let [towards, color] = [[2, 3, 4], [5, 6, 7]].map(|at| at.map(float));
        entries.push(Entry { local, row, towards, color, is_constrained: bits[0] != 0 });
        uncertain.push(bits[1] != 0);
    }
    let sample = Sample {
        at,
        crop: Crop { x, y, width, height },
        original,
        warp,
        flags: flags.to_vec(),
        entries,
        splats,
        prepared: None,
    };
    let (live, masked, surface, splat_colors) = (*live, *masked, *surface, *splat_colors);
    let rejections = [*d0, *d1, *d2, *d3, *d4, *d5];
    let stats = SupervisionStats { live, masked, surface, splat_colors, rejections };
    Some(Some(Made { sample, stats, floored: *floored != 0, uncertain }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_round_trip_and_damaged_bytes_are_rejected() {
        let at = ViewTime { view: 2, time: 0.25 };
        let entry = |row| Entry {
            local: row,
            row: 2 * row,
            towards: [0.1, 0.2, 0.3],
            color: [0.4, 0.5, -0.6],
            is_constrained: row == 1,
        };
        let splats = Splats {
            means: vec![[1.0, 2.0, 3.0]; 2],
            quats: vec![[1.0, 0.0, 0.0, 0.5]; 2],
            log_scales: vec![[-1.0; 3]; 2],
            opacity_logits: vec![0.5, f32::MIN_POSITIVE],
            sh: vec![[0.0; 3]; 2],
            sh_degree: 0,
        };
        let made: Made<()> = Made {
            sample: Sample {
                at,
                crop: Crop { x: 1, y: 2, width: 2, height: 1 },
                original: vec![0.5; 6],
                warp: vec![0.25; 6],
                flags: vec![1, 6],
                entries: vec![entry(0), entry(1)],
                splats,
                prepared: None,
            },
            stats: SupervisionStats {
                live: 1,
                masked: 2,
                surface: 3,
                splat_colors: 4,
                rejections: [5, 6, 7, 8, 9, 10],
            },
            floored: true,
            uncertain: vec![false, true],
        };
        let bytes = encode(Some(&made));
        let read: Made<()> = decode(&bytes, at, 3).unwrap().unwrap();
        assert_eq!(encode(Some(&read)), bytes, "the same bits");
        assert_eq!(
            (read.sample.at, read.stats, read.uncertain),
            (at, made.stats, made.uncertain),
            "all"
        );
        assert!(
            decode::<()>(&encode::<()>(None), at, 3).is_some_and(|made| made.is_none()),
            "nothing"
        );
        assert!(decode::<()>(&bytes, at, 2).is_none(), "of more splats");
        for cut in 1..bytes.len() {
            assert!(decode::<()>(&bytes[..cut], at, 3).is_none(), "cut at {cut}");
        }
    }
}
