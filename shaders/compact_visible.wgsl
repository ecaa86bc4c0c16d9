// Needs: shared/dispatch.wgsl, shared/frame.wgsl
// Gathers the visible splats in index order (a stable depth sort then breaks ties by index). One invocation = one splat.
//
// In: `visible_offsets` [N+1] = exclusive prefix sum of the flags; its last entry is V. Out: `depth_keys` [V], the bits of the
// camera depth, which is positive, so that they sort as integers; `splat_ids` [V].

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> visible_offsets: array<u32>;
@group(0) @binding(2) var<storage, read> projected: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> depth_keys: array<u32>;
@group(0) @binding(4) var<storage, read_write> splat_ids: array<u32>;

@compute @workgroup_size(256)
fn compact(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(workgroup) * GROUP_SIZE + lane;
    if i >= frame.num_splats {
        return;
    }
    let rank = visible_offsets[i];
    if visible_offsets[i + 1u] > rank {
        depth_keys[rank] = bitcast<u32>(projected[2u * i + 1u].z);
        splat_ids[rank] = i;
    }
}
