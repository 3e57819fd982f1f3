//! Choosing the scale of the random weights, the number of neurons and the regularisation.
//!
//! What decides how good an extreme learning machine is, is the scale of its random weights: too
//! small and every neuron is a straight line, too large and every neuron is a step. It cannot be
//! had from a formula, but it can be had from held-out errors, which cost one factorisation each
//! (see [`validate`](crate::validate)). A [`Tuner`] searches within a budget of them:
//!
//! 1. a coarse grid of scales, a factor of $\sqrt{10}$ apart, at a moderate number of neurons;
//! 2. unless it is given, the number of neurons: doubled as long as that pays;
//! 3. the scale again, in smaller and smaller steps;
//! 4. if wanted, a scale for each input, one after the other: inputs that do not matter shrink.
//!
//! In 2 and 4, where a search could follow noise, a step pays only if the held-out errors fall by
//! more than one standard error of their difference, row by row.
//!
//! The regularisation is chosen by leave-one-out within each trial. Every trial, and with it the
//! way to the choice, is in [`Tuned::trials`]. Because the error of the winner was used to choose
//! it, it is a little too good; judge the model on rows that the tuner has not seen.
//!
//! ```
//! use elm::ElmParams;
//! use ndarray::{Array1, Axis};
//!
//! let x = Array1::linspace(-10.0, 10.0, 200).insert_axis(Axis(1));
//! let t = x.mapv(|x: f64| x.sin() / x);
//! let tuned = ElmParams::auto().tune(&x, &t)?;
//! println!("{} neurons, scale {:.2}", tuned.best.neurons, tuned.best.scale);
//! assert!(tuned.best.score < 1e-3);
//! let y = tuned.model.predict(&x)?;
//! # assert_eq!(y.dim(), (200, 1));
//! # Ok::<(), elm::Error>(())
//! ```

use ndarray::{Array2, ArrayRef2, ArrayView1, ArrayView2, Axis};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::activation::Activation;
use crate::error::{Error, Result};
use crate::hidden::Biases;
use crate::model::{ElmParams, Targets};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::{Ridge, check_length, check_matrix};
use crate::validate::assign_folds;

/// The held-out error that a [`Tuner`] makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Criterion {
    /// Exact leave-one-out.
    #[default]
    LeaveOneOut,
    /// Exact k-fold with this many folds: less optimistic where neighbouring rows are near-copies
    /// of each other.
    KFold(usize),
}

/// One setting that was tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Number of hidden neurons.
    pub neurons: usize,
    /// Scale of the random weights.
    pub scale: f64,
    /// Scale of each input on top of it; empty where all are 1.
    pub input_scales: Vec<f64>,
    /// Held-out RMSE relative to the targets' standard deviation, root mean square over outputs.
    pub score: f64,
}

/// What a [`Tuner`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuned<A: Scalar> {
    /// The network with the best setting, fitted to all rows.
    pub model: Elm<A>,
    /// The settings of that network, to fit others alike.
    pub params: ElmParams<A>,
    /// The best trial.
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
/// | [`budget`](Self::budget) | 24; 60 for `auto` | factorisations to spend on the search | at least 1 |
/// | [`criterion`](Self::criterion) | leave-one-out | the error that is made small | at least 2 folds |
/// | [`max_neurons`](Self::max_neurons) | 1000 | where doubling ends when the number is not given | at least 1 |
/// | [`search_rows`](Self::search_rows) | 3000 | rows that the search looks at, drawn at random | at least 2 |
/// | [`per_input`](Self::per_input) | off; on for `auto` | whether each input gets a scale of its own | |
#[derive(Debug, Clone, PartialEq)]
pub struct Tuner<A: Scalar> {
    base: ElmParams<A>,
    /// `None` to choose.
    neurons: Option<usize>,
    budget: usize,
    criterion: Criterion,
    max_neurons: usize,
    search_rows: usize,
    per_input: bool,
}

impl<A: Scalar> ElmParams<A> {
    /// Chooses everything: neurons, weight scale, a scale per input and regularisation, for tanh
    /// neurons with their biases on the data, within 60 factorisations.
    #[must_use]
    pub fn auto() -> Tuner<A> {
        let base = Self::new(1)
            .activation(Activation::Tanh)
            .biases(Biases::OnData);
        Tuner {
            neurons: None,
            per_input: true,
            budget: 60,
            ..base.tuner()
        }
    }

    /// Chooses weight scale and regularisation, and keeps all other settings.
    #[must_use]
    pub fn tuner(self) -> Tuner<A> {
        Tuner {
            neurons: Some(self.neurons()),
            base: self,
            budget: 24,
            criterion: Criterion::default(),
            max_neurons: 1000,
            search_rows: 3000,
            per_input: false,
        }
    }
}

/// Neurons that the coarse search uses when the number is not given.
const MODERATE: usize = 100;
/// Relative gain below which more neurons, or another scale for an input, do not pay.
const WORTHWHILE: f64 = 0.01;
/// Coarse steps of the scale: half a decade.
const COARSE: f64 = 0.5;
/// Steps of the scale below this (in decades) make no difference worth a factorisation.
const FINEST: f64 = 0.1;

impl<A: Scalar> Tuner<A> {
    /// How many factorisations the search may spend; the final fit comes on top.
    #[must_use]
    pub fn budget(mut self, factorisations: usize) -> Self {
        self.budget = factorisations;
        self
    }

    /// The held-out error that is made small.
    #[must_use]
    pub fn criterion(mut self, criterion: Criterion) -> Self {
        self.criterion = criterion;
        self
    }

    /// The largest number of neurons that is chosen.
    #[must_use]
    pub fn max_neurons(mut self, neurons: usize) -> Self {
        self.max_neurons = neurons;
        self
    }

    /// How many rows the search looks at. The final fit uses all.
    #[must_use]
    pub fn search_rows(mut self, rows: usize) -> Self {
        self.search_rows = rows;
        self
    }

    /// Whether each input gets a scale of its own. Costs two factorisations per input and round,
    /// so set the [`budget`](Self::budget) to match.
    #[must_use]
    pub fn per_input(mut self, per_input: bool) -> Self {
        self.per_input = per_input;
        self
    }

    /// Seeds the random layer, and the choice of rows and folds for the search.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.base = self.base.seed(seed);
        self
    }

    /// Searches, and fits the best setting to all rows: [`tune`](Self::tune) without the path.
    ///
    /// # Errors
    /// Those of [`tune`](Self::tune).
    pub fn fit<T: Targets<A>>(&self, x: &ArrayRef2<A>, t: &T) -> Result<Elm<A>> {
        Ok(self.tune(x, t)?.model)
    }

    /// Searches, and fits the best setting to all rows.
    ///
    /// `x` has shape (rows, inputs); `t` has shape (rows, outputs), or (rows) for one output.
    /// Whatever solver was set, ridge by leave-one-out is used.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a setting out of range, and those of [`CheckedParams::fit`].
    ///
    /// [`CheckedParams::fit`]: crate::CheckedParams::fit
    pub fn tune<T: Targets<A>>(&self, x: &ArrayRef2<A>, t: &T) -> Result<Tuned<A>> {
        self.check()?;
        let (x, t) = (x.view(), t.as_matrix());
        check_matrix("inputs", x)?;
        check_matrix("targets", t)?;
        check_length("rows of targets", t.nrows(), x.nrows())?;
        let mut search = Search::new(self, x, t)?;
        search.run()?;
        let Some(best) = search.current().map(|attempt| attempt.trial.clone()) else {
            return Err(Error::NoConvergence {
                what: "the search for a weight scale",
            });
        };
        let trials = search
            .attempts
            .into_iter()
            .map(|attempt| attempt.trial)
            .collect();
        let params = self.params(&best);
        let model = params.fit(&x, &t)?;
        Ok(Tuned {
            model,
            params,
            best,
            trials,
        })
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
            Self { budget: 0, .. } => parameter("budget", 0, "at least 1"),
            Self { max_neurons: 0, .. } => parameter("max_neurons", 0, "at least 1"),
            Self {
                search_rows: rows @ (0 | 1),
                ..
            } => parameter("search_rows", *rows, "at least 2"),
            Self {
                criterion: Criterion::KFold(folds @ (0 | 1)),
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
            .scale(trial.scale)
            .input_scales(trial.input_scales.clone())
            .solver(Ridge::leave_one_out())
    }
}

/// A trial, with the held-out error of each row.
struct Attempt {
    trial: Trial,
    /// Squared, relative to each output's variance, mean over outputs.
    squares: Vec<f64>,
}

impl Attempt {
    /// Whether the errors are smaller by more than one standard error of the difference.
    fn beats(&self, other: &Self) -> bool {
        if self.trial.score >= other.trial.score * (1.0 - WORTHWHILE) {
            return false;
        }
        let gains = || {
            other
                .squares
                .iter()
                .zip(&self.squares)
                .map(|(old, new)| old - new)
        };
        let rows = self.squares.len() as f64;
        let mean = gains().sum::<f64>() / rows;
        let variance = gains().map(|gain| (gain - mean).powi(2)).sum::<f64>() / rows;
        mean > (variance / rows).sqrt()
    }
}

/// A search under way.
struct Search<'a, A: Scalar> {
    tuner: &'a Tuner<A>,
    x: Array2<A>,
    t: Array2<A>,
    /// Standard deviation of each output, 1 for a constant one.
    spread: Vec<f64>,
    folds: Option<Vec<usize>>,
    attempts: Vec<Attempt>,
    /// Index of the setting that the search stands at.
    current: usize,
    /// Bounds of the scale's exponent: beyond, every neuron is a straight line or a step.
    exponents: (f64, f64),
}

impl<'a, A: Scalar> Search<'a, A> {
    fn new(tuner: &'a Tuner<A>, x: ArrayView2<'_, A>, t: ArrayView2<'_, A>) -> Result<Self> {
        let rows = tuner.search_rows.min(x.nrows());
        let (x, t) = if rows < x.nrows() {
            let mut random = ChaCha8Rng::seed_from_u64(tuner.base.get_seed());
            random.set_stream(3);
            let mut chosen = index::sample(&mut random, x.nrows(), rows).into_vec();
            chosen.sort_unstable();
            (x.select(Axis(0), &chosen), t.select(Axis(0), &chosen))
        } else {
            (x.to_owned(), t.to_owned())
        };
        let folds = match tuner.criterion {
            Criterion::LeaveOneOut => None,
            Criterion::KFold(folds) => Some(assign_folds(rows, folds, tuner.base.get_seed())?),
        };
        // A weighted sum of standardised inputs has a deviation of about 1 at this scale.
        let centre = -(x.ncols() as f64).log10() / 2.0;
        Ok(Self {
            tuner,
            spread: t.columns().into_iter().map(deviation).collect(),
            x,
            t,
            folds,
            attempts: Vec::new(),
            current: 0,
            exponents: (centre - 3.0 * COARSE, centre + 3.0 * COARSE),
        })
    }

    fn run(&mut self) -> Result<()> {
        let most = self.tuner.max_neurons.min(self.x.nrows()).max(1);
        let neurons = self.tuner.neurons.unwrap_or(MODERATE.min(most));
        let centre = (self.exponents.0 + self.exponents.1) / 2.0;
        // From the middle outwards, so that a small budget is spent well.
        for step in [0, 1, -1, 2, -2, 3, -3] {
            let exponent = centre + COARSE * f64::from(step);
            self.move_if(neurons, exponent, &[], |new, old| {
                new.trial.score < old.trial.score
            })?;
        }
        if self.tuner.neurons.is_none() {
            self.choose_neurons(most)?;
        }
        self.refine_scale()?;
        if self.tuner.per_input {
            self.choose_input_scales()?;
        }
        Ok(())
    }

    /// Doubles as long as that pays.
    fn choose_neurons(&mut self, most: usize) -> Result<()> {
        while let Some(now) = self.current().map(|attempt| attempt.trial.clone()) {
            let neurons = (2 * now.neurons).min(most);
            let exponent = now.scale.log10();
            if neurons == now.neurons
                || !self.move_if(neurons, exponent, &now.input_scales, Attempt::beats)?
            {
                break;
            }
        }
        Ok(())
    }

    fn refine_scale(&mut self) -> Result<()> {
        let mut step = COARSE / 2.0;
        while step >= FINEST && !self.spent() {
            let mut moved = false;
            for direction in [1.0, -1.0] {
                let Some(now) = self.current().map(|attempt| attempt.trial.clone()) else {
                    return Ok(());
                };
                let exponent = now.scale.log10() + direction * step;
                if exponent < self.exponents.0 || exponent > self.exponents.1 {
                    continue;
                }
                let lower = |new: &Attempt, old: &Attempt| new.trial.score < old.trial.score;
                if self.move_if(now.neurons, exponent, &now.input_scales, lower)? {
                    moved = true;
                    break;
                }
            }
            if !moved {
                step /= 2.0;
            }
        }
        Ok(())
    }

    /// Coordinate by coordinate, by a factor that shrinks once no input moves.
    fn choose_input_scales(&mut self) -> Result<()> {
        let mut step = 2.0 * COARSE;
        while step >= FINEST && !self.spent() {
            let mut moved = false;
            for input in 0..self.x.ncols() {
                for direction in [-1.0, 1.0] {
                    let Some(now) = self.current().map(|attempt| attempt.trial.clone()) else {
                        return Ok(());
                    };
                    let mut scales = now.input_scales.clone();
                    scales.resize(self.x.ncols(), 1.0);
                    scales[input] *= 10.0_f64.powf(direction * step);
                    let exponent = now.scale.log10();
                    if self.move_if(now.neurons, exponent, &scales, Attempt::beats)? {
                        moved = true;
                        break;
                    }
                }
            }
            if !moved {
                step /= 2.0;
            }
        }
        Ok(())
    }

    fn spent(&self) -> bool {
        self.attempts.len() >= self.tuner.budget
    }

    fn current(&self) -> Option<&Attempt> {
        self.attempts.get(self.current)
    }

    /// Tries a setting, records it, and moves there if it is better than where the search stands;
    /// returns whether it moved. Does nothing once the budget is spent.
    fn move_if(
        &mut self,
        neurons: usize,
        exponent: f64,
        scales: &[f64],
        better: impl Fn(&Attempt, &Attempt) -> bool,
    ) -> Result<bool> {
        if self.spent() {
            return Ok(false);
        }
        let scale = 10.0_f64.powf(exponent);
        let attempt = self.attempt(neurons, scale, scales)?;
        let moves = self
            .current()
            .is_none_or(|current| better(&attempt, current));
        if moves {
            self.current = self.attempts.len();
        }
        self.attempts.push(attempt);
        Ok(moves)
    }

    fn attempt(&self, neurons: usize, scale: f64, scales: &[f64]) -> Result<Attempt> {
        let mut trial = Trial {
            neurons,
            scale,
            input_scales: scales.to_vec(),
            score: f64::INFINITY,
        };
        let params = self.tuner.params(&trial).check()?;
        let validator = params.validator(self.x.view(), self.t.view())?;
        let lambda = validator.strengths(Ridge::leave_one_out())?;
        let held_out = match &self.folds {
            Some(folds) => validator.k_fold(folds, &lambda),
            None => validator.leave_one_out(&lambda),
        };
        let held_out = match held_out {
            Ok(held_out) => held_out,
            // A row or fold that cannot be left out, as of a single one: any setting is as good.
            Err(Error::Undetermined { .. }) => {
                return Ok(Attempt {
                    trial,
                    squares: Vec::new(),
                });
            }
            Err(error) => return Err(error),
        };
        let outputs = self.spread.len() as f64;
        let squares: Vec<f64> = held_out
            .residuals()
            .rows()
            .into_iter()
            .map(|row| {
                let relative = row
                    .iter()
                    .zip(&self.spread)
                    .map(|(e, s)| (e.as_f64() / s).powi(2));
                relative.sum::<f64>() / outputs
            })
            .collect();
        trial.score = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        Ok(Attempt { trial, squares })
    }
}

/// The standard deviation, or 1 where it is 0.
fn deviation<A: Scalar>(column: ArrayView1<'_, A>) -> f64 {
    let values: Vec<f64> = column.iter().map(|value| value.as_f64()).collect();
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if largest == 0.0 {
        return 1.0;
    }
    let count = values.len() as f64;
    let mean = values.iter().map(|v| v / largest).sum::<f64>() / count;
    let squares = values
        .iter()
        .map(|v| (v / largest - mean).powi(2))
        .sum::<f64>();
    let deviation = (squares / count).sqrt() * largest;
    if deviation > 0.0 { deviation } else { 1.0 }
}
