//! Equation 11: $\beta = H^{+} T$ with the Moore-Penrose generalised inverse.

use ndarray::{Array2, Axis};
use serde::{Deserialize, Serialize};

use super::spectrum::Spectrum;
use super::{LeastSquares, Reason, Solution};
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// The least-squares solution of minimum norm, by singular values.
///
/// Directions whose singular value is at most `cutoff` times the largest are left out. Without a
/// cut-off of one's own only those at the level of rounding error are, which is the paper's plain
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
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PseudoInverse {
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

    pub(super) fn solve<A: Scalar>(self, problem: &LeastSquares<'_, A>) -> Result<Solution<A>> {
        Ok(self.solve_spectrum(&Spectrum::new(problem)?))
    }

    pub(super) fn solve_spectrum<A: Scalar>(self, spectrum: &Spectrum<A>) -> Solution<A> {
        let level = spectrum.level();
        let cutoff = self
            .cutoff
            .map_or(level, |cutoff| A::from_f64(cutoff).max(level));
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
}
