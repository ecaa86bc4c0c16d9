//! Tests of the rasteriser: golden cases, brute force, finite
//! differences, hostile values, reuse and determinism.

#[cfg(test)]
mod brute_force;
#[cfg(test)]
#[cfg(test)]
mod finite_differences;
#[cfg(test)]
mod golden_forward;
#[cfg(test)]
mod golden_gradients;
#[cfg(test)]
mod hostile;
#[cfg(test)]
mod placement;
#[cfg(test)]
mod reuse;
#[cfg(test)]
mod scenes;
