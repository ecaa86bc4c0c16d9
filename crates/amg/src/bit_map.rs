//! Maps keyed by the bits of splats.

/// A map for long keys, hashed eight bytes at a time. Seeded randomly in each process, so that no
/// file can be crafted to cause collisions; results must not depend on the order of its entries.
pub(crate) type BitMap<K, V> = std::collections::HashMap<K, V, foldhash::fast::RandomState>;
