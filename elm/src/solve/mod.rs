//! The one linear solve: output weights $\beta$ with $H\beta \approx T$ (equation 9).
//!
//! | solver | equation | for |
//! |---|---|---|
//! | [`Inverse`] | 10, $\beta = H^{-1}T$ | as many neurons as rows, the paper's special case |
//! | [`PseudoInverse`] | 11, $\beta = H^{+}T$ | the paper's general case: least squares, minimum norm |
//! | [`Ridge`] | $\beta = \arg\min \lVert H\beta - T\rVert^2 + \lambda\lVert\beta\rVert^2$ | everything else; the default |
//!
//! All take any number of outputs (columns of $T$) and answer them from one factorization. Each
//! returns a [`Diagnosis`] beside the weights. A [`LeastSquares`] problem can be solved without a
//! network around it:
//!
//! ```
//! use elm::solve::{LeastSquares, PseudoInverse, Solver};
//! use ndarray::array;
//!
//! let h = array![[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]];
//! let t = array![[1.0], [3.0], [5.0]];
//! let solution = Solver::from(PseudoInverse::default()).solve(&LeastSquares::new(&h, &t)?)?;
//! assert!((solution.beta[[0, 0]] - 1.0_f64).abs() < 1e-12);
//! assert!((solution.beta[[1, 0]] - 2.0_f64).abs() < 1e-12);
//! assert_eq!(solution.diagnosis.rank, Some(2));
//! # Ok::<(), elm::Error>(())
//! ```

pub(crate) mod beside;
mod cholesky;
mod close_rows;
pub(crate) mod design_svd;
mod diagnosis;
pub(crate) mod equilibration;
mod gcv;
mod gram;
mod inverse;
pub(crate) mod lambda_grid;
pub(crate) mod lanczos;
mod leave_one_out;
mod left_out_tiles;
mod many_rows;
#[cfg(feature = "serde")]
mod named;
pub(crate) mod normal_equations;
pub(crate) mod norms;
mod products;
mod pseudo_inverse;
pub(crate) mod ridge;
mod stack;
pub(crate) mod symmetric;
#[cfg(test)]
mod tests_tiles;
mod tiles;

use std::fmt;
use std::str::FromStr;

use ndarray::{Array1, Array2, ArrayRef1, ArrayRef2, ArrayView1, ArrayView2, Axis};
#[cfg(feature = "serde")]
use serde::Serialize;

use crate::check::{check_length, check_matrix, check_some_weight, present};
use crate::error::{Error, Result};
use crate::linalg::Failure;
use crate::scalar::Scalar;
use design_svd::DesignSvd;
use normal_equations::{HiddenRows, NormalEquations, RowSource};

pub use cholesky::Cholesky;
pub use diagnosis::{Diagnosis, Reason, Route};
pub use inverse::Inverse;
pub use pseudo_inverse::PseudoInverse;
pub use ridge::{Lambda, Ridge};

/// The problem $H\beta \approx T$: checked shapes, finite entries.
///
/// ```
/// use elm::solve::{LeastSquares, PseudoInverse, Solver};
/// use ndarray::array;
///
/// let (h, t) = (array![[0.0], [1.0], [2.0]], array![[5.0], [7.0], [100.0]]);
/// // The third row counts for nothing, and a line needs its constant.
/// let weights = array![1.0, 1.0, 0.0];
/// let problem = LeastSquares::new(&h, &t)?.with_weights(&weights)?.with_intercept(true);
/// let solution = Solver::from(PseudoInverse::default()).solve(&problem)?;
/// assert!((solution.beta[[0, 0]] - 2.0_f64).abs() < 1e-12);
/// assert!((solution.intercept[0] - 5.0_f64).abs() < 1e-12);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct LeastSquares<'a, A: Scalar> {
    hidden: ArrayView2<'a, A>,
    targets: ArrayView2<'a, A>,
    weights: Option<ArrayView1<'a, A>>,
    intercept: bool,
}

impl<'a, A: Scalar> LeastSquares<'a, A> {
    /// `hidden` has shape (rows, neurons), `targets` (rows, outputs).
    ///
    /// # Errors
    /// [`Error::Empty`] when either has no rows or no columns, [`Error::Shape`] when their rows
    /// differ, [`Error::NotFinite`] at the first NaN or infinity.
    pub fn new(hidden: &'a ArrayRef2<A>, targets: &'a ArrayRef2<A>) -> Result<Self> {
        Self::of_views(hidden.view(), targets.view())
    }

    pub(crate) fn of_views(hidden: ArrayView2<'a, A>, targets: ArrayView2<'a, A>) -> Result<Self> {
        check_matrix("hidden-layer matrix", hidden)?;
        check_matrix("targets", targets)?;
        check_length("rows of targets", targets.nrows(), hidden.nrows())?;
        Ok(Self {
            hidden,
            targets,
            weights: None,
            intercept: false,
        })
    }

    /// Weighs the squared residual of each row; by default all weights are 1. A row of weight 0 is no
    /// row.
    ///
    /// # Errors
    /// [`Error::Shape`] when there is not one weight per row, [`Error::Parameter`] when one is
    /// negative or not finite or when all are 0.
    #[doc(alias = "sample_weight")]
    pub fn with_weights(mut self, weights: &'a ArrayRef1<A>) -> Result<Self> {
        check_some_weight(weights.view(), self.hidden.nrows())?;
        self.weights = Some(weights.view());
        Ok(self)
    }

    /// Adds a constant to each output that no solver penalizes; off by default.
    #[must_use]
    #[doc(alias = "fit_intercept")]
    pub fn with_intercept(mut self, intercept: bool) -> Self {
        self.intercept = intercept;
        self
    }

    /// The weight of each row, where there are any.
    #[must_use]
    pub fn weights(&self) -> Option<ArrayView1<'a, A>> {
        self.weights
    }

    /// Whether each output has a constant that is not penalized.
    #[must_use]
    pub fn intercept(&self) -> bool {
        self.intercept
    }

    pub(crate) fn hidden(&self) -> ArrayView2<'a, A> {
        self.hidden
    }

    /// The problem as rows that could be made as they are needed.
    fn row_source(&self) -> RowSource<'a, A> {
        RowSource {
            hidden: HiddenRows::Matrix(self.hidden),
            targets: self.targets,
            weights: self.weights,
            intercept: self.intercept,
        }
    }

    pub(crate) fn targets(&self) -> ArrayView2<'a, A> {
        self.targets
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.hidden.nrows()
    }

    /// Number of columns of the hidden-layer matrix.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.hidden.ncols()
    }

    /// Number of columns of the targets.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.targets.ncols()
    }
}

/// What a solver found.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution<A: Scalar> {
    /// Output weights, shape (neurons, outputs).
    pub beta: Array2<A>,
    /// The constant added to each output; all 0 without an intercept.
    pub intercept: Array1<A>,
    /// What the solver saw on its way.
    pub diagnosis: Diagnosis,
}

impl Solution<f64> {
    /// Rounded to `A`.
    fn narrow<A: Scalar>(self) -> Solution<A> {
        Solution {
            beta: self.beta.mapv_into_any(A::from_f64),
            intercept: self.intercept.mapv_into_any(A::from_f64),
            diagnosis: self.diagnosis,
        }
    }
}

/// One of the solvers, with its settings.
///
/// ```
/// use elm::{ElmParams, solve::Solver};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let t = x.column(0).mapv(f64::sin);
/// for name in ["pseudo-inverse", "ridge"] {
///     let solver: Solver = name.parse()?;
///     let model = ElmParams::new(15).with_solver(solver).fit(&x, &t)?;
///     let error = elm::metrics::rmse(&model.predict(&x)?, &t)?;
///     assert!(error < 1e-3, "{name}: {error}");
/// }
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Solver {
    /// Equation 10.
    Inverse(Inverse),
    /// Equation 11.
    PseudoInverse(PseudoInverse),
    /// Regularized least squares.
    Ridge(Ridge),
}

impl Solver {
    /// The names of the solvers, as [`FromStr`] reads them.
    pub const NAMES: &'static str = "inverse, pseudo-inverse, ridge";

    /// Solves the problem.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a setting out of range; [`Error::NotSquare`],
    /// [`Error::Singular`] and [`Error::Conflict`] from [`Inverse`]; [`Error::Overflow`] when the
    /// answer does not fit the type; [`Error::NoConvergence`] from the factorization.
    pub fn solve<A: Scalar>(&self, problem: &LeastSquares<'_, A>) -> Result<Solution<A>> {
        self.solve_present(problem, |problem| {
            match self.solve_rows(&problem.row_source())? {
                Some(solution) => Ok(solution),
                None => self.solve_matrix(problem),
            }
        })
    }

    /// As [`solve`](Self::solve), for a problem of which [`solve_rows`](Self::solve_rows) has made nothing.
    pub(crate) fn solve_whole<A: Scalar>(
        &self,
        problem: &LeastSquares<'_, A>,
    ) -> Result<Solution<A>> {
        self.solve_present(problem, |problem| self.solve_matrix(problem))
    }

    /// Solves without the rows of weight 0.
    fn solve_present<A: Scalar>(
        &self,
        problem: &LeastSquares<'_, A>,
        solve: impl Fn(&LeastSquares<'_, A>) -> Result<Solution<A>>,
    ) -> Result<Solution<A>> {
        self.check()?;
        let Some(rows) = problem.weights.and_then(present) else {
            return solve(problem);
        };
        let hidden = problem.hidden.select(Axis(0), &rows);
        let targets = problem.targets.select(Axis(0), &rows);
        let weights = problem.weights.map(|w| w.select(Axis(0), &rows));
        solve(&LeastSquares {
            hidden: hidden.view(),
            targets: targets.view(),
            weights: weights.as_ref().map(|weights| weights.view()),
            intercept: problem.intercept,
        })
    }

    fn solve_matrix<A: Scalar>(&self, problem: &LeastSquares<'_, A>) -> Result<Solution<A>> {
        in_range(match self {
            Self::Inverse(solver) => solver.solve(problem),
            Self::PseudoInverse(solver) => solver.solve_matrix(problem),
            Self::Ridge(solver) => solver.solve_matrix(problem),
        }?)
    }

    /// Solves a problem whose hidden-layer matrix is made as it is needed, or nothing where that
    /// takes the matrix itself.
    pub(crate) fn solve_rows<A: Scalar>(
        &self,
        source: &RowSource<'_, A>,
    ) -> Result<Option<Solution<A>>> {
        match self {
            Self::Ridge(solver) => solver.solve_rows(source)?,
            Self::PseudoInverse(solver) => solver.solve_rows(source)?,
            Self::Inverse(_) => None,
        }
        .map(in_range)
        .transpose()
    }

    /// Solves a problem that is known only by its spectrum.
    pub(crate) fn solve_spectrum<A: Scalar>(&self, spectrum: &DesignSvd<A>) -> Result<Solution<A>> {
        self.check()?;
        in_range(match self {
            Self::Inverse(_) => {
                return Err(Error::Conflict {
                    first: "the solver 'inverse'",
                    second: "an accumulator",
                });
            }
            Self::PseudoInverse(solver) => solver.solve_spectrum(spectrum),
            Self::Ridge(solver) => solver.solve_spectrum(spectrum),
        })
    }

    /// Solves a problem that is known only by its sums of products, or nothing where these do not serve.
    pub(crate) fn solve_moments<A: Scalar>(
        &self,
        moments: &NormalEquations<A>,
    ) -> Result<Option<Solution<A>>> {
        let Some(lambda) = self.strength_for_products::<A>() else {
            return Ok(None);
        };
        let solution = gram::solve_moments(moments, lambda, None)?;
        solution.map(in_range).transpose()
    }

    /// The given strength of ridge, where it leaves sums of products their digits.
    pub(crate) fn strength_for_products<A: Scalar>(&self) -> Option<f64> {
        match self {
            Self::Ridge(ridge) => ridge.strength_for_products::<A>(),
            Self::Inverse(_) | Self::PseudoInverse(_) => None,
        }
    }

    /// The same, but choosing by generalized cross-validation where leave-one-out was to choose.
    pub(crate) fn without_rows(self) -> Self {
        match self {
            Self::Ridge(ridge) => Self::Ridge(ridge.without_rows()),
            other => other,
        }
    }

    /// Whether the settings are in range.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first that is not.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Inverse(_) => Ok(()),
            Self::PseudoInverse(solver) => solver.check(),
            Self::Ridge(solver) => solver.check(),
        }
    }

    /// The solver's name: `inverse`, `pseudo-inverse` or `ridge`.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Inverse(_) => "inverse",
            Self::PseudoInverse(_) => "pseudo-inverse",
            Self::Ridge(_) => "ridge",
        }
    }
}

impl FromStr for Solver {
    type Err = Error;

    /// The solver of this name with its default settings.
    fn from_str(name: &str) -> Result<Self> {
        match name {
            "inverse" => Ok(Inverse.into()),
            "pseudo-inverse" => Ok(PseudoInverse::default().into()),
            "ridge" => Ok(Ridge::default().into()),
            _ => Err(Error::UnknownName {
                what: "solver",
                name: name.to_owned(),
                expected: Self::NAMES,
            }),
        }
    }
}

impl Default for Solver {
    /// Ridge, its strength chosen by leave-one-out.
    fn default() -> Self {
        Self::Ridge(Ridge::default())
    }
}

impl fmt::Display for Solver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl From<Inverse> for Solver {
    fn from(solver: Inverse) -> Self {
        Self::Inverse(solver)
    }
}

impl From<PseudoInverse> for Solver {
    fn from(solver: PseudoInverse) -> Self {
        Self::PseudoInverse(solver)
    }
}

impl From<Ridge> for Solver {
    fn from(solver: Ridge) -> Self {
        Self::Ridge(solver)
    }
}

pub(crate) fn in_range<A: Scalar>(mut solution: Solution<A>) -> Result<Solution<A>> {
    let finite = |x: &A| x.is_finite();
    if solution.beta.iter().all(finite) && solution.intercept.iter().all(finite) {
        solution.diagnosis.saturate();
        Ok(solution)
    } else {
        Err(Error::Overflow {
            what: "an output weight",
        })
    }
}

impl From<Failure> for Error {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::NoConvergence => Self::NoConvergence {
                what: "the singular value decomposition",
            },
            Failure::Pivot => Self::Singular {
                reciprocal_condition: 0.0,
            },
        }
    }
}
