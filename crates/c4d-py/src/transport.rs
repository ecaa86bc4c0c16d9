//! Unbalanced optimal transport.

use crate::arrays::{array, rows, values};
use crate::failures::value_error;
use crate::supervise::compute;
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use uot::{
    Acceleration, Bandwidth, EntropyReference, Sinkhorn, SinkhornParams, UotError, UotOutput,
    UotProblem, WelschParams,
};

/// A solved problem.
#[pyclass(frozen, module = "catalyst4d._native")]
#[derive(Debug)]
pub(crate) struct Transport {
    problem: Arc<UotProblem<'static>>,
    output: Arc<UotOutput>,
}

#[pymethods]
impl Transport {
    /// Potentials, masses and the history of the iteration.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let UotOutput { f, g, row_mass, col_mass, residuals, .. } = self.output.as_ref();
        let dict = PyDict::new(py);
        let vectors = [
            ("f", f),
            ("g", g),
            ("row_mass", row_mass),
            ("col_mass", col_mass),
            ("residuals", residuals),
        ];
        for (name, vector) in vectors {
            dict.set_item(name, array(py, vector.clone(), &[vector.len()])?)?;
        }
        dict.set_item("total_mass", self.output.total_mass)?;
        dict.set_item("objective", self.output.objective)?;
        dict.set_item("converged", self.output.converged)?;
        dict.set_item("sweeps", self.output.sweeps)?;
        dict.set_item("beta", self.problem.scale().map(|scale| scale.beta))?;
        Ok(dict)
    }

    /// The plan, `[n,m]`.
    fn plan<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let (n, m) = (self.problem.num_rows(), self.problem.num_cols());
        array(py, self.evaluate(py, |output, problem| output.plan(problem))?, &[n, m])
    }

    /// `⟨D, P⟩`.
    fn transport_cost(&self, py: Python<'_>) -> PyResult<f64> {
        self.evaluate(py, |output, problem| output.transport_cost(problem))
    }

    /// For each column the row with the largest share of its mass, −1 for none, `[m]`.
    fn best_rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let found = self.evaluate(py, |output, problem| output.correspondence(problem))?;
        let rows: Vec<i64> = found
            .rows
            .iter()
            .map(|&row| if row == uot::NO_ROW { -1 } else { i64::from(row) })
            .collect();
        let count = rows.len();
        array(py, rows, &[count])
    }
}

impl Transport {
    fn evaluate<T: Send + 'static>(
        &self,
        py: Python<'_>,
        of: impl FnOnce(&UotOutput, &UotProblem<'static>) -> Result<T, UotError> + Send + 'static,
    ) -> PyResult<T> {
        let (output, problem) = (Arc::clone(&self.output), Arc::clone(&self.problem));
        let work = move || of(&output, &problem);
        compute(py, work)?.map_err(|error| value_error(&error))
    }
}

/// Points of any supported dimension.
enum Clouds {
    D1(Vec<[f64; 1]>, Vec<[f64; 1]>),
    D2(Vec<[f64; 2]>, Vec<[f64; 2]>),
    D3(Vec<[f64; 3]>, Vec<[f64; 3]>),
    D4(Vec<[f64; 4]>, Vec<[f64; 4]>),
    D5(Vec<[f64; 5]>, Vec<[f64; 5]>),
    D6(Vec<[f64; 6]>, Vec<[f64; 6]>),
}

impl Clouds {
    fn read(x: &PyReadonlyArrayDyn<'_, f64>, y: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Self> {
        let (x_shape, y_shape) = (x.as_array().shape().to_vec(), y.as_array().shape().to_vec());
        match (&x_shape[..], &y_shape[..]) {
            ([_, 1], [_, 1]) => Ok(Self::D1(rows("x", x)?, rows("y", y)?)),
            ([_, 2], [_, 2]) => Ok(Self::D2(rows("x", x)?, rows("y", y)?)),
            ([_, 3], [_, 3]) => Ok(Self::D3(rows("x", x)?, rows("y", y)?)),
            ([_, 4], [_, 4]) => Ok(Self::D4(rows("x", x)?, rows("y", y)?)),
            ([_, 5], [_, 5]) => Ok(Self::D5(rows("x", x)?, rows("y", y)?)),
            ([_, 6], [_, 6]) => Ok(Self::D6(rows("x", x)?, rows("y", y)?)),
            _ => Err(PyValueError::new_err(format!(
                "points have shapes {x_shape:?} and {y_shape:?}, expected [n, d] and [m, d] with d \
                 from 1 to 6"
            ))),
        }
    }

    fn problem(&self, params: &WelschParams) -> Result<UotProblem<'static>, UotError> {
        match self {
            Self::D1(x, y) => UotProblem::welsch(x, y, params),
            Self::D2(x, y) => UotProblem::welsch(x, y, params),
            Self::D3(x, y) => UotProblem::welsch(x, y, params),
            Self::D4(x, y) => UotProblem::welsch(x, y, params),
            Self::D5(x, y) => UotProblem::welsch(x, y, params),
            Self::D6(x, y) => UotProblem::welsch(x, y, params),
        }
    }
}

enum Cost {
    Matrix(Vec<f64>, usize, usize),
    Points(Clouds, WelschParams),
}

/// Solves a problem whose cost is a matrix `[n,m]`, or the Welsch cost of two clouds.
#[pyfunction]
#[pyo3(signature = (
    a, b, cost, points, lambda_ent, lambda_a, lambda_b, reference, tol, max_sweeps, acceleration,
    gamma, beta, cutoff
))]
#[expect(clippy::too_many_arguments, reason = "named in Python")]
pub(crate) fn solve_transport<'py>(
    py: Python<'py>,
    a: Option<PyReadonlyArrayDyn<'py, f64>>,
    b: Option<PyReadonlyArrayDyn<'py, f64>>,
    cost: Option<PyReadonlyArrayDyn<'py, f64>>,
    points: Option<(PyReadonlyArrayDyn<'py, f64>, PyReadonlyArrayDyn<'py, f64>)>,
    lambda_ent: f64,
    lambda_a: f64,
    lambda_b: f64,
    reference: &str,
    tol: f64,
    max_sweeps: usize,
    acceleration: &str,
    gamma: f64,
    beta: Option<f64>,
    cutoff: f64,
) -> PyResult<Transport> {
    let reference = match reference {
        "kl" => EntropyReference::Kl,
        "entropy" => EntropyReference::Entropy,
        "plogp" => EntropyReference::PLogP,
        other => return Err(unknown("reg_type", other, "kl, entropy or plogp")),
    };
    let acceleration = match acceleration {
        "auto" => Acceleration::Auto,
        "plain" => Acceleration::Plain,
        "overrelaxed" => Acceleration::OverRelaxed,
        "anderson" => Acceleration::Anderson,
        other => {
            return Err(unknown("acceleration", other, "auto, plain, overrelaxed or anderson"));
        }
    };
    let cost = match (cost, points) {
        (Some(matrix), None) => match *matrix.as_array().shape() {
            [n, m] => Cost::Matrix(values(&matrix)?, n, m),
            _ => return Err(PyValueError::new_err("cost: expected an array [n, m]")),
        },
        (None, Some((x, y))) => {
            let bandwidth = beta.map_or(Bandwidth::MedianTimes(gamma), Bandwidth::Fixed);
            let params = WelschParams { bandwidth, cutoff, ..WelschParams::default() };
            Cost::Points(Clouds::read(&x, &y)?, params)
        }
        _ => return Err(PyValueError::new_err("expected either cost or points")),
    };
    let weights =
        |array: Option<PyReadonlyArrayDyn<'py, f64>>| array.as_ref().map(values).transpose();
    let (a, b) = (weights(a)?, weights(b)?);
    let params = SinkhornParams {
        lambda_ent,
        lambda_a,
        lambda_b,
        reference,
        tol,
        max_sweeps,
        acceleration,
        ..SinkhornParams::default()
    };
    let work = move || -> Result<Transport, UotError> {
        let problem = match cost {
            Cost::Matrix(cost, n, m) => UotProblem::from_cost(cost, n, m)?,
            Cost::Points(clouds, params) => clouds.problem(&params)?,
        };
        let uniform = |count: usize| vec![(count as f64).recip(); count];
        let problem = if a.is_some() || b.is_some() {
            let a = a.unwrap_or_else(|| uniform(problem.num_rows()));
            let b = b.unwrap_or_else(|| uniform(problem.num_cols()));
            problem.with_marginals(a, b)?
        } else {
            problem
        };
        let output = Sinkhorn::new(params)?.solve(&problem)?;
        Ok(Transport { problem: Arc::new(problem), output: Arc::new(output) })
    };
    compute(py, work)?.map_err(|error| value_error(&error))
}

fn unknown(name: &str, found: &str, expected: &str) -> PyErr {
    PyValueError::new_err(format!("{name} {found:?}: expected {expected}"))
}
