//! The largest eigenvalue of a symmetric matrix by Lanczos iteration.

use ndarray::{Array1, ArrayView2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::symmetric::Symmetric;
use crate::scalar::Scalar;

/// The largest eigenvalue of a symmetric matrix without negative ones, to 1e-10 of itself (32
/// epsilon in `f32`), by Lanczos iteration with full reorthogonalisation; `None` for a zero
/// matrix.
///
/// With a residual $r$ an eigenvalue lies within $r$ of the Ritz value, and within $r^2$ over the
/// distance to all others (Parlett, The Symmetric Eigenvalue Problem, 1998, ch. 4, 11 and 13); a
/// random start makes it the largest. That distance is taken from the next Ritz value, with a
/// factor of 100 for what that one may be short of. Eigenvalues that agree so nearly that the
/// iteration has not told them apart give one between them, to a hundred times the error above.
pub(crate) fn largest_eigenvalue<A: Scalar>(matrix: &Symmetric<A>) -> Option<A> {
    const STEPS: usize = 80;
    let n = matrix.len();
    let steps = STEPS.min(n);
    let tolerance = 1e-10_f64.max(32.0 * A::epsilon().as_f64());
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let start = Array1::from_shape_simple_fn(n, || A::from_f64(rng.random_range(-1.0..1.0)));
    let mut basis: Vec<A> = Vec::new();
    let mut next = &start / start.dot(&start).sqrt();
    let mut small = Tridiagonal::default();
    let mut value = 0.0;
    for step in 0..steps {
        basis.extend(&next);
        let known = ArrayView2::from_shape((step + 1, n), &basis).ok()?;
        next = matrix.product(&next);
        small.diagonal.push(known.row(step).dot(&next).as_f64());
        for _ in 0..2 {
            let shares = known.dot(&next);
            next -= &shares.dot(&known);
        }
        let rest = next.dot(&next).sqrt();
        let last = step + 1 == steps;
        if step % 4 == 3 || last || rest == A::zero() {
            // Ritz values only grow.
            value = small.bisect(value, small.bound());
            if value <= 0.0 || !value.is_finite() {
                return None;
            }
            let residual = rest.as_f64() * small.last_component(value);
            let close = residual <= tolerance * value || step + 1 == n;
            // What the gap must be, for it to show that the value is close.
            let gap = 100.0 * residual * residual / (tolerance * value);
            let nearly = residual <= 100.0 * tolerance * value;
            if close || (nearly && gap < value && !small.above(value - gap, 2)) {
                return Some(A::from_f64(value));
            }
        }
        small.beside.push(rest.as_f64());
        next /= rest;
    }
    // Many eigenvalues crowd at the top: all of them, then.
    let all = A::singular_values(matrix.whole().view()).ok()?;
    (all[0] > A::zero()).then_some(all[0])
}

/// A symmetric tridiagonal matrix, which Lanczos iteration makes of a larger one.
#[derive(Default)]
struct Tridiagonal {
    diagonal: Vec<f64>,
    /// One less, or as many, the last of which is not used.
    beside: Vec<f64>,
}

impl Tridiagonal {
    /// No eigenvalue is larger (Gershgorin).
    fn bound(&self) -> f64 {
        let beside = |i: usize| self.beside.get(i).copied().unwrap_or(0.0);
        let last = self.diagonal.len() - 1;
        let row = |(i, diagonal): (usize, &f64)| {
            let left = if i == 0 { 0.0 } else { beside(i - 1) };
            let right = if i == last { 0.0 } else { beside(i) };
            diagonal.abs() + left + right
        };
        self.diagonal
            .iter()
            .enumerate()
            .map(row)
            .fold(0.0, f64::max)
    }

    /// The largest eigenvalue to a few roundings, which lies between these two.
    fn bisect(&self, mut low: f64, mut high: f64) -> f64 {
        loop {
            let middle = low + (high - low) / 2.0;
            if high - low <= 4.0 * f64::EPSILON * high || !high.is_finite() {
                return high;
            }
            if self.above(middle, 1) {
                low = middle;
            } else {
                high = middle;
            }
        }
    }

    /// Whether at least `wanted` eigenvalues are larger than `value`: the pivots of elimination
    /// have the signs of the eigenvalues (Sylvester's law of inertia).
    fn above(&self, value: f64, wanted: usize) -> bool {
        let mut found = 0;
        let mut pivot = 1.0_f64;
        for (i, &diagonal) in self.diagonal.iter().enumerate() {
            let coupling = if i == 0 { 0.0 } else { self.beside[i - 1] };
            pivot = diagonal - value - coupling * coupling / pivot;
            if pivot == 0.0 {
                pivot = -f64::MIN_POSITIVE;
            }
            found += usize::from(pivot > 0.0);
            if found == wanted {
                return true;
            }
        }
        false
    }

    /// The magnitude of the last component of the unit eigenvector of the largest eigenvalue,
    /// by recursion from there: above all eigenvalues of the parts below, components only grow.
    fn last_component(&self, value: f64) -> f64 {
        let (mut below, mut here, mut squares) = (0.0_f64, 1.0_f64, 1.0_f64);
        for i in (1..self.diagonal.len()).rev() {
            let coupling_below = self.beside.get(i).copied().unwrap_or(0.0);
            let above =
                ((value - self.diagonal[i]) * here - coupling_below * below) / self.beside[i - 1];
            (below, here) = (here, above);
            squares += above * above;
        }
        if squares.is_finite() {
            squares.sqrt().recip()
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Backend;
    use ndarray::{Array2, ShapeBuilder};
    use ndarray_rand::RandomExt;
    use ndarray_rand::rand_distr::StandardNormal;

    fn largest(lower: &Array2<f64>) -> Option<f64> {
        largest_eigenvalue(&Symmetric::of_lower(lower))
    }

    #[test]
    fn the_largest_eigenvalue_is_the_squared_singular_value() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (rows, columns) in [(1, 1), (5, 2), (60, 59), (300, 100), (120, 119)] {
            let a: Array2<f64> = Array2::random_using((rows, columns), StandardNormal, &mut rng);
            let found = largest(&f64::gram(a.view())).unwrap();
            let s = f64::singular_values(a.view()).unwrap()[0];
            approx::assert_relative_eq!(found, s * s, max_relative = 1e-10);
        }
        // All equal, and none at all.
        assert_eq!(largest(&Array2::<f64>::eye(200)), Some(1.0));
        assert_eq!(largest(&Array2::<f64>::zeros((9, 9).f())), None);
        // 1 and 1 - 1e-12 many times: nothing to tell apart, and either is right to 1e-10.
        for step in [1e-3, 1e-5, 1e-12] {
            let crowd = Array1::from_shape_fn(300, |i| 1.0 - i as f64 * step);
            let found = largest(&Array2::from_diag(&crowd)).unwrap();
            approx::assert_relative_eq!(found, 1.0, max_relative = 1e-10);
        }
    }

    #[test]
    fn two_that_nearly_agree_are_told_apart_as_far_as_it_matters() {
        for gap in [1e-2, 1e-4, 1e-6, 1e-8, 1e-11] {
            let spectrum = Array1::from_shape_fn(150, |i| match i {
                70 => 1.0,
                20 => 1.0 - gap,
                _ => 0.9_f64.powf((i + 1) as f64),
            });
            let found = largest(&Array2::from_diag(&spectrum)).unwrap();
            let bound = if gap < 1e-7 { 1e-8 } else { 1e-10 };
            approx::assert_relative_eq!(found, 1.0, max_relative = bound);
        }
    }
}
