// Needs: nothing
// Uniforms of one digit of the radix sort.

struct Sort {
    shift: u32,
    num_blocks: u32,
    // The number of items is counts[count_index], at most
    // max_items; it is known only on the device.
    count_index: u32,
    max_items: u32,
    // 1: the values are the positions themselves; no values are read.
    iota: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

const SORT_BLOCK: u32 = 2048u;
const RADIX: u32 = 256u;
