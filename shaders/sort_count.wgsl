// Needs: shared/dispatch.wgsl, shared/sort.wgsl
// Histogram of one digit. One group = one block of 2048 keys. Out: `digit_counts` [256, blocks].

@group(0) @binding(0) var<uniform> sort: Sort;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read_write> digit_counts: array<u32>;

var<workgroup> histogram: array<atomic<u32>, 256>;

@compute @workgroup_size(256)
fn sort_count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group_index(workgroup);
    let num_items = min(counts[sort.count_index], sort.max_items);
    atomicStore(&histogram[lane], 0u);
    workgroupBarrier();
    for (var round = 0u; round < SORT_BLOCK / GROUP_SIZE; round++) {
        let i = block * SORT_BLOCK + round * GROUP_SIZE + lane;
        if i < num_items {
            atomicAdd(&histogram[(keys[i] >> sort.shift) % RADIX], 1u);
        }
    }
    workgroupBarrier();
    if block < sort.num_blocks {
        digit_counts[lane * sort.num_blocks + block] = atomicLoad(&histogram[lane]);
    }
}
