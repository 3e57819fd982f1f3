//! Networks that are cheap to evaluate: few neurons of one function on arithmetic inputs.

use elm::prune::Keep;
use elm::solve::Ridge;
use elm::{Activation, Biases, Distribution, ElmParams, Scaler};
use ndarray::{Array2, ArrayView2, Axis};
use rand::seq::index;

use super::errors::row_weights;
use super::large_data::RIDGE;
use super::{Drawn, dataset, provenance};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::fit::{Fit, check};
use crate::metrics::{Metric, Metrics};
use crate::model::{BrdfModel, Layer};
use crate::streams::{self, generator};
use crate::target_transform::{FittedTransform, TargetTransform};
use elm_datasets::geometry::DirectionPair;

/// A network of `neurons` neurons of one function, made for cheap [evaluation](crate::batch).
///
/// # Parameters
///
/// | name | default | purpose |
/// |---|---|---|
/// | `neurons` | of [`new`](Self::new) | size of the network |
/// | `features` | [`Features::Algebraic`] | the inputs |
/// | `activation` | [`Activation::SquaredRelu`] | the neurons' function |
/// | `pruned` | yes | drawn in plenty and [pruned](elm::prune), or just drawn |
/// | `metric` | RMSE | the held-out error that chooses, and that rows are weighted for |
/// | `seed` | 1 | random layers, and rows drawn for the search |
///
/// The target is the log. The scales of weights and biases are those, of six pairs, whose network
/// has the least error on rows that it was not fitted to, of 1500 to fit and 1500 to judge at most;
/// of many rows the scale of each input is then moved where that lowers this error. At last the output
/// weights are fitted to all rows, by a ridge whose strength leave-one-out chooses where there are
/// few (up to 1500).
///
/// ```
/// use elm_brdf::{batch::Packed, model::Compact};
/// use elm_datasets::{Invalid, MaterialId, synthetic};
///
/// let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
/// let samples = data.samples(0).ok_or("no such material")?;
/// let model = Compact::new(16).fit_model(&samples.directions, samples.values.view())?;
/// let packed: Packed<f32> = Packed::new(&model)?;
/// assert_eq!(packed.neurons(), 16);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Compact {
    /// Size of the network.
    pub neurons: usize,
    /// The inputs.
    pub features: Features,
    /// The neurons' function.
    pub activation: Activation<f64>,
    /// Whether more neurons are drawn than are kept.
    pub pruned: bool,
    /// The error that is made small.
    pub metric: Metric,
    /// Seed.
    pub seed: u64,
}

/// Rows that the search fits to, and as many others that judge, at most.
const ROWS: usize = 1500;
/// Neurons drawn for each one kept, up to [`MAX_DRAWN`].
const DRAWN: usize = 8;
const MAX_DRAWN: usize = 256;
/// Scales of weights, and deviations of biases.
const SCALES: [f64; 3] = [0.5, 1.0, 2.0];
const BIASES: [f64; 2] = [0.9, 1.8];
/// An input's scale is moved by these factors in turn.
const STEPS: [f64; 3] = [2.0, 1.414, 1.2];

impl Compact {
    /// So many neurons, and the defaults.
    #[must_use]
    pub fn new(neurons: usize) -> Self {
        Self {
            neurons,
            features: Features::Algebraic,
            activation: Activation::SquaredRelu,
            pruned: true,
            metric: Metric::Rmse,
            seed: 1,
        }
    }

    /// Fits one network for all channels of `values` (BRDF in 1/sr, shape (pairs, channels)).
    ///
    /// # Errors
    /// Where these measurements cannot be fitted, or the settings are out of range.
    pub fn fit_model(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
    ) -> Result<BrdfModel> {
        check(pairs, values)?;
        let transform = TargetTransform::default_log().fit(values)?;
        let targets = transform.to_targets(values)?;
        let x = self.features.compute_training(pairs);
        let scaler = Scaler::measured(&x)?;
        let mut random = generator(self.seed, streams::COMPACT);
        let wanted = pairs.len().min(2 * ROWS);
        let rows = index::sample(&mut random, pairs.len(), wanted).into_vec();
        // Of few rows most are needed for the fit. A single one is fitted and judges.
        let judges = if wanted == 2 * ROWS { ROWS } else { wanted / 4 };
        let (fitted, validation) = rows.split_at(wanted - judges);
        let search = Search {
            lean: self,
            scaler: &scaler,
            transform: &transform,
            ridge: ridge(pairs.len()),
            x: x.select(Axis(0), fitted),
            targets: targets.select(Axis(0), fitted),
            weights: row_weights(
                self.metric,
                &select(pairs, fitted),
                values.select(Axis(0), fitted).view(),
                &transform,
            ),
        };
        let validation = if validation.is_empty() {
            fitted
        } else {
            validation
        };
        let judge = Judge {
            pairs: select(pairs, validation),
            x: x.select(Axis(0), validation),
            values: values.select(Axis(0), validation),
        };
        let mut best: Option<Found> = None;
        for (scale, bias) in SCALES.into_iter().flat_map(|s| BIASES.map(|b| (s, b))) {
            let found = search.try_scales(vec![scale; x.ncols()], bias, &judge)?;
            if best.as_ref().is_none_or(|best| found.error < best.error) {
                best = Some(found);
            }
        }
        let Some(mut best) = best else {
            return Err(Error::NoConvergence {
                what: "the search for a network",
            });
        };
        if pairs.len() > ROWS {
            for (step, input) in STEPS
                .into_iter()
                .flat_map(|s| (0..x.ncols()).map(move |i| (s, i)))
            {
                for factor in [step, 1.0 / step] {
                    let mut scales = best.scales.clone();
                    scales[input] *= factor;
                    let found = search.try_scales(scales, best.bias, &judge)?;
                    if found.error < best.error {
                        best = found;
                    }
                }
            }
        }
        let Found {
            drawn, held_out, ..
        } = best;
        let weights = row_weights(self.metric, pairs, values, &transform);
        let data = dataset(&x, &targets, weights.as_ref())?;
        let network = search.solve().fit_map(drawn.map, &data)?;
        let mut about = provenance(self.seed, self.metric, pairs, values);
        about.held_out = Some(held_out);
        let layer = Layer::Drawn(vec![drawn.draw]);
        Ok(BrdfModel::new(self.features, transform, layer, network).with_provenance(about))
    }
}

impl Fit for Compact {
    type Model = BrdfModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        self.fit_model(pairs, values)
    }
}

/// Of many measurements the noise averages out; of few, leave-one-out says how strong a ridge it
/// takes.
fn ridge(rows: usize) -> Ridge {
    if rows > ROWS {
        Ridge::relative(RIDGE)
    } else {
        Ridge::leave_one_out()
    }
}

fn select(pairs: &[DirectionPair], rows: &[usize]) -> Vec<DirectionPair> {
    rows.iter().map(|&row| pairs[row]).collect()
}

/// Scales, and what a network with them is worth.
struct Found {
    scales: Vec<f64>,
    bias: f64,
    drawn: Drawn,
    held_out: Metrics,
    error: f64,
}

struct Search<'a> {
    lean: &'a Compact,
    scaler: &'a Scaler<f64>,
    transform: &'a FittedTransform,
    ridge: Ridge,
    x: Array2<f64>,
    targets: Array2<f64>,
    weights: Option<ndarray::Array1<f64>>,
}

struct Judge {
    pairs: Vec<DirectionPair>,
    x: Array2<f64>,
    values: Array2<f64>,
}

impl Search<'_> {
    /// How output weights are found. Directions are bounded by themselves.
    fn solve(&self) -> ElmParams<f64> {
        let params = ElmParams::new(self.lean.neurons).with_bounded(false);
        params.with_solver(self.ridge)
    }

    fn try_scales(&self, scales: Vec<f64>, bias: f64, judge: &Judge) -> Result<Found> {
        let neurons = self.lean.neurons;
        let count = if self.lean.pruned {
            neurons.max((DRAWN * neurons).min(MAX_DRAWN.max(neurons + neurons / 2)))
        } else {
            neurons
        };
        let params = ElmParams::new(count)
            .with_activation(self.lean.activation.clone())
            .with_distribution(Distribution::Normal)
            .with_input_scales(scales.clone())
            .with_biases(Biases::Scaled(bias))
            .with_seed(self.lean.seed);
        let mut drawn = Drawn::new(&params, scales.len(), self.scaler)?;
        let params = self.solve();
        let data = dataset(&self.x, &self.targets, self.weights.as_ref())?;
        if count > neurons {
            let keep = Keep::Neurons(neurons);
            let map = drawn.map.clone();
            let pruned = params.prune_map(map, &data, keep)?;
            drawn = drawn.pruned(&pruned.kept)?;
        }
        let map = drawn.map.clone();
        let network = params.fit_map(map, &data)?;
        let predicted = self.transform.to_values(network.predict(&judge.x)?)?;
        let held_out = Metrics::of(&judge.pairs, predicted.view(), judge.values.view())?;
        Ok(Found {
            scales,
            bias,
            drawn,
            error: self.lean.metric.of(&held_out),
            held_out,
        })
    }
}
