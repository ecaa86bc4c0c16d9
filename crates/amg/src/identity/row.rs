//! [`Identity`]: what one edited splat is.

/// What one edited splat is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Identity {
    /// Source splat with this id: all stored fields agree.
    Unchanged(u32),
    /// Source splat with this id: geometry agrees, opacity or colour does not.
    Recoloured(u32),
    /// Source splat, moved, turned or scaled together with others.
    Moved {
        /// Its id.
        source: u32,
        /// Which of [`crate::IdentityMap::similarities`].
        group: u32,
    },
    /// No source splat.
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
