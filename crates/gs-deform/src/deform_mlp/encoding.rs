//! Frequency encoding of coordinates.

/// Length of the encoding of `dims` coordinates with `frequencies` frequencies.
pub(super) const fn len(dims: usize, frequencies: usize) -> usize {
    dims * (1 + 2 * frequencies)
}

/// `[x, sin x, cos x, sin 2x, cos 2x, …, cos 2^(L−1)x]`, each entry for all coordinates; calls
/// `put` with index and value in this order.
pub(super) fn encode<const D: usize>(
    x: [f32; D],
    frequencies: usize,
    mut put: impl FnMut(usize, f32),
) {
    for (k, value) in x.into_iter().enumerate() {
        put(k, value);
    }
    let mut scale = 1.0_f32;
    for frequency in 0..frequencies {
        let start = D * (1 + 2 * frequency);
        for (k, value) in x.into_iter().enumerate() {
            let (sine, cosine) = (scale * value).sin_cos();
            put(start + k, sine);
            put(start + D + k, cosine);
        }
        scale *= 2.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_order_and_frequencies() {
        let mut out = vec![f32::NAN; len(2, 2)];
        encode([0.3, -0.7], 2, |k, value| out[k] = value);
        let expected = [
            0.3,
            -0.7,
            0.3_f32.sin(),
            (-0.7_f32).sin(),
            0.3_f32.cos(),
            0.7_f32.cos(),
            0.6_f32.sin(),
            (-1.4_f32).sin(),
            0.6_f32.cos(),
            1.4_f32.cos(),
        ];
        assert_eq!(out, expected, "no π, all sines of a frequency before its cosines");
    }
}
