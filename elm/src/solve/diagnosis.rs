//! What a solver reports beside the weights.

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use super::spectrum::norm;
use crate::scalar::Scalar;

/// How a solver came to its answer; [`Reason`] says why so.
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
    /// Cholesky of $H^T H$ with ridge's $\lambda$ on the diagonal.
    Gram,
    /// Cholesky of $H H^T$ with ridge's $\lambda$ on the diagonal, for fewer rows than neurons.
    DualGram,
    /// None: the weights were given.
    Given,
}

/// Why a solver took its [`Route`]. Between the two forms of a route the shape of the matrix
/// decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Reason {
    /// Equation 10 is the solution of a square system.
    SquareSystem,
    /// The pseudo-inverse must tell which directions are there, which singular values do.
    RankDecision,
    /// All strengths are tried, and leave-one-out scored, in the coordinates of the singular
    /// vectors.
    StrengthSearch,
    /// The given strength bounds the condition of the normal equations: weights have relative
    /// errors below 1e-8 (`f64`) or 1e-3 (`f32`) by the fast route.
    StrongRidge,
    /// The given strength is too weak (or far too strong) for the normal equations, or the matrix
    /// is zero.
    WeakRidge,
    /// It is the mean of several networks, each with an answer of its own.
    Mean,
    /// Nothing was solved: the weights come from elsewhere.
    GivenWeights,
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
    /// Why it was computed that way.
    pub reason: Reason,
    /// Number of singular values above the cut-off (for ridge: above rounding error); `None` on
    /// the routes that do not find them, [`Route::Gram`] and [`Route::DualGram`].
    pub rank: Option<usize>,
    /// Largest over smallest singular value counted in [`rank`](Self::rank), 1 at rank 0; `None`
    /// with it.
    pub condition: Option<f64>,
    /// The largest singular value; 0 where nothing was factorised.
    pub largest_singular_value: f64,
    /// The smallest singular value counted in [`rank`](Self::rank); `None` with it.
    pub smallest_singular_value: Option<f64>,
    /// The regularisation relative to the largest squared singular value; 0 without one.
    pub lambda: Vec<f64>,
    /// Effective degrees of freedom, the trace of the matrix that maps targets to fitted values.
    pub degrees_of_freedom: Vec<f64>,
    /// Euclidean norm of the (weighted) residual.
    pub residual_norm: Vec<f64>,
    /// Euclidean norm of the output weights.
    pub beta_norm: Vec<f64>,
    /// Leave-one-out root mean squared error, where the solver computed it; with what rounding is
    /// expected to add to it (see [`Ridge`](crate::solve::Ridge)).
    pub leave_one_out: Option<Vec<f64>>,
}

impl Diagnosis {
    /// Of output weights that were given, not solved for.
    pub(crate) fn of_given<A: Scalar>(beta: ArrayView2<'_, A>) -> Self {
        let outputs = beta.ncols();
        Self {
            route: Route::Given,
            reason: Reason::GivenWeights,
            rank: None,
            condition: None,
            largest_singular_value: 0.0,
            smallest_singular_value: None,
            lambda: vec![0.0; outputs],
            degrees_of_freedom: vec![0.0; outputs],
            residual_norm: vec![0.0; outputs],
            beta_norm: beta.columns().into_iter().map(norm).collect(),
            leave_one_out: None,
        }
    }
}
