//! HTTP/1.1 requests and responses, one per connection.

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Maximum size of a request head, bytes.
const MAX_HEAD: usize = 16 * 1024;
/// Maximum size of a request body, bytes; a selection of many spheres takes a few kilobytes.
const MAX_BODY: usize = 64 * 1024;
/// Maximum number of headers.
const MAX_HEADERS: usize = 64;
/// Maximum number of bytes of a refused request that are read and dropped before the connection
/// closes.
const MAX_DROPPED: usize = 1024 * 1024;
/// Time limit for reading and dropping them.
const LINGER: Duration = Duration::from_millis(500);
/// Timeout for a complete request.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);

/// A complete request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Request {
    pub(super) method: String,
    /// Part of the target before `?`.
    pub(super) path: String,
    /// Part of the target after `?`, or empty.
    pub(super) query: String,
    pub(super) host: Option<String>,
    pub(super) origin: Option<String>,
    pub(super) body: Vec<u8>,
}

/// A response.
#[derive(Debug)]
pub(super) struct Response {
    pub(super) status: u16,
    pub(super) content_type: &'static str,
    pub(super) body: Vec<u8>,
}

impl Response {
    pub(super) fn html(text: String) -> Self {
        Self { status: 200, content_type: "text/html; charset=utf-8", body: text.into_bytes() }
    }

    pub(super) fn bytes(body: Vec<u8>) -> Self {
        Self { status: 200, content_type: "application/octet-stream", body }
    }

    pub(super) fn json(value: &serde_json::Value) -> Self {
        let body = value.to_string().into_bytes();
        Self { status: 200, content_type: "application/json", body }
    }

    /// An error response with its reason.
    pub(super) fn refusal(status: u16, reason: impl std::fmt::Display) -> Self {
        let body = reason.to_string().into_bytes();
        Self { status, content_type: "text/plain; charset=utf-8", body }
    }

    /// Writes the response, with headers that forbid caching, framing and access by other sites.
    pub(super) fn write(&self, stream: &mut TcpStream) -> std::io::Result<()> {
        let reason = match self.status {
            200 => "OK",
            400 => "Bad Request",
            403 => "Forbidden",
            404 => "Not Found",
            405 => "Method Not Allowed",
            408 => "Request Timeout",
            411 => "Length Required",
            413 => "Content Too Large",
            503 => "Service Unavailable",
            _ => "Error",
        };
        let head = format!(
            "HTTP/1.1 {} {reason}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\nContent-Security-Policy: frame-ancestors 'none'\r\n\r\n",
            self.status,
            self.content_type,
            self.body.len(),
        );
        stream.write_all(head.as_bytes())?;
        stream.write_all(&self.body)?;
        stream.flush()
    }
}

/// Closes a connection after its response. Remaining input is read and dropped for a limited time,
/// because closing a connection with unread bytes resets it, and the response may be lost.
pub(super) fn close(mut stream: TcpStream) {
    if stream.shutdown(Shutdown::Write).is_err() || stream.set_read_timeout(Some(LINGER)).is_err() {
        return;
    }
    let (deadline, mut left) = (Instant::now() + LINGER, MAX_DROPPED);
    let mut chunk = [0; 4096];
    while left > 0 && Instant::now() < deadline {
        match stream.read(&mut chunk) {
            Ok(count) if count > 0 => left = left.saturating_sub(count),
            _ => return,
        }
    }
}

/// A request head, and the length of the body that follows.
#[derive(Debug)]
struct Head {
    request: Request,
    length: usize,
}

/// Reads one request; malformed, too large and too slow ones are refused. `None` if the connection
/// was closed before the request began.
pub(super) fn read(stream: &mut TcpStream) -> Result<Option<Request>, Response> {
    let deadline = Instant::now() + REQUEST_TIMEOUT;
    let mut received = Vec::new();
    let (end, head) = loop {
        if let Some(found) = parse(&received)? {
            break found;
        }
        if received.len() > MAX_HEAD {
            return Err(Response::refusal(413, "the request's head is too long"));
        }
        if fill(stream, &mut received, deadline)? == 0 {
            return if received.is_empty() {
                Ok(None)
            } else {
                Err(Response::refusal(400, "the request is incomplete"))
            };
        }
    };
    let mut request = head.request;
    while received.len() < end + head.length {
        if fill(stream, &mut received, deadline)? == 0 {
            return Err(Response::refusal(400, "the request is incomplete"));
        }
    }
    request.body = received[end..end + head.length].to_vec();
    Ok(Some(request))
}

/// Reads more bytes; returns their number.
fn fill(
    stream: &mut TcpStream,
    received: &mut Vec<u8>,
    deadline: Instant,
) -> Result<usize, Response> {
    let late = || Response::refusal(408, "the request took too long");
    let left = deadline.checked_duration_since(Instant::now()).filter(|left| !left.is_zero());
    let left = left.ok_or_else(late)?;
    let mut chunk = [0; 4096];
    let read = stream.set_read_timeout(Some(left)).and_then(|()| stream.read(&mut chunk));
    match read {
        Ok(count) => {
            received.extend_from_slice(&chunk[..count]);
            Ok(count)
        }
        Err(error) if error.kind() == ErrorKind::Interrupted => Ok(1),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
            Err(late())
        }
        Err(error) => Err(Response::refusal(400, error)),
    }
}

/// The head at the start of `received` and its length in bytes, if it is complete.
fn parse(received: &[u8]) -> Result<Option<(usize, Head)>, Response> {
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    let bad = |reason: &str| Response::refusal(400, reason);
    let end = match parsed.parse(received) {
        Ok(httparse::Status::Complete(end)) => end,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(error) => return Err(Response::refusal(400, error)),
    };
    let header = |name: &str| -> Result<Option<String>, Response> {
        let mut found =
            parsed.headers.iter().filter(|header| header.name.eq_ignore_ascii_case(name));
        let Some(first) = found.next() else { return Ok(None) };
        if found.next().is_some() {
            return Err(bad("a header is repeated"));
        }
        let text = std::str::from_utf8(first.value)
            .map_err(|error| bad(&format!("a header is not text: {error}")))?;
        Ok(Some(text.trim().to_owned()))
    };
    if header("transfer-encoding")?.is_some() {
        return Err(Response::refusal(411, "the request has no length"));
    }
    let length = match header("content-length")? {
        Some(text) if text.bytes().all(|byte| byte.is_ascii_digit()) && !text.is_empty() => {
            text.parse::<usize>().unwrap_or(usize::MAX)
        }
        Some(_) => return Err(bad("the length is not a number")),
        None => 0,
    };
    if length > MAX_BODY {
        return Err(Response::refusal(413, "the request is too long"));
    }
    let target = parsed.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let request = Request {
        method: parsed.method.unwrap_or_default().to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        host: header("host")?,
        origin: header("origin")?,
        body: Vec::new(),
    };
    Ok(Some((end, Head { request, length })))
}

impl Request {
    /// Value of a query parameter.
    pub(super) fn value(&self, name: &str) -> Option<&str> {
        self.query.split('&').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(text: &str) -> Option<u16> {
        parse(text.as_bytes()).err().map(|refusal| refusal.status)
    }

    #[test]
    fn heads_are_read_or_refused() {
        let text = "POST /a/b?scene=1&row=22 HTTP/1.1\r\nHost: x:1\r\nContent-Length: 3\r\n\r\nabc";
        let (end, head) = parse(text.as_bytes()).unwrap().unwrap();
        assert_eq!(&text[end..], "abc", "the head ends at the empty line");
        assert_eq!((head.request.path.as_str(), head.length), ("/a/b", 3), "path and length");
        assert_eq!(head.request.value("row"), Some("22"), "query");
        assert_eq!(head.request.value("ro"), None, "no part of a name");
        assert!(parse(b"GET / HTTP/1.1\r\nHo").unwrap().is_none(), "incomplete");
        assert_eq!(status("GET\r\n\r\n"), Some(400), "malformed");
        assert_eq!(status("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"), Some(400), "repeated");
        let chunked = "POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n";
        assert_eq!(status(chunked), Some(411), "chunked");
        let long = "POST / HTTP/1.1\r\nContent-Length: 99999999999999999999999\r\n\r\n";
        assert_eq!(status(long), Some(413), "too long");
        assert_eq!(status("POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n"), Some(400), "negative");
    }
}
