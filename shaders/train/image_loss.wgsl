// Needs: nothing
// Uniforms of the image losses, addresses, and tests of numbers.
//
// Images are interleaved [H,W,C]; a mask has one weight per pixel, and only weights above 0 count (a weight that is no number does not).

struct ImageLoss {
    img_size: vec2u,
    num_channels: u32,
    // The channel of this dispatch, where it treats one.
    channel: u32,
    // First value of the image, and of its gradient, in their buffers.
    x_base: u32,
    v_base: u32,
    // Where this dispatch leaves its sums.
    first_partial: u32,
    // Weight of the gradient.
    factor: f32,
}

// Tests on bits: a compiler may assume that floats are never NaN.
fn is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
}

// The weight, 0 unless it is above 0.
fn counted(weight: f32) -> f32 {
    return select(0.0, weight, weight > 0.0 && !is_nan(weight));
}

// A masked value; whatever lies outside the mask, even NaN, is 0.
fn masked(weight: f32, value: f32) -> f32 {
    return select(0.0, weight * value, weight > 0.0);
}
