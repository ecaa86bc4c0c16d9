//! Access control: only requests of the page itself are answered.
//!
//! The server listens on 127.0.0.1, but any page in the browser can send requests there, and other
//! users of the machine can connect. Therefore the URL contains a secret token; the host must be
//! this machine, which rejects foreign names that resolve to 127.0.0.1 (DNS rebinding); and the
//! `Origin` header, if present, must be the page's own.

use super::http::{Request, Response};
use crate::failure::{Failure, Outcome};
use std::fmt::Write as _;

/// Length of a token, bytes.
const TOKEN_BYTES: usize = 16;
/// Names of this machine. The port is not compared, because forwarding may change it.
const HOSTS: [&str; 3] = ["127.0.0.1", "localhost", "[::1]"];

/// The secret part of the page's URL.
#[derive(Debug, Clone)]
pub(super) struct Token(String);

impl Token {
    /// A new token from the operating system's random numbers.
    pub(super) fn random() -> Outcome<Self> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)
            .map_err(|error| Failure::failed(format!("no random numbers for a token: {error}")))?;
        let mut text = String::new();
        for byte in bytes {
            let _ = write!(text, "{byte:02x}");
        }
        Ok(Self(text))
    }

    pub(super) fn as_str(&self) -> &str {
        &self.0
    }

    /// Compares in constant time.
    fn is(&self, given: &str) -> bool {
        let differences = self.0.bytes().zip(given.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
        given.len() == self.0.len() && differences == 0
    }
}

/// The path of the request after the token.
pub(super) fn admit<'a>(request: &'a Request, token: &Token) -> Result<&'a str, Response> {
    let Some(host) = &request.host else {
        return Err(Response::refusal(400, "the request has no host"));
    };
    let name = host.rsplit_once(':').map_or(host.as_str(), |(name, port)| {
        if port.bytes().all(|byte| byte.is_ascii_digit()) { name } else { host }
    });
    if !HOSTS.iter().any(|own| name.eq_ignore_ascii_case(own)) {
        return Err(Response::refusal(403, "the host is not this machine"));
    }
    let own = |origin: &String| origin.eq_ignore_ascii_case(&format!("http://{host}"));
    let is_read = request.method == "GET";
    match &request.origin {
        Some(origin) if !own(origin) => {
            return Err(Response::refusal(403, "the request comes from a different page"));
        }
        None if !is_read => return Err(Response::refusal(403, "the request has no origin")),
        _ => {}
    }
    if !is_read && request.method != "POST" {
        return Err(Response::refusal(405, "expected GET or POST"));
    }
    let rest = request.path.strip_prefix('/').and_then(|path| path.split_once('/'));
    match rest {
        Some((given, rest)) if token.is(given) => Ok(rest),
        _ => Err(Response::refusal(404, "the address has no valid token")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(method: &str, path: &str, host: &str, origin: Option<&str>) -> Option<u16> {
        let request = Request {
            method: method.to_owned(),
            path: path.to_owned(),
            query: String::new(),
            host: Some(host.to_owned()),
            origin: origin.map(str::to_owned),
            body: Vec::new(),
        };
        admit(&request, &Token("abc".to_owned())).err().map(|refusal| refusal.status)
    }

    #[test]
    fn only_requests_from_the_page_are_answered() {
        for host in ["127.0.0.1:8000", "localhost:9", "LOCALHOST", "[::1]:80"] {
            assert_eq!(status("GET", "/abc/x", host, None), None, "{host}");
        }
        for host in ["evil.example:8000", "127.0.0.1.evil.example", "localhost.", "", "::1"] {
            assert_eq!(status("GET", "/abc/x", host, None), Some(403), "{host}");
        }
        let local = "127.0.0.1:80";
        assert_eq!(status("POST", "/abc/x", local, Some("http://127.0.0.1:80")), None, "own");
        for origin in ["http://evil.example", "null", "https://127.0.0.1:80", "http://127.0.0.1:81"]
        {
            assert_eq!(status("POST", "/abc/x", local, Some(origin)), Some(403), "{origin}");
            assert_eq!(status("GET", "/abc/x", local, Some(origin)), Some(403), "{origin}");
        }
        assert_eq!(status("POST", "/abc/x", local, None), Some(403), "no origin");
        assert_eq!(status("PUT", "/abc/x", local, Some("http://127.0.0.1:80")), Some(405), "PUT");
        for path in ["/", "/abd/x", "/ab/x", "/abcd/x", "/abc", "abc/x", ""] {
            assert_eq!(status("GET", path, local, None), Some(404), "{path}");
        }
    }

    #[test]
    fn tokens_are_long_and_different() {
        let [a, b] = [(); 2].map(|()| Token::random().unwrap());
        assert_eq!(a.as_str().len(), 2 * TOKEN_BYTES, "hexadecimal");
        assert_ne!(a.as_str(), b.as_str(), "random");
        assert!(a.is(a.as_str()) && !a.is(b.as_str()), "compared");
    }
}
