//! The settings and the seed that a feature map is drawn from.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use super::neurons::{Biases, Distribution, NeuronGroup};
use super::ramps::{Embedding, check_bins};
use crate::activation::Activation;
use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// The settings that a [`FeatureMap`](super::FeatureMap) is drawn from; part of
/// [`ElmParams`](crate::ElmParams), whose setters describe them.
///
/// Whoever keeps these settings, and the scaler of the training rows, need not keep the random weights.
///
/// ```
/// use elm::advanced::FeatureMap;
/// use elm::{ElmParams, Scaler};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let params = ElmParams::new(20).with_seed(7);
/// let layer = params.feature_map().draw(1)?;
/// let map = FeatureMap::new(Some(Scaler::measured(&x)?), layer, false)?;
/// assert_eq!(map, params.feature_map().draw_on(&x)?);
/// assert_eq!(map.transform(&x)?.dim(), (60, 20));
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub struct FeatureMapParams<A: Scalar> {
    /// The neurons that the setters of `ElmParams` describe.
    pub(crate) neurons: NeuronGroup<A>,
    /// Those of other kinds.
    pub(crate) others: Vec<NeuronGroup<A>>,
    pub(crate) distribution: Distribution,
    /// Multiplies all weights.
    pub(crate) scale: f64,
    /// Multiplies the weights of each input, or of each column of the embedding; empty for 1.
    pub(crate) input_scales: Vec<f64>,
    pub(crate) seed: u64,
    #[cfg_attr(feature = "serde", serde(alias = "standardise"))]
    pub(crate) standardize: bool,
    pub(crate) direct_links: bool,
    #[cfg_attr(feature = "serde", serde(default))]
    pub(crate) embedding: Embedding<A>,
}

impl<A: Scalar> FeatureMapParams<A> {
    /// The defaults, with this many neurons.
    pub(crate) fn new(neurons: usize) -> Self {
        Self {
            neurons: NeuronGroup::new(neurons, Activation::default()),
            others: Vec::new(),
            distribution: Distribution::default(),
            scale: 1.0,
            input_scales: Vec::new(),
            seed: 0,
            standardize: true,
            direct_links: false,
            embedding: Embedding::default(),
        }
    }

    pub(crate) fn groups(&self) -> impl Iterator<Item = &NeuronGroup<A>> {
        std::iter::once(&self.neurons).chain(&self.others)
    }

    pub(crate) fn groups_mut(&mut self) -> impl Iterator<Item = &mut NeuronGroup<A>> {
        std::iter::once(&mut self.neurons).chain(&mut self.others)
    }

    /// Number of neurons, of all kinds together.
    #[must_use]
    pub fn neurons(&self) -> usize {
        let add = |sum: usize, group: &NeuronGroup<A>| sum.saturating_add(group.count);
        self.groups().fold(0, add)
    }

    /// Whether drawing takes more of the training rows than the number of their inputs.
    pub(crate) fn needs_rows(&self) -> bool {
        self.groups().any(NeuronGroup::need_rows)
            || matches!(self.embedding, Embedding::Quantiles(_))
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
        if let Embedding::Quantiles(bins) = self.embedding {
            check_bins(bins)?;
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
}
