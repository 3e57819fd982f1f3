//! Classifiers, whose labels are the indices of Python's classes.

use std::sync::OnceLock;

use elm::classify::{ClassAccumulator, ClassPredictor, ClassWeights, LabeledRows};
use elm::{ElmClassifier, Scalar, onnx, persist};
use ndarray::{Array2, ArrayView1, ArrayView2};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::pool::on_threads;
use crate::regressor::precision;
use crate::scalars::{Either, either, on_rows};
use crate::settings::{Recipe, Settings, error};

struct Packed<A: Scalar> {
    model: ElmClassifier<A, u32>,
    predictor: OnceLock<ClassPredictor<A>>,
    relevance: Vec<f64>,
}

impl<A: Scalar> Packed<A> {
    fn of(model: ElmClassifier<A, u32>) -> Self {
        Self {
            model,
            predictor: OnceLock::new(),
            relevance: Vec::new(),
        }
    }

    fn predictor(&self) -> &ClassPredictor<A> {
        self.predictor.get_or_init(|| self.model.predictor())
    }

    fn probabilities(&self, x: ArrayView2<'_, A>) -> PyResult<Array2<A>> {
        self.predictor().predict_proba(&x).map_err(error)
    }

    fn decisions(&self, x: ArrayView2<'_, A>) -> PyResult<Array2<A>> {
        self.predictor().decision_function(&x).map_err(error)
    }
}

/// What rows and classes count for.
struct Weights<'a, A: Scalar> {
    rows: Option<ArrayView1<'a, A>>,
    classes: Option<Vec<f64>>,
    balanced: bool,
}

fn labeled<'a, A: Scalar>(
    x: &'a ArrayView2<'_, A>,
    labels: &[u32],
    classes: u32,
    weights: Weights<'_, A>,
) -> elm::Result<LabeledRows<'a, A, u32>> {
    let all: Vec<u32> = (0..classes).collect();
    let mut rows = LabeledRows::with_classes(x, labels, &all)?;
    if let Some(weights) = &weights.rows {
        rows = rows.with_weights(weights)?;
    }
    let of_classes = match weights.classes {
        _ if weights.balanced => ClassWeights::Balanced,
        Some(given) => ClassWeights::Given((0..).zip(given).collect()),
        None => ClassWeights::Equal,
    };
    rows.with_class_weights(of_classes)
}

fn fit<A: Scalar>(
    settings: &Settings,
    x: ArrayView2<'_, A>,
    labels: &[u32],
    classes: u32,
    weights: Weights<'_, A>,
) -> PyResult<Packed<A>> {
    let rows = labeled(&x, labels, classes, weights).map_err(error)?;
    match settings.recipe()? {
        Recipe::Given(params) => Ok(Packed::of(params.fit_labeled(&rows).map_err(error)?)),
        Recipe::Search(tuner) => {
            let tuned = tuner.tune_classifier(&rows).map_err(error)?;
            let classifier = match settings.with_alpha(&tuned.params)? {
                Some(params) => params.fit_labeled(&rows).map_err(error)?,
                None => tuned.classifier,
            };
            let mut packed = Packed::of(classifier);
            packed.relevance = tuned.params.relevance(x.ncols());
            Ok(packed)
        }
    }
}

type Kind = Either<Packed<f32>, Packed<f64>>;

/// A fitted classifier of classes 0, 1 and so on.
#[pyclass(frozen, module = "elm_learn._elm_learn")]
pub(crate) struct Classifier {
    kind: Kind,
}

#[pymethods]
impl Classifier {
    /// Fits to rows of `float32` or `float64` and the index of each row's class.
    #[staticmethod]
    #[pyo3(signature = (settings, x, labels, classes, weights=None, class_weights=None, balanced=false))]
    #[allow(clippy::too_many_arguments)]
    fn fit(
        py: Python<'_>,
        settings: &Settings,
        x: &Bound<'_, PyAny>,
        labels: PyReadonlyArray1<'_, u32>,
        classes: u32,
        weights: Option<&Bound<'_, PyAny>>,
        class_weights: Option<Vec<f64>>,
        balanced: bool,
    ) -> PyResult<Self> {
        let labels = labels.as_array().to_vec();
        let kind = if let Ok(x) = x.extract::<PyReadonlyArray2<'_, f64>>() {
            let w: Option<PyReadonlyArray1<'_, f64>> = weights.map(|w| w.extract()).transpose()?;
            let weights = Weights {
                rows: w.as_ref().map(|w| w.as_array()),
                classes: class_weights,
                balanced,
            };
            let x = x.as_array();
            Kind::F64(on_threads(py, settings.threads, || {
                fit(settings, x, &labels, classes, weights)
            })??)
        } else {
            let x = x.extract::<PyReadonlyArray2<'_, f32>>()?;
            let w: Option<PyReadonlyArray1<'_, f32>> = weights.map(|w| w.extract()).transpose()?;
            let weights = Weights {
                rows: w.as_ref().map(|w| w.as_array()),
                classes: class_weights,
                balanced,
            };
            let x = x.as_array();
            Kind::F32(on_threads(py, settings.threads, || {
                fit(settings, x, &labels, classes, weights)
            })??)
        };
        Ok(Self { kind })
    }

    fn predict_proba<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        either!(&self.kind, model => on_rows(py, x, threads, |x| model.probabilities(x)))
    }

    fn decision_function<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        either!(&self.kind, model => on_rows(py, x, 1, |x| model.decisions(x)))
    }

    /// Leave-one-out RMSE of the 0 and 1 of each class, where the solver knows it.
    #[getter]
    fn leave_one_out(&self) -> Option<Vec<f64>> {
        either!(&self.kind, model => model.model.model().diagnosis().leave_one_out.clone())
    }

    #[getter]
    fn alpha(&self) -> Vec<f64> {
        either!(&self.kind, model => model.model.model().diagnosis().lambda.clone())
    }

    #[getter]
    fn neurons(&self) -> usize {
        either!(&self.kind, model => model.model.model().hidden().neurons())
    }

    /// The scale of each input, where a search has been made.
    #[getter]
    fn relevance(&self) -> Vec<f64> {
        either!(&self.kind, model => model.relevance.clone())
    }

    #[getter]
    fn dtype(&self) -> &'static str {
        self.kind.dtype()
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = either!(&self.kind, model => persist::to_bytes(&model.model)).map_err(error)?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        let kind = match Either::load(bytes)? {
            Either::F32(model) => Kind::F32(Packed::of(model)),
            Either::F64(model) => Kind::F64(Packed::of(model)),
        };
        Ok(Self { kind })
    }

    fn to_onnx<'py>(&self, py: Python<'py>, double: bool) -> PyResult<Bound<'py, PyBytes>> {
        let precision = precision(double);
        let bytes = either!(&self.kind, model => onnx::classifier(&model.model, precision));
        Ok(PyBytes::new(py, &bytes.map_err(error)?))
    }
}

/// Rows in pieces, in double precision.
#[pyclass(module = "elm_learn._elm_learn")]
pub(crate) struct ClassRows {
    rows: ClassAccumulator<f64, u32>,
}

#[pymethods]
impl ClassRows {
    /// For rows like those of `x` and `labels`, on which settings that are to be chosen are searched for;
    /// without any.
    #[staticmethod]
    fn prepare(
        py: Python<'_>,
        settings: &Settings,
        x: PyReadonlyArray2<'_, f64>,
        labels: PyReadonlyArray1<'_, u32>,
        classes: u32,
        class_weights: Option<Vec<f64>>,
    ) -> PyResult<Self> {
        let (x, labels) = (x.as_array(), labels.as_array().to_vec());
        let weights = Weights {
            rows: None,
            classes: class_weights,
            balanced: false,
        };
        on_threads(py, settings.threads, || {
            let params = match settings.recipe()? {
                Recipe::Given(params) => params,
                Recipe::Search(tuner) => {
                    let rows = labeled(&x, &labels, classes, weights).map_err(error)?;
                    let found = tuner.tune_classifier(&rows).map_err(error)?.params;
                    settings.with_alpha(&found)?.unwrap_or(found)
                }
            };
            let all: Vec<u32> = (0..classes).collect();
            let rows = ClassAccumulator::from_sample(&params, &x, &all).map_err(error)?;
            Ok(Self {
                rows: rows.with_unlike_rows(true),
            })
        })?
    }

    #[pyo3(signature = (x, labels, weights, class_weights, threads))]
    fn push(
        &mut self,
        py: Python<'_>,
        x: PyReadonlyArray2<'_, f64>,
        labels: PyReadonlyArray1<'_, u32>,
        weights: Option<PyReadonlyArray1<'_, f64>>,
        class_weights: Option<Vec<f64>>,
        threads: usize,
    ) -> PyResult<()> {
        let labels = labels.as_array().to_vec();
        let classes = self.rows.classes().len() as u32;
        let weights = Weights {
            rows: weights.as_ref().map(|w| w.as_array()),
            classes: class_weights,
            balanced: false,
        };
        let (x, rows) = (x.as_array(), &mut self.rows);
        let push = || rows.push_labeled(&labeled(&x, &labels, classes, weights)?);
        on_threads(py, threads, push)?.map_err(error)
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

    fn fit(&self, py: Python<'_>, threads: usize) -> PyResult<Classifier> {
        let model = on_threads(py, threads, || self.rows.fit())?.map_err(error)?;
        Ok(Classifier {
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
