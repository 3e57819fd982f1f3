//! How many outputs a network of many channels has: as few as are good enough at rows left out.

use ndarray::{Array2, ArrayView2, Axis, Slice};

use super::Tuned;
use super::errors::{cut_off_means, geometric_root};
use crate::basis::Basis;
use crate::error::Result;
use crate::metrics::{Metric, Metrics};
use crate::target_transform::FittedTransform;
use elm_datasets::geometry::DirectionPair;

/// Outputs tried, at most.
const MOST: usize = 12;
/// Fewer outputs are taken where the error is larger by no more than this.
const AS_GOOD: f64 = 1.02;

/// Rows at which numbers of outputs are compared.
pub(super) struct Judge<'a> {
    pub(super) pairs: &'a [DirectionPair],
    pub(super) values: ArrayView2<'a, f64>,
}

impl Judge<'_> {
    /// The metric, or where RMSE is asked for, which a few bright rows decide, that of the targets, the
    /// largest errors cut off. `targets` are predicted ones of all channels.
    fn error(
        &self,
        metric: Metric,
        transform: &FittedTransform,
        targets: &Array2<f64>,
    ) -> Result<f64> {
        if metric == Metric::Rmse {
            let squares = (targets - &transform.to_targets(self.values)?).mapv_into(|e| e * e);
            return Ok(geometric_root(&cut_off_means(squares.view())));
        }
        let predicted = transform.to_values(targets.clone())?;
        Ok(metric.of(&Metrics::of(self.pairs, predicted.view(), self.values)?))
    }
}

impl Tuned {
    /// `transform` with a basis of the outputs that are good enough, or as it is for few channels. Its basis
    /// is found from `values`. `predict(basis, n)` predicts the first n outputs of a basis at the rows of
    /// `judge`; `None` where the limits leave no room for n.
    pub(super) fn with_outputs(
        &self,
        transform: FittedTransform,
        values: ArrayView2<'_, f64>,
        judge: &Judge<'_>,
        mut predict: impl FnMut(&FittedTransform, usize) -> Result<Option<Array2<f64>>>,
    ) -> Result<FittedTransform> {
        let channels = transform.channels();
        if channels <= Self::DIRECT {
            return Ok(transform);
        }
        let most = MOST.min(channels - 1);
        let basis = Basis::fit(transform.to_targets(values)?.view(), most)?;
        let whole = transform.with_basis(basis.clone());
        let mut tried: Vec<(usize, f64)> = Vec::with_capacity(most);
        for outputs in 1..=most {
            let Some(predicted) = predict(&whole, outputs)? else {
                break;
            };
            let some = predicted.slice_axis(Axis(1), Slice::from(..outputs));
            let targets = basis.first(outputs).expand(&some.to_owned());
            let error = judge.error(self.metric, &transform, &targets)?;
            if error.is_finite() {
                tried.push((outputs, error));
            }
        }
        let least = tried
            .iter()
            .map(|(_, error)| *error)
            .fold(f64::INFINITY, f64::min);
        let good = tried.iter().find(|(_, error)| *error <= AS_GOOD * least);
        let outputs = good.map_or(1, |(outputs, _)| *outputs);
        Ok(transform.with_basis(basis.first(outputs)))
    }
}
