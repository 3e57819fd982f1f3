//! The rows that count in an uncertainty, their weights and groups.

use std::collections::BTreeMap;

use ndarray::{Array1, ArrayView2};

use crate::metrics::{root_mean_square, root_mean_squares};
use crate::scalar::Scalar;
use crate::stats;

/// Rows whose weight is not 0.
#[derive(Debug, Clone)]
pub(super) struct CountedRows<A: Scalar> {
    pub(super) present: Vec<usize>,
    /// Of all rows, the mean of those present being 1.
    pub(super) weights: Array1<A>,
    /// The mean weight over the largest.
    pub(super) mean: A,
    /// Of each row the number of its group, counted from 0, where rows have groups.
    pub(super) groups: Option<Vec<usize>>,
}

impl<A: Scalar> CountedRows<A> {
    /// `weights` are those of all rows, the largest being 1.
    pub(super) fn new(mut weights: Array1<A>, groups: Option<&[usize]>) -> Self {
        let present: Vec<usize> = (0..weights.len())
            .filter(|&row| weights[row] > A::zero())
            .collect();
        let total = stats::sum(weights.iter().map(|w| w.as_f64()));
        let mean = A::from_f64(total / present.len().max(1) as f64);
        weights.mapv_inplace(|weight| weight / mean);
        let groups = groups.map(|groups| {
            let mut known = BTreeMap::new();
            for &group in groups {
                let next = known.len();
                known.entry(group).or_insert(next);
            }
            groups.iter().map(|group| known[group]).collect()
        });
        Self {
            present,
            weights,
            mean,
            groups,
        }
    }

    /// The root mean square of each column.
    pub(super) fn errors(&self, residuals: ArrayView2<'_, A>) -> Array1<f64> {
        if self.weights.iter().all(|weight| *weight == A::one()) {
            return root_mean_squares(residuals);
        }
        let columns = residuals.columns().into_iter();
        let errors = columns.map(|column| root_mean_square(column, self.weights.view()));
        errors.collect()
    }

    /// Adds up what rows of one group have, and gives all of them the sum.
    pub(super) fn pool(&self, values: &mut Array1<A>) {
        let Some(groups) = &self.groups else { return };
        let mut sums = vec![A::zero(); groups.iter().max().map_or(0, |last| last + 1)];
        for (&group, &value) in groups.iter().zip(&*values) {
            sums[group] += value;
        }
        for (&group, value) in groups.iter().zip(values) {
            *value = sums[group];
        }
    }
}
