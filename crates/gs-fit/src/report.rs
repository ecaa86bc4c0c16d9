//! [`FitReport`]: counts of a fit, and regions that few pictures show.

use crate::FitError;
use crate::view::View;
use crate::votes::Votes;
use crate::working::NEW;
use gs_core::{Image, Rasterizer, RenderParams, Splats};

/// Number of views that determine the position of a surface.
pub(crate) const ENOUGH_VIEWS: u16 = 3;

/// Counts of a fit.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct FitReport {
    /// Edited pictures.
    pub edited_views: usize,
    /// All pictures.
    pub views: usize,
    /// Masked pixels of all pictures.
    pub masked_pixels: usize,
    /// Splats selected at the start.
    pub selected: usize,
    /// Splats removed before the first step, because the pictures show the background behind them.
    pub carved: usize,
    /// Total number of splats of the start that were removed.
    pub removed: usize,
    /// New splats.
    pub added: usize,
    /// Whether geometry was not fitted because fewer than three pictures are edited.
    pub geometry_frozen: bool,
    /// Masked regions that fewer than three pictures show; `None` if there are none.
    pub poorly_seen: Option<PoorlySeen>,
}

/// Masked regions that fewer than three pictures show.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct PoorlySeen {
    /// Number of such pixels in all pictures.
    pub pixels: usize,
    /// The view that shows most of them.
    pub view: String,
    /// That view with the regions in red, `[H,W,3]`.
    pub image: Image,
}

impl FitReport {
    pub(crate) fn of(views: &[View]) -> Self {
        Self {
            edited_views: views.iter().filter(|view| view.is_edited()).count(),
            views: views.len(),
            masked_pixels: views
                .iter()
                .map(|view| view.mask.iter().filter(|on| **on).count())
                .sum(),
            ..Self::default()
        }
    }

    pub(crate) fn finish(&mut self, source: &[u32], selected: &[bool]) {
        self.added = source.iter().filter(|&&row| row == NEW).count();
        self.removed = selected.len() - (source.len() - self.added);
    }
}

pub(crate) fn poorly_seen<R: Rasterizer>(
    raster: &R,
    start: &Splats,
    views: &[View],
    selected: &[bool],
    votes: &Votes,
) -> Result<Option<PoorlySeen>, FitError> {
    let poor = |i: usize| selected[i] && votes.views[i] < ENOUGH_VIEWS;
    let flag = |on: bool| f32::from(u8::from(on));
    let features: Vec<f32> =
        (0..start.len()).flat_map(|i| [flag(poor(i)), flag(selected[i])]).collect();
    let params = RenderParams { rgb: false, depth: false, ..RenderParams::default() };
    // More than half of the pixel's selected part.
    let is_poor = |poor: f32, selected: f32| selected > 0.1 && poor > 0.5 * selected;
    let mut found: Option<(usize, PoorlySeen)> = None;
    let mut total = 0;
    for view in views.iter().filter(|view| view.is_edited()) {
        let mut prepared = raster.prepare(start, &view.camera)?;
        let shown = raster.forward(&mut prepared, start, &features, &params)?.features;
        let pixels: Vec<usize> = (0..view.mask.len())
            .filter(|&p| view.mask[p] && is_poor(shown[2 * p], shown[2 * p + 1]))
            .collect();
        total += pixels.len();
        if pixels.len() > found.as_ref().map_or(0, |(most, _)| *most) {
            let mut image = Image {
                width: view.width,
                height: view.height,
                channels: 3,
                data: view.target.clone(),
            };
            for &p in &pixels {
                let rgb = &mut image.data[3 * p..3 * p + 3];
                rgb[0] = 0.5 + 0.5 * rgb[0];
                rgb[1] *= 0.5;
                rgb[2] *= 0.5;
            }
            let seen = PoorlySeen { pixels: 0, view: view.camera.name.clone(), image };
            found = Some((pixels.len(), seen));
        }
    }
    // A few pixels at outlines are always visible in few views.
    let masked: usize = views.iter().map(|view| view.mask.iter().filter(|on| **on).count()).sum();
    Ok(found.filter(|_| total * 50 > masked).map(|(_, seen)| PoorlySeen { pixels: total, ..seen }))
}
