//! Reflectance models.

use std::sync::OnceLock;

use elm_brdf::model::{BrdfModel, Tuned};
use elm_datasets::Brdf as _;
use elm_datasets::geometry::{DirectionPair, Vector};
use elm_datasets::mixture::LobeMixture;
use ndarray::{Array1, Array2, ArrayView1};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::pool::on_threads;
use crate::regressor::precision;
use crate::settings::error;

/// A fitted reflectance model.
#[pyclass(frozen, module = "elm_learn._elm_learn")]
pub(crate) struct Brdf {
    model: BrdfModel,
    /// Fitted when it is first needed.
    mixture: OnceLock<LobeMixture>,
}

impl Brdf {
    fn of(model: BrdfModel) -> Self {
        let mixture = OnceLock::new();
        Self { model, mixture }
    }

    fn mixture(&self) -> PyResult<&LobeMixture> {
        if let Some(mixture) = self.mixture.get() {
            return Ok(mixture);
        }
        let fitted = LobeMixture::of(&self.model).map_err(error)?;
        Ok(self.mixture.get_or_init(|| fitted))
    }
}

/// Directions, and their densities in 1/sr.
type Drawn<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

fn is_above(w: Vector) -> bool {
    w[2] > 0.0
}

fn unit(v: ArrayView1<'_, f64>) -> Vector {
    let length = v.dot(&v).sqrt();
    [v[0] / length, v[1] / length, v[2] / length]
}

/// Pairs of unit vectors, shape (pairs, 3) each.
fn pairs(
    wi: &PyReadonlyArray2<'_, f64>,
    wo: &PyReadonlyArray2<'_, f64>,
) -> PyResult<Vec<DirectionPair>> {
    let (wi, wo) = (wi.as_array(), wo.as_array());
    if wi.ncols() != 3 || wi.dim() != wo.dim() {
        return Err(PyValueError::new_err(format!(
            "wi and wo must have one shape (pairs, 3), found {:?} and {:?}",
            wi.shape(),
            wo.shape()
        )));
    }
    let rows = wi.rows().into_iter().zip(wo.rows());
    Ok(rows
        .map(|(wi, wo)| DirectionPair {
            incident: unit(wi),
            outgoing: unit(wo),
        })
        .collect())
}

#[pymethods]
impl Brdf {
    #[staticmethod]
    fn load(py: Python<'_>, path: std::path::PathBuf) -> PyResult<Self> {
        on_threads(py, 1, || BrdfModel::load(path))?
            .map(Self::of)
            .map_err(error)
    }

    #[staticmethod]
    #[pyo3(signature = (wi, wo, values, neurons=None))]
    fn fit(
        py: Python<'_>,
        wi: PyReadonlyArray2<'_, f64>,
        wo: PyReadonlyArray2<'_, f64>,
        values: PyReadonlyArray2<'_, f64>,
        neurons: Option<usize>,
    ) -> PyResult<Self> {
        let pairs = pairs(&wi, &wo)?;
        let values = values.as_array();
        let tuned = Tuned {
            neurons,
            ..Tuned::default()
        };
        on_threads(py, 1, || tuned.fit_model(&pairs, values))?
            .map(Self::of)
            .map_err(error)
    }

    /// BRDF in 1/sr, shape (pairs, channels).
    fn eval<'py>(
        &self,
        py: Python<'py>,
        wi: PyReadonlyArray2<'_, f64>,
        wo: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pairs = pairs(&wi, &wo)?;
        let values = on_threads(py, 1, || self.model.eval(&pairs))?.map_err(error)?;
        Ok(values.into_pyarray(py))
    }

    /// Directions towards the light and their densities, for viewers (n, 3) and uniform numbers (n, 2).
    fn sample<'py>(
        &self,
        py: Python<'py>,
        wo: PyReadonlyArray2<'_, f64>,
        u: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Drawn<'py>> {
        let (wo, u) = (wo.as_array(), u.as_array());
        if wo.ncols() != 3 || u.dim() != (wo.nrows(), 2) {
            return Err(PyValueError::new_err(format!(
                "wo must have shape (n, 3) and u (n, 2), found {:?} and {:?}",
                wo.shape(),
                u.shape()
            )));
        }
        let (directions, densities) = on_threads(py, 1, || -> PyResult<_> {
            let mixture = self.mixture()?;
            let mut directions = Array2::zeros((wo.nrows(), 3));
            let mut densities = Array1::zeros(wo.nrows());
            for (row, (wo, u)) in wo.rows().into_iter().zip(u.rows()).enumerate() {
                let wo = unit(wo);
                let (direction, density) = mixture.sample(wo, [u[0], u[1]]);
                directions
                    .row_mut(row)
                    .assign(&ArrayView1::from(&direction));
                densities[row] = if is_above(wo) { density } else { 0.0 };
            }
            Ok((directions, densities))
        })??;
        Ok((directions.into_pyarray(py), densities.into_pyarray(py)))
    }

    /// Densities of `sample` in 1/sr.
    fn pdf<'py>(
        &self,
        py: Python<'py>,
        wi: PyReadonlyArray2<'_, f64>,
        wo: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let pairs = pairs(&wi, &wo)?;
        let densities: Array1<f64> = on_threads(py, 1, || -> PyResult<_> {
            let mixture = self.mixture()?;
            let density = |pair: &DirectionPair| mixture.density(pair.outgoing, pair.incident);
            let densities = pairs.iter();
            Ok(densities
                .map(|pair| {
                    if is_above(pair.outgoing) {
                        density(pair)
                    } else {
                        0.0
                    }
                })
                .collect())
        })??;
        Ok(densities.into_pyarray(py))
    }

    fn save(&self, py: Python<'_>, path: std::path::PathBuf) -> PyResult<()> {
        py.detach(|| self.model.save(path)).map_err(error)
    }

    fn to_onnx<'py>(&self, py: Python<'py>, double: bool) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = elm_brdf::export::onnx(&self.model, precision(double)).map_err(error)?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[getter]
    fn channels(&self) -> Vec<String> {
        let named = &self.model.provenance().channels;
        if named.is_empty() {
            return (0..self.model.channels()).map(|c| c.to_string()).collect();
        }
        named.clone()
    }

    #[getter]
    fn is_isotropic(&self) -> bool {
        self.model.is_isotropic()
    }
}
