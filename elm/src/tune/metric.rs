//! The learned metric: how much the layer sees of each input, and of each ramp along it, by the slopes
//! that a network has there.
//!
//! A round draws a layer, solves it, and takes the root mean square slopes of the network along all that
//! its neurons see; the next layer's weights are scaled by them. After rounds along ramps an input's
//! axis is stretched where the targets change, and shrunk where they do not: a warp of every input,
//! learned by a few ridge solves (Radhakrishnan, Beaglehole, Pandit and Belkin, Mechanism for feature
//! learning in neural networks and backpropagation-free machine learning models, Science 383, 2024).
//!
//! Within a round the scale of all weights and the strength of ridge are those of the least generalized
//! cross-validation score. That score does not leave a row out of the slopes, so that the number of rounds,
//! and whether there are ramps, are chosen by errors of rows that the slopes have not seen.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};

use super::Trial;
use super::slopes::proportional;
use crate::activation::Activation;
use crate::bounds::Bounds;
use crate::error::{Error, Result};
use crate::feature_map::{Biases, Distribution, Embedding, FeatureMap, Ramps, Scaler};
use crate::model::ElmParams;
use crate::solve::beside::{Beside, FIRST_STEP, SharedColumns};
use crate::stats::Moments;

/// Rounds at most.
pub(super) const ROUNDS: usize = 3;
/// Rows at which slopes are taken.
pub(super) const SLOPE_ROWS: usize = 1000;
/// Root mean square weighted sums that the first round tries; a factor of 2 apart.
const FIRST_SPREAD: f64 = 0.4;
const SPREADS: (f64, f64) = (0.05, 6.5);

/// The rows of a search, and what its layers see of them.
pub(super) struct Seen {
    pub(super) x: Array2<f64>,
    /// Each output has mean 0 and deviation 1.
    pub(super) targets: Array2<f64>,
    pub(super) weights: Option<Array1<f64>>,
    scaler: Scaler<f64>,
    ramps: Option<Ramps<f64>>,
    /// The inputs as layers see them.
    u: Array2<f64>,
    variances: Array1<f64>,
    bounded: bool,
    seed: u64,
}

/// What a round found.
#[derive(Debug, Clone)]
pub(super) struct Round {
    /// Of the weights, before the columns' own.
    pub(super) scale: f64,
    /// Of the columns that neurons see.
    pub(super) column_scales: Vec<f64>,
    /// Root mean square weighted sum.
    spread: f64,
    step: i32,
}

/// Rounds on some rows of a search.
pub(super) struct Path<'a> {
    seen: &'a Seen,
    rows: Vec<usize>,
    u: Array2<f64>,
    columns: SharedColumns,
    neurons: usize,
    /// Layers that may still be solved.
    pub(super) left: usize,
    pub(super) trials: Vec<Trial>,
}

/// A layer, solved.
struct Attempt {
    round: Round,
    map: FeatureMap<f64>,
    solved: Beside,
}

impl Seen {
    pub(super) fn new(
        x: Array2<f64>,
        targets: Array2<f64>,
        weights: Option<Array1<f64>>,
        bins: Option<usize>,
        seed: u64,
    ) -> Self {
        let view = weights.as_ref().map(|weights| weights.view());
        let scaler = Scaler::measure(x.view(), view);
        let ramps = bins.map(|bins| Ramps::of(x.view(), view, bins));
        let u = see(&scaler, ramps.as_ref(), x.view());
        Self {
            variances: variances(u.view(), view),
            x,
            targets,
            weights,
            scaler,
            ramps,
            u,
            bounded: true,
            seed,
        }
    }

    /// Whether predictions are held to the ranges of the rows that a network was fitted to.
    pub(super) fn with_bounded(mut self, bounded: bool) -> Self {
        self.bounded = bounded;
        self
    }

    pub(super) fn has_ramps(&self) -> bool {
        self.ramps.as_ref().is_some_and(|ramps| ramps.columns() > 0)
    }

    pub(super) fn embedding(&self) -> Embedding<f64> {
        match &self.ramps {
            Some(ramps) => Embedding::Ramps(ramps.clone()),
            None => Embedding::Inputs,
        }
    }

    /// The scale of weights at which weighted sums have this root mean square.
    fn scale(&self, wanted: f64, column_scales: &[f64]) -> f64 {
        let of_one = spread(column_scales, &self.variances);
        if of_one > 0.0 {
            wanted / of_one
        } else {
            wanted
        }
    }

    fn weights_of(&self, rows: &[usize]) -> Option<Array1<f64>> {
        let weights = self.weights.as_ref()?;
        Some(weights.select(Axis(0), rows))
    }
}

/// What neurons see of inputs.
fn see(scaler: &Scaler<f64>, ramps: Option<&Ramps<f64>>, x: ArrayView2<'_, f64>) -> Array2<f64> {
    let scaled = scaler.transform(x);
    match ramps {
        Some(ramps) => ramps.beside(scaled.view(), x),
        None => scaled,
    }
}

/// The settings of a layer of this search.
pub(super) fn layer(neurons: usize, seed: u64) -> ElmParams<f64> {
    ElmParams::new(neurons)
        .with_activation(Activation::Tanh)
        .with_biases(Biases::AtTrainingRows)
        .with_distribution(Distribution::Normal)
        .with_direct_links(true)
        .with_seed(seed)
}

/// Rows that a path does not see, and judges its networks by.
struct Held {
    u: Array2<f64>,
    targets: Array2<f64>,
    /// Of the rows that it does see.
    bounds: Option<Bounds<f64>>,
}

impl Held {
    fn new(path: &Path<'_>, held: &[usize]) -> Self {
        let seen = path.seen;
        let (x, t) = (&seen.x, &seen.targets);
        let weights = seen.weights_of(&path.rows);
        let weights = weights.as_ref().map(|weights| weights.view());
        let own = |matrix: &Array2<f64>| matrix.select(Axis(0), &path.rows);
        let bounds = Bounds::of(own(x).view(), own(t).view(), weights, seen.bounded);
        let mut x = x.select(Axis(0), held);
        if let Some(bounds) = &bounds {
            bounds.hold_inputs(&mut x);
        }
        Self {
            u: see(&seen.scaler, seen.ramps.as_ref(), x.view()),
            targets: t.select(Axis(0), held),
            bounds,
        }
    }

    /// The squared error of each row, the sum over outputs, of predictions as the fitted network will make
    /// them: a single row far from the others would decide for all, else.
    fn squared_errors(&self, attempt: &Attempt) -> Array1<f64> {
        let hidden = attempt.map.layer().forward(self.u.view());
        let mut predicted = attempt.solved.predict(hidden.view(), self.u.view());
        if let Some(bounds) = &self.bounds {
            bounds.hold_predictions(&mut predicted);
        }
        let errors = &self.targets - &predicted;
        errors.map_axis(Axis(1), |row| row.dot(&row))
    }
}

impl<'a> Path<'a> {
    /// On `rows`, solving at most `left` layers.
    pub(super) fn new(
        seen: &'a Seen,
        rows: Vec<usize>,
        neurons: usize,
        left: usize,
    ) -> Result<Self> {
        let u = seen.u.select(Axis(0), &rows);
        let targets = seen.targets.select(Axis(0), &rows);
        let weights = seen.weights_of(&rows);
        let weights = weights.as_ref().map(|weights| weights.view());
        Ok(Self {
            columns: SharedColumns::new(u.view(), targets.view(), weights)?,
            seen,
            rows,
            u,
            neurons,
            left,
            trials: Vec::new(),
        })
    }

    /// Round after round; `held` rows are judged after each: returns the rounds, and the squared errors of
    /// `held` by each, the sum over outputs.
    ///
    /// # Errors
    /// [`Error::NoConvergence`] where not one layer can be solved.
    pub(super) fn run(
        &mut self,
        rounds: usize,
        held: &[usize],
    ) -> Result<Vec<(Round, Array1<f64>)>> {
        let held = Held::new(self, held);
        let mut found: Vec<(Round, Array1<f64>)> = Vec::new();
        let mut scales = vec![1.0; self.u.ncols()];
        let (mut spread, mut step) = (FIRST_SPREAD, FIRST_STEP);
        for round in 0..=rounds {
            let Some(best) = self.best_scale(&scales, spread, step) else {
                break;
            };
            found.push((best.round.clone(), held.squared_errors(&best)));
            (spread, step) = (best.round.spread, best.round.step);
            match self.slopes(&best) {
                Some(slopes) if round < rounds => scales = slopes,
                _ => break,
            }
        }
        if found.is_empty() {
            return Err(Error::NoConvergence {
                what: "the search for a weight scale",
            });
        }
        Ok(found)
    }

    /// Uphill and downhill from a spread, by factors of 2.
    fn best_scale(&mut self, scales: &[f64], spread: f64, step: i32) -> Option<Attempt> {
        let mut best = self.attempt(scales, spread, step);
        for factor in [2.0, 0.5] {
            let mut moved = false;
            while let Some(here) = best
                .as_ref()
                .map(|best| (best.round.spread, best.round.step))
            {
                let next = here.0 * factor;
                if next < SPREADS.0 || next > SPREADS.1 {
                    break;
                }
                let tried = self.attempt(scales, next, here.1);
                let better = match (&tried, &best) {
                    (Some(tried), Some(best)) => tried.solved.score < best.solved.score,
                    _ => false,
                };
                if !better {
                    break;
                }
                (best, moved) = (tried, true);
            }
            if moved {
                break;
            }
        }
        best
    }

    fn attempt(&mut self, scales: &[f64], spread: f64, step: i32) -> Option<Attempt> {
        if self.left == 0 {
            return None;
        }
        self.left -= 1;
        let scale = self.seen.scale(spread, scales);
        let params = layer(self.neurons, self.seen.seed)
            .with_scale(scale)
            .with_input_scales(scales.to_vec())
            .with_embedding(self.seen.embedding());
        let x = self.seen.x.select(Axis(0), &self.rows);
        let weights = self.seen.weights_of(&self.rows);
        let weights = weights.as_ref().map(|weights| weights.view());
        let scaler = Some(self.seen.scaler.clone());
        let map = params.feature_map().draw_scaled(x.view(), scaler, weights);
        let map = map.ok()?;
        let hidden = map.layer().forward(self.u.view());
        let solved = self.columns.solve(hidden.view(), step)?;
        self.trials.push(Trial {
            neurons: self.neurons,
            scale,
            input_scales: scales.to_vec(),
            direct_links: true,
            score: (solved.score / self.seen.targets.ncols() as f64).sqrt(),
        });
        Some(Attempt {
            round: Round {
                scale,
                column_scales: scales.to_vec(),
                spread,
                step: solved.step,
            },
            map,
            solved,
        })
    }

    /// Scales in proportion to the slopes of a network; nothing where there are none.
    fn slopes(&self, attempt: &Attempt) -> Option<Vec<f64>> {
        let every = self.u.nrows().div_ceil(SLOPE_ROWS).max(1);
        let u = self.u.slice(ndarray::s![..;every, ..]);
        let weights = self.seen.weights_of(&self.rows);
        let weights = weights.map(|weights| weights.slice(ndarray::s![..;every]).to_owned());
        let mut squares = Array1::<f64>::zeros(u.ncols());
        for beta in attempt.solved.beta.columns() {
            let slopes = attempt.map.slopes(u, beta).mapv_into(|slope| slope * slope);
            squares += &match &weights {
                None => slopes.sum_axis(Axis(0)),
                Some(weights) => slopes.t().dot(weights),
            };
        }
        proportional(&squares.mapv_into(f64::sqrt).to_vec(), 1.0)
    }
}

/// The root mean square weighted sum of what neurons see, for weights of deviation 1 times those scales.
pub(super) fn spread(column_scales: &[f64], variances: &Array1<f64>) -> f64 {
    let squares = column_scales.iter().zip(variances);
    let sum: f64 = squares
        .map(|(scale, variance)| scale * scale * variance)
        .sum();
    sum.sqrt()
}

/// The variance of each column.
pub(super) fn variances(
    matrix: ArrayView2<'_, f64>,
    weights: Option<ArrayView1<'_, f64>>,
) -> Array1<f64> {
    let of = |column: ArrayView1<'_, f64>| {
        let moments = Moments::of(column.insert_axis(Axis(1)), weights);
        moments.deviations().next().map_or(0.0, |d| d * d)
    };
    matrix.columns().into_iter().map(of).collect()
}

/// Widened rows of a matrix.
pub(super) fn wide<A: crate::Scalar>(matrix: ArrayView2<'_, A>) -> Array2<f64> {
    matrix.mapv(crate::Scalar::as_f64)
}

#[test]
fn a_row_far_outside_is_judged_as_the_fitted_network_would_predict_it() {
    let mut x = Array2::from_shape_fn((121, 2), |(row, input)| {
        (row as f64 * [0.618_034, 0.414_214][input]).fract()
    });
    let targets = x.map_axis(Axis(1), |x| 5.0 * x[0] + x[1]);
    let targets = targets.insert_axis(Axis(1));
    x[[120, 0]] = 30.0;
    let rows: Vec<usize> = (0..120).collect();
    let error = |bounded| {
        let seen = Seen::new(x.clone(), targets.clone(), None, Some(8), 1).with_bounded(bounded);
        let mut path = Path::new(&seen, rows.clone(), 50, 100).unwrap();
        path.run(1, &[120]).unwrap().last().unwrap().1[0]
    };
    // Targets lie between 0 and 6, and predictions within a quarter more on either side.
    assert!(error(true) <= 7.5_f64.powi(2), "{}", error(true));
    assert!(error(false) > 100.0_f64.powi(2), "{}", error(false));
}
