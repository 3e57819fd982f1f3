//! The last step of every fit: output weights for a layer that is there, by a strength that
//! cross-validation chooses, and a look at what came of it.
//!
//! The strength makes small the error on rows that were left out, with the error added that single
//! precision would make: an exported network is evaluated in `f32`, where output weights that cancel
//! each other leave noise. [Anchors](super::anchors) say what happens where nothing was measured; while the
//! network returns more light than it receives, and than its measurements do by their nearest
//! neighbours, they count for more.

use elm::advanced::{FeatureMap, HiddenLayer};

use elm::Elm;
use ndarray::{Array1, Array2, Axis, Slice};

use super::Drawn;
use super::albedo_check::AlbedoCheck;
use super::censored::Censored;
use super::errors::{cut_off_means, geometric_root, no_fit};
use super::normal_equations::{WEAKEST, Weights, rounding};
use super::problem::Problem;
use super::rows::{Pull, Rows, STRENGTHS, TILE};
use crate::error::Result;
use crate::features::Features;
use crate::metrics::{Metric, Metrics};
use crate::model::{Draw, Layer};

/// The weight of the squared rounding error: what is exported is to be better than what rounding
/// alone leaves.
pub(super) const ROUNDING: f64 = 25.0;
/// While the albedo is not physical their weight grows tenfold, at most this number of times.
const STEPS: usize = 6;
/// Rounds of working residuals end where targets move by a two-thousandth of their size.
const CONVERGED: f64 = 2.5e-7;

/// Values of a hidden layer that are kept from round to round.
const KEPT: usize = 1 << 23;

/// What a layer came to.
pub(super) struct Finished {
    pub(super) features: Features,
    pub(super) layer: Layer,
    pub(super) network: Elm<f64>,
    pub(super) held_out: Option<Metrics>,
    /// The error on rows left out, by which layers are compared.
    pub(super) score: f64,
    /// By how much the albedo is above what it may be, 0 where it is not.
    pub(super) excess: f64,
}

/// A network, and what is known of it.
pub(super) struct Fitted {
    pub(super) network: Elm<f64>,
    /// What is predicted for the targets of the rows of the folds, each by the fit without its fold.
    pub(super) held_out: Array2<f64>,
    /// By how much the albedo is above what it may be, 0 where it is not.
    pub(super) excess: f64,
}

/// The fits without a fold each.
struct LeftOut {
    /// Of the targets of all validation rows, each by the fit without its fold.
    predicted: Array2<f64>,
    /// Of one of these fits.
    weights: Weights,
}

impl Problem<'_> {
    /// Judges a network.
    pub(super) fn finished(
        &self,
        features: Features,
        draw: Draw,
        fitted: Fitted,
    ) -> Result<Finished> {
        Ok(Finished {
            features,
            layer: Layer::Drawn(vec![draw]),
            score: self.score(&fitted.held_out)?,
            held_out: self.metrics(&fitted.held_out)?,
            network: fitted.network,
            excess: fitted.excess,
        })
    }

    /// Fits the output weights of a layer to the rows, whose inputs are `x`.
    pub(super) fn finish(
        &self,
        features: Features,
        drawn: &Drawn,
        x: &Array2<f64>,
    ) -> Result<Finished> {
        let map = &drawn.map;
        let reach = reach(map.layer());
        let rows = Rows::new(self, map, x)?;
        let (strength, held_out) = self.strength(&rows, &reach, None, (2..STRENGTHS).step_by(2))?;
        let at_anchors = map.transform(&features.compute(&self.anchors.pairs))?;
        let mut pull = Pull::new(self, at_anchors, &self.variances(&held_out));
        let mut albedo = AlbedoCheck::new(self.anisotropic);
        let (mut best, mut kept) = (None, Vec::new());
        for _ in 0..=STEPS {
            let near = rows.near(strength);
            let (strength, held_out) = self.strength(&rows, &reach, Some(&pull), near)?;
            let weights = self.solve(&rows, map, x, strength, &pull, &mut kept)?;
            let network = Elm::from_parts(map.clone(), weights.beta, weights.intercept)?;
            let excess = albedo.excess(features, &network, &self.transform, |pairs| {
                self.neighbors_guess(pairs)
            })?;
            let better = |&(_, _, known): &(_, _, f64)| excess < known;
            if best.as_ref().is_none_or(better) {
                best = Some((network, held_out, excess));
            }
            if excess <= 0.0 {
                break;
            }
            pull.times *= 10.0;
        }
        let Some((network, held_out, excess)) = best else {
            return Err(no_fit());
        };
        let fitted = Fitted {
            network,
            held_out,
            excess,
        };
        self.finished(features, drawn.draw.clone(), fitted)
    }

    fn metrics(&self, held_out: &Array2<f64>) -> Result<Option<Metrics>> {
        if self.folds.len() < 2 {
            return Ok(None);
        }
        let predicted = self.transform.to_values(held_out.clone())?;
        let values = self.values.select(Axis(0), &self.validation);
        Metrics::of(&self.validation_pairs, predicted.view(), values.view()).map(Some)
    }

    /// Errors of targets where RMSE is asked for: all rows count alike, where a few bright ones
    /// would decide the RMSE itself. The metric itself otherwise.
    fn score(&self, held_out: &Array2<f64>) -> Result<f64> {
        let metric = self.tuned.metric;
        if metric == Metric::Rmse {
            let transform = self.transform.plain();
            let values = self.values.select(Axis(0), &self.validation);
            let targets = transform.to_targets(values.view())?;
            let errors = self.transform.in_channels(held_out.view()) - targets;
            return Ok(geometric_root(&self.mean_squares(errors)));
        }
        let metrics = self.metrics(held_out)?;
        Ok(metrics.map_or(0.0, |metrics| metric.of(&metrics)))
    }

    /// The mean squared error of each output, the largest cut off.
    fn variances(&self, held_out: &Array2<f64>) -> Vec<f64> {
        self.mean_squares(held_out - &self.targets(&self.validation))
    }

    /// The mean squares of errors at the validation rows, the largest cut off.
    fn mean_squares(&self, errors: Array2<f64>) -> Vec<f64> {
        let mut squares = errors.mapv_into(|error| error * error);
        if let Some(weights) = self.weights(&self.validation) {
            squares *= &weights.insert_axis(Axis(1));
        }
        cut_off_means(squares.view())
    }

    /// The fits without each fold, for every strength that leaves the equations of all folds a triangle.
    fn held_out(
        &self,
        rows: &Rows,
        strengths: &[f64],
        pull: Option<&Pull>,
    ) -> Result<Vec<Option<LeftOut>>> {
        let outputs = self.targets.ncols();
        let mut predicted = vec![Array2::zeros((self.validation.len(), outputs)); strengths.len()];
        let mut whole: Vec<Option<Weights>> = vec![None; strengths.len()];
        let mut failed: Vec<bool> = vec![false; strengths.len()];
        let mut first = 0;
        for (number, fold) in self.folds.iter().enumerate() {
            let mut left = rows.total.clone();
            if self.folds.len() > 1 {
                left.add(&rows.folds[number], -1.0);
            }
            if let Some(pull) = pull {
                left.add(&pull.without[number], pull.times);
            }
            for (number, &strength) in strengths.iter().enumerate() {
                whole[number] = match left.factor(strength) {
                    Some(factor) => Some(factor.solve(&left)?),
                    None => None,
                };
                failed[number] |= whole[number].is_none();
            }
            let range = Slice::from(first..first + fold.len());
            first += fold.len();
            // One product for all strengths.
            let fitted = Weights::joined(whole.iter().flatten());
            let fitted = fitted.apply(rows.validation.slice_axis(Axis(0), range));
            let parts = fitted.axis_chunks_iter(Axis(1), outputs);
            let there = predicted
                .iter_mut()
                .zip(&whole)
                .filter(|(_, weights)| weights.is_some());
            for ((predicted, _), fitted) in there.zip(parts) {
                predicted.slice_axis_mut(Axis(0), range).assign(&fitted);
            }
        }
        let found = predicted.into_iter().zip(whole).zip(failed);
        Ok(found
            .map(|((predicted, whole), failed)| {
                whole
                    .filter(|_| !failed)
                    .map(|weights| LeftOut { predicted, weights })
            })
            .collect())
    }

    /// What squared errors of each output are relative to: the variance of its targets, which for coordinates
    /// in a basis is that of all together, as they are of one unit.
    fn spread(&self) -> Vec<f64> {
        let columns = self.targets.columns().into_iter();
        let spread: Vec<f64> = columns.map(|t| t.var(0.0).max(1e-300)).collect();
        match self.transform.basis() {
            None => spread,
            Some(_) => vec![spread.iter().sum(); spread.len()],
        }
    }

    /// Of the strengths of these steps the one with the least error on rows left out, and what is
    /// predicted for these.
    fn strength(
        &self,
        rows: &Rows,
        reach: &Array1<f64>,
        pull: Option<&Pull>,
        steps: impl Iterator<Item = usize>,
    ) -> Result<(f64, Array2<f64>)> {
        let spread = self.spread();
        let mut tried: Vec<(f64, f64, Array2<f64>)> = Vec::new();
        let strength = |step: usize| rows.scale * WEAKEST * 10_f64.powf(step as f64 / 2.0);
        let strengths: Vec<f64> = steps.map(strength).collect();
        let found = self.held_out(rows, &strengths, pull)?;
        for (strength, found) in strengths.into_iter().zip(found) {
            let Some(LeftOut { predicted, weights }) = found else {
                continue;
            };
            let errors = self.variances(&predicted);
            let rounded = rounding(weights.beta.view(), reach.view());
            let score: f64 = errors
                .iter()
                .zip(&rounded)
                .zip(&spread)
                .map(|((error, rounded), spread)| (error + ROUNDING * rounded.powi(2)) / spread)
                .sum();
            if score.is_finite() {
                tried.push((score, strength, predicted));
            }
        }
        let by_score = |&a: &usize, &b: &usize| tried[a].0.total_cmp(&tried[b].0);
        let mut chosen = (0..tried.len()).min_by(by_score).ok_or_else(no_fit)?;
        if self.noisy {
            chosen = self.strongest_as_good(&tried, chosen, &spread);
        }
        let (_, strength, held_out) = tried.swap_remove(chosen);
        Ok((strength, held_out))
    }

    /// Of the strengths above the best one the largest whose errors are not surely larger: by no more
    /// than the standard error of their mean difference. Where noise is as large as values, the
    /// difference between a slope and none is often luck.
    fn strongest_as_good(
        &self,
        tried: &[(f64, f64, Array2<f64>)],
        best: usize,
        spread: &[f64],
    ) -> usize {
        let targets = self.targets(&self.validation);
        let squares = |held_out: &Array2<f64>| -> Array1<f64> {
            let errors = (held_out - &targets).mapv_into(|error| error * error);
            errors.dot(&Array1::from_iter(spread.iter().map(|spread| 1.0 / spread)))
        };
        let least = squares(&tried[best].2);
        let as_good = |place: &usize| {
            let more = squares(&tried[*place].2) - &least;
            let mean = more.mean().unwrap_or(0.0);
            mean <= more.std(0.0) / (more.len() as f64).sqrt()
        };
        (best..tried.len()).rev().find(as_good).unwrap_or(best)
    }

    /// The output weights for all rows.
    ///
    /// The mean of a logarithm is not the logarithm of the mean: noise makes a network of mean targets
    /// too dark, the more, the darker the rows. Where the RMSE is asked for, residuals are therefore
    /// taken of the values, $(y - f) / (f + o)$, instead of the targets, $\ln (y + o) - \ln(f + o)$,
    /// whose mean is 0 where $f$ is the mean of $y$: the estimating equations of a regression with
    /// logarithmic transform whose deviation is proportional to $f + o$ (R. Wedderburn, *Quasi-Likelihood
    /// Functions, Generalized Linear Models, and the Gauss-Newton Method*, Biometrika 61(3), 1974),
    /// solved by the same factorisation.
    ///
    /// Tiles of the hidden-layer matrix are `kept` from one call to the next where there is room for all.
    fn solve(
        &self,
        rows: &Rows,
        map: &FeatureMap<f64>,
        x: &Array2<f64>,
        strength: f64,
        pull: &Pull,
        kept: &mut Vec<Array2<f64>>,
    ) -> Result<Weights> {
        let mut all = rows.total.clone();
        all.add(&pull.all, pull.times);
        let factor = all.factor(strength).ok_or_else(no_fit)?;
        let mut weights = factor.solve(&all)?;
        if self.tuned.metric != Metric::Rmse {
            return Ok(weights);
        }
        let mut censored = Censored::new(self.values, &self.noise);
        let keep = x.nrows() * weights.beta.nrows() <= KEPT;
        for _ in 0..censored.rounds() {
            let mut z = Array2::zeros(self.targets.dim());
            let mut moved = rows.total.without_targets();
            for (number, first) in (0..x.nrows()).step_by(TILE).enumerate() {
                let tile = Slice::from(first..(first + TILE).min(x.nrows()));
                let made = if number < kept.len() {
                    None
                } else {
                    Some(map.transform(&x.slice_axis(Axis(0), tile))?)
                };
                let h = made.as_ref().unwrap_or_else(|| &kept[number]);
                let fitted = weights.apply(h.view());
                let values = self.values.slice_axis(Axis(0), tile);
                let means = self.transform.to_values(fitted.clone())?;
                let values = censored.completed(values, means.view());
                let working = self
                    .transform
                    .working_targets(fitted.view(), values.view())?;
                moved.add_cross(&rows.total.again(h, &working, None), 1.0);
                z.slice_axis_mut(Axis(0), tile).assign(&working);
                if keep {
                    kept.extend(made);
                }
            }
            let guesses = self.guesses(&z, |_| true);
            moved.add_cross(
                &pull.all.again(&pull.h, &guesses, Some(&pull.weights)),
                pull.times,
            );
            let before = weights.apply(rows.validation.view());
            weights = factor.solve(&moved)?;
            let after = weights.apply(rows.validation.view());
            // What the noise moves, not what the rows say.
            let moved = (&after - &before).mapv_into(|d| d * d).sum();
            if moved <= CONVERGED * before.mapv(|t| t * t).sum() {
                break;
            }
            censored.learn();
        }
        Ok(weights)
    }
}

/// The size of the sum that each neuron's function is applied to, of standardized inputs.
pub(super) fn reach(hidden: &HiddenLayer<f64>) -> Array1<f64> {
    let squares = hidden.weights().mapv(|w| w * w).sum_axis(Axis(0));
    (squares + hidden.biases().mapv(|b| b * b)).mapv(f64::sqrt)
}
