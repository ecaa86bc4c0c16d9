//! One level of a hash grid: table index of a lattice point.

/// How lattice points that do not fit a level's table are mapped into it. Two versions of the
/// training library differ on levels whose resolution to the fourth power is a multiple of 2³²;
/// checkpoints do not record which version trained them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IndexRule {
    /// tiny-cuda-nn from 24 June 2025 on: every level that does not fit is hashed.
    Current,
    /// tiny-cuda-nn before that date: hashing depends on a running stride that wraps at 2³², so
    /// the finest levels may use only x and y.
    Older,
}

/// Factors of the spatial hash, one per coordinate x, y, z, t.
pub(crate) const PRIMES: [u32; 4] = [1, 2_654_435_761, 805_459_861, 3_674_653_429];

/// How the coordinates of a lattice point are combined to an index,
/// before reduction modulo the level's size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Addressing {
    /// Exclusive or of `q_d · PRIMES[d]`.
    Hash,
    /// Sum of `q_d · strides[d]`.
    Strides([u32; 4]),
}

/// One resolution of a hash grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Lattice cells per unit of the normalised box: `base · 2^l − 1`.
    pub scale: f32,
    /// Lattice points per axis in the level's layout; cell corners may lie one beyond.
    pub resolution: u32,
    /// First entry within the whole table.
    pub start: usize,
    /// Number of entries, at least 1.
    pub size: u32,
    pub(crate) addressing: Addressing,
}

impl Level {
    pub(crate) fn new(scale: f32, start: usize, size: u32, rule: IndexRule) -> Self {
        let resolution = resolution(scale);
        Self { scale, resolution, start, size, addressing: addressing(resolution, size, rule) }
    }

    /// Cell and position within the cell of a normalised coordinate. The sum is rounded once, as in
    /// training; two roundings, or double precision, change the cell on fine levels.
    #[inline(always)]
    pub fn locate(&self, x: f32) -> (u32, f32) {
        let position = self.scale.mul_add(x, 0.5);
        let cell = position.floor();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "as in the reference: through a signed integer, wrapping below zero, \
                     saturating above"
        )]
        let index = cell as i32 as u32;
        (index, position - cell)
    }

    /// Entry within the level of a lattice point (x, y, z, t). Not clamped:
    /// points beyond the last plane wrap around.
    pub fn index(&self, corner: [u32; 4]) -> u32 {
        let index = (0..4).fold(0, |index, d| self.join(index, self.term(d, corner[d])));
        self.reduce(index)
    }

    /// Contribution of coordinate `d`.
    #[inline(always)]
    pub(crate) fn term(&self, d: usize, q: u32) -> u32 {
        match self.addressing {
            Addressing::Hash => q.wrapping_mul(PRIMES[d]),
            Addressing::Strides(strides) => q.wrapping_mul(strides[d]),
        }
    }

    #[inline(always)]
    pub(crate) fn join(&self, a: u32, b: u32) -> u32 {
        match self.addressing {
            Addressing::Hash => a ^ b,
            Addressing::Strides(_) => a.wrapping_add(b),
        }
    }

    #[inline(always)]
    pub(crate) fn reduce(&self, index: u32) -> u32 {
        if self.size.is_power_of_two() { index & (self.size - 1) } else { index % self.size }
    }
}

/// `⌈scale⌉ + 1`.
pub(crate) fn resolution(scale: f32) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "shapes bound the scale to 2^30; it is not negative"
    )]
    let cells = scale.ceil() as u32;
    cells + 1
}

fn addressing(resolution: u32, size: u32, rule: IndexRule) -> Addressing {
    let mut strides = [0; 4];
    let mut stride = 1_u32;
    match rule {
        IndexRule::Current => {
            if resolution > 255 || u64::from(resolution).pow(4) > u64::from(size) {
                return Addressing::Hash;
            }
            for slot in &mut strides {
                *slot = stride;
                stride = stride.wrapping_mul(resolution);
            }
        }
        IndexRule::Older => {
            for slot in &mut strides {
                if stride > size {
                    break;
                }
                *slot = stride;
                stride = stride.wrapping_mul(resolution);
            }
            if size < stride {
                return Addressing::Hash;
            }
        }
    }
    Addressing::Strides(strides)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_beyond_the_upper_end_wrap() {
        let level = Level::new(15.0, 0, 65_536, IndexRule::Current);
        assert_eq!(level.resolution, 16, "nominal points");
        assert_eq!(level.locate(1.0), (15, 0.5), "the last cell, half way");
        assert_eq!(level.locate(0.0), (0, 0.5), "half-cell offset");
        assert_eq!(level.index([16, 0, 0, 0]), 16, "next row");
        assert_eq!(level.index([0, 0, 0, 16]), 0, "wraps to the start");
    }

    #[test]
    fn sizes_that_are_not_powers_of_two_wrap() {
        let level = Level::new(2.0, 0, 88, IndexRule::Older);
        assert_eq!(level.addressing, Addressing::Strides([1, 3, 9, 27]), "81 points fit 88");
        assert_eq!(level.index([0, 0, 1, 3]), 2, "90 mod 88");
    }

    #[test]
    fn rules_differ_where_the_stride_wraps() {
        let fine = |rule| Level::new(65_535.0, 0, 1 << 16, rule);
        assert_eq!(fine(IndexRule::Current).addressing, Addressing::Hash, "hashed today");
        let older = fine(IndexRule::Older);
        assert_eq!(older.addressing, Addressing::Strides([1, 1 << 16, 0, 0]), "x and y only");
        assert_eq!(older.index([7, 3, 9, 9]), 7, "and y drops out of this size");
    }
}
