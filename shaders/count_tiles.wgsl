// Needs: shared/dispatch.wgsl, shared/frame.wgsl
// Number of tiles in the rectangle of each visible splat, in depth order. One invocation = one rank (and one that ends the array).
//
// In: `visible_offsets`, whose last entry is V; `splat_ids` [V] by depth; `rects`. Out: `tiles_per_splat` [N+1], 0 from rank V on.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> visible_offsets: array<u32>;
@group(0) @binding(2) var<storage, read> splat_ids: array<u32>;
@group(0) @binding(3) var<storage, read> rects: array<vec2u>;
@group(0) @binding(4) var<storage, read_write> tiles_per_splat: array<u32>;

@compute @workgroup_size(256)
fn count_tiles(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let rank = group_index(workgroup) * GROUP_SIZE + lane;
    if rank > frame.num_splats {
        return;
    }
    var count = 0u;
    if rank < visible_offsets[frame.num_splats] {
        let rect = rects[splat_ids[rank]];
        let size = vec2u((rect.y & 0xffffu) - (rect.x & 0xffffu), (rect.y >> 16u) - (rect.x >> 16u));
        count = size.x * size.y;
    }
    tiles_per_splat[rank] = count;
}
