//! [`RowKind`]: how one edited splat moves.

/// How one edited splat moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum RowKind {
    /// It is static, at its position in the edit.
    Static = 0,
    /// It is an unchanged source splat: geometry, opacity and colour of that splat at every time,
    /// bit for bit.
    Unchanged = 1,
    /// It is a source splat with other colours or opacity: that splat's geometry bit for bit, the
    /// edit's appearance plus the source's change of appearance.
    Recolored = 2,
    /// Its motion is a weighted blend of the motion of its sources.
    Blended = 3,
    /// The deformation field is evaluated at its own position (baseline "w/o AMG").
    Field = 4,
    /// It is a source splat that the edit moved with others, see [`MovedGroup`](crate::MovedGroup):
    /// that splat's geometry under the group's similarity, the edit's appearance plus the source's
    /// change of appearance.
    Moved = 5,
    /// It is an untouched source splat that is invisible in the edit frame; it inherits the edit of
    /// the surface that it represents at other times, see [`Inherited`](crate::Inherited).
    Descendant = 6,
    /// It is a copy of a short-lived source splat, or next to such a copy: that splat, extended
    /// over the whole clip, under the similarity of its group, with the edit's appearance.
    Copied = 7,
}

impl RowKind {
    /// The kind stored as `code`, if there is one.
    pub fn from_code(code: u8) -> Option<Self> {
        [
            Self::Static,
            Self::Unchanged,
            Self::Recolored,
            Self::Blended,
            Self::Field,
            Self::Moved,
            Self::Descendant,
            Self::Copied,
        ]
        .into_iter()
        .find(|kind| *kind as u8 == code)
    }

    /// Code of this kind in files.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// Whether geometry is copied from one source splat.
    pub fn is_exact(self) -> bool {
        matches!(self, Self::Unchanged | Self::Recolored)
    }
}
