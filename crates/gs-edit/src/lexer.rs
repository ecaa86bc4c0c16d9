//! Splits a text into tokens with their columns.

use crate::error::SyntaxError;

/// Maximum length of a text, characters; limits hostile input.
const MAX_LENGTH: usize = 65_536;

/// One token.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Token {
    /// A finite number.
    Number(f64),
    /// Letters, digits, `_` and `-`, beginning with a letter.
    Word(String),
    /// `#rgb` or `#rrggbb`, channels 0 to 1.
    Hex([f64; 3]),
    /// Punctuation.
    Symbol(&'static str),
    /// End of the text.
    End,
}

impl Token {
    /// Name for messages.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Number(value) => format!("`{value}`"),
            Self::Word(word) => format!("`{word}`"),
            Self::Hex(_) => "a colour".to_owned(),
            Self::Symbol(symbol) => format!("`{symbol}`"),
            Self::End => "the end".to_owned(),
        }
    }
}

/// Longest first, so that `<=` is not read as `<`.
const SYMBOLS: [&str; 14] =
    ["<=", ">=", "..", "<", ">", "&", "|", "!", "(", ")", ",", "~", ":", "@"];

/// A text and the current position in it.
#[derive(Debug, Clone)]
pub(crate) struct Lexer<'a> {
    text: &'a str,
    chars: Vec<char>,
    at: usize,
}

impl<'a> Lexer<'a> {
    /// Starts at the first character.
    pub(crate) fn new(text: &'a str) -> Result<Self, SyntaxError> {
        let chars: Vec<char> = text.chars().collect();
        if chars.len() > MAX_LENGTH {
            let head: String = chars[..60].iter().collect();
            let what = format!("{} characters, expected at most {MAX_LENGTH}", chars.len());
            return Err(SyntaxError::new(&head, 0, what));
        }
        Ok(Self { text, chars, at: 0 })
    }

    /// An error at character `at`.
    pub(crate) fn error(&self, at: usize, what: impl Into<String>) -> SyntaxError {
        SyntaxError::new(self.text, at, what)
    }

    /// The next token and the character at which it starts, without consuming it.
    pub(crate) fn peek(&self) -> Result<(Token, usize), SyntaxError> {
        self.clone().next()
    }

    /// The next token and the character at which it starts.
    pub(crate) fn next(&mut self) -> Result<(Token, usize), SyntaxError> {
        self.skip_space();
        let start = self.at;
        let Some(&first) = self.chars.get(start) else { return Ok((Token::End, start)) };
        if first == '#' {
            return Ok((self.hex()?, start));
        }
        if self.starts_number() {
            return Ok((Token::Number(self.number()?), start));
        }
        if first.is_ascii_alphabetic() {
            while self.char().is_some_and(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
                self.at += 1;
            }
            return Ok((Token::Word(self.chars[start..self.at].iter().collect()), start));
        }
        for symbol in SYMBOLS {
            if symbol.chars().enumerate().all(|(i, c)| self.chars.get(start + i) == Some(&c)) {
                self.at += symbol.len();
                return Ok((Token::Symbol(symbol), start));
            }
        }
        Err(self.error(start, format!("unexpected `{first}`")))
    }

    /// A path: in double quotes, or up to a space, `)`, `&` or `|`.
    pub(crate) fn path(&mut self) -> Result<String, SyntaxError> {
        self.skip_space();
        let start = self.at;
        if self.char() == Some('"') {
            let rest = &self.chars[start + 1..];
            let Some(length) = rest.iter().position(|&c| c == '"') else {
                return Err(self.error(start, "the quoted path has no closing `\"`"));
            };
            self.at = start + length + 2;
            if length == 0 {
                return Err(self.error(start, "the path is empty"));
            }
            return Ok(rest[..length].iter().collect());
        }
        while self.char().is_some_and(|c| !c.is_whitespace() && !")&|".contains(c)) {
            self.at += 1;
        }
        if self.at == start {
            let what = "expected a path; put paths with spaces in double quotes";
            return Err(self.error(start, what));
        }
        Ok(self.chars[start..self.at].iter().collect())
    }

    fn char(&self) -> Option<char> {
        self.chars.get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while self.char().is_some_and(char::is_whitespace) {
            self.at += 1;
        }
    }

    fn is_digit(&self, offset: usize) -> bool {
        self.chars.get(self.at + offset).is_some_and(char::is_ascii_digit)
    }

    fn starts_number(&self) -> bool {
        let sign = usize::from(matches!(self.char(), Some('-' | '+')));
        self.is_digit(sign)
            || (self.chars.get(self.at + sign) == Some(&'.') && self.is_digit(sign + 1))
    }

    fn digits(&mut self) {
        while self.is_digit(0) {
            self.at += 1;
        }
    }

    fn number(&mut self) -> Result<f64, SyntaxError> {
        let start = self.at;
        if matches!(self.char(), Some('-' | '+')) {
            self.at += 1;
        }
        self.digits();
        // `1..2` is a range; it does not start with the number `1.`.
        if self.char() == Some('.') && self.chars.get(self.at + 1) != Some(&'.') {
            self.at += 1;
            self.digits();
        }
        if matches!(self.char(), Some('e' | 'E')) {
            let sign = usize::from(matches!(self.chars.get(self.at + 1), Some('-' | '+')));
            if self.is_digit(1 + sign) {
                self.at += 1 + sign;
                self.digits();
            }
        }
        let text: String = self.chars[start..self.at].iter().collect();
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.error(start, format!("`{text}` is out of range"))),
        }
    }

    fn hex(&mut self) -> Result<Token, SyntaxError> {
        let start = self.at;
        self.at += 1;
        while self.char().is_some_and(|c| c.is_ascii_alphanumeric()) {
            self.at += 1;
        }
        let digits: Option<Vec<u32>> =
            self.chars[start + 1..self.at].iter().map(|c| c.to_digit(16)).collect();
        let channel = |value: u32| f64::from(value) / 255.0;
        match digits.as_deref() {
            Some(&[r, g, b]) => Ok(Token::Hex([r, g, b].map(|value| channel(17 * value)))),
            Some(&[a, b, c, d, e, f]) => {
                Ok(Token::Hex([16 * a + b, 16 * c + d, 16 * e + f].map(channel)))
            }
            _ => Err(self.error(start, "expected a colour as `#rgb` or `#rrggbb`")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<Token> {
        let mut lexer = Lexer::new(text).unwrap();
        let mut found = Vec::new();
        loop {
            match lexer.next().unwrap().0 {
                Token::End => return found,
                token => found.push(token),
            }
        }
    }

    #[test]
    fn numbers_ranges_and_colours() {
        use Token::{Hex, Number, Symbol, Word};
        assert_eq!(
            tokens("hue 200..260&size>=-.5e-1"),
            [
                Word("hue".into()),
                Number(200.0),
                Symbol(".."),
                Number(260.0),
                Symbol("&"),
                Word("size".into()),
                Symbol(">="),
                Number(-0.05)
            ],
            "ranges are not decimal points"
        );
        assert_eq!(tokens("#f00~.1"), [Hex([1.0, 0.0, 0.0]), Symbol("~"), Number(0.1)], "colour");
    }

    #[test]
    fn errors_have_columns() {
        for (text, column) in [("a $", 3), ("#12", 1), ("1e999", 1), ("é", 1)] {
            let mut lexer = Lexer::new(text).unwrap();
            let error = loop {
                match lexer.next() {
                    Ok((Token::End, _)) => panic!("{text} is rejected"),
                    Ok(_) => {}
                    Err(error) => break error,
                }
            };
            assert_eq!(error.column, column, "{error}");
        }
    }

    #[test]
    fn paths_end_at_operators() {
        let mut lexer = Lexer::new(" a/b.txt)").unwrap();
        assert_eq!(lexer.path().unwrap(), "a/b.txt", "bare");
        let mut lexer = Lexer::new("\"my masks\" & x").unwrap();
        assert_eq!(lexer.path().unwrap(), "my masks", "quoted");
        assert!(Lexer::new("\"open").unwrap().path().is_err(), "no closing quote");
    }
}
