//! Ridge of a given strength by Cholesky, where the strength keeps the equations well conditioned.
//!
//! Forming $\tilde H^T \tilde H$ squares the condition number, which is why normal equations are
//! not used elsewhere in this crate. With $\lambda s_1^2$ on the diagonal it is at most
//! $1 + 1 / \lambda$, so that output weights have relative errors of about $\epsilon / \lambda$
//! (Higham, Accuracy and Stability of Numerical Algorithms, 2002, ch. 10 and 20), for half the
//! arithmetic of QR and a small part of its memory traffic. A matrix with fewer rows than neurons
//! is answered from $\tilde H \tilde H^T$ (the dual form):
//! $\beta = \tilde H^T (\tilde H \tilde H^T + \lambda s_1^2 I)^{-1} \tilde T$. With at least as
//! many rows as neurons the matrix itself is not needed: [`NormalEquations`] adds up its products
//! tile by tile.

use ndarray::{Array1, Array2};

use super::Solution;
use super::diagnosis::{Diagnosis, Reason, Route};
use super::equilibration::{EquilibratedProblem, Equilibration};
use super::lambda_grid::FLAT;
use super::lanczos::largest_eigenvalue;
use super::normal_equations::{NormalEquations, RowSource};
use super::norms::norm;
use super::symmetric::Symmetric;
use crate::error::Result;
use crate::linalg::{Backend, CholeskySolve};
use crate::scalar::Scalar;

/// The least share of the targets' squares that must be left where a residual is a difference of sums.
pub(super) const UNEXPLAINED: f64 = 1e-6;

/// The relative error that output weights may have by this route.
fn accuracy<A: Scalar>() -> f64 {
    if A::epsilon().as_f64() < 1e-10 {
        1e-8
    } else {
        1e-3
    }
}

/// Whether this strength allows the route: errors of about $\epsilon / \lambda$ must stay below
/// 1e-8 in `f64` and 1e-3 in `f32`.
pub(super) fn allowed<A: Scalar>(lambda: f64) -> bool {
    // The upper bound keeps the diagonal far from overflow in either type.
    lambda * accuracy::<A>() >= A::epsilon().as_f64() && lambda <= 1e6
}

/// The weakest strength that is [`allowed`] in `f64`.
pub(super) fn weakest() -> f64 {
    f64::EPSILON / accuracy::<f64>()
}

/// The weakest strength that a search by sums of products chooses where this share of the targets' squares is
/// left: residuals are off by $\epsilon / \lambda$ of the targets, which is to be a ten thousandth of them at
/// most. From 1e-10 on one step of refinement makes output weights as accurate as this route's.
pub(super) fn weakest_searched(share: f64) -> f64 {
    (1e4 * f64::EPSILON / share.sqrt()).max(SEARCHED)
}

const SEARCHED: f64 = 1e-10;

/// Sums of products of centered rows.
pub(super) struct Sums {
    /// $H^T H$, the lower half.
    pub(super) products: Array2<f64>,
    /// $H^T T$.
    pub(super) right: Array2<f64>,
    /// $\lVert T \rVert^2$ of each output.
    pub(super) squares: Array1<f64>,
    pub(super) rows: f64,
}

/// Whether generalized cross-validation calls for a strength that a search may choose, for every output, as
/// far as these sums tell: whether its score does not fall from ten times the weakest such strength to that
/// one.
pub(super) fn holds_back(sums: &Sums) -> bool {
    let Sums {
        products,
        right,
        squares,
        rows,
    } = sums;
    let neurons = products.ncols() as f64;
    let gram = Symmetric::of_lower(products);
    let Some(largest) = largest_eigenvalue(&gram) else {
        return false;
    };
    let score = |lambda: f64| -> Option<Array1<f64>> {
        let mut shifted = products.clone();
        let mut diagonal = shifted.diag_mut();
        diagonal += lambda * largest;
        let CholeskySolve { x, inverse_trace } =
            f64::solve_positive(shifted.view(), right.view()).ok()?;
        let free = rows - neurons + lambda * largest * inverse_trace;
        let left = residual_squares(&gram, right, squares, &x);
        // Small differences of large numbers have no digits.
        let known = left
            .iter()
            .zip(squares)
            .all(|(left, all)| *left > UNEXPLAINED * all);
        known.then(|| left / (free * free))
    };
    let (Some(weak), Some(stronger)) = (score(SEARCHED), score(10.0 * SEARCHED)) else {
        return false;
    };
    weak.iter()
        .zip(&stronger)
        .all(|(weak, stronger)| *weak * (1.0 + FLAT) > *stronger)
}

/// $\lVert T - H x \rVert^2$ of each output from $H^T H$, $H^T T$ and $\lVert T \rVert^2$.
fn residual_squares<A: Scalar>(
    gram: &Symmetric<A>,
    right: &Array2<A>,
    squares: &Array1<A>,
    x: &Array2<A>,
) -> Array1<A> {
    let left = |output: usize| {
        let (beta, right) = (x.column(output).to_owned(), right.column(output));
        let fitted = gram.product(&beta);
        squares[output] - beta.dot(&(&right * A::from_f64(2.0) - fitted))
    };
    (0..x.ncols()).map(left).collect()
}

/// The ridge solution of a problem with at least as many rows as neurons, whose hidden-layer
/// matrix need never be there as a whole; or nothing where its numbers are beyond this route: out
/// of range, all zeros, or with means so far from those of some rows that centering would cost digits.
///
/// # Errors
/// Those of making the rows.
pub(super) fn solve_rows<A: Scalar>(
    source: &RowSource<'_, A>,
    lambda: f64,
) -> Result<Option<Solution<A>>> {
    if source.rows() < source.neurons() {
        return Ok(None);
    }
    let moments = NormalEquations::gather(source)?;
    solve_moments(&moments, lambda, Some(source))
}

/// The same from sums of products. Residuals that are small differences of these are taken from the rows,
/// where they are still there.
///
/// # Errors
/// Those of making the rows.
pub(crate) fn solve_moments<A: Scalar>(
    moments: &NormalEquations<A>,
    lambda: f64,
    source: Option<&RowSource<'_, A>>,
) -> Result<Option<Solution<A>>> {
    if !moments.in_range() {
        return Ok(None);
    }
    let gram = Symmetric::of_lower(&moments.gram);
    let Some(largest) = largest_eigenvalue(&gram) else {
        return Ok(None);
    };
    // With the correction c, errors are about epsilon (1 + c / s_1^2) / lambda.
    let reserve = lambda * accuracy::<A>() / A::epsilon().as_f64() - 1.0;
    if moments.correction > largest * A::from_f64(reserve.clamp(0.0, 1.0)) {
        return Ok(None);
    }
    let absolute = A::from_f64(lambda) * largest;
    let mut shifted = moments.gram.clone();
    let mut diagonal = shifted.diag_mut();
    diagonal += absolute;
    let Ok(solved) = A::solve_positive(shifted.view(), moments.right.view()) else {
        return Ok(None);
    };
    let CholeskySolve { x, inverse_trace } = solved;
    // |t - H b|^2 from the sums, where it is not a small difference of large numbers.
    let mut squares = residual_squares(&gram, &moments.right, &moments.squares, &x);
    let trusted = A::from_f64(100.0) * A::epsilon().sqrt();
    let small = |(&square, &whole): (&A, &A)| square < trusted * whole || whole == A::zero();
    if squares.iter().zip(&moments.squares).any(small) {
        match source {
            Some(source) => squares = moments.residual_squares(source, &x)?,
            None => squares.mapv_inplace(|square| square.max(A::zero())),
        }
    }
    let norms = squares.iter().map(|s| s.as_f64().sqrt());
    let kept = moments.gram.ncols() as f64 - (absolute * inverse_trace).as_f64();
    let found = Found {
        beta: x,
        route: Route::Gram,
        lambda,
        largest: largest.sqrt(),
        kept,
    };
    Ok(Some(found.solution(&moments.frame, norms)))
}

/// The ridge solution, or nothing where the matrix turns out to be beyond this route (all zeros).
pub(super) fn solve<A: Scalar>(
    prepared: &EquilibratedProblem<A>,
    lambda: f64,
) -> Option<Solution<A>> {
    let EquilibratedProblem {
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
    let largest = largest_eigenvalue(&Symmetric::of_lower(&gram))?;
    let absolute = A::from_f64(lambda) * largest;
    let mut diagonal = gram.diag_mut();
    diagonal += absolute;
    let (beta, residual, inverse_trace) = if dual {
        let CholeskySolve { x, inverse_trace } =
            A::solve_positive(gram.view(), targets.view()).ok()?;
        let beta = A::product(hidden.t(), x.view());
        // T - (K + l - l) x.
        (beta, x * absolute, inverse_trace)
    } else {
        let right = A::product(hidden.t(), targets.view());
        let CholeskySolve { x, inverse_trace } =
            A::solve_positive(gram.view(), right.view()).ok()?;
        let residual = targets - &A::product(hidden.view(), x.view());
        (x, residual, inverse_trace)
    };
    let found = Found {
        beta,
        route: if dual { Route::DualGram } else { Route::Gram },
        lambda,
        largest: largest.sqrt(),
        // The trace of G (G + l)^-1.
        kept: gram.nrows() as f64 - (absolute * inverse_trace).as_f64(),
    };
    Some(found.solution(frame, residual.columns().into_iter().map(norm)))
}

/// What either form of the route finds, of the scaled problem.
struct Found<A: Scalar> {
    beta: Array2<A>,
    route: Route,
    lambda: f64,
    /// The largest singular value.
    largest: A,
    /// Degrees of freedom without the intercept.
    kept: f64,
}

impl<A: Scalar> Found<A> {
    /// In the problem's own units; `norms` are those of the residuals.
    fn solution(self, frame: &Equilibration<A>, norms: impl Iterator<Item = f64>) -> Solution<A> {
        let outputs = self.beta.ncols();
        let beta = frame.unscale(self.beta);
        let intercept = frame.constant(&beta);
        let constant = f64::from(u8::from(frame.intercept));
        let diagnosis = Diagnosis {
            route: self.route,
            reason: Reason::StrongRidge,
            rank: None,
            condition: None,
            largest_singular_value: frame.singular_value_in_original_units(self.largest),
            smallest_singular_value: None,
            lambda: vec![self.lambda; outputs],
            degrees_of_freedom: vec![self.kept.max(0.0) + constant; outputs],
            residual_norm: frame.residual_norms_in_original_units(norms),
            beta_norm: beta.columns().into_iter().map(norm).collect(),
            leave_one_out: None,
        };
        Solution {
            beta,
            intercept,
            diagnosis,
        }
    }
}
