//! Groups of neurons, and what their weights are drawn from.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::activation::Activation;
use crate::scalar::Scalar;

/// The distribution that hidden weights and biases are drawn from, before scaling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
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
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Biases {
    /// Drawn as the weights are, and multiplied by the same scale.
    #[default]
    AsWeights,
    /// Drawn as the weights are, and multiplied by a scale of their own.
    Scaled(#[cfg_attr(feature = "serde", serde(serialize_with = "crate::numbers::finite"))] f64),
    /// Chosen so that each neuron's weighted sum is 0 at a training row drawn for it: the bend or
    /// bump of every neuron then lies where there are data, whatever the scale of the weights. Rows
    /// that have weights of their own are drawn in proportion to them.
    #[cfg_attr(feature = "serde", serde(alias = "on-data"))]
    AtTrainingRows,
}

/// What a neuron's function is applied to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum NodeType {
    /// A weighted sum of the inputs and a bias, $\omega_k \cdot x + b_k$: the neurons of equation 7.
    #[default]
    #[cfg_attr(feature = "serde", serde(alias = "projection"))]
    Additive,
    /// The distance $\lVert s \odot (x - c_k) \rVert$ from a center, a training row drawn for the
    /// neuron (no row twice until all are taken; in proportion to its weight), with each input multiplied
    /// by the scale of the weights, $s$. With [`Activation::Gaussian`] this is a radial basis function
    /// $e^{-\lVert s \odot (x - c_k) \rVert^2}$, whose width is the scale's inverse.
    #[cfg_attr(feature = "serde", serde(alias = "radial"))]
    Rbf,
}

/// A group of like neurons, to stand in one layer with others: see
/// [`ElmParams::with_group`](crate::ElmParams::with_group).
///
/// ```
/// use elm::{Activation, Biases, ElmParams, NeuronGroup};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 100).insert_axis(Axis(1));
/// let params = ElmParams::new(20)
///     .with_activation(Activation::Tanh)
///     .with_group(
///         NeuronGroup::new(10, Activation::Sine)
///             .with_scale(3.0)
///             .with_biases(Biases::AtTrainingRows),
///     )
///     .with_group(NeuronGroup::rbf(10));
/// let model = params.fit(&x, &x.mapv(|x: f64| x.abs()))?;
/// assert_eq!(model.hidden().neurons(), 40);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", deny_unknown_fields))]
pub struct NeuronGroup<A: Scalar> {
    pub(crate) count: usize,
    #[cfg_attr(feature = "serde", serde(default))]
    pub(crate) activation: Activation<A>,
    #[cfg_attr(feature = "serde", serde(default, alias = "kind"))]
    pub(crate) node_type: NodeType,
    #[cfg_attr(
        feature = "serde",
        serde(default = "one", serialize_with = "crate::numbers::finite")
    )]
    pub(crate) scale: f64,
    #[cfg_attr(feature = "serde", serde(default))]
    pub(crate) biases: Biases,
}

/// The scale of a file that does not say.
#[cfg(feature = "serde")]
fn one() -> f64 {
    1.0
}

impl<A: Scalar> NeuronGroup<A> {
    /// This many neurons of equation 7.
    #[must_use]
    pub fn new(count: usize, activation: Activation<A>) -> Self {
        Self {
            count,
            activation,
            node_type: NodeType::Additive,
            scale: 1.0,
            biases: Biases::default(),
        }
    }

    /// This many Gaussian radial basis functions.
    #[must_use]
    pub fn rbf(count: usize) -> Self {
        Self {
            node_type: NodeType::Rbf,
            ..Self::new(count, Activation::Gaussian)
        }
    }

    /// What the function is applied to.
    #[must_use]
    pub fn with_node_type(mut self, node_type: NodeType) -> Self {
        self.node_type = node_type;
        self
    }

    /// Multiplies the weights on top of [`ElmParams::with_scale`](crate::ElmParams::with_scale): how many
    /// times the scale of the layer these neurons have. 1 unless set.
    #[must_use]
    pub fn with_scale(mut self, scale: f64) -> Self {
        self.scale = scale;
        self
    }

    /// Where the biases come from; radial neurons have none.
    #[must_use]
    pub fn with_biases(mut self, biases: Biases) -> Self {
        self.biases = biases;
        self
    }

    /// Number of neurons.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.count
    }

    /// The activation function.
    #[must_use]
    pub fn activation(&self) -> &Activation<A> {
        &self.activation
    }

    /// What the function is applied to.
    #[must_use]
    pub fn node_type(&self) -> NodeType {
        self.node_type
    }

    /// What the weights are multiplied by on top of the scale of the layer.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Where the biases come from.
    #[must_use]
    pub fn biases(&self) -> Biases {
        self.biases
    }

    /// Whether drawing takes more of the rows than the number of their inputs.
    pub(crate) fn need_rows(&self) -> bool {
        self.node_type == NodeType::Rbf || self.biases == Biases::AtTrainingRows
    }
}
