//! The random feature map of an extreme learning machine: standardize, project, activate, and where
//! wanted pass the inputs through.
//!
//! A network is a feature map and a linear readout. The map is drawn, never trained.

mod distance;
mod gradient;
mod kernels;
mod layer;
mod neurons;
mod packed;
mod packed_map;
mod params;
mod rows;
mod sampling;
mod scaler;
#[cfg(test)]
mod tests;

use ndarray::{Array2, ArrayRef2, ArrayView1, ArrayView2, s};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::check::{check_length, check_matrix};
#[cfg(feature = "serde")]
use crate::error::Error;
use crate::error::Result;
use crate::memory::check_room;
use crate::scalar::Scalar;

pub(crate) use kernels::{Accumulate, sum_of_line};
pub use layer::{HiddenLayer, NeuronBlock};
pub use neurons::{Biases, Distribution, NeuronGroup, NodeType};
pub(crate) use packed::CHUNK_PANELS;
pub(crate) use packed_map::{PackedMap, TILE_ROWS, TileBuffers, tile_rows};
pub use params::FeatureMapParams;
pub(crate) use rows::FeatureRows;
pub use scaler::{Scaler, ScalerBuilder};

/// From inputs to features: standardized by a [`Scaler`], through the neurons of a
/// [`HiddenLayer`], and followed by the standardized inputs themselves where these are linked directly.
///
/// ```
/// use elm::ElmParams;
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let map = ElmParams::new(20).with_direct_links(true).feature_map().draw_on(&x)?;
/// assert_eq!(map.transform(&x)?.dim(), (60, 21));
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", try_from = "Parts<A>"))]
pub struct FeatureMap<A: Scalar> {
    scaler: Option<Scaler<A>>,
    layer: HiddenLayer<A>,
    direct_links: bool,
}

/// A [`FeatureMap`] from outside, before its parts are known to fit together.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
#[serde(bound = "")]
struct Parts<A: Scalar> {
    scaler: Option<Scaler<A>>,
    layer: HiddenLayer<A>,
    direct_links: bool,
}

#[cfg(feature = "serde")]
impl<A: Scalar> TryFrom<Parts<A>> for FeatureMap<A> {
    type Error = Error;

    fn try_from(parts: Parts<A>) -> Result<Self> {
        Self::new(parts.scaler, parts.layer, parts.direct_links)
    }
}

impl<A: Scalar> FeatureMap<A> {
    /// A map of these parts: `scaler` is that of the training rows, `None` for inputs that are taken as
    /// they are.
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Empty`] and [`Error::NotFinite`] for parts that do not fit.
    pub fn new(
        scaler: Option<Scaler<A>>,
        layer: HiddenLayer<A>,
        direct_links: bool,
    ) -> Result<Self> {
        layer.check()?;
        if let Some(scaler) = &scaler {
            let inputs = scaler.mean().len();
            check_length("inputs of the scaler", inputs, layer.inputs())?;
        }
        Ok(Self::of_checked(scaler, layer, direct_links))
    }

    pub(crate) fn of_checked(
        scaler: Option<Scaler<A>>,
        layer: HiddenLayer<A>,
        direct_links: bool,
    ) -> Self {
        Self {
            scaler,
            layer,
            direct_links,
        }
    }

    /// The features of `x`: shape (rows, inputs) to (rows, [`features`](Self::features)). The paper's
    /// $F$ (equation 9), most of the literature's $H$.
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Empty`] and [`Error::NotFinite`] for `x`; [`Error::TooLarge`].
    pub fn transform(&self, x: &ArrayRef2<A>) -> Result<Array2<A>> {
        check_length("columns of inputs", x.ncols(), self.inputs())?;
        check_matrix("inputs", x.view())?;
        check_room("the hidden-layer matrix", x.nrows(), self.features())?;
        Ok(self.apply(x.view()))
    }

    /// As [`transform`](Self::transform), of inputs that have been checked.
    pub(crate) fn apply(&self, x: ArrayView2<'_, A>) -> Array2<A> {
        match &self.scaler {
            Some(scaler) => self.apply_to_scaled(scaler.transform(x).view()),
            None => self.apply_to_scaled(x),
        }
    }

    pub(crate) fn apply_to_scaled(&self, x: ArrayView2<'_, A>) -> Array2<A> {
        let h = self.layer.forward(x);
        if !self.direct_links {
            return h;
        }
        let mut both = Array2::zeros((x.nrows(), self.features()));
        both.slice_mut(s![.., ..h.ncols()]).assign(&h);
        both.slice_mut(s![.., h.ncols()..]).assign(&x);
        both
    }

    /// The map with these neurons alone, given by rising numbers, such as those that
    /// [pruning](crate::prune) keeps; direct links stay.
    ///
    /// # Errors
    /// Those of [`HiddenLayer::subset`].
    pub fn subset(&self, neurons: &[usize]) -> Result<Self> {
        let layer = self.layer.subset(neurons)?;
        Ok(Self::of_checked(
            self.scaler.clone(),
            layer,
            self.direct_links,
        ))
    }

    pub(crate) fn select(&self, neurons: &[usize]) -> Self {
        let layer = self.layer.select(neurons);
        Self::of_checked(self.scaler.clone(), layer, self.direct_links)
    }

    /// The slopes along the (standardized) inputs `x` of $\sum_j \beta_j \phi_j(x)$, shape (rows,
    /// inputs).
    pub(crate) fn gradient(&self, x: ArrayView2<'_, A>, beta: ArrayView1<'_, A>) -> Array2<A> {
        let (own, links) = beta.split_at(ndarray::Axis(0), self.layer.neurons());
        let mut gradient = self.layer.gradient(x, own);
        if !links.is_empty() {
            gradient += &links;
        }
        gradient
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.layer.inputs()
    }

    /// Number of features: neurons, and inputs where they are linked directly.
    #[must_use]
    pub fn features(&self) -> usize {
        self.layer.neurons() + if self.direct_links { self.inputs() } else { 0 }
    }

    /// The standardization of inputs, where it is on.
    #[must_use]
    pub fn scaler(&self) -> Option<&Scaler<A>> {
        self.scaler.as_ref()
    }

    /// The random hidden layer.
    #[must_use]
    pub fn layer(&self) -> &HiddenLayer<A> {
        &self.layer
    }

    /// Whether the standardized inputs follow the neurons.
    #[must_use]
    pub fn direct_links(&self) -> bool {
        self.direct_links
    }
}
