//! From the parameters of an estimator to the library's.

use elm::solve::{Ridge, Solver};
use elm::{Activation, ElmParams, Scalar, Tuner};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// An error of the library as Python's.
pub(crate) fn error(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// The settings of a fit, checked and converted by the Python classes.
#[pyclass(frozen, module = "elm_learn._elm_learn")]
pub(crate) struct Settings {
    /// Nothing to choose.
    neurons: Option<usize>,
    activation: String,
    /// Nothing to choose.
    scale: Option<f64>,
    alpha: String,
    direct_links: bool,
    seed: u64,
    pub(crate) threads: usize,
}

#[pymethods]
impl Settings {
    #[new]
    #[pyo3(signature = (neurons, activation, scale, alpha, direct_links, seed, threads))]
    fn new(
        neurons: Option<usize>,
        activation: String,
        scale: Option<f64>,
        alpha: String,
        direct_links: bool,
        seed: u64,
        threads: usize,
    ) -> Self {
        Self {
            neurons,
            activation,
            scale,
            alpha,
            direct_links,
            seed,
            threads,
        }
    }
}

/// What makes a model.
pub(crate) enum Recipe<A: Scalar> {
    Given(ElmParams<A>),
    Search(Tuner<A>),
}

impl Settings {
    /// The library's settings, with a number of neurons.
    pub(crate) fn params<A: Scalar>(&self) -> PyResult<ElmParams<A>> {
        let activation: Activation<A> = self.activation.parse().map_err(error)?;
        Ok(ElmParams::new(self.neurons.unwrap_or(100))
            .with_activation(activation)
            .with_scale(self.scale.unwrap_or(1.0))
            .with_direct_links(self.direct_links)
            .with_seed(self.seed)
            .with_solver(self.solver()?))
    }

    pub(crate) fn recipe<A: Scalar>(&self) -> PyResult<Recipe<A>> {
        Ok(match (self.neurons, self.scale) {
            (None, _) => Recipe::Search(ElmParams::auto().with_seed(self.seed)),
            (Some(_), None) => Recipe::Search(self.params()?.tuner()),
            (Some(_), Some(_)) => Recipe::Given(self.params()?),
        })
    }

    /// What a search found, with the strength of ridge where that is given; nothing where a search has
    /// chosen that as well.
    pub(crate) fn with_alpha<A: Scalar>(
        &self,
        found: &ElmParams<A>,
    ) -> PyResult<Option<ElmParams<A>>> {
        if self.alpha == "loo" {
            return Ok(None);
        }
        Ok(Some(found.clone().with_solver(self.solver()?)))
    }

    fn solver(&self) -> PyResult<Solver> {
        Ok(match self.alpha.as_str() {
            "loo" => Ridge::leave_one_out().into(),
            "gcv" => Ridge::gcv().into(),
            number => Ridge::relative(number.parse().map_err(error)?).into(),
        })
    }
}
