//! Fits of pruned networks.

use ndarray::Axis;

use super::{Keep, Pruned, choose};
use crate::bounds::Bounds;
use crate::dataset::{Dataset, Rows, TargetDim};
use crate::error::{Error, Result};
use crate::feature_map::FeatureMap;
use crate::model::{Drawn, ElmParams};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::{LeastSquares, Ridge, Solver};

impl<A: Scalar> ElmParams<A> {
    /// Draws the layer, keeps the neurons that are most useful together, and fits them; see
    /// [`prune`](crate::prune). Direct links are kept. Weights of rows count in what is useful, too.
    ///
    /// # Errors
    /// [`Error::Parameter`] for more neurons than there are, none, or a loss that is negative or
    /// not finite; [`Error::Conflict`] unless the solver is ridge; those of
    /// [`fit_dataset`](Self::fit_dataset).
    pub fn fit_pruned<D: TargetDim>(
        &self,
        data: &Dataset<'_, A, D>,
        keep: Keep,
    ) -> Result<Pruned<A, D>> {
        self.check()?;
        let ridge = self.pruning_ridge()?;
        keep.check(self.neurons())?;
        let rows = Rows::new(data)?;
        let drawn = self.draw(&rows)?;
        self.prune(drawn, &rows, keep, ridge)
    }

    /// As [`fit_pruned`](Self::fit_pruned), of a feature map that is there already: see
    /// [`fit_map`](Self::fit_map).
    ///
    /// # Errors
    /// Those of [`fit_pruned`](Self::fit_pruned) and [`fit_map`](Self::fit_map).
    pub fn prune_map<D: TargetDim>(
        &self,
        map: FeatureMap<A>,
        data: &Dataset<'_, A, D>,
        keep: Keep,
    ) -> Result<Pruned<A, D>> {
        self.check()?;
        let ridge = self.pruning_ridge()?;
        keep.check(map.layer().neurons())?;
        let rows = Self::rows_of_map(&map, data)?;
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

    fn prune<D: TargetDim>(
        &self,
        drawn: Drawn<A>,
        rows: &Rows<'_, A>,
        keep: Keep,
        ridge: Ridge,
    ) -> Result<Pruned<A, D>> {
        let (t, weights) = (rows.t(), rows.weights());
        let Drawn { map, design } = drawn;
        let neurons = map.layer().neurons();
        let wide = (A::widen(design.view()), A::widen(t));
        let wide_weights = weights.map(A::widen);
        let mut problem = LeastSquares::of_views(wide.0.view(), wide.1.view())?;
        if let Some(weights) = &wide_weights {
            problem = problem.with_weights(weights)?;
        }
        let problem = problem.with_intercept(self.intercept());
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
                Bounds::of(rows.x(), t, weights, self.bounded()),
            ),
            kept,
            path,
        })
    }
}
