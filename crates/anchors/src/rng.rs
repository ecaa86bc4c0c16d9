//! Counter-based uniform random numbers: a value depends on its index, not on earlier draws.

/// Increment of the `SplitMix64` sequence (the golden ratio in 64 bits).
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Output function of `SplitMix64`: a bijection that passes the usual statistical tests.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Four uniform numbers in [0,1) for item `index`; `attempt` counts redraws after rejection.
pub(crate) fn uniforms(seed: u64, index: u64, attempt: u64) -> [f64; 4] {
    // Seeds are mixed first so that neighbouring seeds do not give shifted copies of one sequence.
    let stream = mix(mix(seed.wrapping_add(GOLDEN)).wrapping_add(attempt.wrapping_mul(GOLDEN)));
    std::array::from_fn(|j| {
        let counter = index.wrapping_mul(4).wrapping_add(j as u64 + 1);
        let bits = mix(stream.wrapping_add(counter.wrapping_mul(GOLDEN)));
        (bits >> 11) as f64 * (0.5 * f64::EPSILON)
    })
}
