// Needs: shared/dispatch.wgsl, shared/frame.wgsl
// The pairs of each tile. One invocation = one sorted pair.
//
// In: `isect_offsets`, whose last entry is I; `isect_keys` [I] sorted by tile,
// keeping the depth order; `isect_slots` [I] = position before the sort;
// `isect_splats` [I] by position before the sort. Out: `entries` [I] = (splat, slot);
// `tile_ranges` [tiles] = (first, end), cleared beforehand.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> isect_offsets: array<u32>;
@group(0) @binding(2) var<storage, read> isect_keys: array<u32>;
@group(0) @binding(3) var<storage, read> isect_slots: array<u32>;
@group(0) @binding(4) var<storage, read> isect_splats: array<u32>;
@group(0) @binding(5) var<storage, read_write> entries: array<vec2u>;
@group(0) @binding(6) var<storage, read_write> tile_ranges: array<u32>;

@compute @workgroup_size(256)
fn find_ranges(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let e = group_index(workgroup) * GROUP_SIZE + lane;
    let num_isects = min(isect_offsets[frame.num_splats], frame.max_isects);
    if e >= num_isects {
        return;
    }
    let key = isect_keys[e];
    let slot = isect_slots[e];
    entries[e] = vec2u(isect_splats[slot], slot);
    if key >= frame.tile_bounds.x * frame.tile_bounds.y {
        return;
    }
    if e == 0u || isect_keys[max(e, 1u) - 1u] != key {
        tile_ranges[2u * key] = e;
    }
    if e + 1u == num_isects || isect_keys[min(e + 1u, num_isects - 1u)] != key {
        tile_ranges[2u * key + 1u] = e + 1u;
    }
}
