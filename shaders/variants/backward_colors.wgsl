// Needs: variants/channels
// Gradient of an entry in vectors of four: the channels alone.

const GEOMETRY_QUADS: u32 = 0u;
const ENTRY_QUADS: u32 = QUADS;
// Entries summed over the tile at once.
const SUM_ENTRIES: u32 = 8u / QUADS;
