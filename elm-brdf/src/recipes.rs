//! The only place that chooses a network for a material: what `fit` writes, `render` and `gallery`
//! show, and `export` exports, `compare` and `pareto` judge.

use ndarray::ArrayView2;

use crate::error::Result;
use crate::fit::{AnyFit, Fit, Model, boxed};
use crate::model::{BrdfModel, Tuned};
use elm_datasets::Samples;
use elm_datasets::geometry::DirectionPair;

/// Chooses a network, given how many neurons are asked for, if that is said.
pub type Recipe = dyn Fn(Option<usize>) -> Box<AnyFit> + Send + Sync;

/// The [`Recipe`] of this project: [`Tuned`], one network for all channels of a material.
#[must_use]
pub fn network(neurons: Option<usize>) -> Box<AnyFit> {
    boxed(Joint(Tuned {
        neurons,
        ..Tuned::default()
    }))
}

/// What `method` fits to samples, in red, green and blue: the [colours](elm_datasets::color) of a spectrum of
/// which one network has all wavelengths, else the channels as they are called.
///
/// # Errors
/// Those of the fit, and of a spectrum that has no colour.
pub fn in_color(method: &AnyFit, samples: &Samples) -> Result<Box<dyn Model>> {
    let fitted = method.fit(&samples.directions, samples.values.view())?;
    let Some(network) = BrdfModel::of(&*fitted) else {
        return Ok(fitted);
    };
    let mut about = network.provenance().clone();
    about.channels.clone_from(&samples.channels);
    Ok(Box::new(network.clone().with_provenance(about).in_color()?))
}

/// One network for all channels, where [`Tuned`] as a [`Fit`], which takes channels for
/// materials of their own, makes one for each.
#[derive(Debug, Clone)]
pub struct Joint(
    /// What chooses the network.
    pub Tuned,
);

impl Fit for Joint {
    type Model = BrdfModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<BrdfModel> {
        self.0.fit_model(pairs, values)
    }
}
