//! `metrics.json`.

use super::item::Item;
use gs_core::Camera;
use serde_json::{Value, json};

/// Version of the layout of `metrics.json`.
const SCHEMA: u32 = 1;

/// Metadata of all values in a file.
#[derive(Debug, Clone)]
pub(crate) struct Header<'a> {
    pub(crate) scene: String,
    /// Fingerprint of the edit, for runs.
    pub(crate) edit: Option<String>,
    pub(crate) cameras: &'a [Camera],
    /// Origin of the views.
    pub(crate) origin: String,
    pub(crate) times: &'a [f32],
    pub(crate) edit_time: f32,
    pub(crate) background: [f32; 3],
    pub(crate) truth: Option<String>,
    pub(crate) renderer: &'static str,
}

/// The whole file. Identical for any number of threads: its only times are those recorded by the
/// run.
pub(crate) fn document(header: &Header<'_>, items: &[Item]) -> Value {
    let names: Vec<String> = header.cameras.iter().map(|camera| camera.name.clone()).collect();
    let view = |camera: &Camera| {
        json!({
            "name": camera.name,
            "size": [camera.width, camera.height],
            "viewmat": camera.viewmat,
            "fx": camera.intrinsics.fx,
            "fy": camera.intrinsics.fy,
            "cx": camera.intrinsics.cx,
            "cy": camera.intrinsics.cy,
            "near": camera.near,
        })
    };
    json!({
        "schema": SCHEMA,
        "tool_version": env!("CARGO_PKG_VERSION"),
        "scene": header.scene,
        "edit": header.edit,
        "source": "render",
        "quantised": "8 bits",
        "renderer": header.renderer,
        "views_from": header.origin,
        "views": header.cameras.iter().map(view).collect::<Vec<_>>(),
        "frames": header.times.len(),
        "times": header.times,
        "edit_time": header.edit_time,
        "background": header.background,
        "truth": header.truth,
        "items": items.iter().map(|item| item.json(&names)).collect::<Vec<_>>(),
    })
}
