//! A reflectance model whose settings are chosen by held-out errors.

mod few;
mod lean;
mod many;

use elm::{Activation, Biases, Distribution, Elm, ElmParams, HiddenLayer, Neurons, Scaler};
use ndarray::{Array1, Array2, ArrayView2, Axis};

use super::{BrdfModel, Draw, Provenance};
use crate::brdf::{Brdf, Fit, check};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::geometry::Pair;
use crate::metrics::Metric;
use crate::quality;
pub use lean::Lean;

/// Fits a network and chooses what is left open: inputs, the scale of each input, regularisation,
/// and, of many neurons drawn, which to keep.
///
/// # Parameters
///
/// | name | default | purpose |
/// |---|---|---|
/// | `features` | chosen | the inputs |
/// | `metric` | RMSE | the held-out error that is made small |
/// | `neurons` | see below | size of the network |
/// | `max_floats` | none | most numbers that the model may store |
/// | `seed` | 1 | random layers, and rows drawn for the search |
///
/// **Few measurements** (up to [`Tuned::MANY`]): sine neurons with random frequencies. The scales of
/// the inputs are tried from a fixed low-discrepancy set, each with its strength of regularisation by
/// exact leave-one-out; the best [`MEMBERS`](Tuned::MEMBERS), judged by their
/// [evidence](elm::validate::Validator::log_evidence) for RMSE and by leave-one-out for other metrics,
/// are averaged into one network, 400 neurons each. With `neurons` or `max_floats` given, the best
/// alone is taken. Inputs are [`Features::SumDifference`] unless said otherwise.
///
/// **Many measurements**: inputs and scales by a search on part of the rows, judged on others; then
/// more neurons than wanted are drawn and the less useful are [pruned](elm::prune); then one solve on
/// all rows, weighted by what the metric makes of an error. 213 neurons unless said otherwise, which
/// for three channels is 675 stored numbers. The errors in the model's
/// [provenance](super::Provenance) are those of the search's small network on the rows that judged it:
/// an upper bound more than an estimate.
///
/// As [`Fit`] every channel is chosen for by itself; [`fit_model`](Self::fit_model) makes one network
/// for all channels.
///
/// ```
/// use elm_brdf::{brdf::Brdf, geometry::pairs, model::Tuned};
/// use elm_datasets::{Invalid, MaterialId, synthetic};
///
/// let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
/// let samples = data.samples(0).ok_or("no such material")?;
/// let pairs = pairs(&samples.directions);
/// let tuned = Tuned { neurons: Some(60), ..Tuned::default() };
/// let model = tuned.fit_model(&pairs, samples.values.view())?;
/// assert_eq!(model.network().hidden().neurons(), 60);
/// println!("{} numbers, held-out {:?}", model.stored_floats(), model.provenance().held_out);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuned {
    /// Inputs; `None` to choose.
    pub features: Option<Features>,
    /// The error that is made small.
    pub metric: Metric,
    /// Neurons; `None` for the default.
    pub neurons: Option<usize>,
    /// The most numbers that the model may store; `None` for no limit.
    pub max_floats: Option<usize>,
    /// Seed.
    pub seed: u64,
}

impl Default for Tuned {
    fn default() -> Self {
        Self {
            features: None,
            metric: Metric::Rmse,
            neurons: None,
            max_floats: None,
            seed: 1,
        }
    }
}

impl Tuned {
    /// With more measurements than this they count as many.
    pub const MANY: usize = 1500;
    /// Networks that are averaged for few measurements.
    pub const MEMBERS: usize = 6;

    /// Fits one network for all channels of `values` (BRDF in 1/sr, shape (pairs, channels)).
    ///
    /// # Errors
    /// Where these measurements cannot be fitted, or `max_floats` leaves no neuron.
    pub fn fit_model(&self, pairs: &[Pair], values: ArrayView2<'_, f64>) -> Result<BrdfModel> {
        check(pairs, values)?;
        let all: Vec<usize> = (0..values.ncols()).collect();
        if pairs.len() > Self::MANY {
            return many::fit(self, pairs, values);
        }
        let mut models = few::fit(self, pairs, values, &[all])?;
        models.pop().ok_or(Error::Elm(elm::Error::NoConvergence {
            what: "the search for a network",
        }))
    }

    /// The sets of inputs to choose among.
    fn sets(&self, open: &[Features]) -> Vec<Features> {
        self.features.map_or_else(|| open.to_vec(), |set| vec![set])
    }

    /// The neurons that the limits allow, or `usual`. `drawn` says how many are drawn for so many
    /// to be kept, which of them being a bit each; `per_link` numbers go with each channel's link.
    fn size(
        &self,
        usual: usize,
        inputs: usize,
        channels: usize,
        per_link: usize,
        drawn: impl Fn(usize) -> usize,
    ) -> Result<usize> {
        let wanted = self.neurons.unwrap_or(usual);
        let Some(most) = self.max_floats else {
            return Ok(wanted);
        };
        // Mean, factor and scale of each input; constant and link of each channel.
        let fixed = 3 * inputs + channels * (1 + per_link);
        let floats = |neurons: usize| fixed + channels * neurons + drawn(neurons).div_ceil(32);
        let largest = self.neurons.unwrap_or(most / channels);
        (1..=largest)
            .rev()
            .find(|&neurons| floats(neurons) <= most)
            .ok_or(Error::Elm(elm::Error::Parameter {
                name: "max_floats",
                value: most as f64,
                expected: "enough for the scales, the links and one neuron: some 20 and more",
            }))
    }

    /// Sine neurons of normal frequencies at three scales: heavier tails than one scale has.
    fn waves(&self, neurons: usize, input_scales: &[f64]) -> ElmParams<f64> {
        let third = neurons / 3;
        let params = ElmParams::new(neurons - 2 * third)
            .activation(Activation::Sine)
            .distribution(Distribution::Normal)
            .biases(Biases::Scaled(std::f64::consts::PI))
            .input_scales(input_scales.to_vec())
            .seed(self.seed);
        let group = |scale: f64| {
            Neurons::new(third, Activation::Sine)
                .scale(scale)
                .biases(Biases::Scaled(std::f64::consts::PI))
        };
        if third == 0 {
            return params;
        }
        params.and(group(0.6)).and(group(1.7))
    }
}

impl Fit for Tuned {
    fn fit(&self, pairs: &[Pair], values: ArrayView2<'_, f64>) -> Result<Box<dyn Brdf>> {
        check(pairs, values)?;
        let each: Vec<Vec<usize>> = (0..values.ncols()).map(|channel| vec![channel]).collect();
        let models = if pairs.len() > Self::MANY {
            each.iter()
                .map(|channel| many::fit(self, pairs, values.select(Axis(1), channel).view()))
                .collect::<Result<_>>()?
        } else {
            few::fit(self, pairs, values, &each)?
        };
        Ok(Box::new(SideBySide(models)))
    }
}

/// Models of one channel or more each, side by side.
pub(crate) struct SideBySide(pub(crate) Vec<BrdfModel>);

impl Brdf for SideBySide {
    fn channels(&self) -> usize {
        self.0.iter().map(Brdf::channels).sum()
    }

    fn multiply_adds(&self) -> usize {
        self.0.iter().map(Brdf::multiply_adds).sum()
    }

    fn eval(&self, pairs: &[Pair]) -> Result<Array2<f64>> {
        let mut values = Array2::zeros((pairs.len(), self.channels()));
        let mut first = 0;
        for model in &self.0 {
            for column in model.eval(pairs)?.columns() {
                values.column_mut(first).assign(&column);
                first += 1;
            }
        }
        Ok(values)
    }

    fn floats_per_channel(&self) -> usize {
        self.0
            .iter()
            .map(Brdf::floats_per_channel)
            .max()
            .unwrap_or(0)
    }
}

/// A drawn layer as a network that gives its hidden-layer matrix, without output weights yet.
struct Blank {
    draw: Draw,
    network: Elm<f64>,
}

impl Blank {
    fn new(params: ElmParams<f64>, scales: usize, scaler: &Scaler<f64>) -> Result<Self> {
        let inputs = scaler.mean().len();
        let hidden = params.clone().check()?.hidden_layer(inputs)?;
        let draw = Draw {
            params,
            kept: None,
            scales,
        };
        let network = without_weights(scaler, hidden)?;
        Ok(Self { draw, network })
    }

    fn matrix(&self, x: &Array2<f64>) -> Result<Array2<f64>> {
        Ok(self.network.hidden_matrix(x)?)
    }
}

/// A network that is not fitted yet.
pub(crate) fn without_weights(scaler: &Scaler<f64>, hidden: HiddenLayer<f64>) -> Result<Elm<f64>> {
    let beta = Array2::zeros((hidden.neurons(), 1));
    Ok(Elm::from_parts(
        Some(scaler.clone()),
        hidden,
        beta,
        Array1::zeros(1),
    )?)
}

/// What is known of measurements whatever is fitted to them.
fn provenance(
    seed: u64,
    metric: Metric,
    pairs: &[Pair],
    values: ArrayView2<'_, f64>,
) -> Provenance {
    let exchanged = quality::exchanged(pairs);
    let floors: Vec<f64> = values
        .columns()
        .into_iter()
        .filter_map(|column| quality::NoiseFloor::of(&exchanged, column))
        .map(|floor| floor.sigma)
        .collect();
    let channels = floors.len();
    Provenance {
        rows: pairs.len(),
        seed,
        metric: Some(metric),
        noise_floor: (channels > 0).then(|| floors.iter().sum::<f64>() / channels as f64),
        ..Provenance::default()
    }
}
