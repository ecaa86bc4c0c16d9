//! [`Vector`]: a register with operators, so that the maths of one splat also works for many splats
//! at once; [`Quad`]: the memory from which registers are loaded and to which they are stored.

use crate::lanes::Lane;
use gs_core::Ring;
use pulp::Simd;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Splats staged side by side. A whole number of registers for every instruction set.
pub(crate) const GROUP: usize = 16;

/// Four values of every splat of a group, splat by splat. Copied as one block, and transposed into
/// registers of one value each by shuffles; a splat has the same lane in all of them.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Quad<F>(pub [[F; 4]; GROUP]);

impl<F: Lane> Quad<F> {
    pub(crate) fn zero() -> Self {
        Self([[F::zero(); 4]; GROUP])
    }

    /// The four values of the splats of register `k`.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, s: S, k: usize) -> [Vector<S, F>; 4] {
        let registers = F::vectors::<S>(self.0.as_flattened());
        let rows =
            [registers[4 * k], registers[4 * k + 1], registers[4 * k + 2], registers[4 * k + 3]];
        let [a, b, c, d] = F::vcolumns(s, rows);
        [
            Vector { s, lanes: a },
            Vector { s, lanes: b },
            Vector { s, lanes: c },
            Vector { s, lanes: d },
        ]
    }

    /// Overwrites the values of the splats of register `k`.
    #[inline(always)]
    pub(crate) fn store<S: Simd>(&mut self, s: S, k: usize, [a, b, c, d]: [Vector<S, F>; 4]) {
        let rows = F::vrows(s, [a.lanes, b.lanes, c.lanes, d.lanes]);
        F::vectors_mut::<S>(self.0.as_flattened_mut())[4 * k..4 * k + 4].copy_from_slice(&rows);
    }
}

/// Every value in all lanes of a register.
#[inline(always)]
pub(crate) fn splat<S: Simd, F: Lane, const N: usize>(s: S, values: [F; N]) -> [Vector<S, F>; N] {
    let mut out = [Vector::splat(s, F::zero()); N];
    for (out, value) in out.iter_mut().zip(values) {
        *out = Vector::splat(s, value);
    }
    out
}

/// Registers that hold one value of every splat of a group.
#[inline(always)]
pub(crate) const fn registers<S: Simd, F: Lane>() -> usize {
    GROUP * size_of::<F>() / size_of::<F::Vector<S>>()
}

/// A register with operators, one splat per lane.
#[derive(Clone, Copy)]
pub(crate) struct Vector<S: Simd, F: Lane> {
    s: S,
    lanes: F::Vector<S>,
}

/// A boolean per lane.
#[derive(Clone, Copy)]
pub(crate) struct LaneMask<S: Simd, F: Lane> {
    s: S,
    lanes: F::Mask<S>,
}

impl<S: Simd, F: Lane> LaneMask<S, F> {
    #[inline(always)]
    pub(crate) fn and(self, other: Self) -> Self {
        Self { lanes: F::vand(self.s, self.lanes, other.lanes), ..self }
    }

    #[inline(always)]
    pub(crate) fn select(self, yes: Vector<S, F>, no: Vector<S, F>) -> Vector<S, F> {
        Vector { lanes: F::vselect(self.s, self.lanes, yes.lanes, no.lanes), ..yes }
    }

    /// The values where true, zeros elsewhere.
    #[inline(always)]
    pub(crate) fn select_all<const N: usize>(
        self,
        mut values: [Vector<S, F>; N],
    ) -> [Vector<S, F>; N] {
        for value in &mut values {
            *value = self.select(*value, value.like(0.0));
        }
        values
    }
}

impl<S: Simd, F: Lane> Vector<S, F> {
    #[inline(always)]
    pub(crate) fn splat(s: S, x: F) -> Self {
        Self { s, lanes: F::vsplat(s, x) }
    }

    /// `self·b + c`.
    #[inline(always)]
    pub(crate) fn mul_add(self, b: Self, c: Self) -> Self {
        Self { lanes: F::vfma(self.s, self.lanes, b.lanes, c.lanes), ..self }
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self { lanes: F::vsqrt(self.s, self.lanes), ..self }
    }

    #[inline(always)]
    pub(crate) fn exp(self) -> Self {
        Self { lanes: F::vexp(self.s, self.lanes), ..self }
    }

    /// `1 / (1 + e^{−x})`.
    #[inline(always)]
    pub(crate) fn sigmoid(self) -> Self {
        let one = self.like(1.0);
        one / (one + (-self).exp())
    }

    /// `other` where either is NaN.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self { lanes: F::vmax(self.s, self.lanes, other.lanes), ..self }
    }

    /// `other` where either is NaN.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self { lanes: F::vmin(self.s, self.lanes, other.lanes), ..self }
    }

    /// False for NaN.
    #[inline(always)]
    pub(crate) fn less(self, other: Self) -> LaneMask<S, F> {
        LaneMask { s: self.s, lanes: F::vlt(self.s, self.lanes, other.lanes) }
    }

    /// Whether the value is finite in single precision.
    #[inline(always)]
    pub(crate) fn is_finite(self) -> LaneMask<S, F> {
        let limit = self.like(f32::MAX);
        LaneMask { s: self.s, lanes: F::vle(self.s, F::vabs(self.s, self.lanes), limit.lanes) }
    }
}

/// Whether all values are finite in single precision.
#[inline(always)]
pub(crate) fn all_finite<S: Simd, F: Lane, const N: usize>(
    values: [Vector<S, F>; N],
) -> LaneMask<S, F> {
    let mut all = values[0].is_finite();
    for value in &values[1..] {
        all = all.and(value.is_finite());
    }
    all
}

impl<S: Simd, F: Lane> Ring for Vector<S, F> {
    #[inline(always)]
    fn like(self, constant: f32) -> Self {
        Self::splat(self.s, F::of(constant))
    }
}

impl<S: Simd, F: Lane> Add for Vector<S, F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { lanes: F::vadd(self.s, self.lanes, other.lanes), ..self }
    }
}

impl<S: Simd, F: Lane> Sub for Vector<S, F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { lanes: F::vsub(self.s, self.lanes, other.lanes), ..self }
    }
}

impl<S: Simd, F: Lane> Mul for Vector<S, F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { lanes: F::vmul(self.s, self.lanes, other.lanes), ..self }
    }
}

impl<S: Simd, F: Lane> Div for Vector<S, F> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self { lanes: F::vdiv(self.s, self.lanes, other.lanes), ..self }
    }
}

impl<S: Simd, F: Lane> Neg for Vector<S, F> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // Flips the sign instead of subtracting from 0, so that 0 becomes −0 as for scalars.
        Self { lanes: F::vneg(self.s, self.lanes), ..self }
    }
}
