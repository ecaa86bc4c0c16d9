//! Parser of [`Selector`]s, by recursive descent.
//!
//! ```text
//! expression = term { "|" term }
//! term       = operand { "&" operand }
//! operand    = "!" operand | "(" expression ")" | prefix operand | leaf
//! prefix     = ("grow" | "shrink" | "near") D
//! ```

use crate::error::SyntaxError;
use crate::lexer::{Lexer, Token};
use crate::selector::{Bounds, Selector, SplatProperty};

/// Maximum nesting of parentheses, `!` and prefixes, well within the stack.
const MAX_DEPTH: usize = 64;

/// Default tolerance of `color`, distance in RGB: includes the shading of one material.
const TOLERANCE: f64 = 0.15;

/// The leaves and prefixes of the language, for messages.
const WORDS: &str = "all, box, sphere, plane, opacity, size, x, y, z, red, green, blue, saturation, brightness, color, hue, mask, moving, part, connected, near, ids, grow or shrink";

impl Selector {
    /// Parses an expression.
    ///
    /// # Errors
    /// For a malformed text; the error contains the column.
    pub fn parse(text: &str) -> Result<Self, SyntaxError> {
        let mut parser = Parser { lexer: Lexer::new(text)?, depth: 0 };
        let selector = parser.expression()?;
        match parser.lexer.next()? {
            (Token::End, _) => Ok(selector),
            (token, at) => {
                let what = format!("expected `&`, `|` or the end, found {}", token.name());
                Err(parser.lexer.error(at, what))
            }
        }
    }
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    depth: usize,
}

impl Parser<'_> {
    fn expression(&mut self) -> Result<Selector, SyntaxError> {
        let mut terms = vec![self.term()?];
        while self.take("|")? {
            terms.push(self.term()?);
        }
        Ok(joined(terms, Selector::Or))
    }

    fn term(&mut self) -> Result<Selector, SyntaxError> {
        let mut operands = vec![self.operand()?];
        while self.take("&")? {
            operands.push(self.operand()?);
        }
        Ok(joined(operands, Selector::And))
    }

    fn operand(&mut self) -> Result<Selector, SyntaxError> {
        self.depth += 1;
        let (token, at) = self.lexer.next()?;
        if self.depth > MAX_DEPTH {
            return Err(self.lexer.error(at, format!("nested more than {MAX_DEPTH} levels deep")));
        }
        let selector = match token {
            Token::Symbol("!") => Selector::Not(Box::new(self.operand()?)),
            Token::Symbol("(") => {
                let inner = self.expression()?;
                if !self.take(")")? {
                    let (token, at) = self.lexer.peek()?;
                    let what = format!("expected `)`, `&` or `|`, found {}", token.name());
                    return Err(self.lexer.error(at, what));
                }
                inner
            }
            Token::Word(word) => self.named(&word, at)?,
            Token::Hex(_) => {
                return Err(self.lexer.error(at, "select colours with `color #rrggbb~.15`"));
            }
            token => {
                let what = format!("expected a selection, found {}: one of {WORDS}", token.name());
                return Err(self.lexer.error(at, what));
            }
        };
        self.depth -= 1;
        Ok(selector)
    }

    fn named(&mut self, word: &str, at: usize) -> Result<Selector, SyntaxError> {
        if let Some((_, field)) = SplatProperty::ALL.iter().find(|(name, _)| *name == word) {
            return Ok(Selector::Range(*field, self.bounds(word)?));
        }
        Ok(match word {
            "all" => Selector::All,
            "moving" => Selector::Moving,
            "box" => self.cuboid()?,
            "sphere" => {
                let center = self.vector(word)?;
                self.comma(word)?;
                Selector::Sphere { center, radius: self.length(word)? }
            }
            "plane" => self.plane()?,
            "color" => self.color()?,
            "hue" => {
                let from = self.degrees()?;
                self.expect("..", "`hue` takes two angles, for example `hue 200..260`")?;
                Selector::Hue { from, to: self.degrees()? }
            }
            "mask" => Selector::Mask(self.lexer.path()?),
            "ids" => Selector::Ids(self.lexer.path()?),
            "part" => self.part()?,
            "connected" => self.connected()?,
            "near" => Selector::Near(self.length(word)?, Box::new(self.operand()?)),
            "grow" => Selector::Grow(self.length(word)?, Box::new(self.operand()?)),
            "shrink" => Selector::Shrink(self.length(word)?, Box::new(self.operand()?)),
            _ => {
                let what = format!("unknown selection `{word}`: expected {WORDS}");
                return Err(self.lexer.error(at, what));
            }
        })
    }

    /// Consumes `symbol` if it is next.
    fn take(&mut self, symbol: &'static str) -> Result<bool, SyntaxError> {
        let found = self.lexer.peek()?.0 == Token::Symbol(symbol);
        if found {
            self.lexer.next()?;
        }
        Ok(found)
    }

    /// Consumes `word` if it is next.
    fn take_word(&mut self, word: &str) -> Result<bool, SyntaxError> {
        let found = matches!(self.lexer.peek()?.0, Token::Word(next) if next == word);
        if found {
            self.lexer.next()?;
        }
        Ok(found)
    }

    fn expect(&mut self, symbol: &'static str, usage: &str) -> Result<(), SyntaxError> {
        let (token, at) = self.lexer.next()?;
        if token == Token::Symbol(symbol) {
            return Ok(());
        }
        Err(self.lexer.error(at, format!("expected `{symbol}`, found {}: {usage}", token.name())))
    }

    fn comma(&mut self, word: &str) -> Result<(), SyntaxError> {
        self.expect(",", usage(word))
    }

    fn number(&mut self, word: &str) -> Result<(f64, usize), SyntaxError> {
        match self.lexer.next()? {
            (Token::Number(value), at) => Ok((value, at)),
            (token, at) => {
                let found = token.name();
                let what = format!("expected a number, found {found}: {}", usage(word));
                Err(self.lexer.error(at, what))
            }
        }
    }

    fn vector(&mut self, word: &str) -> Result<[f64; 3], SyntaxError> {
        let x = self.number(word)?.0;
        self.comma(word)?;
        let y = self.number(word)?.0;
        self.comma(word)?;
        Ok([x, y, self.number(word)?.0])
    }

    /// A number from 0.
    fn length(&mut self, word: &str) -> Result<f64, SyntaxError> {
        let (value, at) = self.number(word)?;
        if value < 0.0 {
            let what = format!("a length must be 0 or more: {}", usage(word));
            return Err(self.lexer.error(at, what));
        }
        Ok(value)
    }

    fn degrees(&mut self) -> Result<f64, SyntaxError> {
        let (value, at) = self.number("hue")?;
        if !(0.0..=360.0).contains(&value) {
            return Err(self.lexer.error(at, "a hue must be 0 to 360 degrees"));
        }
        Ok(value)
    }

    /// A coordinate of a box, which may be infinite.
    fn corner(&mut self) -> Result<(f64, usize), SyntaxError> {
        let (token, at) = self.lexer.peek()?;
        if token == Token::Word("inf".to_owned()) {
            self.lexer.next()?;
            return Ok((f64::INFINITY, at));
        }
        self.number("box")
    }

    fn cuboid(&mut self) -> Result<Selector, SyntaxError> {
        let mut found = [(0.0, 0); 6];
        for (i, value) in found.iter_mut().enumerate() {
            if i > 0 {
                self.comma("box")?;
            }
            *value = self.corner()?;
        }
        let mut min = [0.0; 3];
        let mut max = [0.0; 3];
        for axis in 0..3 {
            let ((low, _), (high, at)) = (found[axis], found[axis + 3]);
            // An unbounded lower side is also written `inf`.
            min[axis] = if low == f64::INFINITY { f64::NEG_INFINITY } else { low };
            max[axis] = high;
            if min[axis] > max[axis] {
                let what = format!("the upper corner is below the lower one, {low}");
                return Err(self.lexer.error(at, what));
            }
        }
        Ok(Selector::Box { min, max })
    }

    fn plane(&mut self) -> Result<Selector, SyntaxError> {
        let at = self.lexer.peek()?.1;
        let normal = self.vector("plane")?;
        self.comma("plane")?;
        let offset = self.number("plane")?.0;
        // Scaled first, so that squares of huge numbers stay finite.
        let largest = normal.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        if largest == 0.0 {
            return Err(self.lexer.error(at, "the normal of a plane must not be zero"));
        }
        let scaled = normal.map(|v| v / largest);
        let length = scaled.iter().map(|v| v * v).sum::<f64>().sqrt();
        Ok(Selector::Plane { normal: scaled.map(|v| v / length), offset })
    }

    fn color(&mut self) -> Result<Selector, SyntaxError> {
        let (token, at) = self.lexer.next()?;
        let Token::Hex(rgb) = token else {
            let what = format!("expected a colour, found {}: {}", token.name(), usage("color"));
            return Err(self.lexer.error(at, what));
        };
        let tolerance = if self.take("~")? { self.length("color")? } else { TOLERANCE };
        Ok(Selector::Color { rgb, tolerance })
    }

    fn part(&mut self) -> Result<Selector, SyntaxError> {
        let (value, at) = self.number("part")?;
        if value < 1.0 || value.fract() != 0.0 || value > f64::from(u32::MAX) {
            return Err(self.lexer.error(at, "parts are numbered 1, 2, 3, …"));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number in range"
        )]
        Ok(Selector::Part(value as u32))
    }

    fn connected(&mut self) -> Result<Selector, SyntaxError> {
        let point = self.vector("connected")?;
        let gap = if self.take_word("gap")? { Some(self.length("connected")?) } else { None };
        let of = if self.take_word("of")? { Some(Box::new(self.operand()?)) } else { None };
        Ok(Selector::Connected { point, gap, of })
    }

    fn bounds(&mut self, word: &str) -> Result<Bounds, SyntaxError> {
        let (token, at) = self.lexer.peek()?;
        let Token::Symbol(symbol) = token else {
            let (low, at) = self.number(word)?;
            self.expect("..", usage(word))?;
            let (high, _) = self.number(word)?;
            if low > high {
                return Err(self.lexer.error(at, format!("{low}..{high} is empty")));
            }
            return Ok(Bounds { low: Some((low, true)), high: Some((high, true)) });
        };
        if !["<", "<=", ">", ">="].contains(&symbol) {
            let what = format!("expected `<`, `>` or a range, found `{symbol}`: {}", usage(word));
            return Err(self.lexer.error(at, what));
        }
        self.lexer.next()?;
        let end = Some((self.number(word)?.0, symbol.len() == 2));
        Ok(if symbol.starts_with('<') {
            Bounds { low: None, high: end }
        } else {
            Bounds { low: end, high: None }
        })
    }
}

fn joined(mut terms: Vec<Selector>, join: impl Fn(Vec<Selector>) -> Selector) -> Selector {
    if terms.len() == 1 { terms.remove(0) } else { join(terms) }
}

/// An example of the arguments of a word.
fn usage(word: &str) -> &'static str {
    match word {
        "box" => "`box x,y,z,X,Y,Z`, the lower and the upper corner; `inf` for no bound",
        "sphere" => "`sphere x,y,z,radius`",
        "plane" => "`plane nx,ny,nz,d` selects n·x ≥ d",
        "color" => "`color #e33~.15`, with the largest distance in RGB",
        "hue" => "`hue 200..260`, degrees",
        "part" => "`part 1`",
        "connected" => "`connected x,y,z [gap D] [of (…)]`",
        "near" => "`near D (…)`",
        "grow" => "`grow D (…)`",
        "shrink" => "`shrink D (…)`",
        "opacity" => "for example `opacity<.2` or `opacity .2..1`",
        "size" => "for example `size>.1`, world units",
        _ => "for example `red>.5` or `x -1..1`",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn precedence_is_not_and_or() {
        let parsed = Selector::parse("all | !moving & part 2").unwrap();
        let not = Selector::Not(Box::new(Selector::Moving));
        let and = Selector::And(vec![not, Selector::Part(2)]);
        assert_eq!(parsed, Selector::Or(vec![Selector::All, and]), "precedence");
    }

    #[test]
    fn documented_selections_are_parsed() {
        for text in [
            "all",
            "box -1,0,-1,1,2,1",
            "box inf,0,inf,inf,1,inf",
            "sphere 0,1,0,.5",
            "plane 0,1,0,.2",
            "opacity<.2",
            "size>.1",
            "size .1..1",
            "x>=-1e300",
            "color #e33~.15",
            "color #12aBcD",
            "hue 330..30",
            "mask frozen/masks",
            "mask \"my masks\"",
            "moving & !part 12",
            "connected 0,1,0 gap .1 of (color #e33 | opacity>.5)",
            "near .1 part 2",
            "ids rows.txt & grow .1 shrink 0.2 moving",
            "( all )",
        ] {
            assert!(Selector::parse(text).is_ok(), "{text}: {:?}", Selector::parse(text));
        }
    }

    #[test]
    fn errors_contain_the_column() {
        for (text, column) in [
            ("", 1),
            ("moving &", 9),
            ("moving part 2", 8),
            ("sphere 0,0,0", 13),
            ("sphere 0,0,0,-1", 14),
            ("sphere 0,x,0,1", 10),
            ("box 0,0,0,1,-1,1", 13),
            ("plane 0,0,0,1", 7),
            ("opacity=.2", 8),
            ("opacity 2", 10),
            ("size 2..1", 6),
            ("colour #e33", 1),
            ("color e33", 7),
            ("hue 200..400", 10),
            ("part 0", 6),
            ("part 1.5", 6),
            ("grow nan all", 6),
            ("(moving", 8),
            ("moving)", 7),
            ("mask", 5),
            ("size>1e999", 6),
            ("é", 1),
        ] {
            let error = Selector::parse(text).expect_err(text);
            assert_eq!(error.column, column, "`{text}`: {error}");
            let lines: Vec<String> = error.to_string().lines().map(str::to_owned).collect();
            let caret = lines[2].chars().position(|c| c == '^').unwrap();
            assert_eq!(caret, 4 + column - 1, "the caret is below column {column}: {error}");
        }
    }

    #[test]
    fn deep_nesting_is_an_error() {
        for open in ["(", "!", "grow 1 "] {
            let text = open.repeat(9000) + "all";
            let error = Selector::parse(&text).unwrap_err();
            assert!(error.what.contains("deep"), "{}", error.what);
        }
        let fine = "(".repeat(40) + "all" + &")".repeat(40);
        assert!(Selector::parse(&fine).is_ok(), "40 are fine");
        let wide = "all|".repeat(9000) + "all";
        assert!(Selector::parse(&wide).is_ok(), "long chains are not deep");
    }
}
