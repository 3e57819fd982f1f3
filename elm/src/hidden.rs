//! The random layer: weights and biases drawn once, and the forward pass
//! $f(\omega_k \cdot x_i + b_k)$ of equation 7, which fills the hidden-layer matrix of equation 9.
//!
//! That matrix is the paper's $F$; most of the literature, and this crate, call it $H$.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, s};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::{StandardNormal, StandardUniform};
use rand::SeedableRng;
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
    /// Draws a layer. Weights are multiplied by `scale`, biases by `bias_scale`.
    pub(crate) fn draw(
        inputs: usize,
        neurons: usize,
        distribution: Distribution,
        scale: f64,
        bias_scale: f64,
        activation: Activation<A>,
        seed: u64,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let shape = (neurons, inputs + 1);
        let draws: Array2<f64> = match distribution {
            Distribution::Uniform => Array2::random_using(shape, StandardUniform, &mut rng)
                .mapv_into(|unit: f64| 2.0 * unit - 1.0),
            Distribution::Normal => Array2::random_using(shape, StandardNormal, &mut rng),
        };
        let weights = draws
            .slice(s![.., ..inputs])
            .t()
            .mapv(|w| A::from_f64(w * scale));
        let biases = draws
            .index_axis(Axis(1), inputs)
            .mapv(|b| A::from_f64(b * bias_scale));
        // The transpose above is laid out by columns; rows are what the product reads.
        Self {
            weights: weights.as_standard_layout().into_owned(),
            biases,
            activation,
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

    fn draw(neurons: usize, seed: u64) -> HiddenLayer<f64> {
        HiddenLayer::draw(
            3,
            neurons,
            Distribution::Uniform,
            1.0,
            1.0,
            Activation::Tanh,
            seed,
        )
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
        let single: HiddenLayer<f32> =
            HiddenLayer::draw(3, 5, Distribution::Normal, 0.3, 1.0, Activation::Tanh, 9);
        let double: HiddenLayer<f64> =
            HiddenLayer::draw(3, 5, Distribution::Normal, 0.3, 1.0, Activation::Tanh, 9);
        assert_eq!(single.weights, double.weights.mapv(|w| w as f32));
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
