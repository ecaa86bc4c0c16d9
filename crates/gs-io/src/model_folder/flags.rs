//! Flags of a training run in reports, with the origin of each.

/// Origin of a flag's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The user.
    Override,
    /// The file `cfg_args`.
    CfgArgs,
    /// The published configuration that matches the network's shape.
    FamilyGuess,
    /// Inferred from the tensors.
    Inferred,
    /// The reference's default.
    Default,
}

/// A flag and its origin.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct FlagReport {
    /// Name as in `cfg_args`.
    pub name: &'static str,
    /// Value as text.
    pub value: String,
    /// Origin of the value.
    pub origin: Origin,
}
