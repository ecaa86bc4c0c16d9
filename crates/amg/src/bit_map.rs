//! Maps by the bits of splats.

/// A map whose keys are long: its hash takes eight bytes at a time. Seeded anew in each process, so
/// that no file can be made to collide; nothing may depend on the order of its entries.
pub(crate) type BitMap<K, V> = std::collections::HashMap<K, V, foldhash::fast::RandomState>;
