//! [`encode`]: bytes as text without characters that are special in HTML: 13 bits in two of the 91
//! printable ASCII characters other than space, `&`, `<` and `>`.
//!
//! 1.231 characters per byte (base64: 1.333). The text is the same in every character encoding that
//! a server may declare for the page.

/// Number of characters.
const BASE: u32 = 91;
/// Bits in two characters: 91² is a little more than 2¹³.
const BITS: u32 = 13;

/// Bytes in one block of text: a whole number of character pairs, about half a megabyte.
pub(crate) const BLOCK: usize = 13 * 32_000;

/// Character of a digit below 91: from `!`, skipping `&`, `<` and `>`.
fn character(digit: u32) -> char {
    #[expect(clippy::cast_possible_truncation, reason = "a digit is below 91")]
    let mut code = b'!' + digit as u8;
    for skipped in [b'&', b'<', b'>'] {
        code += u8::from(code >= skipped);
    }
    char::from(code)
}

/// Text of the bytes.
pub(crate) fn encode(bytes: &[u8], out: &mut String) {
    out.reserve(bytes.len() * 5 / 4 + 2);
    let (mut bits, mut count) = (0_u32, 0);
    let mut pair = |value: u32| out.extend([character(value % BASE), character(value / BASE)]);
    for &byte in bytes {
        bits |= u32::from(byte) << count;
        count += 8;
        if count >= BITS {
            pair(bits & ((1 << BITS) - 1));
            bits >>= BITS;
            count -= BITS;
        }
    }
    if count > 0 {
        pair(bits);
    }
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "bits and bytes of a test")]
mod tests {
    use super::*;

    /// Decoder written from the description: pairs of digits, least
    /// significant first, 13 bits each, lowest bits first.
    fn decode(text: &str, bytes: usize) -> Vec<u8> {
        let digits: Vec<u32> = text
            .chars()
            .map(|c| {
                u32::try_from(
                    ('!'..='~').filter(|c| !"&<>".contains(*c)).position(|d| d == c).unwrap(),
                )
                .unwrap()
            })
            .collect();
        let mut stream = Vec::new();
        for pair in digits.chunks(2) {
            let value = pair[0] + 91 * pair[1];
            stream.extend((0..13).map(|bit| value >> bit & 1));
        }
        stream.chunks(8).take(bytes).map(|b| (0..8).map(|i| (b[i] as u8) << i).sum()).collect()
    }

    #[test]
    fn bytes_round_trip_through_text_without_markup_characters() {
        for length in [0, 1, 2, 12, 13, 14, 1000] {
            let bytes: Vec<u8> =
                (0..length).map(|i: u32| (i * 31 + 7) as u8 ^ (i / 8) as u8).collect();
            let mut text = String::new();
            encode(&bytes, &mut text);
            assert!(text.chars().all(|c| c.is_ascii_graphic() && !"&<>".contains(c)), "{text}");
            assert!(text.len() <= bytes.len() * 16 / 13 + 2, "{length}: {}", text.len());
            assert_eq!(decode(&text, bytes.len()), bytes, "{length} bytes");
        }
    }

    #[test]
    fn digits_skip_html_special_characters() {
        let all: String = (0..BASE).map(character).collect();
        assert_eq!(all.len(), 91, "ascii");
        assert!(
            all.starts_with("!\"#$%'") && all.ends_with("|}~") && all.contains(";=?@"),
            "{all}"
        );
    }
}
