//! Cameras.

use crate::arrays::{array, matrix};
use crate::failures::{exception, value_error};
use gs_core::Intrinsics;
use gs_core::image_formation::NEAR_PLANE;
use gs_io::cameras::Split;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A pinhole camera. OpenCV axes: x right, y down, z forward; pixel centres at half-integers.
///
/// viewmat: world to camera, [4,4]. K: intrinsics in pixels, [3,3] without skew.
/// width, height: pixels. near: near plane, world units. time: scene time of its image, or None.
#[pyclass(frozen, eq, skip_from_py_object, module = "catalyst4d")]
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Camera {
    pub(crate) inner: gs_core::Camera,
}

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (viewmat, K, width, height, *, near=NEAR_PLANE, time=None, name=String::new()))]
    #[expect(non_snake_case, reason = "the name of the matrix in this field")]
    fn new(
        viewmat: &Bound<'_, PyAny>,
        K: &Bound<'_, PyAny>,
        width: u32,
        height: u32,
        near: f64,
        time: Option<f32>,
        name: String,
    ) -> PyResult<Self> {
        let viewmat = matrix::<4, 4>("viewmat", viewmat)?;
        let k = matrix::<3, 3>("K", K)?;
        let intrinsics = Intrinsics { fx: k[0][0], fy: k[1][1], cx: k[0][2], cy: k[1][2] };
        Self { inner: gs_core::Camera { viewmat, intrinsics, width, height, near, time, name } }
            .checked()
    }

    /// Camera at `eye` looking at `target`, world units; `fov_y` vertical field of view, radians.
    #[staticmethod]
    #[pyo3(signature = (eye, target, up, fov_y, width, height, *, near=NEAR_PLANE))]
    fn look_at(
        eye: [f64; 3],
        target: [f64; 3],
        up: [f64; 3],
        fov_y: f64,
        width: u32,
        height: u32,
        near: f64,
    ) -> PyResult<Self> {
        let camera = gs_core::Camera::look_at(eye, target, up, fov_y, width, height);
        Self { inner: camera.with_near(near) }.checked()
    }

    /// World to camera, [4,4].
    #[getter]
    fn viewmat<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array(py, self.inner.viewmat.as_flattened().to_vec(), &[4, 4])
    }

    /// Intrinsics, pixels, [3,3].
    #[getter]
    #[pyo3(name = "K")]
    fn intrinsics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let Intrinsics { fx, fy, cx, cy } = self.inner.intrinsics;
        array(py, vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], &[3, 3])
    }

    /// Image columns, pixels.
    #[getter]
    fn width(&self) -> u32 {
        self.inner.width
    }

    /// Image rows, pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.inner.height
    }

    /// Near plane, world units.
    #[getter]
    fn near(&self) -> f64 {
        self.inner.near
    }

    /// Scene time of the camera's image, or None.
    #[getter]
    fn time(&self) -> Option<f32> {
        self.inner.time
    }

    /// Name of the view.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// Camera centre, world units, [3].
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array(py, self.inner.position().to_vec(), &[3])
    }

    /// The same view at a different image size, pixels.
    fn resized(&self, width: u32, height: u32) -> PyResult<Self> {
        Self { inner: self.inner.resized(width, height) }.checked()
    }

    fn __repr__(&self) -> String {
        let gs_core::Camera { width, height, near, time, name, .. } = &self.inner;
        let time = time.map_or("None".to_owned(), |time| time.to_string());
        format!("Camera({name:?}, {width}×{height}, near={near}, time={time})")
    }
}

impl Camera {
    fn checked(self) -> PyResult<Self> {
        self.inner.check().map_err(|error| value_error(&error))?;
        Ok(self)
    }
}

/// Reads the cameras of a data set, one of its files, or a model folder: `format`, `notes`,
/// `cameras`, the indices of each split, and the cameras of the reference's videos.
#[pyfunction]
pub(crate) fn open_cameras(
    py: Python<'_>,
    path: PathBuf,
    trained: bool,
) -> PyResult<Bound<'_, PyDict>> {
    let set = py
        .detach(|| c4d_cli::open_cameras(&path, trained))
        .map_err(|failure| exception(py, &failure))?;
    let dict = PyDict::new(py);
    dict.set_item("format", set.format.to_string())?;
    for (name, split) in [("train", Split::Train), ("test", Split::Test), ("val", Split::Val)] {
        let members: Vec<usize> =
            (0..set.views.len()).filter(|&i| set.views[i].split.includes(split)).collect();
        dict.set_item(name, members)?;
    }
    let wrapped = |cameras: Vec<gs_core::Camera>| -> Vec<Camera> {
        cameras.into_iter().map(|inner| Camera { inner }).collect()
    };
    dict.set_item("cameras", wrapped(set.views.into_iter().map(|view| view.camera).collect()))?;
    dict.set_item("path", wrapped(set.video))?;
    dict.set_item("notes", set.notes)?;
    Ok(dict)
}
