//! What a solver reports beside the weights.

use serde::{Deserialize, Serialize};

/// How a solver came to its answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Route {
    /// LU with partial pivoting.
    Lu,
    /// Singular values of the hidden-layer matrix itself.
    Svd,
    /// QR, then the singular values of $R$: much cheaper where rows outnumber neurons.
    QrSvd,
}

/// The state of the problem that was solved, for the user to judge the answer by.
///
/// Singular values are those of the matrix that was factorised: the hidden-layer matrix with rows
/// weighted and, when there is an intercept, columns centred. Vectors have one entry per output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Diagnosis {
    /// The way the answer was computed.
    pub route: Route,
    /// Number of singular values above the cut-off (for ridge: above rounding error).
    pub rank: usize,
    /// Largest over smallest singular value counted in [`rank`](Self::rank); 1 at rank 0.
    pub condition: f64,
    /// The largest singular value.
    pub largest_singular_value: f64,
    /// The smallest singular value counted in [`rank`](Self::rank).
    pub smallest_singular_value: f64,
    /// The regularisation relative to the largest squared singular value; 0 without one.
    pub lambda: Vec<f64>,
    /// Effective degrees of freedom, the trace of the matrix that maps targets to fitted values.
    pub degrees_of_freedom: Vec<f64>,
    /// Euclidean norm of the (weighted) residual.
    pub residual_norm: Vec<f64>,
    /// Euclidean norm of the output weights.
    pub beta_norm: Vec<f64>,
    /// Leave-one-out root mean squared error, where the solver computed it.
    pub leave_one_out: Option<Vec<f64>>,
}
