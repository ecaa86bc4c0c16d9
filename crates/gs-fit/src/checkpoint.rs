//! Conversion of a running fit to [`FitState`], and back.

use crate::alignment::{Aligning, Alignment};
use crate::state::FitState;
use crate::view::View;
use crate::working::Working;
use crate::{Adam, FitError};
use gs_core::{Splats, TileSet, sh};

fn put(arrays: &mut Vec<(String, Vec<f32>)>, prefix: &str, splats: &Splats) {
    for (name, values) in [
        ("means", splats.means.as_flattened()),
        ("quats", splats.quats.as_flattened()),
        ("log_scales", splats.log_scales.as_flattened()),
        ("opacity_logits", &splats.opacity_logits),
        ("sh", splats.sh.as_flattened()),
    ] {
        arrays.push((format!("{prefix}.{name}"), values.to_vec()));
    }
}

/// The state after `step` steps.
pub(crate) fn save(
    fingerprint: u64,
    step: usize,
    working: &mut Working,
    views: &[View],
) -> FitState {
    let mut arrays = Vec::new();
    put(&mut arrays, "splats", &working.splats);
    arrays.push(("largest".to_owned(), working.largest.clone()));
    let coeffs = working.splats.sh_coeffs();
    let mut steps = Vec::new();
    for (name, adam, _) in working.optimizer.groups(coeffs) {
        arrays.push((format!("m.{name}"), adam.m.clone()));
        arrays.push((format!("v.{name}"), adam.v.clone()));
        steps.push(u32::try_from(adam.step).unwrap_or(u32::MAX));
    }
    arrays.push(("gradient".to_owned(), working.gradient.clone()));
    for (v, View { alignment, noise, .. }) in views.iter().enumerate() {
        let Alignment { gain, offset, shift, local } = alignment;
        arrays.push((format!("align.{v}"), [&gain[..], offset, shift, &[*noise]].concat()));
        arrays.push((format!("local.{v}"), local.as_flattened().to_vec()));
    }
    let selected = working.selected.iter().map(|&on| u32::from(on)).collect();
    let mut counts = vec![
        ("steps".to_owned(), steps),
        ("source".to_owned(), working.source.clone()),
        ("aligning".to_owned(), vec![working.aligning as u32]),
        ("selected".to_owned(), selected),
        ("chosen".to_owned(), working.chosen.iter().map(|&on| u32::from(on)).collect()),
        ("fading".to_owned(), working.fading.iter().map(|&on| u32::from(on)).collect()),
        ("frozen".to_owned(), working.frozen.iter().map(|&on| u32::from(on)).collect()),
        ("hidden".to_owned(), working.hidden.iter().map(|&on| u32::from(on)).collect()),
        ("num_visible_steps".to_owned(), working.num_visible_steps.clone()),
    ];
    for (v, view) in views.iter().enumerate() {
        // They depend on earlier positions of the splats.
        let tiles = view.tiles.flags().iter().map(|&on| u32::from(on)).collect();
        counts.push((format!("tiles.{v}"), tiles));
    }
    FitState { fingerprint, step: step as u64, arrays, counts }
}

fn damaged(what: impl Into<String>) -> FitError {
    FitError::State { what: what.into() }
}

fn find<'a, T>(list: &'a [(String, Vec<T>)], name: &str) -> Result<&'a [T], FitError> {
    list.iter()
        .find(|(key, _)| key == name)
        .map(|(_, values)| values.as_slice())
        .ok_or_else(|| damaged(format!("`{name}` is missing")))
}

fn rows<const K: usize>(state: &FitState, name: &str) -> Result<Vec<[f32; K]>, FitError> {
    let (rows, rest) = find(&state.arrays, name)?.as_chunks::<K>();
    if rest.is_empty() { Ok(rows.to_vec()) } else { Err(damaged(format!("`{name}` is truncated"))) }
}

fn splats(state: &FitState, prefix: &str, sh_degree: usize) -> Result<Splats, FitError> {
    let splats = Splats {
        means: rows(state, &format!("{prefix}.means"))?,
        quats: rows(state, &format!("{prefix}.quats"))?,
        log_scales: rows(state, &format!("{prefix}.log_scales"))?,
        opacity_logits: find(&state.arrays, &format!("{prefix}.opacity_logits"))?.to_vec(),
        sh: rows(state, &format!("{prefix}.sh"))?,
        sh_degree,
    };
    splats.check_shapes()?;
    Ok(splats)
}

/// Restores a state in a run with the same inputs; returns the number of steps done.
pub(crate) fn restore(
    state: &FitState,
    working: &mut Working,
    views: &mut [View],
) -> Result<usize, FitError> {
    let degree = working.splats.sh_degree;
    working.splats = splats(state, "splats", degree)?;
    working.largest = find(&state.arrays, "largest")?.to_vec();
    let n = working.splats.len();
    let counts = |name: &str| -> Result<Vec<u32>, FitError> {
        let values = find(&state.counts, name)?;
        if values.len() == n {
            Ok(values.to_vec())
        } else {
            Err(damaged(format!("`{name}` has {} rows, expected {n}", values.len())))
        }
    };
    working.source = counts("source")?;
    working.num_visible_steps = counts("num_visible_steps")?;
    working.selected = counts("selected")?.iter().map(|&on| on != 0).collect();
    let chosen = find(&state.counts, "chosen")?;
    if chosen.len() != working.chosen.len() {
        return Err(damaged(format!("`chosen` has {} rows", chosen.len())));
    }
    working.chosen = chosen.iter().map(|&on| on != 0).collect();
    working.fading = counts("fading")?.iter().map(|&on| on != 0).collect();
    working.frozen = counts("frozen")?.iter().map(|&on| on != 0).collect();
    working.hidden = counts("hidden")?.iter().map(|&on| on != 0).collect();
    working.gradient = find(&state.arrays, "gradient")?.to_vec();
    if working.gradient.len() != n || working.largest.len() != n {
        return Err(damaged("arrays of different lengths"));
    }
    let steps = find(&state.counts, "steps")?.to_vec();
    for (k, (name, adam, columns)) in
        working.optimizer.groups(sh::num_coeffs(degree)).into_iter().enumerate()
    {
        let (m, v) = (
            find(&state.arrays, &format!("m.{name}"))?,
            find(&state.arrays, &format!("v.{name}"))?,
        );
        if m.len() != n * columns || v.len() != n * columns {
            return Err(damaged(format!("moments of `{name}` have a different length")));
        }
        let step = steps.get(k).copied().ok_or_else(|| damaged("`steps` is truncated"))?;
        *adam = Adam { step: u64::from(step), m: m.to_vec(), v: v.to_vec(), ..Adam::new(0) };
    }
    working.aligning = match find(&state.counts, "aligning")? {
        [0] => Aligning::Nothing,
        [1] => Aligning::Whole,
        [2] => Aligning::Local,
        _ => return Err(damaged("`aligning` is not 0, 1 or 2")),
    };
    for (v, view) in views.iter_mut().enumerate() {
        let tiles = find(&state.counts, &format!("tiles.{v}"))?.iter().map(|&on| on != 0).collect();
        view.tiles = TileSet::from_flags(tiles, view.width, view.height)
            .ok_or_else(|| damaged(format!("`tiles.{v}` does not match the picture")))?;
        let flat = find(&state.arrays, &format!("align.{v}"))?;
        let &[g0, g1, g2, o0, o1, o2, x, y, noise] = flat else {
            return Err(damaged(format!("`align.{v}` has {} values", flat.len())));
        };
        let local: Vec<[f32; 2]> = rows(state, &format!("local.{v}"))?;
        if !local.is_empty() && local.len() != view.width * view.height {
            return Err(damaged(format!("`local.{v}` has {} pixels", local.len())));
        }
        view.noise = noise;
        view.alignment =
            Alignment { gain: [g0, g1, g2], offset: [o0, o1, o2], shift: [x, y], local };
        view.retarget();
    }
    usize::try_from(state.step).map_err(|_too_large| damaged("more steps than fit in memory"))
}
