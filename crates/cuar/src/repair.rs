//! [`Repair`]: applies the colour change of the surrounding surface to hidden splats.

use crate::{Evidence, OffsetScene, scene};
use gs_core::{DynamicScene, Splats};

/// The changes that follow from [`Evidence`]: a change of SH of some rows, the same at every time,
/// and rows that fade.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Repair {
    /// Recoloured rows, ascending.
    pub rows: Vec<u32>,
    /// Their change of SH, `[rows,K,3]`.
    pub d_sh: Vec<[f32; 3]>,
    /// Rows that fade, ascending.
    pub faded: Vec<u32>,
}

impl Repair {
    /// The repair of rows with ξ′ above `min_uncertainty`.
    pub fn of(evidence: &Evidence, min_uncertainty: f32) -> Self {
        let mut repair = Self { faded: evidence.remnants.clone(), ..Self::default() };
        for (row, change) in &evidence.missing_changes {
            if evidence.xi[*row as usize] > min_uncertainty {
                repair.rows.push(*row);
                repair.d_sh.extend(change);
            }
        }
        repair
    }

    /// Whether nothing changes.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty() && self.faded.is_empty()
    }

    /// Applies the changes to the splats of one time.
    ///
    /// # Panics
    /// If the number or SH degree of the splats differs from those of the evidence.
    pub fn apply(&self, splats: &mut Splats) {
        scene::add(splats, &self.rows, &self.d_sh);
        scene::fade(splats, &self.faded);
    }

    /// `scene` with the repair at every time.
    pub fn scene<'a>(&'a self, scene: &'a dyn DynamicScene) -> OffsetScene<'a> {
        OffsetScene::new(scene, &self.rows, &self.d_sh, &self.faded)
    }
}

/// Counts of a [`Repair`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RepairCounts {
    /// Splats that frame 1 does not supervise.
    pub hidden: usize,
    /// Of these, splats that received the change of colour of the surrounding surface.
    pub recoloured: usize,
    /// Of the recoloured ones, splats that had a meaningless colour after the edit.
    pub meaningless: usize,
    /// Of the hidden splats, remnants of deleted objects; they fade.
    pub faded: usize,
    /// Of the hidden splats, those near a change that are not repaired, because the surrounding
    /// surface is ambiguous.
    pub ambiguous: usize,
    /// Whether the edit itself changed hidden splats.
    pub reaches_hidden: bool,
}

impl RepairCounts {
    /// The counts of `repair`, made from `evidence`.
    pub fn of(evidence: &Evidence, repair: &Repair) -> Self {
        let is_meaningless = |row: &u32| evidence.meaningless.binary_search(row).is_ok();
        Self {
            hidden: evidence.supervision.iter().filter(|known| **known <= 0.0).count(),
            recoloured: repair.rows.len(),
            meaningless: repair.rows.iter().filter(|row| is_meaningless(row)).count(),
            faded: repair.faded.len(),
            ambiguous: evidence.num_ambiguous,
            reaches_hidden: evidence.reaches_hidden,
        }
    }
}
