//! [`Identity`]: relation of an edited splat to the source.

/// Relation of an edited splat to the source splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Identity {
    /// The source splat with this id: all stored values agree.
    Unchanged(u32),
    /// The source splat with this id: geometry agrees, opacity or colour differs.
    Recolored(u32),
    /// A source splat that the edit moved, rotated or scaled together with others.
    Moved {
        /// Id of the source splat.
        source: u32,
        /// Index into [`crate::IdentityMap::similarities`].
        group: u32,
    },
    /// Not a source splat.
    Edited,
}

impl Identity {
    /// Id of the source splat; `None` if the edited splat is not one.
    pub fn source(self) -> Option<u32> {
        match self {
            Self::Unchanged(source) | Self::Recolored(source) | Self::Moved { source, .. } => {
                Some(source)
            }
            Self::Edited => None,
        }
    }

    /// Id of the source splat at its original position; `None` if the edited splat was moved or is
    /// not a source splat.
    pub fn in_place(self) -> Option<u32> {
        match self {
            Self::Unchanged(source) | Self::Recolored(source) => Some(source),
            Self::Moved { .. } | Self::Edited => None,
        }
    }
}
