// Needs: nothing
// A crop of an image, and flags of its pixels. Four flags are packed in a word.

struct Crop {
    // Size of the whole image.
    img_size: vec2u,
    origin: vec2u,
    size: vec2u,
    // First value of the change of colour among the planes of the whole image.
    features_base: u32,
    pad0: u32,
}

// Supervised by the warp.
const FORE: u32 = 1u;
// Supervised by the previous render.
const BACK: u32 = 2u;
// An edited splat is visible.
const LIVE: u32 = 4u;

// Position of pixel `p` of the crop in the whole image.
fn whole_pixel(crop: Crop, p: u32) -> u32 {
    return (crop.origin.y + p / crop.size.x) * crop.img_size.x + crop.origin.x + p % crop.size.x;
}

fn flags_of(word: u32, p: u32) -> u32 {
    return (word >> (8u * (p % 4u))) & 255u;
}
