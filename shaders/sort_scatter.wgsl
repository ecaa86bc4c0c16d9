// Needs: shared/dispatch.wgsl, shared/sort.wgsl
// Moves keys and values to their positions by one digit, stably. One
// group = one block of 2048 keys, 256 at a time.
//
// Among the 256, a key's rank is the number of earlier lanes with its digit:
// each lane sets its bit in the digit's mask and counts the lower bits. The
// result does not depend on the order of the atomics.

@group(0) @binding(0) var<uniform> sort: Sort;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read> values_in: array<u32>;
@group(0) @binding(4) var<storage, read> digit_offsets: array<u32>;
@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;

const MASK_WORDS: u32 = 8u;

// Word-major, so that neighbouring digits are in neighbouring memory banks.
var<workgroup> masks: array<atomic<u32>, 2048>;
var<workgroup> places: array<u32, 256>;

@compute @workgroup_size(256)
fn sort_scatter(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group_index(workgroup);
    let num_items = min(counts[sort.count_index], sort.max_items);
    if block * SORT_BLOCK >= num_items {
        return;
    }
    places[lane] = digit_offsets[lane * sort.num_blocks + block];
    for (var word = 0u; word < MASK_WORDS; word++) {
        atomicStore(&masks[word * RADIX + lane], 0u);
    }
    workgroupBarrier();
    for (var round = 0u; round < SORT_BLOCK / GROUP_SIZE; round++) {
        let i = block * SORT_BLOCK + round * GROUP_SIZE + lane;
        let present = i < num_items;
        var key = 0u;
        var value = i;
        var digit = 0u;
        if present {
            key = keys_in[i];
            digit = (key >> sort.shift) % RADIX;
            if sort.iota == 0u {
                value = values_in[i];
            }
            atomicOr(&masks[(lane / 32u) * RADIX + digit], 1u << (lane % 32u));
        }
        workgroupBarrier();
        if present {
            var place = places[digit];
            for (var word = 0u; word < lane / 32u; word++) {
                place += countOneBits(atomicLoad(&masks[word * RADIX + digit]));
            }
            let below = (1u << (lane % 32u)) - 1u;
            place += countOneBits(atomicLoad(&masks[(lane / 32u) * RADIX + digit]) & below);
            keys_out[place] = key;
            values_out[place] = value;
        }
        // The masks must be complete and read before they are counted and cleared.
        workgroupBarrier();
        var count = 0u;
        for (var word = 0u; word < MASK_WORDS; word++) {
            count += countOneBits(atomicLoad(&masks[word * RADIX + lane]));
            atomicStore(&masks[word * RADIX + lane], 0u);
        }
        places[lane] += count;
        workgroupBarrier();
    }
}
