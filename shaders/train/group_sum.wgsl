// Needs: shared/dispatch.wgsl
// Sum over the lanes of a group, in a fixed order.

var<workgroup> lane_values: array<f32, GROUP_SIZE>;

// Uniform control flow; only lane 0 gets the sum.
fn group_sum(lane: u32, value: f32) -> f32 {
    lane_values[lane] = value;
    for (var reach = GROUP_SIZE / 2u; reach > 0u; reach /= 2u) {
        workgroupBarrier();
        if lane < reach {
            lane_values[lane] += lane_values[lane + reach];
        }
    }
    return lane_values[0];
}
