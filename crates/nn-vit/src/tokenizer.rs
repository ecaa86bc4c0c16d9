//! CLIP's byte-pair encoding.

use crate::NetworkError;
use std::collections::HashMap;

/// Number of tokens of an encoded text, with start, end and padding.
pub const CONTEXT: usize = 77;
/// Number of merges of CLIP's vocabulary.
const MERGES: usize = 49_152 - 256 - 2;
/// End of a word.
const END: &str = "</w>";
const START_OF_TEXT: &str = "<|startoftext|>";
const END_OF_TEXT: &str = "<|endoftext|>";

/// CLIP's byte-pair encoding.
///
/// Sennrich et al. 2016, Neural Machine Translation of Rare Words with Subword Units.
#[derive(Debug, Clone)]
pub struct Tokenizer {
    ids: HashMap<String, u32>,
    ranks: HashMap<(String, String), usize>,
}

impl Tokenizer {
    /// The encoding of a list of merges, one per line: `bpe_simple_vocab_16e6.txt` or `merges.txt`.
    ///
    /// # Errors
    /// If a line is malformed, or there are too few.
    pub fn from_merges(text: &str) -> Result<Self, NetworkError> {
        // The first line is a title.
        let lines = text.lines().enumerate().skip(1);
        let mut merges = Vec::with_capacity(MERGES);
        for (at, line) in lines.filter(|(_, line)| !line.is_empty()).take(MERGES) {
            let pair = line.split_once(' ').filter(|(_, second)| !second.contains(' '));
            let malformed = || NetworkError::Merge { line: at + 1, text: line.to_owned() };
            let (first, second) = pair.ok_or_else(malformed)?;
            merges.push((first.to_owned(), second.to_owned()));
        }
        if merges.len() < MERGES {
            return Err(NetworkError::FewMerges { found: merges.len(), expected: MERGES });
        }
        let bytes = byte_symbols();
        let mut order: Vec<u8> = (0..=255).collect();
        order.sort_by_key(|&byte| (!is_printable(byte), byte));
        let symbols = || order.iter().map(|&byte| bytes[byte as usize].to_string());
        let names = symbols()
            .chain(symbols().map(|symbol| symbol + END))
            .chain(merges.iter().map(|(first, second)| format!("{first}{second}")))
            .chain([START_OF_TEXT, END_OF_TEXT].map(str::to_owned));
        let ids = names.zip(0..).collect();
        let ranks = merges.into_iter().zip(0..).collect();
        Ok(Self { ids, ranks })
    }

    fn id(&self, symbol: &str) -> u32 {
        self.ids.get(symbol).copied().unwrap_or_default()
    }

    /// Token ids of start, text and end, then zeros; a text that is too long is truncated. Unlike
    /// in the original code, HTML entities and broken Unicode are not repaired.
    pub fn encode(&self, text: &str) -> [u32; CONTEXT] {
        let mut tokens = [0; CONTEXT];
        tokens[0] = self.id(START_OF_TEXT);
        let mut len = 1;
        let lower = text.to_lowercase();
        for id in words(&lower).flat_map(|word| self.word(word)) {
            if len == CONTEXT - 1 {
                break;
            }
            tokens[len] = id;
            len += 1;
        }
        tokens[len] = self.id(END_OF_TEXT);
        tokens
    }

    /// Tokens of a word: the pair with the smallest rank is merged until none is left.
    fn word(&self, word: &str) -> Vec<u32> {
        let bytes = byte_symbols();
        let mut symbols: Vec<String> =
            word.bytes().map(|byte| bytes[byte as usize].to_string()).collect();
        if let Some(last) = symbols.last_mut() {
            last.push_str(END);
        }
        loop {
            let rank =
                |pair: &[String]| self.ranks.get(&(pair[0].clone(), pair[1].clone())).copied();
            let best = symbols.windows(2).filter_map(|pair| Some((rank(pair)?, pair))).min();
            let Some((_, pair)) = best else { break };
            let [first, second] = [pair[0].clone(), pair[1].clone()];
            let mut merged = Vec::with_capacity(symbols.len());
            let mut at = 0;
            while at < symbols.len() {
                if symbols[at] == first && symbols.get(at + 1) == Some(&second) {
                    merged.push(format!("{first}{second}"));
                    at += 2;
                } else {
                    merged.push(symbols[at].clone());
                    at += 1;
                }
            }
            symbols = merged;
        }
        symbols.iter().map(|symbol| self.id(symbol)).collect()
    }
}

/// Whether a byte is represented by its own character.
fn is_printable(byte: u8) -> bool {
    matches!(byte, b'!'..=b'~' | 0xa1..=0xac | 0xae..=0xff)
}

/// A printable character for each byte.
fn byte_symbols() -> [char; 256] {
    let mut symbols = ['\0'; 256];
    let mut next = 256;
    for byte in 0..=255_u8 {
        let code = if is_printable(byte) {
            u32::from(byte)
        } else {
            next += 1;
            next - 1
        };
        symbols[usize::from(byte)] = char::from_u32(code).unwrap_or_default();
    }
    symbols
}

/// Splits a text as CLIP's regular expression does: contractions, letters, single digits, other
/// characters; white space separates.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let mut rest = text;
    std::iter::from_fn(move || {
        rest = rest.trim_start();
        let first = rest.chars().next()?;
        let len = [START_OF_TEXT, END_OF_TEXT, "'s", "'t", "'re", "'ve", "'m", "'ll", "'d"]
            .iter()
            .find(|special| rest.starts_with(**special))
            .map_or_else(|| run(rest, first), |special| special.len());
        let (word, after) = rest.split_at(len);
        rest = after;
        Some(word)
    })
}

/// Length of the run that begins with `first`, bytes.
fn run(text: &str, first: char) -> usize {
    let other = |c: char| !c.is_whitespace() && !c.is_alphabetic() && !c.is_numeric();
    let length = |belongs: &dyn Fn(char) -> bool| text.find(|c| !belongs(c)).unwrap_or(text.len());
    if first.is_alphabetic() {
        length(&char::is_alphabetic)
    } else if first.is_numeric() {
        first.len_utf8()
    } else {
        length(&other)
    }
}
