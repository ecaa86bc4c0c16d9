//! What a splat is: [`Part`], [`Bone`], [`Kind`], [`Tag`].

/// What a splat belongs to.
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
    /// Belongs to nothing.
    Floater,
    /// What the right hand holds.
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

    /// The bone that carries the part.
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

/// What moves. A parent always comes before its children.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Bone {
    /// Does not move.
    World,
    /// Root of the figure.
    Pelvis,
    /// Carried by the pelvis.
    Chest,
    /// Carried by the chest.
    Head,
    /// Carried by the chest.
    UpperArmL,
    /// Carried by the left upper arm.
    ForearmL,
    /// Carried by the chest.
    UpperArmR,
    /// Carried by the right upper arm.
    ForearmR,
    /// Carried by the pelvis.
    ThighL,
    /// Carried by the left thigh.
    ShinL,
    /// Carried by the left shin.
    FootL,
    /// Carried by the pelvis.
    ThighR,
    /// Carried by the right thigh.
    ShinR,
    /// Carried by the right shin.
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

    /// The bone that carries this one.
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

/// How a splat of a reconstruction came to be where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Kind {
    /// Flat disc on a surface.
    Surface,
    /// Blob inside a body, hidden until something moves.
    Interior,
    /// In the air, with a motion of its own that no surface has.
    Floater,
    /// On a surface, but the reconstruction lost track of it: its motion is wrong.
    Outlier,
}

/// What the last edit that touched a splat did to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Tag {
    /// Bit-identical to its source splat.
    Unchanged,
    /// Geometry bit-identical to its source splat, other colour.
    Recoloured,
    /// Moved, turned and scaled a little.
    Drifted,
    /// Scaled, turned or moved with all of its part.
    Placed,
    /// Offset along its normal, or a clone of one that is.
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
