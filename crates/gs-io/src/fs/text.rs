//! Decoding of text files: UTF-8 with or without a byte order mark,
//! or UTF-16 (Windows Notepad and PowerShell).

use std::borrow::Cow;

/// Joins two bytes to a unit of UTF-16.
type Unit = fn([u8; 2]) -> u16;

/// The text of a file. Invalid characters are replaced.
pub(crate) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    if let Some(rest) = bytes.strip_prefix(b"\xef\xbb\xbf") {
        return String::from_utf8_lossy(rest);
    }
    // Without a byte order mark, UTF-16 is recognised by zeros in every second byte, because all
    // formats here begin with Latin characters.
    let unit: Option<(&[u8], Unit)> = match *bytes {
        [0xff, 0xfe, ref rest @ ..] => Some((rest, u16::from_le_bytes)),
        [0xfe, 0xff, ref rest @ ..] => Some((rest, u16::from_be_bytes)),
        [1..=255, 0, 1..=255, 0, ..] => Some((bytes, u16::from_le_bytes)),
        [0, 1..=255, 0, 1..=255, ..] => Some((bytes, u16::from_be_bytes)),
        _ => None,
    };
    let Some((rest, unit)) = unit else { return String::from_utf8_lossy(bytes) };
    let units: Vec<u16> = rest.as_chunks::<2>().0.iter().map(|&pair| unit(pair)).collect();
    Cow::Owned(String::from_utf16_lossy(&units))
}

/// As [`decode`], for parsers of bytes.
pub(crate) fn utf8(bytes: &[u8]) -> Cow<'_, [u8]> {
    match decode(bytes) {
        Cow::Borrowed(text) => Cow::Borrowed(text.as_bytes()),
        Cow::Owned(text) => Cow::Owned(text.into_bytes()),
    }
}

/// Non-finite numbers as printed by Python and JavaScript, which JSON does not allow.
const NOT_JSON: [&[u8]; 3] = [b"-Infinity", b"Infinity", b"NaN"];

/// As [`utf8`], for parsers of JSON: numbers that JSON does not allow become
/// `null`, so that they invalidate only one value.
pub(crate) fn json(bytes: &[u8]) -> Cow<'_, [u8]> {
    let text = utf8(bytes);
    if !NOT_JSON[1..].iter().any(|word| text.windows(word.len()).any(|found| found == *word)) {
        return text;
    }
    let mut out = Vec::with_capacity(text.len());
    let (mut rest, mut quoted) = (&text[..], false);
    while let Some((&byte, after)) = rest.split_first() {
        let word = NOT_JSON.iter().find(|word| !quoted && rest.starts_with(word));
        if let Some(word) = word {
            out.extend_from_slice(b"null");
            rest = &rest[word.len()..];
            continue;
        }
        out.push(byte);
        rest = after;
        match byte {
            b'"' => quoted = !quoted,
            b'\\' => {
                // An escaped character does not end the string.
                if let Some((&escaped, after)) = rest.split_first() {
                    out.push(escaped);
                    rest = after;
                }
            }
            _ => {}
        }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn non_finite_numbers_become_null() {
        for (text, expected) in [
            (r#"{"a": NaN, "b": [-Infinity, Infinity]}"#, r#"{"a": null, "b": [null, null]}"#),
            (r#"["NaN", "a \" NaN", NaN]"#, r#"["NaN", "a \" NaN", null]"#),
            (r#"["\\", NaN]"#, r#"["\\", null]"#),
            ("[1]", "[1]"),
            ("\"\\", "\"\\"),
        ] {
            assert_eq!(String::from_utf8_lossy(&json(text.as_bytes())), expected, "{text}");
        }
    }

    #[test]
    fn text_encodings_are_detected() {
        let text = "Namespace(a='椅子')";
        let utf16: Vec<u16> = text.encode_utf16().collect();
        let little: Vec<u8> = utf16.iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = utf16.iter().flat_map(|unit| unit.to_be_bytes()).collect();
        let with = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
        for (bytes, how) in [
            (text.as_bytes().to_vec(), "UTF-8"),
            (with(b"\xef\xbb\xbf", text.as_bytes()), "with a byte order mark"),
            (with(b"\xff\xfe", &little), "UTF-16, little-endian"),
            (with(b"\xfe\xff", &big), "UTF-16, big-endian"),
            (little, "UTF-16 without a byte order mark"),
            (big, "UTF-16, big-endian, without a byte order mark"),
        ] {
            assert_eq!(decode(&bytes), text, "{how}");
            assert_eq!(&*utf8(&bytes), text.as_bytes(), "{how}");
        }
        assert_eq!(decode(b"caf\xe9"), "caf\u{fffd}", "Latin-1 stays readable");
        assert_eq!(decode(b""), "", "nothing");
    }
}
