//! Products of a symmetric matrix, of which one half is there, with a vector.

use ndarray::{Array1, Array2};
use pulp::{Simd, WithSimd};

use crate::scalar::Scalar;
use crate::simd::{Lanes, Level};

/// $A x$ for the symmetric matrix whose lower half is that of `lower`, which lies by columns.
pub(crate) fn symmetric_product<A: Scalar>(lower: &Array2<A>, x: &Array1<A>) -> Array1<A> {
    let mut y = Array1::zeros(x.len());
    let columns = lower.t();
    if let (Some(lower), Some(x), Some(sums)) = (columns.to_slice(), x.as_slice(), y.as_slice_mut())
    {
        Level::best().run(Product { lower, x, y: sums });
        return y;
    }
    for (j, column) in lower.columns().into_iter().enumerate() {
        y[j] += column[j] * x[j];
        for i in j + 1..x.len() {
            y[i] += column[i] * x[j];
            y[j] += column[i] * x[i];
        }
    }
    y
}

struct Product<'a, A: Scalar> {
    lower: &'a [A],
    x: &'a [A],
    y: &'a mut [A],
}

impl<A: Scalar> WithSimd for Product<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let n = self.x.len();
        for (j, column) in self.lower.chunks_exact(n.max(1)).enumerate() {
            // Every entry is read once, for its row and for its column.
            let (column, column_rest) = A::registers::<S>(&column[j + 1..]);
            let (x, x_rest) = A::registers::<S>(&self.x[j + 1..]);
            let (y, y_rest) = A::registers_mut::<S>(&mut self.y[j + 1..]);
            let own = self.x[j];
            let factor = Lanes::<S, A>::splat(simd, own);
            let mut sums = [Lanes::<S, A>::splat(simd, A::ZERO); 2];
            for (index, ((&a, &x), y)) in column.iter().zip(x).zip(y).enumerate() {
                let a = Lanes::new(simd, a);
                sums[index % 2] = a.mul_add(Lanes::new(simd, x), sums[index % 2]);
                *y = a.mul_add(factor, Lanes::new(simd, *y)).register();
            }
            let mut sum = (sums[0] + sums[1]).sum();
            for ((&a, &x), y) in column_rest.iter().zip(x_rest).zip(y_rest) {
                sum += a * x;
                *y += a * own;
            }
            self.y[j] += self.lower[j * n + j] * own + sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::ShapeBuilder;

    #[test]
    fn one_half_gives_the_product_of_the_whole() {
        for n in [1, 2, 5, 33, 70] {
            let value = |i: usize, j: usize| ((3 * i.max(j) + 7 * i.min(j)) % 11) as f64 - 4.0;
            let whole = Array2::from_shape_fn((n, n), |(i, j)| value(i, j));
            let x = Array1::from_shape_fn(n, |i| (i % 5) as f64 - 2.0);
            // Integers, so that no sum rounds.
            let half = |(i, j)| if i >= j { value(i, j) } else { f64::NAN };
            let by_columns = Array2::from_shape_fn((n, n).f(), half);
            let by_rows = Array2::from_shape_fn((n, n), half);
            assert_eq!(symmetric_product(&by_columns, &x), whole.dot(&x));
            assert_eq!(symmetric_product(&by_rows, &x), whole.dot(&x));
        }
    }
}
