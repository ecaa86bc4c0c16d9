//! [`Record`]: the files of a folder as this program wrote them, so that nothing else in it is ever
//! removed.

use super::reservation::{hidden_name, is_temporary};
use super::special_name;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Name of a record in the folder that it is of.
const INSIDE: &str = ".c4d-files";
/// Bytes read at a time.
const CHUNK: usize = 1 << 20;

/// Whether a name is one that this program uses for itself, and that holds no output: a record, or
/// what a killed process left.
pub(crate) fn is_bookkeeping(name: &str) -> bool {
    name == INSIDE || name.starts_with('.') && name.ends_with(INSIDE) || is_temporary(name)
}

/// Where the record of a folder lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// In the folder, so that it goes where the folder goes.
    Inside,
    /// Beside it: for folders that other programs read, and in which they take every file for one
    /// of theirs.
    Beside,
}

impl Place {
    /// The record of `folder`.
    pub(super) fn of(self, folder: &Path) -> PathBuf {
        match self {
            Self::Inside => folder.join(INSIDE),
            Self::Beside => {
                let name = folder.file_name().unwrap_or_default();
                folder.with_file_name(hidden_name(name, INSIDE))
            }
        }
    }
}

/// What tells a file from a changed one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Stamp {
    bytes: u64,
    crc32: u32,
}

impl Stamp {
    /// Of a file that grows while it is written, and whose content is not compared.
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

/// The files of a folder, at every depth. A file that was rewritten has several stamps: the new one
/// is added before the file is put in place, so that a process killed in between leaves a file that
/// is recognised either way.
#[derive(Debug, Default)]
pub(super) struct Record(HashMap<String, Vec<Stamp>>);

/// Why a folder is not replaced.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct UnrecordedEntry {
    /// Relative to the folder.
    pub(super) entry: String,
    /// What is known of it.
    pub(super) what: &'static str,
}

impl Record {
    /// Reads a record. Lines that are no entries are skipped, as is the last one if its writer was
    /// killed.
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

    /// The files that are in `folder` now.
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

    /// Adds the entries to the end of the file `path`, before the files they are of are put in
    /// place.
    pub(super) fn append(&self, path: &Path) -> io::Result<()> {
        if fs::symlink_metadata(path).is_ok_and(|found| !found.is_file()) {
            return Err(io::Error::other("the record of the folder's files is not a file"));
        }
        let mut file = File::options().create(true).append(true).open(path)?;
        // After a line that was cut short, the next one begins on a line of its own.
        file.write_all(format!("\n{}", self.text()?).as_bytes())?;
        file.sync_all()
    }

    /// Writes the entries, and no others, to the file `path`.
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

    /// Whether a file of this path and stamp is one that this program wrote.
    pub(super) fn knows(&self, path: &str, stamp: Stamp) -> bool {
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

/// How closely files are compared with their records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compare {
    /// By name, size and checksum.
    Content,
    /// By name and size.
    Sizes,
}

/// The first entry of `folder` that this program did not write as it is, if there is one.
/// `recorded_as` is the folder's path as far as a record beside it is concerned.
pub(super) fn unrecorded_entry(
    folder: &Path,
    recorded_as: &Path,
    compare: Compare,
) -> io::Result<Option<UnrecordedEntry>> {
    let beside = Record::read(&Place::Beside.of(recorded_as));
    let mut walk = Walk { records: vec![(String::new(), beside)], compare };
    walk.folder(folder, "")
}

struct Walk {
    /// Records of the folders on the way, with their paths. A folder of ours in another one may
    /// have been rewritten since, and keeps its own record.
    records: Vec<(String, Record)>,
    compare: Compare,
}

impl Walk {
    fn folder(&mut self, folder: &Path, prefix: &str) -> io::Result<Option<UnrecordedEntry>> {
        let mut entries = fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
        entries.sort_by_key(fs::DirEntry::file_name);
        self.records.push((prefix.to_owned(), Record::read(&Place::Inside.of(folder))));
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
                if !self.ours(&path, Record::has_folder)
                    && Record::read(&Place::Inside.of(&entry.path())).0.is_empty()
                {
                    return unrecorded(UNKNOWN);
                }
                if let Some(found) = self.folder(&entry.path(), &own)? {
                    return Ok(Some(found));
                }
                continue;
            }
            if !self.ours(&path, |record, path| !record.stamps(path).is_empty()) {
                return unrecorded(UNKNOWN);
            }
            let bytes = entry.metadata()?.len();
            let same = self.ours(&path, |record, path| record.sizes_fit(path, bytes))
                && (self.compare == Compare::Sizes || {
                    let stamp = Stamp::of_file(&entry.path())?;
                    self.ours(&path, |record, path| record.knows(path, stamp))
                });
            if !same {
                return unrecorded("was changed since");
            }
        }
        self.records.pop();
        Ok(None)
    }

    /// Whether some record says so of `path`, seen from its folder.
    fn ours(&self, path: &str, says: impl Fn(&Record, &str) -> bool) -> bool {
        self.records.iter().any(|(prefix, record)| {
            path.strip_prefix(prefix).is_some_and(|path| says(record, path))
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
