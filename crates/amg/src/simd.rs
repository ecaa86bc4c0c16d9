//! Loops compiled for the best instruction set of the machine, chosen at run time.
#![expect(
    clippy::inline_always,
    reason = "vectorised bodies must be compiled inside the dispatched caller"
)]

/// Runs `body` compiled for the best instruction set of this machine. Mark the closure `#[inline(always)]`, and every function it
/// calls that should be vectorised too. Nothing in such bodies may depend on how sums are grouped: results are the same
/// everywhere.
pub(crate) fn dispatch<R>(body: impl FnMut() -> R) -> R {
    struct Body<F>(F);
    impl<R, F: FnMut() -> R> pulp::WithSimd for Body<F> {
        type Output = R;
        #[inline(always)]
        fn with_simd<S: pulp::Simd>(mut self, _: S) -> R {
            (self.0)()
        }
    }
    pulp::Arch::new().dispatch(Body(body))
}
