//! The Cholesky factor of a symmetric positive definite matrix, for problems that are sums of products.

use ndarray::{Array1, Array2, ArrayRef2};

use crate::check::check_length;
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// The lower triangle $L$ of $A = L L^T$.
///
/// ```
/// use elm::solve::Cholesky;
/// use ndarray::array;
///
/// let factor = Cholesky::new(array![[4.0, 2.0], [2.0, 3.0]])?;
/// let x = factor.solve(&array![[8.0], [7.0]])?;
/// assert!((x[[0, 0]] - 1.25_f64).abs() < 1e-12 && (x[[1, 0]] - 1.5).abs() < 1e-12);
/// assert!((factor.log_determinant() - 8_f64.ln()).abs() < 1e-12);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Cholesky<A: Scalar> {
    /// What is above its diagonal is not said.
    lower: Array2<A>,
}

impl<A: Scalar> Cholesky<A> {
    /// Factorizes a symmetric matrix, of which only what is on and below the diagonal is read. A matrix
    /// that lies by columns is overwritten, any other copied.
    ///
    /// # Errors
    /// [`Error::Shape`] where it is not square, [`Error::NotPositiveDefinite`] where it is not, to
    /// rounding, or holds a NaN.
    pub fn new(matrix: Array2<A>) -> Result<Self> {
        let (rows, columns) = matrix.dim();
        check_length("columns of the matrix", columns, rows)?;
        match A::cholesky(matrix) {
            Ok(lower) if lower.diag().iter().all(|pivot| pivot.is_finite()) => Ok(Self { lower }),
            _ => Err(Error::NotPositiveDefinite),
        }
    }

    /// $A^{-1} B$ for `b` of shape (rows of the matrix, any).
    ///
    /// # Errors
    /// [`Error::Shape`] where `b` has another number of rows.
    pub fn solve(&self, b: &ArrayRef2<A>) -> Result<Array2<A>> {
        let half = self.forward(b)?;
        Ok(A::solve_lower_transposed(&self.lower, half.view())?)
    }

    /// $L^{-1} B$, whose squares sum to $B^T A^{-1} B$.
    ///
    /// # Errors
    /// [`Error::Shape`] where `b` has another number of rows.
    pub fn forward(&self, b: &ArrayRef2<A>) -> Result<Array2<A>> {
        check_length("rows of the right-hand side", b.nrows(), self.lower.nrows())?;
        Ok(A::solve_lower(&self.lower, b.view())?)
    }

    /// $A^{-1}$, both of its halves, for less than [`solve`](Self::solve) with the identity costs.
    ///
    /// ```
    /// use elm::solve::Cholesky;
    /// use ndarray::{Array2, array};
    ///
    /// let a = array![[4.0_f64, 2.0], [2.0, 3.0]];
    /// let inverse = Cholesky::new(a.clone())?.inverse()?;
    /// assert!((a.dot(&inverse) - Array2::<f64>::eye(2)).iter().all(|v| v.abs() < 1e-14));
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] where a pivot is zero.
    pub fn inverse(&self) -> Result<Array2<A>> {
        let mut inverse = A::inverse_of_positive(&self.lower)?;
        for row in 0..inverse.nrows() {
            for column in row + 1..inverse.nrows() {
                inverse[[row, column]] = inverse[[column, row]];
            }
        }
        Ok(inverse)
    }

    /// $\ln \det A$.
    #[must_use]
    pub fn log_determinant(&self) -> A {
        let logs: Array1<A> = self.lower.diag().mapv(A::ln);
        let sum = logs.sum();
        sum + sum
    }
}
