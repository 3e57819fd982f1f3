//! Fits of pruned networks.

use ndarray::{ArrayRef2, ArrayView1, Axis};

use super::{Keep, Pruned, choose};
use crate::bounds::Bounds;
use crate::error::{Error, Result};
use crate::feature_map::FeatureMap;
use crate::model::{CheckedParams, Drawn, ElmParams, Rows, Targets};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::{LeastSquares, Ridge, Solver};

impl<A: Scalar> ElmParams<A> {
    /// Draws the layer, keeps the neurons that are most useful together, and fits them; see
    /// [`prune`](crate::prune).
    ///
    /// # Errors
    /// Those of [`check`](Self::check) and [`CheckedParams::fit_pruned`].
    pub fn fit_pruned<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        keep: Keep,
    ) -> Result<Pruned<A>> {
        self.clone().check()?.fit_pruned(x, t, keep)
    }
}

impl<A: Scalar> CheckedParams<A> {
    /// Draws the layer, keeps the neurons that are most useful together, and fits them; see
    /// [`prune`](crate::prune). Direct links are kept.
    ///
    /// # Errors
    /// [`Error::Parameter`] for more neurons than there are, none, or a loss that is negative or
    /// not finite; [`Error::Conflict`] unless the solver is ridge; those of [`fit`](Self::fit).
    pub fn fit_pruned<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        keep: Keep,
    ) -> Result<Pruned<A>> {
        self.fit_pruned_weighted(x, t, keep, None)
    }

    /// As [`fit_pruned`](Self::fit_pruned), with a weight for the squared residual of each row, which
    /// decides what is useful as well, and counts in all else as in
    /// [`fit_weighted`](Self::fit_weighted).
    ///
    /// # Errors
    /// Those of [`fit_pruned`](Self::fit_pruned) and [`LeastSquares::weights`].
    pub fn fit_pruned_weighted<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        keep: Keep,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<Pruned<A>> {
        let ridge = self.pruning_ridge()?;
        keep.check(self.params().neurons())?;
        let rows = Rows::new(x.view(), t.as_matrix(), weights)?;
        let drawn = self.draw(&rows)?;
        self.prune(drawn, &rows, keep, ridge)
    }

    /// As [`fit_pruned_weighted`](Self::fit_pruned_weighted), of a feature map that is there already: see
    /// [`fit_map`](Self::fit_map).
    ///
    /// # Errors
    /// Those of [`fit_pruned`](Self::fit_pruned) and [`fit_map`](Self::fit_map).
    pub fn prune_map<T: Targets<A>>(
        &self,
        map: FeatureMap<A>,
        x: &ArrayRef2<A>,
        t: &T,
        keep: Keep,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<Pruned<A>> {
        let ridge = self.pruning_ridge()?;
        keep.check(map.layer().neurons())?;
        let rows = Self::rows_of_map(&map, x.view(), t.as_matrix(), weights)?;
        let design = Self::design(rows.x(), &map)?;
        self.prune(Drawn { map, design }, &rows, keep, ridge)
    }

    fn pruning_ridge(&self) -> Result<Ridge> {
        match self.solver() {
            Solver::Ridge(ridge) => Ok(ridge),
            _ => Err(Error::Conflict {
                first: "a solver other than ridge",
                second: "pruning",
            }),
        }
    }

    fn prune(
        &self,
        drawn: Drawn<A>,
        rows: &Rows<'_, A>,
        keep: Keep,
        ridge: Ridge,
    ) -> Result<Pruned<A>> {
        let (t, weights) = (rows.t(), rows.weights());
        let Drawn { map, design } = drawn;
        let neurons = map.layer().neurons();
        let wide = (A::widen(design.view()), A::widen(t));
        let wide_weights = weights.map(A::widen);
        let mut problem = LeastSquares::of_views(wide.0.view(), wide.1.view())?;
        if let Some(weights) = &wide_weights {
            problem = problem.weights(weights)?;
        }
        let problem = problem.intercept(self.has_intercept());
        let (mut kept, path) = choose(&problem, neurons, ridge, keep)?;
        kept.sort_unstable();

        let columns: Vec<usize> = kept
            .iter()
            .copied()
            .chain(neurons..design.ncols())
            .collect();
        let design = design.select(Axis(1), &columns);
        let solution = self
            .solver()
            .solve(&self.problem(&design, t, weights.as_ref())?)?;
        Ok(Pruned {
            model: Elm::assemble(
                map.select(&kept),
                solution,
                Bounds::of(rows.x(), t, weights, self.is_bounded()),
            ),
            kept,
            path,
        })
    }
}
