//! A network as exports need it: standardisation folded into the weights, neurons in order of their
//! functions, all numbers in the range of single precision.

use elm::Activation;

use super::error::ExportError;
use crate::features::Features;
use crate::model::BrdfModel;
use crate::target_transform::{Channel, FittedTransform};

/// A model ready to be written.
pub(super) struct Network {
    /// Names of the inputs.
    pub(super) inputs: Vec<&'static str>,
    pub(super) neurons: Vec<Neuron>,
    pub(super) outputs: Vec<Output>,
    pub(super) values: Values,
}

/// How values come of the outputs.
pub(super) enum Values {
    /// Each of its own output.
    Direct(Vec<Channel>),
    /// Red, green and blue of a spectrum.
    Color(Vec<Wavelength>),
}

impl Values {
    /// How many there are.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Direct(transforms) => transforms.len(),
            Self::Color(_) => 3,
        }
    }
}

/// A wavelength of a spectrum.
pub(super) struct Wavelength {
    /// Its target where all outputs are 0, and what each output adds.
    pub(super) mean: f64,
    pub(super) axes: Vec<f64>,
    pub(super) transform: Channel,
    /// What its value adds to red, green and blue.
    pub(super) color: [f64; 3],
}

/// A neuron: its function of the weighted sum of the inputs, or of the distance of the weighted
/// inputs from a center.
pub(super) struct Neuron {
    /// Name of the function.
    pub(super) activation: String,
    pub(super) weights: Vec<f64>,
    pub(super) bias: f64,
    /// In weighted inputs; `None` where the function is of the sum.
    pub(super) center: Option<Vec<f64>>,
    /// Output weights.
    pub(super) beta: Vec<f64>,
}

impl Neuron {
    /// Whether two can be computed side by side: radial neurons of one group share their weights.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let (own, others) = (self.center.is_some(), other.center.is_some());
        self.activation == other.activation
            && own == others
            && (!own || self.weights == other.weights)
    }
}

/// An output.
pub(super) struct Output {
    pub(super) constant: f64,
    /// Weights of the inputs themselves.
    pub(super) linear: Vec<f64>,
}

/// Takes weights of standardised inputs to weights of the inputs as they come.
struct Scaling<'a> {
    model: &'a BrdfModel,
}

impl Scaling<'_> {
    /// What standardisation takes from an input, and what it multiplies the rest by.
    fn of(&self, input: usize) -> (f64, f64) {
        let scaler = self.model.network().scaler();
        scaler.map_or((0.0, 1.0), |s| (s.mean()[input], s.factor()[input]))
    }

    /// The weights of a weighted sum, and the constant that standardisation adds to it.
    fn additive(&self, weights: &[f64]) -> (Vec<f64>, f64) {
        let mut constant = 0.0;
        let weights = weights.iter().enumerate();
        let scaled = weights.map(|(input, weight)| {
            let (mean, factor) = self.of(input);
            let scaled = weight * factor;
            constant -= scaled * mean;
            scaled
        });
        let scaled = scaled.collect();
        (turned(self.model.features(), scaled), constant)
    }

    /// The scales s and the center c of a distance |s (x - mean) factor - c|.
    fn radial(&self, scales: &[f64], center: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let both = scales.iter().zip(center).enumerate();
        both.map(|(input, (scale, center))| {
            let (mean, factor) = self.of(input);
            let scale = scale * factor;
            (scale, center + scale * mean)
        })
        .unzip()
    }
}

/// What outputs add up of the inputs themselves.
struct Linear {
    constants: Vec<f64>,
    weights: Vec<Vec<f64>>,
}

impl Linear {
    /// Adds a neuron without an activation.
    fn add(&mut self, weights: &[f64], bias: f64, betas: &[f64]) {
        for (output, &beta) in betas.iter().enumerate() {
            self.constants[output] += beta * bias;
            for (sum, weight) in self.weights[output].iter_mut().zip(weights) {
                *sum += beta * weight;
            }
        }
    }
}

impl Network {
    pub(super) fn new(model: &BrdfModel) -> Result<Self, ExportError> {
        let network = model.network();
        let hidden = network.hidden();
        let (inputs, outputs) = (network.inputs(), network.outputs());
        let (beta, intercept) = (network.beta(), network.intercept());
        let scaling = Scaling { model };
        let mut neurons = Vec::new();
        let mut linear = Linear {
            constants: intercept.to_vec(),
            weights: vec![vec![0.0; inputs]; outputs],
        };
        let of_group = hidden.groups().iter();
        let of_group = of_group.flat_map(|group| std::iter::repeat_n(group, group.neurons()));
        for (neuron, group) in of_group.enumerate() {
            let activation = group.activation().name();
            // One of the user's own may have the name of another.
            if let Activation::Custom(_) = group.activation() {
                let name = activation.to_owned();
                return Err(ExportError::Activation { name });
            }
            let betas = beta.row(neuron).to_vec();
            let own = hidden.weights().column(neuron).to_vec();
            if let Some(scales) = group.input_scales() {
                let (weights, center) = scaling.radial(&scales.to_vec(), &own);
                neurons.push(Neuron {
                    activation: activation.to_owned(),
                    center: Some(all_in_range("a center", center)?),
                    weights: all_in_range("a scale", weights)?,
                    bias: 0.0,
                    beta: all_in_range("an output weight", betas)?,
                });
                continue;
            }
            let (weights, constant) = scaling.additive(&own);
            let bias = hidden.biases()[neuron] + constant;
            if activation == "linear" {
                linear.add(&weights, bias, &betas);
                continue;
            }
            neurons.push(Neuron {
                activation: activation.to_owned(),
                weights: all_in_range("a hidden weight", weights)?,
                bias: in_range("a hidden bias", bias)?,
                center: None,
                beta: all_in_range("an output weight", betas)?,
            });
        }
        // With direct links the inputs' rows follow the neurons'.
        for input in 0..beta.nrows() - hidden.neurons() {
            let mut own = vec![0.0; inputs];
            own[input] = 1.0;
            let (weights, constant) = scaling.additive(&own);
            let betas = beta.row(hidden.neurons() + input).to_vec();
            linear.add(&weights, constant, &betas);
        }
        let order = |neuron: &Neuron| (neuron.activation.clone(), neuron.center.is_some());
        neurons.sort_by_key(order);

        let outputs = linear.constants.into_iter().zip(linear.weights);
        Ok(Self {
            values: values(model)?,
            inputs: model.features().inputs().to_vec(),
            neurons,
            outputs: outputs
                .map(|(constant, linear)| {
                    Ok(Output {
                        constant: in_range("an intercept", constant)?,
                        linear: all_in_range("a direct link", linear)?,
                    })
                })
                .collect::<Result<_, ExportError>>()?,
        })
    }

    /// Puts the channels at `places` in this order, in place of all outputs. Channels that are combinations
    /// of fewer outputs have outputs of their own then.
    pub(super) fn select(
        &mut self,
        transform: &FittedTransform,
        places: &[usize],
    ) -> Result<(), ExportError> {
        let weights = |outputs: &[f64], place: usize| match transform.basis() {
            Some(basis) => {
                let axis = basis.axes().column(place);
                outputs.iter().zip(axis).map(|(o, a)| o * a).sum()
            }
            None => outputs[place],
        };
        let mean = |place: usize| transform.basis().map_or(0.0, |basis| basis.mean()[place]);
        let of_channels =
            |outputs: &[f64]| -> Vec<f64> { places.iter().map(|&p| weights(outputs, p)).collect() };
        for neuron in &mut self.neurons {
            let beta = of_channels(&neuron.beta);
            neuron.beta = all_in_range("an output weight", beta)?;
        }
        let constants: Vec<f64> = self.outputs.iter().map(|output| output.constant).collect();
        let constants = of_channels(&constants);
        let mut linear = vec![vec![0.0; self.inputs.len()]; places.len()];
        for input in 0..self.inputs.len() {
            let own: Vec<f64> = self.outputs.iter().map(|o| o.linear[input]).collect();
            for (row, weight) in linear.iter_mut().zip(of_channels(&own)) {
                row[input] = weight;
            }
        }
        self.outputs = places
            .iter()
            .zip(constants)
            .zip(linear)
            .map(|((&place, constant), linear)| {
                Ok(Output {
                    constant: in_range("an intercept", constant + mean(place))?,
                    linear: all_in_range("a direct link", linear)?,
                })
            })
            .collect::<Result<_, ExportError>>()?;
        let transforms = transform.by_channel();
        self.values = Values::Direct(places.iter().map(|&place| transforms[place]).collect());
        Ok(())
    }
}

fn values(model: &BrdfModel) -> Result<Values, ExportError> {
    let transform = model.target_transform();
    let transforms = transform.by_channel();
    let Some(color) = transform.color() else {
        return Ok(Values::Direct(transforms.to_vec()));
    };
    let wavelength = |(k, (&of_channel, color)): (usize, (&Channel, &[f64; 3]))| {
        let (mean, axes) = match transform.basis() {
            Some(basis) => (basis.mean()[k], basis.axes().column(k).to_vec()),
            None => {
                let mut own = vec![0.0; transforms.len()];
                own[k] = 1.0;
                (0.0, own)
            }
        };
        let [r, g, b] = *color;
        Ok(Wavelength {
            mean: in_range("a mean target", mean)?,
            axes: all_in_range("an axis", axes)?,
            transform: of_channel,
            color: [
                in_range("a colour", r)?,
                in_range("a colour", g)?,
                in_range("a colour", b)?,
            ],
        })
    };
    let wavelengths = transforms.iter().zip(color).enumerate().map(wavelength);
    Ok(Values::Color(wavelengths.collect::<Result<_, _>>()?))
}

/// Weights of the inputs of a grain along x, for those of one along another direction.
fn turned(features: Features, mut weights: Vec<f64>) -> Vec<f64> {
    if let (Features::Anisotropic { .. }, [.., cos_weight, sin_weight]) =
        (features, &mut weights[..])
    {
        let (sin, cos) = (2.0 * features.azimuth()).sin_cos();
        (*cos_weight, *sin_weight) = (
            cos * *cos_weight - sin * *sin_weight,
            sin * *cos_weight + cos * *sin_weight,
        );
    }
    weights
}

/// The number, if single precision has its range.
fn in_range(what: &'static str, value: f64) -> Result<f64, ExportError> {
    if (value as f32).is_finite() {
        Ok(value)
    } else {
        Err(ExportError::Single { what, value })
    }
}

fn all_in_range(what: &'static str, values: Vec<f64>) -> Result<Vec<f64>, ExportError> {
    for &value in &values {
        in_range(what, value)?;
    }
    Ok(values)
}
