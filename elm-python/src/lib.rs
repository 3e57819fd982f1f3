//! The Rust side of the Python package `elm_learn`: arrays in, arrays out, the interpreter's lock released
//! while anything is computed. What scikit-learn asks of its estimators is in Python, `python/elm_learn`.

mod brdf;
mod classifier;
mod pool;
mod regressor;
mod scalars;
mod settings;

use pyo3::prelude::*;

#[pymodule]
mod _elm_learn {
    #[pymodule_export]
    use crate::brdf::Brdf;
    #[pymodule_export]
    use crate::classifier::{ClassRows, Classifier};
    #[pymodule_export]
    use crate::regressor::{Network, Rows};
    #[pymodule_export]
    use crate::settings::Settings;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn constants(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("SEARCH_ROWS", elm::ElmParams::<f64>::auto().search_rows())
    }
}
