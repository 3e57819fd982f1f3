//! Few measurements: inputs and their scales by the evidence of networks of infinitely many neurons, then a
//! small network that is like the best of them.

use std::f64::consts::PI;

use elm::{Activation, Biases, ElmParams, Scaler};
use ndarray::{Array1, Array2, ArrayView2, Axis};
use rand::seq::index;

use super::censored::Censored;
use super::covariance::Smoothness;
use super::distill::Teacher;
use super::errors::{dark_noise, row_weights};
use super::finish::Finished;
use super::limit::{Limit, Rows, Setting};
use super::outputs::Judge;
use super::problem::Problem;
use super::{Drawn, Tuned, Width, better};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::metrics::Metric;
use crate::streams::{self, generator};
use crate::target_transform::FittedTransform;
use elm_datasets::geometry::DirectionPair;

/// Most neurons, unless they are asked for, and how many are drawn for each that is kept.
const NEURONS: usize = 213;
const DRAWN: usize = 2;
/// Rows that a beginning of the search is chosen by.
const START: usize = 60;
/// Rows and rounds of the search: for every set of inputs, and for those that look best.
const FIRST: (usize, usize) = (120, 15);
const SECOND: (usize, usize) = (240, 14);
/// The same for all sets where the targets have changed a little.
const AGAIN: (usize, usize) = (FIRST.0, 8);
/// Sets whose evidence is lower than the best by no more than this for each value look as good.
const CLOSE: f64 = 0.3;
/// Inputs that turn with the surface must have an evidence higher by this for each value: a grain is plain to
/// see, or none.
const ANISOTROPY_GAIN: f64 = 0.3;
/// Rows that the limit is fitted to, at most: it costs their cube.
const LIMIT_ROWS: usize = 600;
/// Folds for the noise.
const FOLDS: usize = 5;
/// Groups of rows by their targets.
const GROUPS: usize = 32;

/// Sets of inputs with the best setting of each, the best set first.
pub(super) struct Search<'a> {
    tuned: &'a Tuned,
    /// The rows of the limit, those of the search first.
    rows: Vec<usize>,
    values: Array2<f64>,
    found: Vec<Found>,
    /// All measurements.
    total: usize,
}

/// A set of inputs, and its best setting.
struct Found {
    features: Features,
    scaler: Scaler<f64>,
    rows: Rows,
    setting: Setting,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        tuned: &'a Tuned,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
        transform: &FittedTransform,
        grain: Option<Features>,
    ) -> Result<Self> {
        let targets = transform.to_targets(values)?;
        let mut random = generator(tuned.seed, streams::FEW);
        let drawn = index::sample(&mut random, pairs.len(), pairs.len()).into_vec();
        let mut rows = evenly(&drawn, &targets);
        rows.truncate(LIMIT_ROWS);
        let targets = targets.select(Axis(0), &rows);
        let spread = row_spread(tuned, pairs, values, transform, &rows);
        let sets = tuned.sets(&Tuned::FEW_SETS, grain);
        let found: Vec<Found> = sets
            .into_iter()
            .map(|features| {
                let x = features.compute_training(pairs);
                let scaler = Scaler::measured(&x)?;
                let rows = Rows {
                    x: standardized(&scaler, &x.select(Axis(0), &rows)),
                    targets: targets.clone(),
                    spread: spread.clone(),
                };
                Found::first(features, scaler, rows)
            })
            .collect::<Result<_>>()?;
        let mut search = Self {
            tuned,
            values: values.select(Axis(0), &rows),
            rows,
            found,
            total: pairs.len(),
        };
        search.sort();
        Ok(search)
    }

    /// Takes the targets of another transform, which are nearly those of before.
    pub(super) fn retarget(
        &mut self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
        transform: &FittedTransform,
    ) -> Result<()> {
        let targets = transform.to_targets(self.values.view())?;
        let spread = row_spread(self.tuned, pairs, values, transform, &self.rows);
        for found in &mut self.found {
            found.rows.targets.clone_from(&targets);
            found.rows.spread.clone_from(&spread);
            found.improve(AGAIN)?;
        }
        self.sort();
        Ok(())
    }

    /// The values that the evidence of at most this many rows is about.
    fn values_of(&self, most: usize) -> f64 {
        let (rows, outputs) = self.values.dim();
        (rows.min(most) * outputs) as f64
    }

    /// The best first, by the evidence of few rows.
    fn sort(&mut self) {
        let few = self.values_of(FIRST.0);
        sort(&mut self.found, few);
    }

    /// Improves the sets that look best, on more rows.
    pub(super) fn refine(&mut self) -> Result<()> {
        let (few, more) = (self.values_of(FIRST.0), self.values_of(SECOND.0));
        let least = self.found[0].rank(few) - CLOSE * few;
        let close = self.found.partition_point(|found| found.rank(few) >= least);
        let close = &mut self.found[..close];
        for found in close.iter_mut() {
            found.improve(SECOND)?;
        }
        sort(close, more);
        Ok(())
    }

    /// Whether the best set's inputs turn with the surface.
    pub(super) fn is_anisotropic(&self) -> bool {
        let best = self.found.first();
        best.is_some_and(|best| !best.features.is_isotropic())
    }

    /// The standard deviation of the noise of each channel's dark half, in 1/sr: of what the best
    /// set is off by at rows left out, by the median, which a few bad rows do not move.
    pub(super) fn noise(&self, transform: &FittedTransform) -> Result<Vec<f64>> {
        let Some(held_out) = self.held_out()? else {
            return Ok(vec![0.0; self.values.ncols()]);
        };
        let held_out = transform.to_values(held_out)?;
        let columns = held_out.columns().into_iter().zip(self.values.columns());
        Ok(columns
            .map(|(fitted, values)| dark_noise(fitted, values))
            .collect())
    }

    /// `transform` with as many outputs as the error at rows left out asks for.
    pub(super) fn with_outputs(
        &self,
        transform: FittedTransform,
        pairs: &[DirectionPair],
    ) -> Result<FittedTransform> {
        let pairs: Vec<DirectionPair> = self.rows.iter().map(|&row| pairs[row]).collect();
        let values = self.values.view();
        let judge = Judge {
            pairs: &pairs,
            values,
        };
        // Of too few rows none can be left out: the rows themselves say what outputs are for.
        let targets = match self.held_out()? {
            Some(held_out) => held_out,
            None => transform.to_targets(values)?,
        };
        let tuned = self.tuned;
        let inputs = self.found.first().map_or(1, |best| best.rows.x.ncols());
        let total = self.total;
        tuned.with_outputs(transform, values, &judge, |transform, outputs| {
            let width = Width {
                channels: transform.channels(),
                outputs,
            };
            let room = tuned.size(NEURONS, total, inputs, width, |neurons| DRAWN * neurons);
            Ok(room.is_ok().then(|| transform.project(targets.clone())))
        })
    }

    /// What the best set says of the targets of each row without it; `None` for too few rows.
    fn held_out(&self) -> Result<Option<Array2<f64>>> {
        let count = self.rows.len();
        let channels = self.values.ncols();
        let Some(best) = self.found.first().filter(|_| count >= 4 * FOLDS) else {
            return Ok(None);
        };
        let fold = |fold: usize| (fold..count).step_by(FOLDS).collect();
        let folds: Vec<Vec<usize>> = (0..FOLDS).map(fold).collect();
        let limit = Limit::new(&best.rows, &best.setting, &folds)?;
        let (_, without) = limit.predict(&best.rows.x);
        let mut held_out = Array2::zeros((count, channels));
        for (fold, without) in folds.iter().zip(&without) {
            for &row in fold {
                held_out.row_mut(row).assign(&without.row(row));
            }
        }
        Ok(Some(held_out))
    }

    /// The network of the best set, or, where its albedo is not physical, of another.
    pub(super) fn best(&self, problem: &Problem<'_>) -> Result<Finished> {
        let mut best: Option<Finished> = None;
        for found in &self.found {
            let finished = self.finished(found, problem)?;
            let known = best.take();
            let chosen = match known {
                None => finished,
                Some(known) => better(known, finished),
            };
            if chosen.excess <= 0.0 {
                return Ok(chosen);
            }
            best = Some(chosen);
        }
        best.ok_or(Error::NoConvergence {
            what: "the search for a network",
        })
    }

    fn finished(&self, found: &Found, problem: &Problem<'_>) -> Result<Finished> {
        let mut place = vec![None; problem.pairs.len()];
        for (number, &row) in self.rows.iter().enumerate() {
            place[row] = Some(number);
        }
        let of_fold = |fold: &Vec<usize>| fold.iter().filter_map(|&row| place[row]).collect();
        let folds: Vec<Vec<usize>> = problem.folds().iter().map(of_fold).collect();
        let setting = if problem.noisy {
            found.rows.calmest(&found.setting)?
        } else {
            found.setting.clone()
        };
        let mut limit = Limit::new(&found.rows, &setting, &folds)?;
        if self.tuned.metric == Metric::Rmse {
            self.fit_means(&mut limit, problem)?;
        }
        let inputs = found.rows.x.ncols();
        let rows = problem.pairs.len();
        let width = Width::of(&problem.transform);
        let drawn = |neurons: usize| DRAWN * neurons;
        let neurons = self.tuned.size(NEURONS, rows, inputs, width, drawn)?;
        let params = ElmParams::new(drawn(neurons))
            .with_activation(Activation::Sine)
            .with_distribution(setting.smoothness.frequencies())
            .with_biases(Biases::Scaled(PI))
            .with_input_scales(setting.scales.to_vec())
            .with_bounded(false)
            .with_seed(self.tuned.seed);
        let candidates = Drawn::new(&params, inputs, &found.scaler)?;
        let teacher = Large {
            found,
            limit,
            transform: &problem.transform,
        };
        problem.distilled(found.features, &teacher, candidates, &params, neurons)
    }

    /// Fits the mean value instead of the value of the mean target; see
    /// [`Problem::finish`](super::problem::Problem).
    fn fit_means(&self, limit: &mut Limit, problem: &Problem<'_>) -> Result<()> {
        let mut censored = Censored::new(self.values.view(), &problem.noise);
        let transform = problem.transform.plain();
        for _ in 0..censored.rounds() {
            let fitted = limit.fitted();
            let means = transform.to_values(fitted.clone())?;
            let values = censored.completed(self.values.view(), means.view());
            let working = transform.working_targets(fitted.view(), values.view())?;
            limit.fit(&working);
            censored.learn();
        }
        Ok(())
    }
}

impl Found {
    /// The best setting that few rows tell.
    fn first(features: Features, scaler: Scaler<f64>, rows: Rows) -> Result<Self> {
        let (fewer, some) = (first_of(&rows, START), first_of(&rows, FIRST.0));
        let mut settings = Vec::with_capacity(Smoothness::ALL.len());
        for smoothness in Smoothness::ALL {
            settings.push(some.improved(&fewer.start(smoothness)?, FIRST.1)?);
        }
        settings.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        Ok(Self {
            features,
            scaler,
            rows,
            setting: settings.swap_remove(0),
        })
    }

    /// What sets are compared by: the evidence of this many values.
    fn rank(&self, values: f64) -> f64 {
        if self.features.is_isotropic() {
            self.setting.evidence
        } else {
            self.setting.evidence - ANISOTROPY_GAIN * values
        }
    }

    fn improve(&mut self, (rows, rounds): (usize, usize)) -> Result<()> {
        self.setting = first_of(&self.rows, rows).improved(&self.setting, rounds)?;
        Ok(())
    }
}

/// The limit of a set of inputs.
struct Large<'a> {
    found: &'a Found,
    limit: Limit,
    transform: &'a FittedTransform,
}

impl Teacher for Large<'_> {
    fn targets(&self, pairs: &[DirectionPair]) -> (Array2<f64>, Vec<Array2<f64>>) {
        let x = self.found.features.compute(pairs);
        let (all, without) = self.limit.predict(&standardized(&self.found.scaler, &x));
        let project = |targets| self.transform.project(targets);
        (project(all), without.into_iter().map(project).collect())
    }
}

/// How many times as large as that of the others the variance of each row's noise is: where it weighs little,
/// large.
fn row_spread(
    tuned: &Tuned,
    pairs: &[DirectionPair],
    values: ArrayView2<'_, f64>,
    transform: &FittedTransform,
    rows: &[usize],
) -> Array1<f64> {
    let weights = row_weights(tuned.metric, pairs, values, transform);
    weights.map_or_else(
        || Array1::ones(rows.len()),
        |weights| {
            let weights = weights.select(Axis(0), rows);
            let mean = weights.mean().unwrap_or(1.0);
            weights.mapv(|weight| mean / weight.max(1e-6 * mean))
        },
    )
}

fn first_of(rows: &Rows, count: usize) -> Rows {
    rows.select(&(0..rows.x.nrows().min(count)).collect::<Vec<_>>())
}

/// The best first, by the evidence of this many values.
fn sort(found: &mut [Found], values: f64) {
    found.sort_by(|a, b| b.rank(values).total_cmp(&a.rank(values)));
}

fn standardized(scaler: &Scaler<f64>, x: &Array2<f64>) -> Array2<f64> {
    (x - &scaler.mean()) * scaler.factor()
}

/// The rows in an order of which every beginning has targets from the whole range evenly, as far as there
/// are any: a highlight of few rows is among the first.
fn evenly(rows: &[usize], targets: &Array2<f64>) -> Vec<usize> {
    let means = targets.mean_axis(Axis(1)).unwrap_or_default();
    let low = means.iter().copied().fold(f64::INFINITY, f64::min);
    let high = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut groups = vec![Vec::new(); GROUPS];
    for &row in rows.iter().rev() {
        let place = (means[row] - low) / (high - low).max(f64::MIN_POSITIVE);
        groups[((place * GROUPS as f64) as usize).min(GROUPS - 1)].push(row);
    }
    let mut ordered = Vec::with_capacity(rows.len());
    while ordered.len() < rows.len() {
        ordered.extend(groups.iter_mut().filter_map(Vec::pop));
    }
    ordered
}
