//! What single precision costs a model: output weights that nearly cancel magnify every rounding.

use elm::Activation;
use elm_datasets::Angles;
use ndarray::{Array2, Zip};

use super::error::ExportError;
use super::network::{Network, Neuron};
use crate::batch;
use crate::error::{Error, Result};
use crate::model::BrdfModel;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;

/// The error of evaluating a model in `f32` in place of `f64`, over directions all over the
/// hemisphere, near the mirror direction and back towards the light. In 1/sr, over all channels.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SinglePrecision {
    /// Root mean square of the error.
    pub rmse: f64,
    /// Its largest.
    pub largest: f64,
    /// Root mean square of the model's own values at these directions.
    pub scale: f64,
}

impl SinglePrecision {
    /// The part of a model's own held-out RMSE that single precision may add: errors that are
    /// independent then add up to 1.03 times the model's own.
    pub const PART: f64 = 0.25;
    /// The part of the values that it may add where nothing was held out.
    pub const PART_OF_VALUES: f64 = 0.01;
    /// What it may always add, as a part of the values: some ten roundings of each.
    pub const ALWAYS: f64 = 1e-5;

    /// The largest [`rmse`](Self::rmse) that a model with this held-out RMSE in 1/sr may have to
    /// be evaluated in single precision.
    #[must_use]
    pub fn limit(&self, held_out: Option<f64>) -> f64 {
        let own = match held_out {
            Some(error) => Self::PART * error,
            None => Self::PART_OF_VALUES * self.scale,
        };
        own.max(Self::ALWAYS * self.scale)
    }
}

impl BrdfModel {
    /// The error of evaluating this model in single precision, as its [exports](crate::export) do.
    ///
    /// At each pair of directions it is the larger of two: the error of an evaluation in `f32`,
    /// weights, directions and inputs rounded too, against [`eval`](Brdf::eval); and the standard
    /// deviation of the error that roundings independent of each other add up to (N. Higham,
    /// T. Mary, *A New Approach to Probabilistic Rounding Error Analysis*, SIAM J. Sci. Comput.
    /// 41(5), 2019), to first order. The second does not depend on the order of sums or on one
    /// program's functions. Takes some milliseconds.
    ///
    /// # Errors
    /// [`ExportError`] for a network that has no form in single precision, such as one with a
    /// function of the user's own.
    pub fn single_precision_error(&self) -> Result<SinglePrecision> {
        let pairs = survey();
        let network = Network::new(self)?;
        // The network's weights have the direction of a grain in them.
        let inputs = batch::inputs_of::<f32>(self.features().along_x(), &pairs);
        let exact = self.eval(&pairs)?;
        let shape = (pairs.len(), network.outputs.len());
        let mut single = Array2::zeros(shape);
        let mut spread = Array2::zeros(shape);
        let functions = functions(&network)?;
        for (row, x) in inputs.rows().into_iter().enumerate() {
            let x = x.to_vec();
            let of_neurons = neurons(&network.neurons, &functions, &x);
            for (channel, output) in network.outputs.iter().enumerate() {
                let mut sum = Sum::default();
                sum.add(output.constant as f32, output.constant.abs());
                for (&weight, x) in output.linear.iter().zip(&x) {
                    let term = weight as f32 * x;
                    sum.add(term, f64::from(term.abs()));
                }
                for (neuron, (h, off)) in network.neurons.iter().zip(&of_neurons) {
                    let beta = neuron.beta[channel] as f32;
                    sum.add(beta * h, f64::from(beta.abs()) * off);
                }
                single[[row, channel]] = f64::from(sum.total);
                spread[[row, channel]] = sum.standard_deviation();
            }
        }
        self.errors(&pairs, &exact, &single, &spread)
    }

    /// From targets in single precision, and the standard deviation of their errors, to the
    /// errors of values.
    fn errors(
        &self,
        pairs: &[DirectionPair],
        exact: &Array2<f64>,
        single: &Array2<f64>,
        spread: &Array2<f64>,
    ) -> Result<SinglePrecision> {
        let transform = self.target_transform();
        let outputs = self.network().predict(&self.features().compute(pairs))?;
        let targets = transform.in_channels(outputs.view());
        let single = &transform.in_channels(single.view());
        // Of a sum of outputs, whose errors do not know each other.
        let spread = &match transform.basis() {
            None => spread.clone(),
            Some(basis) => {
                let squares = spread.mapv(|s| s * s);
                squares
                    .dot(&basis.axes().mapv(|a| a * a))
                    .mapv_into(f64::sqrt)
            }
        };
        let values = |targets: Array2<f64>| -> Result<Array2<f64>> {
            // A number beyond single precision is not one of the model's.
            Ok(transform
                .values_of_channels(targets)?
                .mapv(|value| if value.is_finite() { value } else { 0.0 }))
        };
        let found = values(single.clone())?;
        let (above, below) = (values(&targets + spread)?, values(&targets - spread)?);
        let mut worst = Array2::zeros(exact.dim());
        Zip::from(&mut worst)
            .and(exact)
            .and(&found)
            .and(&above)
            .and(&below)
            .for_each(|worst: &mut f64, exact, found, above, below| {
                let reach = (above - exact).abs().max((below - exact).abs());
                *worst = (found - exact).abs().max(reach);
            });
        let mean_square = |values: &Array2<f64>| -> f64 {
            let squares: f64 = values.iter().map(|value| value * value).sum();
            (squares / values.len().max(1) as f64).sqrt()
        };
        Ok(SinglePrecision {
            rmse: mean_square(&worst),
            largest: worst.iter().copied().fold(0.0, f64::max),
            scale: mean_square(exact),
        })
    }
}

/// Refuses a model whose values single precision moves by more than [`SinglePrecision::limit`].
///
/// # Errors
/// [`ExportError::Precision`], and those of [`BrdfModel::single_precision_error`].
pub fn check_precision(model: &BrdfModel) -> Result<SinglePrecision> {
    let found = model.single_precision_error()?;
    let held_out = model.provenance().held_out.map(|errors| errors.rmse);
    let limit = found.limit(held_out);
    // Also for an error that is no number.
    if found.rmse <= limit {
        return Ok(found);
    }
    Err(Error::Export(ExportError::Precision {
        found: found.rmse,
        limit,
        held_out,
    }))
}

/// Half the distance of numbers next to 1: the relative error of a rounding.
const EPS: f64 = 5.960_464_477_539_063e-8;

/// A sum in single precision, and what is known of its error.
#[derive(Default)]
struct Sum {
    total: f32,
    /// The sum of squares of errors of terms and of partial sums, in roundings.
    squares: f64,
}

impl Sum {
    /// Adds a term whose error is `roundings` roundings.
    fn add(&mut self, term: f32, roundings: f64) {
        self.total += term;
        let partial = f64::from(self.total);
        self.squares += roundings * roundings + partial * partial;
    }

    fn standard_deviation(&self) -> f64 {
        // The exponential that follows is off by a rounding of its argument and one of its own.
        let last = 1.0 + f64::from(self.total).abs();
        EPS * (self.squares + last * last).sqrt()
    }
}

fn functions(network: &Network) -> Result<Vec<Activation<f32>>, ExportError> {
    let function = |neuron: &Neuron| {
        neuron
            .activation
            .parse()
            .map_err(|_| ExportError::Activation {
                name: neuron.activation.clone(),
            })
    };
    network.neurons.iter().map(function).collect()
}

/// The value of each neuron in single precision, and by how many roundings it is off.
fn neurons(neurons: &[Neuron], functions: &[Activation<f32>], x: &[f32]) -> Vec<(f32, f64)> {
    let one = |(neuron, function): (&Neuron, &Activation<f32>)| {
        let (mut z, mut size) = (neuron.bias as f32, neuron.bias.abs());
        match &neuron.center {
            Some(center) => {
                for ((&weight, x), &center) in neuron.weights.iter().zip(x).zip(center) {
                    let (scaled, center) = (weight as f32 * x, center as f32);
                    let part = scaled - center;
                    z += part * part;
                    // A distance moves by no more than what it is the length of.
                    size += f64::from(scaled.abs() + center.abs());
                }
                z = z.sqrt();
            }
            None => {
                for (&weight, x) in neuron.weights.iter().zip(x) {
                    let term = weight as f32 * x;
                    z += term;
                    size += f64::from(term.abs());
                }
            }
        }
        let h = function.apply(z);
        // All have slopes of at most 1 but the step, which has none, and the square.
        let slope = match function {
            Activation::HardLimit => 0.0,
            Activation::SquaredRelu => 2.0 * f64::from(z.abs()),
            _ => 1.0,
        };
        (h, 1.0 + f64::from(h.abs()) + slope * size)
    };
    neurons.iter().zip(functions).map(one).collect()
}

/// Pairs of directions at which models are held against themselves: a low-discrepancy sequence
/// over both polar angles and the azimuth between them (M. Roberts's R3: powers of the inverse of
/// the root of x^4 = x + 1), and an eighth of the pairs each about the mirror direction and about
/// the light.
fn survey() -> Vec<DirectionPair> {
    const COUNT: u32 = 2048;
    const STEPS: [f64; 3] = [
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_2,
        0.549_700_477_901_970_2,
    ];
    /// Just above the horizon, in radians.
    const MAX: f64 = 1.55;
    /// How far from the mirror direction or the light, in radians.
    const NEAR: f64 = 0.1;
    let at = |number: u32| {
        let u = STEPS.map(|step| (0.5 + step * f64::from(number)).fract());
        let theta_i = MAX * u[0];
        let near = theta_i + NEAR * (2.0 * u[1] - 1.0);
        let turned = NEAR * (2.0 * u[2] - 1.0);
        let (theta_o, phi_o) = match number % 8 {
            0 => (near, std::f64::consts::PI + turned),
            1 => (near, turned),
            _ => (MAX * u[1], std::f64::consts::TAU * u[2]),
        };
        DirectionPair::from(Angles {
            theta_i,
            phi_i: 0.0,
            theta_o: theta_o.clamp(0.0, MAX),
            phi_o,
        })
    };
    (1..=COUNT).map(at).collect()
}
