//! [`Record`]: the files of a folder as this program wrote them, so
//! that other files in it are never removed.

use super::reservation::{hidden_name, is_temporary};
use super::special_name;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Name of a record inside its folder.
const INSIDE: &str = ".c4d-files";
/// Bytes read at a time.
const CHUNK: usize = 1 << 20;

/// Whether a name is for internal use and is not an output: a
/// record, or a leftover of a killed process.
pub(crate) fn is_bookkeeping(name: &str) -> bool {
    name == INSIDE || name.starts_with('.') && name.ends_with(INSIDE) || is_temporary(name)
}

/// Location of a folder's record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RecordLocation {
    /// In the folder, so that it moves with the folder.
    Inside,
    /// Next to the folder, for folders in which other programs interpret every file.
    NextTo,
}

impl RecordLocation {
    /// The record of `folder`.
    pub(super) fn of(self, folder: &Path) -> PathBuf {
        match self {
            Self::Inside => folder.join(INSIDE),
            Self::NextTo => {
                let name = folder.file_name().unwrap_or_default();
                folder.with_file_name(hidden_name(name, INSIDE))
            }
        }
    }
}

/// Size and checksum, by which a changed file is recognised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Stamp {
    bytes: u64,
    crc32: u32,
}

impl Stamp {
    /// Stamp of a file that grows while it is written, and whose content is not compared.
    pub(super) const GROWING: Self = Self { bytes: u64::MAX, crc32: 0 };

    pub(super) fn of_bytes(bytes: &[u8]) -> Self {
        Self { bytes: bytes.len() as u64, crc32: crc32fast::hash(bytes) }
    }

    pub(super) fn of_file(path: &Path) -> io::Result<Self> {
        let (mut file, mut hasher) = (File::open(path)?, crc32fast::Hasher::new());
        let (mut buffer, mut bytes) = (vec![0; CHUNK], 0);
        loop {
            let read = file.read(&mut buffer)?;
            if read == 0 {
                return Ok(Self { bytes, crc32: hasher.finalize() });
            }
            hasher.update(&buffer[..read]);
            bytes += read as u64;
        }
    }
}

/// One line of a record.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    /// Relative to the folder, with `/`.
    path: String,
    #[serde(flatten)]
    stamp: Stamp,
}

/// The files of a folder, at every depth. A rewritten file has several stamps: the
/// new one is added before the file is moved into place, so that the file is
/// recognised even if the process is killed in between.
#[derive(Debug, Default)]
pub(super) struct Record(HashMap<String, Vec<Stamp>>);

/// Why a folder is not replaced.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct UnrecordedEntry {
    /// Relative to the folder.
    pub(super) entry: String,
    /// Predicate about the entry, to complete a sentence.
    pub(super) what: &'static str,
}

impl Record {
    /// Reads a record. Invalid lines are skipped, such as the last one if its writer was killed.
    pub(super) fn read(path: &Path) -> Self {
        let mut record = Self::default();
        if !fs::symlink_metadata(path).is_ok_and(|found| found.is_file()) {
            return record;
        }
        let text = fs::read(path).unwrap_or_default();
        for line in String::from_utf8_lossy(&text).lines() {
            if let Ok(Line { path, stamp }) = serde_json::from_str(line) {
                record.0.entry(path).or_default().push(stamp);
            }
        }
        record
    }

    /// The current files of `folder`.
    pub(super) fn of_folder(folder: &Path) -> io::Result<Self> {
        let mut record = Self::default();
        record.add_folder(folder, "")?;
        Ok(record)
    }

    fn add_folder(&mut self, folder: &Path, prefix: &str) -> io::Result<()> {
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if is_bookkeeping(&name) {
                continue;
            }
            let path = format!("{prefix}{name}");
            if entry.file_type()?.is_dir() {
                self.add_folder(&entry.path(), &format!("{path}/"))?;
            } else {
                self.0.entry(path).or_default().push(Stamp::of_file(&entry.path())?);
            }
        }
        Ok(())
    }

    /// The record as text, lines in the order of their paths.
    fn text(&self) -> io::Result<String> {
        let mut entries: Vec<_> = self.0.iter().collect();
        entries.sort_by_key(|(path, _)| *path);
        let mut text = String::new();
        for (path, stamps) in entries {
            for &stamp in stamps {
                let line = serde_json::to_string(&Line { path: path.clone(), stamp })?;
                // Writing to a string cannot fail.
                let _ = writeln!(text, "{line}");
            }
        }
        Ok(text)
    }

    /// Appends the entries to the file `path`; must be called
    /// before their files are moved into place.
    pub(super) fn append(&self, path: &Path) -> io::Result<()> {
        if fs::symlink_metadata(path).is_ok_and(|found| !found.is_file()) {
            return Err(io::Error::other("the record of the folder's files is not a file"));
        }
        let mut file = File::options().create(true).append(true).open(path)?;
        // Begins with a line break, in case the previous line is truncated.
        file.write_all(format!("\n{}", self.text()?).as_bytes())?;
        file.sync_all()
    }

    /// Writes the file `path` with exactly these entries.
    pub(super) fn write(&self, path: &Path) -> io::Result<()> {
        fs::write(path, self.text()?)
    }

    /// A record of one file.
    pub(super) fn of_one(path: &str, stamp: Stamp) -> Self {
        Self(HashMap::from([(path.to_owned(), vec![stamp])]))
    }

    fn sizes_fit(&self, path: &str, bytes: u64) -> bool {
        let fits = |stamp: &Stamp| stamp.bytes == bytes || *stamp == Stamp::GROWING;
        self.stamps(path).iter().any(fits)
    }

    /// Whether this program wrote a file with this path and stamp.
    pub(super) fn contains(&self, path: &str, stamp: Stamp) -> bool {
        let stamps = self.stamps(path);
        stamps.contains(&stamp) || stamps.contains(&Stamp::GROWING)
    }

    fn stamps(&self, path: &str) -> &[Stamp] {
        self.0.get(path).map_or(&[], Vec::as_slice)
    }

    fn has_folder(&self, path: &str) -> bool {
        let within =
            |other: &String| other.strip_prefix(path).is_some_and(|rest| rest.starts_with('/'));
        self.0.keys().any(within)
    }
}

/// How files are compared with their records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compare {
    /// By name, size and checksum.
    Content,
    /// By name and size.
    Sizes,
}

/// The first entry of `folder` that differs from what this program wrote, if any. `recorded_as` is
/// the folder's path for a record next to it.
pub(super) fn unrecorded_entry(
    folder: &Path,
    recorded_as: &Path,
    compare: Compare,
) -> io::Result<Option<UnrecordedEntry>> {
    let next_to = Record::read(&RecordLocation::NextTo.of(recorded_as));
    let mut walk = Walk { records: vec![(String::new(), next_to)], compare };
    walk.folder(folder, "")
}

struct Walk {
    /// Records of the enclosing folders, with their paths. A nested folder written by this program
    /// may have been rewritten since, and has its own record.
    records: Vec<(String, Record)>,
    compare: Compare,
}

impl Walk {
    fn folder(&mut self, folder: &Path, prefix: &str) -> io::Result<Option<UnrecordedEntry>> {
        let mut entries = fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
        entries.sort_by_key(fs::DirEntry::file_name);
        self.records.push((prefix.to_owned(), Record::read(&RecordLocation::Inside.of(folder))));
        for entry in entries {
            let name = entry.file_name().to_string_lossy().into_owned();
            let kind = entry.file_type()?;
            let path = format!("{prefix}{name}");
            let unrecorded = |what| Ok(Some(UnrecordedEntry { entry: path.clone(), what }));
            if !kind.is_dir() && !kind.is_file() {
                let what = if kind.is_symlink() { "is a link" } else { special(kind) };
                return unrecorded(what);
            }
            if is_bookkeeping(&name) {
                continue;
            }
            if kind.is_dir() {
                let own = format!("{path}/");
                if !self.any_record(&path, Record::has_folder)
                    && Record::read(&RecordLocation::Inside.of(&entry.path())).0.is_empty()
                {
                    return unrecorded(UNKNOWN);
                }
                if let Some(found) = self.folder(&entry.path(), &own)? {
                    return Ok(Some(found));
                }
                continue;
            }
            if !self.any_record(&path, |record, path| !record.stamps(path).is_empty()) {
                return unrecorded(UNKNOWN);
            }
            let bytes = entry.metadata()?.len();
            let same = self.any_record(&path, |record, path| record.sizes_fit(path, bytes))
                && (self.compare == Compare::Sizes || {
                    let stamp = Stamp::of_file(&entry.path())?;
                    self.any_record(&path, |record, path| record.contains(path, stamp))
                });
            if !same {
                return unrecorded("was changed since");
            }
        }
        self.records.pop();
        Ok(None)
    }

    /// Whether `test` is true for `path`, relative to the record's folder, in any record.
    fn any_record(&self, path: &str, test: impl Fn(&Record, &str) -> bool) -> bool {
        self.records.iter().any(|(prefix, record)| {
            path.strip_prefix(prefix).is_some_and(|path| test(record, path))
        })
    }
}

const UNKNOWN: &str = "was not written by it";

fn special(kind: fs::FileType) -> &'static str {
    match special_name(kind) {
        "a FIFO" => "is a FIFO",
        "a socket" => "is a socket",
        "a device" => "is a device",
        _ => UNKNOWN,
    }
}
