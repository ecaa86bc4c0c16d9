// Needs: shared/frame.wgsl
// Traversal of a tile: 64 lanes, each with a block of 2x2 pixels in the four components of a
// vector; 64 entries staged at a time.

const TILE_LANES: u32 = 64u;

// Mean and conic A, B.
var<workgroup> stage_near: array<vec4f, 64>;
// Conic C, opacity, smallest exponent at which alpha can be ALPHA_THRESHOLD, unused.
var<workgroup> stage_far: array<vec4f, 64>;
// Splat and slot.
var<workgroup> stage_ids: array<vec2u, 64>;

// Coordinates of the lane's four pixels.
struct Block {
    x: vec4u,
    y: vec4u,
    inside: vec4<bool>,
    // Row-major index in the image; undefined outside.
    pixel: vec4u,
}

fn block_of(frame: Frame, tile: vec2u, lane: u32) -> Block {
    var o: Block;
    o.x = tile.x * TILE_SIZE + 2u * (lane % 8u) + vec4u(0u, 1u, 0u, 1u);
    o.y = tile.y * TILE_SIZE + 2u * (lane / 8u) + vec4u(0u, 0u, 1u, 1u);
    o.inside = (o.x < vec4u(frame.img_size.x)) & (o.y < vec4u(frame.img_size.y));
    o.pixel = o.y * frame.img_size.x + o.x;
    return o;
}

fn stage_entry(at: u32, entry: vec2u, g0: vec4f, g1: vec4f) {
    stage_near[at] = g0;
    // A hidden splat (opacity 0 or less) gets a threshold that no exponent reaches. The margin
    // makes this test weaker than the exact one.
    let min_exponent = select(1.0, log(ALPHA_THRESHOLD / max(g1.y, 1e-30)) - 0.001, g1.y > 0.0);
    stage_far[at] = vec4f(g1.xy, min_exponent, 0.0);
    stage_ids[at] = entry;
}

// Exponent of the Gaussian at the four pixels.
fn exponent(near: vec4f, far: vec4f, dx: vec4f, dy: vec4f) -> vec4f {
    return -0.5 * (near.z * dx * dx + far.x * dy * dy) - near.w * dx * dy;
}
