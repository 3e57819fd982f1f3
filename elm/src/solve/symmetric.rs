//! Products of a symmetric matrix with vectors.

use ndarray::{Array1, Array2, ArrayView2};
use pulp::{Simd, WithSimd};

use crate::scalar::Scalar;
use crate::simd::{Aligned, Lanes, Level, zeros};

/// Registers of sums that are taken together.
const TOGETHER: usize = 4;

/// A symmetric matrix, whole, laid out for products with vectors.
pub(crate) struct Symmetric<A: Scalar> {
    n: usize,
    /// By columns, each filled up with zeros to whole groups of registers.
    columns: Aligned<A>,
}

impl<A: Scalar> Symmetric<A> {
    /// Of the lower half of a square matrix.
    pub(crate) fn of_lower(lower: &Array2<A>) -> Self {
        let n = lower.nrows();
        let stride = stride::<A>(n);
        let mut columns = zeros::<A>(n * stride);
        for (j, column) in lower.columns().into_iter().enumerate() {
            for (i, &value) in column.iter().enumerate().skip(j) {
                columns[j * stride + i] = value;
                columns[i * stride + j] = value;
            }
        }
        Self { n, columns }
    }

    /// Number of rows, and of columns.
    pub(crate) fn len(&self) -> usize {
        self.n
    }

    /// The matrix itself.
    pub(crate) fn whole(&self) -> Array2<A> {
        let view = ArrayView2::from_shape((self.n, stride::<A>(self.n)), &self.columns);
        view.map_or_else(
            |_| Array2::zeros((0, 0)),
            |view| view.slice(ndarray::s![.., ..self.n]).to_owned(),
        )
    }

    /// The product with a vector of as many values. The same bits wherever multiply-add is fused.
    pub(crate) fn product(&self, x: &Array1<A>) -> Array1<A> {
        let stride = stride::<A>(self.n);
        let mut y = zeros::<A>(stride);
        Level::best().run(Product {
            columns: &self.columns,
            x,
            y: &mut y,
        });
        y.iter().copied().take(self.n).collect()
    }
}

fn stride<A: Scalar>(n: usize) -> usize {
    n.next_multiple_of(TOGETHER * A::LINE)
}

struct Product<'a, A: Scalar> {
    columns: &'a [A],
    x: &'a Array1<A>,
    y: &'a mut [A],
}

impl<A: Scalar> WithSimd for Product<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let stride = self.y.len();
        let y = A::registers_mut::<S>(self.y).0;
        for (group, y) in y.chunks_exact_mut(TOGETHER).enumerate() {
            let mut sums = [Lanes::<S, A>::splat(simd, A::ZERO); TOGETHER];
            for (column, &x) in self.columns.chunks_exact(stride).zip(self.x) {
                let column = &A::registers::<S>(column).0[group * TOGETHER..][..TOGETHER];
                let x = Lanes::splat(simd, x);
                for (sum, &a) in sums.iter_mut().zip(column) {
                    *sum = Lanes::new(simd, a).mul_add(x, *sum);
                }
            }
            for (y, sum) in y.iter_mut().zip(sums) {
                *y = sum.register();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::ShapeBuilder;

    #[test]
    fn one_half_gives_the_product_of_the_whole() {
        for n in [1, 2, 5, 32, 33, 70] {
            let value = |i: usize, j: usize| ((3 * i.max(j) + 7 * i.min(j)) % 11) as f64 - 4.0;
            let whole = Array2::from_shape_fn((n, n), |(i, j)| value(i, j));
            let x = Array1::from_shape_fn(n, |i| (i % 5) as f64 - 2.0);
            // Integers, so that no sum rounds.
            let half = |(i, j)| if i >= j { value(i, j) } else { f64::NAN };
            for lower in [
                Array2::from_shape_fn((n, n).f(), half),
                Array2::from_shape_fn((n, n), half),
            ] {
                let symmetric = Symmetric::of_lower(&lower);
                assert_eq!(symmetric.product(&x), whole.dot(&x));
                assert_eq!(symmetric.whole(), whole);
            }
        }
    }
}
