//! Kinds of neurons, and what their weights are drawn from.

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
    /// Multivariate Student $t$ with $\nu \ge 1$ degrees of freedom: the normal weights
    /// of a neuron (not its bias) divided by one $\sqrt{\chi^2_\nu / \nu}$, so that some neurons are
    /// much steeper than most. Sine neurons with $\nu$ of 3 or 5 are random features of Matérn's
    /// covariance 3/2 or 5/2 (Rahimi and Recht, 2007).
    StudentT(u8),
}

impl Distribution {
    /// The name, as it is written in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Normal => "normal",
            Self::StudentT(_) => "student-t",
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
    Scaled(#[serde(serialize_with = "crate::numbers::finite")] f64),
    /// Chosen so that each neuron's weighted sum is 0 at a training row drawn for it: the bend or
    /// bump of every neuron then lies where there are data, whatever the scale of the weights. Rows
    /// that have weights of their own are drawn in proportion to them.
    OnData,
}

/// What a neuron's function is applied to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Kind {
    /// A weighted sum of the inputs and a bias, $\omega_k \cdot x + b_k$: the neurons of equation 7.
    #[default]
    Projection,
    /// The distance $\lVert s \odot (x - c_k) \rVert$ from a centre, a training row drawn for the
    /// neuron (no row twice until all are taken; in proportion to its weight), with each input
    /// multiplied by the scale of the weights, $s$. With [`Activation::Gaussian`] this is a radial
    /// basis function $e^{-\lVert s \odot (x - c_k) \rVert^2}$, whose width is the scale's inverse.
    Radial,
}

/// Neurons of one kind, to stand in one layer with others: see
/// [`ElmParams::and`](crate::ElmParams::and).
///
/// ```
/// use elm::{Activation, Biases, ElmParams, Neurons};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 100).insert_axis(Axis(1));
/// let params = ElmParams::new(20)
///     .activation(Activation::Tanh)
///     .and(Neurons::new(10, Activation::Sine).scale(3.0).biases(Biases::OnData))
///     .and(Neurons::radial(10));
/// let model = params.fit(&x, &x.mapv(|x: f64| x.abs()))?;
/// assert_eq!(model.hidden().neurons(), 40);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(bound = "", deny_unknown_fields)]
pub struct Neurons<A: Scalar> {
    pub(crate) count: usize,
    #[serde(default)]
    pub(crate) activation: Activation<A>,
    #[serde(default)]
    pub(crate) kind: Kind,
    #[serde(default = "one", serialize_with = "crate::numbers::finite")]
    pub(crate) scale: f64,
    #[serde(default)]
    pub(crate) biases: Biases,
}

/// The scale of a file that does not say.
fn one() -> f64 {
    1.0
}

impl<A: Scalar> Neurons<A> {
    /// This many neurons of equation 7.
    #[must_use]
    pub fn new(count: usize, activation: Activation<A>) -> Self {
        Self {
            count,
            activation,
            kind: Kind::Projection,
            scale: 1.0,
            biases: Biases::default(),
        }
    }

    /// This many Gaussian radial basis functions.
    #[must_use]
    pub fn radial(count: usize) -> Self {
        Self {
            kind: Kind::Radial,
            ..Self::new(count, Activation::Gaussian)
        }
    }

    /// What the function is applied to.
    #[must_use]
    pub fn kind(mut self, kind: Kind) -> Self {
        self.kind = kind;
        self
    }

    /// Multiplies the weights on top of [`ElmParams::scale`](crate::ElmParams::scale): how many
    /// times the scale of the layer these neurons have. 1 unless set.
    #[must_use]
    pub fn scale(mut self, scale: f64) -> Self {
        self.scale = scale;
        self
    }

    /// Where the biases come from; radial neurons have none.
    #[must_use]
    pub fn biases(mut self, biases: Biases) -> Self {
        self.biases = biases;
        self
    }

    /// Whether drawing takes more of the rows than the number of their inputs.
    pub(crate) fn need_rows(&self) -> bool {
        self.kind == Kind::Radial || self.biases == Biases::OnData
    }
}
