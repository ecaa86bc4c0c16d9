//! Scenes, runs and single frames.

use crate::arrays::array;
use crate::camera::Camera;
use crate::failures::{exception, value_error};
use crate::splat_arrays::to_dict;
use crate::supervise::{Callbacks, Interrupted, compute, supervise};
use c4d_cli::SceneHandle;
use gs_core::DynamicScene;
use numpy::PyArrayDyn;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;

/// An open scene, run or frame.
#[pyclass(frozen, module = "catalyst4d._native")]
#[derive(Debug)]
pub(crate) struct Scene {
    handle: Arc<SceneHandle>,
}

/// Frame, time, camera, pass and `[H,W]` or `[H,W,C]` image.
type Rendered<'py> = (usize, f32, Camera, &'static str, Bound<'py, PyArrayDyn<f32>>);

#[pymethods]
impl Scene {
    #[staticmethod]
    #[pyo3(signature = (path, arguments, on_message=None))]
    fn open(
        py: Python<'_>,
        path: PathBuf,
        arguments: Vec<OsString>,
        on_message: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let callbacks = Callbacks { on_message, on_progress: None };
        let handle = supervise(py, &callbacks, Interrupted::IsAbandoned, move |observer| {
            SceneHandle::open(&path, &arguments, observer)
        })?
        .map_err(|failure| exception(py, &failure))?;
        Ok(Self { handle: Arc::new(handle) })
    }

    #[getter]
    fn num_splats(&self) -> usize {
        self.handle.scene().num_splats()
    }

    #[getter]
    fn sh_degree(&self) -> usize {
        self.handle.scene().sh_degree()
    }

    /// First and last time.
    #[getter]
    fn time_range(&self) -> (f32, f32) {
        let range = self.handle.scene().time_range();
        (range.start, range.end)
    }

    /// Times of the stored frames; `None` for continuous scenes.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let scene = self.handle.scene();
        let frames = scene.num_frames().map(|count| scene.time_range().frames(count));
        frames
            .map(|times| {
                let count = times.len();
                array(py, times, &[count])
            })
            .transpose()
    }

    #[getter]
    fn kind(&self) -> String {
        self.handle.kind()
    }

    #[getter]
    fn edit_time(&self) -> f32 {
        self.handle.edit_time()
    }

    #[getter]
    fn up(&self) -> [f64; 3] {
        self.handle.up()
    }

    #[getter]
    fn fps(&self) -> Option<f64> {
        self.handle.fps()
    }

    #[getter]
    fn background(&self) -> [f32; 3] {
        self.handle.background()
    }

    /// The splats at time `t`; with `original`, those of the scene before the edit.
    #[pyo3(signature = (t, activated=false, original=false))]
    fn at<'py>(
        &self,
        py: Python<'py>,
        t: f32,
        activated: bool,
        original: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let scene = if original {
            let original = self.handle.original();
            original.ok_or_else(|| PyValueError::new_err("only runs have an original"))?
        } else {
            self.handle.scene()
        };
        let scene: Arc<dyn DynamicScene> = Arc::clone(scene);
        let work = move || scene.at(t);
        let splats = compute(py, work)?.map_err(|error| value_error(&error))?;
        to_dict(py, splats, activated)
    }

    /// The cameras of `c4d render ARGUMENTS`.
    #[pyo3(signature = (arguments, on_message=None))]
    fn cameras(
        &self,
        py: Python<'_>,
        arguments: Vec<OsString>,
        on_message: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Camera>> {
        let callbacks = Callbacks { on_message, on_progress: None };
        let handle = Arc::clone(&self.handle);
        let work = move |observer: &_| handle.cameras(&arguments, observer);
        let cameras = supervise(py, &callbacks, Interrupted::IsAbandoned, work)?
            .map_err(|failure| exception(py, &failure))?;
        Ok(cameras.into_iter().map(|inner| Camera { inner }).collect())
    }

    /// The images of `c4d render ARGUMENTS`.
    #[pyo3(signature = (arguments, cameras=None, on_message=None, on_progress=None))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        arguments: Vec<OsString>,
        cameras: Option<Vec<PyRef<'py, Camera>>>,
        on_message: Option<Py<PyAny>>,
        on_progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Rendered<'py>>> {
        let callbacks = Callbacks { on_message, on_progress };
        let cameras = cameras
            .map(|cameras| cameras.iter().map(|camera| camera.inner.clone()).collect::<Vec<_>>());
        let handle = Arc::clone(&self.handle);
        let work = move |observer: &_| handle.render(&arguments, cameras, observer);
        let images = supervise(py, &callbacks, Interrupted::Stops, work)?
            .map_err(|failure| exception(py, &failure))?;
        images
            .into_iter()
            .map(|rendered| {
                let image = rendered.image;
                let shape = [image.height, image.width, image.channels];
                let axes = if image.channels == 1 { 2 } else { 3 };
                let pixels = array(py, image.data, &shape[..axes])?;
                let camera = Camera { inner: rendered.camera };
                Ok((rendered.frame, rendered.time, camera, rendered.pass, pixels))
            })
            .collect()
    }
}
