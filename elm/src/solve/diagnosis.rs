//! What a solver reports beside the weights: rank, condition, route.

use ndarray::ArrayView2;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use super::norms::norm;
use crate::check::check_length;
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// How a solver came to its answer; [`Reason`] says why so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
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
    /// QR, then back substitution.
    Qr,
    /// Singular values from $H^T H$, whose condition, or the strength of ridge that was found, bounds the
    /// relative error that this leaves by 1e-8: for at least two rows to a neuron, which are made as they
    /// are needed.
    GramSvd,
}

/// Why a solver took its [`Route`]. Between the two forms of a route the shape of the matrix
/// decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Reason {
    /// Equation 10 is the solution of a square system.
    SquareSystem,
    /// The pseudo-inverse must tell which directions are there, which singular values do.
    RankDecision,
    /// All strengths are tried, and leave-one-out scored, in the coordinates of the singular
    /// vectors.
    #[cfg_attr(feature = "serde", serde(alias = "strength-search"))]
    LambdaSearch,
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
    /// The triangle of the QR factorization is far from losing a direction, so that the
    /// pseudo-inverse is the plain least-squares solution.
    FullRank,
}

/// The state of the problem that was solved, for the user to judge the answer by.
///
/// Singular values are those of the matrix that was factorized: the hidden-layer matrix with rows
/// weighted and, when there is an intercept, columns centered. Vectors have one entry per output.
/// What would overflow (the norm of residuals near the end of the range) is the largest number.
///
/// ```
/// use elm::ElmParams;
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let t = x.mapv(|x: f64| x.sin() + 0.1 * (37.0 * x).sin());
/// let model = ElmParams::new(50).fit(&x, &t)?;
/// let diagnosis = model.diagnosis();
/// // One input and smooth neurons: few of the 50 directions carry anything.
/// assert!(diagnosis.degrees_of_freedom[0] < 25.0);
/// let Some(error) = &diagnosis.leave_one_out else { panic!("ridge by leave-one-out knows it") };
/// assert!((0.05..0.1).contains(&error[0]));
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub struct Diagnosis {
    /// The way the answer was computed.
    pub route: Route,
    /// Why it was computed that way.
    pub reason: Reason,
    /// Number of singular values above the cut-off (for ridge: above rounding error); `None` on
    /// the routes that do not find them, [`Route::Gram`] and [`Route::DualGram`], and on
    /// [`Route::GramSvd`] where the strength of ridge made up for the condition.
    pub rank: Option<usize>,
    /// Largest over smallest singular value counted in [`rank`](Self::rank), 1 at rank 0; `None`
    /// with it.
    pub condition: Option<f64>,
    /// The largest singular value; 0 where nothing was factorized.
    pub largest_singular_value: f64,
    /// The smallest singular value counted in [`rank`](Self::rank); `None` with it.
    pub smallest_singular_value: Option<f64>,
    /// The regularization relative to the largest squared singular value; 0 without one.
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
        let mut diagnosis = Self {
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
        };
        diagnosis.saturate();
        diagnosis
    }

    /// A norm or a ratio beyond the range becomes the largest number: infinity has no place in a
    /// JSON file.
    pub(super) fn saturate(&mut self) {
        for number in self.numbers_mut() {
            if *number == f64::INFINITY {
                *number = f64::MAX;
            }
        }
    }

    /// Whether a diagnosis from outside has finite numbers, as many as there are outputs.
    pub(crate) fn check(&mut self, outputs: usize) -> Result<()> {
        let vectors = [
            Some(&self.lambda),
            Some(&self.degrees_of_freedom),
            Some(&self.residual_norm),
            Some(&self.beta_norm),
            self.leave_one_out.as_ref(),
        ];
        for vector in vectors.into_iter().flatten() {
            check_length("outputs of the diagnosis", vector.len(), outputs)?;
        }
        if self.numbers_mut().all(|number| number.is_finite()) {
            return Ok(());
        }
        Err(Error::Overflow {
            what: "a number of the diagnosis",
        })
    }

    fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        let vectors = [
            Some(&mut self.lambda),
            Some(&mut self.degrees_of_freedom),
            Some(&mut self.residual_norm),
            Some(&mut self.beta_norm),
            self.leave_one_out.as_mut(),
        ];
        self.condition
            .iter_mut()
            .chain([&mut self.largest_singular_value])
            .chain(&mut self.smallest_singular_value)
            .chain(vectors.into_iter().flatten().flatten())
    }
}
