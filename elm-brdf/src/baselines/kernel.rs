//! What radial basis functions and Gaussian processes share: a symmetric kernel matrix, a
//! polynomial that it leaves free, and all strengths of regularisation from one decomposition.
//!
//! The interpolant is $s(x) = \sum_i \alpha_i k(x, x_i) + p(x)^T c$ with $(K + \lambda I) \alpha + P
//! c = y$ and $P^T \alpha = 0$. With $U$ the eigenvectors of $K$ within the complement of $P$'s
//! columns, $\Lambda$ its eigenvalues there and $z = U^T y$, it is $\alpha = U (\Lambda + \lambda)^{-1}
//! z$: a new $\lambda$ or column $y$ costs a product, not a factorisation.
//!
//! The only file of this crate that names a linear algebra crate: `elm` solves least squares, which
//! a symmetric eigenvalue problem is not.

use faer::{MatRef, Side};
use ndarray::{Array1, Array2, ArrayView2, Axis, Zip};

use crate::error::{Error, Result};

/// Relative size below which an eigenvalue, or what is left of a column, is rounding.
const ROUNDING: f64 = 1e-13;

/// A kernel matrix decomposed in the complement of a polynomial.
pub(super) struct Projected {
    /// Shape (rows, k).
    u: Array2<f64>,
    /// Length k, falling.
    eigenvalues: Array1<f64>,
    tail: Tail,
}

/// Kernel weights and polynomial coefficients of each column.
pub(super) struct Weights {
    /// $\alpha$, shape (rows, columns).
    pub(super) kernel: Array2<f64>,
    /// $c$, shape (polynomial terms, columns).
    pub(super) tail: Array2<f64>,
}

impl Projected {
    /// Decomposes `kernel` $K$, shape (rows, rows), which must be positive semidefinite on the
    /// complement of the columns of `polynomial` $P$, shape (rows, terms).
    pub(super) fn new(kernel: Array2<f64>, polynomial: ArrayView2<'_, f64>) -> Result<Self> {
        let rows = kernel.nrows();
        let tail = Tail::new(polynomial);
        let mut projected = tail.project(kernel);
        // The span of P, where nothing is left of K, is moved below everything else, so that
        // its vectors are told from those of small eigenvalues.
        let scale = projected.diag().iter().map(|d| d.abs()).fold(0.0, f64::max);
        let scale = if scale > 0.0 { scale } else { 1.0 };
        projected.scaled_add(-scale, &tail.basis.dot(&tail.basis.t()));

        let no_vectors = || Error::NoConvergence {
            what: "the eigenvalue decomposition of a kernel matrix",
        };
        let slice = projected.as_slice_memory_order().unwrap_or(&[]);
        let eigen = MatRef::from_row_major_slice(slice, rows, rows)
            .self_adjoint_eigen(Side::Lower)
            .map_err(|_| no_vectors())?;
        let (values, vectors) = (eigen.S().column_vector(), eigen.U());
        let kept = rows - tail.basis.ncols();
        // faer's eigenvalues rise.
        let u = Array2::from_shape_fn((rows, kept), |(i, j)| vectors[(i, rows - 1 - j)]);
        // Divide and conquer does not always say that it failed.
        if !u.iter().all(|value| value.is_finite()) {
            return Err(no_vectors());
        }
        Ok(Self {
            u,
            eigenvalues: Array1::from_shape_fn(kept, |j| values[rows - 1 - j].max(0.0)),
            tail,
        })
    }

    /// Degrees of freedom that the polynomial leaves.
    pub(super) fn free(&self) -> usize {
        self.eigenvalues.len()
    }

    /// The largest eigenvalue, or 0.
    pub(super) fn largest(&self) -> f64 {
        self.eigenvalues.first().copied().unwrap_or(0.0)
    }

    /// $z = U^T y$ for each column of `targets`, shape (k, columns).
    pub(super) fn coordinates(&self, targets: ArrayView2<'_, f64>) -> Array2<f64> {
        self.u.t().dot(&targets)
    }

    /// $1 / (\Lambda + \lambda)$; 0 for directions that neither of them reaches.
    fn inverse(&self, lambda: f64) -> Array1<f64> {
        let floor = ROUNDING * self.largest();
        self.eigenvalues.mapv(|value| {
            let sum = value + lambda;
            if sum > floor { 1.0 / sum } else { 0.0 }
        })
    }

    /// The weights for a $\lambda$ per column.
    pub(super) fn weights(
        &self,
        kernel: ArrayView2<'_, f64>,
        targets: ArrayView2<'_, f64>,
        lambda: &[f64],
    ) -> Weights {
        let mut scaled = self.coordinates(targets);
        for (mut column, &lambda) in scaled.columns_mut().into_iter().zip(lambda) {
            column *= &self.inverse(lambda);
        }
        let alpha = self.u.dot(&scaled);
        let mut rest = &targets - &kernel.dot(&alpha);
        for ((mut column, &lambda), alpha) in rest
            .columns_mut()
            .into_iter()
            .zip(lambda)
            .zip(alpha.columns())
        {
            column.scaled_add(-lambda, &alpha);
        }
        Weights {
            tail: self.tail.coefficients(rest.view()),
            kernel: alpha,
        }
    }

    /// The leave-one-out errors of each column, $\alpha_i / G_{ii}$ with $G = U (\Lambda +
    /// \lambda)^{-1} U^T$; `squared` as [`squared`](Self::squared) gives it and `coordinates` as
    /// [`coordinates`](Self::coordinates) does.
    ///
    /// S. Rippa, *An Algorithm for Selecting a Good Value for the Parameter c in Radial Basis
    /// Function Interpolation*, Advances in Computational Mathematics 11, 1999.
    pub(super) fn leave_one_out(
        &self,
        squared: ArrayView2<'_, f64>,
        coordinates: ArrayView2<'_, f64>,
        lambda: f64,
    ) -> Array2<f64> {
        let inverse = self.inverse(lambda);
        let mut errors = self
            .u
            .dot(&(&coordinates * &inverse.view().insert_axis(Axis(1))));
        let diagonal = squared.dot(&inverse);
        Zip::from(errors.rows_mut())
            .and(&diagonal)
            .for_each(|mut row, &g| {
                // A row that nothing but itself determines has no leave-one-out error.
                row.mapv_inplace(|e| if g > 0.0 { e / g } else { 0.0 });
            });
        errors
    }

    /// $U_{ij}^2$, as [`leave_one_out`](Self::leave_one_out) wants them.
    pub(super) fn squared(&self) -> Array2<f64> {
        self.u.mapv(|u| u * u)
    }

    /// The restricted log likelihood of each column under a Gaussian process of covariance
    /// $\sigma^2 (K + \lambda I)$ and a mean that is any of the polynomials, at its best
    /// $\sigma^2$; up to a constant of the polynomials and the number of rows. $-\infty$ where
    /// it does not exist. `squared` has the squares of [`coordinates`](Self::coordinates).
    ///
    /// D. Harville, *Bayesian Inference for Variance Components Using Only Error Contrasts*,
    /// Biometrika 61(2), 1974.
    pub(super) fn log_likelihood(&self, squared: ArrayView2<'_, f64>, lambda: f64) -> Array1<f64> {
        let count = self.free() as f64;
        let sums = &self.eigenvalues + lambda;
        let log_determinant: f64 = sums.iter().map(|sum| sum.ln()).sum();
        let quadratic = sums.mapv(f64::recip).dot(&squared);
        quadratic.mapv_into(|quadratic| {
            let likelihood = -0.5 * (count * (quadratic / count).ln() + log_determinant);
            if likelihood.is_nan() {
                f64::NEG_INFINITY
            } else {
                likelihood
            }
        })
    }
}

/// An orthonormal basis of the span of a polynomial's columns.
struct Tail {
    /// Shape (rows, rank).
    basis: Array2<f64>,
    /// $T$ with $P T$ = basis, shape (terms, rank).
    transform: Array2<f64>,
}

impl Tail {
    /// Gram and Schmidt's process, twice over; columns that depend on those before are left out.
    fn new(polynomial: ArrayView2<'_, f64>) -> Self {
        let (rows, terms) = polynomial.dim();
        let (mut basis, mut transform) = (Array2::zeros((rows, 0)), Array2::zeros((terms, 0)));
        for (term, column) in polynomial.columns().into_iter().enumerate() {
            let length = column.dot(&column).sqrt();
            let mut vector = column.to_owned();
            let mut source = Array1::zeros(terms);
            source[term] = 1.0;
            for _ in 0..2 {
                let shares = basis.t().dot(&vector);
                vector -= &basis.dot(&shares);
                source -= &transform.dot(&shares);
            }
            let rest = vector.dot(&vector).sqrt();
            // The square root of rounding: a column less independent than that would get a
            // coefficient without meaning.
            if rest > 1e-8 * length && basis.ncols() < rows {
                basis = with_column(&basis, &(vector / rest));
                transform = with_column(&transform, &(source / rest));
            }
        }
        Self { basis, transform }
    }

    /// $(I - B B^T) K (I - B B^T)$, symmetric to the last bit.
    fn project(&self, kernel: Array2<f64>) -> Array2<f64> {
        let b = &self.basis;
        let kb = kernel.dot(b);
        let bkb = b.t().dot(&kb);
        let half = &kb - &(b.dot(&bkb) * 0.5);
        let mut out = kernel;
        out -= &half.dot(&b.t());
        out -= &b.dot(&half.t());
        let rows = out.nrows();
        for i in 0..rows {
            for j in 0..i {
                let mean = 0.5 * (out[[i, j]] + out[[j, i]]);
                out[[i, j]] = mean;
                out[[j, i]] = mean;
            }
        }
        out
    }

    /// Coefficients of the polynomial nearest to each column.
    fn coefficients(&self, columns: ArrayView2<'_, f64>) -> Array2<f64> {
        self.transform.dot(&self.basis.t().dot(&columns))
    }
}

fn with_column(matrix: &Array2<f64>, column: &Array1<f64>) -> Array2<f64> {
    let (rows, columns) = matrix.dim();
    Array2::from_shape_fn((rows, columns + 1), |(i, j)| {
        if j < columns {
            matrix[[i, j]]
        } else {
            column[i]
        }
    })
}

/// The most rows that a dense kernel matrix is made for: 4000 rows take 128 MB and a minute.
pub(super) const MAX_ROWS: usize = 4000;

/// Refuses more rows than [`MAX_ROWS`].
pub(super) fn check_rows(method: &'static str, rows: usize) -> Result<()> {
    if rows > MAX_ROWS {
        return Err(Error::TooManyRows {
            method,
            rows,
            most: MAX_ROWS,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use ndarray::{arr1, arr2, array};

    /// A covariance of four points on a line, and what was measured there.
    fn four() -> (Array2<f64>, Array2<f64>) {
        let x = [0.0_f64, 0.4, 1.1, 2.0];
        let kernel = Array2::from_shape_fn((4, 4), |(i, j)| f64::exp(-0.5 * (x[i] - x[j]).powi(2)));
        (kernel, array![[0.3], [-0.2], [0.9], [0.4]])
    }

    #[test]
    fn two_points_have_the_textbooks_mean() {
        // C. Rasmussen, C. Williams, eq. 2.23 and 2.38. A = [[1 + l, k], [k, 1 + l]] has
        // A^-1 = [[1 + l, -k], [-k, 1 + l]] / ((1 + l)^2 - k^2).
        let (k, l) = (0.6, 0.1);
        let kernel = arr2(&[[1.0, k], [k, 1.0]]);
        let y = arr2(&[[0.5], [-0.3]]);
        let none = Projected::new(kernel.clone(), Array2::zeros((2, 0)).view()).unwrap();
        let alpha = none.weights(kernel.view(), y.view(), &[l]).kernel;
        let determinant = (1.0 + l) * (1.0 + l) - k * k;
        let expected = array![
            [((1.0 + l) * 0.5 + k * 0.3) / determinant],
            [(-k * 0.5 - (1.0 + l) * 0.3) / determinant]
        ];
        assert_abs_diff_eq!(alpha, expected, epsilon = 1e-14);

        // With a mean to be found: by symmetry it is (0.5 - 0.3) / 2, and A^-1 (y - mean) =
        // (0.4, -0.4) / (1 + l - k), as (1, -1) is an eigenvector.
        let constant = Projected::new(kernel.clone(), Array2::ones((2, 1)).view()).unwrap();
        let weights = constant.weights(kernel.view(), y.view(), &[l]);
        let alpha = 0.4 / (1.0 + l - k);
        assert_abs_diff_eq!(weights.tail, array![[0.1]], epsilon = 1e-14);
        assert_abs_diff_eq!(weights.kernel, array![[alpha], [-alpha]], epsilon = 1e-14);
    }

    #[test]
    fn weights_solve_the_bordered_system() {
        let (kernel, y) = four();
        let polynomial = arr2(&[[1.0, 0.0], [1.0, 0.4], [1.0, 1.1], [1.0, 2.0]]);
        let projected = Projected::new(kernel.clone(), polynomial.view()).unwrap();
        assert_eq!(projected.free(), 2);
        for lambda in [0.0, 0.01, 3.0] {
            let Weights {
                kernel: alpha,
                tail,
            } = projected.weights(kernel.view(), y.view(), &[lambda]);
            let left = kernel.dot(&alpha) + &alpha * lambda + polynomial.dot(&tail);
            assert_abs_diff_eq!(left, y, epsilon = 1e-12);
            assert_abs_diff_eq!(
                polynomial.t().dot(&alpha),
                Array2::zeros((2, 1)),
                epsilon = 1e-12
            );
        }
    }

    #[test]
    fn leave_one_out_errors_are_those_of_leaving_one_out() {
        let (kernel, y) = four();
        let (lambda, ones) = (0.05, Array2::ones((4, 1)));
        let projected = Projected::new(kernel.clone(), ones.view()).unwrap();
        let coordinates = projected.coordinates(y.view());
        let errors =
            projected.leave_one_out(projected.squared().view(), coordinates.view(), lambda);
        for out in 0..4 {
            let rest: Vec<usize> = (0..4).filter(|&row| row != out).collect();
            let (k, t) = (
                kernel.select(Axis(0), &rest).select(Axis(1), &rest),
                y.select(Axis(0), &rest),
            );
            let fitted = Projected::new(k.clone(), Array2::ones((3, 1)).view()).unwrap();
            let weights = fitted.weights(k.view(), t.view(), &[lambda]);
            let across = kernel.row(out).select(Axis(0), &rest);
            let predicted = across.dot(&weights.kernel.column(0)) + weights.tail[[0, 0]];
            assert_abs_diff_eq!(errors[[out, 0]], y[[out, 0]] - predicted, epsilon = 1e-12);
        }
    }

    #[test]
    fn the_restricted_likelihood_agrees_with_its_definition() {
        // Harville: -1/2 [(n - 1) ln s2 + ln |A| + ln (1' A^-1 1) - ln (1' 1)] with s2 = (y - m)'
        // A^-1 (y - m) / (n - 1) and m = 1' A^-1 y / 1' A^-1 1; a diagonal A needs no algebra.
        let (diagonal, y, lambda) = (arr1(&[1.0, 2.0, 4.0]), arr1(&[0.3, -0.5, 0.7]), 0.5);
        let a = &diagonal + lambda;
        let weight = a.mapv(f64::recip).sum();
        let mean = (&y / &a).sum() / weight;
        let s2 = ((&y - mean).mapv(|d| d * d) / &a).sum() / 2.0;
        let definition =
            -0.5 * (2.0 * s2.ln() + a.mapv(f64::ln).sum() + weight.ln() - 3.0_f64.ln());

        let projected =
            Projected::new(Array2::from_diag(&diagonal), Array2::ones((3, 1)).view()).unwrap();
        let z = projected.coordinates(y.insert_axis(Axis(1)).view());
        let likelihood = projected.log_likelihood(z.mapv(|z| z * z).view(), lambda);
        assert_abs_diff_eq!(likelihood[0], definition, epsilon = 1e-12);
    }

    #[test]
    fn dependent_columns_of_the_polynomial_get_no_coefficient() {
        let (kernel, y) = four();
        let twice = Array2::from_elem((4, 2), 2.0);
        let projected = Projected::new(kernel.clone(), twice.view()).unwrap();
        assert_eq!(projected.free(), 3);
        let weights = projected.weights(kernel.view(), y.view(), &[0.1]);
        assert_eq!(weights.tail[[1, 0]], 0.0);
    }
}
