// Needs: shared/tile.wgsl, variants/backward
// Sum over the lanes of a tile through workgroup memory alone. Fixed order.

var<workgroup> lane_sums: array<vec4f, ENTRY_QUADS * SUM_ENTRIES * TILE_LANES>;

// Stores the lane's contribution to the group's vector `at`.
fn put_quad(at: u32, lane: u32, value: vec4f) {
    lane_sums[at * TILE_LANES + lane] = value;
}

// A quarter of the sum of vector `at`. The quarters start at different offsets, so that
// neighbouring lanes read different memory banks.
fn take_quarter(at: u32, quarter: u32) -> vec4f {
    let first = at * TILE_LANES;
    let turn = 5u * at + quarter;
    var sum = vec4f(0.0);
    for (var k = 0u; k < TILE_LANES / 4u; k += 4u) {
        sum += lane_sums[first + 4u * ((k + turn) % 16u) + quarter];
        sum += lane_sums[first + 4u * ((k + 1u + turn) % 16u) + quarter];
        sum += lane_sums[first + 4u * ((k + 2u + turn) % 16u) + quarter];
        sum += lane_sums[first + 4u * ((k + 3u + turn) % 16u) + quarter];
    }
    return sum;
}
