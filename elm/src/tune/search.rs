//! The tuner's search: fits candidates, and decides which to try next.

use std::collections::HashMap;

use ndarray::{Array1, Array2, ArrayView2, Axis, Ix2};

use super::attempt::{Attempt, links_pay, neurons_pay, scale_pays, step_pays};
use super::rows::{chosen_rows, deviation};
use super::slopes::proportional;
use super::{Trial, Tuner};
use crate::cross_validation::check_several;
use crate::dataset::{Dataset, Rows, TargetDim};
use crate::error::{Error, Result};
use crate::scalar::Scalar;
use crate::solve::Ridge;
use crate::threads;

/// Neurons that the search uses as long as their number is not chosen.
const SEARCH_NEURONS: usize = 100;
/// Coarse steps of the scale: half a decade.
const COARSE: f64 = 0.5;
/// What a held-out error at a scale below the center counts more for, for each decade.
const PER_DECADE: f64 = 0.06;
/// Steps of the scale below this (in decades) make no difference worth a factorization.
const MIN_STEP: f64 = 0.1;
/// Factorizations that are kept for choosing the number of neurons, where that is to be chosen.
const FOR_NEURONS: usize = 9;
/// Rows at which slopes are taken.
const SLOPE_ROWS: usize = 500;

/// What is tried: neurons, exponent of the scale, scales of inputs, direct links; numbers by their bits.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Setting {
    neurons: usize,
    exponent: u64,
    scales: Vec<u64>,
    links: bool,
}

/// A search under way.
pub(super) struct Search<'a, A: Scalar> {
    tuner: &'a Tuner<A>,
    x: Array2<A>,
    t: Array2<A>,
    /// Of the rows, all positive, where they have any.
    weights: Option<Array1<A>>,
    /// Standard deviation of each output, 1 for a constant one.
    spread: Vec<f64>,
    folds: Option<Vec<usize>>,
    attempts: Vec<Attempt>,
    /// Tried on other threads before it was known whether they would be wanted.
    ahead: HashMap<Setting, Result<Attempt>>,
    /// Index of the setting that the search stands at.
    current: usize,
    /// Bounds of the scale's exponent: beyond, every neuron is a straight line or a step.
    exponents: (f64, f64),
    /// Factorizations so far, and how many there may be for now.
    spent: usize,
    limit: usize,
    /// Where doubling ends.
    most: usize,
    /// Slopes along the inputs, where they were last looked at.
    steepness: Option<Vec<f64>>,
    /// Whether inputs reach the outputs directly where the search stands.
    links: bool,
}

impl<'a, A: Scalar> Search<'a, A> {
    /// `labels` has the fold of each row, where rows are held out in folds.
    pub(super) fn new<D: TargetDim>(
        tuner: &'a Tuner<A>,
        data: &Dataset<'_, A, D>,
        labels: Option<&[usize]>,
    ) -> Result<Self> {
        // Some rows, and weights that are not all 0.
        drop(Rows::new(data)?);
        let (x, t) = (data.inputs(), data.target_matrix());
        let chosen = chosen_rows(tuner, data);
        let select = |matrix: ArrayView2<'_, A>| match &chosen {
            Some(rows) => matrix.select(Axis(0), rows),
            None => matrix.to_owned(),
        };
        let weights = data.weights().map(|weights| match &chosen {
            Some(rows) => weights.select(Axis(0), rows),
            None => weights.to_owned(),
        });
        let folds = labels.map(|labels| match &chosen {
            Some(rows) => rows.iter().map(|&row| labels[row]).collect(),
            None => labels.to_vec(),
        });
        if let Some(folds) = &folds {
            check_several("groups", folds)?;
        }
        let most = tuner.most_neurons(x.nrows());
        let (x, t) = (select(x), select(t));
        // A weighted sum of standardized inputs has a deviation of about 1 at this scale.
        let center = -(x.ncols() as f64).log10() / 2.0;
        Ok(Self {
            tuner,
            spread: t
                .columns()
                .into_iter()
                .map(|column| deviation(column, weights.as_ref().map(|weights| weights.view())))
                .collect(),
            x,
            t,
            weights,
            folds,
            attempts: Vec::new(),
            ahead: HashMap::new(),
            current: 0,
            exponents: (center - 3.0 * COARSE, center + 3.0 * COARSE),
            spent: 0,
            limit: tuner.quick_budget(),
            most,
            steepness: None,
            links: tuner.base.direct_links(),
        })
    }

    /// The rows that the search looks at.
    fn data(&self) -> Result<Dataset<'_, A, Ix2>> {
        let data = Dataset::new(&self.x, &self.t)?;
        match &self.weights {
            Some(weights) => data.with_weights(weights),
            None => Ok(data),
        }
    }

    /// The best trial, and all.
    pub(super) fn finish(self) -> Result<(Trial, Vec<Trial>)> {
        let trials: Vec<Trial> = self.attempts.into_iter().map(|a| a.trial).collect();
        let best = trials.get(self.current).cloned();
        let best = best.ok_or(Error::NoConvergence {
            what: "the search for a weight scale",
        })?;
        Ok((best, trials))
    }

    pub(super) fn run(&mut self) -> Result<()> {
        let budget = self.tuner.quick_budget();
        let most = self.most;
        let neurons = self.tuner.neurons.unwrap_or(SEARCH_NEURONS.min(most));
        if self.tuner.neurons.is_none() {
            self.limit = budget - FOR_NEURONS.min(budget / 4);
        }
        let center = (self.exponents.0 + self.exponents.1) / 2.0;
        // From the middle outwards, so that a small budget is spent well.
        let exponents = [0, 1, -1, 2, -2, 3, -3].map(|step| center + COARSE * f64::from(step));
        self.look_ahead(exponents.map(|exponent| (neurons, exponent, Vec::new())));
        for exponent in exponents {
            self.move_if(neurons, exponent, &[], scale_pays)?;
        }
        self.refine_scale(COARSE / 2.0, MIN_STEP)?;
        if self.tuner.per_input && self.x.ncols() > 1 {
            self.follow_slopes()?;
            self.choose_input_scales()?;
        }
        self.limit = budget;
        if self.tuner.neurons.is_none() {
            self.choose_neurons(most)?;
        }
        // Last, as scales of inputs and more neurons do more where they do anything.
        if self.tuner.try_links && !self.links {
            self.link()?;
        }
        Ok(())
    }

    /// Links the inputs directly if that pays: what is linear in many inputs, or in columns of zeros
    /// and ones, a layer of some hundred neurons carries badly.
    fn link(&mut self) -> Result<()> {
        let Some(now) = self.now() else {
            return Ok(());
        };
        self.links = true;
        let exponent = now.scale.log10();
        self.links = self.move_if(now.neurons, exponent, &now.input_scales, links_pay)?;
        Ok(())
    }

    /// Doubles as long as that pays; once it does not, looks one doubling further.
    fn choose_neurons(&mut self, most: usize) -> Result<()> {
        let Some(start) = self.now() else {
            return Ok(());
        };
        let (mut neurons, mut misses) = (start.neurons, 0);
        // Two are tried in any case.
        let doubled = [2, 4].map(|times| (times * start.neurons).min(most));
        let exponent = start.scale.log10();
        self.look_ahead(doubled.map(|neurons| (neurons, exponent, start.input_scales.clone())));
        while neurons < most && misses < 2 {
            // What is left to the most is not worth a step of its own unless it is half as many again.
            if 3 * neurons > 2 * most {
                break;
            }
            neurons = (2 * neurons).min(most);
            let exponent = start.scale.log10();
            if self.move_if(neurons, exponent, &start.input_scales, neurons_pay)? {
                misses = 0;
            } else {
                misses += 1;
            }
        }
        if self.now().is_some_and(|now| now.neurons != start.neurons) {
            // More neurons can carry steeper ones. No finer: these factorizations are the dear ones.
            self.refine_scale(COARSE / 2.0, COARSE / 2.0)?;
        }
        Ok(())
    }

    /// The standard errors that scales of inputs have to win by beyond what other steps have to: each
    /// input's is one more parameter fitted to the rows, and leave-one-out does not leave a row out of
    /// that fit. (Of single inputs tens are tried, and the best of so many that change nothing looks
    /// better by two standard errors, however many rows there are.)
    fn overfitting_penalty(&self) -> f64 {
        10.0 * self.x.ncols() as f64 / self.x.nrows() as f64
    }

    /// Scales inputs by the slopes that the network has along them, and again, as long as that pays.
    fn follow_slopes(&mut self) -> Result<()> {
        const ROUNDS: usize = 4;
        let penalty = self.overfitting_penalty();
        for _ in 0..ROUNDS {
            let Some(now) = self.now().filter(|_| !self.is_spent()) else {
                break;
            };
            let Some(slopes) = self.slopes(&now)? else {
                break;
            };
            let mut moved = false;
            let exponent = now.scale.log10();
            let both = [1.0, 0.5].map(|power| proportional(&slopes, power));
            let both: Vec<_> = both.into_iter().flatten().collect();
            let ahead = both.iter().cloned();
            self.look_ahead(ahead.map(|scales| (now.neurons, exponent, scales)));
            for scales in both {
                moved |= self.move_if(now.neurons, exponent, &scales, |new, old| {
                    new.improves_on(old, 1.0 + penalty)
                })?;
            }
            if !moved {
                break;
            }
            self.refine_scale(COARSE / 2.0, MIN_STEP)?;
        }
        Ok(())
    }

    /// For each input the root mean square slope of the trial's network along it, in what the network
    /// makes of the input; nothing where there are none.
    fn slopes(&mut self, trial: &Trial) -> Result<Option<Vec<f64>>> {
        self.spent += 1;
        let model = self.tuner.params(trial).fit_dataset(&self.data()?)?;
        let every = self.x.nrows().div_ceil(SLOPE_ROWS).max(1);
        let rows = self.x.slice(ndarray::s![..;every, ..]).to_owned();
        let mut squares = vec![0.0; self.x.ncols()];
        for (gradient, spread) in model.gradients(&rows).zip(&self.spread) {
            for (square, slopes) in squares.iter_mut().zip(gradient.columns()) {
                *square += slopes
                    .iter()
                    .map(|slope| (slope.as_f64() / spread).powi(2))
                    .sum::<f64>();
            }
        }
        let slopes: Vec<f64> = squares.into_iter().map(f64::sqrt).collect();
        let usable = slopes.iter().all(|s| s.is_finite()) && slopes.iter().any(|s| *s > 0.0);
        self.steepness = usable.then_some(slopes);
        Ok(self.steepness.clone())
    }

    fn refine_scale(&mut self, mut step: f64, finest: f64) -> Result<()> {
        while step >= finest && !self.is_spent() {
            let mut moved = false;
            let Some(now) = self.now() else {
                return Ok(());
            };
            let within = self.exponents.0..=self.exponents.1;
            let exponents = [1.0, -1.0].map(|direction| now.scale.log10() + direction * step);
            let exponents = exponents.into_iter().filter(|e| within.contains(e));
            let exponents: Vec<f64> = exponents.collect();
            let ahead = exponents.iter();
            self.look_ahead(ahead.map(|&e| (now.neurons, e, now.input_scales.clone())));
            for exponent in exponents {
                if self.move_if(now.neurons, exponent, &now.input_scales, step_pays)? {
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

    /// Coordinate by coordinate, the steepest first, by a factor that shrinks once no input moves.
    fn choose_input_scales(&mut self) -> Result<()> {
        let penalty = self.overfitting_penalty();
        // The budget may end before the inputs do.
        let mut order: Vec<usize> = (0..self.x.ncols()).collect();
        if let Some(slopes) = &self.steepness {
            order.sort_by(|&a, &b| slopes[b].total_cmp(&slopes[a]));
        }
        let mut step = 2.0 * COARSE;
        while step >= MIN_STEP && !self.is_spent() {
            let mut moved = false;
            for (place, &input) in order.iter().enumerate() {
                for direction in [-1.0, 1.0] {
                    let Some(now) = self.now() else {
                        return Ok(());
                    };
                    let columns = self.x.ncols();
                    let turned = |input: usize, direction: f64| {
                        let mut scales = now.input_scales.clone();
                        scales.resize(columns, 1.0);
                        scales[input] *= 10.0_f64.powf(direction * step);
                        scales
                    };
                    let exponent = now.scale.log10();
                    let scales = turned(input, direction);
                    if !self.is_known(now.neurons, exponent, &scales) {
                        // As if none of them paid, which is so of most.
                        let next = order[place..].iter().flat_map(|&i| [(i, -1.0), (i, 1.0)]);
                        let next = next.skip(usize::from(direction > 0.0));
                        let next = next.take(threads::current_threads());
                        let next = next.map(|(i, d)| (now.neurons, exponent, turned(i, d)));
                        self.look_ahead(next);
                    }
                    if self.move_if(now.neurons, exponent, &scales, |new, old| {
                        new.improves_on(old, 2.0 + penalty)
                    })? {
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

    fn is_spent(&self) -> bool {
        self.spent >= self.limit
    }

    /// Where the search stands.
    fn now(&self) -> Option<Trial> {
        self.current().map(|attempt| attempt.trial.clone())
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
        if self.is_spent() {
            return Ok(false);
        }
        self.spent += 1;
        let known = self.ahead.remove(&self.setting(neurons, exponent, scales));
        let attempt = match known {
            Some(attempt) => attempt?,
            None => self.attempt(neurons, exponent, scales)?,
        };
        let moves = self
            .current()
            .is_none_or(|current| better(&attempt, current));
        if moves {
            self.current = self.attempts.len();
        }
        self.attempts.push(attempt);
        Ok(moves)
    }

    fn setting(&self, neurons: usize, exponent: f64, scales: &[f64]) -> Setting {
        Setting {
            neurons,
            exponent: exponent.to_bits(),
            scales: scales.iter().map(|scale| scale.to_bits()).collect(),
            links: self.links,
        }
    }

    fn is_known(&self, neurons: usize, exponent: f64, scales: &[f64]) -> bool {
        let setting = self.setting(neurons, exponent, scales);
        self.ahead.contains_key(&setting)
    }

    /// Tries settings on several threads that [`move_if`](Self::move_if) may be about to try: what it finds
    /// is not changed, nor what counts as spent.
    fn look_ahead(&mut self, settings: impl IntoIterator<Item = (usize, f64, Vec<f64>)>) {
        if threads::current_threads() == 1 {
            return;
        }
        self.ahead.clear();
        let left = self.limit.saturating_sub(self.spent);
        let settings: Vec<_> = settings.into_iter().take(left).collect();
        let search = &*self;
        let tried = threads::map(settings, |(neurons, exponent, scales)| {
            let setting = search.setting(neurons, exponent, &scales);
            (setting, search.attempt(neurons, exponent, &scales))
        });
        self.ahead = tried.into_iter().collect();
    }

    /// What a score counts for at a scale, over what it is: small scales make networks that are
    /// nearly polynomials, with large output weights that cancel among the rows and nowhere else.
    fn price(&self, scale: f64) -> f64 {
        let center = (self.exponents.0 + self.exponents.1) / 2.0;
        (1.0 + PER_DECADE).powf((center - scale.log10()).max(0.0))
    }

    fn attempt(&self, neurons: usize, exponent: f64, scales: &[f64]) -> Result<Attempt> {
        let scale = 10.0_f64.powf(exponent);
        let mut trial = Trial {
            neurons,
            scale,
            input_scales: scales.to_vec(),
            direct_links: self.links,
            score: f64::INFINITY,
        };
        let validator = self.tuner.params(&trial).validator(&self.data()?)?;
        let ridge = Ridge::leave_one_out();
        let lambda = match &self.folds {
            Some(folds) => validator.select_lambda_by_folds(folds, ridge),
            None => validator.select_lambda(ridge),
        };
        let held_out = lambda.and_then(|lambda| match &self.folds {
            Some(folds) => validator.k_fold(folds, &lambda),
            None => validator.leave_one_out(&lambda),
        });
        let held_out = match held_out {
            Ok(held_out) => held_out,
            // A row or fold that cannot be left out, as of a single one: any setting is as good.
            Err(Error::Undetermined { .. }) => {
                return Ok(Attempt {
                    trial,
                    squares: Vec::new(),
                    price: 1.0,
                });
            }
            Err(error) => return Err(error),
        };
        let outputs = self.spread.len() as f64;
        let mut squares: Vec<f64> = held_out
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
        if let Some(weights) = &self.weights {
            let mean = weights.iter().map(|w| w.as_f64()).sum::<f64>() / weights.len() as f64;
            for (square, weight) in squares.iter_mut().zip(weights) {
                *square *= weight.as_f64() / mean;
            }
        }
        trial.score = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let price = self.price(scale);
        Ok(Attempt {
            trial,
            squares,
            price,
        })
    }
}
