// Needs: shared/dispatch.wgsl, shared/frame.wgsl
// The (splat, tile) pairs in depth order. One invocation = one pair, so
// that large splats do not unbalance the work.
//
// In: `isect_offsets` [N+1], prefix sum of the tile counts by depth rank; `splat_ids`; `rects`;
// `projected`. Out: `isect_keys` [I] = tile id, or the number of tiles for pairs that cannot draw
// (they are sorted behind all tiles); `isect_splats` [I].

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> isect_offsets: array<u32>;
@group(0) @binding(2) var<storage, read> splat_ids: array<u32>;
@group(0) @binding(3) var<storage, read> rects: array<vec2u>;
@group(0) @binding(4) var<storage, read> projected: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> isect_keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> isect_splats: array<u32>;

// Beyond it even an opaque splat has alpha below the threshold. Opacities may change without new
// lists, so the bound assumes opacity 1.
const REACH: f32 = -2.0 * log(ALPHA_THRESHOLD);

// A dx^2 + 2 B dx dy + C dy^2, minus a bound of the rounding error.
fn quad_below(conic: vec3f, d: vec2f) -> f32 {
    let squares = conic.x * d.x * d.x + conic.z * d.y * d.y;
    let cross = 2.0 * conic.y * d.x * d.y;
    return squares + cross - 2e-6 * (squares + abs(cross));
}

// Whether the splat's alpha is at least ALPHA_THRESHOLD at some pixel centre of the box.
fn reaches(mean: vec2f, conic: vec3f, low: vec2f, high: vec2f) -> bool {
    if all(mean >= low) && all(mean <= high) {
        return true;
    }
    // If the minimum of a convex function lies outside the box, the minimum over the box lies on an
    // edge; along each edge the function is a parabola.
    let near = low - mean;
    let far = high - mean;
    let bend = -conic.y / vec2f(conic.x, conic.z);
    var smallest = quad_below(conic, vec2f(near.x, clamp(bend.y * near.x, near.y, far.y)));
    smallest = min(smallest, quad_below(conic, vec2f(far.x, clamp(bend.y * far.x, near.y, far.y))));
    smallest = min(smallest, quad_below(conic, vec2f(clamp(bend.x * near.y, near.x, far.x), near.y)));
    smallest = min(smallest, quad_below(conic, vec2f(clamp(bend.x * far.y, near.x, far.x), far.y)));
    return smallest <= REACH * 1.0002;
}

@compute @workgroup_size(256)
fn emit_isects(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let k = group_index(workgroup) * GROUP_SIZE + lane;
    if k >= min(isect_offsets[frame.num_splats], frame.max_isects) {
        return;
    }
    // The last rank whose pairs begin at or before k; ranks without
    // pairs are last and begin after every k.
    var rank = 0u;
    var end = frame.num_splats;
    while rank + 1u < end {
        let middle = (rank + end) / 2u;
        if isect_offsets[middle] <= k {
            rank = middle;
        } else {
            end = middle;
        }
    }
    let splat = splat_ids[rank];
    let rect = rects[splat];
    let low = vec2u(rect.x & 0xffffu, rect.x >> 16u);
    let columns = (rect.y & 0xffffu) - low.x;
    let within = k - isect_offsets[rank];
    let tile = low + vec2u(within % columns, within / columns);
    let g0 = projected[2u * splat];
    let g1 = projected[2u * splat + 1u];
    let first = tile * TILE_SIZE;
    let last = min(first + TILE_SIZE, frame.img_size) - 1u;
    var key = tile.y * frame.tile_bounds.x + tile.x;
    if !reaches(g0.xy, vec3f(g0.zw, g1.x), vec2f(first), vec2f(last)) {
        key = frame.tile_bounds.x * frame.tile_bounds.y;
    }
    isect_keys[k] = key;
    isect_splats[k] = splat;
}
