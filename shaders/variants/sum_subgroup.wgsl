// Needs: shared/tile.wgsl, variants/backward
// Sum over the lanes of a tile: within subgroups by the subgroup operation, across them through
// workgroup memory. Needs subgroups.

// A tile of 64 lanes has at most 16 subgroups, since none is smaller than 4.
const MAX_SUBGROUPS: u32 = 16u;

var<private> subgroup_of_lane: u32;
var<private> lane_in_subgroup: u32;
var<private> subgroups_in_tile: u32;
var<workgroup> subgroup_sums: array<vec4f, ENTRY_QUADS * SUM_ENTRIES * MAX_SUBGROUPS>;

// Stores the lane's contribution to the group's vector `at`. Uniform control flow.
fn put_quad(at: u32, lane: u32, value: vec4f) {
    let sum = subgroupAdd(value);
    if lane_in_subgroup == 0u {
        subgroup_sums[at * MAX_SUBGROUPS + subgroup_of_lane] = sum;
    }
}

// The part of the sum of vector `at` that every fourth subgroup holds.
fn take_quarter(at: u32, quarter: u32) -> vec4f {
    var sum = vec4f(0.0);
    for (var k = quarter; k < subgroups_in_tile; k += 4u) {
        sum += subgroup_sums[at * MAX_SUBGROUPS + k];
    }
    return sum;
}
