//! [`Identity`]: relation of an edited splat to the source.

/// Relation of an edited splat to the source splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Identity {
    /// Source splat with this id: all stored fields agree.
    Unchanged(u32),
    /// Source splat with this id: geometry agrees, opacity or colour does not.
    Recoloured(u32),
    /// Source splat, moved, rotated or scaled together with others.
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
    /// Id of the source splat, if it is one.
    pub fn source(self) -> Option<u32> {
        match self {
            Self::Unchanged(source) | Self::Recoloured(source) | Self::Moved { source, .. } => {
                Some(source)
            }
            Self::Edited => None,
        }
    }

    /// Id of the source splat, if it is one in its original place.
    pub fn in_place(self) -> Option<u32> {
        match self {
            Self::Unchanged(source) | Self::Recoloured(source) => Some(source),
            Self::Moved { .. } | Self::Edited => None,
        }
    }
}
