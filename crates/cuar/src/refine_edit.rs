//! [`refine_edit`]: repair by evidence, then the refinement of [`crate::refine()`].

use crate::{
    Backend, BeforeEdit, CuarError, Evidence, EvidenceParams, RefineObserver, RefineOptions,
    Refined, Repair, RepairCounts, State, Views, color_uncertainty, refine::images_of, refine_with,
};
use gs_core::{Camera, DynamicScene, Rasterizer, sh};
use std::ops::Range;

/// [`crate::refine_with`] for an edit with a known source. First, splats that frame 1 does not
/// supervise are repaired ([`Evidence`], [`Repair`]), equally for all times; then view-dependent
/// colours that are only known from frame 1 are refined, including those of repaired splats.
/// Without [`RefineOptions::evidence`] this is `refine_with` alone. The result's rows are the
/// edited and the repaired ones; all other rows and all geometry do not change.
///
/// # Errors
/// As [`crate::refine()`], and if `before` does not match the splats of the scene.
#[expect(clippy::too_many_arguments, reason = "those of `refine_with`, and what was before")]
pub fn refine_edit<R: Rasterizer<Prepared: Send> + Sync>(
    backend: Backend<'_, R>,
    scene: &dyn DynamicScene,
    before: &BeforeEdit<'_>,
    edited: &[bool],
    views: &Views,
    options: &RefineOptions,
    resume: Option<&State>,
    observer: &mut dyn RefineObserver,
) -> Result<Refined, CuarError> {
    let Some(params) = &options.evidence else {
        return refine_with(backend, scene, edited, views, options, resume, observer);
    };
    options.check()?;
    let edit_time = options.edit_time.unwrap_or(scene.time_range().start);
    let (repair, counts, edited) =
        find_repair(backend.raster, scene, before, edited, views, options, params)?;
    let repaired = repair.scene(scene);
    let coeffs = sh::num_coeffs(scene.sh_degree());
    let mut refined = if any_uncertain(&repaired, &edited, views, options)? {
        refine_with(backend, &repaired, &edited, views, options, resume, observer)?
    } else {
        unrefined(&edited, coeffs)
    };
    let mut next = 0;
    for (k, row) in refined.rows.iter().enumerate() {
        if repair.rows.get(next) == Some(row) {
            let own = &mut refined.d_sh[k * coeffs..(k + 1) * coeffs];
            for (own, more) in own.iter_mut().zip(&repair.d_sh[next * coeffs..]) {
                (0..3).for_each(|c| own[c] += more[c]);
            }
            next += 1;
        }
    }
    refined.faded = repair.faded;
    refined.report.repair = counts;
    let mut changed = scene.at(edit_time)?;
    refined.apply(&mut changed);
    refined.sh.clear();
    for &row in &refined.rows {
        refined.sh.extend_from_slice(changed.sh_of(row as usize));
    }
    Ok(refined)
}

/// Makes the `share` of the supervised images of [`refine_edit`] and passes each to
/// [`RefineObserver::store_image`]; `share` receives their number and returns a range of it. A
/// refinement whose observer returns these images from [`RefineObserver::stored_image`] has the
/// same result as one that makes them itself. Returns the number of images of all shares, 0 if no
/// colour is uncertain.
///
/// # Errors
/// As [`refine_edit`].
#[expect(clippy::too_many_arguments, reason = "those of `refine_edit`, and a share")]
pub fn make_images<R: Rasterizer<Prepared: Send> + Sync>(
    raster: &R,
    scene: &dyn DynamicScene,
    before: &BeforeEdit<'_>,
    edited: &[bool],
    views: &Views,
    options: &RefineOptions,
    share: &dyn Fn(usize) -> Range<usize>,
    observer: &mut dyn RefineObserver,
) -> Result<usize, CuarError> {
    options.check()?;
    let Some(params) = &options.evidence else {
        return images_of(raster, scene, edited, views, options, share, observer);
    };
    let (repair, _, edited) = find_repair(raster, scene, before, edited, views, options, params)?;
    let repaired = repair.scene(scene);
    if !any_uncertain(&repaired, &edited, views, options)? {
        return Ok(0);
    }
    images_of(raster, &repaired, &edited, views, options, share, observer)
}

/// The repair by evidence, its counts, and the edited splats with the repaired ones.
fn find_repair<R: Rasterizer<Prepared: Send> + Sync>(
    raster: &R,
    scene: &dyn DynamicScene,
    before: &BeforeEdit<'_>,
    edited: &[bool],
    views: &Views,
    options: &RefineOptions,
    params: &EvidenceParams,
) -> Result<(Repair, RepairCounts, Vec<bool>), CuarError> {
    let edit_time = options.edit_time.unwrap_or(scene.time_range().start);
    let cameras = supervising(views);
    let evidence = Evidence::of(raster, scene, before, edit_time, &cameras, params)?;
    let repair = Repair::of(&evidence, options.min_uncertainty);
    let counts = RepairCounts::of(&evidence, &repair);
    let mut edited = edited.to_vec();
    CuarError::check("edited", edited.len(), evidence.xi.len())?;
    for &row in repair.rows.iter().chain(&repair.faded) {
        edited[row as usize] = true;
    }
    Ok((repair, counts, edited))
}

/// Maximum number of cameras that measure the visibility in frame 1.
const MAX_SURVEYED: usize = 32;

/// The cameras of `views` that measure the visibility in frame 1: those not held out, thinned
/// evenly.
fn supervising(views: &Views) -> Vec<Camera> {
    let supervises = |view: &usize| !views.held_out.contains(view);
    let all: Vec<usize> = (0..views.cameras.len()).filter(supervises).collect();
    let count = all.len().min(MAX_SURVEYED);
    (0..count).map(|k| views.cameras[all[k * all.len() / count]].clone()).collect()
}

/// The result of [`refine_with`] where no colour is uncertain, without its SH.
fn unrefined(edited: &[bool], coeffs: usize) -> Refined {
    #[expect(clippy::cast_possible_truncation, reason = "rows are numbered in 32 bits")]
    let rows: Vec<u32> = (0..edited.len()).filter(|&i| edited[i]).map(|i| i as u32).collect();
    let mut refined = Refined { d_sh: vec![[0.0; 3]; rows.len() * coeffs], ..Refined::default() };
    refined.report.num_edited = rows.len();
    refined.rows = rows;
    refined
}

/// Whether any edited splat's colour changes enough over time (Eq. 15) for an artifact to be
/// possible. Evaluates one colour per splat instead of an image; scenes without view dependence
/// skip the whole stage.
///
/// # Errors
/// If the scene cannot be evaluated or a camera is malformed.
pub fn any_uncertain(
    scene: &dyn DynamicScene,
    edited: &[bool],
    views: &Views<'_>,
    options: &RefineOptions,
) -> Result<bool, CuarError> {
    let then = scene.at(options.edit_time.unwrap_or(scene.time_range().start))?;
    for &t in views.times {
        let now = scene.at(t)?;
        for camera in views.cameras {
            let uncertainty = color_uncertainty(&now, &then, camera)?;
            let mut changes = uncertainty.iter().zip(edited);
            if changes.any(|(value, edited)| *edited && *value > options.min_uncertainty) {
                return Ok(true);
            }
        }
    }
    Ok(false)
}
