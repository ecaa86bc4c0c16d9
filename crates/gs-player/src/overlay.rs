//! [`Overlay`]: colours of splats by a property, shown over their original colours.

use crate::PlayerError;
use serde::Serialize;

/// Maximum number of entries of a palette; entries are stored as bytes.
pub const MAX_ENTRIES: usize = 256;

/// Colours of splats by a property, constant over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlay {
    /// Short name: lower-case letters.
    pub name: String,
    /// Description of the colours, one line.
    pub title: String,
    /// sRGB colours, at most [`MAX_ENTRIES`].
    pub palette: Vec<[u8; 3]>,
    /// Explanation of the palette.
    pub legend: Legend,
    /// Entry of the palette for each splat of the first and of the second scene, `[N]` each; empty
    /// without a second scene. A splat that both scenes share is shown as in the second.
    pub entries: [Vec<u8>; 2],
}

/// Explanation of a palette.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Legend {
    /// Entries with a name of their own, in the order in which they are listed.
    pub classes: Vec<(u8, String)>,
    /// First and last entry of a continuous scale, with the values at its ends.
    pub scale: Option<(u8, String, u8, String)>,
}

/// Data stored besides the scenes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Annotations<'a> {
    /// Overlays to choose from.
    pub overlays: &'a [Overlay],
    /// Whether to store the row number of each splat, which [picking](crate#picking) returns.
    pub row_numbers: bool,
}

impl Overlay {
    /// Name of its attribute in the payload.
    pub(crate) fn attribute(&self) -> String {
        format!("overlay:{}", self.name)
    }

    fn fault(&self, rows: [usize; 2]) -> Option<String> {
        if self.name.is_empty() || !self.name.bytes().all(|byte| byte.is_ascii_lowercase()) {
            return Some(format!("the name `{}` is not made of lower-case letters", self.name));
        }
        let found = [self.entries[0].len(), self.entries[1].len()];
        if found != rows {
            return Some(format!(
                "entries for {} and {} splats, the scenes have {} and {}",
                found[0], found[1], rows[0], rows[1]
            ));
        }
        let colors = self.palette.len();
        if colors > MAX_ENTRIES {
            return Some(format!("{colors} colours"));
        }
        let classes = self.legend.classes.iter().map(|class| class.0);
        let ends = self.legend.scale.iter().flat_map(|scale| [scale.0, scale.2]);
        let used = self.entries.iter().flatten().copied();
        let missing = used.chain(classes).chain(ends).find(|&entry| usize::from(entry) >= colors);
        missing.map(|entry| format!("entry {entry} of a palette of {colors} colours"))
    }
}

impl Annotations<'_> {
    /// Verifies that the overlays fit scenes of `rows` splats.
    pub(crate) fn check(&self, rows: [usize; 2]) -> Result<(), PlayerError> {
        for (i, overlay) in self.overlays.iter().enumerate() {
            let repeated = self.overlays[..i].iter().any(|other| other.name == overlay.name);
            let fault = overlay.fault(rows);
            if let Some(what) = fault.or_else(|| repeated.then(|| "given twice".to_owned())) {
                return Err(PlayerError::Overlay { name: overlay.name.clone(), what });
            }
        }
        Ok(())
    }
}
