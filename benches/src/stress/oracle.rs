//! The smallest test error that any ridge strength or cut-off reaches on a hidden-layer matrix.

use faer::Mat;
use ndarray::{Array1, Array2, ArrayView2, Axis};

/// Mean squared error on the test rows of the best answer for each output, shape (outputs), or
/// `None` where the singular value decomposition fails.
///
/// Answers are ridge regression with a strength from 1e-24 to 1e4 of the largest squared singular
/// value, four to a decade and one for each output, and the pseudo-inverse with cut-offs from
/// 1e-15 to 1; all in `f64`, from one factorisation that `elm` has no part in. Choosing with the
/// test rows in sight, no solver can know as much.
#[must_use]
pub fn best(
    hidden: ArrayView2<'_, f64>,
    targets: ArrayView2<'_, f64>,
    test: ArrayView2<'_, f64>,
    test_targets: ArrayView2<'_, f64>,
    intercept: bool,
) -> Option<Array1<f64>> {
    let mean = |a: ArrayView2<'_, f64>| {
        if intercept {
            a.mean_axis(Axis(0))
        } else {
            Some(Array1::zeros(a.ncols()))
        }
    };
    let (hidden_mean, target_mean) = (mean(hidden)?, mean(targets)?);
    let centered = &hidden - &hidden_mean;
    let svd = Mat::from_fn(centered.nrows(), centered.ncols(), |i, j| centered[[i, j]])
        .thin_svd()
        .ok()?;
    let columns = |m: faer::MatRef<'_, f64>| {
        Array2::from_shape_fn((m.nrows(), m.ncols()), |(i, j)| m[(i, j)])
    };
    let (u, v) = (columns(svd.U()), columns(svd.V()));
    let s: Array1<f64> = svd.S().column_vector().iter().copied().collect();
    let largest = s.first().copied().filter(|s| *s > 0.0).unwrap_or(1.0);
    let s = s / largest;
    let c = u.t().dot(&(&targets - &target_mean));
    let z = (&test - &hidden_mean).dot(&v) / largest;

    let ridge = (-96..=16).map(|step| 10.0_f64.powf(f64::from(step) / 4.0));
    let ridge = ridge.map(|lambda| s.mapv(|s| s / (s * s + lambda)));
    let cutoffs = (-60..=0).map(|step| 10.0_f64.powf(f64::from(step) / 4.0));
    let truncated = cutoffs.map(|cutoff| s.mapv(|s| if s >= cutoff { 1.0 / s } else { 0.0 }));
    let mut best = Array1::from_elem(targets.ncols(), f64::INFINITY);
    for gain in ridge.chain(truncated) {
        let gain = gain.mapv(|g| if g.is_finite() { g } else { 0.0 });
        let predicted = z.dot(&(&c * &gain.insert_axis(Axis(1)))) + &target_mean;
        let squares = (predicted - test_targets).mapv(|e| e * e);
        let error = squares.mean_axis(Axis(0))?;
        best.zip_mut_with(&error, |best, &error| *best = best.min(error));
    }
    Some(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn on_orthogonal_columns_the_oracle_finds_the_shrinkage_that_was_planted() {
        // One column of ones with targets 2: ridge predicts 2 / (1 + lambda), so test targets of
        // 1 are met at relative strength 1, which is among the candidates.
        let h = Array2::<f64>::ones((4, 1));
        let (t, test) = (h.mapv(|_| 2.0), array![[1.0]]);
        let error = best(h.view(), t.view(), test.view(), test.view(), false);
        assert!(error.is_some_and(|e| e[0] < 1e-30));
    }

    #[test]
    fn with_an_intercept_a_constant_costs_nothing() {
        let h = array![[1.0], [2.0], [3.0]];
        let t = array![[5.0], [5.0], [5.0]];
        let error = best(h.view(), t.view(), h.view(), t.view(), true);
        assert!(error.is_some_and(|e| e[0] == 0.0));
    }
}
