//! Regularised least squares: $\beta = \arg\min \lVert H\beta - T\rVert^2 + \lambda
//! s_1^2 \lVert\beta\rVert^2$.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, Zip};
use serde::{Deserialize, Serialize};

use super::frame::Prepared;
use super::spectrum::{RowSpectrum, Spectrum};
use super::{LeastSquares, Reason, Solution, gram};
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// How strongly [`Ridge`] regularises, always relative to the largest squared singular value
/// $s_1^2$ of the hidden-layer matrix: a fixed number would mean something else for every number
/// of rows and every scale of activations.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lambda {
    /// This value, positive and finite.
    Relative(f64),
    /// The value with the smallest exact leave-one-out error (Allen's PRESS, 1974).
    #[default]
    LeaveOneOut,
    /// The value with the smallest generalised cross-validation score (Golub, Heath and Wahba,
    /// 1979): cheaper than leave-one-out as it does not visit the rows.
    Gcv,
}

/// Ridge regression (Tikhonov regularisation), one factorisation for all outputs and all
/// candidate strengths.
///
/// Candidates lie four to a decade from [`Ridge::FLOOR`] (in `f32` from 1e-7: below that,
/// predictions lose more to rounding than any fit can gain) to 100. Each output gets its own
/// unless [`shared`](Ridge::shared) is set.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Ridge {
    lambda: Lambda,
    shared: bool,
}

impl Ridge {
    /// The weakest regularisation that is chosen by itself.
    pub const FLOOR: f64 = 1e-12;

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

    /// A strength chosen by generalised cross-validation.
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
    pub fn shared(mut self, shared: bool) -> Self {
        self.shared = shared;
        self
    }

    /// How the strength is chosen.
    #[must_use]
    pub fn lambda(&self) -> Lambda {
        self.lambda
    }

    /// The strengths that are tried, rising; see [`Ridge`].
    #[must_use]
    pub fn candidates<A: Scalar>() -> Vec<f64> {
        let floor = Self::FLOOR.max(A::epsilon().as_f64());
        let steps = 4.0;
        let first = (floor.log10() * steps).ceil() as i32;
        (first..=8)
            .map(|step| 10.0_f64.powf(f64::from(step) / steps))
            .collect()
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

    pub(super) fn solve<A: Scalar>(self, problem: &LeastSquares<'_, A>) -> Result<Solution<A>> {
        match self.lambda {
            Lambda::Relative(lambda) => {
                let prepared = Prepared::new(problem);
                if gram::allowed::<A>(lambda)
                    && let Some(solution) = gram::solve(&prepared, lambda)
                {
                    return Ok(solution);
                }
                Ok(self.solve_spectrum(&Spectrum::from_prepared(prepared)?))
            }
            Lambda::Gcv => Ok(self.solve_spectrum(&Spectrum::new(problem)?)),
            Lambda::LeaveOneOut => {
                let rows = RowSpectrum::new(problem)?;
                let (lambda, errors) = self.by_leave_one_out(&rows);
                // Without its only row a problem has nothing to place an intercept by.
                let defined = rows.spectrum.can_lose_a_row();
                let errors = defined.then_some(errors);
                Ok(answer(
                    &rows.spectrum,
                    Reason::StrengthSearch,
                    &lambda,
                    errors,
                ))
            }
        }
    }

    /// Solves without the rows, from which leave-one-out would choose: by generalised
    /// cross-validation then.
    pub(super) fn solve_spectrum<A: Scalar>(self, spectrum: &Spectrum<A>) -> Solution<A> {
        let (reason, lambda) = match self.lambda {
            Lambda::Relative(lambda) => (Reason::WeakRidge, vec![lambda; spectrum.c.ncols()]),
            Lambda::Gcv | Lambda::LeaveOneOut => (Reason::StrengthSearch, self.by_gcv(spectrum)),
        };
        answer(spectrum, reason, &lambda, None)
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

    /// The strength for each output, from a factorisation that is there already.
    pub(crate) fn strengths<A: Scalar>(self, rows: &RowSpectrum<A>) -> Vec<f64> {
        match self.lambda {
            Lambda::Relative(lambda) => vec![lambda; rows.spectrum.c.ncols()],
            Lambda::Gcv => self.by_gcv(&rows.spectrum),
            Lambda::LeaveOneOut => self.by_leave_one_out(rows).0,
        }
    }

    fn by_gcv<A: Scalar>(self, spectrum: &Spectrum<A>) -> Vec<f64> {
        let candidates = Self::candidates::<A>();
        let scores = gcv_scores(spectrum, &candidates);
        let chosen = self.choose(spectrum, &scores);
        chosen.iter().map(|&i| candidates[i]).collect()
    }

    /// Strengths and leave-one-out errors.
    fn by_leave_one_out<A: Scalar>(self, rows: &RowSpectrum<A>) -> (Vec<f64>, Vec<f64>) {
        let candidates = Self::candidates::<A>();
        let scores = leave_one_out_scores(rows, &candidates);
        let total = rows.spectrum.total_weight();
        let chosen = self.choose(&rows.spectrum, &scores);
        chosen
            .iter()
            .zip(rows.spectrum.target_scale())
            .enumerate()
            .map(|(output, (&i, scale))| {
                let error = (scores[[i, output]] / total).sqrt() * scale.as_f64();
                (candidates[i], error)
            })
            .unzip()
    }

    /// The index of the smallest finite score; of (nearly) equal ones the last.
    pub(crate) fn best(scores: ArrayView1<'_, f64>) -> usize {
        let smallest = scores.iter().copied().fold(f64::INFINITY, f64::min);
        let bound = smallest * (1.0 + 1e-9);
        scores
            .iter()
            .rposition(|&score| score <= bound)
            .unwrap_or(scores.len() - 1)
    }

    /// For each output the index of the best candidate. Of equals the strongest wins, so that a
    /// flat score never means an unregularised fit.
    fn choose<A: Scalar>(self, spectrum: &Spectrum<A>, scores: &Array2<f64>) -> Vec<usize> {
        let outputs = scores.ncols();
        if !self.shared {
            return scores.columns().into_iter().map(Self::best).collect();
        }
        let variance = spectrum
            .total_squares()
            .mapv(|v| if v > A::zero() { v.as_f64() } else { 1.0 });
        let mean = (scores / &variance).sum_axis(Axis(1));
        vec![Self::best(mean.view()); outputs]
    }
}

fn answer<A: Scalar>(
    spectrum: &Spectrum<A>,
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

/// $n \cdot \text{RSS} / (n - \text{df})^2$ for each candidate and output, shape (candidates,
/// outputs), in units of the scaled targets.
fn gcv_scores<A: Scalar>(spectrum: &Spectrum<A>, candidates: &[f64]) -> Array2<f64> {
    let mut scores = Array2::zeros((candidates.len(), spectrum.c.ncols()));
    for (mut row, &lambda) in scores.rows_mut().into_iter().zip(candidates) {
        let held_back = spectrum.ridge_held_back(A::from_f64(lambda));
        let spare = spectrum.spare_rows() as f64 + held_back.sum().as_f64();
        for (output, score) in row.iter_mut().enumerate() {
            let rest = Zip::from(spectrum.c.column(output))
                .and(&held_back)
                .fold(spectrum.unreached[output], |sum, &c, &h| {
                    sum + (c * h).powi(2)
                });
            *score = rest.as_f64() / (spare * spare);
        }
    }
    scores
}

/// The sum of squared leave-one-out residuals for each candidate and output, shape (candidates,
/// outputs), in units of the scaled targets.
fn leave_one_out_scores<A: Scalar>(rows: &RowSpectrum<A>, candidates: &[f64]) -> Array2<f64> {
    let mut scores = Array2::zeros((candidates.len(), rows.spectrum.c.ncols()));
    let squared = rows.u.mapv(|u| u * u);
    for (mut score, &lambda) in scores.rows_mut().into_iter().zip(candidates) {
        let held_back = rows.spectrum.ridge_held_back(A::from_f64(lambda));
        let residuals = rows.leave_one_out(
            &(squared.dot(&held_back) + &rows.free),
            &held_back,
            rows.spectrum.c.view(),
            rows.residual.view(),
        );
        for (score, column) in score.iter_mut().zip(residuals.columns()) {
            *score = column.iter().map(|e| e.as_f64().powi(2)).sum();
        }
    }
    scores
}

impl<A: Scalar> RowSpectrum<A> {
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
        held_back: &Array1<A>,
        c: ArrayView2<'_, A>,
        residual: ArrayView2<'_, A>,
    ) -> Array2<A> {
        let held = &c * &held_back.view().insert_axis(Axis(1));
        let mut residuals = A::product(self.u.view(), held.view());
        residuals += &residual;
        residuals /= &denominators.view().insert_axis(Axis(1));
        residuals
    }
}
