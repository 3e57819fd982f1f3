//! Models and arrays of either scalar type.

use elm::persist::{self, Persist};
use elm::{Dataset, Scalar};
use ndarray::{Array2, ArrayView2, Ix2};
use numpy::{Element, IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::pool::on_threads;
use crate::settings::error;

/// What there is for each scalar type.
pub(crate) enum Either<S, D> {
    F32(S),
    F64(D),
}

/// Evaluates an expression for either type.
macro_rules! either {
    ($kind:expr, $model:ident => $value:expr) => {
        match $kind {
            $crate::scalars::Either::F32($model) => $value,
            $crate::scalars::Either::F64($model) => $value,
        }
    };
}
pub(crate) use either;

impl<S, D> Either<S, D> {
    /// NumPy's name of the type.
    pub(crate) fn dtype(&self) -> &'static str {
        match self {
            Self::F32(_) => "float32",
            Self::F64(_) => "float64",
        }
    }
}

impl<S: Persist, D: Persist> Either<S, D> {
    /// Reads a file of either type.
    pub(crate) fn load(bytes: &[u8]) -> PyResult<Self> {
        Self::try_load(bytes).map_err(error)
    }

    pub(crate) fn try_load(bytes: &[u8]) -> Result<Self, persist::Error> {
        match persist::from_bytes::<D>(bytes) {
            Ok(double) => Ok(Self::F64(double)),
            Err(persist::Error::ScalarType { .. }) => {
                persist::from_bytes::<S>(bytes).map(Self::F32)
            }
            Err(reason) => Err(reason),
        }
    }
}

/// What `evaluate` makes of an array, the interpreter's lock released meanwhile.
pub(crate) fn on_rows<'py, A: Element + Sync>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    threads: usize,
    evaluate: impl FnOnce(ArrayView2<'_, A>) -> PyResult<Array2<A>> + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let x = x.extract::<PyReadonlyArray2<'_, A>>()?;
    let x = x.as_array();
    let values = on_threads(py, threads, || evaluate(x))??;
    Ok(values.into_pyarray(py).into_any())
}

/// What `work` makes of rows with targets and perhaps weights, the interpreter's lock released meanwhile.
pub(crate) fn on_dataset<A: Element + Scalar, R: Send>(
    py: Python<'_>,
    threads: usize,
    (x, y): (&Bound<'_, PyAny>, &Bound<'_, PyAny>),
    weights: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Dataset<'_, A, Ix2>) -> PyResult<R> + Send,
) -> PyResult<R> {
    let x = x.extract::<PyReadonlyArray2<'_, A>>()?;
    let y = y.extract::<PyReadonlyArray2<'_, A>>()?;
    let weights: Option<PyReadonlyArray1<'_, A>> = weights.map(|w| w.extract()).transpose()?;
    let (x, y) = (x.as_array(), y.as_array());
    let weights = weights.as_ref().map(|w| w.as_array());
    on_threads(py, threads, || {
        let mut data = Dataset::new(&x, &y).map_err(error)?;
        if let Some(weights) = &weights {
            data = data.with_weights(weights).map_err(error)?;
        }
        work(&data)
    })?
}
