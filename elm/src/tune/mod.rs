//! Chooses the scale of the random weights, the number of neurons and the regularization.
//!
//! What decides how good an extreme learning machine is, is the scale of its random weights: too
//! small and every neuron is a straight line, too large and every neuron is a step. It cannot be
//! had from a formula, but it can be had from held-out errors, which cost one factorization each
//! (see [`cross_validation`](crate::cross_validation)). At the [quick level](Level::Quick) a [`Tuner`]
//! searches within a budget of them:
//!
//! 1. a coarse grid of scales, a factor of $\sqrt{10}$ apart, then smaller and smaller steps, with the
//!    neurons given or a hundred;
//! 2. if wanted, a scale for each input: all at once, in proportion to the slopes that the network
//!    found so far has along them (as in recursive feature machines: Radhakrishnan, Beaglehole,
//!    Pandit and Belkin, Science 383, 2024), a few times over, so that inputs that do not matter
//!    shrink however many they are; then one after the other, the steepest first, while the budget lasts;
//! 3. unless it is given, the number of neurons: doubled as long as that pays, and the scale once
//!    more;
//! 4. with `auto`, direct links from the inputs to the outputs, if they pay.
//!
//! So as not to follow noise, a step pays only if the held-out errors fall by more than one standard
//! error of their difference, row by row: a small step of the scale by more than half of one, a large
//! one by more than one and a half, and a scale of a single input, of which many are tried, by more
//! than two. Per-input scales must win by a further `10 * inputs / rows` standard errors, or they would
//! fit noise when rows are few.
//!
//! An error at a scale below the one that the search begins at counts 6 % more for each decade: networks
//! that are nearly polynomials have large output weights, which cancel among the rows and nowhere else.
//!
//! At the [full level](Level::Full), which is that of `auto` but for classes, neurons also see
//! [ramps](crate::Ramps) along the inputs, with a scale for each input and ramp by the slopes of the
//! network before, in rounds. Within a round scale and strength are chosen by generalized
//! cross-validation; the number of rounds, and whether there are ramps, by errors of rows that neither
//! weights nor slopes have seen, held to the [bounds](crate::bounds) of the others: one round and
//! ramps, unless another choice is surely better. The fit to all rows begins with half of the usual
//! neurons, and of many rows is made once more with slopes of its own, and kept where that is better. Neurons
//! are doubled, up to twice the usual number, where that takes a hundredth off the squared error of rows left
//! out, beyond the usual number two; else they are halved while that costs no more than one. Where the
//! held-out error is below a fifth of the targets' deviation the quick search is made as well, and the fit of
//! the smaller error of rows left out is kept.
//!
//! A trial looks at 2000 rows at most. At the quick level nearly all trials of `auto` are of a hundred
//! neurons, some ten milliseconds each; at most nine are of more.
//!
//! The regularization is chosen by leave-one-out within each trial. Every trial, and with it the
//! way to the choice, is in [`Tuned::trials`]. Because the error of the winner was used to choose
//! it, it is a little too good; judge the model on rows that the tuner has not seen.
//!
//! ```
//! use elm::{Dataset, ElmParams};
//! use ndarray::{Array1, Axis};
//!
//! let x = Array1::linspace(-10.0, 10.0, 200).insert_axis(Axis(1));
//! let t = x.column(0).mapv(|x: f64| x.sin() / x);
//! let tuned = ElmParams::auto().tune(&Dataset::new(&x, &t)?)?;
//! println!("{} neurons, scale {:.2}", tuned.best.neurons, tuned.best.scale);
//! assert!(tuned.best.score < 1e-3);
//! let y = tuned.model.predict(&x)?;
//! # assert_eq!(y.dim(), 200);
//! # Ok::<(), elm::Error>(())
//! ```

mod attempt;
mod full;
mod late;
mod metric;
mod rows;
mod search;
mod slopes;

use ndarray::Ix2;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::activation::Activation;
use crate::dataset::{Dataset, Inputs, RepeatedRows, Rows, TargetDim, Targets};
use crate::error::{Error, Result};
use crate::feature_map::Biases;
use crate::model::ElmParams;
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::Ridge;
use search::Search;

/// The held-out error that a [`Tuner`] makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Criterion {
    /// Exact leave-one-out; of rows that have groups, leave-one-group-out.
    #[default]
    LeaveOneOut,
    /// Exact k-fold with this many folds: less optimistic where neighbouring rows are near-copies
    /// of each other.
    KFold(usize),
    /// Exact k-fold with this many blocks of neighbouring rows, in their order: for series in time, where
    /// a row says what the next one is.
    Blocks(usize),
}

/// How much a [`Tuner`] looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Level {
    /// The scale of the weights and, where wanted, of each input, neurons and direct links: step by
    /// step, each by exact held-out errors.
    Quick,
    /// Ramps along the inputs, and a scale for each, learned from slopes in rounds whose number is chosen on
    /// rows that the slopes have not seen. For [`auto`](ElmParams::auto) and rows that may be held out one by
    /// one: where neurons are [given](ElmParams::tuner), rows have [groups](Dataset::with_groups), folds or a
    /// [budget](Tuner::with_budget) are asked for, and where rows are fewer than 300, the search is that of
    /// [`Quick`](Self::Quick).
    Full,
}

/// The held-out error, relative to the targets' deviation, below which targets are a smooth function with
/// little noise, of which the exact search may make far more: it is made as well, and the better fit is kept.
const SMOOTH: f64 = 0.2;

/// One setting that was tried.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Trial {
    /// Number of hidden neurons.
    pub neurons: usize,
    /// Scale of the random weights.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::numbers::finite"))]
    pub scale: f64,
    /// Scale of each input on top of it; empty where all are 1.
    pub input_scales: Vec<f64>,
    /// Whether inputs reach the outputs directly, too.
    pub direct_links: bool,
    /// Held-out RMSE relative to the targets' standard deviation, root mean square over outputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::numbers::score"))]
    pub score: f64,
}

/// What a [`Tuner`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuned<A: Scalar, D: TargetDim = Ix2> {
    /// The network with the best setting, fitted to all rows.
    pub model: Elm<A, D>,
    /// The settings of that network, to fit others alike.
    pub params: ElmParams<A>,
    /// The best trial; of the [full](Level::Full) search with the settings of the network and the held-out
    /// error of a smaller one, by which they were chosen.
    pub best: Trial,
    /// All trials in the order they were made.
    pub trials: Vec<Trial>,
}

/// Chooses settings by held-out errors; made by [`ElmParams::auto`] or [`ElmParams::tuner`].
///
/// # Parameters
///
/// | name | default | purpose | range |
/// |---|---|---|---|
/// | [`level`](Self::with_level) | quick; for `auto` full, quick for classes | how much the search looks for | |
/// | [`budget`](Self::with_budget) | 24; 60 for `auto` | factorizations to spend on the quick search | at least 1 |
/// | [`criterion`](Self::with_criterion) | leave-one-out | the error that is made small | at least 2 folds |
/// | [`max_neurons`](Self::with_max_neurons) | 1000, fewer above 4000 rows; at the full level twice these where they pay | neurons at most when the number is not given | at least 1 |
/// | [`search_rows`](Self::with_search_rows) | 2000 | rows that the search looks at, drawn at random | at least 2 |
/// | [`per_input`](Self::with_per_input) | off; on for `auto` | whether each input gets a scale of its own | |
#[derive(Debug, Clone, PartialEq)]
pub struct Tuner<A: Scalar> {
    base: ElmParams<A>,
    /// `None` to choose.
    neurons: Option<usize>,
    /// `None` for full where everything is chosen, and quick for classes.
    level: Option<Level>,
    /// `None` for that of the level.
    budget: Option<usize>,
    criterion: Criterion,
    /// `None` for a number by the rows.
    max_neurons: Option<usize>,
    search_rows: usize,
    per_input: bool,
    /// Whether direct links are tried.
    try_links: bool,
}

impl<A: Scalar> ElmParams<A> {
    /// Chooses everything: neurons, weight scale, a scale per input, direct links and regularization, for
    /// tanh neurons with their biases on the data; from 300 rows on also ramps along the inputs, and a scale
    /// for each of them ([`quick`](Tuner::quick) does not).
    #[must_use]
    pub fn auto() -> Tuner<A> {
        let base = Self::new(1)
            .with_activation(Activation::Tanh)
            .with_biases(Biases::AtTrainingRows);
        Tuner {
            neurons: None,
            per_input: true,
            try_links: true,
            ..base.tuner()
        }
    }

    /// Chooses weight scale and regularization, and keeps all other settings.
    #[must_use]
    pub fn tuner(self) -> Tuner<A> {
        Tuner {
            neurons: Some(self.neurons()),
            base: self,
            level: None,
            budget: None,
            criterion: Criterion::default(),
            max_neurons: None,
            search_rows: 2000,
            per_input: false,
            try_links: false,
        }
    }
}

impl<A: Scalar> Tuner<A> {
    /// How many factorizations the search may spend; the final fit comes on top.
    #[must_use]
    pub fn with_budget(mut self, factorizations: usize) -> Self {
        self.budget = Some(factorizations);
        self
    }

    /// How many factorizations the search may spend, where that is set.
    #[must_use]
    pub fn budget(&self) -> Option<usize> {
        self.budget
    }

    /// How much the search looks for.
    #[must_use]
    pub fn with_level(mut self, level: Level) -> Self {
        self.level = Some(level);
        self
    }

    /// How much the search looks for, where that is set.
    #[must_use]
    pub fn level(&self) -> Option<Level> {
        self.level
    }

    /// The search of [`Level::Full`].
    #[must_use]
    pub fn full(self) -> Self {
        self.with_level(Level::Full)
    }

    /// The search of [`Level::Quick`]: smaller networks of inputs alone.
    #[must_use]
    pub fn quick(self) -> Self {
        self.with_level(Level::Quick)
    }

    /// With a level, this one unless another is set.
    pub(crate) fn or_level(mut self, level: Level) -> Self {
        self.level.get_or_insert(level);
        self
    }

    /// Factorizations of the quick search.
    fn quick_budget(&self) -> usize {
        self.budget
            .unwrap_or(if self.neurons.is_none() { 60 } else { 24 })
    }

    /// The held-out error that is made small.
    #[must_use]
    #[doc(alias = "cv")]
    pub fn with_criterion(mut self, criterion: Criterion) -> Self {
        self.criterion = criterion;
        self
    }

    /// The held-out error that is made small.
    #[must_use]
    pub fn criterion(&self) -> Criterion {
        self.criterion
    }

    /// The largest number of neurons that is chosen. Unless it is set, 1000; or, where there are more
    /// than 4000 rows, as many as keep rows times neurons squared, which the final fit's time goes
    /// by, at 4e9, but at least 200; at the [full level](Level::Full) up to twice as many where those pay.
    #[must_use]
    pub fn with_max_neurons(mut self, neurons: usize) -> Self {
        self.max_neurons = Some(neurons);
        self
    }

    /// The largest number of neurons that is chosen, where it is set.
    #[must_use]
    pub fn max_neurons(&self) -> Option<usize> {
        self.max_neurons
    }

    /// How many rows the search looks at. The final fit uses all.
    #[must_use]
    pub fn with_search_rows(mut self, rows: usize) -> Self {
        self.search_rows = rows;
        self
    }

    /// How many rows the search looks at.
    #[must_use]
    pub fn search_rows(&self) -> usize {
        self.search_rows
    }

    /// Whether each input gets a scale of its own.
    #[must_use]
    pub fn with_per_input(mut self, per_input: bool) -> Self {
        self.per_input = per_input;
        self
    }

    /// Whether each input gets a scale of its own.
    #[must_use]
    pub fn per_input(&self) -> bool {
        self.per_input
    }

    /// Seeds the random layer, and the choice of rows and folds for the search.
    #[must_use]
    #[doc(alias = "random_state")]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.base = self.base.with_seed(seed);
        self
    }

    /// The seed of the random layer and of the search.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.base.seed()
    }

    /// Searches, and fits the best setting to all rows: [`tune`](Self::tune) without the path.
    ///
    /// # Errors
    /// Those of [`Dataset::new`] and [`tune`](Self::tune).
    pub fn fit<X, T>(&self, x: &X, t: &T) -> Result<Elm<A, T::Dim>>
    where
        X: Inputs<A> + ?Sized,
        T: Targets<A> + ?Sized,
    {
        Ok(self.tune(&Dataset::new(x, t)?)?.model)
    }

    /// Searches, and fits the best setting to all rows. Whatever solver was set, ridge by leave-one-out
    /// is used.
    ///
    /// Weights of rows count in errors as they do in fits; a row of weight 2 is two rows where all are whole
    /// multiples, of at most 20, of the smallest, and the search looks at all of these. Rows of one group are
    /// held out together, by both [criteria](Criterion).
    ///
    /// # Errors
    /// [`Error::Parameter`] for a setting out of range, and those of [`ElmParams::fit_dataset`].
    #[doc(alias = "GridSearchCV")]
    pub fn tune<D: TargetDim>(&self, data: &Dataset<'_, A, D>) -> Result<Tuned<A, D>> {
        self.check()?;
        match RepeatedRows::new(data, self.search_rows) {
            Some(rows) => self.tune_rows(&rows.data()),
            None => self.tune_rows(data),
        }
    }

    fn tune_rows<D: TargetDim>(&self, data: &Dataset<'_, A, D>) -> Result<Tuned<A, D>> {
        let Some(choice) = self.full_search(data)? else {
            return self.quick_search(data);
        };
        let smooth = choice.best.score < SMOOTH;
        let (params, model) = late::fit(choice.params, self.max_neurons, data)?;
        let best = Trial {
            neurons: params.neurons(),
            scale: params.scale(),
            input_scales: params.input_scales().to_vec(),
            ..choice.best
        };
        let full = Tuned {
            model,
            params,
            best,
            trials: choice.trials,
        };
        if !smooth {
            return Ok(full);
        }
        let quick = self.quick_search(data)?;
        let quick_wins = late::left_out(&quick.model, data) < late::left_out(&full.model, data);
        let (mut found, other) = if quick_wins {
            (quick, full)
        } else {
            (full, quick)
        };
        found.trials.extend(other.trials);
        Ok(found)
    }

    fn quick_search<D: TargetDim>(&self, data: &Dataset<'_, A, D>) -> Result<Tuned<A, D>> {
        let folds = rows::folds(self, data)?;
        let mut search = Search::new(self, data, folds.as_deref())?;
        search.run()?;
        let (best, trials) = search.finish()?;
        let params = self.params(&best);
        let model = match &folds {
            Some(folds) => params.fit_dataset(&data.in_groups(folds))?,
            None => params.fit_dataset(data)?,
        };
        Ok(Tuned {
            model,
            params,
            best,
            trials,
        })
    }

    /// What the full search finds, where it is for these rows.
    fn full_search<D: TargetDim>(
        &self,
        data: &Dataset<'_, A, D>,
    ) -> Result<Option<full::Choice<A>>> {
        let rows = Rows::new(data)?.x().nrows().min(self.search_rows);
        let exchangeable = data.groups().is_none() && self.criterion == Criterion::LeaveOneOut;
        let quick = self.level == Some(Level::Quick) || self.budget.is_some();
        // Neurons of its own kinds are searched for step by step.
        let given = self.neurons.is_some();
        if quick || given || !exchangeable || rows < full::FEWEST_ROWS {
            return Ok(None);
        }
        full::search(self, data)
    }

    /// Where doubling ends for a problem of this many rows.
    fn most_neurons(&self, rows: usize) -> usize {
        const WORK: f64 = 4e9;
        let with_work_limit = || (WORK / rows as f64).sqrt().clamp(200.0, 1000.0) as usize;
        self.max_neurons.unwrap_or_else(with_work_limit)
    }

    fn check(&self) -> Result<()> {
        let parameter = |name, value: usize, expected| {
            Err(Error::Parameter {
                name,
                value: value as f64,
                expected,
            })
        };
        match self {
            Self {
                budget: Some(0), ..
            } => parameter("budget", 0, "at least 1"),
            Self {
                max_neurons: Some(0),
                ..
            } => parameter("max_neurons", 0, "at least 1"),
            Self {
                search_rows: rows @ (0 | 1),
                ..
            } => parameter("search_rows", *rows, "at least 2"),
            Self {
                criterion: Criterion::KFold(folds @ (0 | 1)) | Criterion::Blocks(folds @ (0 | 1)),
                ..
            } => parameter("folds", *folds, "at least 2"),
            Self {
                neurons: Some(0), ..
            } => parameter("neurons", 0, "at least 1"),
            _ => Ok(()),
        }
    }

    fn params(&self, trial: &Trial) -> ElmParams<A> {
        self.base
            .clone()
            .with_neurons(trial.neurons)
            .with_scale(trial.scale)
            .with_input_scales(trial.input_scales.clone())
            .with_direct_links(trial.direct_links)
            .with_solver(Ridge::leave_one_out())
    }
}
