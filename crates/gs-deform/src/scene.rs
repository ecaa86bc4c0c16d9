//! [`HexPlaneScene`]: canonical splats and their deformation field.

use crate::evaluate::Wanted;
use crate::{Component, FieldError, HexPlaneField};
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Default bound of the memory for cached time-independent features, bytes.
pub const DEFAULT_CACHE_LIMIT: usize = 512 << 20;

/// Canonical splats and the field that deforms them: a 4DGaussians model, at times 0 to 1.
///
/// The canonical splats are not a frame of the sequence: the field deforms at every time.
#[derive(Debug)]
pub struct HexPlaneScene {
    canonical: Splats,
    field: HexPlaneField,
    cache_limit: usize,
    /// Rows that the field does not deform.
    still: Vec<usize>,
    /// Spatial products `[N, L·C]`, built by the first evaluation when they fit the limit.
    spatial: OnceLock<Vec<f32>>,
    /// Whether a thread has begun to build them.
    building: AtomicBool,
}

impl HexPlaneScene {
    /// A scene from its parts.
    ///
    /// # Errors
    /// If the arrays of `canonical` have inconsistent lengths, or SH are deformed and their degree
    /// is not 3.
    pub fn new(canonical: Splats, field: HexPlaneField) -> Result<Self, FieldError> {
        field.check_splats(&canonical)?;
        Ok(Self {
            canonical,
            field,
            cache_limit: DEFAULT_CACHE_LIMIT,
            still: Vec::new(),
            spatial: OnceLock::new(),
            building: AtomicBool::new(false),
        })
    }

    /// Bounds the memory for cached time-independent features: the first evaluation
    /// stores `N·L·C` floats if they take at most `bytes`; otherwise they are
    /// recomputed at every evaluation. 0 disables the cache.
    #[must_use]
    pub fn with_cache_limit(self, bytes: usize) -> Self {
        Self {
            cache_limit: bytes,
            spatial: OnceLock::new(),
            building: AtomicBool::new(false),
            ..self
        }
    }

    /// Gaussians whose entry in `moving` (`[N]`) is false keep their stored parameters at every
    /// time. Early revisions of the reference had such a table.
    ///
    /// # Errors
    /// If the number of entries differs from the number of Gaussians.
    pub fn with_moving(self, moving: &[bool]) -> Result<Self, FieldError> {
        if moving.len() != self.canonical.len() {
            return Err(FieldError::Shape {
                tensor: "deformation_table".to_owned(),
                found: vec![moving.len()],
                expected: format!("[{}]", self.canonical.len()),
            });
        }
        let still = (0..moving.len()).filter(|&row| !moving[row]).collect();
        Ok(Self { still, ..self })
    }

    /// The stored splats, before any deformation.
    pub fn canonical(&self) -> &Splats {
        &self.canonical
    }

    /// The deformation field.
    pub fn field(&self) -> &HexPlaneField {
        &self.field
    }

    fn spatial(&self) -> Option<&[f32]> {
        if let Some(features) = self.spatial.get() {
            return Some(features);
        }
        let floats = self.canonical.len() * self.field.planes().num_features();
        if floats * size_of::<f32>() > self.cache_limit || self.building.swap(true, Relaxed) {
            return None;
        }
        // Concurrent evaluations compute without the cache and give the same bits.
        // Waiting could deadlock: while the building thread waits for its parallel tasks,
        // it may pick up another evaluation of this scene.
        let features = self.field.spatial_features(&self.canonical.means);
        Some(self.spatial.get_or_init(|| features))
    }

    fn evaluate(&self, t: f32, wanted: Wanted, out: &mut Splats) -> Result<(), SceneError> {
        let range = self.time_range();
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        self.field.evaluate(&self.canonical, self.spatial(), t, wanted, out).map_err(|error| {
            SceneError::Source { what: "evaluating the field".to_owned(), source: error.into() }
        })?;
        let coeffs = self.canonical.sh_coeffs();
        for &row in &self.still {
            out.means[row] = self.canonical.means[row];
            out.log_scales[row] = self.canonical.log_scales[row];
            out.quats[row] = self.canonical.quats[row];
            if wanted == Wanted::All {
                out.opacity_logits[row] = self.canonical.opacity_logits[row];
                out.sh[row * coeffs..(row + 1) * coeffs].copy_from_slice(self.canonical.sh_of(row));
            }
        }
        Ok(())
    }
}

impl DynamicScene for HexPlaneScene {
    fn num_splats(&self) -> usize {
        self.canonical.len()
    }

    fn sh_degree(&self) -> usize {
        self.canonical.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        TimeRange::UNIT
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, Wanted::All, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, Wanted::Geometry, out)
    }

    fn fades(&self) -> bool {
        self.field.deforms(Component::OpacityLogits)
    }
}
