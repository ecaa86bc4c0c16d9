//! The differentiable rasteriser.

use crate::arrays::{array, values};
use crate::camera::Camera;
use crate::failures::value_error;
use crate::splat_arrays::from_arrays;
use crate::supervise::compute;
use gs_core::{
    GradientConvention, RasterError, Rasterizer, Real, RenderGrads, RenderOutput, RenderParams,
    Splats, UpstreamGrads,
};
use gs_raster_cpu::{CpuRasterizer, Prepared};
use numpy::{Element, PyReadonlyArrayDyn};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex, PoisonError};

/// Images of splats, and the data for their gradients.
#[pyclass(frozen, module = "catalyst4d._native")]
#[derive(Debug)]
pub(crate) struct Rasterized {
    pass: AnyPass,
}

#[derive(Debug)]
enum AnyPass {
    Single(Arc<Pass<f32>>),
    Double(Arc<Pass<f64>>),
}

/// A forward pass.
#[derive(Debug)]
struct Pass<F> {
    splats: Splats<F>,
    features: Vec<F>,
    params: RenderParams,
    output: RenderOutput<F>,
    prepared: Mutex<Prepared<F>>,
}

#[pymethods]
impl Rasterized {
    /// `rgb` `[H,W,3]`, `alpha` `[H,W]`, `depth` `[H,W]`, `features` `[H,W,C]`.
    fn images<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        match &self.pass {
            AnyPass::Single(pass) => images(py, &pass.output),
            AnyPass::Double(pass) => images(py, &pass.output),
        }
    }

    /// Gradients of all parameters from those of the images; missing image gradients count as zero.
    #[pyo3(signature = (v_rgb=None, v_alpha=None, v_depth=None, v_features=None))]
    fn backward<'py>(
        &self,
        py: Python<'py>,
        v_rgb: Option<Bound<'py, PyAny>>,
        v_alpha: Option<Bound<'py, PyAny>>,
        v_depth: Option<Bound<'py, PyAny>>,
        v_features: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let upstream = [v_rgb, v_alpha, v_depth, v_features];
        match &self.pass {
            AnyPass::Single(pass) => backward(py, pass, &upstream),
            AnyPass::Double(pass) => backward(py, pass, &upstream),
        }
    }
}

/// Renders splats of 32- or 64-bit floats.
#[pyfunction]
#[pyo3(signature = (
    means, quats, log_scales, opacity_logits, sh, camera, background, features=None,
    exact_gradients=false
))]
#[expect(clippy::too_many_arguments, reason = "named in Python")]
pub(crate) fn rasterize<'py>(
    py: Python<'py>,
    means: Bound<'py, PyAny>,
    quats: Bound<'py, PyAny>,
    log_scales: Bound<'py, PyAny>,
    opacity_logits: Bound<'py, PyAny>,
    sh: Bound<'py, PyAny>,
    camera: PyRef<'py, Camera>,
    background: [f64; 3],
    features: Option<Bound<'py, PyAny>>,
    exact_gradients: bool,
) -> PyResult<Rasterized> {
    let gradients =
        if exact_gradients { GradientConvention::Exact } else { GradientConvention::Reference };
    let params = RenderParams { background, gradients, ..RenderParams::default() };
    let arrays = [means, quats, log_scales, opacity_logits, sh];
    let pass = if arrays[0].extract::<PyReadonlyArrayDyn<'_, f32>>().is_ok() {
        AnyPass::Single(forward(py, &arrays, features.as_ref(), &camera.inner, params)?)
    } else {
        AnyPass::Double(forward(py, &arrays, features.as_ref(), &camera.inner, params)?)
    };
    Ok(Rasterized { pass })
}

fn typed<'py, F: Element>(
    name: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArrayDyn<'py, F>> {
    value.extract().map_err(|_wrong_type| {
        PyTypeError::new_err(format!(
            "{name}: expected an array of the same type as means, float32 or float64"
        ))
    })
}

fn forward<F: Real + Element + Copy>(
    py: Python<'_>,
    arrays: &[Bound<'_, PyAny>; 5],
    features: Option<&Bound<'_, PyAny>>,
    camera: &gs_core::Camera,
    params: RenderParams,
) -> PyResult<Arc<Pass<F>>>
where
    CpuRasterizer: Rasterizer<F, Prepared = Prepared<F>>,
    Prepared<F>: Send,
{
    let [means, quats, log_scales, opacity_logits, sh] = arrays;
    let splats = from_arrays::<F>(
        &typed("means", means)?,
        &typed("quats", quats)?,
        &typed("log_scales", log_scales)?,
        &typed("opacity_logits", opacity_logits)?,
        &typed("sh", sh)?,
    )?;
    let features = match features {
        Some(features) => values(&typed::<F>("features", features)?)?,
        None => Vec::new(),
    };
    if !features.is_empty() && !features.len().is_multiple_of(splats.len().max(1)) {
        return Err(PyValueError::new_err(format!(
            "features has {} values, expected [N, C] for {} splats",
            features.len(),
            splats.len()
        )));
    }
    let camera = camera.clone();
    let work = move || -> Result<Pass<F>, RasterError> {
        let raster = CpuRasterizer::default();
        let mut prepared = raster.prepare(&splats, &camera)?;
        let output = raster.forward(&mut prepared, &splats, &features, &params)?;
        Ok(Pass { splats, features, params, output, prepared: Mutex::new(prepared) })
    };
    compute(py, work)?.map(Arc::new).map_err(|error| value_error(&error))
}

fn images<'py, F: Real + Element + Copy>(
    py: Python<'py>,
    output: &RenderOutput<F>,
) -> PyResult<Bound<'py, PyDict>> {
    let (height, width) = (output.height, output.width);
    let dict = PyDict::new(py);
    dict.set_item("rgb", array(py, output.rgb.clone(), &[height, width, 3])?)?;
    dict.set_item("alpha", array(py, output.alpha.clone(), &[height, width])?)?;
    dict.set_item("depth", array(py, output.depth.clone(), &[height, width])?)?;
    let shape = [height, width, output.num_features];
    dict.set_item("features", array(py, output.features.clone(), &shape)?)?;
    Ok(dict)
}

fn backward<'py, F: Real + Element + Copy>(
    py: Python<'py>,
    pass: &Arc<Pass<F>>,
    upstream: &[Option<Bound<'py, PyAny>>; 4],
) -> PyResult<Bound<'py, PyDict>>
where
    CpuRasterizer: Rasterizer<F, Prepared = Prepared<F>>,
    Prepared<F>: Send,
{
    let plane = |name: &str, i: usize| match &upstream[i] {
        Some(given) => values(&typed::<F>(name, given)?),
        None => Ok(Vec::new()),
    };
    let upstream = UpstreamGrads {
        v_rgb: plane("v_rgb", 0)?,
        v_alpha: plane("v_alpha", 1)?,
        v_depth: plane("v_depth", 2)?,
        v_features: plane("v_features", 3)?,
    };
    let shared = Arc::clone(pass);
    let work = move || -> Result<RenderGrads<F>, RasterError> {
        let Pass { splats, features, params, prepared, .. } = shared.as_ref();
        let mut prepared = prepared.lock().unwrap_or_else(PoisonError::into_inner);
        CpuRasterizer::default().backward(&mut prepared, splats, features, params, &upstream)
    };
    let grads = compute(py, work)?.map_err(|error| value_error(&error))?;
    let (n, coeffs) = (pass.splats.len(), pass.splats.sh_coeffs());
    let channels = pass.features.len() / n.max(1);
    let dict = PyDict::new(py);
    dict.set_item("means", array(py, grads.v_means.into_flattened(), &[n, 3])?)?;
    dict.set_item("quats", array(py, grads.v_quats.into_flattened(), &[n, 4])?)?;
    dict.set_item("log_scales", array(py, grads.v_log_scales.into_flattened(), &[n, 3])?)?;
    dict.set_item("opacity_logits", array(py, grads.v_opacity_logits, &[n])?)?;
    dict.set_item("sh", array(py, grads.v_sh.into_flattened(), &[n, coeffs, 3])?)?;
    dict.set_item("features", array(py, grads.v_features, &[n, channels])?)?;
    dict.set_item("means2d", array(py, grads.v_means2d.into_flattened(), &[n, 2])?)?;
    Ok(dict)
}
