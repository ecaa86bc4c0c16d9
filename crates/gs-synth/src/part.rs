//! Labels of splats: [`Part`], [`Bone`], [`Kind`], [`Tag`].

/// Object or body part of a splat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Part {
    /// Far wall and sky.
    Backdrop,
    /// The disc the figure stands on.
    Ground,
    /// Columns behind the figure.
    Column,
    /// Glossy balls.
    Ball,
    /// Stacked crates.
    Crate,
    /// Hips.
    Pelvis,
    /// Upper body.
    Chest,
    /// Neck, head, hair, face.
    Head,
    /// Left upper arm (the figure's left, +x).
    UpperArmL,
    /// Left forearm and hand.
    ForearmL,
    /// Right upper arm.
    UpperArmR,
    /// Right forearm and hand.
    ForearmR,
    /// Left thigh.
    ThighL,
    /// Left lower leg.
    ShinL,
    /// Left shoe.
    FootL,
    /// Right thigh.
    ThighR,
    /// Right lower leg.
    ShinR,
    /// Right shoe.
    FootR,
    /// First of two touching bodies.
    ObjectA,
    /// Second of two touching bodies.
    ObjectB,
    /// A hanging sheet.
    Cloth,
    /// A floater, which belongs to no object.
    Floater,
    /// The object in the right hand.
    Held,
}

impl Part {
    /// The figure, head to shoes.
    pub const FIGURE: [Self; 13] = [
        Self::Pelvis,
        Self::Chest,
        Self::Head,
        Self::UpperArmL,
        Self::ForearmL,
        Self::UpperArmR,
        Self::ForearmR,
        Self::ThighL,
        Self::ShinL,
        Self::FootL,
        Self::ThighR,
        Self::ShinR,
        Self::FootR,
    ];
    /// Everything that never moves.
    pub const SCENERY: [Self; 5] =
        [Self::Backdrop, Self::Ground, Self::Column, Self::Ball, Self::Crate];

    /// The bone that moves the part.
    pub const fn bone(self) -> Bone {
        match self {
            Self::Backdrop
            | Self::Ground
            | Self::Column
            | Self::Ball
            | Self::Crate
            | Self::Floater => Bone::World,
            Self::Pelvis => Bone::Pelvis,
            Self::Chest => Bone::Chest,
            Self::Head => Bone::Head,
            Self::UpperArmL => Bone::UpperArmL,
            Self::ForearmL => Bone::ForearmL,
            Self::UpperArmR => Bone::UpperArmR,
            Self::ForearmR | Self::Held => Bone::ForearmR,
            Self::ThighL => Bone::ThighL,
            Self::ShinL => Bone::ShinL,
            Self::FootL => Bone::FootL,
            Self::ThighR => Bone::ThighR,
            Self::ShinR => Bone::ShinR,
            Self::FootR => Bone::FootR,
            Self::ObjectA => Bone::ObjectA,
            Self::ObjectB => Bone::ObjectB,
            Self::Cloth => Bone::Cloth,
        }
    }
}

/// A rigid element of the skeleton. A parent always comes before its children.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Bone {
    /// Does not move.
    World,
    /// Root of the figure.
    Pelvis,
    /// Attached to the pelvis.
    Chest,
    /// Attached to the chest.
    Head,
    /// Attached to the chest.
    UpperArmL,
    /// Attached to the left upper arm.
    ForearmL,
    /// Attached to the chest.
    UpperArmR,
    /// Attached to the right upper arm.
    ForearmR,
    /// Attached to the pelvis.
    ThighL,
    /// Attached to the left thigh.
    ShinL,
    /// Attached to the left shin.
    FootL,
    /// Attached to the pelvis.
    ThighR,
    /// Attached to the right thigh.
    ShinR,
    /// Attached to the right shin.
    FootR,
    /// First of two touching bodies.
    ObjectA,
    /// Second of two touching bodies.
    ObjectB,
    /// The sheet; not rigid.
    Cloth,
}

impl Bone {
    /// All bones, in the order of their numbers.
    pub const ALL: [Self; 17] = [
        Self::World,
        Self::Pelvis,
        Self::Chest,
        Self::Head,
        Self::UpperArmL,
        Self::ForearmL,
        Self::UpperArmR,
        Self::ForearmR,
        Self::ThighL,
        Self::ShinL,
        Self::FootL,
        Self::ThighR,
        Self::ShinR,
        Self::FootR,
        Self::ObjectA,
        Self::ObjectB,
        Self::Cloth,
    ];

    /// Parent of this bone.
    #[must_use]
    pub const fn parent(self) -> Self {
        match self {
            Self::World | Self::Pelvis | Self::ObjectA | Self::ObjectB | Self::Cloth => Self::World,
            Self::Chest | Self::ThighL | Self::ThighR => Self::Pelvis,
            Self::Head | Self::UpperArmL | Self::UpperArmR => Self::Chest,
            Self::ForearmL => Self::UpperArmL,
            Self::ForearmR => Self::UpperArmR,
            Self::ShinL => Self::ThighL,
            Self::FootL => Self::ShinL,
            Self::ShinR => Self::ThighR,
            Self::FootR => Self::ShinR,
        }
    }
}

/// Kind of a reconstructed splat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Kind {
    /// Flat disc on a surface.
    Surface,
    /// Blob inside a body, hidden unless parts move apart.
    Interior,
    /// In empty space, with independent motion.
    Floater,
    /// On a surface, but with wrong motion, as after a tracking failure.
    Outlier,
}

/// Effect of the last edit that affected a splat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[non_exhaustive]
pub enum Tag {
    /// Bit-identical to its source splat.
    Unchanged,
    /// Geometry bit-identical to its source splat, other colour.
    Recoloured,
    /// Slightly moved, rotated and scaled.
    Drifted,
    /// Scaled, rotated or moved together with its part.
    Transformed,
    /// Offset along its normal, or a clone of such a splat.
    Clothing,
    /// One half of a splat that was split.
    SplitChild,
    /// On a box that replaced a body part.
    Box,
    /// On the hat.
    Hat,
    /// On a horn.
    Horns,
    /// On a wing.
    Wings,
    /// On the block.
    Block,
    /// On the stick.
    Stick,
    /// On the halo.
    Halo,
}
