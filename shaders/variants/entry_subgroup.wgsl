// Needs: variants/sum_subgroup.wgsl, a backward pass
// Entry point of a backward pass over tiles, with subgroups.

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) tile: vec3u,
    @builtin(local_invocation_index) lane: u32,
    @builtin(subgroup_id) subgroup: u32,
    @builtin(num_subgroups) subgroups: u32,
    @builtin(subgroup_invocation_id) within: u32,
) {
    subgroup_of_lane = subgroup;
    subgroups_in_tile = subgroups;
    lane_in_subgroup = within;
    backward_tile(tile.xy, lane);
}
