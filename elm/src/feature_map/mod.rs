//! The random feature map of an extreme learning machine: standardize, embed, project, activate, and
//! where wanted pass the inputs through.
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
mod ramp_tables;
mod ramps;
mod rows;
mod sampling;
mod scaler;
#[cfg(test)]
mod tests;

use ndarray::{Array2, ArrayRef2, ArrayView1, ArrayView2, CowArray, Ix2, s};
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
pub use ramps::{Embedding, Ramps};
pub(crate) use rows::FeatureRows;
pub use scaler::{Scaler, ScalerBuilder};

/// From inputs to features: standardized by a [`Scaler`], beside their [`Ramps`] where they have any,
/// through the neurons of a [`HiddenLayer`], and followed by what the neurons see of the inputs where that
/// is linked directly.
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
    ramps: Option<Ramps<A>>,
    layer: HiddenLayer<A>,
    direct_links: bool,
}

/// A [`FeatureMap`] from outside, before its parts are known to fit together.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
#[serde(bound = "")]
struct Parts<A: Scalar> {
    scaler: Option<Scaler<A>>,
    #[serde(default)]
    ramps: Option<Ramps<A>>,
    layer: HiddenLayer<A>,
    direct_links: bool,
}

#[cfg(feature = "serde")]
impl<A: Scalar> TryFrom<Parts<A>> for FeatureMap<A> {
    type Error = Error;

    fn try_from(parts: Parts<A>) -> Result<Self> {
        Self::checked(parts.scaler, parts.ramps, parts.layer, parts.direct_links)
    }
}

/// Inputs as neurons see them: standardized, and beside their ramps.
fn embed<'a, A: Scalar>(
    scaler: Option<&Scaler<A>>,
    ramps: Option<&Ramps<A>>,
    x: ArrayView2<'a, A>,
) -> CowArray<'a, A, Ix2> {
    let scaled = match scaler {
        Some(scaler) => CowArray::from(scaler.transform(x)),
        None => CowArray::from(x),
    };
    match ramps {
        Some(ramps) => ramps.beside(scaled.view(), x).into(),
        None => scaled,
    }
}

impl<A: Scalar> FeatureMap<A> {
    /// A map without ramps of these parts: `scaler` is that of the training rows, `None` for inputs that are
    /// taken as they are.
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Empty`] and [`Error::NotFinite`] for parts that do not fit.
    pub fn new(
        scaler: Option<Scaler<A>>,
        layer: HiddenLayer<A>,
        direct_links: bool,
    ) -> Result<Self> {
        Self::checked(scaler, None, layer, direct_links)
    }

    /// The same with the ramps of the inputs, the layer being one of inputs and ramps.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub fn with_ramps(
        scaler: Option<Scaler<A>>,
        ramps: Ramps<A>,
        layer: HiddenLayer<A>,
        direct_links: bool,
    ) -> Result<Self> {
        Self::checked(scaler, Some(ramps), layer, direct_links)
    }

    fn checked(
        scaler: Option<Scaler<A>>,
        ramps: Option<Ramps<A>>,
        layer: HiddenLayer<A>,
        direct_links: bool,
    ) -> Result<Self> {
        layer.check()?;
        let mut inputs = layer.inputs();
        if let Some(ramps) = &ramps {
            inputs = ramps.inputs();
            let embedded = inputs.saturating_add(ramps.columns());
            check_length("inputs of the layer", layer.inputs(), embedded)?;
        }
        if let Some(scaler) = &scaler {
            check_length("inputs of the scaler", scaler.mean().len(), inputs)?;
        }
        Ok(Self {
            scaler,
            ramps,
            layer,
            direct_links,
        })
    }

    /// Of parts that fit together.
    pub(crate) fn of_checked(
        scaler: Option<Scaler<A>>,
        ramps: Option<Ramps<A>>,
        layer: HiddenLayer<A>,
        direct_links: bool,
    ) -> Self {
        Self {
            scaler,
            ramps,
            layer,
            direct_links,
        }
    }

    /// The same map with another layer of as many inputs.
    pub(crate) fn with_layer(&self, layer: HiddenLayer<A>) -> Self {
        Self {
            scaler: self.scaler.clone(),
            ramps: self.ramps.clone(),
            layer,
            direct_links: self.direct_links,
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
        let x = self.embed(x);
        let h = self.layer.forward(x.view());
        if !self.direct_links {
            return h;
        }
        let mut both = Array2::zeros((x.nrows(), self.features()));
        both.slice_mut(s![.., ..h.ncols()]).assign(&h);
        both.slice_mut(s![.., h.ncols()..]).assign(&x);
        both
    }

    /// What the neurons see of inputs that have been checked: standardized, and beside their ramps.
    pub(crate) fn embed<'a>(&self, x: ArrayView2<'a, A>) -> CowArray<'a, A, Ix2> {
        embed(self.scaler.as_ref(), self.ramps.as_ref(), x)
    }

    /// The map with these neurons alone, given by rising numbers, such as those that
    /// [pruning](crate::prune) keeps; direct links stay.
    ///
    /// # Errors
    /// Those of [`HiddenLayer::subset`].
    pub fn subset(&self, neurons: &[usize]) -> Result<Self> {
        Ok(self.with_layer(self.layer.subset(neurons)?))
    }

    pub(crate) fn select(&self, neurons: &[usize]) -> Self {
        self.with_layer(self.layer.select(neurons))
    }

    /// The slopes at `x` of $\sum_j \beta_j \phi_j(x)$ along the (standardized) inputs, shape (rows,
    /// inputs).
    pub(crate) fn gradient(&self, x: ArrayView2<'_, A>, beta: ArrayView1<'_, A>) -> Array2<A> {
        let slopes = self.slopes(self.embed(x).view(), beta);
        let Some(ramps) = &self.ramps else {
            return slopes;
        };
        let factor = |input: usize| self.scaler.as_ref().map_or(A::one(), |s| s.factor()[input]);
        ramps.slopes_along_inputs(slopes.view(), x, factor)
    }

    /// The same along all that the neurons see, of [embedded](Self::embed) inputs.
    pub(crate) fn slopes(&self, u: ArrayView2<'_, A>, beta: ArrayView1<'_, A>) -> Array2<A> {
        let (own, links) = beta.split_at(ndarray::Axis(0), self.layer.neurons());
        let mut gradient = self.layer.gradient(u, own);
        if !links.is_empty() {
            gradient += &links;
        }
        gradient
    }

    /// The columns of the embedding that are made of an input.
    pub(crate) fn columns_of(&self, input: usize) -> Vec<usize> {
        match &self.ramps {
            None => vec![input],
            Some(ramps) => {
                let columns = ramps.sources().enumerate();
                let own = columns.filter(|(_, source)| *source == input);
                own.map(|(column, _)| column).collect()
            }
        }
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.ramps
            .as_ref()
            .map_or(self.layer.inputs(), Ramps::inputs)
    }

    /// Number of features: neurons, and what they see of the inputs where that is linked directly.
    #[must_use]
    pub fn features(&self) -> usize {
        let links = if self.direct_links {
            self.layer.inputs()
        } else {
            0
        };
        self.layer.neurons() + links
    }

    /// The ramps of the inputs, where they have any.
    #[must_use]
    pub fn ramps(&self) -> Option<&Ramps<A>> {
        self.ramps.as_ref()
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

    /// Whether what the neurons see of the inputs follows them.
    #[must_use]
    pub fn direct_links(&self) -> bool {
        self.direct_links
    }
}
