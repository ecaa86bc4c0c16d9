// Needs: a backward pass
// Entry point of a backward pass over tiles, without subgroups.

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) lane: u32) {
    backward_tile(tile.xy, lane);
}
