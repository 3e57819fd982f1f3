//! Fits of pruned layers.

use ndarray::{ArrayRef2, ArrayView1, Axis};

use super::{Keep, Pruned, choose};
use crate::bounds::Bounds;
use crate::error::{Error, Result};
use crate::hidden::HiddenLayer;
use crate::model::{CheckedParams, Drawn, ElmParams, Rows, Targets};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::scaler::Scaler;
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

    /// As [`fit_pruned_weighted`](Self::fit_pruned_weighted), of a layer that is there already: see
    /// [`fit_layer`](Self::fit_layer).
    ///
    /// # Errors
    /// Those of [`fit_pruned`](Self::fit_pruned) and [`fit_layer`](Self::fit_layer).
    pub fn prune_layer<T: Targets<A>>(
        &self,
        scaler: Option<Scaler<A>>,
        hidden: HiddenLayer<A>,
        x: &ArrayRef2<A>,
        t: &T,
        keep: Keep,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<Pruned<A>> {
        let ridge = self.pruning_ridge()?;
        keep.check(hidden.neurons())?;
        let rows =
            self.rows_of_layer(scaler.as_ref(), &hidden, x.view(), t.as_matrix(), weights)?;
        let design = self.design(rows.x(), scaler.as_ref(), &hidden)?;
        let drawn = Drawn {
            scaler,
            hidden,
            design,
        };
        self.prune(drawn, &rows, keep, ridge)
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
        let Drawn {
            scaler,
            hidden,
            design,
        } = drawn;
        let wide = (A::widen(design.view()), A::widen(t));
        let wide_weights = weights.map(A::widen);
        let mut problem = LeastSquares::of_views(wide.0.view(), wide.1.view())?;
        if let Some(weights) = &wide_weights {
            problem = problem.weights(weights)?;
        }
        let problem = problem.intercept(self.has_intercept());
        let (mut kept, path) = choose(&problem, hidden.neurons(), ridge, keep)?;
        kept.sort_unstable();

        let columns: Vec<usize> = kept
            .iter()
            .copied()
            .chain(hidden.neurons()..design.ncols())
            .collect();
        let design = design.select(Axis(1), &columns);
        let solution = self
            .solver()
            .solve(&self.problem(&design, t, weights.as_ref())?)?;
        Ok(Pruned {
            model: Elm::assemble(
                scaler,
                hidden.select(&kept),
                self.links_directly(),
                solution,
                Bounds::of(rows.x(), t, weights, self.is_bounded()),
            ),
            kept,
            path,
        })
    }
}
