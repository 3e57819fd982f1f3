//! The measurements of a fit: targets, weights, folds, and what is guessed where nothing was measured.

use ndarray::{Array1, Array2, ArrayView2, Axis};
use rand::seq::index;

use super::Tuned;
use super::anchors::{Anchors, Neighborhood};
use super::errors::row_weights;
use crate::error::Result;
use crate::streams::{self, generator};
use crate::target_transform::FittedTransform;
use elm_datasets::geometry::DirectionPair;

/// Folds of the cross-validation.
const FOLDS: usize = 5;
/// Rows that are left out in turn, at most.
const VALIDATION: usize = 6_000;
/// Measurements that guesses are made from, at most.
const KNOWN: usize = 4_000;

/// Measurements to be fitted, for all sets of inputs.
pub(super) struct Problem<'a> {
    pub(super) tuned: &'a Tuned,
    pub(super) pairs: &'a [DirectionPair],
    pub(super) values: ArrayView2<'a, f64>,
    pub(super) transform: FittedTransform,
    /// Standard deviation of the noise of each channel's dark values, in 1/sr.
    pub(super) noise: Vec<f64>,
    /// Whether that is as large as values are.
    pub(super) noisy: bool,
    /// Whether the surface has a grain.
    pub(super) anisotropic: bool,
    pub(super) targets: Array2<f64>,
    pub(super) weights: Option<Array1<f64>>,
    /// The rows that are left out in turn, fold by fold.
    pub(super) folds: Vec<Vec<usize>>,
    /// All rows of the folds, in their order.
    pub(super) validation: Vec<usize>,
    pub(super) validation_pairs: Vec<DirectionPair>,
    /// The measurements that guesses are made from, as places among the validation rows.
    pub(super) known: Vec<usize>,
    pub(super) neighborhood: Neighborhood,
    pub(super) anchors: Anchors,
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        tuned: &'a Tuned,
        pairs: &'a [DirectionPair],
        values: ArrayView2<'a, f64>,
        transform: FittedTransform,
        noise: Vec<f64>,
        noisy: bool,
        anisotropic: bool,
    ) -> Result<Self> {
        let mut random = generator(tuned.seed, streams::VALIDATION);
        let rows = pairs.len();
        let validation = index::sample(&mut random, rows, rows.min(VALIDATION)).into_vec();
        let count = FOLDS.min(rows);
        let folds: Vec<Vec<usize>> = (0..count)
            .map(|fold| {
                validation
                    .iter()
                    .copied()
                    .skip(fold)
                    .step_by(count)
                    .collect()
            })
            .collect();
        let validation: Vec<usize> = folds.concat();
        let validation_pairs: Vec<DirectionPair> =
            validation.iter().map(|&row| pairs[row]).collect();
        let known: Vec<usize> = (0..validation.len())
            .step_by(validation.len().div_ceil(KNOWN).max(1))
            .collect();
        let known_pairs: Vec<DirectionPair> =
            known.iter().map(|&place| validation_pairs[place]).collect();
        let neighborhood = Neighborhood::new(&known_pairs, anisotropic);
        Ok(Self {
            targets: transform.to_targets(values)?,
            weights: row_weights(tuned.metric, pairs, values, &transform),
            anchors: Anchors::new(&neighborhood, tuned.seed),
            tuned,
            pairs,
            values,
            transform,
            noise,
            noisy,
            anisotropic,
            folds,
            validation,
            validation_pairs,
            known,
            neighborhood,
        })
    }

    /// The targets of some rows.
    pub(super) fn targets(&self, rows: &[usize]) -> Array2<f64> {
        self.targets.select(Axis(0), rows)
    }

    /// What the metric makes of errors at some rows, where it makes anything of them.
    pub(super) fn weights(&self, rows: &[usize]) -> Option<Array1<f64>> {
        let weights = self.weights.as_ref();
        weights.map(|weights| weights.select(Axis(0), rows))
    }

    /// The rows that are left out in turn, fold by fold.
    pub(super) fn folds(&self) -> &[Vec<usize>] {
        &self.folds
    }

    /// All rows of the folds, in their order.
    pub(super) fn validation(&self) -> &[usize] {
        &self.validation
    }

    /// The rows that guesses are made from.
    fn known_rows(&self) -> Vec<usize> {
        self.known
            .iter()
            .map(|&place| self.validation[place])
            .collect()
    }

    /// What the nearest measurements say of the targets at any pairs.
    pub(super) fn neighbors_guess(&self, pairs: &[DirectionPair]) -> Array2<f64> {
        let targets = self.targets(&self.known_rows());
        self.neighborhood.guess(pairs, targets.view())
    }

    /// What anchors count where the targets have these variances about a network.
    pub(super) fn anchor_weights(&self, variances: &[f64]) -> Array1<f64> {
        let targets = self.targets(&self.known_rows());
        self.anchors.weights(targets.view(), variances)
    }

    /// What the targets suggest at each anchor, by the rows in a place among the validation rows of which
    /// `is_there`.
    pub(super) fn guesses_of_targets(&self, is_there: impl Fn(usize) -> bool) -> Array2<f64> {
        self.guesses(&self.targets, is_there)
    }

    /// What `targets`, of all rows, suggest at each anchor, by the known rows that are in a place among
    /// the validation rows of which `is_there`.
    pub(super) fn guesses(
        &self,
        targets: &Array2<f64>,
        is_there: impl Fn(usize) -> bool,
    ) -> Array2<f64> {
        let targets = targets.select(Axis(0), &self.known_rows());
        self.anchors
            .targets(targets.view(), |known| is_there(self.known[known]))
    }
}
