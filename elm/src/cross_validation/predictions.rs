//! Held-out predictions, and their errors along a path of strengths.

use std::marker::PhantomData;

use ndarray::{Array1, Array2, ArrayView, ArrayView2, Axis, Ix2};

use crate::dataset::{TargetDim, per_output};
use crate::scalar::Scalar;
use crate::solve::lambda_grid::last_within;

/// Predictions for rows by fits that have not seen them; made by
/// [`ElmParams::cross_val_predict`](crate::ElmParams::cross_val_predict) and by
/// [`CrossValidator`](super::CrossValidator). They have the dimension of the targets.
///
/// ```
/// use elm::{Dataset, ElmParams};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let t = x.mapv(f64::sin);
/// let data = Dataset::new(&x, &t)?;
/// let held_out = ElmParams::new(20).cross_val_predict(&data, &data.folds(6, 1)?)?;
/// assert!((&held_out.predictions() + &held_out.residuals() - &t).iter().all(|d| d.abs() < 1e-12));
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct CvPredictions<A: Scalar, D: TargetDim = Ix2> {
    pub(super) predictions: Array2<A>,
    pub(super) residuals: Array2<A>,
    /// Relative to the largest.
    pub(super) weights: Array1<A>,
    pub(super) dimension: PhantomData<D>,
}

impl<A: Scalar> CvPredictions<A> {
    /// The same, as arrays of the dimension of the targets.
    pub(crate) fn of_dimension<D: TargetDim>(self) -> CvPredictions<A, D> {
        CvPredictions {
            predictions: self.predictions,
            residuals: self.residuals,
            weights: self.weights,
            dimension: PhantomData,
        }
    }
}

impl<A: Scalar, D: TargetDim> CvPredictions<A, D> {
    /// The prediction for each row and output, shape (rows, outputs) or (rows).
    #[must_use]
    pub fn predictions(&self) -> ArrayView<'_, A, D> {
        D::of_matrix_view(self.predictions.view())
    }

    /// Target less prediction, shape (rows, outputs) or (rows); not subtracted from the predictions, so that
    /// small ones have all their digits.
    #[must_use]
    pub fn residuals(&self) -> ArrayView<'_, A, D> {
        D::of_matrix_view(self.residuals.view())
    }

    /// Root mean squared residual of each output over all rows, with the weights of the fit.
    #[must_use]
    pub fn rmse(&self) -> D::PerOutput<f64> {
        per_output::<D, _>(self.residuals.ncols(), |output| self.rmse_of(output))
    }

    pub(super) fn rmse_of(&self, output: usize) -> f64 {
        crate::metrics::root_mean_square(self.residuals.column(output), self.weights.view())
    }
}

/// Held-out errors along a path of strengths; made by [`CrossValidator`](super::CrossValidator).
///
/// ```
/// use elm::solve::{LeastSquares, Ridge};
/// use elm::cross_validation::CrossValidator;
/// use ndarray::{Array2, array};
///
/// let h = Array2::from_shape_fn((12, 3), |(i, j)| (i as f64 * 0.7 + j as f64).sin());
/// let t = h.dot(&array![[1.0], [-2.0], [0.5]]);
/// let validator = CrossValidator::new(&LeastSquares::new(&h, &t)?)?;
/// let path = validator.leave_one_out_path(&[1.0, 1e-3, 1e-6])?;
/// // Without noise the weakest is the best.
/// assert_eq!(path.best(), [1e-6]);
/// assert!(path.rmse()[[0, 0]] > path.rmse()[[2, 0]]);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LambdaPath {
    pub(super) lambdas: Vec<f64>,
    pub(super) rmse: Array2<f64>,
    /// For each output the size of its (centered) targets.
    pub(super) scale: Array1<f64>,
}

/// Scores that differ by rounding alone.
const EQUAL: f64 = 1e-9;

impl LambdaPath {
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
            .map(|scores| self.lambdas[last_within(scores, EQUAL)])
            .collect()
    }

    /// For each output, or for all together, the strongest whose error exceeds the smallest by no more than
    /// this share.
    pub(super) fn strongest(&self, shared: bool, tolerance: f64) -> Vec<f64> {
        let strength = |scores| self.lambdas[last_within(scores, tolerance)];
        if !shared {
            return self.rmse.columns().into_iter().map(strength).collect();
        }
        let relative = (&self.rmse / &self.scale).mapv(|r| r * r).sum_axis(Axis(1));
        let best = strength(relative.mapv_into(f64::sqrt).view());
        vec![best; self.rmse.ncols()]
    }

    /// The strength with the smallest sum over outputs of the squared error relative to the
    /// output's own variance.
    #[must_use]
    pub fn best_shared(&self) -> f64 {
        let relative = &self.rmse / &self.scale;
        self.lambdas[last_within(relative.mapv(|r| r * r).sum_axis(Axis(1)).view(), EQUAL)]
    }
}
