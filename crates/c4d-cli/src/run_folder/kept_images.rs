//! `refine.images`: the images of an unfinished refinement, so
//! that `--resume` does not render them again.
//!
//! A line of JSON with the inputs of the images, then per image: view and length (u64), the time's
//! bits and a CRC-32 (u32), bytes. Little-endian. The file only grows, so a killed process leaves
//! at most one partial image at the end, which is ignored.

use super::REFINE_IMAGES;
use crate::failure::{Failure, Outcome};
use cuar::ViewTime;
use gs_io::FolderUpdate;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};

/// Inputs on which the images depend.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct MadeFrom {
    /// Edit, options and cameras.
    pub(crate) fingerprint: u64,
    /// The source scene.
    pub(crate) source_sha256: String,
    /// Device that rendered them.
    pub(crate) device: String,
}

/// Size of the header of an image, bytes.
const HEAD: usize = 8 + 8 + 4 + 4;

/// An open `refine.images`.
#[derive(Debug)]
pub(crate) struct KeptImages {
    file: File,
    /// Offset and length of each view and time (its bits).
    entries: HashMap<(usize, u32), (u64, usize)>,
    end: u64,
}

impl KeptImages {
    /// Opens the images of a run; images with other inputs are discarded.
    pub(crate) fn open(update: &FolderUpdate, made_from: &MadeFrom) -> Outcome<Self> {
        let file =
            update.growing(REFINE_IMAGES).map_err(|error| crate::output::output_failure(&error))?;
        Self::of_file(file, made_from)
    }

    /// As [`KeptImages::open`], of a file open for reading and writing.
    pub(crate) fn of_file(file: File, made_from: &MadeFrom) -> Outcome<Self> {
        let failed = |error: io::Error| Failure::failed(format!("{REFINE_IMAGES}: {error}"));
        let mut kept = Self { file, entries: HashMap::new(), end: 0 };
        let found = kept.read_index(made_from).map_err(failed)?;
        if !found {
            let line = serde_json::to_string(made_from).map_err(Failure::failed)?;
            kept.file.set_len(0).map_err(failed)?;
            kept.file.rewind().map_err(failed)?;
            writeln!(kept.file, "{line}").map_err(failed)?;
            kept.end = line.len() as u64 + 1;
        }
        Ok(kept)
    }

    /// The images of a file open for reading; `None` if they have other inputs.
    pub(crate) fn read(file: File, made_from: &MadeFrom) -> io::Result<Option<Self>> {
        let mut kept = Self { file, entries: HashMap::new(), end: 0 };
        Ok(kept.read_index(made_from)?.then_some(kept))
    }

    /// Number of images.
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    fn read_index(&mut self, made_from: &MadeFrom) -> io::Result<bool> {
        let length = self.file.metadata()?.len();
        let mut reader = BufReader::new(&mut self.file);
        let mut line = Vec::new();
        (&mut reader).take(1 << 16).read_until(b'\n', &mut line)?;
        if serde_json::from_slice::<MadeFrom>(&line).ok().as_ref() != Some(made_from) {
            return Ok(false);
        }
        let mut at = line.len() as u64;
        let mut head = [0; HEAD];
        let mut entries = HashMap::new();
        while reader.read_exact(&mut head).is_ok() {
            let word = |from: usize| u64::from_le_bytes(std::array::from_fn(|k| head[from + k]));
            let half = |from: usize| u32::from_le_bytes(std::array::from_fn(|k| head[from + k]));
            let (Ok(view), Ok(bytes)) = (usize::try_from(word(0)), usize::try_from(word(8))) else {
                break;
            };
            let next = at.saturating_add(HEAD as u64).saturating_add(word(8));
            if next > length {
                break;
            }
            let mut content = vec![0; bytes];
            reader.read_exact(&mut content)?;
            if crc32fast::hash(&content) != half(20) {
                break;
            }
            entries.insert((view, half(16)), (at + HEAD as u64, bytes));
            at = next;
        }
        (self.entries, self.end) = (entries, at);
        Ok(true)
    }

    /// The stored images, in the order of the file.
    pub(crate) fn keys(&self) -> Vec<ViewTime> {
        let mut entries: Vec<_> = self.entries.iter().collect();
        entries.sort_by_key(|(_, (offset, _))| *offset);
        let key = |(&(view, time), _)| ViewTime { view, time: f32::from_bits(time) };
        entries.into_iter().map(key).collect()
    }

    /// The stored bytes of a view and time.
    pub(crate) fn get(&mut self, at: ViewTime) -> Option<Vec<u8>> {
        let (offset, length) = *self.entries.get(&(at.view, at.time.to_bits()))?;
        let mut bytes = vec![0; length];
        self.file.seek(SeekFrom::Start(offset)).ok()?;
        self.file.read_exact(&mut bytes).ok()?;
        Some(bytes)
    }

    /// Stores the bytes of a view and time.
    pub(crate) fn put(&mut self, at: ViewTime, bytes: &[u8]) -> io::Result<()> {
        let mut head = Vec::with_capacity(HEAD + bytes.len());
        head.extend((at.view as u64).to_le_bytes());
        head.extend((bytes.len() as u64).to_le_bytes());
        head.extend(at.time.to_bits().to_le_bytes());
        head.extend(crc32fast::hash(bytes).to_le_bytes());
        head.extend_from_slice(bytes);
        self.file.seek(SeekFrom::Start(self.end))?;
        self.file.write_all(&head)?;
        self.entries.insert((at.view, at.time.to_bits()), (self.end + HEAD as u64, bytes.len()));
        self.end += head.len() as u64;
        Ok(())
    }

    /// Empties the file, for a full disk.
    pub(crate) fn clear(&mut self) {
        self.entries.clear();
        // Best effort: the file is removed when the refinement ends.
        let _ = self.file.set_len(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_kept_until_their_inputs_change() {
        let dir = tempfile::tempdir().unwrap();
        let update = FolderUpdate::begin(dir.path()).unwrap();
        let made_from = MadeFrom {
            fingerprint: u64::MAX,
            source_sha256: "a".to_owned(),
            device: "CPU".to_owned(),
        };
        let (one, other) = (ViewTime { view: 1, time: 0.1 }, ViewTime { view: 7, time: 0.9 });
        let mut kept = KeptImages::open(&update, &made_from).unwrap();
        assert!(kept.get(one).is_none(), "none yet");
        kept.put(one, b"some bytes").unwrap();
        kept.put(other, b"").unwrap();
        drop(kept);
        let path = dir.path().join(REFINE_IMAGES);
        let whole = std::fs::read(&path).unwrap();
        // A process killed while writing a third image.
        std::fs::write(&path, [&whole[..], &[9; 30]].concat()).unwrap();
        let mut kept = KeptImages::open(&update, &made_from).unwrap();
        assert_eq!(kept.len(), 2, "the complete ones");
        assert_eq!(kept.get(one).as_deref(), Some(&b"some bytes"[..]), "found again");
        assert_eq!(kept.get(other).as_deref(), Some(&b""[..]), "an empty one, too");
        kept.put(ViewTime { view: 8, time: 0.9 }, b"third").unwrap();
        drop(kept);
        assert_eq!(
            KeptImages::open(&update, &made_from).unwrap().len(),
            3,
            "after the complete ones"
        );
        let changed = MadeFrom { device: "GPU".to_owned(), ..made_from };
        assert_eq!(KeptImages::open(&update, &changed).unwrap().len(), 0, "of something else");
    }
}
