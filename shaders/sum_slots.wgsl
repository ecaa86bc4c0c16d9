// Needs: shared/dispatch.wgsl, shared/frame.wgsl, variants/channels, variants/backward
// Adds the slots of each splat, in the order of its tiles, to its gradient. One invocation = one
// vector of four of one splat, vectors innermost, so that reads are contiguous.
//
// In: `isect_offsets` [N+1] and `splat_ids` by depth rank; `slots` [num_slots,ENTRY_QUADS]. Out: `splat_grads` [N,grad_stride/4] +=
// sums.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> isect_offsets: array<u32>;
@group(0) @binding(2) var<storage, read> splat_ids: array<u32>;
@group(0) @binding(3) var<storage, read> slots: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> splat_grads: array<vec4f>;

@compute @workgroup_size(256)
fn sum_slots(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let invocation = group_index(workgroup) * GROUP_SIZE + lane;
    let rank = invocation / ENTRY_QUADS;
    let quad = invocation % ENTRY_QUADS;
    if rank >= frame.num_splats {
        return;
    }
    let begin = max(isect_offsets[rank], frame.first_slot);
    let end = min(isect_offsets[rank + 1u], frame.first_slot + frame.num_slots);
    if begin >= end {
        return;
    }
    var sum = vec4f(0.0);
    for (var slot = begin; slot < end; slot++) {
        sum += slots[(slot - frame.first_slot) * ENTRY_QUADS + quad];
    }
    let channel_quad = 2u + frame.first_channel / 4u + quad - GEOMETRY_QUADS;
    let column = select(channel_quad, quad, quad < GEOMETRY_QUADS);
    splat_grads[splat_ids[rank] * (frame.grad_stride / 4u) + column] += sum;
}
