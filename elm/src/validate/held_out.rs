//! Held-out predictions, and their errors along a path of strengths.

use ndarray::{Array1, Array2, ArrayView2, Axis};

use crate::scalar::Scalar;
use crate::solve::Ridge;

/// Predictions for rows by fits that have not seen them; made by [`Validator`](super::Validator) and by
/// [`CheckedParams::cross_validate`](crate::CheckedParams::cross_validate).
///
/// ```
/// use elm::{ElmParams, validate::assign_folds};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let t = x.mapv(f64::sin);
/// let params = ElmParams::new(20).check()?;
/// let held_out = params.cross_validate(&x, &t, &assign_folds(60, 6, 1)?)?;
/// assert!((&held_out.predictions() + &held_out.residuals() - &t).iter().all(|d| d.abs() < 1e-12));
/// # Ok::<(), elm::Error>(())
/// ```
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
///
/// ```
/// use elm::solve::{LeastSquares, Ridge};
/// use elm::validate::Validator;
/// use ndarray::{Array2, array};
///
/// let h = Array2::from_shape_fn((12, 3), |(i, j)| (i as f64 * 0.7 + j as f64).sin());
/// let t = h.dot(&array![[1.0], [-2.0], [0.5]]);
/// let validator = Validator::new(&LeastSquares::new(&h, &t)?)?;
/// let path = validator.leave_one_out_path(&[1.0, 1e-3, 1e-6])?;
/// // Without noise the weakest is the best.
/// assert_eq!(path.best(), [1e-6]);
/// assert!(path.rmse()[[0, 0]] > path.rmse()[[2, 0]]);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    pub(super) lambdas: Vec<f64>,
    pub(super) rmse: Array2<f64>,
    /// For each output the size of its (centred) targets.
    pub(super) scale: Array1<f64>,
}

/// Scores that differ by rounding alone.
const EQUAL: f64 = 1e-9;

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
            .map(|scores| self.lambdas[Ridge::last_within(scores, EQUAL)])
            .collect()
    }

    /// The strength with the smallest sum over outputs of the squared error relative to the
    /// output's own variance.
    #[must_use]
    pub fn best_shared(&self) -> f64 {
        let relative = &self.rmse / &self.scale;
        self.lambdas[Ridge::last_within(relative.mapv(|r| r * r).sum_axis(Axis(1)).view(), EQUAL)]
    }
}
