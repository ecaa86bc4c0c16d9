//! `cfg_args`: the `repr` of a Python namespace, read as data.

use thiserror::Error;

/// Deepest nesting accepted; real files have three levels.
const MAX_DEPTH: usize = 32;

/// A `cfg_args` text that does not parse.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "malformed cfg_args: {what} at character {at}; fix or remove the file (flags are then guessed)"
)]
pub struct CfgError {
    /// Position, bytes.
    pub at: usize,
    /// What was expected.
    pub what: String,
}

/// A Python literal.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// `None`.
    None,
    /// `True` or `False`.
    Bool(bool),
    /// An integer.
    Int(i64),
    /// A floating-point number, or an integer beyond 64 bits.
    Float(f64),
    /// A string.
    Str(String),
    /// A list or tuple.
    List(Vec<Value>),
    /// A dictionary, in order.
    Dict(Vec<(Value, Value)>),
    /// The `repr` of an object, for example `PosixPath('x')`, as text.
    Other(String),
}

impl Value {
    /// As a flag: booleans, and integers the way Python takes them.
    pub fn as_bool(&self) -> Option<bool> {
        match self {
            Self::Bool(value) => Some(*value),
            Self::Int(value) => Some(*value != 0),
            _ => None,
        }
    }

    /// As a non-negative integer.
    pub fn as_u64(&self) -> Option<u64> {
        match self {
            Self::Int(value) => u64::try_from(*value).ok(),
            _ => None,
        }
    }

    /// As a number.
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            #[expect(clippy::cast_precision_loss, reason = "options are small numbers")]
            Self::Int(value) => Some(*value as f64),
            Self::Float(value) => Some(*value),
            _ => None,
        }
    }

    /// As text.
    pub fn as_str(&self) -> Option<&str> {
        match self {
            Self::Str(value) => Some(value),
            _ => None,
        }
    }

    /// Entry of a dictionary with string keys.
    pub fn get(&self, key: &str) -> Option<&Self> {
        match self {
            Self::Dict(items) => {
                items.iter().find(|(name, _)| name.as_str() == Some(key)).map(|(_, value)| value)
            }
            _ => None,
        }
    }
}

/// The arguments of a training run, in file order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CfgArgs {
    /// Names and values.
    pub items: Vec<(String, Value)>,
}

impl CfgArgs {
    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.items.iter().find(|(name, _)| name == key).map(|(_, value)| value)
    }
}

/// Parses `Namespace(key=value, …)`.
///
/// # Errors
/// Says what was expected where.
pub fn parse(text: &str) -> Result<CfgArgs, CfgError> {
    let mut parser = Parser { text, at: 0 };
    parser.space();
    parser.expect("Namespace(")?;
    let mut items = Vec::new();
    parser.space();
    while !parser.eat(")") {
        let key = parser.identifier()?.to_owned();
        parser.space();
        parser.expect("=")?;
        items.push((key, parser.value(0)?));
        parser.separator(")")?;
    }
    parser.space();
    if parser.at < text.len() {
        return Err(parser.error("the end of the text"));
    }
    Ok(CfgArgs { items })
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn error(&self, expected: &str) -> CfgError {
        CfgError { at: self.at, what: format!("expected {expected}") }
    }

    fn space(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start().len();
    }

    fn eat(&mut self, token: &str) -> bool {
        let found = self.rest().starts_with(token);
        if found {
            self.at += token.len();
        }
        found
    }

    fn expect(&mut self, token: &str) -> Result<(), CfgError> {
        if self.eat(token) { Ok(()) } else { Err(self.error(&format!("`{token}`"))) }
    }

    /// A comma between items; none is needed before `close`.
    fn separator(&mut self, close: &str) -> Result<(), CfgError> {
        self.space();
        if self.eat(",") {
            self.space();
            Ok(())
        } else if self.rest().starts_with(close) {
            Ok(())
        } else {
            Err(self.error(&format!("`,` or `{close}`")))
        }
    }

    fn identifier(&mut self) -> Result<&'a str, CfgError> {
        let end = self.rest().find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.'));
        let name = &self.rest()[..end.unwrap_or(self.rest().len())];
        if name.is_empty() {
            return Err(self.error("a name"));
        }
        self.at += name.len();
        Ok(name)
    }

    fn value(&mut self, depth: usize) -> Result<Value, CfgError> {
        if depth > MAX_DEPTH {
            return Err(self.error("less nesting"));
        }
        self.space();
        let start = self.at;
        match self.rest().chars().next() {
            Some('\'' | '"') => self.string().map(Value::Str),
            Some('[') => self.list("[", "]", depth),
            Some('(') => self.list("(", ")", depth),
            Some('{') => self.dict(depth),
            Some('<') => {
                let end = self.rest().find('>').ok_or_else(|| self.error("`>`"))?;
                self.at += end + 1;
                Ok(Value::Other(self.text[start..self.at].to_owned()))
            }
            Some(c) if c.is_ascii_digit() || matches!(c, '-' | '+' | '.') => self.number(),
            Some(_) => match self.identifier()? {
                "None" => Ok(Value::None),
                "True" => Ok(Value::Bool(true)),
                "False" => Ok(Value::Bool(false)),
                "inf" => Ok(Value::Float(f64::INFINITY)),
                "nan" => Ok(Value::Float(f64::NAN)),
                _ if self.rest().starts_with('(') => {
                    self.call(depth)?;
                    Ok(Value::Other(self.text[start..self.at].to_owned()))
                }
                _ => {
                    self.at = start;
                    Err(self.error("a value"))
                }
            },
            None => Err(self.error("a value")),
        }
    }

    /// Arguments of the `repr` of an object, positional or by name.
    fn call(&mut self, depth: usize) -> Result<(), CfgError> {
        self.expect("(")?;
        self.space();
        while !self.eat(")") {
            let start = self.at;
            let named = self.identifier().is_ok() && self.eat("=");
            if !named {
                self.at = start;
            }
            self.value(depth + 1)?;
            self.separator(")")?;
        }
        Ok(())
    }

    fn list(&mut self, open: &str, close: &str, depth: usize) -> Result<Value, CfgError> {
        self.expect(open)?;
        self.space();
        let mut items = Vec::new();
        while !self.eat(close) {
            items.push(self.value(depth + 1)?);
            self.separator(close)?;
        }
        Ok(Value::List(items))
    }

    fn dict(&mut self, depth: usize) -> Result<Value, CfgError> {
        self.expect("{")?;
        self.space();
        let mut items = Vec::new();
        while !self.eat("}") {
            let key = self.value(depth + 1)?;
            self.space();
            self.expect(":")?;
            items.push((key, self.value(depth + 1)?));
            self.separator("}")?;
        }
        Ok(Value::Dict(items))
    }

    fn number(&mut self) -> Result<Value, CfgError> {
        let end = self
            .rest()
            .find(|c: char| !(c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.' | '_')));
        let text = &self.rest()[..end.unwrap_or(self.rest().len())];
        let value = match (text.parse(), text.parse()) {
            (Ok(integer), _) => Value::Int(integer),
            (_, Ok(float)) => Value::Float(float),
            _ => return Err(self.error("a number")),
        };
        self.at += text.len();
        Ok(value)
    }

    fn string(&mut self) -> Result<String, CfgError> {
        let mut chars = self.rest().char_indices();
        let quote = chars.next().map(|(_, quote)| quote);
        let mut out = String::new();
        while let Some((offset, c)) = chars.next() {
            if Some(c) == quote {
                self.at += offset + 1;
                return Ok(out);
            }
            if c != '\\' {
                out.push(c);
                continue;
            }
            let escaped = chars.next().map(|(_, escaped)| escaped);
            let digits = match escaped {
                Some('x') => 2,
                Some('u') => 4,
                Some('U') => 8,
                _ => 0,
            };
            match escaped {
                Some('n') => out.push('\n'),
                Some('t') => out.push('\t'),
                Some('r') => out.push('\r'),
                Some(c @ ('\\' | '\'' | '"')) => out.push(c),
                Some(_) if digits > 0 => {
                    let hex: String = chars.by_ref().take(digits).map(|(_, digit)| digit).collect();
                    let code = u32::from_str_radix(&hex, 16).ok().and_then(char::from_u32);
                    out.push(code.ok_or_else(|| self.error("a character code"))?);
                }
                // Python keeps a backslash it does not know, and so do Windows paths typed by hand.
                Some(other) => out.extend(['\\', other]),
                None => break,
            }
        }
        Err(self.error("the end of a string"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_the_whole_grammar() {
        let text = r#"Namespace(a='x', b="it's", c=-1, d=1.6e-06, e=True, f=None, g=[1, [2], (3,)], h={'k': {'r': [64, 25]}}, i='C:\\new\x41', j=[], k=PosixPath('a, b)'), l=1e400, m=99999999999999999999, n=<function f at 0x7f>)"#;
        let cfg = parse(text).unwrap();
        let get = |key: &str| cfg.get(key).unwrap();
        assert_eq!(get("b").as_str(), Some("it's"), "double quotes");
        assert_eq!(get("c"), &Value::Int(-1), "negative");
        assert_eq!(get("d"), &Value::Float(1.6e-6), "exponent");
        assert_eq!((get("c").as_f64(), get("d").as_f64()), (Some(-1.0), Some(1.6e-6)), "numbers");
        assert_eq!(get("e").as_bool(), Some(true), "bool");
        assert_eq!(get("i").as_str(), Some("C:\\newA"), "escapes");
        let resolution = get("h").get("k").and_then(|k| k.get("r"));
        assert_eq!(resolution, Some(&Value::List(vec![Value::Int(64), Value::Int(25)])), "nested");
        assert_eq!(get("k"), &Value::Other("PosixPath('a, b)')".to_owned()), "object");
        assert!(matches!(get("m"), Value::Float(_)), "huge integer");
        assert!(cfg.get("z").is_none(), "absent");
        assert!(parse("Namespace()").unwrap().items.is_empty(), "empty");
    }

    #[test]
    fn broken_texts_are_refused() {
        let deep = format!("Namespace(a={})", "[".repeat(100_000));
        for text in [
            "",
            "Namespace(",
            "Namespace(a)",
            "Namespace(a=)",
            "Namespace(a=1",
            "Namespace(a=1 b=2)",
            "Namespace(a='x)",
            "Namespace(a=[1, 2)",
            "Namespace(a={1})",
            "Namespace(a=1) x",
            "Namespace(a=__import__)",
            "Namespace(a=1-)",
            "Namespace(a='\\xZZ')",
            "Namespace(é=ü)",
            &deep,
        ] {
            assert!(parse(text).is_err(), "{}", &text[..text.len().min(40)]);
        }
    }
}
