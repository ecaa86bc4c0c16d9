//! [`Class`]: effect of the edit on a splat.

use amg::{Binding, RowKind};

/// Effect of the edit on a splat of the source or of the edited scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    Unchanged,
    Recoloured,
    Moved,
    Follows,
    Stays,
    Field,
    Inherits,
    Removed,
}

impl Class {
    /// All classes, in the order of the legend.
    pub(crate) const ALL: [Self; 8] = [
        Self::Unchanged,
        Self::Recoloured,
        Self::Moved,
        Self::Follows,
        Self::Stays,
        Self::Field,
        Self::Inherits,
        Self::Removed,
    ];

    /// The class of an edited row.
    pub(crate) fn of(kind: RowKind) -> Self {
        match kind {
            RowKind::Unchanged => Self::Unchanged,
            RowKind::Recolored => Self::Recoloured,
            RowKind::Moved | RowKind::Copied => Self::Moved,
            RowKind::Blended => Self::Follows,
            RowKind::Static => Self::Stays,
            RowKind::Field => Self::Field,
            RowKind::Descendant => Self::Inherits,
        }
    }

    /// The classes of the source's splats: that of the edited row which is the splat, else removed.
    pub(crate) fn of_source(binding: &Binding) -> Vec<Self> {
        let mut classes = vec![Self::Removed; binding.num_sources()];
        for (row, &kind) in binding.kinds().iter().enumerate() {
            let is_source = kind.is_exact() || matches!(kind, RowKind::Moved | RowKind::Descendant);
            if let Some(&source) = binding.row(row).0.first().filter(|_| is_source) {
                classes[source as usize] = Self::of(kind);
            }
        }
        classes
    }

    /// Label in legends.
    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Unchanged => "unchanged",
            Self::Recoloured => "recoloured",
            Self::Moved => "moved, rotated or scaled",
            Self::Follows => "edited or new, follows source splats",
            Self::Stays => "edited or new, does not move",
            Self::Field => "moved by the deformation field",
            Self::Inherits => "inherits the edit of its surface",
            Self::Removed => "removed",
        }
    }

    /// Index in the palette.
    #[expect(clippy::cast_possible_truncation, reason = "eight classes")]
    pub(super) fn entry(self) -> u8 {
        Self::ALL.iter().position(|class| *class == self).unwrap_or(0) as u8
    }
}
