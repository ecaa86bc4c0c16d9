// Needs: nothing
// Uniforms of the image losses, addresses, and tests for NaN.
//
// Images are interleaved [H,W,C]; a mask has one weight per pixel; weights
// that are not above 0, including NaN, count as 0.

struct ImageLoss {
    img_size: vec2u,
    num_channels: u32,
    // The channel of this dispatch, for kernels that process one.
    channel: u32,
    // First value of the image, and of its gradient, in their buffers.
    x_base: u32,
    v_base: u32,
    // Index of the first sum of this dispatch.
    first_partial: u32,
    // Weight of the gradient.
    factor: f32,
}

// Tests on bits, because a compiler may assume that floats are never NaN.
fn is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
}

// The weight if it is above 0, else 0.
fn counted(weight: f32) -> f32 {
    return select(0.0, weight, weight > 0.0 && !is_nan(weight));
}

// A masked value; outside the mask every value, even NaN, becomes 0.
fn masked(weight: f32, value: f32) -> f32 {
    return select(0.0, weight * value, weight > 0.0);
}
