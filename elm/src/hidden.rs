//! The random layer: weights and biases drawn once, and the forward pass
//! $f(\omega_k \cdot x_i + b_k)$ of equation 7, which fills the hidden-layer matrix of equation 9.
//!
//! That matrix is the paper's $F$; most of the literature, and this crate, call it $H$.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::{StandardNormal, StandardUniform};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::activation::Activation;
use crate::scalar::Scalar;

/// The distribution that hidden weights and biases are drawn from, before scaling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Distribution {
    /// Uniform on $[-1, 1)$, the usual choice of the ELM literature.
    #[default]
    Uniform,
    /// Normal with mean 0 and variance 1.
    Normal,
}

impl Distribution {
    /// The name, as it is written in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Normal => "normal",
        }
    }
}

/// Where the biases of the random layer come from.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Biases {
    /// Drawn as the weights are, and multiplied by the same scale.
    #[default]
    AsWeights,
    /// Drawn as the weights are, and multiplied by a scale of their own.
    Scaled(f64),
    /// Chosen so that each neuron's weighted sum is 0 at a training row drawn for it: the bend or
    /// bump of every neuron then lies where there are data, whatever the scale of the weights.
    OnData,
}

/// How a layer is drawn.
#[derive(Debug, Clone)]
pub(crate) struct Plan<A: Scalar> {
    pub(crate) neurons: usize,
    pub(crate) activation: Activation<A>,
    pub(crate) distribution: Distribution,
    /// Multiplies all weights.
    pub(crate) scale: f64,
    /// Multiplies the weights of each input; 1 for an input that is not listed.
    pub(crate) input_scales: Vec<f64>,
    pub(crate) biases: Biases,
    pub(crate) seed: u64,
}

/// The random hidden layer of a network: it is drawn, never trained.
///
/// One seed gives one layer on every platform: ChaCha8, drawn in `f64` and then rounded to `A`,
/// neuron by neuron, so that a layer of 50 neurons is the beginning of one of 100.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct HiddenLayer<A: Scalar> {
    /// Shape (inputs, neurons).
    weights: Array2<A>,
    /// Shape (neurons).
    biases: Array1<A>,
    activation: Activation<A>,
}

impl<A: Scalar> HiddenLayer<A> {
    /// Draws a layer for these (standardised) training rows.
    pub(crate) fn draw(x: ArrayView2<'_, A>, plan: &Plan<A>) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(plan.seed);
        let shape = (plan.neurons, x.ncols() + 1);
        let draws: Array2<f64> = match plan.distribution {
            Distribution::Uniform => Array2::random_using(shape, StandardUniform, &mut random)
                .mapv_into(|unit: f64| 2.0 * unit - 1.0),
            Distribution::Normal => Array2::random_using(shape, StandardNormal, &mut random),
        };
        let input_scale = |input: usize| plan.input_scales.get(input).copied().unwrap_or(1.0);
        // Laid out by rows, as the product reads it.
        let weights = Array2::from_shape_fn((x.ncols(), plan.neurons), |(input, neuron)| {
            A::from_f64(draws[[neuron, input]] * plan.scale * input_scale(input))
        });
        let drawn = |scale: f64| draws.column(x.ncols()).mapv(|b| A::from_f64(b * scale));
        let biases = match plan.biases {
            Biases::AsWeights => drawn(plan.scale),
            Biases::Scaled(scale) => drawn(scale),
            Biases::OnData => {
                // A stream of its own: the weights are those of the other choices.
                random.set_stream(2);
                let rows = weights.columns().into_iter().map(|column| {
                    let row = random.random_range(0..x.nrows().max(1));
                    -column.dot(&x.row(row))
                });
                rows.collect()
            }
        };
        Self {
            weights,
            biases,
            activation: plan.activation.clone(),
        }
    }

    /// The hidden-layer matrix of `x`: shape (rows, inputs) to (rows, neurons).
    pub(crate) fn forward(&self, x: ArrayView2<'_, A>) -> Array2<A> {
        let mut h = A::product(x, self.weights.view());
        h += &self.biases;
        self.activation.apply_in_place(h.view_mut());
        h
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.weights.nrows()
    }

    /// Number of neurons.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.weights.ncols()
    }

    /// The weights $\omega$, shape (inputs, neurons).
    #[must_use]
    pub fn weights(&self) -> ArrayView2<'_, A> {
        self.weights.view()
    }

    /// The biases $b$, one per neuron.
    #[must_use]
    pub fn biases(&self) -> ArrayView1<'_, A> {
        self.biases.view()
    }

    /// The activation function $f$.
    #[must_use]
    pub fn activation(&self) -> &Activation<A> {
        &self.activation
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{array, s};

    fn plan<A: Scalar>(neurons: usize, seed: u64) -> Plan<A> {
        Plan {
            neurons,
            activation: Activation::Tanh,
            distribution: Distribution::Uniform,
            scale: 1.0,
            input_scales: Vec::new(),
            biases: Biases::AsWeights,
            seed,
        }
    }

    fn draw(neurons: usize, seed: u64) -> HiddenLayer<f64> {
        HiddenLayer::draw(array![[0.5, -1.0, 2.0]].view(), &plan(neurons, seed))
    }

    #[test]
    fn a_seed_gives_the_same_layer_on_every_platform() {
        // The first neuron of ChaCha8 seeded with 7: a change here changes every saved figure.
        let layer = draw(2, 7);
        assert_eq!(
            layer.weights.column(0).to_vec(),
            [
                -0.684_407_805_958_761_3,
                -0.664_021_274_455_797_4,
                0.408_552_256_072_912_9
            ]
        );
        assert_eq!(layer.biases[0], 0.453_482_593_426_530_1);
        assert_ne!(layer, draw(2, 8));
    }

    #[test]
    fn a_small_layer_is_the_beginning_of_a_larger_one() {
        let (small, large) = (draw(4, 1), draw(9, 1));
        assert_eq!(small.weights, large.weights.slice(s![.., ..4]));
        assert_eq!(small.biases, large.biases.slice(s![..4]));
    }

    #[test]
    fn f32_is_the_rounded_f64_layer() {
        let normal = |biases| (Distribution::Normal, 0.3, biases);
        let (distribution, scale, biases) = normal(Biases::Scaled(2.0));
        let single = Plan::<f32> {
            distribution,
            scale,
            biases,
            ..plan(5, 9)
        };
        let double = Plan::<f64> {
            distribution,
            scale,
            biases,
            ..plan(5, 9)
        };
        let single = HiddenLayer::draw(array![[0.0_f32, 1.0]].view(), &single);
        let double = HiddenLayer::draw(array![[0.0, 1.0]].view(), &double);
        assert_eq!(single.weights, double.weights.mapv(|w| w as f32));
        assert_eq!(single.biases, double.biases.mapv(|b| b as f32));
    }

    #[test]
    fn biases_on_data_put_every_neuron_at_a_row() {
        let x = array![[0.5, -1.0], [3.0, 0.25], [-2.0, 8.0]];
        let plan = Plan {
            biases: Biases::OnData,
            scale: 50.0,
            ..plan(20, 4)
        };
        let layer = HiddenLayer::draw(x.view(), &plan);
        let z = x.dot(&layer.weights) + &layer.biases;
        for column in z.columns() {
            assert!(column.iter().any(|z: &f64| z.abs() < 1e-12), "{column}");
        }
    }

    #[test]
    fn input_scales_multiply_the_weights_of_their_input() {
        let x = array![[0.5, -1.0]];
        let scaled = Plan {
            input_scales: vec![1.0, 0.0],
            ..plan(3, 1)
        };
        let layer = HiddenLayer::draw(x.view(), &scaled);
        let whole = HiddenLayer::draw(x.view(), &plan(3, 1));
        assert_eq!(layer.weights.row(0), whole.weights.row(0));
        assert_eq!(layer.weights.row(1).sum(), 0.0);
    }

    #[test]
    fn the_forward_pass_is_equation_7() {
        let layer = draw(4, 3);
        let x = ndarray::array![[0.5, -1.0, 2.0], [0.0, 0.0, 0.0]];
        let h = layer.forward(x.view());
        for i in 0..2 {
            for k in 0..4 {
                let z: f64 = (0..3).map(|j| x[[i, j]] * layer.weights[[j, k]]).sum();
                approx::assert_abs_diff_eq!(
                    h[[i, k]],
                    (z + layer.biases[k]).tanh(),
                    epsilon = 1e-15
                );
            }
        }
    }
}
