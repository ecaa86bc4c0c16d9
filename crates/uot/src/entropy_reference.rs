//! [`EntropyReference`]: reference measure of the entropy term.

/// Reference measure of the entropy term.
///
/// For uniform marginals the three plans differ only by a global factor (with Λ = λ0+λ1+λ2):
/// `P_entropy = (n·m)^(λ0/Λ) · P_kl` and `P_plogp = e^(−λ0/Λ) · P_entropy`. Correspondences and
/// normalised columns are identical.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum EntropyReference {
    /// `KL(P ‖ a bᵀ)`. The mass is at most 1 and does not depend on how finely the clouds are
    /// sampled.
    #[default]
    Kl,
    /// `Σ (P ln P − P)`. Uniform marginals only.
    Entropy,
    /// `Σ P ln P`. Uniform marginals only.
    PLogP,
}
