//! Equation 10: $\beta = H^{-1} T$ for square $H$.

use ndarray::Array1;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use super::equilibration::EquilibratedProblem;
use super::norms::{norm, rounding};
use super::{Diagnosis, LeastSquares, Reason, Route, Solution};
use crate::error::{Error, Result};
use crate::linalg::Failure;
use crate::scalar::Scalar;

/// Solves $H\beta = T$ exactly by LU with partial pivoting. Needs as many neurons as rows, and
/// takes neither an intercept (there would be more unknowns than equations) nor row weights (an
/// exact answer leaves nothing to weigh).
///
/// The network passes through every training target, noise included; it exists to reproduce
/// equation 10. For square, well-conditioned $H$ it agrees with
/// [`PseudoInverse`](super::PseudoInverse).
///
/// ```
/// use elm::{ElmParams, solve::Inverse};
/// use ndarray::array;
///
/// let (x, t) = (array![[0.0], [1.0], [2.0]], array![1.0, -1.0, 1.0]);
/// let model = ElmParams::new(3).with_solver(Inverse).fit(&x, &t)?;
/// assert!((model.predict(&x)?[1] + 1.0_f64).abs() < 1e-9);
/// assert!(ElmParams::new(4).with_solver(Inverse).fit(&x, &t).is_err());
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Inverse;

impl Inverse {
    pub(super) fn solve<A: Scalar>(self, problem: &LeastSquares<'_, A>) -> Result<Solution<A>> {
        if problem.intercept {
            return Err(Error::Conflict {
                first: "the solver 'inverse'",
                second: "an intercept",
            });
        }
        if problem.weights.is_some() {
            return Err(Error::Conflict {
                first: "the solver 'inverse'",
                second: "row weights",
            });
        }
        let (rows, neurons) = problem.hidden.dim();
        if rows != neurons {
            return Err(Error::NotSquare { rows, neurons });
        }
        // Scaled by powers of two, so that squares inside the factorizations stay in range.
        let EquilibratedProblem {
            hidden,
            targets,
            frame,
        } = EquilibratedProblem::new(problem);
        let s = A::singular_values(hidden.view())?;
        let (largest, smallest) = (s[0], s[s.len() - 1]);
        let singular = |reciprocal_condition| Error::Singular {
            reciprocal_condition,
        };
        if smallest <= rounding::<A>(rows, neurons) * largest {
            let ratio = if largest > A::zero() {
                smallest / largest
            } else {
                A::zero()
            };
            return Err(singular(ratio.as_f64()));
        }
        let scaled = match A::solve_square(hidden.view(), targets.view()) {
            Ok(beta) => beta,
            Err(Failure::Pivot) => return Err(singular((smallest / largest).as_f64())),
            Err(failure) => return Err(failure.into()),
        };
        let outputs = problem.outputs();
        let residual = targets - A::product(hidden.view(), scaled.view());
        let beta = frame.unscale(scaled);
        let diagnosis = Diagnosis {
            route: Route::Lu,
            reason: Reason::SquareSystem,
            rank: Some(neurons),
            condition: Some((largest / smallest).as_f64()),
            largest_singular_value: frame.singular_value_in_original_units(largest),
            smallest_singular_value: Some(frame.singular_value_in_original_units(smallest)),
            lambda: vec![0.0; outputs],
            degrees_of_freedom: vec![neurons as f64; outputs],
            residual_norm: frame
                .residual_norms_in_original_units(residual.columns().into_iter().map(norm)),
            beta_norm: beta.columns().into_iter().map(norm).collect(),
            leave_one_out: None,
        };
        Ok(Solution {
            beta,
            intercept: Array1::zeros(outputs),
            diagnosis,
        })
    }
}
