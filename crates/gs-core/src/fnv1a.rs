//! [`Fnv1a`]: fingerprints that are equal on every machine and in every version.

/// FNV-1a, 64 bits (Fowler, Noll and Vo). Not cryptographic.
#[derive(Debug, Clone, Copy)]
pub struct Fnv1a(u64);

impl Default for Fnv1a {
    fn default() -> Self {
        Self(0xCBF2_9CE4_8422_2325)
    }
}

impl Fnv1a {
    /// Continues from the result of [`Fnv1a::finish`].
    pub const fn resume(hash: u64) -> Self {
        Self(hash)
    }

    /// Hashes bytes, one per round, as published.
    pub fn bytes(&mut self, bytes: impl IntoIterator<Item = u8>) {
        for byte in bytes {
            self.word(u64::from(byte));
        }
    }

    /// Hashes 64 bits in one round: faster than their bytes, with a different result, and weaker (the
    /// high bits do not reach the low ones).
    #[inline]
    pub const fn word(&mut self, word: u64) {
        self.0 = (self.0 ^ word).wrapping_mul(0x0100_0000_01B3);
    }

    /// The hash of all input so far.
    #[inline]
    pub const fn finish(self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the authors' test suite.
    #[test]
    fn hashes_equal_published_values() {
        let hash = |text: &str| {
            let mut hash = Fnv1a::default();
            hash.bytes(text.bytes());
            hash.finish()
        };
        assert_eq!(hash(""), 0xCBF2_9CE4_8422_2325);
        assert_eq!(hash("a"), 0xAF63_DC4C_8601_EC8C);
        assert_eq!(hash("foobar"), 0x8594_4171_F739_67E8);
        let mut resumed = Fnv1a::resume(hash("foo"));
        resumed.bytes(*b"bar");
        assert_eq!(resumed.finish(), hash("foobar"), "continued");
    }
}
