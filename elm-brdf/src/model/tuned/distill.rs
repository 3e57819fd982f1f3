//! A small network that comes as near as it can to the [limit](super::limit) of large ones.
//!
//! Of few measurements a network of very many frequencies is more accurate than a small one: it averages
//! over what the measurements leave open. But it is as smooth as the measurements say, and what is smooth
//! needs few neurons. The small network is fitted to the large one, which can be asked anywhere and has no
//! noise: at the measured directions, and at others over the whole hemisphere (C. Buciluă, R. Caruana,
//! A. Niculescu-Mizil, *Model Compression*, KDD 2006).

use elm::advanced::FeatureMap;
use elm::prune::Keep;
use elm::solve::Ridge;
use elm::{Dataset, Elm, ElmParams};
use ndarray::{Array1, Array2, Axis, Slice};

use super::Drawn;
use super::albedo_check::AlbedoCheck;
use super::anchors::scatter;
use super::errors::{no_fit, row_weights};
use super::finish::{Finished, Fitted, ROUNDING, reach};
use super::normal_equations::{NormalEquations, WEAKEST, Weights, rounding};
use super::problem::Problem;
use crate::error::Result;
use crate::features::Features;
use crate::streams::{self, generator};
use elm_datasets::geometry::DirectionPair;

/// The strength under which neurons are ranked, relative to the largest squared singular value.
const RIDGE: f64 = 1e-9;
/// Measured directions at which the networks are compared, at most.
const MEASURED: usize = 1000;
/// What all directions that were not measured count, where all that were count 1.
const BETWEEN: f64 = 0.25;
/// Times that this is raised tenfold, while the albedo of the small network is not physical.
const STEPS: usize = 2;
/// Strengths tried, two to a decade, and how many of them without a gain end the search.
const STRENGTHS: usize = 26;
const NO_GAIN: usize = 4;

/// What a large network says at any directions: with all rows, and without those of each fold.
pub(super) trait Teacher {
    fn targets(&self, pairs: &[DirectionPair]) -> (Array2<f64>, Vec<Array2<f64>>);
}

/// Where the small network is to be like the large one.
struct Places {
    x: Array2<f64>,
    /// Measured ones come first.
    measured: usize,
    /// What an error counts, without [`BETWEEN`].
    weights: Array1<f64>,
    targets: Array2<f64>,
    /// Of the large network without each fold.
    without: Vec<Array2<f64>>,
}

impl Places {
    fn new(problem: &Problem<'_>, features: Features, teacher: &impl Teacher) -> Result<Self> {
        let mut random = generator(problem.tuned.seed, streams::DISTILL);
        let validation = problem.validation_pairs.iter().copied();
        let mut pairs: Vec<DirectionPair> = validation.take(MEASURED).collect();
        let measured = pairs.len();
        pairs.extend(scatter(&mut random, problem.anisotropic));
        let (targets, without) = teacher.targets(&pairs);
        let values = problem.transform.to_values(targets.clone())?;
        let weights = row_weights(
            problem.tuned.metric,
            &pairs,
            values.view(),
            &problem.transform,
        );
        Ok(Self {
            x: features.compute(&pairs),
            measured,
            weights: weights.unwrap_or_else(|| Array1::ones(pairs.len())),
            targets,
            without,
        })
    }

    /// The weights where directions that were not measured count `between` times, all of them together.
    fn weighted(&self, between: f64) -> Array1<f64> {
        let mut weights = self.weights.clone();
        let share = between * self.measured as f64 / (weights.len() - self.measured) as f64;
        weights
            .slice_axis_mut(Axis(0), Slice::from(self.measured..))
            .mapv_inplace(|weight| share * weight);
        weights
    }
}

impl Problem<'_> {
    /// The best of `neurons` neurons of `candidates`, fitted to what `teacher` says.
    pub(super) fn distilled(
        &self,
        features: Features,
        teacher: &impl Teacher,
        candidates: Drawn,
        params: &ElmParams<f64>,
        neurons: usize,
    ) -> Result<Finished> {
        let places = Places::new(self, features, teacher)?;
        let params = params.clone().with_solver(Ridge::relative(RIDGE));
        let weights = places.weighted(BETWEEN);
        let data = Dataset::new(&places.x, &places.targets)?.with_weights(&weights)?;
        let pruned = params.prune_map(candidates.map.clone(), &data, Keep::Neurons(neurons))?;
        let drawn = candidates.pruned(&pruned.kept)?;
        let fitted = self.like(features, &drawn.map, &places)?;
        self.finished(features, drawn.draw, fitted)
    }

    /// The layer with output weights of which the albedo is physical, if there are any.
    fn like(&self, features: Features, map: &FeatureMap<f64>, places: &Places) -> Result<Fitted> {
        let h = map.transform(&places.x)?;
        let validation = map.transform(&features.compute(&self.validation_pairs))?;
        let mut albedo = AlbedoCheck::new(self.anisotropic);
        let mut best: Option<Fitted> = None;
        let mut between = BETWEEN;
        for _ in 0..=STEPS {
            let weights = places.weighted(between);
            let equations = NormalEquations::of(h.view(), places.targets.view(), Some(&weights));
            let (strength, found) = self.weights_like(map, &h, places, &weights, &equations)?;
            let network = Elm::from_parts(map.clone(), found.beta, found.intercept)?;
            let excess = albedo.excess(features, &network, &self.transform, |pairs| {
                self.neighbors_guess(pairs)
            })?;
            if best.as_ref().is_none_or(|best| excess < best.excess) {
                let factor = equations.factor(strength).ok_or_else(no_fit)?;
                let mut held_out = Array2::zeros((self.validation.len(), self.targets.ncols()));
                let mut first = 0;
                for (fold, targets) in self.folds.iter().zip(&places.without) {
                    let solved = factor.solve(&equations.again(&h, targets, Some(&weights)))?;
                    let range = Slice::from(first..first + fold.len());
                    let fitted = solved.apply(validation.slice_axis(Axis(0), range));
                    held_out.slice_axis_mut(Axis(0), range).assign(&fitted);
                    first += fold.len();
                }
                best = Some(Fitted {
                    network,
                    held_out,
                    excess,
                });
            }
            if excess <= 0.0 {
                break;
            }
            between *= 10.0;
        }
        best.ok_or_else(no_fit)
    }

    /// The output weights, and their strength, with the least error at the places, that of rounding added.
    fn weights_like(
        &self,
        map: &FeatureMap<f64>,
        h: &Array2<f64>,
        places: &Places,
        weights: &Array1<f64>,
        equations: &NormalEquations,
    ) -> Result<(f64, Weights)> {
        let reach = reach(map.layer());
        let mut chosen: Option<(f64, f64, Weights)> = None;
        let mut best_step = STRENGTHS;
        for step in 0..STRENGTHS {
            if step > best_step.saturating_add(NO_GAIN) {
                break;
            }
            let strength = equations.scale() * WEAKEST * 10_f64.powf(step as f64 / 2.0);
            let Some(factor) = equations.factor(strength) else {
                continue;
            };
            let solved = factor.solve(equations)?;
            let squares = (solved.apply(h.view()) - &places.targets).mapv_into(|e| e * e);
            let errors = squares.t().dot(weights) / weights.sum();
            let rounded = rounding(solved.beta.view(), reach.view());
            let score: f64 = errors
                .iter()
                .zip(&rounded)
                .map(|(error, rounded)| error + ROUNDING * rounded.powi(2))
                .sum();
            if score.is_finite() && chosen.as_ref().is_none_or(|(least, ..)| score < *least) {
                chosen = Some((score, strength, solved));
                best_step = step;
            }
        }
        let (_, strength, weights) = chosen.ok_or_else(no_fit)?;
        Ok((strength, weights))
    }
}
