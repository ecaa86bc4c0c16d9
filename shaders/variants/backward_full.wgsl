// Needs: variants/channels
// Gradient of an entry in vectors of four: (u, v, A, B), (C, opacity, 0, 0), then the channels.

const GEOMETRY_QUADS: u32 = 2u;
const ENTRY_QUADS: u32 = 2u + QUADS;
// Entries summed over the tile at once.
const SUM_ENTRIES: u32 = 4u / QUADS;
