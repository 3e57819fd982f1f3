//! The few linear algebra primitives that the solvers need, and the only place that names a
//! linear algebra crate. One file per back end; all take any strides and expect finite input.
//!
//! What is worth it is cut into parts for several threads, by sizes alone, so that a result does not depend
//! on how many threads there are; the linear algebra crates themselves stay on one.

#[cfg(all(feature = "faer", not(feature = "openblas-system")))]
mod faer;
#[cfg(feature = "openblas-system")]
mod lapack;

#[cfg(not(any(feature = "faer", feature = "openblas-system")))]
compile_error!("elm-learn needs a linear algebra back end: feature `faer` or `openblas-system`");

use ndarray::{Array1, Array2, ArrayView2, ShapeBuilder};
use num_traits::Zero;

/// Rows or columns that are copied together where a matrix changes its layout: both sides stay in cache.
pub(crate) const BAND: usize = 32;

/// The linear algebra back end that this build uses, `"faer"` or `"openblas"`.
#[must_use]
pub fn backend() -> &'static str {
    if cfg!(feature = "openblas-system") {
        "openblas"
    } else {
        "faer"
    }
}

/// A thin singular value decomposition $A = U \operatorname{diag}(s) V^T$, singular values
/// falling.
#[derive(Debug, Clone)]
pub struct Svd<A> {
    /// Shape (rows, min(rows, columns)).
    pub u: Array2<A>,
    /// Length min(rows, columns).
    pub s: Array1<A>,
    /// Shape (min(rows, columns), columns).
    pub vt: Array2<A>,
}

/// The eigenvalues and eigenvectors of a symmetric matrix that has no negative ones: $A = V
/// \operatorname{diag}(\lambda) V^T$.
#[derive(Debug, Clone)]
pub struct Eigen<A> {
    /// Falling; what rounding makes negative is 0.
    pub values: Array1<A>,
    /// An eigenvector in each row.
    pub vt: Array2<A>,
}

/// A least-squares problem $\min \|AX - B\|$ reduced to its triangle by $A = QR$.
#[derive(Debug, Clone)]
pub struct QrFactor<A> {
    /// $R$, square, zero below the diagonal.
    pub r: Array2<A>,
    /// $Q^T B$, shape (columns of $A$, columns of $B$).
    pub qtb: Array2<A>,
    /// For each column of $B$, the sum of squares of the part that no combination of $A$'s
    /// columns reaches.
    pub residual_ss: Array1<A>,
}

/// The answer of a symmetric positive definite system.
#[derive(Debug, Clone)]
pub struct CholeskySolve<A> {
    /// The solution, as many columns as the right-hand side.
    pub x: Array2<A>,
    /// The trace of the inverse, the sum of 1 / eigenvalue: at least the norm of the inverse, at
    /// most that times the dimension.
    pub inverse_trace: A,
}

/// Why a primitive gave no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// An iteration limit was reached.
    NoConvergence,
    /// A pivot was zero or, for Cholesky, not positive.
    Pivot,
}

/// What a back end provides for one scalar type.
///
/// Not public: it is named by the sealed [`Scalar`](crate::Scalar) alone.
pub trait Backend: Sized {
    /// $A B$.
    fn product(a: ArrayView2<'_, Self>, b: ArrayView2<'_, Self>) -> Array2<Self>;

    /// The thin singular value decomposition.
    fn svd(a: ArrayView2<'_, Self>) -> Result<Svd<Self>, Failure>;

    /// The singular values alone, falling.
    fn singular_values(a: ArrayView2<'_, Self>) -> Result<Array1<Self>, Failure>;

    /// Of a symmetric matrix without negative eigenvalues, of which the lower half is read.
    fn eigen(a: ArrayView2<'_, Self>) -> Result<Eigen<Self>, Failure>;

    /// $A = QR$ for `a` with at least as many rows as columns, applied to `b`.
    fn triangularize(
        a: ArrayView2<'_, Self>,
        b: ArrayView2<'_, Self>,
    ) -> Result<QrFactor<Self>, Failure>;

    /// $R$ alone, for `a` with at least as many rows as columns, whose place it may take.
    fn triangle(a: Array2<Self>) -> Result<Array2<Self>, Failure>;

    /// Solves $R X = B$ for square $R$, of which the upper half is read.
    fn solve_upper(
        r: ArrayView2<'_, Self>,
        b: ArrayView2<'_, Self>,
    ) -> Result<Array2<Self>, Failure>;

    /// Solves $A X = B$ for square $A$ by LU with partial pivoting.
    fn solve_square(
        a: ArrayView2<'_, Self>,
        b: ArrayView2<'_, Self>,
    ) -> Result<Array2<Self>, Failure>;

    /// Adds $A^T A$ to the lower half of `sum`, a square matrix that lies by columns. What the
    /// upper half is afterwards is not said. What is in `scratch` does not matter; kept from one
    /// call to the next it saves allocations.
    fn add_gram(a: ArrayView2<'_, Self>, sum: &mut Array2<Self>, scratch: &mut Vec<Self>);

    /// $A^T A$, of which the lower half is to be read, by columns.
    fn gram(a: ArrayView2<'_, Self>) -> Array2<Self>
    where
        Self: Copy + Zero,
    {
        let mut sum = Array2::zeros((a.ncols(), a.ncols()).f());
        Self::add_gram(a, &mut sum, &mut Vec::new());
        sum
    }

    /// Solves $A X = B$ for symmetric positive definite $A$ by Cholesky. Only the lower half of
    /// `a` is read.
    fn solve_positive(
        a: ArrayView2<'_, Self>,
        b: ArrayView2<'_, Self>,
    ) -> Result<CholeskySolve<Self>, Failure>;

    /// The $L$ of $A = L L^T$ for symmetric positive definite $A$, of which the lower half is read. The
    /// upper half of the result is not said.
    fn cholesky(a: Array2<Self>) -> Result<Array2<Self>, Failure>;

    /// Solves $L X = B$, of which the lower half of $L$ is read.
    fn solve_lower(l: &Array2<Self>, b: ArrayView2<'_, Self>) -> Result<Array2<Self>, Failure>;

    /// Solves $L^T X = B$, of which the lower half of $L$ is read.
    fn solve_lower_transposed(
        l: &Array2<Self>,
        b: ArrayView2<'_, Self>,
    ) -> Result<Array2<Self>, Failure>;

    /// $(L L^T)^{-1}$, of which the lower half is to be read, as is that of $L$.
    fn inverse_of_positive(l: &Array2<Self>) -> Result<Array2<Self>, Failure>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Scalar;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use ndarray::{Array, Axis, array};
    use ndarray_rand::RandomExt;
    use ndarray_rand::rand_distr::StandardNormal;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn random(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
        Array::random_using(
            (rows, columns),
            StandardNormal,
            &mut ChaCha8Rng::seed_from_u64(seed),
        )
    }

    fn both_halves(lower: &Array2<f64>) -> Array2<f64> {
        Array2::from_shape_fn(lower.dim(), |(i, j)| lower[[i.max(j), i.min(j)]])
    }

    const SHAPES: [(usize, usize); 8] = [
        (1, 1),
        (5, 1),
        (1, 5),
        (7, 7),
        (40, 7),
        (7, 40),
        (185, 60),
        (300, 299),
    ];

    #[test]
    fn svd_factors_multiply_to_the_matrix_and_are_orthonormal() {
        for (rows, columns) in SHAPES {
            // A transposed view too: the layout must not matter.
            for a in [
                random(rows, columns, 1).view(),
                random(columns, rows, 2).t(),
            ] {
                let Svd { u, s, vt } = f64::svd(a).unwrap();
                let k = rows.min(columns);
                assert_eq!((u.dim(), s.len(), vt.dim()), ((rows, k), k, (k, columns)));
                assert!(s.windows(2).into_iter().all(|pair| pair[0] >= pair[1]));
                assert_abs_diff_eq!((&u * &s).dot(&vt), a, epsilon = 1e-12);
                assert_abs_diff_eq!(u.t().dot(&u), Array2::eye(k), epsilon = 1e-12);
                assert_abs_diff_eq!(vt.dot(&vt.t()), Array2::eye(k), epsilon = 1e-12);
                assert_abs_diff_eq!(f64::singular_values(a).unwrap(), s, epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn symmetric_matrices_have_their_eigenvectors() {
        for n in [1, 2, 7, 60, 150] {
            let a = f64::gram(random(n / 2 + 1, n, 9).view());
            let Eigen { values, vt } = f64::eigen(a.view()).unwrap();
            assert!(values.windows(2).into_iter().all(|pair| pair[0] >= pair[1]));
            assert!(values.iter().all(|value| *value >= 0.0));
            let again = vt.t().dot(&(&vt * &values.view().insert_axis(Axis(1))));
            assert_abs_diff_eq!(again, both_halves(&a), epsilon = 1e-12 * n as f64);
            assert_abs_diff_eq!(vt.dot(&vt.t()), Array2::eye(n), epsilon = 1e-13 * n as f64);
            let svd = f64::svd(both_halves(&a).view()).unwrap();
            assert_abs_diff_eq!(values, svd.s, epsilon = 1e-12 * n as f64);
        }
    }

    #[test]
    fn parts_of_a_larger_matrix_are_taken_as_they_lie() {
        let whole = random(90, 80, 8);
        for size in [1, 2, 30] {
            let part = whole.slice(ndarray::s![3..3 + 2 * size;2, 5..5 + size]);
            let part = part.slice(ndarray::s![..size.min(part.nrows()), ..]);
            let copy = part.to_owned().as_standard_layout().into_owned();
            assert_eq!(f64::svd(part).unwrap().s, f64::svd(copy.view()).unwrap().s);
            let right = whole.slice(ndarray::s![..part.nrows(), 7..8]);
            let one = f64::triangularize(part, right).unwrap();
            let other = f64::triangularize(copy.view(), right.to_owned().view()).unwrap();
            assert_eq!((one.r, one.qtb), (other.r, other.qtb));
            assert_eq!(
                f64::solve_square(part, right).unwrap(),
                f64::solve_square(copy.view(), right).unwrap()
            );
            assert_abs_diff_eq!(
                both_halves(&f64::gram(part)),
                copy.t().dot(&copy),
                epsilon = 1e-12
            );
            assert_eq!(f64::product(part, right), f64::product(copy.view(), right));
        }
    }

    #[test]
    fn triangularize_keeps_norms_and_normal_equations() {
        for (rows, columns) in [(1, 1), (5, 5), (40, 7), (600, 60)] {
            let (a, b) = (random(rows, columns, 3), random(rows, 4, 4));
            let QrFactor {
                r,
                qtb,
                residual_ss,
            } = f64::triangularize(a.view(), b.view()).unwrap();
            for ((i, j), &value) in r.indexed_iter() {
                assert!(i <= j || value == 0.0, "below the diagonal");
            }
            assert_abs_diff_eq!(r.t().dot(&r), a.t().dot(&a), epsilon = 1e-11);
            assert_abs_diff_eq!(r.t().dot(&qtb), a.t().dot(&b), epsilon = 1e-11);
            let reached = (&qtb * &qtb).sum_axis(Axis(0));
            assert_abs_diff_eq!(
                reached + residual_ss,
                (&b * &b).sum_axis(Axis(0)),
                epsilon = 1e-10
            );
        }
    }

    #[test]
    fn square_and_positive_systems_are_solved() {
        for n in [1, 2, 9, 64, 150] {
            let (a, x) = (
                random(n, n, 5) + Array2::<f64>::eye(n) * 4.0 * (n as f64).sqrt(),
                random(n, 3, 6),
            );
            assert_abs_diff_eq!(
                f64::solve_square(a.view(), a.dot(&x).view()).unwrap(),
                x,
                epsilon = 1e-10
            );
            let p = a.t().dot(&a);
            let mut gram = f64::gram(a.view());
            assert_abs_diff_eq!(both_halves(&gram), p, epsilon = 1e-10);
            f64::add_gram(a.t(), &mut gram, &mut Vec::new());
            let sum = &p + &a.dot(&a.t());
            assert_abs_diff_eq!(both_halves(&gram), sum, epsilon = 1e-10);
            let solved = f64::solve_positive(p.view(), p.dot(&x).view()).unwrap();
            assert_abs_diff_eq!(solved.x, x, epsilon = 1e-9);
            let factor = f64::cholesky(p.clone()).unwrap();
            let inverse = both_halves(&f64::inverse_of_positive(&factor).unwrap());
            assert_abs_diff_eq!(p.dot(&inverse), Array2::eye(n), epsilon = 1e-10);
            let s = f64::singular_values(a.view()).unwrap();
            let r = Array2::from_shape_fn((n, n), |(i, j)| if i <= j { a[[i, j]] } else { 0.0 });
            assert_abs_diff_eq!(
                f64::solve_upper(a.view(), r.dot(&x).view()).unwrap(),
                x,
                epsilon = 1e-10
            );
            assert_relative_eq!(
                solved.inverse_trace,
                s.mapv(|s| s.powi(-2)).sum(),
                max_relative = 1e-11
            );
        }
    }

    #[test]
    fn products_of_wide_matrices_are_those_of_narrow_ones() {
        for (rows, columns) in [(3, 241), (50, 250), (7, 601)] {
            // Small integers, so that nothing rounds.
            let a = Array2::from_shape_fn((rows, columns), |(i, j)| ((3 * i + 5 * j) % 7) as f64);
            let (by_rows, by_columns) = (f64::gram(a.view()), f64::gram(a.t().to_owned().t()));
            assert_eq!(both_halves(&by_rows), a.t().dot(&a));
            assert_eq!(both_halves(&by_columns), a.t().dot(&a));
            let single = f32::gram(a.mapv(|v| v as f32).view());
            assert_eq!(both_halves(&single.mapv(Scalar::as_f64)), a.t().dot(&a));
        }
    }

    #[test]
    fn a_triangle_without_a_pivot_is_not_solved() {
        let r: Array2<f64> = array![[1.0, 2.0], [0.0, 0.0]];
        let solved = f64::solve_upper(r.view(), Array2::eye(2).view());
        assert_eq!(solved.unwrap_err(), Failure::Pivot);
    }

    #[test]
    fn an_indefinite_matrix_has_no_cholesky_factor() {
        let a: Array2<f64> = array![[1.0, 2.0], [2.0, 1.0]];
        assert_eq!(
            f64::solve_positive(a.view(), a.view()).unwrap_err(),
            Failure::Pivot
        );
    }

    #[test]
    fn single_precision_agrees_with_double() {
        let a = random(50, 20, 7);
        let single = f32::svd(a.mapv(|v| v as f32).view()).unwrap();
        assert_abs_diff_eq!(
            single.s.mapv(Scalar::as_f64),
            f64::svd(a.view()).unwrap().s,
            epsilon = 1e-4
        );
    }
}
