//! What a feature map is drawn from: kinds of neurons, distributions, a seed.

use ndarray::{Array2, ArrayRef2, ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

use super::FeatureMap;
use super::layer::HiddenLayer;
use super::sampling::Inputs;
use super::scaler::Scaler;
use crate::activation::Activation;
use crate::check::{check_length, check_matrix};
use crate::error::{Error, Result};
use crate::memory::check_room;
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
    /// Multivariate Student $t$ with so many degrees of freedom $\nu$, at least 1: the normal weights
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
    /// neuron (no row twice until all are taken; in proportion to its weight), with each input multiplied by the scale of the
    /// weights, $s$. With [`Activation::Gaussian`] this is a radial basis function
    /// $e^{-\lVert s \odot (x - c_k) \rVert^2}$, whose width is the scale's inverse.
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

/// The settings that a [`FeatureMap`] is drawn from; part of [`ElmParams`](crate::ElmParams), whose
/// setters describe them.
///
/// Whoever keeps these settings, and the scaler of the training rows, need not keep the random weights.
///
/// ```
/// use elm::{ElmParams, FeatureMap, Scaler};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let params = ElmParams::new(20).seed(7);
/// let layer = params.feature_map().draw(1)?;
/// let map = FeatureMap::new(Some(Scaler::measured(&x)?), layer, false)?;
/// assert_eq!(map, params.feature_map().draw_on(&x)?);
/// assert_eq!(map.transform(&x)?.dim(), (60, 20));
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct FeatureMapParams<A: Scalar> {
    /// The neurons that the setters of `ElmParams` describe.
    pub(crate) neurons: Neurons<A>,
    /// Those of other kinds.
    pub(crate) others: Vec<Neurons<A>>,
    pub(crate) distribution: Distribution,
    /// Multiplies all weights.
    pub(crate) scale: f64,
    /// Multiplies the weights of each input; empty for 1.
    pub(crate) input_scales: Vec<f64>,
    pub(crate) seed: u64,
    pub(crate) standardise: bool,
    pub(crate) direct_links: bool,
}

impl<A: Scalar> FeatureMapParams<A> {
    /// The defaults, with this many neurons.
    pub(crate) fn new(neurons: usize) -> Self {
        Self {
            neurons: Neurons::new(neurons, Activation::default()),
            others: Vec::new(),
            distribution: Distribution::default(),
            scale: 1.0,
            input_scales: Vec::new(),
            seed: 0,
            standardise: true,
            direct_links: false,
        }
    }

    pub(crate) fn groups(&self) -> impl Iterator<Item = &Neurons<A>> {
        std::iter::once(&self.neurons).chain(&self.others)
    }

    pub(crate) fn groups_mut(&mut self) -> impl Iterator<Item = &mut Neurons<A>> {
        std::iter::once(&mut self.neurons).chain(&mut self.others)
    }

    /// Number of neurons, of all kinds together.
    #[must_use]
    pub fn neurons(&self) -> usize {
        let add = |sum: usize, group: &Neurons<A>| sum.saturating_add(group.count);
        self.groups().fold(0, add)
    }

    /// Whether drawing takes more of the training rows than the number of their inputs.
    pub(crate) fn needs_rows(&self) -> bool {
        self.groups().any(Neurons::need_rows)
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first setting that is out of range.
    pub fn check(&self) -> Result<()> {
        let parameter = |name, value, expected| {
            Err(Error::Parameter {
                name,
                value,
                expected,
            })
        };
        if self.neurons() == 0 {
            return parameter("neurons", 0.0, "at least 1");
        }
        // Written so that NaN fails too.
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return parameter("scale", self.scale, "positive and finite");
        }
        let not_negative = |value: f64| value >= 0.0 && value.is_finite();
        if let Some(&value) = self
            .input_scales
            .iter()
            .find(|value| !not_negative(**value))
        {
            return parameter("input_scales", value, "finite and not negative");
        }
        if self.distribution == Distribution::StudentT(0) {
            return parameter("degrees of freedom", 0.0, "at least 1");
        }
        for group in self.groups() {
            if !(group.scale > 0.0 && group.scale.is_finite()) {
                return parameter("scale of neurons", group.scale, "positive and finite");
            }
            if let Biases::Scaled(value) = group.biases
                && !not_negative(value)
            {
                return parameter("biases", value, "finite and not negative");
            }
        }
        Ok(())
    }

    /// The random layer alone, for this many inputs.
    ///
    /// # Errors
    /// Those of [`check`](Self::check); [`Error::Empty`] without inputs, [`Error::Shape`] for another
    /// number of input scales, [`Error::TooLarge`]; [`Error::Conflict`] for neurons that are laid on
    /// training rows ([`Biases::OnData`], [`Kind::Radial`]), as there are none.
    pub fn draw(&self, inputs: usize) -> Result<HiddenLayer<A>> {
        self.check()?;
        if self.needs_rows() {
            return Err(Error::Conflict {
                first: "neurons laid on training rows",
                second: "a layer without them",
            });
        }
        let nowhere = Array2::zeros((1, inputs));
        check_matrix("inputs", nowhere.view())?;
        self.draw_layer(nowhere.view(), None, None)
    }

    /// The map for these training rows, shape (rows, inputs): measures them and draws the layer.
    ///
    /// # Errors
    /// Those of [`draw`](Self::draw) but the last; [`Error::Empty`] and [`Error::NotFinite`] for `x`.
    pub fn draw_on(&self, x: &ArrayRef2<A>) -> Result<FeatureMap<A>> {
        self.check()?;
        check_matrix("inputs", x.view())?;
        self.draw_weighted(x.view(), None)
    }

    /// As [`draw_on`](Self::draw_on), for rows of these positive weights; all has been checked.
    pub(crate) fn draw_weighted(
        &self,
        x: ArrayView2<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<FeatureMap<A>> {
        let scaler = self.standardise.then(|| Scaler::measure(x, weights));
        let layer = self.draw_layer(x, scaler.as_ref(), weights)?;
        Ok(FeatureMap::of_checked(scaler, layer, self.direct_links))
    }

    /// The layer for these rows, standardised by `scaler`, of these positive weights.
    pub(crate) fn draw_layer(
        &self,
        x: ArrayView2<'_, A>,
        scaler: Option<&Scaler<A>>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<HiddenLayer<A>> {
        // A failed allocation would abort the program.
        let per_neuron = x.ncols().saturating_add(1);
        check_room("the hidden layer", per_neuron, self.neurons())?;
        if !self.input_scales.is_empty() {
            check_length("input scales", self.input_scales.len(), x.ncols())?;
        }
        Ok(self.sample(Inputs::new(x, scaler), weights))
    }
}
