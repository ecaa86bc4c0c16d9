//! Masks of edited pixels.

use gs_core::Image;

/// Flags of the pixels that differ by more than `threshold` in any channel, `[H,W]`.
///
/// # Panics
/// If the sizes differ.
pub fn difference_mask(original: &Image, edited: &Image, threshold: f32) -> Vec<bool> {
    assert!(
        original.data.len() == edited.data.len() && original.channels == edited.channels,
        "difference_mask: {} and {} values",
        original.data.len(),
        edited.data.len()
    );
    let channels = original.channels.max(1);
    original
        .data
        .chunks_exact(channels)
        .zip(edited.data.chunks_exact(channels))
        .map(|(a, b)| a.iter().zip(b).any(|(a, b)| (a - b).abs() > threshold))
        .collect()
}

/// Clears 4-connected groups of fewer than `smallest` pixels, such as noise of lossy compression.
pub fn remove_specks(mask: &mut [bool], width: usize, smallest: usize) {
    let mut seen = vec![false; mask.len()];
    let (mut group, mut open) = (Vec::new(), Vec::new());
    for start in 0..mask.len() {
        if !mask[start] || seen[start] {
            continue;
        }
        group.clear();
        open.push(start);
        seen[start] = true;
        while let Some(p) = open.pop() {
            group.push(p);
            let x = p % width;
            let neighbors = [
                (x > 0).then(|| p - 1),
                (x + 1 < width).then_some(p + 1),
                p.checked_sub(width),
                (p + width < mask.len()).then_some(p + width),
            ];
            for q in neighbors.into_iter().flatten() {
                if mask[q] && !seen[q] {
                    seen[q] = true;
                    open.push(q);
                }
            }
        }
        if group.len() < smallest {
            for &p in &group {
                mask[p] = false;
            }
        }
    }
}

/// Sets every pixel within `radius` columns and rows of a set one.
pub fn dilated(mask: &[bool], width: usize, radius: usize) -> Vec<bool> {
    if width == 0 || radius == 0 {
        return mask.to_vec();
    }
    let mut across = vec![false; mask.len()];
    for (row, out) in mask.chunks(width).zip(across.chunks_mut(width)) {
        for (x, _) in row.iter().enumerate().filter(|(_, on)| **on) {
            out[x.saturating_sub(radius)..(x + radius + 1).min(width)].fill(true);
        }
    }
    let rows = mask.len() / width;
    let mut out = vec![false; mask.len()];
    for y in 0..rows {
        let target = &mut out[y * width..(y + 1) * width];
        for near in y.saturating_sub(radius)..(y + radius + 1).min(rows) {
            for (set, &on) in target.iter_mut().zip(&across[near * width..(near + 1) * width]) {
                *set |= on;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_specks_and_dilation() {
        let original = Image::zeros(5, 4, 3);
        let mut edited = original.clone();
        edited.pixel_mut(1, 1)[2] = 0.5;
        edited.pixel_mut(2, 1)[0] = 0.5;
        edited.pixel_mut(4, 3)[0] = 0.5;
        edited.pixel_mut(0, 3)[0] = 0.02;
        let mut mask = difference_mask(&original, &edited, 8.0 / 255.0);
        let set = |mask: &[bool]| -> Vec<usize> { (0..20).filter(|&p| mask[p]).collect() };
        assert_eq!(set(&mask), [6, 7, 19], "any channel, above the threshold");
        remove_specks(&mut mask, 5, 2);
        assert_eq!(set(&mask), [6, 7], "single pixels go");
        let wide = dilated(&mask, 5, 1);
        assert_eq!(set(&wide), [0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13], "one around, cut");
    }
}
