// Needs: nothing
// The 11x11 Gaussian window of SSIM (sigma 1.5, sum 1) as two passes of 11
// taps, and the block of an image that a group reads.
//
// One group = 16x16 windows of one channel; it reads 26x26 pixels. Values beyond the image are 0.

const REACH: u32 = 5u;
const BLOCK: u32 = 16u;
const SEEN: u32 = 26u;
const SEEN_PIXELS: u32 = 676u;
// SEEN rows of BLOCK values.
const STRIP: u32 = 416u;

// exp(-d^2 / 4.5) / sum for d = 5 to 0.
const TAP_5: f32 = 0.001028380084;
const TAP_4: f32 = 0.007598758135;
const TAP_3: f32 = 0.03600077213;
const TAP_2: f32 = 0.1093606895;
const TAP_1: f32 = 0.2130055377;
const TAP_0: f32 = 0.2660117249;

// Pixel of entry `seen` (0 to 675) of a group's block; x and y may lie outside the image.
fn seen_pixel(group: vec2u, seen: u32) -> vec2i {
    return vec2i(vec2u(group.x * BLOCK + seen % SEEN, group.y * BLOCK + seen / SEEN)) - vec2i(i32(REACH));
}

fn weigh(a: f32, b: f32, c: f32, d: f32, e: f32, f: f32) -> f32 {
    return TAP_5 * a + TAP_4 * b + TAP_3 * c + TAP_2 * d + TAP_1 * e + TAP_0 * f;
}
