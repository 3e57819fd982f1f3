//! Validation in closed form: what a fit would predict for rows that it has not seen, for any
//! division into folds, from the one factorization of the full fit. No row is ever refitted.
//!
//! ```
//! use elm::solve::{LeastSquares, Ridge};
//! use elm::cross_validation::{CrossValidator, assign_folds};
//! use ndarray::{Array2, array};
//!
//! let h = Array2::from_shape_fn((12, 3), |(i, j)| (i as f64 * 0.7 + j as f64).sin());
//! let t = h.dot(&array![[1.0], [-2.0], [0.5]]) + 3.0;
//! let validator = CrossValidator::new(&LeastSquares::new(&h, &t)?.with_intercept(true))?;
//! let folds = assign_folds(12, 4, 0)?;
//! let path = validator.k_fold_path(&folds, &Ridge::lambda_grid())?;
//! let held_out = validator.k_fold(&folds, &path.best())?;
//! assert!(held_out.rmse()[0] < 1e-6);
//! # Ok::<(), elm::Error>(())
//! ```
//!
//! # How
//! Leaving out the rows of a fold $F$ gives the same fit as giving each of them a parameter of its
//! own (the mean-shift model), whose values are the held-out residuals $e_F$. Eliminating
//! $\beta$ leaves $(I - S_{FF})\\, e_F = r_F$ with $S$ the matrix that maps targets to fitted values
//! and $r$ the residual of the full fit (Cook and Weisberg, Residuals and Influence in Regression,
//! 1982, for one row $e_i = r_i / (1 - h_i)$). With singular vectors $U$ and shares $f$ held back
//! by ridge,
//! $$I - S_{FF} = \left(I - q q^T - U U^T\right)_{FF} + U_F \operatorname{diag}(f) U_F^T,$$
//! a sum of two positive parts, which is how it is computed: $1 - h$ by subtraction has no digits
//! left where a row is nearly interpolated. A fold with more rows than there are directions is
//! solved in the coordinates of the directions instead, from the sum over all *other* rows.
//!
//! # What is and is not seen
//! Ridge's $\lambda$ is relative to the largest singular value of **all** rows; every fold is
//! fitted with that same absolute $\lambda$. When inputs were standardized on all rows, the mean
//! and deviation of a held-out row's inputs have entered the hidden layer (its targets never do);
//! so has a row's input in whatever else was derived from all inputs. That leak is of the order of
//! one row's share in a mean, and it shrinks with the number of rows; protocols that forbid it
//! standardize on the training rows of each fold and refit. Choosing $\lambda$ by a held-out score
//! and then quoting that score as the error is the usual mild optimism of model selection.

mod evidence;
mod fold;
mod fold_predictions;
mod influence;
mod posterior;
mod predictions;

use std::marker::PhantomData;

use ndarray::{Array1, Array2, Axis, Zip};

use crate::check::check_length;
pub use crate::dataset::{assign_blocks, assign_folds};
use crate::error::{Error, Result};
use crate::scalar::Scalar;
use crate::solve::design_svd::DesignSvdWithRows;
use crate::solve::lambda_grid::{TOLERANCE, coarse_grid};
use crate::solve::ridge::ridge_solution;
use crate::solve::{Lambda, LeastSquares, Reason, Ridge, Solution, in_range};
use fold::Fold;
pub(crate) use fold::check_several;
pub use fold_predictions::FoldPredictions;
pub(crate) use influence::Shifts;
pub(crate) use posterior::Posterior;
pub use predictions::{CvPredictions, LambdaPath};

/// A least-squares problem, factorized once, ready to answer what it would predict without some
/// of its rows.
///
/// Strengths are given as one relative $\lambda$ for all outputs or one for each; 0 stands for
/// [`PseudoInverse`](crate::solve::PseudoInverse) with its default cut-off. All answers are those
/// of refitting, up to rounding: about $\epsilon / \lambda$ where a row or fold nearly determines
/// its own fit, and $\epsilon$ times a modest number elsewhere.
///
/// Rows of weight 0 are predicted like all others, without the rest of their fold.
///
/// ```
/// use elm::solve::{LeastSquares, Ridge};
/// use elm::cross_validation::CrossValidator;
/// use ndarray::{Array2, array};
///
/// let h = Array2::from_shape_fn((12, 3), |(i, j)| (i as f64 * 0.7 + j as f64).sin());
/// let t = h.dot(&array![[1.0], [-2.0], [0.5]]);
/// let validator = CrossValidator::new(&LeastSquares::new(&h, &t)?)?;
/// let lambda = validator.select_lambda(Ridge::default())?;
/// // What each row is predicted to be by the fit to the eleven others.
/// let held_out = validator.leave_one_out(&lambda)?;
/// assert!(held_out.rmse()[0] < 1e-6);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct CrossValidator<A: Scalar> {
    rows: DesignSvdWithRows<A>,
    /// As given, shape (rows, outputs).
    targets: Array2<A>,
    /// Weighted, centered and scaled, as the factorization saw them.
    inner_targets: Array2<A>,
    /// The rows of weight 0, and their coordinates in the singular vectors, one row each.
    absent: Vec<usize>,
    absent_coordinates: Array2<A>,
}

impl<A: Scalar> CrossValidator<A> {
    /// Factorizes the problem: one singular value decomposition.
    ///
    /// # Errors
    /// [`Error::NoConvergence`] from the factorization.
    pub fn new(problem: &LeastSquares<'_, A>) -> Result<Self> {
        let rows = DesignSvdWithRows::new(problem)?;
        let spectrum = &rows.spectrum;
        let frame = &spectrum.frame;
        let inner_targets = A::product(rows.u.view(), spectrum.c.view()) + &rows.residual;
        let absent: Vec<usize> = (0..frame.rows)
            .filter(|&row| frame.root_weights[row] == A::zero())
            .collect();
        // Scaled before centering, as the difference of two huge values may overflow.
        let hidden = problem.hidden().select(Axis(0), &absent) / frame.hidden_scale;
        let centered = hidden - frame.hidden_mean.mapv(|m| m / frame.hidden_scale);
        let absent_coordinates = A::product(centered.view(), spectrum.vt.t()) / &spectrum.s;
        Ok(Self {
            targets: problem.targets().to_owned(),
            inner_targets,
            absent,
            absent_coordinates,
            rows,
        })
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.targets.nrows()
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.targets.ncols()
    }

    /// The relative strengths that `ridge` takes for this problem, one per output: given ones, or
    /// chosen from the same factorization.
    ///
    /// # Errors
    /// [`Error::Parameter`] when its settings are out of range.
    pub fn select_lambda(&self, ridge: Ridge) -> Result<Vec<f64>> {
        ridge.check()?;
        Ok(ridge.select_lambda(&self.rows))
    }

    /// The fit to all rows at these strengths, from the same factorization.
    ///
    /// # Errors
    /// [`Error::Shape`] when `lambda` has neither one entry nor one per output,
    /// [`Error::Parameter`] when one is negative or not finite, [`Error::Overflow`] when the answer
    /// does not fit the type.
    pub fn solve(&self, lambda: &[f64]) -> Result<Solution<A>> {
        let mut strengths = vec![0.0; self.outputs()];
        for (strength, outputs) in self.by_strength(lambda)? {
            for output in outputs {
                strengths[output] = strength.as_f64();
            }
        }
        in_range(ridge_solution(
            &self.rows.spectrum,
            Reason::LambdaSearch,
            &strengths,
            None,
        ))
    }

    /// The weight of each row, the largest being 1.
    pub(crate) fn weights(&self) -> Array1<A> {
        let roots = &self.rows.spectrum.frame.root_weights;
        roots.mapv(|root| root * root)
    }

    /// What an intercept adds to each of the forms below: $1 / n$, or 0 without one.
    fn constant_share(&self) -> A {
        let frame = &self.rows.spectrum.frame;
        if frame.intercept {
            A::one() / frame.total_weight
        } else {
            A::zero()
        }
    }

    /// What variances of predictions need, without the rows.
    pub(crate) fn posterior(&self) -> Posterior<A> {
        Posterior::of(&self.rows.spectrum, self.constant_share())
    }

    /// What is predicted for each row by the fit to all others.
    ///
    /// # Errors
    /// [`Error::Shape`] when `lambda` has neither one entry nor one per output,
    /// [`Error::Parameter`] when one is negative or not finite, [`Error::Undetermined`] naming the
    /// first row without which the others have no unique answer to it.
    pub fn leave_one_out(&self, lambda: &[f64]) -> Result<CvPredictions<A>> {
        let spectrum = &self.rows.spectrum;
        let squared = self.rows.u.mapv(|u| u * u);
        self.held_out(lambda, |strength, outputs, inner| {
            let complements = spectrum.filter_complements(strength);
            let denominators = squared.dot(&complements) + &self.rows.one_minus_leverage;
            let least = self.singular_level(strength).powi(2);
            let lone = !spectrum.can_lose_a_row();
            for (row, &denominator) in denominators.iter().enumerate() {
                let present = spectrum.frame.root_weights[row] > A::zero();
                if present && (lone || denominator <= least) {
                    return Err(Error::Undetermined { fold: row });
                }
            }
            let c = spectrum.c.select(Axis(1), outputs);
            let residual = self.rows.residual.select(Axis(1), outputs);
            inner.assign(&self.rows.leave_one_out(
                &denominators,
                &complements,
                c.view(),
                residual.view(),
            ));
            let all: Vec<usize> = (0..self.absent.len()).collect();
            let nothing = Array2::zeros((0, outputs.len()));
            let rest = self.absent_residuals(&all, strength, outputs, &[], &nothing);
            Ok(vec![(all, rest)])
        })
    }

    /// What is predicted for the rows of each fold by the fit to all other folds. `folds` has one
    /// label per row, any numbers; rows of one label are left out together.
    ///
    /// # Errors
    /// As [`leave_one_out`](Self::leave_one_out); [`Error::Shape`] also when there is not one
    /// label per row, [`Error::Parameter`] where all labels are one. [`Error::Undetermined`] names the
    /// label.
    pub fn k_fold(&self, folds: &[usize], lambda: &[f64]) -> Result<CvPredictions<A>> {
        let folds = Fold::divide(self, folds)?;
        self.k_fold_divided(&folds, lambda)
    }

    fn k_fold_divided(&self, folds: &[Fold<A>], lambda: &[f64]) -> Result<CvPredictions<A>> {
        self.held_out(lambda, |strength, outputs, inner| {
            let mut absent = Vec::new();
            for fold in folds {
                let residuals = fold.residuals(self, strength, outputs)?;
                for (&row, residual) in fold.rows.iter().zip(residuals.rows()) {
                    inner.row_mut(row).assign(&residual);
                }
                let rest =
                    self.absent_residuals(&fold.absent, strength, outputs, &fold.rows, &residuals);
                absent.push((fold.absent.clone(), rest));
            }
            Ok(absent)
        })
    }

    /// The held-out error of each output along a path of relative strengths, all folds divided
    /// once.
    ///
    /// # Errors
    /// Those of [`k_fold`](Self::k_fold).
    pub fn k_fold_path(&self, folds: &[usize], lambdas: &[f64]) -> Result<LambdaPath> {
        let folds = Fold::divide(self, folds)?;
        self.path(lambdas, |lambda| self.k_fold_divided(&folds, &[lambda]))
    }

    /// The relative strength that `ridge` takes for each output where rows of one label are held out
    /// together: a given one, by generalized cross-validation, or in place of leave-one-out the one with the
    /// smallest [held-out error](Self::k_fold) of a grid of two to a decade, or the strongest whose
    /// squared error is within 1 % of that.
    ///
    /// # Errors
    /// Those of [`k_fold`](Self::k_fold) and [`select_lambda`](Self::select_lambda).
    pub fn select_lambda_by_folds(&self, folds: &[usize], ridge: Ridge) -> Result<Vec<f64>> {
        ridge.check()?;
        if ridge.lambda() != Lambda::LeaveOneOut {
            return self.select_lambda(ridge);
        }
        let candidates = coarse_grid(self.rows.spectrum.condition());
        let path = self.k_fold_path(folds, &candidates)?;
        Ok(path.strongest(ridge.shared(), TOLERANCE / 2.0))
    }

    /// The leave-one-out error of each output along a path of relative strengths.
    ///
    /// # Errors
    /// Those of [`leave_one_out`](Self::leave_one_out).
    pub fn leave_one_out_path(&self, lambdas: &[f64]) -> Result<LambdaPath> {
        self.path(lambdas, |lambda| self.leave_one_out(&[lambda]))
    }

    fn path(
        &self,
        lambdas: &[f64],
        at: impl Fn(f64) -> Result<CvPredictions<A>>,
    ) -> Result<LambdaPath> {
        if lambdas.is_empty() {
            return Err(Error::Empty {
                what: "path of strengths",
                rows: 0,
                columns: self.outputs(),
            });
        }
        let mut rmse = Array2::zeros((lambdas.len(), self.outputs()));
        for (mut row, &lambda) in rmse.rows_mut().into_iter().zip(lambdas) {
            row.assign(&at(lambda)?.rmse());
        }
        // Relative to what the fit has to explain, so that outputs of any unit can be averaged.
        let spectrum = &self.rows.spectrum;
        let scale = Zip::from(&spectrum.total_squares())
            .and(spectrum.target_scale())
            .map_collect(
                |&squares, &scale| match squares.as_f64().sqrt() * scale.as_f64() {
                    0.0 => 1.0,
                    size => size,
                },
            );
        Ok(LambdaPath {
            lambdas: lambdas.to_vec(),
            rmse,
            scale,
        })
    }

    /// Calls `fit` once for each distinct strength, with the outputs that have it, to fill in their
    /// inner residuals; it returns those of absent rows, in outer units, with their places in
    /// [`absent`](Self::absent).
    fn held_out(
        &self,
        lambda: &[f64],
        mut fit: impl FnMut(A, &[usize], &mut Array2<A>) -> Result<Vec<(Vec<usize>, Array2<A>)>>,
    ) -> Result<CvPredictions<A>> {
        let frame = &self.rows.spectrum.frame;
        let mut residuals = Array2::zeros(self.targets.dim());
        for (strength, outputs) in self.by_strength(lambda)? {
            let mut inner = Array2::zeros((self.rows(), outputs.len()));
            let absent = fit(strength, &outputs, &mut inner)?;
            for (column, &output) in outputs.iter().enumerate() {
                Zip::from(residuals.column_mut(output))
                    .and(inner.column(column))
                    .and(&frame.root_weights)
                    .for_each(|residual, &inner, &root| {
                        if root > A::zero() {
                            *residual = inner / root * frame.target_scale[output];
                        }
                    });
                for (places, rest) in &absent {
                    for (&place, &residual) in places.iter().zip(rest.column(column)) {
                        residuals[[self.absent[place], output]] = residual;
                    }
                }
            }
        }
        let predictions = &self.targets - &residuals;
        if !predictions.iter().all(|p| p.is_finite()) {
            return Err(Error::Overflow {
                what: "a held-out prediction",
            });
        }
        Ok(CvPredictions {
            predictions,
            residuals,
            weights: frame.root_weights.mapv(|root| root * root),
            dimension: PhantomData,
        })
    }

    /// The distinct strengths with the outputs that have them.
    fn by_strength(&self, lambda: &[f64]) -> Result<Vec<(A, Vec<usize>)>> {
        if lambda.len() != 1 {
            check_length("relative strengths", lambda.len(), self.outputs())?;
        }
        let mut groups: Vec<(f64, Vec<usize>)> = Vec::new();
        for output in 0..self.outputs() {
            let value = lambda[output.min(lambda.len() - 1)];
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::Parameter {
                    name: "lambda",
                    value,
                    expected: "finite and not negative",
                });
            }
            match groups.iter_mut().find(|(known, _)| *known == value) {
                Some((_, outputs)) => outputs.push(output),
                None => groups.push((value, vec![output])),
            }
        }
        Ok(groups
            .into_iter()
            .map(|(lambda, outputs)| (A::from_f64(lambda), outputs))
            .collect())
    }

    /// How far the rows left must reach into the space of a fold for the fit to be determined.
    ///
    /// The pseudo-inverse of the rows left would cut off a direction below rounding error times
    /// the largest singular value; here directions have been divided by their singular values, so
    /// the same direction is cut off at that times the condition.
    fn singular_level(&self, strength: A) -> A {
        if strength > A::zero() {
            return A::zero();
        }
        let s = &self.rows.spectrum.s;
        let condition = match (s.first(), s.last()) {
            (Some(&largest), Some(&smallest)) => largest / smallest,
            _ => A::one(),
        };
        self.rows.spectrum.level() * condition
    }

    /// The residuals, in outer units, of the rows of weight 0 at `places` when `rows`, which have
    /// the inner held-out residuals `inner`, are left out. Shape (places, `outputs`).
    fn absent_residuals(
        &self,
        places: &[usize],
        strength: A,
        outputs: &[usize],
        rows: &[usize],
        inner: &Array2<A>,
    ) -> Array2<A> {
        let mut residuals = Array2::zeros((places.len(), outputs.len()));
        if places.is_empty() {
            return residuals;
        }
        let frame = &self.rows.spectrum.frame;
        let coordinates = self.absent_coordinates.select(Axis(0), places);
        let fitted = self.fitted_without(rows, inner, strength, outputs, &coordinates);
        for (column, &output) in outputs.iter().enumerate() {
            for (row, &place) in places.iter().enumerate() {
                let above_mean = fitted[[row, column]] * frame.target_scale[output];
                residuals[[row, column]] = self.targets[[self.absent[place], output]]
                    - frame.target_mean[output]
                    - above_mean;
            }
        }
        residuals
    }
}
