//! All folds of a cross-validation from one factorisation.

use elm::Dataset;
use ndarray::{Array2, ArrayView2};

use super::{BrdfModel, BrdfParams};
use crate::error::{Error, Result};
use crate::fit::Fit;
use crate::target_transform::TargetTransform;
use elm_datasets::geometry::DirectionPair;

/// [`BrdfParams`] that are cross-validated with their inputs standardised once, on all
/// measurements, so that all folds come from one factorisation, in closed form.
///
/// The means and deviations of all **directions** then enter every fold, those of the held-out
/// ones too; held-out **values** never do, unless the solver is ridge with a strength of its own
/// choice, which is chosen on all rows. By default (the plain [`BrdfParams`]) each fold scales its
/// own training rows.
#[derive(Debug, Clone, PartialEq)]
pub struct GlobalScaling(BrdfParams);

impl GlobalScaling {
    /// # Errors
    /// [`Error::Conflict`] for a transform other than [`TargetTransform::Identity`], which is fitted to each
    /// fold's values.
    pub fn new(params: BrdfParams) -> Result<Self> {
        if params.transform == TargetTransform::Identity {
            return Ok(Self(params));
        }
        Err(Error::Conflict {
            first: "a target transform other than identity",
            second: "inputs scaled once",
        })
    }
}

impl Fit for GlobalScaling {
    type Model = BrdfModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        self.0.fit(pairs, values)
    }

    fn cross_fits(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
        folds: &[usize],
        count: usize,
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<Vec<Array2<f64>>> {
        let x = self.0.features.compute_training(pairs);
        let network = self.0.network.clone().with_bounded(false);
        let fits = network.fold_predictions(&Dataset::new(&x, &values)?, folds)?;
        let mut all = Vec::with_capacity(count);
        for fold in 0..count {
            all.push(match fits.iter().find(|fit| fit.label() == fold) {
                Some(fit) => fit.predictions().to_owned(),
                // A fold without rows leaves nothing out.
                None => network.fit(&x, &values)?.predict(&x)?,
            });
        }
        done(count);
        Ok(all)
    }
}
