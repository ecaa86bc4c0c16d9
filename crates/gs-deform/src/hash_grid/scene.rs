//! [`HashGridScene`]: canonical splats whose dynamic ones are deformed by a hash-grid field.

use super::evaluate::Moving;
use super::field::HashGridField;
use super::segments::segments;
use crate::FieldError;
use crate::evaluate::Wanted;
use gs_core::{DynamicScene, SceneError, Splats, TimeRange};
use std::sync::Arc;

/// Canonical splats, the flags of the dynamic ones, and the
/// field that deforms them: a Swift4D model.
///
/// A Gaussian moves if it is declared dynamic *and* its stored centre lies in the field's box; all
/// others keep their stored values at every time; their only cost is a copy. The canonical splats
/// are not a frame of the sequence.
#[derive(Debug, Clone)]
pub struct HashGridScene {
    canonical: Splats,
    dynamic: Vec<bool>,
    moving: Moving,
    field: Arc<HashGridField>,
    time_range: TimeRange,
    num_frames: Option<usize>,
}

impl HashGridScene {
    /// A scene from its parts, at times 0 to 1. `dynamic` is `[N]`.
    ///
    /// # Errors
    /// If arrays have inconsistent lengths, the SH degree is not 3, or there are 2³² Gaussians or
    /// more.
    pub fn new(
        canonical: Splats,
        dynamic: Vec<bool>,
        field: impl Into<Arc<HashGridField>>,
    ) -> Result<Self, FieldError> {
        let field = field.into();
        canonical.check_shapes()?;
        if canonical.sh_degree != 3 {
            return Err(FieldError::Unsupported(format!(
                "the SH head deforms degree 3, the splats have degree {}",
                canonical.sh_degree
            )));
        }
        let n = canonical.len();
        if dynamic.len() != n || u32::try_from(n).is_err() {
            return Err(FieldError::Shape {
                tensor: "dynamic".to_owned(),
                found: vec![dynamic.len()],
                expected: format!("[{n}], fewer than 2^32"),
            });
        }
        let mut moving = Moving::default();
        for (row, (mean, dynamic)) in (0_u32..).zip(canonical.means.iter().zip(&dynamic)) {
            if let Some(coords) = field.bounds().normalize(*mean).filter(|_| *dynamic) {
                moving.rows.push(row);
                moving.coords.push(coords);
            }
        }
        moving.segments = segments(n, &moving.rows);
        Ok(Self {
            canonical,
            dynamic,
            moving,
            field,
            time_range: TimeRange::UNIT,
            num_frames: None,
        })
    }

    /// Declares the frames of the training video: frame `i` of `count` was trained at
    /// time `i / divisor`. The scene's times end with its last frame, because fine
    /// levels of the grid contain noise at untrained times.
    ///
    /// # Errors
    /// If there are no frames, or the last lies beyond time 1.
    pub fn with_frames(self, count: usize, divisor: usize) -> Result<Self, FieldError> {
        if count == 0 || divisor == 0 || count - 1 > divisor {
            return Err(FieldError::Unsupported(format!(
                "{count} frames at times i/{divisor}, expected at least one, and none beyond time 1"
            )));
        }
        #[expect(clippy::cast_possible_truncation, reason = "scene times are single precision")]
        let end = ((count - 1) as f64 / divisor as f64) as f32;
        Ok(Self { time_range: TimeRange { start: 0.0, end }, num_frames: Some(count), ..self })
    }

    /// The stored splats, before any deformation.
    pub fn canonical(&self) -> &Splats {
        &self.canonical
    }

    /// The deformation field.
    pub fn field(&self) -> &Arc<HashGridField> {
        &self.field
    }

    /// Whether each Gaussian is declared dynamic, `[N]`.
    pub fn dynamic(&self) -> &[bool] {
        &self.dynamic
    }

    /// Rows that the field moves, ascending: dynamic ones inside its box.
    pub fn moving_rows(&self) -> &[u32] {
        &self.moving.rows
    }

    /// The splats at any time, including times beyond the frames.
    ///
    /// # Errors
    /// If `t` is not finite.
    pub fn deform_into(&self, t: f32, out: &mut Splats) -> Result<(), FieldError> {
        self.field.evaluate(&self.canonical, &self.moving, t, Wanted::All, out)
    }

    fn evaluate(&self, t: f32, wanted: Wanted, out: &mut Splats) -> Result<(), SceneError> {
        let range = self.time_range;
        if !range.contains(t) {
            return Err(SceneError::Time { t, range });
        }
        self.field.evaluate(&self.canonical, &self.moving, t, wanted, out).map_err(|error| {
            SceneError::Source { what: "evaluating the field".to_owned(), source: error.into() }
        })
    }
}

impl DynamicScene for HashGridScene {
    fn num_splats(&self) -> usize {
        self.canonical.len()
    }

    fn sh_degree(&self) -> usize {
        self.canonical.sh_degree
    }

    fn time_range(&self) -> TimeRange {
        self.time_range
    }

    fn num_frames(&self) -> Option<usize> {
        self.num_frames
    }

    fn at_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, Wanted::All, out)
    }

    fn geometry_into(&self, t: f32, out: &mut Splats) -> Result<(), SceneError> {
        self.evaluate(t, Wanted::Geometry, out)
    }

    fn dynamic_mask(&self) -> Option<&[bool]> {
        Some(&self.dynamic)
    }
}
