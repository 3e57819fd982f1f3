//! Many measurements: a search on part of the rows, then pruning, then one solve on all of them.

use elm::Scaler;
use elm::prune::Keep;
use elm::solve::Ridge;
use ndarray::{Array2, ArrayView2, Axis};
use rand::seq::index;

use super::errors::{cut_off_means, dark_noise, geometric_root};
use super::finish::Finished;
use super::outputs::Judge;
use super::problem::Problem;
use super::{Drawn, TIE, Tuned, Width, better, dataset};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::metrics::{Metric, Metrics};
use crate::streams::{self, generator};
use crate::target_transform::FittedTransform;
use elm_datasets::geometry::DirectionPair;

/// Neurons unless said otherwise: some 675 numbers for three channels.
pub(super) const NEURONS: usize = 213;
/// Rows that the search fits to, and as many others that judge.
const SEARCH_ROWS: usize = 1500;
/// Rows that decide which neurons are kept.
const PRUNE_ROWS: usize = 1500;
/// Neurons of the search.
const SEARCH_NEURONS: usize = 96;
/// Weak, but strong enough for the normal equations.
pub(super) const RIDGE: f64 = 3e-8;
/// A scale is moved by this factor, then by its root.
const STEPS: [f64; 2] = [2.0, 1.414];
/// Sets that are fitted to all rows to choose between them, if they come close: the search's networks are too
/// small to tell them apart.
const FINISHED: usize = 3;
/// How close that is.
const CLOSE: f64 = 1.15;
/// Sets that are fitted to all rows, at most, where none returns less light than it receives.
const MAX_FINISHED: usize = 4;
/// Sets whose scales are moved, at most, and how far off these may be at first.
const MOVED: usize = 3;
const FAR: f64 = 1.6;
/// Inputs that turn with the surface are taken where their error is this many times smaller: a grain is
/// plain to see, or none.
const ANISOTROPY_GAIN: f64 = 1.25;
/// Where every scale begins.
const FIRST_SCALE: f64 = 0.7;

/// Candidates drawn to keep `neurons`: 4 n for small networks, 1.5 n for large, as elimination costs
/// the cube.
fn drawn(neurons: usize) -> usize {
    (4 * neurons).min((neurons + neurons / 2).max(320))
}

/// Rows that the search fits to, and others that judge.
pub(super) fn search_rows(tuned: &Tuned, rows: usize) -> Vec<usize> {
    let mut random = generator(tuned.seed, streams::MANY);
    index::sample(&mut random, rows, rows.min(2 * SEARCH_ROWS)).into_vec()
}

/// The best settings for these targets, the best first.
pub(super) fn search(
    tuned: &Tuned,
    transform: &FittedTransform,
    pairs: &[DirectionPair],
    values: ArrayView2<'_, f64>,
    rows: &[usize],
    sets: &[Features],
) -> Result<Vec<Setting>> {
    Search::new(tuned, transform, pairs, values, rows)?.best(sets)
}

/// The best network of some of the settings.
pub(super) fn best(
    problem: &Problem<'_>,
    settings: &[Setting],
    rows: &[usize],
) -> Result<Finished> {
    let mut found: Option<Finished> = None;
    for (number, setting) in settings.iter().enumerate() {
        let physical = found.as_ref().is_some_and(|found| found.excess <= 0.0);
        let usual = setting.set == Features::SumDifference;
        let within = |factor: f64| setting.error <= factor * settings[0].error;
        let close = usual && within(FAR) || number < FINISHED && within(CLOSE);
        if physical && !close || number >= MAX_FINISHED && !usual {
            continue;
        }
        let finished = finished(problem, setting, rows)?;
        found = Some(match found {
            None => finished,
            Some(known) => better(known, finished),
        });
    }
    found.ok_or_else(no_search)
}

fn no_search() -> Error {
    Error::NoConvergence {
        what: "the search for a network",
    }
}

/// Draws more neurons than wanted, keeps the most useful, and fits them.
fn finished(problem: &Problem<'_>, setting: &Setting, rows: &[usize]) -> Result<Finished> {
    let tuned = problem.tuned;
    let x = setting.set.compute_training(problem.pairs);
    let scaler = Scaler::measured(&x)?;
    let width = Width::of(&problem.transform);
    let neurons = tuned.size(NEURONS, x.nrows(), x.ncols(), width, drawn)?;
    let count = drawn(neurons);
    let few = &rows[..rows.len().min(PRUNE_ROWS.max(count))];
    let params = tuned.sine_features(count, &setting.scales);
    let layer = Drawn::new(&params, x.ncols(), &scaler)?;
    let params = params.with_solver(Ridge::relative(RIDGE));
    let (few_x, few_targets) = (x.select(Axis(0), few), problem.targets(few));
    let few_weights = problem.weights(few);
    let pruned = params.prune_map(
        layer.map.clone(),
        &dataset(&few_x, &few_targets, few_weights.as_ref())?,
        Keep::Neurons(neurons),
    )?;
    let layer = layer.pruned(&pruned.kept)?;
    problem.finish(setting.set, &layer, &x)
}

/// `transform` with as many outputs as the error at the rows that judge asks for, each number of them with
/// the neurons that the limits leave for it.
pub(super) fn with_outputs(
    tuned: &Tuned,
    transform: FittedTransform,
    pairs: &[DirectionPair],
    values: ArrayView2<'_, f64>,
    rows: &[usize],
    setting: &Setting,
) -> Result<FittedTransform> {
    let plain = transform.clone();
    let search = Search::new(tuned, &plain, pairs, values, rows)?;
    let inputs = search.inputs(setting.set)?;
    let judge = Judge {
        pairs: &search.validation.pairs,
        values: search.validation.values.view(),
    };
    let mut known: Option<(usize, Array2<f64>)> = None;
    tuned.with_outputs(
        transform,
        search.fitted.values.view(),
        &judge,
        |transform, outputs| {
            let width = Width {
                channels: transform.channels(),
                outputs,
            };
            let inputs_of = inputs.fitted.ncols();
            let Ok(neurons) = tuned.size(NEURONS, pairs.len(), inputs_of, width, drawn) else {
                return Ok(None);
            };
            // More than half of the rows would leave little to tell neurons by.
            let neurons = neurons.min(inputs.fitted.nrows() / 2).max(1);
            if let Some((_, predicted)) = known.as_ref().filter(|(size, _)| *size == neurons) {
                return Ok(Some(predicted.clone()));
            }
            let params = tuned.sine_features(neurons, &setting.scales);
            let map = Drawn::new(&params, inputs_of, &inputs.scaler)?.map;
            let params = params.with_solver(Ridge::relative(RIDGE));
            let targets = transform.to_targets(search.fitted.values.view())?;
            let network = params.fit_map(map, &dataset(&inputs.fitted, &targets, None)?)?;
            let predicted = network.predict(&inputs.validation)?;
            known = Some((neurons, predicted.clone()));
            Ok(Some(predicted))
        },
    )
}

/// Some of the rows.
struct Part {
    pairs: Vec<DirectionPair>,
    values: Array2<f64>,
    targets: Array2<f64>,
}

fn part(
    pairs: &[DirectionPair],
    values: ArrayView2<'_, f64>,
    targets: &Array2<f64>,
    rows: &[usize],
) -> Part {
    Part {
        pairs: rows.iter().map(|&row| pairs[row]).collect(),
        values: values.select(Axis(0), rows),
        targets: targets.select(Axis(0), rows),
    }
}

/// Inputs, their scales, and what comes of them.
pub(super) struct Setting {
    set: Features,
    scales: Vec<f64>,
    error: f64,
    /// What is predicted at the rows that judge, and what was measured there.
    predicted: Array2<f64>,
    measured: Array2<f64>,
}

impl Setting {
    /// Whether its inputs turn with the surface.
    pub(super) fn is_anisotropic(&self) -> bool {
        !self.set.is_isotropic()
    }

    /// The standard deviation of the noise of each channel's dark half, in 1/sr.
    pub(super) fn noise(&self) -> Vec<f64> {
        let columns = self.predicted.columns().into_iter();
        columns
            .zip(self.measured.columns())
            .map(|(predicted, measured)| dark_noise(predicted, measured))
            .collect()
    }
}

struct Search<'a> {
    tuned: &'a Tuned,
    transform: &'a FittedTransform,
    fitted: Part,
    validation: Part,
}

/// One set of inputs at the rows of both parts.
struct Inputs {
    set: Features,
    fitted: Array2<f64>,
    validation: Array2<f64>,
    scaler: Scaler<f64>,
}

impl<'a> Search<'a> {
    /// The first half of `rows` is fitted, the second judges.
    fn new(
        tuned: &'a Tuned,
        transform: &'a FittedTransform,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
        rows: &[usize],
    ) -> Result<Self> {
        let targets = transform.to_targets(values)?;
        let (fitted, validation) = rows.split_at(rows.len() / 2);
        Ok(Self {
            tuned,
            transform,
            fitted: part(pairs, values, &targets, fitted),
            validation: part(pairs, values, &targets, validation),
        })
    }

    fn inputs(&self, set: Features) -> Result<Inputs> {
        let fitted = set.compute_training(&self.fitted.pairs);
        Ok(Inputs {
            set,
            scaler: Scaler::measured(&fitted)?,
            fitted,
            validation: set.compute(&self.validation.pairs),
        })
    }

    /// For every set its best setting: of those that are good at the first scale of all inputs and its
    /// neighbours, with each input's scale moved until that no longer pays. The best first.
    fn best(&self, sets: &[Features]) -> Result<Vec<Setting>> {
        let mut found: Vec<(Inputs, Setting)> = Vec::new();
        for &set in sets {
            let inputs = self.inputs(set)?;
            let mut best: Option<Setting> = None;
            for scale in [1.0, 2.0, 0.5].map(|factor| factor * FIRST_SCALE) {
                let tried = self.try_scales(&inputs, vec![scale; inputs.fitted.ncols()])?;
                if best.as_ref().is_none_or(|best| tried.error < best.error) {
                    best = Some(tried);
                }
            }
            if let Some(best) = best {
                found.push((inputs, best));
            }
        }
        found.sort_by(|(_, a), (_, b)| a.error.total_cmp(&b.error));
        let least = found.first().map_or(0.0, |(_, best)| best.error);
        let promising = |(_, setting): &&mut (Inputs, Setting)| setting.error <= FAR * least;
        for (inputs, best) in found.iter_mut().take(MOVED).filter(promising) {
            for step in STEPS {
                for input in 0..best.scales.len() {
                    for factor in [step, 1.0 / step] {
                        let mut scales = best.scales.clone();
                        scales[input] *= factor;
                        let tried = self.try_scales(inputs, scales)?;
                        if tried.error < best.error {
                            *best = tried;
                            break;
                        }
                    }
                }
            }
        }
        let mut settings: Vec<Setting> = found.into_iter().map(|(_, best)| best).collect();
        let handicap = |setting: &Setting| {
            if !setting.set.is_isotropic() {
                ANISOTROPY_GAIN * setting.error
            } else if setting.set.is_reciprocal() {
                setting.error
            } else {
                TIE * setting.error
            }
        };
        settings.sort_by(|a, b| handicap(a).total_cmp(&handicap(b)));
        Ok(settings)
    }

    fn try_scales(&self, inputs: &Inputs, scales: Vec<f64>) -> Result<Setting> {
        let params = self.tuned.sine_features(SEARCH_NEURONS, &scales);
        let map = Drawn::new(&params, scales.len(), &inputs.scaler)?.map;
        let params = params.with_solver(Ridge::relative(RIDGE));
        let data = dataset(&inputs.fitted, &self.fitted.targets, None)?;
        let network = params.fit_map(map, &data)?;
        let targets = network.predict(&inputs.validation)?;
        let predicted = self.transform.to_values(targets.clone())?;
        Ok(Setting {
            set: inputs.set,
            scales,
            error: self.error(&targets, &predicted)?,
            predicted,
            measured: self.validation.values.clone(),
        })
    }

    /// The metric where that is none that a few bright rows decide; errors of the targets, the largest
    /// cut off, where RMSE is asked for.
    fn error(&self, targets: &Array2<f64>, predicted: &Array2<f64>) -> Result<f64> {
        let metric = self.tuned.metric;
        if metric != Metric::Rmse {
            let truth = self.validation.values.view();
            let metrics = Metrics::of(&self.validation.pairs, predicted.view(), truth)?;
            return Ok(metric.of(&metrics));
        }
        let variances = cut_off_means((targets - &self.validation.targets).mapv(|e| e * e).view());
        Ok(geometric_root(&variances))
    }
}
