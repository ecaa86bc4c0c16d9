//! The text at the start of a PLY file.

use super::PlyError;
use crate::content::magic::BYTE_ORDER_MARK;
use std::borrow::Cow;
use std::collections::HashSet;

/// Longest accepted header, bytes; real headers have at most a few hundred columns.
pub(crate) const MAX_HEADER: usize = 1 << 20;
/// Largest number of properties of one element; scenes with a
/// feature vector per splat have up to about 600.
pub(crate) const MAX_PROPERTIES: usize = 4096;

/// How the data are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Decimal text.
    Ascii,
    /// Little-endian binary.
    LittleEndian,
    /// Big-endian binary.
    BigEndian,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    /// `char`, `int8`.
    I8,
    /// `uchar`, `uint8`.
    U8,
    /// `short`, `int16`.
    I16,
    /// `ushort`, `uint16`.
    U16,
    /// `int`, `int32`.
    I32,
    /// `uint`, `uint32`.
    U32,
    /// `float`, `float32`.
    F32,
    /// `double`, `float64`.
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number at the start of `bytes`, which have at least [`Scalar::size`] bytes.
    pub(crate) fn read(self, bytes: &[u8], big_endian: bool) -> f64 {
        fn take<const N: usize>(bytes: &[u8], big_endian: bool) -> [u8; N] {
            let mut raw = [0; N];
            raw.copy_from_slice(&bytes[..N]);
            if big_endian {
                raw.reverse();
            }
            raw
        }
        match self {
            Self::I8 => f64::from(i8::from_le_bytes(take(bytes, big_endian))),
            Self::U8 => f64::from(bytes[0]),
            Self::I16 => f64::from(i16::from_le_bytes(take(bytes, big_endian))),
            Self::U16 => f64::from(u16::from_le_bytes(take(bytes, big_endian))),
            Self::I32 => f64::from(i32::from_le_bytes(take(bytes, big_endian))),
            Self::U32 => f64::from(u32::from_le_bytes(take(bytes, big_endian))),
            Self::F32 => f64::from(f32::from_le_bytes(take(bytes, big_endian))),
            Self::F64 => f64::from_le_bytes(take(bytes, big_endian)),
        }
    }
}

/// Type of a property of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PropertyKind {
    /// One number.
    Scalar(Scalar),
    /// A count, followed by that many numbers.
    List {
        /// Type of the count.
        count: Scalar,
        /// Type of the numbers.
        item: Scalar,
    },
}

/// One property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    /// Its name.
    pub name: String,
    /// Its type.
    pub kind: PropertyKind,
}

/// One element: a table of rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    /// Its name.
    pub name: String,
    /// Number of rows.
    pub count: u64,
    /// Columns.
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes of a binary row, if all columns are scalars.
    pub(crate) fn stride(&self) -> Option<usize> {
        self.properties.iter().try_fold(0, |sum, property| match property.kind {
            PropertyKind::Scalar(scalar) => Some(sum + scalar.size()),
            PropertyKind::List { .. } => None,
        })
    }
}

/// The header of a PLY file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// How the data are written.
    pub encoding: Encoding,
    /// Tables, in file order.
    pub elements: Vec<Element>,
    /// Text of `comment` and `obj_info` lines.
    pub comments: Vec<String>,
    /// Where the data start, bytes.
    pub data_start: usize,
}

impl Header {
    /// Parses the header at the start of `bytes`. Lines may end in LF, CRLF or CR; text may begin
    /// with the byte order mark of UTF-8.
    ///
    /// # Errors
    /// If this is not a PLY file or its header is malformed.
    pub fn parse(bytes: &[u8]) -> Result<Self, PlyError> {
        // If the first line ends in CR without LF, all lines do.
        let start = if bytes.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
        let end = match bytes.get(start + 3..start + 5) {
            Some([b'\r', next]) if *next != b'\n' => b'\r',
            _ => b'\n',
        };
        let mut lines = Lines { bytes, position: start, end };
        if lines.next().is_none_or(|line| line.trim_end() != "ply") {
            let found: String = String::from_utf8_lossy(&bytes[..bytes.len().min(12)])
                .chars()
                .map(|c| if c.is_control() { '·' } else { c })
                .collect();
            let found = if found.is_empty() { "no bytes".to_owned() } else { format!("`{found}`") };
            return Err(PlyError::NotPly { found });
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        // Names of the current element's properties; searching the
        // list for each would take quadratic time.
        let mut names: HashSet<String> = HashSet::new();
        let mut comments = Vec::new();
        loop {
            let line = lines.next().ok_or_else(|| {
                PlyError::Header(
                    "no `end_header` line; the file is incomplete or not text at its start"
                        .to_owned(),
                )
            })?;
            let line = line.as_ref();
            match line.split_whitespace().next() {
                None => {}
                Some("end_header") => break,
                Some("format") => encoding = Some(parse_format(line)?),
                Some(keyword @ ("comment" | "obj_info")) => {
                    comments.push(line.trim_start()[keyword.len()..].trim().to_owned());
                }
                Some("element") => {
                    names.clear();
                    elements.push(parse_element(line)?);
                }
                Some("property") => {
                    let element = elements.last_mut().ok_or_else(|| {
                        PlyError::Header(format!("`{}` comes before any element", shown(line)))
                    })?;
                    let property = parse_property(line)?;
                    if element.properties.len() >= MAX_PROPERTIES {
                        return Err(PlyError::Header(format!(
                            "element `{}` declares more than {MAX_PROPERTIES} properties",
                            element.name
                        )));
                    }
                    if !names.insert(property.name.clone()) {
                        return Err(PlyError::Header(format!(
                            "element `{}` declares `{}` twice",
                            element.name, property.name
                        )));
                    }
                    element.properties.push(property);
                }
                Some(_) => return Err(PlyError::Header(format!("unknown line `{}`", shown(line)))),
            }
        }
        let encoding = encoding.ok_or_else(|| PlyError::Header("no `format` line".to_owned()))?;
        Ok(Self { encoding, elements, comments, data_start: lines.position })
    }
}

fn parse_format(line: &str) -> Result<Encoding, PlyError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        ["format", "ascii", "1.0"] => Ok(Encoding::Ascii),
        ["format", "binary_little_endian", "1.0"] => Ok(Encoding::LittleEndian),
        ["format", "binary_big_endian", "1.0"] => Ok(Encoding::BigEndian),
        _ => Err(PlyError::Header(format!(
            "`{}`, expected ascii, binary_little_endian or binary_big_endian, version 1.0",
            shown(line)
        ))),
    }
}

fn parse_element(line: &str) -> Result<Element, PlyError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    if let ["element", name, count] = words[..]
        && let Ok(count) = count.parse()
    {
        return Ok(Element { name: name.to_owned(), count, properties: Vec::new() });
    }
    Err(PlyError::Header(format!("`{}`, expected `element <name> <count>`", shown(line))))
}

fn parse_property(line: &str) -> Result<Property, PlyError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let parsed = match words[..] {
        ["property", "list", count, item, name] => Scalar::parse(count)
            .filter(|count| !matches!(count, Scalar::F32 | Scalar::F64))
            .zip(Scalar::parse(item))
            .map(|(count, item)| (PropertyKind::List { count, item }, name)),
        ["property", scalar, name] => {
            Scalar::parse(scalar).map(|scalar| (PropertyKind::Scalar(scalar), name))
        }
        _ => None,
    };
    parsed.map(|(kind, name)| Property { name: name.to_owned(), kind }).ok_or_else(|| {
        PlyError::Header(format!(
            "`{}`, expected `property <type> <name>` or `property list <type> <type> <name>`",
            shown(line)
        ))
    })
}

/// The start of a line, which may be binary data, for a message.
fn shown(line: &str) -> String {
    line.chars().take(60).map(|c| if c.is_control() { '·' } else { c }).collect()
}

/// Header lines without their line ends; `None` at the end of the bytes or of the allowed length.
struct Lines<'a> {
    bytes: &'a [u8],
    position: usize,
    /// Last byte of a line.
    end: u8,
}

impl<'a> Lines<'a> {
    /// Comments may have any encoding; invalid UTF-8 is replaced.
    fn next(&mut self) -> Option<Cow<'a, str>> {
        let rest = &self.bytes[self.position..self.bytes.len().min(MAX_HEADER).max(self.position)];
        let end = rest.iter().position(|&byte| byte == self.end)?;
        self.position += end + 1;
        Some(String::from_utf8_lossy(rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_headers_of_common_tools() {
        let text = "ply\r\nformat binary_big_endian 1.0\r\ncomment made by  a tool\r\nobj_info x\r\nelement vertex 3\r\nproperty float32 x\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\nDATA";
        let header = Header::parse(text.as_bytes()).unwrap();
        assert_eq!(header.encoding, Encoding::BigEndian, "encoding");
        assert_eq!(header.comments, ["made by  a tool", "x"], "comments");
        assert_eq!(header.elements.len(), 2, "elements");
        assert_eq!(header.elements[0].stride(), Some(4), "fixed rows");
        assert_eq!(header.elements[1].stride(), None, "list rows");
        assert_eq!(&text.as_bytes()[header.data_start..], b"DATA", "data");
        let marked = [BYTE_ORDER_MARK, text.as_bytes()].concat();
        let again = Header::parse(&marked).unwrap();
        assert_eq!(&marked[again.data_start..], b"DATA", "data after a byte order mark");
    }

    #[test]
    fn the_number_of_properties_is_bounded() {
        let header = |count: usize| {
            use std::fmt::Write;
            let mut text = "ply\nformat ascii 1.0\nelement vertex 1\n".to_owned();
            for i in 0..count {
                writeln!(text, "property float p{i}").unwrap();
            }
            Header::parse((text + "end_header\n").as_bytes())
        };
        let most = header(MAX_PROPERTIES).unwrap();
        assert_eq!(most.elements[0].properties.len(), MAX_PROPERTIES, "the most");
        let error = header(MAX_PROPERTIES + 1).unwrap_err().to_string();
        assert!(error.contains("more than 4096 properties"), "{error}");
        let again = "ply\nformat ascii 1.0\nelement a 1\nproperty int x\nelement b 1\nproperty int x\nend_header\n";
        assert!(Header::parse(again.as_bytes()).is_ok(), "names are local to an element");
    }

    #[test]
    fn broken_headers_are_refused() {
        for (text, needle) in [
            ("", "no bytes"),
            ("glTF\n", "not a PLY"),
            ("ply\nformat ascii 1.0\nelement vertex 1\n", "end_header"),
            ("ply\nelement vertex 1\nend_header\n", "no `format`"),
            ("ply\nformat ascii 2.0\nend_header\n", "version 1.0"),
            ("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "before any element"),
            ("ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "<count>"),
            ("ply\nformat ascii 1.0\nelement v 1\nproperty quad x\nend_header\n", "<type>"),
            (
                "ply\nformat ascii 1.0\nelement v 1\nproperty float x\nproperty int x\nend_header\n",
                "twice",
            ),
            (
                "ply\nformat ascii 1.0\nelement v 1\nproperty list float int x\nend_header\n",
                "<type>",
            ),
            ("ply\nformat ascii 1.0\nwhat\nend_header\n", "unknown line"),
        ] {
            let error = Header::parse(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(needle), "{text:?}: {error}");
        }
    }
}
