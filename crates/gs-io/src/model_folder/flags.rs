//! Flags of a training run as they are reported, and where each comes from.

/// Where the value of a flag comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The user.
    Override,
    /// The file `cfg_args`.
    CfgArgs,
    /// The published configuration the network's shape belongs to.
    FamilyGuess,
    /// Read off the tensors.
    Inferred,
    /// The reference's default.
    Default,
}

/// A flag and its origin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FlagReport {
    /// Name as in `cfg_args`.
    pub name: &'static str,
    /// Value as text.
    pub value: String,
    /// Where it comes from.
    pub origin: Origin,
}
