//! [`Selector`]: a selection as an expression tree.

/// A scalar property of a splat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SplatProperty {
    /// Opacity, 0 to 1.
    Opacity,
    /// Largest standard deviation, world units.
    Size,
    /// First coordinate of the centre, world units.
    X,
    /// Second coordinate of the centre, world units.
    Y,
    /// Third coordinate of the centre, world units.
    Z,
    /// Red of the base colour, 0 to 1.
    Red,
    /// Green of the base colour, 0 to 1.
    Green,
    /// Blue of the base colour, 0 to 1.
    Blue,
    /// HSV saturation of the base colour, 0 to 1.
    Saturation,
    /// HSV value of the base colour, its largest channel, 0 to 1.
    Brightness,
}

impl SplatProperty {
    /// All properties with their names in the language.
    pub const ALL: [(&'static str, Self); 10] = [
        ("opacity", Self::Opacity),
        ("size", Self::Size),
        ("x", Self::X),
        ("y", Self::Y),
        ("z", Self::Z),
        ("red", Self::Red),
        ("green", Self::Green),
        ("blue", Self::Blue),
        ("saturation", Self::Saturation),
        ("brightness", Self::Brightness),
    ];
}

/// An interval; missing ends are infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower end, and whether it belongs to the interval.
    pub low: Option<(f64, bool)>,
    /// Upper end, and whether it belongs to the interval.
    pub high: Option<(f64, bool)>,
}

impl Bounds {
    /// Whether `value` is inside; false for NaN.
    pub fn contain(&self, value: f64) -> bool {
        let above = self.low.is_none_or(|(low, closed)| value > low || (closed && value == low));
        let below =
            self.high.is_none_or(|(high, closed)| value < high || (closed && value == high));
        above && below && !value.is_nan()
    }
}

/// A selection of splats. Lengths are world units in the frame of the file; colours are base
/// colours, `½ + C₀·dc` clamped to 0 to 1. `docs/EDITING.md` has the language.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Selector {
    /// Every splat.
    All,
    /// Centres inside an axis-aligned box, ends included.
    Box {
        /// Lower corner.
        min: [f64; 3],
        /// Upper corner.
        max: [f64; 3],
    },
    /// Centres within `radius` of `center`.
    Sphere {
        /// Centre.
        center: [f64; 3],
        /// Radius, world units, at least 0.
        radius: f64,
    },
    /// Centres on the side of a plane to which its normal points: `n·x ≥ offset`, `|n| = 1`.
    Plane {
        /// Unit normal.
        normal: [f64; 3],
        /// Distance of the plane from the origin along the normal.
        offset: f64,
    },
    /// A property inside an interval.
    Range(SplatProperty, Bounds),
    /// Base colours within a Euclidean distance in RGB.
    Color {
        /// Colour, RGB, 0 to 1.
        rgb: [f64; 3],
        /// Maximum distance in RGB, 0 to √3.
        tolerance: f64,
    },
    /// Hues from `from` to `to` in increasing direction, degrees 0 to 360, across 360 if
    /// `from > to`. Greys have no hue and are not selected.
    Hue {
        /// First hue.
        from: f64,
        /// Last hue.
        to: f64,
    },
    /// Splats in masks drawn in pictures ([`crate::lift_masks`]).
    Mask(String),
    /// Splats of the scene that move.
    Moving,
    /// Splats of the part with this number, from 1: parts move rigidly and are sorted by size.
    Part(u32),
    /// Splats connected to the one nearest to a point; splats whose centres are at most `gap` apart
    /// are linked.
    Connected {
        /// The point.
        point: [f64; 3],
        /// Maximum gap, world units; default: three times the median distance of nearest
        /// neighbours.
        gap: Option<f64>,
        /// Only splats of this selection are linked; default: all.
        of: Option<Box<Self>>,
    },
    /// Rows of the input listed in a file, from 0.
    Ids(String),
    /// Splats outside a selection at most this distance from one inside it.
    Near(f64, Box<Self>),
    /// A selection and all splats at most this distance from it.
    Grow(f64, Box<Self>),
    /// A selection without its splats at most this distance from one outside it.
    Shrink(f64, Box<Self>),
    /// Splats that are not in a selection.
    Not(Box<Self>),
    /// Intersection of two or more.
    And(Vec<Self>),
    /// Union of two or more.
    Or(Vec<Self>),
}

impl Selector {
    /// Calls `each` for this selector and all below it.
    pub(crate) fn visit(&self, each: &mut impl FnMut(&Self)) {
        each(self);
        match self {
            Self::Connected { of: Some(inner), .. }
            | Self::Near(_, inner)
            | Self::Grow(_, inner)
            | Self::Shrink(_, inner)
            | Self::Not(inner) => inner.visit(each),
            Self::And(terms) | Self::Or(terms) => {
                for term in terms {
                    term.visit(each);
                }
            }
            _ => {}
        }
    }
}
