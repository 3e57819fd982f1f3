//! Regularized least squares: $\beta = \arg\min \lVert H\beta - T\rVert^2 + \lambda
//! s_1^2 \lVert\beta\rVert^2$.

use ndarray::{Array1, Array2, ArrayView2, Axis};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use super::design_svd::{DesignSvd, DesignSvdWithRows};
use super::equilibration::EquilibratedProblem;
use super::gcv::gcv_scores;
use super::lambda_grid::{
    FIRST_STEP, TOLERANCE, distinguishable_lambdas, grid, last_within, strength,
};
use super::leave_one_out;
use super::normal_equations::RowSource;
use super::tiles::{Threshold, Tiles};
use super::{LeastSquares, Reason, Solution, gram};
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// How strongly [`Ridge`] regularizes, always relative to the largest squared singular value
/// $s_1^2$ of the hidden-layer matrix: a fixed number would mean something else for every number
/// of rows and every scale of activations.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Lambda {
    /// This value, positive and finite.
    Relative(#[cfg_attr(feature = "serde", serde(serialize_with = "crate::numbers::finite"))] f64),
    /// The value with the smallest exact leave-one-out error (Allen's PRESS, 1974), or the strongest
    /// whose squared error is within 1 % of that. Weights that are whole multiples, of at most 20, of the
    /// smallest are taken for numbers of rows, of which one is left out; with other weights the choice is
    /// that of [`Gcv`](Self::Gcv), and so it is for many rows whose weights differ.
    #[default]
    LeaveOneOut,
    /// The same by the generalized cross-validation score (Golub, Heath and Wahba, 1979): cheaper than
    /// leave-one-out as it does not visit the rows.
    Gcv,
}

/// Ridge regression (Tikhonov regularization), one factorization for all outputs and all
/// candidate strengths. Each output gets its own unless [`shared`](Ridge::with_shared) is set.
///
/// A strength that is not given is searched for from where everything is held back to where
/// nothing is. The score of a candidate is its held-out squared error plus the error that rounding
/// is to be expected to leave in the predictions, $u^2 \sum_k \lVert h_k \rVert^2
/// \beta_k^2$ over the columns $h_k$ of the hidden-layer matrix: without it noise-free targets
/// would call for weights so large that the type cannot carry them. The search computes in `f64`
/// whatever the type, since an ELM's directions fall far below the resolution of `f32`; $u$
/// is that of the type.
///
/// Of rows that far outnumber neurons neither the hidden-layer matrix nor its factors are kept: they are
/// made a tile at a time, twice for leave-one-out, and the answer is the same to within rounding. Memory
/// beside the data is then a small multiple of neurons squared, and a number for each row.
///
/// ```
/// use elm::solve::{LeastSquares, Ridge, Solver};
/// use ndarray::array;
///
/// let (h, t) = (array![[1.0, 1.0], [2.0, 2.1]], array![[2.0], [4.0]]);
/// let problem = LeastSquares::new(&h, &t)?;
/// let norm = |lambda| -> Result<f64, elm::Error> {
///     Ok(Solver::from(Ridge::relative(lambda)).solve(&problem)?.diagnosis.beta_norm[0])
/// };
/// assert!(norm(1e-2)? < norm(1e-6)?);
/// let chosen = Solver::from(Ridge::gcv()).solve(&problem)?;
/// assert_eq!(chosen.diagnosis.lambda.len(), 1);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Ridge {
    lambda: Lambda,
    shared: bool,
}

impl Ridge {
    /// The weakest regularization that is chosen by itself, about the square of `f64`'s epsilon: all
    /// directions that it would affect are lost to rounding.
    pub const FLOOR: f64 = 1e-31;

    /// A given strength, relative to the largest squared singular value.
    ///
    /// From about 2e-8 (in `f32` 1e-4) up to 1e6 the normal equations are well conditioned and are
    /// solved by Cholesky, several times faster; see [`Reason::StrongRidge`].
    #[must_use]
    pub fn relative(lambda: f64) -> Self {
        Self {
            lambda: Lambda::Relative(lambda),
            shared: false,
        }
    }

    /// A strength chosen by exact leave-one-out; the default.
    #[must_use]
    pub fn leave_one_out() -> Self {
        Self {
            lambda: Lambda::LeaveOneOut,
            shared: false,
        }
    }

    /// A strength chosen by generalized cross-validation.
    #[must_use]
    pub fn gcv() -> Self {
        Self {
            lambda: Lambda::Gcv,
            shared: false,
        }
    }

    /// One strength for all outputs, chosen by the mean of their scores, each relative to that
    /// output's variance.
    #[must_use]
    pub fn with_shared(mut self, shared: bool) -> Self {
        self.shared = shared;
        self
    }

    /// How the strength is chosen.
    #[must_use]
    pub fn lambda(&self) -> Lambda {
        self.lambda
    }

    /// The given strength, where it allows the normal equations.
    pub(super) fn strength_for_products<A: Scalar>(self) -> Option<f64> {
        match self.lambda {
            Lambda::Relative(lambda) => gram::allowed::<A>(lambda).then_some(lambda),
            Lambda::Gcv | Lambda::LeaveOneOut => None,
        }
    }

    pub(crate) fn shared(self) -> bool {
        self.shared
    }

    /// The strengths that may be chosen, rising: four to a decade from [`Ridge::FLOOR`] to 100.
    ///
    /// Of those a search leaves out the many that are one fit: all that hold back less than
    /// rounding error of the smallest direction, and most that hold back less than 1 % of it.
    #[must_use]
    pub fn lambda_grid() -> Vec<f64> {
        grid(FIRST_STEP).map(strength).collect()
    }

    pub(crate) fn check(&self) -> Result<()> {
        match self.lambda {
            Lambda::Relative(value) if !(value > 0.0 && value.is_finite()) => {
                Err(Error::Parameter {
                    name: "lambda",
                    value,
                    expected: "positive and finite",
                })
            }
            _ => Ok(()),
        }
    }

    /// The answer from the whole matrix.
    pub(super) fn solve_matrix<A: Scalar>(
        self,
        problem: &LeastSquares<'_, A>,
    ) -> Result<Solution<A>> {
        match self.lambda {
            Lambda::Relative(lambda) => {
                let prepared = EquilibratedProblem::new(problem);
                if gram::allowed::<A>(lambda)
                    && let Some(solution) = gram::solve(&prepared, lambda)
                {
                    return Ok(solution);
                }
                Ok(self.solve_spectrum(&DesignSvd::from_prepared(prepared)?))
            }
            Lambda::Gcv | Lambda::LeaveOneOut => {
                let hidden = A::widen(problem.hidden);
                let targets = A::widen(problem.targets);
                let weights = problem.weights.map(A::widen);
                let wide = LeastSquares {
                    hidden: hidden.view(),
                    targets: targets.view(),
                    weights: weights.as_ref().map(|weights| weights.view()),
                    intercept: problem.intercept,
                };
                Ok(self.search(&wide, unit_roundoff::<A>())?.narrow())
            }
        }
    }

    /// The answer from rows that need not stand in memory together: where a given strength allows
    /// the normal equations and there are at least as many rows as neurons; where there are many more
    /// rows than neurons; and for a search with at least two rows to a neuron where the condition, or the
    /// strength that is found, allows sums of products.
    pub(super) fn solve_rows<A: Scalar>(
        self,
        source: &RowSource<'_, A>,
    ) -> Result<Option<Solution<A>>> {
        if let Some(lambda) = self.strength_for_products::<A>()
            && let Some(solution) = gram::solve_rows(source, lambda)?
        {
            return Ok(Some(solution));
        }
        let is = |threshold: Threshold| threshold.is_met(source.rows(), source.neurons());
        match self.lambda {
            Lambda::Relative(_) if is(Threshold::TRIANGLE) => {
                let Some(mut tiles) = Tiles::new(source, Threshold::TRIANGLE)? else {
                    return Ok(None);
                };
                let Some((triangle, frame)) = tiles.centered_triangle()? else {
                    return Ok(None);
                };
                let spectrum = DesignSvd::<A>::of_triangle(triangle.narrow(), frame.narrow())?;
                Ok(Some(self.solve_spectrum(&spectrum)))
            }
            Lambda::Gcv | Lambda::LeaveOneOut if is(Threshold::PRODUCTS) => {
                let Some(mut tiles) = Tiles::new(source, Threshold::PRODUCTS)? else {
                    return Ok(None);
                };
                let triangle = is(Threshold::TRIANGLE);
                if !triangle && tiles.frame.weights_differ() {
                    // They may be numbers of rows, of which one is to be left out.
                    return Ok(None);
                }
                let found = self.search_many(&mut tiles, triangle, unit_roundoff::<A>())?;
                Ok(found.map(Solution::narrow))
            }
            _ => Ok(None),
        }
    }

    /// The answer by the best strength for predictions in arithmetic of this unit roundoff.
    pub(super) fn search(
        self,
        problem: &LeastSquares<'_, f64>,
        roundoff: f64,
    ) -> Result<Solution<f64>> {
        let reason = Reason::LambdaSearch;
        if self.lambda == Lambda::Gcv {
            let spectrum = DesignSvd::new(problem)?;
            let lambda = self.by_gcv(&spectrum, roundoff);
            return Ok(ridge_solution(&spectrum, reason, &lambda, None));
        }
        let rows = DesignSvdWithRows::new(problem)?;
        let (lambda, errors) = self.by_leave_one_out(&rows, roundoff);
        // Without its only row a problem has nothing to place an intercept by.
        let errors = rows.spectrum.can_lose_a_row().then_some(errors);
        Ok(ridge_solution(&rows.spectrum, reason, &lambda, errors))
    }

    /// Solves without the rows, from which leave-one-out would choose: by generalized
    /// cross-validation then.
    pub(super) fn solve_spectrum<A: Scalar>(self, spectrum: &DesignSvd<A>) -> Solution<A> {
        let reason = match self.lambda {
            Lambda::Relative(_) => Reason::WeakRidge,
            Lambda::Gcv | Lambda::LeaveOneOut => Reason::LambdaSearch,
        };
        let lambda = self.select_lambda_without_rows(spectrum);
        ridge_solution(spectrum, reason, &lambda, None)
    }

    pub(super) fn without_rows(self) -> Self {
        match self.lambda {
            Lambda::LeaveOneOut => Self {
                lambda: Lambda::Gcv,
                ..self
            },
            _ => self,
        }
    }

    /// The strength for each output, from a factorization that is there already.
    pub(crate) fn select_lambda<A: Scalar>(self, rows: &DesignSvdWithRows<A>) -> Vec<f64> {
        match self.lambda {
            Lambda::Relative(lambda) => vec![lambda; rows.spectrum.c.ncols()],
            Lambda::Gcv => self.by_gcv(&rows.spectrum, unit_roundoff::<A>()),
            Lambda::LeaveOneOut => self.by_leave_one_out(rows, unit_roundoff::<A>()).0,
        }
    }

    /// The same without the rows: by generalized cross-validation where leave-one-out was to choose.
    pub(crate) fn select_lambda_without_rows<A: Scalar>(self, spectrum: &DesignSvd<A>) -> Vec<f64> {
        match self.lambda {
            Lambda::Relative(lambda) => vec![lambda; spectrum.c.ncols()],
            Lambda::Gcv | Lambda::LeaveOneOut => self.by_gcv(spectrum, unit_roundoff::<A>()),
        }
    }

    pub(super) fn by_gcv<A: Scalar>(self, spectrum: &DesignSvd<A>, roundoff: f64) -> Vec<f64> {
        let candidates = distinguishable_lambdas(spectrum);
        let scores = gcv_scores(spectrum, &candidates, roundoff);
        let chosen = self.choose(spectrum, &scores);
        chosen.iter().map(|&i| candidates[i]).collect()
    }

    /// Strengths and leave-one-out errors.
    fn by_leave_one_out<A: Scalar>(
        self,
        rows: &DesignSvdWithRows<A>,
        roundoff: f64,
    ) -> (Vec<f64>, Vec<f64>) {
        let candidates = distinguishable_lambdas(&rows.spectrum);
        let scores = leave_one_out::scores(rows, &candidates, roundoff);
        self.lambda_and_errors(&rows.spectrum, &candidates, &scores, (roundoff, false))
    }

    /// The best candidate of each output, and the root of its mean score.
    pub(super) fn lambda_and_errors<A: Scalar>(
        self,
        spectrum: &DesignSvd<A>,
        candidates: &[f64],
        scores: &Array2<f64>,
        (roundoff, many_rows): (f64, bool),
    ) -> (Vec<f64>, Vec<f64>) {
        let total = spectrum.total_weight();
        let by_gcv =
            spectrum.frame.weights_differ() && (many_rows || spectrum.frame.counts().is_none());
        let chosen = if by_gcv {
            let place = |lambda: f64| candidates.iter().position(|c| *c == lambda);
            let lambda = self.by_gcv(spectrum, roundoff).into_iter();
            lambda.map(|lambda| place(lambda).unwrap_or(0)).collect()
        } else {
            self.choose(spectrum, scores)
        };
        chosen
            .iter()
            .zip(spectrum.target_scale())
            .enumerate()
            .map(|(output, (&i, scale))| {
                let error = (scores[[i, output]] / total).sqrt() * scale.as_f64();
                (candidates[i], error)
            })
            .unzip()
    }

    /// For each output the index of the strongest candidate that is as good as the best, to within
    /// [`TOLERANCE`], so that a flat score never means an unregularized fit.
    pub(super) fn choose<A: Scalar>(
        self,
        spectrum: &DesignSvd<A>,
        scores: &Array2<f64>,
    ) -> Vec<usize> {
        let outputs = scores.ncols();
        if !self.shared {
            let strongest = |scores| last_within(scores, TOLERANCE);
            return scores.columns().into_iter().map(strongest).collect();
        }
        let variance = spectrum
            .total_squares()
            .mapv(|v| if v > A::zero() { v.as_f64() } else { 1.0 });
        let mean = (scores / &variance).sum_axis(Axis(1));
        vec![last_within(mean.view(), TOLERANCE); outputs]
    }
}

/// The largest relative error of one rounding, half of epsilon.
fn unit_roundoff<A: Scalar>() -> f64 {
    A::epsilon().as_f64() / 2.0
}

/// The solution at these relative strengths, one per output.
pub(crate) fn ridge_solution<A: Scalar>(
    spectrum: &DesignSvd<A>,
    reason: Reason,
    lambda: &[f64],
    leave_one_out: Option<Vec<f64>>,
) -> Solution<A> {
    let typed: Vec<A> = lambda.iter().map(|&l| A::from_f64(l)).collect();
    let cutoff = spectrum.level();
    spectrum.solution(
        &spectrum.ridge_gain(&typed),
        cutoff,
        reason,
        lambda.to_vec(),
        leave_one_out,
    )
}

impl<A: Scalar> DesignSvdWithRows<A> {
    /// The (weighted) leave-one-out residuals $e_i / (1 - h_i)$ when each direction is held back
    /// by this share, shape (rows, outputs), given the $1 - h_i$ and the outputs' coordinates and
    /// residuals.
    ///
    /// Numerator and denominator are sums of what is held back, never differences of what is
    /// kept: $1 - h_i$ loses all its digits where a row is nearly interpolated, which is where
    /// the choice of $\lambda$ is decided.
    pub(crate) fn leave_one_out(
        &self,
        denominators: &Array1<A>,
        complements: &Array1<A>,
        c: ArrayView2<'_, A>,
        residual: ArrayView2<'_, A>,
    ) -> Array2<A> {
        let held = &c * &complements.view().insert_axis(Axis(1));
        let mut residuals = A::product(self.u.view(), held.view());
        residuals += &residual;
        residuals /= &denominators.view().insert_axis(Axis(1));
        residuals
    }
}
