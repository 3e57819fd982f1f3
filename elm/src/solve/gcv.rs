//! Generalized cross-validation scores of many strengths at once.

use ndarray::{Array2, Zip};

use super::design_svd::DesignSvd;
use super::lambda_grid::{FLAT, all_distinguishable_lambdas, last_within};
use super::leave_one_out::NEGLIGIBLE;
use crate::scalar::Scalar;

/// $n \cdot \text{RSS} / (n - \text{df})^2$ for each candidate and output, shape (candidates,
/// outputs), in units of the scaled targets. RSS has in it what rounding is to add to it.
pub(super) fn gcv_scores<A: Scalar>(
    spectrum: &DesignSvd<A>,
    candidates: &[f64],
    roundoff: f64,
) -> Array2<f64> {
    let mut scores = Array2::zeros((candidates.len(), spectrum.c.ncols()));
    for (mut row, &lambda) in scores.rows_mut().into_iter().zip(candidates) {
        let complements = spectrum.filter_complements(A::from_f64(lambda));
        let spare = spectrum.spare_rows() as f64 + complements.sum().as_f64();
        for (output, score) in row.iter_mut().enumerate() {
            let rest = Zip::from(spectrum.c.column(output))
                .and(&complements)
                .fold(spectrum.residual_ss[output], |sum, &c, &h| {
                    sum + (c * h).powi(2)
                });
            *score = rest.as_f64();
        }
        let kept = spectrum.filter_factors(A::from_f64(lambda));
        let rounding = spectrum.rounding_squares(&kept, roundoff, |o| NEGLIGIBLE * row[o]);
        for (score, rounding) in row.iter_mut().zip(rounding) {
            *score = (*score + rounding) / (spare * spare);
        }
    }
    scores
}

/// Whether this spectrum serves the best strength of every output by these scores. Those of weaker strengths
/// than it serves lack digits, and are good enough to tell whether one of these is better.
pub(super) fn serves(spectrum: &DesignSvd<f64>, roundoff: f64) -> bool {
    /// Steps of the grid that the best must be above the weakest.
    const ABOVE: usize = 2;
    let Some(weakest) = spectrum.weakest else {
        return true;
    };
    let candidates = all_distinguishable_lambdas(spectrum);
    let first = candidates.partition_point(|strength| *strength < weakest);
    let scores = gcv_scores(spectrum, &candidates, roundoff);
    let mut columns = scores.columns().into_iter();
    columns.all(|scores| last_within(scores, FLAT) >= first + ABOVE)
}
