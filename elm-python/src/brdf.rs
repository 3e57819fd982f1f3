//! Reflectance models.

use elm_brdf::model::{BrdfModel, Tuned};
use elm_datasets::Brdf as _;
use elm_datasets::geometry::DirectionPair;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::settings::error;

/// A fitted reflectance model.
#[pyclass(frozen, module = "elm_learn._elm_learn")]
pub(crate) struct Brdf {
    model: BrdfModel,
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
    let unit = |v: ndarray::ArrayView1<'_, f64>| -> [f64; 3] {
        let length = v.dot(&v).sqrt();
        [v[0] / length, v[1] / length, v[2] / length]
    };
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
        let model = py.detach(|| BrdfModel::load(path)).map_err(error)?;
        Ok(Self { model })
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
        let model = py
            .detach(|| tuned.fit_model(&pairs, values))
            .map_err(error)?;
        Ok(Self { model })
    }

    /// BRDF in 1/sr, shape (pairs, channels).
    fn eval<'py>(
        &self,
        py: Python<'py>,
        wi: PyReadonlyArray2<'_, f64>,
        wo: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pairs = pairs(&wi, &wo)?;
        let values = py.detach(|| self.model.eval(&pairs)).map_err(error)?;
        Ok(values.into_pyarray(py))
    }

    fn save(&self, py: Python<'_>, path: std::path::PathBuf) -> PyResult<()> {
        py.detach(|| self.model.save(path)).map_err(error)
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
