//! Norms, and what of them is rounding error.

use ndarray::ArrayView1;

use crate::scalar::Scalar;

/// The level below which a singular value of a matrix of this size is rounding error, relative to
/// the largest one.
pub(crate) fn rounding<A: Scalar>(rows: usize, columns: usize) -> A {
    // The backward error of the factorizations grows like the root of the size in practice; the
    // usual bound eps * max(rows, columns) would cut at 0.01 for 100,000 rows of f32.
    A::epsilon() * A::from_f64(4.0 * (rows.max(columns) as f64).sqrt())
}

/// Euclidean norm, in range wherever the result is.
pub(crate) fn norm<A: Scalar>(column: ArrayView1<'_, A>) -> f64 {
    let largest = column.iter().fold(0.0_f64, |m, v| m.max(v.as_f64().abs()));
    if largest == 0.0 {
        return 0.0;
    }
    largest
        * column
            .iter()
            .map(|v| (v.as_f64() / largest).powi(2))
            .sum::<f64>()
            .sqrt()
}
