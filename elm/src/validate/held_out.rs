//! What validation answers: predictions of rows not seen, and their errors along a path.

use ndarray::{Array1, Array2, ArrayView2, Axis};

use crate::scalar::Scalar;
use crate::solve::Ridge;

/// Predictions for rows by fits that have not seen them; made by [`Validator`](super::Validator) and by
/// [`CheckedParams::cross_validate`](crate::CheckedParams::cross_validate).
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut<A: Scalar> {
    pub(super) predictions: Array2<A>,
    pub(super) residuals: Array2<A>,
    /// Relative to the largest.
    pub(super) weights: Array1<A>,
}

impl<A: Scalar> HeldOut<A> {
    /// The prediction for each row and output, shape (rows, outputs).
    #[must_use]
    pub fn predictions(&self) -> ArrayView2<'_, A> {
        self.predictions.view()
    }

    /// Target less prediction, shape (rows, outputs); not subtracted from the predictions, so that
    /// small ones have all their digits.
    #[must_use]
    pub fn residuals(&self) -> ArrayView2<'_, A> {
        self.residuals.view()
    }

    /// Root mean squared residual of each output over all rows, with the weights of the fit.
    #[must_use]
    pub fn rmse(&self) -> Vec<f64> {
        self.residuals
            .columns()
            .into_iter()
            .map(|column| crate::metrics::root_mean_square(column, self.weights.view()))
            .collect()
    }
}

/// Held-out errors along a path of strengths; made by [`Validator`](super::Validator).
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    pub(super) lambdas: Vec<f64>,
    pub(super) rmse: Array2<f64>,
    /// For each output the size of its (centred) targets.
    pub(super) scale: Array1<f64>,
}

impl Path {
    /// The relative strengths, as they were asked for.
    #[must_use]
    pub fn lambdas(&self) -> &[f64] {
        &self.lambdas
    }

    /// The held-out RMSE, shape (strengths, outputs).
    #[must_use]
    pub fn rmse(&self) -> ArrayView2<'_, f64> {
        self.rmse.view()
    }

    /// For each output the strength with the smallest error; of equals the last, so the strongest
    /// of a rising path.
    #[must_use]
    pub fn best(&self) -> Vec<f64> {
        self.rmse
            .columns()
            .into_iter()
            .map(|scores| self.lambdas[Ridge::best(scores)])
            .collect()
    }

    /// The strength with the smallest sum over outputs of the squared error relative to the
    /// output's own variance.
    #[must_use]
    pub fn best_shared(&self) -> f64 {
        let relative = &self.rmse / &self.scale;
        self.lambdas[Ridge::best(relative.mapv(|r| r * r).sum_axis(Axis(1)).view())]
    }
}
