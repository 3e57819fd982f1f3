//! Every fold's complete fit, from the one factorization.

use std::marker::PhantomData;

use ndarray::{Array2, ArrayView, Axis, Ix2};

use super::{CrossValidator, Fold};
use crate::dataset::TargetDim;
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// What the fit without one fold predicts; made by
/// [`ElmParams::fold_predictions`](crate::ElmParams::fold_predictions) and by
/// [`CrossValidator::fold_predictions`].
///
/// ```
/// use elm::{Dataset, ElmParams, metrics::rmse, solve::Ridge};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let t = x.column(0).mapv(f64::sin);
/// let data = Dataset::new(&x, &t)?;
/// let folds = data.folds(6, 1)?;
/// let params = ElmParams::new(20).with_solver(Ridge::relative(1e-8));
/// for fit in params.fold_predictions(&data, &folds)? {
///     let trained: Vec<usize> = (0..60).filter(|&row| folds[row] != fit.label()).collect();
///     let p = fit.predictions().select(Axis(0), &trained);
///     assert!(rmse(&p, &t.select(Axis(0), &trained))? < 1e-2);
/// }
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct FoldPredictions<A: Scalar, D: TargetDim = Ix2> {
    label: usize,
    predictions: Array2<A>,
    dimension: PhantomData<D>,
}

impl<A: Scalar> FoldPredictions<A> {
    /// The same, as arrays of the dimension of the targets.
    pub(crate) fn of_dimension<D: TargetDim>(self) -> FoldPredictions<A, D> {
        FoldPredictions {
            label: self.label,
            predictions: self.predictions,
            dimension: PhantomData,
        }
    }
}

impl<A: Scalar, D: TargetDim> FoldPredictions<A, D> {
    /// The label of the fold that was left out.
    #[must_use]
    pub fn label(&self) -> usize {
        self.label
    }

    /// The prediction for every row, in the fold or not, shape (rows, outputs) or (rows).
    #[must_use]
    pub fn predictions(&self) -> ArrayView<'_, A, D> {
        D::of_matrix_view(self.predictions.view())
    }
}

impl<A: Scalar> CrossValidator<A> {
    /// As [`k_fold`](Self::k_fold), with what each fold's fit predicts for the rows that it was
    /// fitted to as well: one entry per fold, in rising order of its label.
    ///
    /// Leaving rows out is fitting the targets less their held-out residuals (see the
    /// [module](crate::cross_validation)), so the fit without a fold costs one product with $U$.
    ///
    /// # Errors
    /// Those of [`k_fold`](Self::k_fold).
    pub fn fold_predictions(
        &self,
        folds: &[usize],
        lambda: &[f64],
    ) -> Result<Vec<FoldPredictions<A>>> {
        let strengths = self.by_strength(lambda)?;
        let coordinates = self.row_coordinates();
        let folds = Fold::divide(self, folds)?;
        let fit = |fold: &Fold<A>| {
            let mut predictions = Array2::zeros(self.targets.dim());
            for (strength, outputs) in &strengths {
                self.fit_without(fold, *strength, outputs, &coordinates, &mut predictions)?;
            }
            if !predictions.iter().all(|p| p.is_finite()) {
                return Err(Error::Overflow {
                    what: "a held-out prediction",
                });
            }
            Ok(FoldPredictions {
                label: fold.label,
                predictions,
                dimension: PhantomData,
            })
        };
        folds.iter().map(fit).collect()
    }

    /// Coordinates of every row, without its weight, along the right singular vectors.
    fn row_coordinates(&self) -> Array2<A> {
        let mut coordinates = self.rows.u.clone();
        let roots = &self.rows.spectrum.frame.root_weights;
        for (mut row, &root) in coordinates.rows_mut().into_iter().zip(roots) {
            if root > A::zero() {
                row.mapv_inplace(|u| u / root);
            }
        }
        for (&row, absent) in self.absent.iter().zip(self.absent_coordinates.rows()) {
            coordinates.row_mut(row).assign(&absent);
        }
        coordinates
    }

    fn fit_without(
        &self,
        fold: &Fold<A>,
        strength: A,
        outputs: &[usize],
        coordinates: &Array2<A>,
        predictions: &mut Array2<A>,
    ) -> Result<()> {
        let frame = &self.rows.spectrum.frame;
        let inner = fold.residuals(self, strength, outputs)?;
        let fitted = self.fitted_without(&fold.rows, &inner, strength, outputs, coordinates);
        for (column, &output) in outputs.iter().enumerate() {
            let (scale, mean) = (frame.target_scale[output], frame.target_mean[output]);
            let mut to = predictions.column_mut(output);
            to.assign(&fitted.column(column).mapv(|above| above * scale + mean));
            // As `k_fold` has them, to the last bit.
            for (place, &row) in fold.rows.iter().enumerate() {
                let residual = inner[[place, column]] / frame.root_weights[row] * scale;
                to[row] = self.targets[[row, output]] - residual;
            }
        }
        Ok(())
    }

    /// What the fit without `rows`, which have the inner held-out residuals `inner`, gives at
    /// `coordinates`: above the mean and in the scale of the factorization, shape (coordinates,
    /// `outputs`).
    pub(super) fn fitted_without(
        &self,
        rows: &[usize],
        inner: &Array2<A>,
        strength: A,
        outputs: &[usize],
        coordinates: &Array2<A>,
    ) -> Array2<A> {
        let spectrum = &self.rows.spectrum;
        // Leaving rows out is fitting the targets less their held-out residuals.
        let mut c = spectrum.c.select(Axis(1), outputs);
        c -= &A::product(self.rows.u.select(Axis(0), rows).t(), inner.view());
        c *= &spectrum.filter_factors(strength).insert_axis(Axis(1));
        let constant = self.rows.constant.select(Axis(0), rows).dot(inner)
            / -spectrum.frame.total_weight.sqrt();
        A::product(coordinates.view(), c.view()) + &constant
    }
}
