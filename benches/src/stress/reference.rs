//! Ridge regression and least squares in double-double arithmetic: Householder QR of the
//! regularised, augmented system
//!
//! $$ \min_\beta \left\lVert \begin{bmatrix} H \\ \sqrt\lambda I \end{bmatrix} \beta -
//! \begin{bmatrix} T \\ 0 \end{bmatrix} \right\rVert, $$
//!
//! which is backward stable (Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed.,
//! theorem 20.3): with a unit roundoff of about 1e-31 its relative error is below
//! $10^{-31} \kappa^2$, that is $10^{-15}$ up to condition $10^8$ of the augmented matrix for any
//! residual, and up to $10^{15}$ for a small one.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use twofloat::TwoFloat;

const ZERO: TwoFloat = TwoFloat::from_f64(0.0);

/// A matrix by columns.
type Columns = Vec<Vec<TwoFloat>>;

/// Predictions for the rows of `test`, shape (test rows, outputs), rounded to `f64`.
///
/// `lambda` is absolute, one per output; 0 is plain least squares, for which `hidden` must have
/// full column rank: `None` when it has not, or when a result is not finite.
#[must_use]
pub fn predict(
    hidden: ArrayView2<'_, f64>,
    targets: ArrayView2<'_, f64>,
    test: ArrayView2<'_, f64>,
    lambda: &[f64],
    intercept: bool,
) -> Option<Array2<f64>> {
    let (rows, neurons) = hidden.dim();
    let mut columns: Columns = hidden.columns().into_iter().map(exact).collect();
    // Scaled to 1, as the low half of a subnormal is lost.
    let unit: Array1<f64> = targets.map_axis(Axis(0), power_of_two);
    columns.extend(
        targets
            .columns()
            .into_iter()
            .zip(&unit)
            .map(|(t, &unit)| exact(t.mapv(|t| t / unit).view())),
    );
    let means: Vec<TwoFloat> = columns
        .iter_mut()
        .map(|column| if intercept { center(column) } else { ZERO })
        .collect();
    let (hidden_means, target_means) = means.split_at(neurons);
    if rows > neurons {
        householder(&mut columns, neurons);
        for column in &mut columns {
            column.truncate(neurons);
        }
    }
    let test: Columns = test.rows().into_iter().map(exact).collect();
    let mut out = Array2::zeros((test.len(), lambda.len()));
    for (output, &lambda) in lambda.iter().enumerate() {
        let beta = solve(&columns, neurons, output, lambda)?;
        for (row, x) in test.iter().enumerate() {
            let sum = x.iter().zip(hidden_means).zip(&beta);
            let sum = sum.fold(target_means[output], |sum, ((&x, &mean), &beta)| {
                sum + (x - mean) * beta
            });
            out[[row, output]] = f64::from(sum) * unit[output];
        }
    }
    out.iter().all(|value| value.is_finite()).then_some(out)
}

/// The weights of one output, whose column follows the `neurons` columns of the matrix.
fn solve(columns: &Columns, neurons: usize, output: usize, lambda: f64) -> Option<Vec<TwoFloat>> {
    let mut system: Columns = columns[..neurons].to_vec();
    system.push(columns[neurons + output].clone());
    let rows = system[0].len();
    if lambda > 0.0 {
        let root = TwoFloat::from(lambda).sqrt();
        for (j, column) in system.iter_mut().enumerate() {
            column.resize(rows + neurons, ZERO);
            if j < neurons {
                column[rows + j] = root;
            }
        }
    } else if rows < neurons {
        return None;
    }
    householder(&mut system, neurons);
    let mut beta = system[neurons][..neurons].to_vec();
    for k in (0..neurons).rev() {
        if system[k][k] == ZERO {
            return None;
        }
        beta[k] = quotient(beta[k], system[k][k]);
        for i in 0..k {
            let later = system[k][i] * beta[k];
            beta[i] -= later;
        }
    }
    Some(beta)
}

/// Brings the first `steps` columns to triangular form by reflections, applied to all columns.
fn householder(columns: &mut Columns, steps: usize) {
    for k in 0..steps {
        let (done, rest) = columns.split_at_mut(k + 1);
        let pivot = &mut done[k];
        // Below the diagonal of an augmented triangle most entries are 0.
        let support: Vec<usize> = (k..pivot.len()).filter(|&i| pivot[i] != ZERO).collect();
        let norm = support
            .iter()
            .fold(ZERO, |sum, &i| sum + pivot[i] * pivot[i])
            .sqrt();
        if norm == ZERO {
            continue;
        }
        let image = if pivot[k] > ZERO { -norm } else { norm };
        let mut v: Vec<(usize, TwoFloat)> = support.iter().map(|&i| (i, pivot[i])).collect();
        match v.first_mut() {
            Some((i, first)) if *i == k => *first -= image,
            _ => v.insert(0, (k, -image)),
        }
        let squared = v.iter().fold(ZERO, |sum, &(_, v)| sum + v * v);
        let twice = quotient(TwoFloat::from(2.0), squared);
        for column in rest {
            let along = v.iter().fold(ZERO, |sum, &(i, v)| sum + v * column[i]);
            let along = along * twice;
            for &(i, v) in &v {
                column[i] -= along * v;
            }
        }
        pivot[k] = image;
        pivot[k + 1..].fill(ZERO);
    }
}

/// Orthonormal columns that span those of a random matrix, by modified Gram-Schmidt, twice.
#[must_use]
pub fn orthonormal(mut a: Array2<f64>) -> Array2<f64> {
    for _ in 0..2 {
        for k in 0..a.ncols() {
            let (done, mut rest) = a.view_mut().split_at(Axis(1), k);
            let mut column = rest.column_mut(0);
            for other in done.columns() {
                let share = other.dot(&column);
                column.scaled_add(-share, &other);
            }
            let norm = column.dot(&column).sqrt();
            column /= norm;
        }
    }
    a
}

/// $a / b$ by long division, three digits in base $2^{53}$: the operator of twofloat 0.8 is only
/// right to the first.
fn quotient(a: TwoFloat, b: TwoFloat) -> TwoFloat {
    let mut rest = a;
    let mut quotient = ZERO;
    for _ in 0..3 {
        let digit = rest.hi() / b.hi();
        quotient += digit;
        rest -= b * digit;
    }
    quotient
}

fn exact(values: ArrayView1<'_, f64>) -> Vec<TwoFloat> {
    values.iter().map(|&value| TwoFloat::from(value)).collect()
}

fn center(column: &mut [TwoFloat]) -> TwoFloat {
    let sum = column.iter().fold(ZERO, |sum, &value| sum + value);
    let mean = quotient(sum, TwoFloat::from(column.len() as f64));
    for value in column {
        *value -= mean;
    }
    mean
}

/// The power of two near the largest magnitude of a column, within the normal range.
pub(super) fn power_of_two(column: ArrayView1<'_, f64>) -> f64 {
    let largest = column.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if largest > 0.0 {
        2.0_f64.powf(largest.log2().floor().clamp(-1022.0, 1022.0))
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn quotients_and_roots_have_31_digits() {
        let (a, b) = (TwoFloat::from(3.0), TwoFloat::from(7.0));
        let error = |value: TwoFloat| f64::from(value).abs();
        assert!(error(quotient(a, b) * b - a) < 1e-30);
        assert!(error(a.sqrt() * a.sqrt() - a) < 1e-30);
        assert_eq!(quotient(a, ZERO - a), TwoFloat::from(-1.0));
    }

    #[test]
    fn the_line_through_three_points_is_exact() {
        // Normal equations by hand: beta = 3/2, intercept 7/6 for (0,1), (1,3), (2,4).
        let x = array![[0.0], [1.0], [2.0]];
        let t = array![[1.0], [3.0], [4.0]];
        let test = array![[4.0]];
        let p = predict(x.view(), t.view(), test.view(), &[0.0], true).map(|p| p[[0, 0]]);
        // Rounded once more at the end.
        assert!(
            p.is_some_and(|p| (p - (6.0 + 7.0 / 6.0)).abs() < 1e-15),
            "{p:?}"
        );
    }

    #[test]
    fn ridge_of_an_orthogonal_matrix_shrinks_by_one_over_one_plus_lambda() {
        // Rows or columns may be the more: [I] and [I I] have H H' = 1 and 2.
        let t = array![[3.0], [5.0]];
        let eye = Array2::<f64>::eye(2);
        let p = predict(eye.view(), t.view(), eye.view(), &[0.5], false).map(|p| p[[1, 0]]);
        assert!(p.is_some_and(|p| (p - 5.0 / 1.5).abs() < 1e-15), "{p:?}");
        let wide = array![[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]];
        let p = predict(wide.view(), t.view(), wide.view(), &[0.5], false).map(|p| p[[1, 0]]);
        assert!(
            p.is_some_and(|p| (p - 5.0 * 2.0 / 2.5).abs() < 1e-15),
            "{p:?}"
        );
    }

    #[test]
    fn the_hilbert_matrix_is_solved_to_full_precision() {
        // Condition 1.6e13 of the 10 x 10 matrix; its inverse applied to its row sums is 1.
        // Numbers 1 / (i + j + 1) scaled by lcm(1..19) are whole, so that the system is exact.
        let scale = 232_792_560.0;
        let h = Array2::from_shape_fn((10, 10), |(i, j)| scale / (i + j + 1) as f64);
        let t = h.sum_axis(Axis(1)).insert_axis(Axis(1));
        let eye = Array2::<f64>::eye(10);
        let p = predict(h.view(), t.view(), eye.view(), &[0.0], false);
        // 31 digits less 13.
        for value in p.iter().flatten() {
            assert!((value - 1.0).abs() < 1e-15, "{value}");
        }
    }

    #[test]
    fn dependent_columns_have_no_least_squares_reference() {
        let h = array![[1.0, 2.0], [0.0, 0.0], [0.0, 0.0]];
        let t = array![[1.0], [1.0], [1.0]];
        assert_eq!(predict(h.view(), t.view(), h.view(), &[0.0], false), None);
    }
}
