//! Networks for regression, and what rows in pieces make of them.

use std::sync::OnceLock;

use elm::persist;
use elm::uncertainty::CompactUncertainElm;
use elm::{Accumulator, Dataset, Elm, Predictor, Scalar, onnx};
use ndarray::{Array2, ArrayView2, Axis, Ix2, concatenate};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::pool::on_threads;
use crate::scalars::{Either, either, on_dataset, on_rows};
use crate::settings::{Recipe, Settings, error};

/// A network with its weights packed on first use.
pub(crate) struct Packed<A: Scalar> {
    model: Elm<A>,
    predictor: OnceLock<Predictor<A>>,
    /// What intervals need.
    uncertain: Option<CompactUncertainElm<A>>,
    relevance: Vec<f64>,
}

impl<A: Scalar> Packed<A> {
    fn of(model: Elm<A>) -> Self {
        Self {
            model,
            predictor: OnceLock::new(),
            uncertain: None,
            relevance: Vec::new(),
        }
    }

    fn uncertain_of(uncertain: CompactUncertainElm<A>) -> Self {
        let model = uncertain.model().clone();
        Self {
            uncertain: Some(uncertain),
            ..Self::of(model)
        }
    }

    fn uncertain(&self) -> PyResult<&CompactUncertainElm<A>> {
        let without = || PyTypeError::new_err("fitted without intervals");
        self.uncertain.as_ref().ok_or_else(without)
    }

    fn predict(&self, x: ArrayView2<'_, A>) -> PyResult<Array2<A>> {
        let predictor = self.predictor.get_or_init(|| self.model.predictor());
        predictor.predict(&x).map_err(error)
    }
}

fn fit<A: Scalar>(
    settings: &Settings,
    data: &Dataset<'_, A, Ix2>,
    intervals: bool,
) -> PyResult<Packed<A>> {
    let (model, params) = match settings.recipe()? {
        Recipe::Given(params) => (params.fit_dataset(data).map_err(error)?, params),
        Recipe::Search(tuner) => {
            let tuned = tuner.tune(data).map_err(error)?;
            match settings.with_alpha(&tuned.params)? {
                Some(params) => (params.fit_dataset(data).map_err(error)?, params),
                None => (tuned.model, tuned.params),
            }
        }
    };
    let mut packed = Packed::of(model);
    packed.relevance = params.relevance(data.inputs().ncols());
    if intervals {
        packed.uncertain = Some(params.fit_uncertain(data).map_err(error)?.compact());
    }
    Ok(packed)
}

fn importance<A: Scalar>(
    settings: &Settings,
    model: &Elm<A>,
    data: &Dataset<'_, A, Ix2>,
    repeats: usize,
    seed: u64,
) -> PyResult<Array2<f64>> {
    let params = settings.params::<A>()?;
    let uncertain = params.fit_map_uncertain(model.map().clone(), data);
    let falls = uncertain
        .and_then(|uncertain| uncertain.permutation_importance(data, repeats, seed))
        .map_err(error)?;
    Ok(falls.mean_axis(Axis(1)).unwrap_or_default())
}

type Kind = Either<Packed<f32>, Packed<f64>>;

/// A fitted network.
#[pyclass(frozen, module = "elm_learn._elm_learn")]
pub(crate) struct Network {
    kind: Kind,
}

#[pymethods]
impl Network {
    /// Fits to arrays of one type, all of `float32` or `float64`, shapes (rows, inputs) and (rows, outputs).
    #[staticmethod]
    #[pyo3(signature = (settings, x, y, weights=None, intervals=false))]
    fn fit(
        py: Python<'_>,
        settings: &Settings,
        x: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
        weights: Option<&Bound<'_, PyAny>>,
        intervals: bool,
    ) -> PyResult<Self> {
        let threads = settings.threads;
        let kind = if x.cast::<PyArray2<f64>>().is_ok() {
            Kind::F64(on_dataset(py, threads, (x, y), weights, |data| {
                fit(settings, data, intervals)
            })?)
        } else {
            Kind::F32(on_dataset(py, threads, (x, y), weights, |data| {
                fit(settings, data, intervals)
            })?)
        };
        Ok(Self { kind })
    }

    fn predict<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        either!(&self.kind, model => on_rows(py, x, threads, |x| model.predict(x)))
    }

    /// Lower and upper ends, shape (rows, 2 outputs): all lower ones, then all upper ones.
    fn predict_interval<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        coverage: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        either!(&self.kind, model => {
            let model = model.uncertain()?;
            on_rows(py, x, 1, |x| {
                let (low, high) = model.predict_interval(&x, coverage).map_err(error)?;
                Ok(concatenate![Axis(1), low, high])
            })
        })
    }

    /// Standard deviation of a new observation, shape (rows, outputs).
    fn predict_deviation<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        either!(&self.kind, model => {
            let model = model.uncertain()?;
            on_rows(py, x, 1, |x| model.predict_deviation(&x).map_err(error))
        })
    }

    /// By how much the leave-one-out R2 falls where an input has the values of other rows, shape
    /// (inputs, repeats), the mean over outputs. The rows are those of the fit; output weights are solved for
    /// again.
    #[pyo3(signature = (settings, x, y, weights, repeats, seed))]
    #[expect(clippy::too_many_arguments, reason = "Python passes them by position")]
    fn permutation_importance<'py>(
        &self,
        py: Python<'py>,
        settings: &Settings,
        x: &Bound<'py, PyAny>,
        y: &Bound<'py, PyAny>,
        weights: Option<&Bound<'py, PyAny>>,
        repeats: usize,
        seed: u64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        either!(&self.kind, model => {
            let falls = on_dataset(py, settings.threads, (x, y), weights, |data| {
                importance(settings, &model.model, data, repeats, seed)
            })?;
            Ok(falls.into_pyarray(py))
        })
    }

    #[getter]
    fn has_intervals(&self) -> bool {
        either!(&self.kind, model => model.uncertain.is_some())
    }

    /// Leave-one-out RMSE of each output, where the solver knows it.
    #[getter]
    fn leave_one_out(&self) -> Option<Vec<f64>> {
        either!(&self.kind, model => model.model.diagnosis().leave_one_out.clone())
    }

    /// The strength of ridge of each output.
    #[getter]
    fn alpha(&self) -> Vec<f64> {
        either!(&self.kind, model => model.model.diagnosis().lambda.clone())
    }

    #[getter]
    fn neurons(&self) -> usize {
        either!(&self.kind, model => model.model.hidden().neurons())
    }

    /// The scale of each input.
    #[getter]
    fn relevance(&self) -> Vec<f64> {
        either!(&self.kind, model => model.relevance.clone())
    }

    #[getter]
    fn dtype(&self) -> &'static str {
        self.kind.dtype()
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = either!(&self.kind, model => match &model.uncertain {
            Some(uncertain) => persist::to_bytes(uncertain),
            None => persist::to_bytes(&model.model),
        });
        let bytes = bytes.map_err(error)?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        let is_other = |reason: &persist::Error| matches!(reason, persist::Error::Kind { .. });
        let kind = match Either::try_load(bytes) {
            Err(reason) if is_other(&reason) => match Either::load(bytes)? {
                Either::F32(model) => Kind::F32(Packed::uncertain_of(model)),
                Either::F64(model) => Kind::F64(Packed::uncertain_of(model)),
            },
            Err(reason) => return Err(error(reason)),
            Ok(Either::F32(model)) => Kind::F32(Packed::of(model)),
            Ok(Either::F64(model)) => Kind::F64(Packed::of(model)),
        };
        Ok(Self { kind })
    }

    fn to_onnx<'py>(&self, py: Python<'py>, double: bool) -> PyResult<Bound<'py, PyBytes>> {
        let precision = precision(double);
        let bytes = either!(&self.kind, model => onnx::network(&model.model, precision));
        Ok(PyBytes::new(py, &bytes.map_err(error)?))
    }
}

pub(crate) fn precision(double: bool) -> onnx::Precision {
    if double {
        onnx::Precision::Double
    } else {
        onnx::Precision::Single
    }
}

/// Rows in pieces, in double precision.
#[pyclass(module = "elm_learn._elm_learn")]
pub(crate) struct Rows {
    rows: Accumulator<f64>,
}

#[pymethods]
impl Rows {
    /// An accumulation for rows like those of `x` and `y`, without any row yet. Settings that are to be
    /// chosen are chosen on these rows.
    #[staticmethod]
    fn prepare(
        py: Python<'_>,
        settings: &Settings,
        x: PyReadonlyArray2<'_, f64>,
        y: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let (x, y) = (x.as_array(), y.as_array());
        on_threads(py, settings.threads, || {
            let params = match settings.recipe()? {
                Recipe::Given(params) => params,
                Recipe::Search(tuner) => {
                    let data = Dataset::new(&x, &y).map_err(error)?;
                    let found = tuner.tune(&data).map_err(error)?.params;
                    settings.with_alpha(&found)?.unwrap_or(found)
                }
            };
            let rows = Accumulator::from_sample(&params, &x, y.ncols()).map_err(error)?;
            Ok(Self {
                rows: rows.with_unlike_rows(true),
            })
        })?
    }

    #[pyo3(signature = (x, y, weights, threads))]
    fn push(
        &mut self,
        py: Python<'_>,
        x: PyReadonlyArray2<'_, f64>,
        y: PyReadonlyArray2<'_, f64>,
        weights: Option<PyReadonlyArray1<'_, f64>>,
        threads: usize,
    ) -> PyResult<()> {
        let (x, y, w) = (
            x.as_array(),
            y.as_array(),
            weights.as_ref().map(|w| w.as_array()),
        );
        let rows = &mut self.rows;
        on_threads(py, threads, || {
            let mut data = Dataset::new(&x, &y)?;
            if let Some(w) = &w {
                data = data.with_weights(w)?;
            }
            rows.push_dataset(&data)
        })?
        .map_err(error)
    }

    fn merge(&mut self, py: Python<'_>, other: &Self, threads: usize) -> PyResult<()> {
        on_threads(py, threads, || self.rows.merge(&other.rows))?.map_err(error)
    }

    fn compact(&mut self, py: Python<'_>, threads: usize) -> PyResult<()> {
        on_threads(py, threads, || self.rows.compact())?.map_err(error)
    }

    fn forget(&mut self, factor: f64) -> PyResult<()> {
        self.rows.forget(factor).map_err(error)
    }

    #[getter]
    fn rows(&self) -> u64 {
        self.rows.rows()
    }

    fn fit(&self, py: Python<'_>, threads: usize) -> PyResult<Network> {
        let model = on_threads(py, threads, || self.rows.fit())?.map_err(error)?;
        Ok(Network {
            kind: Kind::F64(Packed::of(model)),
        })
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = persist::to_bytes(&self.rows).map_err(error)?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        let rows = persist::from_bytes(bytes).map_err(error)?;
        Ok(Self { rows })
    }
}
