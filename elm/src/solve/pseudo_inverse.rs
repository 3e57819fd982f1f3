//! Equation 11: $\beta = H^{+} T$ with the Moore-Penrose generalized inverse.

use ndarray::{Array2, Axis};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use super::design_svd::DesignSvd;
use super::equilibration::{EquilibratedProblem, Equilibration};
use super::lanczos::largest_eigenvalue;
use super::normal_equations::RowSource;
use super::norms::{norm, rounding};
use super::symmetric::Symmetric;
use super::tiles::{Threshold, Tiles};
use super::{Diagnosis, LeastSquares, Reason, Route, Solution};
use crate::error::{Error, Result};
use crate::linalg::QrFactor;
use crate::scalar::Scalar;

/// The least-squares solution of minimum norm.
///
/// By QR where the matrix clearly has full rank; else by singular values, at several times the
/// cost.
///
/// Directions whose singular value is at most `cutoff` times the largest are dropped. By default
/// only those at the level of rounding error are, which is the paper's plain
/// pseudo-inverse: it amplifies whatever noise the smallest kept directions carry, so prefer
/// [`Ridge`](super::Ridge) unless equation 11 itself is wanted.
///
/// ```
/// use elm::solve::{LeastSquares, PseudoInverse, Solver};
/// use ndarray::array;
///
/// // Two neurons that are the same: the answer of least norm shares the weight between them.
/// let (h, t) = (array![[1.0, 1.0], [2.0, 2.0]], array![[2.0], [4.0]]);
/// let solver = Solver::from(PseudoInverse::default());
/// let solution = solver.solve(&LeastSquares::new(&h, &t)?)?;
/// assert_eq!(solution.diagnosis.rank, Some(1));
/// assert!(solution.beta.iter().all(|beta: &f64| (beta - 1.0).abs() < 1e-12));
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct PseudoInverse {
    #[cfg_attr(
        feature = "serde",
        serde(serialize_with = "crate::numbers::finite_if_any")
    )]
    cutoff: Option<f64>,
}

impl PseudoInverse {
    /// With a cut-off relative to the largest singular value, in $[0, 1)$. One below the rounding
    /// level of the matrix (about $4 \epsilon \sqrt{\max(\text{rows}, \text{neurons})}$) has the
    /// effect of that level.
    #[must_use]
    pub fn with_cutoff(cutoff: f64) -> Self {
        Self {
            cutoff: Some(cutoff),
        }
    }

    /// The cut-off, where one was set.
    #[must_use]
    pub fn cutoff(&self) -> Option<f64> {
        self.cutoff
    }

    pub(super) fn check(&self) -> Result<()> {
        match self.cutoff {
            Some(value) if !(0.0..1.0).contains(&value) => Err(Error::Parameter {
                name: "cutoff",
                value,
                expected: "at least 0 and below 1",
            }),
            _ => Ok(()),
        }
    }

    /// The answer from the whole matrix.
    pub(super) fn solve_matrix<A: Scalar>(
        self,
        problem: &LeastSquares<'_, A>,
    ) -> Result<Solution<A>> {
        let prepared = EquilibratedProblem::new(problem);
        let (hidden, targets) = (prepared.hidden.view(), prepared.targets.view());
        if hidden.nrows() < hidden.ncols() {
            return Ok(self.solve_spectrum(&DesignSvd::from_prepared(prepared)?));
        }
        let triangle = A::triangularize(hidden, targets)?;
        if let Some(solution) = self.solve_triangle(&triangle, &prepared.frame) {
            return Ok(solution);
        }
        let spectrum = if DesignSvd::<A>::goes_by_triangle(hidden) {
            DesignSvd::of_triangle(triangle, prepared.frame)
        } else {
            DesignSvd::from_prepared(prepared)
        };
        Ok(self.solve_spectrum(&spectrum?))
    }

    /// The answer from rows that need not stand in memory together, where they are many more than
    /// the neurons.
    pub(super) fn solve_rows<A: Scalar>(
        self,
        source: &RowSource<'_, A>,
    ) -> Result<Option<Solution<A>>> {
        if !Threshold::TRIANGLE.is_met(source.rows(), source.neurons()) {
            return Ok(None);
        }
        let Some(mut tiles) = Tiles::new(source, Threshold::TRIANGLE)? else {
            return Ok(None);
        };
        let Some((triangle, frame)) = tiles.centered_triangle()? else {
            return Ok(None);
        };
        self.solve_centered(triangle.narrow(), frame.narrow())
            .map(Some)
    }

    /// The answer for a problem of many more rows than neurons that is reduced to its triangle.
    pub(super) fn solve_centered<A: Scalar>(
        self,
        triangle: QrFactor<A>,
        frame: Equilibration<A>,
    ) -> Result<Solution<A>> {
        if let Some(solution) = self.solve_triangle(&triangle, &frame) {
            return Ok(solution);
        }
        Ok(self.solve_spectrum(&DesignSvd::of_triangle(triangle, frame)?))
    }

    pub(super) fn solve_spectrum<A: Scalar>(self, spectrum: &DesignSvd<A>) -> Solution<A> {
        let cutoff = self.effective_cutoff(spectrum.level());
        let rank = spectrum.rank(cutoff);
        let gain = Array2::from_shape_fn((spectrum.s.len(), 1), |(j, _)| {
            if j < rank {
                A::one() / spectrum.s[j]
            } else {
                A::zero()
            }
        });
        let lambda = vec![0.0; spectrum.c.len_of(Axis(1))];
        spectrum.solution(&gain, cutoff, Reason::RankDecision, lambda, None)
    }

    fn effective_cutoff<A: Scalar>(self, level: A) -> A {
        self.cutoff
            .map_or(level, |cutoff| A::from_f64(cutoff).max(level))
    }

    /// The plain least-squares solution, where every direction is well above the cut-off.
    fn solve_triangle<A: Scalar>(
        self,
        triangle: &QrFactor<A>,
        frame: &Equilibration<A>,
    ) -> Option<Solution<A>> {
        // In a direction that is not there QR can leave several times the level of rounding, which
        // is what singular values of the matrix itself are off by.
        const CLEAR: f64 = 100.0;
        let r = triangle.r.view();
        let neurons = r.ncols();
        let inverse = A::solve_upper(r, Array2::eye(neurons).view()).ok()?;
        if !inverse.iter().all(|value| value.is_finite()) {
            return None;
        }
        let norm_of = |gram| largest_eigenvalue(&Symmetric::of_lower(&gram)).map(A::sqrt);
        let largest = norm_of(A::gram(r))?;
        let smallest = norm_of(A::gram(inverse.t()))?.recip();
        let level = A::from_f64(CLEAR) * rounding(frame.weighted_rows, neurons);
        let cutoff = A::from_f64(2.0) * self.effective_cutoff(A::zero());
        if smallest <= level.max(cutoff) * largest {
            return None;
        }
        let beta = frame.unscale(A::solve_upper(r, triangle.qtb.view()).ok()?);
        let outputs = beta.ncols();
        let spanned = frame.spanned_by(neurons);
        let residual = |&squares: &A| {
            if spanned {
                0.0
            } else {
                squares.as_f64().sqrt()
            }
        };
        let freedom = neurons as f64 + f64::from(u8::from(frame.intercept));
        let diagnosis = Diagnosis {
            route: Route::Qr,
            reason: Reason::FullRank,
            rank: Some(neurons),
            condition: Some((largest / smallest).as_f64()),
            largest_singular_value: frame.singular_value_in_original_units(largest),
            smallest_singular_value: Some(frame.singular_value_in_original_units(smallest)),
            lambda: vec![0.0; outputs],
            degrees_of_freedom: vec![freedom; outputs],
            residual_norm: frame
                .residual_norms_in_original_units(triangle.residual_ss.iter().map(residual)),
            beta_norm: beta.columns().into_iter().map(norm).collect(),
            leave_one_out: None,
        };
        Some(Solution {
            intercept: frame.constant(&beta),
            beta,
            diagnosis,
        })
    }
}
