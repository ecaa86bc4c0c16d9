//! Parsing a namespace.

use super::{CfgError, Value};

/// Deepest nesting accepted; real files have three levels.
const MAX_DEPTH: usize = 32;

/// The arguments of a training run, in file order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CfgArgs {
    /// Names and values.
    pub items: Vec<(String, Value)>,
    /// Names whose values are not literals ([`Value::Other`]).
    pub unread: Vec<String>,
}

impl CfgArgs {
    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.items.iter().find(|(name, _)| name == key).map(|(_, value)| value)
    }
}

/// Parses `Namespace(key=value, …)`. Values that are not literals are skipped and listed.
///
/// # Errors
/// If the text is not a namespace, or ends before its closing bracket.
pub fn parse(text: &str) -> Result<CfgArgs, CfgError> {
    let mut parser = Parser { text, at: 0, balanced: true };
    parser.space();
    parser.expect("Namespace(")?;
    let mut cfg = CfgArgs::default();
    loop {
        parser.space();
        if parser.eat(")") {
            break;
        }
        if parser.at == text.len() {
            return Err(parser.error("`)` at the end"));
        }
        if parser.eat(",") {
            continue;
        }
        let start = parser.at;
        let name = parser.identifier().map(str::to_owned);
        parser.space();
        let Some(name) = name.ok().filter(|_| parser.eat("=")) else {
            // Not a field: continue with the next one.
            parser.at = start;
            parser.skip_to_next_field();
            continue;
        };
        let value = parser.field_value();
        if let Value::Other(_) = value {
            cfg.unread.push(name.clone());
        }
        cfg.items.push((name, value));
    }
    Ok(cfg)
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    /// Whether brackets and quotes have matched so far; if not, the
    /// parser searches for the next field instead.
    balanced: bool,
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

    /// The value of a field, up to the following comma or bracket: a literal, or else the raw text.
    fn field_value(&mut self) -> Value {
        self.space();
        let start = self.at;
        if let Ok(value) = self.value(0) {
            self.space();
            if self.at == self.text.len() || self.rest().starts_with([',', ')']) {
                return value;
            }
        }
        self.at = start;
        if let Some(length) = self.balanced.then(|| balanced_length(self.rest())).flatten() {
            self.at += length;
        } else {
            self.balanced = false;
            self.skip_to_next_field();
        }
        Value::Other(self.text[start..self.at].trim_end().to_owned())
    }

    /// Advances to the comma before the next `name=`, else to the final bracket, else to the end.
    fn skip_to_next_field(&mut self) {
        let rest = self.rest();
        let is_field = |&(at, _): &(usize, &str)| {
            let after = rest[at + 1..].trim_start();
            let end = after.find(|c: char| !(c.is_alphanumeric() || c == '_'));
            end.is_some_and(|end| end > 0 && after[end..].starts_with('='))
        };
        let next = rest.match_indices(',').find(is_field);
        let last = rest.trim_end().strip_suffix(')').map_or(rest.len(), str::len);
        self.at += next.map_or(last, |(at, _)| at);
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
            Some(c) if c.is_ascii_digit() || matches!(c, '-' | '+' | '.') => self.number(),
            Some(_) => match self.identifier()? {
                "None" => Ok(Value::None),
                "True" | "np.True_" => Ok(Value::Bool(true)),
                "False" | "np.False_" => Ok(Value::Bool(false)),
                "inf" => Ok(Value::Float(f64::INFINITY)),
                "nan" => Ok(Value::Float(f64::NAN)),
                name if self.rest().starts_with('(') => {
                    let mut arguments = self.call(depth)?;
                    let text = || Value::Other(self.text[start..self.at].to_owned());
                    Ok(match (arguments.len(), wraps_a_literal(name)) {
                        (1, true) => arguments.pop().unwrap_or_else(text),
                        _ => text(),
                    })
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
    fn call(&mut self, depth: usize) -> Result<Vec<Value>, CfgError> {
        self.expect("(")?;
        self.space();
        let mut arguments = Vec::new();
        while !self.eat(")") {
            let start = self.at;
            let named = self.identifier().is_ok() && self.eat("=");
            if !named {
                self.at = start;
            }
            arguments.push(self.value(depth + 1)?);
            self.separator(")")?;
        }
        Ok(arguments)
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
                // Python keeps the backslash of an unknown escape, as in hand-typed Windows paths.
                Some(other) => out.extend(['\\', other]),
                None => break,
            }
        }
        Err(self.error("the end of a string"))
    }
}

/// Whether the `repr` of this class only wraps a literal: paths and NumPy's scalars.
fn wraps_a_literal(class: &str) -> bool {
    let class = class.rsplit('.').next().unwrap_or(class);
    class.ends_with("Path")
        || ["str_", "bool_", "float16", "float32", "float64"].contains(&class)
        || class
            .strip_prefix('u')
            .unwrap_or(class)
            .strip_prefix("int")
            .is_some_and(|bits| ["8", "16", "32", "64"].contains(&bits))
}

/// Length of a value up to the comma or bracket that ends it, skipping nested
/// brackets and quotes; `None` if they do not match.
fn balanced_length(text: &str) -> Option<usize> {
    let mut open = Vec::new();
    let mut chars = text.char_indices();
    while let Some((at, c)) = chars.next() {
        match c {
            ',' | ')' if open.is_empty() => return Some(at),
            '(' => open.push(')'),
            '[' => open.push(']'),
            '{' => open.push('}'),
            '<' => open.push('>'),
            ')' | ']' | '}' if open.pop() != Some(c) => return None,
            '>' if open.last() == Some(&'>') => {
                open.pop();
            }
            '\'' | '"' => loop {
                match chars.next()?.1 {
                    '\\' => {
                        chars.next();
                    }
                    end if end == c => break,
                    _ => {}
                }
            },
            _ => {}
        }
    }
    None
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
        assert_eq!(get("k").as_str(), Some("a, b)"), "a path");
        assert_eq!(cfg.unread, ["n"], "values that are not literals");
        assert!(matches!(get("m"), Value::Float(_)), "huge integer");
        assert!(cfg.get("z").is_none(), "absent");
        assert!(parse("Namespace()").unwrap().items.is_empty(), "empty");
    }

    /// Fields as written by forks and on Windows, inserted before and after fields that must be
    /// parsed, with their expected values.
    #[test]
    fn an_unparsable_field_does_not_affect_others() {
        for (field, read) in [
            (r"model_dir=WindowsPath('C:/out/x')", true),
            (r"extra='C:\\Users\\me\\new run\\'", true),
            ("note=\"it's, (a) test)\"", true),
            ("lr=np.float64(0.00016)", true),
            ("n=numpy.int64(5)", true),
            ("flag=np.True_", true),
            ("lo=-inf, hi=inf, bad=nan", true),
            ("t=(), one=(1,), d={}", true),
            ("name='椅子 – é'", true),
            ("lr2=1e-05", true),
            ("sub=Namespace(a=1, b=Namespace(c='x'))", false),
            ("dtype=torch.float32", false),
            ("device=device(type='cuda', index=0)", false),
            ("off=array([0., 1.])", false),
            ("bg=tensor([1., 1., 1.], device='cuda:0')", false),
            ("tags={'a', 'b'}", false),
            ("none=set()", false),
            ("mode=<Mode.FAST: 2>", false),
            ("cls=<class 'int'>", false),
            ("fn=<function main.<locals>.f at 0x7f>", false),
            ("raw=b'a, b)'", false),
            ("dd=defaultdict(<class 'list'>, {'a': [1]})", false),
            ("od=OrderedDict([('a', 1)])", false),
            ("z=(1+2j)", false),
            ("dots=...", false),
            ("re=re.compile('[,)')", false),
            ("odd=<a ' b>", false),
            ("odd=<unclosed", false),
            ("odd=[1, 2)", false),
            ("odd={1}", false),
            ("odd=", false),
            ("odd='\\xZZ'", false),
            ("odd", true),
        ] {
            let text = format!("Namespace(first=1, {field}, last=[2, 3], net_width=64)");
            let cfg = parse(&text).unwrap();
            assert_eq!(cfg.get("first"), Some(&Value::Int(1)), "{field}: before");
            assert_eq!(cfg.get("net_width"), Some(&Value::Int(64)), "{field}: after");
            assert!(
                matches!(cfg.get("last"), Some(Value::List(list)) if list.len() == 2),
                "{field}"
            );
            let name = field.split('=').next().unwrap();
            let unread: &[&str] = if read { &[] } else { &[name] };
            assert_eq!(cfg.unread, unread, "{field}: named");
            let at_the_end = parse(&format!("Namespace(first=1, {field})")).unwrap();
            assert_eq!(at_the_end.get("first"), Some(&Value::Int(1)), "{field}: at the end");
        }
        let path = parse("Namespace(a=PosixPath('x'), b=np.float64(2.5), c=np.True_)").unwrap();
        assert_eq!(path.get("a").and_then(Value::as_str), Some("x"), "a path is its text");
        assert_eq!(path.get("b").and_then(Value::as_f64), Some(2.5), "a scalar is its number");
        assert_eq!(path.get("c").and_then(Value::as_bool), Some(true), "a flag is a flag");
    }

    #[test]
    fn excessive_nesting_is_one_field() {
        let deep = format!("Namespace(a={}, b=2)", "[".repeat(100_000));
        assert_eq!(
            parse(&deep).unwrap().get("b"),
            Some(&Value::Int(2)),
            "the next field is \
            parsed"
        );
    }

    #[test]
    fn hostile_texts_take_linear_time() {
        for piece in ["a=<, ", "a=[1, ", "a=(', ", "a=b'", ", ", "a=", "=", "é"] {
            let text = format!("Namespace({}", piece.repeat(200_000));
            assert!(parse(&text).is_err(), "no end");
        }
    }

    #[test]
    fn malformed_texts_are_refused() {
        for text in ["", "{'a': 1}", "a=1", "namespace(a=1)", "<!doctype html>"] {
            assert!(parse(text).is_err(), "{text}");
        }
        for cut in ["Namespace(", "Namespace(a", "Namespace(a=", "Namespace(a=1", "Namespace(a='x"]
        {
            assert!(parse(cut).is_err(), "{cut}: a truncated file is an error");
        }
    }
}
