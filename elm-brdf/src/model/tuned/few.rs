//! Few measurements: every candidate by exact leave-one-out, the best of them averaged.

use elm::solve::{LeastSquares, Ridge};
use elm::validate::Validator;
use elm::{Elm, HiddenLayer, Scaler};
use ndarray::{Array1, Array2, ArrayView2, Axis, concatenate};

use super::{Blank, Tuned, provenance, solve};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::geometry::Pair;
use crate::link::Link;
use crate::metrics::{Metric, Metrics};
use crate::model::{BrdfModel, Layer};

/// Neurons of a candidate.
const NEURONS: usize = 400;
/// Candidates for the scales of inputs, per set of inputs.
const CANDIDATES: usize = 32;
/// Scales tried, in units of the inputs' standard deviations: from nearly linear to several waves.
const SCALES: (f64, f64) = (0.05, 3.3);

/// One model for each group of channels.
pub(super) fn fit(
    tuned: &Tuned,
    pairs: &[Pair],
    values: ArrayView2<'_, f64>,
    groups: &[Vec<usize>],
) -> Result<Vec<BrdfModel>> {
    let link = Link::default_log();
    let fitted = link.fit(values)?;
    let targets = fitted.to_targets(values)?;
    let mut best: Vec<Option<Choice>> = vec![None; groups.len()];
    for set in tuned.sets(&[Features::SumDifference]) {
        let search = Search::new(tuned, set, pairs, &targets, groups)?;
        for (group, best) in groups.iter().zip(&mut best) {
            let choice = search.choose(tuned, set, pairs, values, &targets, group)?;
            if best.as_ref().is_none_or(|best| choice.score < best.score) {
                *best = Some(choice);
            }
        }
    }
    let about = provenance(tuned, pairs, values);
    let models = groups.iter().zip(best).filter_map(|(group, choice)| {
        let choice = choice?;
        let model = choice.model(tuned, pairs, values, &targets, group);
        Some(model.map(|model| {
            let mut about = about.clone();
            about.held_out = Some(choice.held_out);
            model.with_provenance(about)
        }))
    });
    models.collect()
}

/// The networks that a group of channels is best fitted by.
#[derive(Clone)]
struct Choice {
    set: Features,
    /// Of the input scales.
    members: Vec<Vec<f64>>,
    neurons: usize,
    score: f64,
    held_out: Metrics,
}

/// All candidates of one set of inputs with what leave-one-out predicts.
struct Search {
    neurons: usize,
    scales: Array2<f64>,
    /// For each candidate the residuals of targets, shape (rows, channels).
    left_out: Vec<Array2<f64>>,
    members: usize,
}

impl Search {
    fn new(
        tuned: &Tuned,
        set: Features,
        pairs: &[Pair],
        targets: &Array2<f64>,
        groups: &[Vec<usize>],
    ) -> Result<Self> {
        let x = set.compute(pairs);
        let scaler = Scaler::measured(&x)?;
        let channels = groups.iter().map(Vec::len).max().unwrap_or(1);
        let neurons = tuned.size(NEURONS, x.ncols(), channels, 2, |_| 0)?;
        let limited = tuned.neurons.is_some() || tuned.max_floats.is_some();
        let scales = spread(CANDIDATES, x.ncols());
        let mut left_out = Vec::new();
        for candidate in scales.rows() {
            let blank = Blank::new(
                tuned.waves(neurons, &candidate.to_vec()),
                x.ncols(),
                &scaler,
            )?;
            let h = blank.matrix(&x)?;
            let validator = Validator::new(&LeastSquares::new(&h, targets)?.intercept(true))?;
            let lambda = validator.strengths(Ridge::leave_one_out())?;
            let held_out = match validator.leave_one_out(&lambda) {
                Ok(held_out) => held_out.residuals().to_owned(),
                // One measurement: nothing can be left out of it.
                Err(elm::Error::Undetermined { .. }) => targets.clone(),
                Err(error) => return Err(error.into()),
            };
            left_out.push(held_out);
        }
        Ok(Self {
            neurons,
            scales,
            left_out,
            members: if limited { 1 } else { Tuned::MEMBERS },
        })
    }

    fn choose(
        &self,
        tuned: &Tuned,
        set: Features,
        pairs: &[Pair],
        values: ArrayView2<'_, f64>,
        targets: &Array2<f64>,
        group: &[usize],
    ) -> Result<Choice> {
        let truth = values.select(Axis(1), group);
        let targets = targets.select(Axis(1), group);
        let link = Link::default_log().fit(truth.view())?;
        let metrics = |residuals: &Array2<f64>| -> Result<Metrics> {
            let predicted = link.to_values(&targets - residuals)?;
            Metrics::of(pairs, predicted.view(), truth.view())
        };
        // A few bright rows decide the RMSE, and would decide which candidate is taken; the errors
        // of targets, which are all of one size, choose better (held out on CUReT by 5 %).
        let score = |residuals: &Array2<f64>| -> Result<f64> {
            Ok(match tuned.metric {
                Metric::Rmse => residuals.iter().map(|r| r * r).sum(),
                metric => metric.of(&metrics(residuals)?),
            })
        };
        let mut ranked = Vec::new();
        for (candidate, left_out) in self.left_out.iter().enumerate() {
            let residuals = left_out.select(Axis(1), group);
            ranked.push((score(&residuals)?, candidate));
        }
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked.truncate(self.members);
        let count = ranked.len() as f64;
        let mut mean = Array2::zeros(targets.dim());
        for &(_, candidate) in &ranked {
            mean.scaled_add(
                1.0 / count,
                &self.left_out[candidate].select(Axis(1), group),
            );
        }
        let held_out = metrics(&mean)?;
        Ok(Choice {
            set,
            members: ranked
                .iter()
                .map(|&(_, candidate)| self.scales.row(candidate).to_vec())
                .collect(),
            neurons: self.neurons,
            score: score(&mean)?,
            held_out,
        })
    }
}

impl Choice {
    fn model(
        &self,
        tuned: &Tuned,
        pairs: &[Pair],
        values: ArrayView2<'_, f64>,
        targets: &Array2<f64>,
        group: &[usize],
    ) -> Result<BrdfModel> {
        let x = self.set.compute(pairs);
        let scaler = Scaler::measured(&x)?;
        let targets = targets.select(Axis(1), group);
        let share = 1.0 / self.members.len() as f64;
        let mut draws = Vec::new();
        let (mut layers, mut betas) = (Vec::<HiddenLayer<f64>>::new(), Vec::new());
        let mut intercept = Array1::zeros(group.len());
        for scales in &self.members {
            let blank = Blank::new(tuned.waves(self.neurons, scales), x.ncols(), &scaler)?;
            let (beta, constant) =
                solve(&blank.matrix(&x)?, &targets, None, Ridge::leave_one_out())?;
            betas.push(beta * share);
            intercept.scaled_add(share, &constant);
            layers.push(blank.network.hidden().clone());
            draws.push(blank.draw);
        }
        let views: Vec<_> = betas.iter().map(|beta| beta.view()).collect();
        // All neurons are sines, so that they stand in the order of the layers.
        let beta = concatenate(Axis(0), &views).map_err(|_| {
            Error::Elm(elm::Error::Empty {
                what: "networks",
                rows: 0,
                columns: group.len(),
            })
        })?;
        let network =
            Elm::from_parts(Some(scaler), HiddenLayer::joined(&layers)?, beta, intercept)?;
        let link = Link::default_log().fit(values.select(Axis(1), group).view())?;
        Ok(BrdfModel::new(self.set, link, Layer::Drawn(draws), network))
    }
}

/// Scales of inputs, shape (candidates, inputs): an additive recurrence, evenly spread in the
/// logarithm.
///
/// M. Roberts, *The Unreasonable Effectiveness of Quasirandom Sequences*, 2018.
fn spread(candidates: usize, inputs: usize) -> Array2<f64> {
    // The root of x^(d+1) = x + 1, by fixed-point iteration.
    let mut root = 2.0_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (inputs as f64 + 1.0));
    }
    let (low, high) = (SCALES.0.ln(), SCALES.1.ln());
    Array2::from_shape_fn((candidates, inputs), |(candidate, input)| {
        let step = root.powi(-(input as i32 + 1));
        let place = (0.5 + (candidate as f64 + 1.0) * step).fract();
        (low + place * (high - low)).exp()
    })
}
