//! Settings whose ranges are checked, and every way to fit with them.

use ndarray::{Array2, ArrayRef2, ArrayView1, ArrayView2};

use super::{ElmParams, Rows, Targets};
use crate::bounds::Bounds;
use crate::check::check_length;
use crate::error::{Error, Result};
use crate::feature_map::{FeatureMap, FeatureRows};
use crate::memory::{check_copies, check_room};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::normal_equations::{HiddenRows, RowSource};
use crate::solve::{LeastSquares, Solver};
use crate::validate::{FoldFit, HeldOut, Validator};

/// Settings that are in range; made by [`ElmParams::check`].
///
/// ```
/// use elm::{ElmParams, Error, validate::assign_folds};
/// use ndarray::{Array1, Axis};
///
/// let refused = ElmParams::<f64>::new(0).check();
/// assert!(matches!(refused, Err(Error::Parameter { name: "neurons", .. })));
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let t = x.mapv(f64::sin);
/// let params = ElmParams::new(20).check()?;
/// let folds = assign_folds(60, 10, 1)?;
/// let held_out = params.cross_validate(&x, &t, &folds)?;
/// assert!(held_out.rmse()[0] < 1e-2);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedParams<A: Scalar>(pub(super) ElmParams<A>);

impl<A: Scalar> CheckedParams<A> {
    /// Draws the hidden layer and solves for the output weights.
    ///
    /// `x` has shape (rows, inputs); `t` has shape (rows, outputs), or (rows) for one output.
    ///
    /// # Errors
    /// [`Error::Empty`], [`Error::Shape`] and [`Error::NotFinite`] for the data,
    /// [`Error::TooLarge`] for more neurons than memory holds, and those of [`Solver::solve`].
    pub fn fit<T: Targets<A>>(&self, x: &ArrayRef2<A>, t: &T) -> Result<Elm<A>> {
        self.fit_weighted(x, t, None)
    }

    /// As [`fit`](Self::fit), with a weight for the squared residual of each row.
    ///
    /// Weights count in all that is made of the rows: means and deviations for the standardisation,
    /// the rows that biases and centres are laid on (drawn in proportion to their weights), and the
    /// solve. A row of weight 0 is no row, at a given relative strength of ridge a row of weight 2 is
    /// two, and a factor of all weights says nothing. Rows of weight 0 must be finite all the same.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit) and [`LeastSquares::weights`].
    pub fn fit_weighted<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<Elm<A>> {
        let rows = Rows::new(x.view(), t.as_matrix(), weights)?;
        let map = self.prepare(&rows)?;
        self.output_weights(map, &rows)
    }

    /// Solves for the output weights of a feature map that is there already: drawn by
    /// [`FeatureMapParams`](crate::FeatureMapParams), [pruned](FeatureMap::subset), or of layers that were
    /// [joined](crate::HiddenLayer::joined). Of these settings the solver, the intercept and the bounds
    /// count.
    ///
    /// The hidden-layer matrix is never there as a whole where [`Ridge`](crate::solve::Ridge) of a given
    /// strength allows that.
    ///
    /// ```
    /// use elm::{ElmParams, solve::Ridge};
    /// use ndarray::{Array1, Axis};
    ///
    /// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
    /// let t = x.mapv(f64::sin);
    /// let params = ElmParams::new(40).solver(Ridge::relative(1e-6));
    /// let half: Vec<usize> = (0..40).step_by(2).collect();
    /// let map = params.feature_map().draw_on(&x)?.subset(&half)?;
    /// let model = params.check()?.fit_map(map, &x, &t, None)?;
    /// assert_eq!(model.hidden().neurons(), 20);
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`fit_weighted`](Self::fit_weighted); [`Error::Shape`] for a map of another number of
    /// inputs.
    pub fn fit_map<T: Targets<A>>(
        &self,
        map: FeatureMap<A>,
        x: &ArrayRef2<A>,
        t: &T,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<Elm<A>> {
        let rows = Self::rows_of_map(&map, x.view(), t.as_matrix(), weights)?;
        self.output_weights(map, &rows)
    }

    /// Checks that rows and a map that is there already go together.
    pub(crate) fn rows_of_map<'a>(
        map: &FeatureMap<A>,
        x: ArrayView2<'a, A>,
        t: ArrayView2<'a, A>,
        weights: Option<ArrayView1<'a, A>>,
    ) -> Result<Rows<'a, A>> {
        let rows = Rows::new(x, t, weights)?;
        check_size(x, map.layer().neurons())?;
        check_length("inputs of the feature map", map.inputs(), x.ncols())?;
        Ok(rows)
    }

    /// The solution for a map and data that go together.
    fn output_weights(&self, map: FeatureMap<A>, rows: &Rows<'_, A>) -> Result<Elm<A>> {
        let (x, t, weights) = (rows.x(), rows.t(), rows.weights());
        let mut source = RowSource {
            hidden: HiddenRows::Map(Box::new(FeatureRows::new(&map, x))),
            targets: t,
            weights,
            intercept: self.has_intercept(),
        };
        let solution = match self.0.solver.solve_rows(&mut source)? {
            Some(solution) => solution,
            None => {
                let design = Self::design(x, &map)?;
                let problem = self.problem(&design, t, weights.as_ref())?;
                self.0.solver.solve(&problem)?
            }
        };
        let bounds = Bounds::of(x, t, weights, self.0.bounded);
        Ok(Elm::assemble(map, solution, bounds))
    }

    /// Held-out predictions for every row, from one random layer and one factorisation: `folds`
    /// has one label per row, and rows of one label are predicted by the fit to all others.
    ///
    /// Ridge has the same strength in every fold, given or chosen on all rows, and inputs are
    /// standardised on all rows; [`validate`](crate::validate) says what that leaks. Predictions are
    /// not held to the [`bounds`](crate::bounds) of the other rows.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit) for the data and of [`Validator::k_fold`];
    /// [`Error::Conflict`] for [`Inverse`](crate::solve::Inverse), which cannot be fitted to fewer
    /// rows, and for a pseudo-inverse with a cut-off of its own, which would fall elsewhere in
    /// every fold.
    pub fn cross_validate<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        folds: &[usize],
    ) -> Result<HeldOut<A>> {
        let (validator, lambda) = self.in_closed_form(x.view(), t.as_matrix())?;
        validator.k_fold(folds, &lambda)
    }

    /// What the fit without each fold predicts for **every** row, those that it was fitted to
    /// among them: as [`cross_validate`](Self::cross_validate), with the fits' training errors
    /// beside the held-out ones. One entry per fold, in rising order of its label.
    ///
    /// # Errors
    /// Those of [`cross_validate`](Self::cross_validate).
    pub fn cross_fits<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        folds: &[usize],
    ) -> Result<Vec<FoldFit<A>>> {
        let (validator, lambda) = self.in_closed_form(x.view(), t.as_matrix())?;
        validator.k_fold_fits(folds, &lambda)
    }

    /// The problem, factorised, and the strengths of its solver.
    fn in_closed_form(
        &self,
        x: ArrayView2<'_, A>,
        t: ArrayView2<'_, A>,
    ) -> Result<(Validator<A>, Vec<f64>)> {
        let conflict = |first| {
            Err(Error::Conflict {
                first,
                second: "validation in closed form",
            })
        };
        let ridge = match self.0.solver {
            Solver::Inverse(_) => return conflict("the solver 'inverse'"),
            Solver::PseudoInverse(solver) if solver.cutoff().is_some() => {
                return conflict("a cut-off of the pseudo-inverse");
            }
            Solver::PseudoInverse(_) => None,
            Solver::Ridge(ridge) => Some(ridge),
        };
        let validator = self.validator(x, t)?;
        let lambda = match ridge {
            Some(ridge) => validator.strengths(ridge)?,
            None => vec![0.0],
        };
        Ok((validator, lambda))
    }

    /// Draws the layer, applies it, and factorises.
    pub(crate) fn validator(
        &self,
        x: ArrayView2<'_, A>,
        t: ArrayView2<'_, A>,
    ) -> Result<Validator<A>> {
        let design = self.draw(&Rows::new(x, t, None)?)?.design;
        Validator::new(&self.problem(&design, t, None)?)
    }

    /// Draws the layer and applies it.
    pub(crate) fn draw(&self, rows: &Rows<'_, A>) -> Result<Drawn<A>> {
        let map = self.prepare(rows)?;
        let design = Self::design(rows.x(), &map)?;
        Ok(Drawn { map, design })
    }

    /// Measures the inputs and draws the layer.
    fn prepare(&self, rows: &Rows<'_, A>) -> Result<FeatureMap<A>> {
        check_size(rows.x(), self.0.neurons())?;
        let params = self.0.feature_map();
        params.draw_weighted(rows.x(), rows.weights())
    }

    /// The matrix of features.
    pub(crate) fn design(x: ArrayView2<'_, A>, map: &FeatureMap<A>) -> Result<Array2<A>> {
        // The matrix itself, prepared for a factorisation, the factorisation's own copy and a factor.
        let what = "the hidden-layer matrix with its factors";
        check_copies(what, x.nrows(), map.features(), 4)?;
        Ok(map.apply(x))
    }

    pub(crate) fn problem<'a>(
        &self,
        design: &'a Array2<A>,
        t: ArrayView2<'a, A>,
        weights: Option<&'a ArrayView1<'_, A>>,
    ) -> Result<LeastSquares<'a, A>> {
        let problem = LeastSquares::of_views(design.view(), t)?.intercept(self.has_intercept());
        match weights {
            Some(weights) => problem.weights(weights),
            None => Ok(problem),
        }
    }

    /// Whether the layer takes more of the rows than the number of their inputs.
    pub(crate) fn needs_rows(&self) -> bool {
        self.0.map.needs_rows()
    }

    /// Equation 10 has no room for a constant; asking for both explicitly is an error later.
    pub(crate) fn has_intercept(&self) -> bool {
        let inverse = matches!(self.0.solver, Solver::Inverse(_));
        self.0.intercept.unwrap_or(!inverse)
    }

    pub(crate) fn standardises(&self) -> bool {
        self.0.map.standardise
    }

    pub(crate) fn is_bounded(&self) -> bool {
        self.0.bounded
    }

    pub(crate) fn links_directly(&self) -> bool {
        self.0.map.direct_links
    }

    pub(crate) fn solver(&self) -> Solver {
        self.0.solver
    }

    /// The settings.
    #[must_use]
    pub fn params(&self) -> &ElmParams<A> {
        &self.0
    }
}

/// Whether there is room to fit `neurons` neurons to these rows.
fn check_size<A: Scalar>(x: ArrayView2<'_, A>, neurons: usize) -> Result<()> {
    // Asked before anything is drawn, as a failed allocation would abort the program. Where rows
    // outnumber neurons the matrix itself may not be needed.
    check_room("the hidden-layer matrix", x.nrows().min(neurons), neurons)
}

/// A feature map and what it makes of the training inputs.
pub(crate) struct Drawn<A: Scalar> {
    pub(crate) map: FeatureMap<A>,
    pub(crate) design: Array2<A>,
}
