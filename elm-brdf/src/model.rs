//! An extreme learning machine as a reflectance model: features, link and network.

use elm::{Elm, ElmParams};
use ndarray::{Array2, ArrayView2};

use crate::brdf::{Brdf, Fit};
use crate::error::Result;
use crate::features::Features;
use crate::geometry::Pair;
use crate::link::{FittedLink, Link};

/// What a [`BrdfModel`] is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct BrdfParams {
    /// Inputs of the network.
    pub features: Features,
    /// Targets of the network.
    pub link: Link,
    /// The network.
    pub network: ElmParams<f64>,
}

/// A fitted reflectance model.
///
/// ```
/// use elm::{ElmParams, solve::PseudoInverse};
/// use elm_brdf::{brdf::{Brdf, Fit}, features::Features, geometry::pairs, link::Link};
/// use elm_brdf::model::BrdfParams;
/// use elm_datasets::{Invalid, MaterialId, synthetic};
///
/// let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
/// let samples = data.samples(0).ok_or("no such material")?;
/// let params = BrdfParams {
///     features: Features::Paper,
///     link: Link::Identity,
///     network: ElmParams::new(50).solver(PseudoInverse::default()).intercept(false),
/// };
/// let pairs = pairs(&samples.directions);
/// let model = params.fit(&pairs, samples.values.view())?;
/// assert_eq!(model.eval(&pairs)?.dim(), (205, 3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct BrdfModel {
    features: Features,
    link: FittedLink,
    network: Elm<f64>,
}

impl BrdfModel {
    /// The inputs of the network.
    #[must_use]
    pub fn features(&self) -> Features {
        self.features
    }

    /// What turns its outputs into BRDF values.
    #[must_use]
    pub fn link(&self) -> &FittedLink {
        &self.link
    }

    /// The fitted network.
    #[must_use]
    pub fn network(&self) -> &Elm<f64> {
        &self.network
    }
}

impl Fit for BrdfParams {
    fn fit(&self, pairs: &[Pair], values: ArrayView2<'_, f64>) -> Result<Box<dyn Brdf>> {
        let x = self.features.compute(pairs);
        let link = self.link.fit(values)?;
        let t = link.to_targets(values)?;
        let network = self.network.fit(&x, &t)?;
        Ok(Box::new(BrdfModel {
            features: self.features,
            link,
            network,
        }))
    }
}

impl Brdf for BrdfModel {
    fn channels(&self) -> usize {
        self.network.outputs()
    }

    fn multiply_adds(&self) -> usize {
        let neurons = self.network.hidden().neurons();
        neurons * (self.network.inputs() + self.network.outputs())
    }

    fn eval(&self, pairs: &[Pair]) -> Result<Array2<f64>> {
        let targets = self.network.predict(&self.features.compute(pairs))?;
        self.link.to_values(targets)
    }

    fn as_network(&self) -> Option<&BrdfModel> {
        Some(self)
    }

    fn floats_per_channel(&self) -> usize {
        // The seed regenerates the hidden layer. Each input has a mean and a deviation.
        let scaler = self
            .network
            .scaler()
            .map_or(0, |scaler| 2 * scaler.mean().len());
        self.network.beta().nrows() + 1 + scaler + self.link.floats_per_channel()
    }
}
