//! [`Draft`]: edited splats and their descriptions, kept consistent.

use super::Region;
use crate::{SynthScene, math::row_id, part::Tag, scene::SplatTruth};
use gs_core::Splats;
use rand::RngExt;
use rand_pcg::Pcg64;

#[derive(Debug)]
pub(crate) struct Draft {
    pub(crate) splats: Splats,
    pub(crate) rows: Vec<SplatTruth>,
    pub(crate) tags: Vec<Tag>,
    /// Source row a splat descends from; `None` for new geometry.
    pub(crate) source_rows: Vec<Option<u32>>,
    /// Rows that [`super::Edit::Remove`] marked but that still
    /// exist, because an editor may miss them.
    pub(crate) removed: Vec<bool>,
}

impl Draft {
    pub(super) fn of(scene: &SynthScene) -> Self {
        let count = scene.frame1.len();
        Self {
            splats: scene.frame1.clone(),
            rows: scene.rows.clone(),
            tags: vec![Tag::Unchanged; count],
            source_rows: (0..count).map(|i| Some(row_id(i))).collect(),
            removed: vec![false; count],
        }
    }

    pub(super) fn mask_of(&self, region: &Region) -> Vec<bool> {
        let means = self.splats.means.iter();
        means.zip(&self.rows).map(|(mean, row)| region.contains(row.part, *mean)).collect()
    }

    pub(super) fn rows_in(&self, region: &Region) -> Vec<usize> {
        let mask = self.mask_of(region);
        (0..mask.len()).filter(|&i| mask[i]).collect()
    }

    /// Appends a copy of row `i`; returns its row.
    pub(super) fn push_clone(&mut self, i: usize) -> usize {
        let coeffs = self.splats.sh_coeffs();
        let splats = &mut self.splats;
        splats.means.push(splats.means[i]);
        splats.quats.push(splats.quats[i]);
        splats.log_scales.push(splats.log_scales[i]);
        splats.opacity_logits.push(splats.opacity_logits[i]);
        splats.sh.extend_from_within(i * coeffs..(i + 1) * coeffs);
        self.rows.push(self.rows[i]);
        self.tags.push(self.tags[i]);
        self.source_rows.push(self.source_rows[i]);
        self.removed.push(self.removed[i]);
        self.rows.len() - 1
    }

    pub(crate) fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        let order: Vec<usize> = (0..self.rows.len()).filter(|&i| keep(i)).collect();
        self.take(&order);
    }

    pub(super) fn shuffle(&mut self, rng: &mut Pcg64) {
        let mut order: Vec<usize> = (0..self.rows.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, rng.random_range(0..=i));
        }
        self.take(&order);
    }

    fn take(&mut self, order: &[usize]) {
        self.splats = self.splats.select(order);
        self.rows = order.iter().map(|&i| self.rows[i]).collect();
        self.tags = order.iter().map(|&i| self.tags[i]).collect();
        self.source_rows = order.iter().map(|&i| self.source_rows[i]).collect();
        self.removed = order.iter().map(|&i| self.removed[i]).collect();
    }
}
