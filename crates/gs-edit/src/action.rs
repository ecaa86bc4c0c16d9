//! [`Action`]: a change of the selected splats, and its arguments as text.

use crate::error::{EditError, SyntaxError};
use crate::lexer::{Lexer, Token};

/// Fixed point of a rotation or scaling.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Pivot {
    /// Mean of the selected centres.
    Center,
    /// A point, world units.
    Point([f64; 3]),
}

/// Pose of a graft in the world frame of the input. It is scaled, rotated and moved, in this order,
/// about the origin of its file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GraftPose {
    /// Translation, world units.
    pub translation: [f64; 3],
    /// Angles in degrees, as in [`Action::Rotate`].
    pub degrees: [f64; 3],
    /// Scale factor, above 0.
    pub scale: f64,
}

impl GraftPose {
    /// The identity.
    pub const IDENTITY: Self = Self { translation: [0.0; 3], degrees: [0.0; 3], scale: 1.0 };
}

/// A change of the selected splats. Lengths are world units, angles degrees, colours 0 to 1.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Action {
    /// Removes the selected splats.
    Delete,
    /// Removes all other splats.
    Keep,
    /// Appends copies of the selected splats, which become the selection.
    Duplicate,
    /// Moves by a vector, world units.
    Translate([f64; 3]),
    /// Rotates about x, then y, then z, fixed world axes, right-handed; SH are rotated as well.
    Rotate {
        /// Angles, degrees.
        degrees: [f64; 3],
        /// Fixed point.
        pivot: Pivot,
    },
    /// Scales uniformly: centres about the pivot, and standard deviations.
    Scale {
        /// Factor, above 0.
        factor: f64,
        /// Fixed point.
        pivot: Pivot,
    },
    /// Multiplies opacities, up to [`crate::MAX_OPACITY`].
    Opacity(f64),
    /// [`crate::ColorMap::color`] with the mean luma of the selection.
    Color {
        /// New colour.
        rgb: [f64; 3],
        /// Share of the map, 0 to 1.
        strength: f64,
    },
    /// [`crate::ColorMap::hue`].
    Hue(f64),
    /// [`crate::ColorMap::saturation`].
    Saturation(f64),
    /// [`crate::ColorMap::brightness`].
    Brightness(f64),
    /// [`crate::ColorMap::levels`].
    Levels {
        /// Level that becomes 0.
        black: f64,
        /// Level that becomes 1.
        white: f64,
    },
    /// [`crate::ColorMap::tint`].
    Tint {
        /// Colour of the light.
        rgb: [f64; 3],
        /// Share of the map, 0 to 1.
        strength: f64,
    },
    /// Transforms base colours to the distribution of a picture's colours, by optimal transport.
    MatchColors {
        /// Name of the picture.
        image: String,
        /// Whether the whole distribution is matched instead of mean and covariance.
        sliced: bool,
    },
    /// Colours and patterns of a picture ([`crate::StyleTransfer`]), after
    /// [`Action::MatchColors`] with `sliced`.
    Style {
        /// Name of the picture.
        image: String,
        /// Share of the change, 0 to 1.
        strength: f64,
    },
    /// Appends the splats of a file, which become the selection.
    Graft {
        /// Name of the file.
        file: String,
        /// Pose of its splats in the world of the input.
        pose: GraftPose,
    },
}

/// An option of the command line, for help texts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ActionOption {
    /// Name without dashes.
    pub name: &'static str,
    /// Placeholder of its argument; `None` if it takes none.
    pub argument: Option<&'static str>,
    /// One line of help.
    pub help: &'static str,
}

/// Command-line options for all actions, in the order of the documentation. `sliced`
/// modifies the preceding `match-colors`.
pub const ACTION_OPTIONS: [ActionOption; 17] = [
    option("delete", None, "Remove the selected splats"),
    option("keep", None, "Remove all others"),
    option("duplicate", None, "Append copies, which become the selection"),
    option("translate", Some("X,Y,Z"), "Move, world units"),
    option(
        "rotate",
        Some("X,Y,Z[@PIVOT]"),
        "Rotate about x, then y, then z, degrees; PIVOT is x,y,z or `center`, the default",
    ),
    option("scale", Some("S[@PIVOT]"), "Scale by a factor"),
    option("opacity", Some("FACTOR"), "Multiply opacities"),
    option("color", Some("#RGB[:STRENGTH]"), "Recolour, keeping the shading"),
    option("hue", Some("DEGREES"), "Rotate hues: 120 maps red to green"),
    option(
        "saturation",
        Some("FACTOR"),
        "Scale the distance from grey: 0 gives grey, 1 has no effect",
    ),
    option("brightness", Some("AMOUNT"), "Add to every channel, -1 to 1"),
    option("levels", Some("BLACK,WHITE"), "Stretch BLACK to 0 and WHITE to 1"),
    option("tint", Some("#RGB[:STRENGTH]"), "Multiply by a colour, like coloured light"),
    option(
        "match-colors",
        Some("IMAGE"),
        "Match the mean and covariance of a picture's colours, by optimal transport",
    ),
    option("sliced", None, "After --match-colors: match the whole distribution of colours"),
    option(
        "style",
        Some("IMAGE[:STRENGTH]"),
        "Match the colours and small patterns of a picture, such as brush strokes",
    ),
    option(
        "graft",
        Some("FILE[@POSE]"),
        "Append the splats of a file, which become the selection; POSE is x,y,z[,rx,ry,rz[,scale]]",
    ),
];

const fn option(
    name: &'static str,
    argument: Option<&'static str>,
    help: &'static str,
) -> ActionOption {
    ActionOption { name, argument, help }
}

/// Largest magnitude of colour parameters. Larger values could overflow.
const MAX_COLOR: f64 = 1e3;

impl Action {
    /// Name of the option, without dashes.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Delete => "delete",
            Self::Keep => "keep",
            Self::Duplicate => "duplicate",
            Self::Translate(_) => "translate",
            Self::Rotate { .. } => "rotate",
            Self::Scale { .. } => "scale",
            Self::Opacity(_) => "opacity",
            Self::Color { .. } => "color",
            Self::Hue(_) => "hue",
            Self::Saturation(_) => "saturation",
            Self::Brightness(_) => "brightness",
            Self::Levels { .. } => "levels",
            Self::Tint { .. } => "tint",
            Self::MatchColors { .. } => "match-colors",
            Self::Style { .. } => "style",
            Self::Graft { .. } => "graft",
        }
    }

    /// Parses the option `name` (without dashes) with the argument `text`, empty for options
    /// without one.
    ///
    /// # Errors
    /// [`EditError::UnknownAction`]; [`EditError::Syntax`], with the column, for a malformed
    /// argument.
    pub fn parse(name: &str, text: &str) -> Result<Self, EditError> {
        let syntax = |source| EditError::Syntax { option: name.to_owned(), source };
        let mut argument = Argument { lexer: Lexer::new(text).map_err(syntax)? };
        let action = match name {
            "delete" => Ok(Self::Delete),
            "keep" => Ok(Self::Keep),
            "duplicate" => Ok(Self::Duplicate),
            "translate" => argument.vector().map(Self::Translate),
            "rotate" => argument.rotation(),
            "scale" => argument.scaling(),
            "opacity" => argument
                .number_in(f64::MIN_POSITIVE, 1e6, "a factor above 0, at most 1000000")
                .map(Self::Opacity),
            "color" => argument.tone().map(|(rgb, strength)| Self::Color { rgb, strength }),
            "tint" => argument.tone().map(|(rgb, strength)| Self::Tint { rgb, strength }),
            "hue" => argument.number_in(-1e6, 1e6, "degrees").map(Self::Hue),
            "saturation" => {
                argument.number_in(0.0, MAX_COLOR, "a factor of 0 or more").map(Self::Saturation)
            }
            "brightness" => argument.number_in(-1.0, 1.0, "-1 to 1").map(Self::Brightness),
            "levels" => argument.levels(),
            "match-colors" => {
                return nonempty(text)
                    .map_err(syntax)
                    .map(|image| Self::MatchColors { image, sliced: false });
            }
            "style" => return style(text).map_err(syntax),
            "graft" => return graft(text).map_err(syntax),
            _ => return Err(EditError::UnknownAction(name.to_owned())),
        };
        let action = action.map_err(syntax)?;
        argument.end().map_err(syntax)?;
        Ok(action)
    }
}

fn nonempty(text: &str) -> Result<String, SyntaxError> {
    if text.is_empty() {
        return Err(SyntaxError::new(text, 0, "expected a file"));
    }
    Ok(text.to_owned())
}

/// `FILE` or `FILE:STRENGTH`; a `:` without a following number is part of the name.
fn style(text: &str) -> Result<Action, SyntaxError> {
    let numeric = |rest: &str| rest.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    let Some(at) = text.rfind(':').filter(|at| {
        let rest = text[at + 1..].trim();
        numeric(rest) && !rest.contains(['/', '\\'])
    }) else {
        return Ok(Action::Style { image: nonempty(text)?, strength: 1.0 });
    };
    let image = nonempty(&text[..at])?;
    let offset = text[..=at].chars().count();
    let in_whole =
        |error: SyntaxError| SyntaxError::new(text, offset + error.column - 1, error.what);
    let mut argument = Argument { lexer: Lexer::new(&text[at + 1..]).map_err(in_whole)? };
    let strength = argument.number_in(0.0, 1.0, "a strength, 0 to 1").map_err(in_whole)?;
    argument.end().map_err(in_whole)?;
    Ok(Action::Style { image, strength })
}

/// `FILE` or `FILE@numbers`; an `@` without a following number is part of the name.
fn graft(text: &str) -> Result<Action, SyntaxError> {
    let pose_at = text.rfind('@').filter(|at| {
        text[at + 1..].trim_start().starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
    });
    let Some(at) = pose_at else {
        return Ok(Action::Graft { file: nonempty(text)?, pose: GraftPose::IDENTITY });
    };
    let file = nonempty(&text[..at])?;
    let offset = text[..=at].chars().count();
    // Columns are those of the whole text.
    let in_whole =
        |error: SyntaxError| SyntaxError::new(text, offset + error.column - 1, error.what);
    let mut argument = Argument { lexer: Lexer::new(&text[at + 1..]).map_err(in_whole)? };
    let pose = argument.pose().and_then(|pose| argument.end().map(|()| pose)).map_err(in_whole)?;
    Ok(Action::Graft { file, pose })
}

struct Argument<'a> {
    lexer: Lexer<'a>,
}

impl Argument<'_> {
    fn number(&mut self) -> Result<(f64, usize), SyntaxError> {
        match self.lexer.next()? {
            (Token::Number(value), at) => Ok((value, at)),
            (token, at) => {
                Err(self.lexer.error(at, format!("expected a number, found {}", token.name())))
            }
        }
    }

    fn number_in(&mut self, low: f64, high: f64, expected: &str) -> Result<f64, SyntaxError> {
        let (value, at) = self.number()?;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(self.lexer.error(at, format!("expected {expected}, found `{value}`")))
    }

    fn symbol(&mut self, symbol: &'static str) -> Result<(), SyntaxError> {
        match self.lexer.next()? {
            (token, _) if token == Token::Symbol(symbol) => Ok(()),
            (token, at) => {
                Err(self.lexer.error(at, format!("expected `{symbol}`, found {}", token.name())))
            }
        }
    }

    fn is_next(&self, symbol: &'static str) -> Result<bool, SyntaxError> {
        Ok(self.lexer.peek()?.0 == Token::Symbol(symbol))
    }

    fn end(&mut self) -> Result<(), SyntaxError> {
        match self.lexer.next()? {
            (Token::End, _) => Ok(()),
            (token, at) => {
                Err(self.lexer.error(at, format!("expected the end, found {}", token.name())))
            }
        }
    }

    fn vector(&mut self) -> Result<[f64; 3], SyntaxError> {
        let x = self.number()?.0;
        self.symbol(",")?;
        let y = self.number()?.0;
        self.symbol(",")?;
        Ok([x, y, self.number()?.0])
    }

    fn pivot(&mut self) -> Result<Pivot, SyntaxError> {
        if !self.is_next("@")? {
            return Ok(Pivot::Center);
        }
        self.symbol("@")?;
        if self.lexer.peek()?.0 == Token::Word("center".to_owned()) {
            self.lexer.next()?;
            return Ok(Pivot::Center);
        }
        self.vector().map(Pivot::Point)
    }

    fn rotation(&mut self) -> Result<Action, SyntaxError> {
        let degrees = self.vector()?;
        Ok(Action::Rotate { degrees, pivot: self.pivot()? })
    }

    fn scaling(&mut self) -> Result<Action, SyntaxError> {
        let factor = self.number_in(1e-6, 1e6, "a factor from 0.000001 to 1000000")?;
        Ok(Action::Scale { factor, pivot: self.pivot()? })
    }

    fn tone(&mut self) -> Result<([f64; 3], f64), SyntaxError> {
        let (token, at) = self.lexer.next()?;
        let Token::Hex(rgb) = token else {
            let what = format!("expected a colour as `#rrggbb`, found {}", token.name());
            return Err(self.lexer.error(at, what));
        };
        if !self.is_next(":")? {
            return Ok((rgb, 1.0));
        }
        self.symbol(":")?;
        Ok((rgb, self.number_in(0.0, 1.0, "a strength of 0 to 1")?))
    }

    fn levels(&mut self) -> Result<Action, SyntaxError> {
        let black = self.number_in(-MAX_COLOR, MAX_COLOR, "a colour, black is 0")?;
        self.symbol(",")?;
        let at = self.lexer.peek()?.1;
        let white = self.number_in(-MAX_COLOR, MAX_COLOR, "a colour, white is 1")?;
        if white - black < 1e-3 {
            return Err(self.lexer.error(at, "white must exceed black by 0.001 or more"));
        }
        Ok(Action::Levels { black, white })
    }

    fn pose(&mut self) -> Result<GraftPose, SyntaxError> {
        let mut pose = GraftPose { translation: self.vector()?, ..GraftPose::IDENTITY };
        if self.is_next(",")? {
            self.symbol(",")?;
            pose.degrees = self.vector()?;
            if self.is_next(",")? {
                self.symbol(",")?;
                pose.scale = self.number_in(1e-6, 1e6, "a scale above 0")?;
            }
        }
        Ok(pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_option_is_parsed() {
        for option in ACTION_OPTIONS.iter().filter(|option| option.name != "sliced") {
            let argument = match option.name {
                "translate" => "1,2,3",
                "rotate" => "0,90,0@center",
                "scale" => "2@0,0,0",
                "color" | "tint" => "#e33:.5",
                "levels" => "0,.8",
                "match-colors" => "picture.png",
                "style" => "a:b.png:.5",
                "graft" => "hat@2x.ply@0,1,0,0,90,0,.5",
                _ if option.argument.is_some() => ".5",
                _ => "",
            };
            let action = Action::parse(option.name, argument).unwrap();
            assert_eq!(action.name(), option.name, "its own name");
        }
    }

    #[test]
    fn file_names_may_contain_at_signs() {
        let file = |text: &str| match Action::parse("graft", text).unwrap() {
            Action::Graft { file, pose } => (file, pose),
            other => panic!("{other:?}"),
        };
        assert_eq!(file("a@b.ply"), ("a@b.ply".to_owned(), GraftPose::IDENTITY), "a name");
        assert_eq!(file("a.ply@1,2,3").1.translation, [1.0, 2.0, 3.0], "a pose");
    }

    #[test]
    fn names_of_style_pictures_may_have_colons() {
        for (text, image, strength) in [
            ("a.png", "a.png", 1.0),
            ("a.png:.5", "a.png", 0.5),
            ("C:/a.png", "C:/a.png", 1.0),
            ("C:/a.png:0", "C:/a.png", 0.0),
            ("C:1/a.png", "C:1/a.png", 1.0),
        ] {
            let expected = Action::Style { image: image.to_owned(), strength };
            assert_eq!(Action::parse("style", text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn errors_contain_the_column() {
        for (name, text, column) in [
            ("translate", "1,2", 4),
            ("translate", "1,2,nan", 5),
            ("translate", "1,2,3,4", 6),
            ("rotate", "0,90,0@1,2", 11),
            ("rotate", "0,90,0@left", 8),
            ("scale", "0", 1),
            ("scale", "-2", 1),
            ("opacity", "0", 1),
            ("color", "red", 1),
            ("color", "#e33:2", 6),
            ("brightness", "3", 1),
            ("levels", ".5,.5", 4),
            ("saturation", "-1", 1),
            ("match-colors", "", 1),
            ("style", "a.png:2", 7),
            ("style", "a.png:.5x", 9),
            ("graft", "hat.ply@1,2", 12),
            ("graft", "hat.ply@1,2,3,4", 16),
            ("hue", "1e300", 1),
        ] {
            match Action::parse(name, text) {
                Err(EditError::Syntax { source, .. }) => {
                    assert_eq!(source.column, column, "{name} {text}: {source}");
                }
                other => panic!("{name} {text}: {other:?}"),
            }
        }
        assert!(
            matches!(Action::parse("explode", ""), Err(EditError::UnknownAction(_))),
            "unknown"
        );
    }
}
