// Needs: shared/frame.wgsl, variants/backward
// Writes a tile's sum of an entry to the entry's slot, cleared beforehand. A later pass adds the
// slots of each splat in a fixed order. Slots outside the range of this dispatch are skipped.

@group(0) @binding(7) var<storage, read_write> slots: array<vec4f>;

fn deliver(entry: vec2u, quad: u32, sum: vec4f) {
    let slot = entry.y - frame.first_slot;
    if entry.y >= frame.first_slot && slot < frame.num_slots {
        slots[slot * ENTRY_QUADS + quad] = sum;
    }
}
