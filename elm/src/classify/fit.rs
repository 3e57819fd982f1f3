//! The verbs that make classifiers, of [`ElmParams`] and [`Tuner`].

use ndarray::{Array1, Array2, ArrayView2};

use super::calibration::Calibration;
use super::labels::LabeledRows;
use super::left_out::LeftOut;
use super::{ElmClassifier, Parts};
use crate::dataset::{Dataset, Inputs};
use crate::error::Result;
use crate::model::ElmParams;
use crate::network::Elm;
use crate::prune::{Keep, Pruned, Size};
use crate::scalar::Scalar;
use crate::solve::Solver;
use crate::tune::{Level, Trial, Tuner};

/// A pruned classifier; made by [`ElmParams::fit_pruned_classifier`].
#[derive(Debug, Clone, PartialEq)]
pub struct PrunedClassifier<A: Scalar, L> {
    /// The classifier of the neurons that are kept.
    pub classifier: ElmClassifier<A, L>,
    /// Which of the neurons drawn they are, rising.
    pub kept: Vec<usize>,
    /// The sizes that were looked at, the smallest first.
    pub path: Vec<Size>,
}

/// What a [`Tuner`] found for a classifier; made by [`Tuner::tune_classifier`].
#[derive(Debug, Clone, PartialEq)]
pub struct TunedClassifier<A: Scalar, L> {
    /// The classifier with the best setting, fitted to all rows.
    pub classifier: ElmClassifier<A, L>,
    /// The settings, to fit others alike.
    pub params: ElmParams<A>,
    /// The best trial; its score is the held-out error of the 0 and 1 of classes.
    pub best: Trial,
    /// All trials in the order they were made.
    pub trials: Vec<Trial>,
}

impl<A: Scalar> ElmParams<A> {
    /// Draws the hidden layer, solves for the scores of classes, and calibrates probabilities; see
    /// [`classify`](crate::classify). `x` has shape (rows, inputs), `labels` one entry per row.
    ///
    /// # Errors
    /// Those of [`LabeledRows::new`] and [`fit_labeled`](Self::fit_labeled).
    pub fn fit_classifier<X, L>(&self, x: &X, labels: &[L]) -> Result<ElmClassifier<A, L>>
    where
        X: Inputs<A> + ?Sized,
        L: Ord + Clone,
    {
        self.fit_labeled(&LabeledRows::new(x, labels)?)
    }

    /// As [`fit_classifier`](Self::fit_classifier), of rows and classes that may have weights. A strength of
    /// ridge that is chosen is one for all classes.
    ///
    /// # Errors
    /// [`Error::OneClass`](crate::Error::OneClass) where all rows that count are of one class, and those of
    /// [`fit_dataset`](Self::fit_dataset).
    pub fn fit_labeled<L: Ord + Clone>(
        &self,
        rows: &LabeledRows<'_, A, L>,
    ) -> Result<ElmClassifier<A, L>> {
        self.check()?;
        rows.check_several()?;
        let shared = self.clone().for_classes();
        let targets = Targets::new(rows);
        let model = shared.fit_dataset(&targets.dataset(rows)?)?;
        shared.classifier(model, rows, &targets)
    }

    /// Draws the layer, keeps the neurons that are most useful together, and makes a classifier of them; see
    /// [`prune`](crate::prune).
    ///
    /// # Errors
    /// Those of [`fit_labeled`](Self::fit_labeled) and [`fit_pruned`](Self::fit_pruned).
    pub fn fit_pruned_classifier<L: Ord + Clone>(
        &self,
        rows: &LabeledRows<'_, A, L>,
        keep: Keep,
    ) -> Result<PrunedClassifier<A, L>> {
        self.check()?;
        rows.check_several()?;
        let shared = self.clone().for_classes();
        let targets = Targets::new(rows);
        let Pruned { model, kept, path } = shared.fit_pruned(&targets.dataset(rows)?, keep)?;
        Ok(PrunedClassifier {
            classifier: shared.classifier(model, rows, &targets)?,
            kept,
            path,
        })
    }

    /// One strength of ridge for all classes: their scores then sum to 1, and share their leverages.
    pub(super) fn for_classes(self) -> Self {
        match self.solver() {
            Solver::Ridge(ridge) => self.with_solver(ridge.with_shared(true)),
            _ => self,
        }
    }

    /// Calibrates a network that was fitted to these rows.
    fn classifier<L: Ord + Clone>(
        &self,
        model: Elm<A>,
        rows: &LabeledRows<'_, A, L>,
        targets: &Targets<A>,
    ) -> Result<ElmClassifier<A, L>> {
        let weight = |row: usize| targets.weights.as_ref().map_or(1.0, |w| w[row].as_f64());
        let x: ArrayView2<'_, A> = rows.inputs();
        let left_out = LeftOut::new(&model, self.intercept(), x, &targets.matrix, weight)?;
        let codes: Vec<usize> = left_out.rows.iter().map(|&row| rows.codes()[row]).collect();
        let weights: Array1<f64> = left_out.rows.iter().map(|&row| weight(row)).collect();
        let classes = rows.classes().to_vec();
        let scores = left_out.scores.view();
        let calibration = Calibration::fit(scores, &codes, Some(weights.view()), classes.len());
        ElmClassifier::try_from(Parts {
            model,
            classes,
            calibration,
        })
    }
}

impl<A: Scalar> Tuner<A> {
    /// Searches, and makes a classifier with the best setting: [`tune_classifier`](Self::tune_classifier)
    /// without the path.
    ///
    /// # Errors
    /// Those of [`LabeledRows::new`] and [`tune_classifier`](Self::tune_classifier).
    pub fn fit_classifier<X, L>(&self, x: &X, labels: &[L]) -> Result<ElmClassifier<A, L>>
    where
        X: Inputs<A> + ?Sized,
        L: Ord + Clone,
    {
        Ok(self
            .tune_classifier(&LabeledRows::new(x, labels)?)?
            .classifier)
    }

    /// Searches for the settings that make the held-out squared error of the 0 and 1 of classes small (that
    /// is the Brier score of uncalibrated scores), and makes a classifier with them. The search is the
    /// [quick](Level::Quick) one unless the level is set.
    ///
    /// # Errors
    /// Those of [`tune`](Self::tune) and [`ElmParams::fit_labeled`].
    pub fn tune_classifier<L: Ord + Clone>(
        &self,
        rows: &LabeledRows<'_, A, L>,
    ) -> Result<TunedClassifier<A, L>> {
        rows.check_several()?;
        let targets = Targets::new(rows);
        let search = self.clone().or_level(Level::Quick);
        let tuned = search.tune(&targets.dataset(rows)?)?;
        Ok(TunedClassifier {
            classifier: tuned.params.fit_labeled(rows)?,
            params: tuned.params,
            best: tuned.best,
            trials: tuned.trials,
        })
    }
}

/// What a network for classes is fitted to.
struct Targets<A: Scalar> {
    matrix: Array2<A>,
    weights: Option<Array1<A>>,
}

impl<A: Scalar> Targets<A> {
    fn new<L: Ord + Clone>(rows: &LabeledRows<'_, A, L>) -> Self {
        Self {
            matrix: rows.targets(),
            weights: rows.weights(),
        }
    }

    fn dataset<'a, L: Ord + Clone>(
        &'a self,
        rows: &'a LabeledRows<'_, A, L>,
    ) -> Result<Dataset<'a, A>> {
        let data = Dataset::of_views(rows.inputs(), self.matrix.view());
        match &self.weights {
            Some(weights) => data.with_weights(weights),
            None => Ok(data),
        }
    }
}
