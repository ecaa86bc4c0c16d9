//! Masks of pixels.

/// `mask` (`[H,W]`, `width` columns) dilated by `radius` pixels in each direction (a square).
pub fn dilated(mask: &[bool], width: usize, radius: usize) -> Vec<bool> {
    if width == 0 {
        return Vec::new();
    }
    let height = mask.len() / width;
    let along = |source: &[bool], length: usize, step: usize, start: usize| -> Vec<bool> {
        let mut last = None;
        let mut near = vec![false; length];
        for k in 0..length {
            if source[start + k * step] {
                last = Some(k);
            }
            near[k] = last.is_some_and(|last| k - last <= radius);
        }
        let mut next = None;
        for k in (0..length).rev() {
            if source[start + k * step] {
                next = Some(k);
            }
            near[k] |= next.is_some_and(|next| next - k <= radius);
        }
        near
    };
    let mut rows = Vec::with_capacity(mask.len());
    for y in 0..height {
        rows.extend(along(mask, width, 1, y * width));
    }
    let mut out = vec![false; mask.len()];
    for x in 0..width {
        for (y, near) in along(&rows, height, width, x).into_iter().enumerate() {
            out[y * width + x] = near;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dilated_pixel_is_a_square() {
        let mut mask = vec![false; 7 * 5];
        mask[2 * 7 + 3] = true;
        let grown = dilated(&mask, 7, 1);
        for (i, &inside) in grown.iter().enumerate() {
            let (x, y) = (i % 7, i / 7);
            assert_eq!(inside, x.abs_diff(3) <= 1 && y.abs_diff(2) <= 1, "({x}, {y})");
        }
        assert_eq!(dilated(&mask, 7, 0), mask, "not grown");
        assert!(dilated(&[], 0, 3).is_empty(), "no pixels");
    }
}
