//! Ridge of a given strength by Cholesky, where the strength keeps the equations well conditioned.
//!
//! Forming $\tilde H^T \tilde H$ squares the condition number, which is why normal equations are
//! not used elsewhere in this crate. With $\lambda s_1^2$ on the diagonal it is at most
//! $1 + 1 / \lambda$, so that output weights have relative errors of about $\epsilon / \lambda$
//! (Higham, Accuracy and Stability of Numerical Algorithms, 2002, ch. 10 and 20), for half the
//! arithmetic of QR and a small part of its memory traffic. A matrix with fewer rows than neurons
//! is answered from $\tilde H \tilde H^T$ (the dual form), $\beta = \tilde H^T (\tilde H \tilde H^T
//! + \lambda s_1^2 I)^{-1} \tilde T$.

use ndarray::{Array1, Array2, Axis};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Solution;
use super::diagnosis::{Diagnosis, Reason, Route};
use super::frame::{Frame, Prepared};
use super::spectrum::norm;
use crate::linalg::Positive;
use crate::scalar::Scalar;

/// Whether this strength allows the route: errors of about $\epsilon / \lambda$ must stay below
/// 1e-8 in `f64` and 1e-3 in `f32`.
pub(super) fn allowed<A: Scalar>(lambda: f64) -> bool {
    let epsilon = A::epsilon().as_f64();
    let accuracy = if epsilon < 1e-10 { 1e-8 } else { 1e-3 };
    // The upper bound keeps the diagonal far from overflow in either type.
    lambda * accuracy >= epsilon && lambda <= 1e6
}

/// The ridge solution, or nothing where the matrix turns out to be beyond this route (all zeros).
pub(super) fn solve<A: Scalar>(prepared: &Prepared<A>, lambda: f64) -> Option<Solution<A>> {
    let Prepared {
        hidden,
        targets,
        frame,
    } = prepared;
    let dual = hidden.nrows() < hidden.ncols();
    let mut gram = if dual {
        A::gram(hidden.t())
    } else {
        A::gram(hidden.view())
    };
    let largest = largest_eigenvalue(&gram)?;
    let absolute = A::from_f64(lambda) * largest;
    let mut diagonal = gram.diag_mut();
    diagonal += absolute;
    let (beta, residual, inverse_trace) = if dual {
        let Positive { x, inverse_trace } = A::solve_positive(gram.view(), targets.view()).ok()?;
        let beta = A::product(hidden.t(), x.view());
        // T - (K + l - l) x.
        (beta, x * absolute, inverse_trace)
    } else {
        let right = A::product(hidden.t(), targets.view());
        let Positive { x, inverse_trace } = A::solve_positive(gram.view(), right.view()).ok()?;
        let residual = targets - &A::product(hidden.view(), x.view());
        (x, residual, inverse_trace)
    };
    // The trace of G (G + l)^-1.
    let kept = gram.nrows() as f64 - (absolute * inverse_trace).as_f64();
    let route = if dual { Route::DualGram } else { Route::Gram };
    Some(finish(
        frame,
        beta,
        &residual,
        route,
        lambda,
        largest.sqrt(),
        kept,
    ))
}

fn finish<A: Scalar>(
    frame: &Frame<A>,
    beta: Array2<A>,
    residual: &Array2<A>,
    route: Route,
    lambda: f64,
    largest: A,
    kept: f64,
) -> Solution<A> {
    let outputs = beta.ncols();
    let beta = frame.restore(beta);
    let intercept = frame.constant(&beta);
    let constant = f64::from(u8::from(frame.intercept));
    let diagnosis = Diagnosis {
        route,
        reason: Reason::StrongRidge,
        rank: None,
        condition: None,
        largest_singular_value: frame.outer_singular_value(largest),
        smallest_singular_value: None,
        lambda: vec![lambda; outputs],
        degrees_of_freedom: vec![kept.max(0.0) + constant; outputs],
        residual_norm: frame.outer_residual_norms(residual.columns().into_iter().map(norm)),
        beta_norm: beta.columns().into_iter().map(norm).collect(),
        leave_one_out: None,
    };
    Solution {
        beta,
        intercept,
        diagnosis,
    }
}

/// The largest eigenvalue of a symmetric matrix without negative ones, to 1e-10 of itself (32
/// epsilon in `f32`), by Lanczos iteration with full reorthogonalisation; `None` for a zero
/// matrix.
///
/// An eigenvalue lies within the residual of the Ritz value (Parlett, The Symmetric Eigenvalue
/// Problem, 1998, ch. 4 and 13); a random start makes it the largest.
fn largest_eigenvalue<A: Scalar>(matrix: &Array2<A>) -> Option<A> {
    const STEPS: usize = 80;
    let n = matrix.nrows();
    let tolerance = A::from_f64(1e-10).max(A::from_f64(32.0) * A::epsilon());
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let start = Array1::from_shape_simple_fn(n, || A::from_f64(rng.random_range(-1.0..1.0)));
    let mut basis = Array2::<A>::zeros((STEPS.min(n), n));
    // The tridiagonal projection of the matrix onto the basis.
    let mut small = Array2::<A>::zeros((STEPS.min(n), STEPS.min(n)));
    let mut next = &start / start.dot(&start).sqrt();
    for step in 0..STEPS.min(n) {
        basis.row_mut(step).assign(&next);
        next = A::product(matrix.view(), next.view().insert_axis(Axis(1))).remove_axis(Axis(1));
        small[[step, step]] = basis.row(step).dot(&next);
        let known = basis.slice(ndarray::s![..=step, ..]);
        for _ in 0..2 {
            let shares = known.dot(&next);
            next -= &shares.dot(&known);
        }
        let rest = next.dot(&next).sqrt();
        let last = step + 1 == STEPS.min(n);
        if step % 4 == 3 || last || rest == A::zero() {
            let projected = small.slice(ndarray::s![..=step, ..=step]);
            let svd = A::svd(projected).ok()?;
            let (value, share) = (svd.s[0], svd.vt[[0, step]].abs());
            if value == A::zero() {
                return None;
            }
            if rest * share <= tolerance * value {
                return Some(value);
            }
        }
        if !last {
            small[[step, step + 1]] = rest;
            small[[step + 1, step]] = rest;
            next /= rest;
        }
    }
    // Many eigenvalues crowd at the top: all of them, then.
    let all = A::singular_values(matrix.view()).ok()?;
    (all[0] > A::zero()).then_some(all[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Kernel;
    use ndarray_rand::RandomExt;
    use ndarray_rand::rand_distr::StandardNormal;

    #[test]
    fn the_largest_eigenvalue_is_the_squared_singular_value() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (rows, columns) in [(1, 1), (5, 2), (60, 59), (300, 100), (120, 119)] {
            let a: Array2<f64> = Array2::random_using((rows, columns), StandardNormal, &mut rng);
            let found = largest_eigenvalue(&f64::gram(a.view())).unwrap();
            let s = f64::singular_values(a.view()).unwrap()[0];
            approx::assert_relative_eq!(found, s * s, max_relative = 1e-10);
        }
        // All equal, and none at all.
        assert_eq!(largest_eigenvalue(&Array2::<f64>::eye(200)), Some(1.0));
        assert_eq!(largest_eigenvalue(&Array2::<f64>::zeros((9, 9))), None);
        // 1 and 1 - 1e-12 many times: nothing to tell apart, and either is right to 1e-10.
        let crowd = Array1::from_shape_fn(300, |i| 1.0 - i as f64 * 1e-3);
        let found = largest_eigenvalue(&Array2::from_diag(&crowd)).unwrap();
        approx::assert_relative_eq!(found, 1.0, max_relative = 1e-10);
    }
}
