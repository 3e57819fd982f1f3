//! Few measurements: every candidate by its evidence, the best of them averaged.

use std::f64::consts::PI;

use elm::solve::{LeastSquares, Ridge};
use elm::validate::Validator;
use elm::{Activation, Biases, Distribution, Elm, ElmParams, HiddenLayer, Scaler};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, concatenate};

use super::{Blank, Tuned, provenance};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::geometry::Pair;
use crate::link::{FittedLink, Link};
use crate::metrics::{Metric, Metrics};
use crate::model::{BrdfModel, Layer, Provenance};
use crate::scales::spread;

/// Neurons of a candidate.
const NEURONS: usize = 400;
/// Candidates for the scales of inputs, per set of inputs.
const CANDIDATES: usize = 128;
/// Scales tried, in units of the inputs' standard deviations: from nearly linear to several waves.
const SCALES: (f64, f64) = (0.05, 3.3);
/// Degrees of freedom of the frequencies: those of Matérn's covariance 5/2.
const FREEDOM: u8 = 5;

/// One model for each group of channels.
pub(super) fn fit(
    tuned: &Tuned,
    pairs: &[Pair],
    values: ArrayView2<'_, f64>,
    groups: &[Vec<usize>],
) -> Result<Vec<BrdfModel>> {
    let link = Link::default_log();
    let targets = link.fit(values)?.to_targets(values)?;
    let groups: Vec<Group> = groups
        .iter()
        .map(|channels| Group::new(channels, values))
        .collect::<Result<_>>()?;
    let channels = groups.iter().map(|g| g.channels.len()).max().unwrap_or(1);
    let search = Search::new(tuned, pairs, channels)?;
    let scores = search.scores(tuned.metric, pairs, &targets, &groups)?;
    let choices: Vec<Vec<usize>> = scores
        .columns()
        .into_iter()
        .map(|scores| search.best(scores))
        .collect();
    // One factorisation of a candidate serves every group that has taken it.
    let mut networks = Vec::new();
    for candidate in 0..CANDIDATES {
        let taken = groups.iter().zip(&choices);
        let taken = taken.filter(|(_, members)| members.contains(&candidate));
        let mut columns: Vec<usize> = taken.flat_map(|(g, _)| g.channels.clone()).collect();
        columns.sort_unstable();
        columns.dedup();
        networks.push(if columns.is_empty() {
            None
        } else {
            Some(search.network(candidate, &targets, columns)?)
        });
    }
    let about = provenance(tuned.seed, tuned.metric, pairs, values);
    let model = |(group, members): (&Group, Vec<usize>)| {
        let taken = members.iter().filter_map(|&c| networks[c].as_ref());
        let taken: Vec<&Network> = taken.collect();
        let (layer, network) = average(&search.scaler, &taken, &group.channels)?;
        let share = 1.0 / taken.len() as f64;
        let mut left_out = Array2::zeros(group.values.dim());
        for network in taken {
            left_out.scaled_add(share, &network.of(&network.left_out, &group.channels));
        }
        let about = Provenance {
            held_out: Some(group.metrics(pairs, &targets, &left_out)?),
            ..about.clone()
        };
        let link = group.link.clone();
        Ok(BrdfModel::new(search.set, link, layer, network).with_provenance(about))
    };
    groups.iter().zip(choices).map(model).collect()
}

/// Channels that one network is for.
struct Group {
    channels: Vec<usize>,
    values: Array2<f64>,
    link: FittedLink,
}

impl Group {
    fn new(channels: &[usize], values: ArrayView2<'_, f64>) -> Result<Self> {
        let values = values.select(Axis(1), channels);
        Ok(Self {
            channels: channels.to_vec(),
            link: Link::default_log().fit(values.view())?,
            values,
        })
    }

    /// Errors where the targets of this group's channels are missed by `residuals`.
    fn metrics(
        &self,
        pairs: &[Pair],
        targets: &Array2<f64>,
        residuals: &Array2<f64>,
    ) -> Result<Metrics> {
        let targets = targets.select(Axis(1), &self.channels);
        let predicted = self.link.to_values(targets - residuals)?;
        Metrics::of(pairs, predicted.view(), self.values.view())
    }
}

/// A candidate fitted to some of the channels.
struct Network {
    blank: Blank,
    /// Which channels, in order.
    columns: Vec<usize>,
    beta: Array2<f64>,
    intercept: Array1<f64>,
    /// What leave-one-out misses the targets by.
    left_out: Array2<f64>,
}

impl Network {
    /// Of a matrix with a column for each of the network's channels those of these.
    fn of(&self, matrix: &Array2<f64>, channels: &[usize]) -> Array2<f64> {
        let place = |channel: &usize| self.columns.iter().position(|c| c == channel);
        let columns: Vec<usize> = channels.iter().filter_map(place).collect();
        matrix.select(Axis(1), &columns)
    }
}

/// What is common to all candidates.
struct Search {
    set: Features,
    scaler: Scaler<f64>,
    x: Array2<f64>,
    params: Vec<ElmParams<f64>>,
    members: usize,
}

impl Search {
    fn new(tuned: &Tuned, pairs: &[Pair], channels: usize) -> Result<Self> {
        let set = tuned.features.unwrap_or(Features::SumDifference);
        let x = set.compute_training(pairs);
        let neurons = tuned.size(NEURONS, x.ncols(), channels, 2, |_| 0)?;
        let limited = tuned.neurons.is_some() || tuned.max_floats.is_some();
        let params = |scales: ArrayView1<'_, f64>| {
            ElmParams::new(neurons)
                .activation(Activation::Sine)
                .distribution(Distribution::StudentT(FREEDOM))
                .biases(Biases::Scaled(PI))
                .input_scales(scales.to_vec())
                .seed(tuned.seed)
        };
        let scales = spread(CANDIDATES, x.ncols(), SCALES);
        Ok(Self {
            set,
            scaler: Scaler::measured(&x)?,
            params: scales.rows().into_iter().map(params).collect(),
            x,
            members: if limited { 1 } else { Tuned::MEMBERS },
        })
    }

    /// How bad each candidate is for each group, shape (candidates, groups).
    fn scores(
        &self,
        metric: Metric,
        pairs: &[Pair],
        targets: &Array2<f64>,
        groups: &[Group],
    ) -> Result<Array2<f64>> {
        let mut scores = Array2::zeros((CANDIDATES, groups.len()));
        for (candidate, mut scores) in scores.rows_mut().into_iter().enumerate() {
            let (_, validator) = self.validator(candidate, targets)?;
            // A few bright rows decide the RMSE, and would decide which candidate is taken; the
            // evidence of targets, which are all of one size, chooses better.
            if metric == Metric::Rmse {
                let evidence = most_evidence(&validator);
                for (score, group) in scores.iter_mut().zip(groups) {
                    *score = -evidence.select(Axis(0), &group.channels).sum();
                }
            } else {
                let (_, left_out) = leave_one_out(&validator, targets)?;
                for (score, group) in scores.iter_mut().zip(groups) {
                    let residuals = left_out.select(Axis(1), &group.channels);
                    *score = metric.of(&group.metrics(pairs, targets, &residuals)?);
                }
            }
        }
        Ok(scores)
    }

    /// The candidates that a group takes, the best first.
    fn best(&self, scores: ArrayView1<'_, f64>) -> Vec<usize> {
        let mut ranked: Vec<usize> = (0..scores.len()).collect();
        ranked.sort_by(|&a, &b| scores[a].total_cmp(&scores[b]));
        ranked.truncate(self.members);
        ranked
    }

    /// A candidate's layer, and its matrix factorised.
    fn validator(
        &self,
        candidate: usize,
        targets: &Array2<f64>,
    ) -> Result<(Blank, Validator<f64>)> {
        let params = self.params[candidate].clone();
        let blank = Blank::new(params, self.x.ncols(), &self.scaler)?;
        let h = blank.matrix(&self.x)?;
        let validator = Validator::new(&LeastSquares::new(&h, targets)?.intercept(true))?;
        Ok((blank, validator))
    }

    fn network(
        &self,
        candidate: usize,
        targets: &Array2<f64>,
        columns: Vec<usize>,
    ) -> Result<Network> {
        let targets = targets.select(Axis(1), &columns);
        let (blank, validator) = self.validator(candidate, &targets)?;
        let (lambda, left_out) = leave_one_out(&validator, &targets)?;
        let solution = validator.solve(&lambda)?;
        Ok(Network {
            blank,
            columns,
            beta: solution.beta,
            intercept: solution.intercept,
            left_out,
        })
    }
}

/// Log evidence of each channel at the strength where that is largest.
fn most_evidence(validator: &Validator<f64>) -> Array1<f64> {
    let mut most = Array1::from_elem(validator.outputs(), f64::NEG_INFINITY);
    for strength in Ridge::candidates() {
        // One measurement: no evidence for anything.
        let Ok(evidence) = validator.log_evidence(&[strength]) else {
            break;
        };
        most.zip_mut_with(&Array1::from(evidence), |most, &found| {
            *most = most.max(found);
        });
    }
    most
}

/// The strengths that leave-one-out chooses, and what it misses the targets by.
fn leave_one_out(
    validator: &Validator<f64>,
    targets: &Array2<f64>,
) -> Result<(Vec<f64>, Array2<f64>)> {
    let lambda = validator.strengths(Ridge::leave_one_out())?;
    let residuals = match validator.leave_one_out(&lambda) {
        Ok(held_out) => held_out.residuals().to_owned(),
        // One measurement: nothing can be left out of it.
        Err(elm::Error::Undetermined { .. }) => targets.clone(),
        Err(error) => return Err(error.into()),
    };
    Ok((lambda, residuals))
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
        betas.push(network.of(&network.beta, group) * share);
        let constants = network.intercept.view().insert_axis(Axis(0)).to_owned();
        intercept.scaled_add(share, &network.of(&constants, group).row(0));
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
