//! Regularised least squares: $\beta = \arg\min \lVert H\beta - T\rVert^2 + \lambda
//! s_1^2 \lVert\beta\rVert^2$.

use ndarray::{Array1, Array2, ArrayView1, Axis, Zip};
use serde::{Deserialize, Serialize};

use super::spectrum::{RowSpectrum, Spectrum, rounding};
use super::{LeastSquares, Solution};
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

    pub(super) fn check(&self) -> Result<()> {
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
        let outputs = problem.outputs();
        match self.lambda {
            Lambda::Relative(lambda) => {
                let spectrum = Spectrum::new(problem)?;
                Ok(answer(&spectrum, problem, &vec![lambda; outputs], None))
            }
            Lambda::Gcv => {
                let spectrum = Spectrum::new(problem)?;
                let candidates = candidates::<A>();
                let scores = gcv_scores(&spectrum, &candidates);
                let chosen = self.choose(&spectrum, &scores);
                let lambda: Vec<f64> = chosen.iter().map(|&i| candidates[i]).collect();
                Ok(answer(&spectrum, problem, &lambda, None))
            }
            Lambda::LeaveOneOut => {
                let rows = RowSpectrum::new(problem)?;
                let candidates = candidates::<A>();
                let scores = leave_one_out_scores(&rows, &candidates);
                let chosen = self.choose(&rows.spectrum, &scores);
                let lambda: Vec<f64> = chosen.iter().map(|&i| candidates[i]).collect();
                let total = rows.spectrum.total_weight();
                let errors = chosen.iter().enumerate().map(|(output, &i)| {
                    let scale = rows.spectrum.target_scale()[output].as_f64();
                    (scores[[i, output]] / total).sqrt() * scale
                });
                let errors = errors.collect();
                // Without its only row a problem has nothing to place an intercept by.
                let defined = rows.spectrum.can_lose_a_row();
                Ok(answer(
                    &rows.spectrum,
                    problem,
                    &lambda,
                    defined.then_some(errors),
                ))
            }
        }
    }

    /// For each output the index of the best candidate. Of equals the strongest wins, so that a
    /// flat score never means an unregularised fit.
    fn choose<A: Scalar>(self, spectrum: &Spectrum<A>, scores: &Array2<f64>) -> Vec<usize> {
        let outputs = scores.ncols();
        if !self.shared {
            return scores.columns().into_iter().map(best).collect();
        }
        let variance = spectrum.c.map_axis(Axis(0), |c| c.dot(&c)) + &spectrum.unreached;
        let variance = variance.mapv(|v| if v > A::zero() { v.as_f64() } else { 1.0 });
        let mean = (scores / &variance).sum_axis(Axis(1));
        vec![best(mean.view()); outputs]
    }
}

/// The index of the smallest finite score; of (nearly) equal ones the last.
fn best(scores: ArrayView1<'_, f64>) -> usize {
    let smallest = scores.iter().copied().fold(f64::INFINITY, f64::min);
    let bound = smallest * (1.0 + 1e-9);
    scores
        .iter()
        .rposition(|&score| score <= bound)
        .unwrap_or(scores.len() - 1)
}

/// The strengths tried, rising.
fn candidates<A: Scalar>() -> Vec<f64> {
    let floor = Ridge::FLOOR.max(A::epsilon().as_f64());
    let steps = 4.0;
    let first = (floor.log10() * steps).ceil() as i32;
    (first..=8)
        .map(|step| 10.0_f64.powf(f64::from(step) / steps))
        .collect()
}

fn answer<A: Scalar>(
    spectrum: &Spectrum<A>,
    problem: &LeastSquares<'_, A>,
    lambda: &[f64],
    leave_one_out: Option<Vec<f64>>,
) -> Solution<A> {
    let typed: Vec<A> = lambda.iter().map(|&l| A::from_f64(l)).collect();
    let cutoff = rounding(problem.rows(), problem.neurons());
    spectrum.solution(
        &spectrum.ridge_gain(&typed),
        cutoff,
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
        let residuals = rows.leave_one_out(&squared, &held_back);
        for (score, column) in score.iter_mut().zip(residuals.columns()) {
            *score = column.iter().map(|e| e.as_f64().powi(2)).sum();
        }
    }
    scores
}

impl<A: Scalar> RowSpectrum<A> {
    /// The (weighted) leave-one-out residuals $e_i / (1 - h_i)$ when each direction is held back
    /// by this share, shape (rows, outputs).
    ///
    /// Numerator and denominator are sums of what is held back, never differences of what is
    /// kept: $1 - h_i$ loses all its digits where a row is nearly interpolated, which is where
    /// the choice of $\lambda$ is decided.
    pub(crate) fn leave_one_out(&self, squared: &Array2<A>, held_back: &Array1<A>) -> Array2<A> {
        let held = &self.spectrum.c * &held_back.view().insert_axis(Axis(1));
        let mut residuals = A::product(self.u.view(), held.view());
        residuals += &self.residual;
        let denominators = squared.dot(held_back) + &self.free;
        Zip::from(residuals.rows_mut())
            .and(&denominators)
            .for_each(|mut row, &denominator| {
                row.mapv_inplace(|e| e / denominator);
            });
        residuals
    }
}
