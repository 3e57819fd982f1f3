//! Few measurements: every candidate by exact leave-one-out, the best of them averaged.

use elm::solve::{LeastSquares, Ridge};
use elm::validate::Validator;
use elm::{Elm, ElmParams, HiddenLayer, Scaler};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, concatenate};

use super::{Blank, Tuned, provenance, solve};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::geometry::Pair;
use crate::link::Link;
use crate::metrics::{Metric, Metrics};
use crate::model::{BrdfModel, Layer, Provenance};
use crate::scales::spread;

/// Neurons of a candidate.
const NEURONS: usize = 400;
/// Candidates for the scales of inputs, per set of inputs.
const CANDIDATES: usize = 64;
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
    let targets = link.fit(values)?.to_targets(values)?;
    let channels = groups.iter().map(Vec::len).max().unwrap_or(1);
    let search = Search::new(tuned, pairs, &targets, channels)?;
    let choose = |group: &Vec<usize>| search.choose(tuned, pairs, values, &targets, group);
    let choices: Vec<Choice> = groups.iter().map(choose).collect::<Result<_>>()?;
    // One factorisation of a candidate serves every group that has taken it.
    let mut networks = Vec::new();
    for candidate in 0..search.scales.nrows() {
        let takes = |choice: &Choice| choice.members.contains(&candidate);
        let taken = groups.iter().zip(&choices).filter(|(_, c)| takes(c));
        let mut columns: Vec<usize> = taken.flat_map(|(group, _)| group.clone()).collect();
        columns.sort_unstable();
        columns.dedup();
        networks.push(if columns.is_empty() {
            None
        } else {
            Some(search.network(candidate, &targets, columns)?)
        });
    }
    let about = provenance(tuned.seed, tuned.metric, pairs, values);
    let model = |(group, choice): (&Vec<usize>, Choice)| {
        let link = link.fit(values.select(Axis(1), group).view())?;
        let taken = choice.members.iter().filter_map(|&c| networks[c].as_ref());
        let taken: Vec<&Network> = taken.collect();
        let (layer, network) = average(&search.scaler, &taken, group)?;
        let about = Provenance {
            held_out: Some(choice.held_out),
            ..about.clone()
        };
        Ok(BrdfModel::new(search.set, link, layer, network).with_provenance(about))
    };
    groups.iter().zip(choices).map(model).collect()
}

/// The networks that a group of channels is best fitted by.
struct Choice {
    /// Numbers of candidates.
    members: Vec<usize>,
    held_out: Metrics,
}

/// A candidate fitted to some of the channels.
struct Network {
    blank: Blank,
    /// Which channels, in order.
    columns: Vec<usize>,
    beta: Array2<f64>,
    intercept: Array1<f64>,
}

/// All candidates with what leave-one-out predicts.
struct Search {
    set: Features,
    scaler: Scaler<f64>,
    x: Array2<f64>,
    /// Scales of inputs, shape (candidates, inputs).
    scales: Array2<f64>,
    params: Vec<ElmParams<f64>>,
    /// For each candidate the residuals of targets, shape (rows, channels).
    left_out: Vec<Array2<f64>>,
    members: usize,
}

impl Search {
    fn new(tuned: &Tuned, pairs: &[Pair], targets: &Array2<f64>, channels: usize) -> Result<Self> {
        let set = tuned.features.unwrap_or(Features::SumDifference);
        let x = set.compute(pairs);
        let scaler = Scaler::measured(&x)?;
        let neurons = tuned.size(NEURONS, x.ncols(), channels, 2, |_| 0)?;
        let limited = tuned.neurons.is_some() || tuned.max_floats.is_some();
        let scales = spread(CANDIDATES, x.ncols(), SCALES);
        let params = |scales: ArrayView1<'_, f64>| tuned.waves(neurons, &scales.to_vec());
        let mut search = Self {
            set,
            scaler,
            x,
            params: scales.rows().into_iter().map(params).collect(),
            scales,
            left_out: Vec::new(),
            members: if limited { 1 } else { Tuned::MEMBERS },
        };
        for candidate in 0..CANDIDATES {
            let (_, h) = search.layer(candidate)?;
            let validator = Validator::new(&LeastSquares::new(&h, targets)?.intercept(true))?;
            let lambda = validator.strengths(Ridge::leave_one_out())?;
            search
                .left_out
                .push(match validator.leave_one_out(&lambda) {
                    Ok(held_out) => held_out.residuals().to_owned(),
                    // One measurement: nothing can be left out of it.
                    Err(elm::Error::Undetermined { .. }) => targets.clone(),
                    Err(error) => return Err(error.into()),
                });
        }
        Ok(search)
    }

    /// A candidate's layer and its matrix.
    fn layer(&self, candidate: usize) -> Result<(Blank, Array2<f64>)> {
        let params = self.params[candidate].clone();
        let blank = Blank::new(params, self.x.ncols(), &self.scaler)?;
        let h = blank.matrix(&self.x)?;
        Ok((blank, h))
    }

    fn network(
        &self,
        candidate: usize,
        targets: &Array2<f64>,
        columns: Vec<usize>,
    ) -> Result<Network> {
        let (blank, h) = self.layer(candidate)?;
        let targets = targets.select(Axis(1), &columns);
        let (beta, intercept) = solve(&h, &targets, None, Ridge::leave_one_out())?;
        Ok(Network {
            blank,
            columns,
            beta,
            intercept,
        })
    }

    fn choose(
        &self,
        tuned: &Tuned,
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
        let members: Vec<usize> = ranked.into_iter().map(|(_, candidate)| candidate).collect();
        let share = 1.0 / members.len() as f64;
        let mut mean = Array2::zeros(targets.dim());
        for &member in &members {
            mean.scaled_add(share, &self.left_out[member].select(Axis(1), group));
        }
        let held_out = metrics(&mean)?;
        Ok(Choice { members, held_out })
    }
}

/// One network, the mean of `networks`, for the channels of a group.
fn average(
    scaler: &Scaler<f64>,
    networks: &[&Network],
    group: &[usize],
) -> Result<(Layer, Elm<f64>)> {
    let share = 1.0 / networks.len() as f64;
    let mut betas = Vec::new();
    let mut intercept = Array1::zeros(group.len());
    for network in networks {
        let place = |channel: &usize| network.columns.iter().position(|c| c == channel);
        let columns: Vec<usize> = group.iter().filter_map(place).collect();
        betas.push(network.beta.select(Axis(1), &columns) * share);
        intercept.scaled_add(share, &network.intercept.select(Axis(0), &columns));
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
    let layers = networks.iter().map(|n| n.blank.network.hidden().clone());
    let hidden = HiddenLayer::joined(&layers.collect::<Vec<_>>())?;
    let draws = networks.iter().map(|n| n.blank.draw.clone()).collect();
    let network = Elm::from_parts(Some(scaler.clone()), hidden, beta, intercept)?;
    Ok((Layer::Drawn(draws), network))
}
