// Needs: shared/dispatch.wgsl, train/group_sum.wgsl
// Adds the partial sums of a loss's groups, in a fixed order, to
// the running sum of that loss. One group.
//
// In: `partials`. Out: `losses[slot]` += scale * sum.

struct SumPartials {
    num_partials: u32,
    slot: u32,
    scale: f32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> job: SumPartials;
@group(0) @binding(1) var<storage, read> partials: array<f32>;
@group(0) @binding(2) var<storage, read_write> losses: array<f32>;

@compute @workgroup_size(256)
fn sum_partials(@builtin(local_invocation_index) lane: u32) {
    var sum = 0.0;
    for (var i = lane; i < job.num_partials; i += GROUP_SIZE) {
        sum += partials[i];
    }
    let total = group_sum(lane, sum);
    if lane == 0u {
        losses[job.slot] += job.scale * total;
    }
}
