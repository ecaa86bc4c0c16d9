// Needs: shared/dispatch.wgsl
// Exclusive prefix sum, in place, level by level. One group = one block of 1024 values. Sums that exceed 32 bits stay at the largest
// value, so that an excessive number of pairs is detected instead of wrapping around.
//
// `scan_blocks` scans each block and leaves its total in `totals`; the caller scans those; `scan_add` adds them back.

struct Scan {
    num_items: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

const SCAN_BLOCK: u32 = 1024u;

@group(0) @binding(0) var<uniform> scan: Scan;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> totals: array<u32>;

var<workgroup> sums: array<u32, 256>;

fn add_saturating(a: u32, b: u32) -> u32 {
    return a + min(b, 0xffffffffu - a);
}

@compute @workgroup_size(256)
fn scan_blocks(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group_index(workgroup);
    let first = block * SCAN_BLOCK + lane * 4u;
    var own: vec4u;
    for (var k = 0u; k < 4u; k++) {
        if first + k < scan.num_items {
            own[k] = values[first + k];
        }
    }
    var running = add_saturating(add_saturating(own.x, own.y), add_saturating(own.z, own.w));
    sums[lane] = running;
    workgroupBarrier();
    for (var reach = 1u; reach < GROUP_SIZE; reach *= 2u) {
        var before = 0u;
        if lane >= reach {
            before = sums[lane - reach];
        }
        // All lanes must read before any lane overwrites, and vice versa.
        workgroupBarrier();
        running = add_saturating(running, before);
        sums[lane] = running;
        workgroupBarrier();
    }
    var prefix = 0u;
    if lane > 0u {
        prefix = sums[lane - 1u];
    }
    for (var k = 0u; k < 4u; k++) {
        if first + k < scan.num_items {
            values[first + k] = prefix;
        }
        prefix = add_saturating(prefix, own[k]);
    }
    if lane == GROUP_SIZE - 1u && block * SCAN_BLOCK < scan.num_items {
        totals[block] = running;
    }
}

@compute @workgroup_size(256)
fn scan_add(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group_index(workgroup);
    let first = block * SCAN_BLOCK + lane * 4u;
    for (var k = 0u; k < 4u; k++) {
        if first + k < scan.num_items {
            values[first + k] = add_saturating(values[first + k], totals[block]);
        }
    }
}
