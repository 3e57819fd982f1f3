//! Generalized cross-validation scores of many strengths at once.

use ndarray::{Array2, Zip};

use super::design_svd::DesignSvd;
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
