// Needs: nothing
// Uniforms of a frame, constants of the image formation, and tests of finiteness.

struct Frame {
    // Rows of the world-to-camera matrix for points relative to `camera_pos`; the last entry is the
    // remaining translation (rounding error of `camera_pos`).
    view0: vec4f,
    view1: vec4f,
    view2: vec4f,
    camera_pos: vec3f,
    sh_degree: u32,
    background: vec3f,
    exact_gradients: u32,
    focal: vec2f,
    // Principal point minus half the image size, pixels.
    center_offset: vec2f,
    // Guard band of the projection's Jacobian, in tangents.
    guard: vec2f,
    img_size: vec2u,
    tile_bounds: vec2u,
    num_splats: u32,
    max_isects: u32,
    // 0 or 1: whether colour, depth are among the channels; they come first, then the features.
    rgb: u32,
    depth: u32,
    num_features: u32,
    grad_stride: u32,
    // Offsets of the planes in an image buffer; colour begins at 0.
    alpha_base: u32,
    depth_base: u32,
    features_base: u32,
    // The part of the work done by this dispatch.
    first_channel: u32,
    first_splat: u32,
    num_chunk_splats: u32,
    first_slot: u32,
    num_slots: u32,
    // Near plane, and the offset of the depth in the perspective division, world units.
    near: f32,
    divide: f32,
    pad0: u32,
    pad1: u32,
}

// Documented in gs_core::image_formation; a test compares the values.
const TILE_SIZE: u32 = 16u;
const MAX_ALPHA: f32 = 0.99;
const ALPHA_THRESHOLD: f32 = 0.003921569;
const TRANSMITTANCE_THRESHOLD: f32 = 0.0001;
const EPS2D: f32 = 0.3;
const EXTENT_SIGMAS: f32 = 3.0;
const MIN_DISCRIMINANT: f32 = 0.1;
const MIN_QUAT_NORM: f32 = 1e-12;

// Tests on bits, because a compiler may assume that floats are never NaN.
fn is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
}

fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn is_finite3(x: vec3f) -> bool {
    return is_finite(x.x) && is_finite(x.y) && is_finite(x.z);
}

// Number of channels of a render, before padding.
fn frame_channels(frame: Frame) -> u32 {
    return 3u * frame.rgb + frame.depth + frame.num_features;
}

// Address of channel `channel` of pixel `pixel` in an image buffer.
fn frame_address(frame: Frame, channel: u32, pixel: u32) -> u32 {
    let colors = 3u * frame.rgb;
    if channel < colors {
        return pixel * 3u + channel;
    }
    if frame.depth == 1u && channel == colors {
        return frame.depth_base + pixel;
    }
    return frame.features_base + pixel * frame.num_features + (channel - colors - frame.depth);
}
