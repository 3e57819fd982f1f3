//! What is fitted with the settings: the verbs of [`ElmParams`].

use ndarray::{Array2, ArrayView1, ArrayView2};

use super::ElmParams;
use crate::bounds::Bounds;
use crate::check::check_length;
use crate::cross_validation::{CrossValidator, CvPredictions, FoldPredictions, check_several};
use crate::dataset::{Dataset, Inputs, Rows, TargetDim, Targets};
use crate::error::{Error, Result};
use crate::feature_map::{FeatureMap, FeatureRows};
use crate::memory::{check_copies, check_room};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::normal_equations::{HiddenRows, RowSource};
use crate::solve::{Lambda, LeastSquares, Solver};

impl<A: Scalar> ElmParams<A> {
    /// Draws the hidden layer and solves for the output weights.
    ///
    /// `x` has shape (rows, inputs); `t` has shape (rows, outputs), or one value per row. Predictions have
    /// the dimension of the targets.
    ///
    /// # Errors
    /// Those of [`Dataset::new`] and [`fit_dataset`](Self::fit_dataset).
    pub fn fit<X, T>(&self, x: &X, t: &T) -> Result<Elm<A, T::Dim>>
    where
        X: Inputs<A> + ?Sized,
        T: Targets<A> + ?Sized,
    {
        self.fit_dataset(&Dataset::new(x, t)?)
    }

    /// As [`fit`](Self::fit), of rows that may have [weights](Dataset::with_weights) and
    /// [groups](Dataset::with_groups): where ridge chooses its strength by leave-one-out, rows of one group
    /// are left out together.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first setting that is out of range, or for weights that are all 0;
    /// [`Error::Empty`] without rows or columns, [`Error::TooLarge`] for more neurons than memory holds,
    /// and those of [`Solver::solve`].
    pub fn fit_dataset<D: TargetDim>(&self, data: &Dataset<'_, A, D>) -> Result<Elm<A, D>> {
        self.check()?;
        let rows = Rows::new(data)?;
        let map = self.prepare(&rows)?;
        self.output_weights(map, &rows, data)
    }

    /// Solves for the output weights of a feature map that is there already: drawn by
    /// [`FeatureMapParams`](crate::advanced::FeatureMapParams), [pruned](FeatureMap::subset), or of layers
    /// that were [joined](crate::advanced::HiddenLayer::joined). Of these settings the solver, the
    /// intercept and the bounds count.
    ///
    /// The hidden-layer matrix is never there as a whole where [`Ridge`](crate::solve::Ridge) of a given
    /// strength allows that.
    ///
    /// ```
    /// use elm::{Dataset, ElmParams, solve::Ridge};
    /// use ndarray::{Array1, Axis};
    ///
    /// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
    /// let t = x.mapv(f64::sin);
    /// let params = ElmParams::new(40).with_solver(Ridge::relative(1e-6));
    /// let half: Vec<usize> = (0..40).step_by(2).collect();
    /// let map = params.feature_map().draw_on(&x)?.subset(&half)?;
    /// let model = params.fit_map(map, &Dataset::new(&x, &t)?)?;
    /// assert_eq!(model.hidden().neurons(), 20);
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`fit_dataset`](Self::fit_dataset); [`Error::Shape`] for a map of another number of
    /// inputs.
    pub fn fit_map<D: TargetDim>(
        &self,
        map: FeatureMap<A>,
        data: &Dataset<'_, A, D>,
    ) -> Result<Elm<A, D>> {
        self.check()?;
        let rows = Self::rows_of_map(&map, data)?;
        self.output_weights(map, &rows, data)
    }

    /// Checks that rows and a map that is there already go together.
    pub(crate) fn rows_of_map<'a, D: TargetDim>(
        map: &FeatureMap<A>,
        data: &'a Dataset<'_, A, D>,
    ) -> Result<Rows<'a, A>> {
        let rows = Rows::new(data)?;
        check_size(data.inputs(), map.layer().neurons())?;
        check_length(
            "inputs of the feature map",
            map.inputs(),
            data.inputs().ncols(),
        )?;
        Ok(rows)
    }

    /// The solution for a map and data that go together.
    fn output_weights<D: TargetDim>(
        &self,
        map: FeatureMap<A>,
        rows: &Rows<'_, A>,
        data: &Dataset<'_, A, D>,
    ) -> Result<Elm<A, D>> {
        let (x, t, weights) = (rows.x(), rows.t(), rows.weights());
        let bounds = Bounds::of(x, t, weights, self.bounded);
        if let (Solver::Ridge(ridge), Some(groups)) = (self.solver, data.groups())
            && ridge.lambda() == Lambda::LeaveOneOut
        {
            check_several("groups", groups)?;
            let design = Self::design(data.inputs(), &map)?;
            let weights = data.weights();
            let problem = self.problem(&design, data.target_matrix(), weights.as_ref())?;
            let validator = CrossValidator::new(&problem)?;
            let lambda = validator.select_lambda_by_folds(groups, ridge)?;
            return Ok(Elm::assemble(map, validator.solve(&lambda)?, bounds));
        }
        let source = RowSource {
            hidden: HiddenRows::Map(Box::new(FeatureRows::new(&map, x))),
            targets: t,
            weights,
            intercept: self.intercept(),
        };
        let solution = match self.solver.solve_rows(&source)? {
            Some(solution) => solution,
            None => {
                let design = Self::design(x, &map)?;
                let problem = self.problem(&design, t, weights.as_ref())?;
                self.solver.solve_whole(&problem)?
            }
        };
        Ok(Elm::assemble(map, solution, bounds))
    }

    /// Held-out predictions for every row, from one random layer and one factorization: `folds`
    /// has one label per row, and rows of one label are predicted by the fit to all others.
    ///
    /// Ridge has the same strength in every fold, given or chosen by the errors of these folds in place of
    /// leave-one-out, and inputs are standardized on all rows; [`cross_validation`](crate::cross_validation)
    /// says what that leaks. Predictions are not held to the [`bounds`](crate::bounds) of the other rows.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit) for the data and of [`CrossValidator::k_fold`];
    /// [`Error::Conflict`] for [`Inverse`](crate::solve::Inverse), which cannot be fitted to fewer
    /// rows, and for a pseudo-inverse with a cut-off of its own, which would fall elsewhere in
    /// every fold.
    #[doc(alias = "cross_validate")]
    pub fn cross_val_predict<D: TargetDim>(
        &self,
        data: &Dataset<'_, A, D>,
        folds: &[usize],
    ) -> Result<CvPredictions<A, D>> {
        let (validator, lambda) = self.in_closed_form(data, folds)?;
        Ok(validator.k_fold(folds, &lambda)?.of_dimension())
    }

    /// What the fit without each fold predicts for **every** row, those that it was fitted to
    /// among them: as [`cross_val_predict`](Self::cross_val_predict), with the fits' training errors
    /// beside the held-out ones. One entry per fold, in rising order of its label.
    ///
    /// # Errors
    /// Those of [`cross_val_predict`](Self::cross_val_predict).
    pub fn fold_predictions<D: TargetDim>(
        &self,
        data: &Dataset<'_, A, D>,
        folds: &[usize],
    ) -> Result<Vec<FoldPredictions<A, D>>> {
        let (validator, lambda) = self.in_closed_form(data, folds)?;
        let all = validator.fold_predictions(folds, &lambda)?.into_iter();
        Ok(all.map(FoldPredictions::of_dimension).collect())
    }

    /// The problem, factorized, and the strengths of its solver.
    fn in_closed_form<D: TargetDim>(
        &self,
        data: &Dataset<'_, A, D>,
        folds: &[usize],
    ) -> Result<(CrossValidator<A>, Vec<f64>)> {
        self.check()?;
        let conflict = |first| {
            Err(Error::Conflict {
                first,
                second: "validation in closed form",
            })
        };
        let ridge = match self.solver {
            Solver::Inverse(_) => return conflict("the solver 'inverse'"),
            Solver::PseudoInverse(solver) if solver.cutoff().is_some() => {
                return conflict("a cut-off of the pseudo-inverse");
            }
            Solver::PseudoInverse(_) => None,
            Solver::Ridge(ridge) => Some(ridge),
        };
        check_length("fold labels", folds.len(), data.rows())?;
        check_several("fold labels", folds)?;
        let validator = self.validator(data)?;
        let lambda = match ridge {
            Some(ridge) => validator.select_lambda_by_folds(folds, ridge)?,
            None => vec![0.0],
        };
        Ok((validator, lambda))
    }

    /// Draws the layer, applies it to all rows, those of weight 0 as well, and factorizes.
    pub(crate) fn validator<D: TargetDim>(
        &self,
        data: &Dataset<'_, A, D>,
    ) -> Result<CrossValidator<A>> {
        let map = self.prepare(&Rows::new(data)?)?;
        let design = Self::design(data.inputs(), &map)?;
        let weights = data.weights();
        CrossValidator::new(&self.problem(&design, data.target_matrix(), weights.as_ref())?)
    }

    /// Draws the layer and applies it.
    pub(crate) fn draw(&self, rows: &Rows<'_, A>) -> Result<Drawn<A>> {
        let map = self.prepare(rows)?;
        let design = Self::design(rows.x(), &map)?;
        Ok(Drawn { map, design })
    }

    /// Measures the inputs and draws the layer.
    fn prepare(&self, rows: &Rows<'_, A>) -> Result<FeatureMap<A>> {
        check_size(rows.x(), self.neurons())?;
        let params = self.feature_map();
        params.draw_weighted(rows.x(), rows.weights())
    }

    /// The matrix of features.
    pub(crate) fn design(x: ArrayView2<'_, A>, map: &FeatureMap<A>) -> Result<Array2<A>> {
        // The matrix itself, prepared for a factorization, the factorization's own copy and a factor.
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
        let problem = LeastSquares::of_views(design.view(), t)?.with_intercept(self.intercept());
        match weights {
            Some(weights) => problem.with_weights(weights),
            None => Ok(problem),
        }
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
