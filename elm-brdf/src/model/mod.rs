//! An extreme learning machine as a reflectance model: features, target transform and network.
//!
//! [`BrdfParams`] are settings, all of them the caller's; [`Tuned`] chooses what it is not told.
//! Both make a [`BrdfModel`], which [`save`](BrdfModel::save) keeps in a file.
//!
//! # Where nothing was measured
//! Below either horizon a model is black. Between the last measured angle and grazing it goes on as
//! its network does, which for inputs that are bounded (all sets are) is a bounded continuation; the
//! [target transform](crate::target_transform) keeps it between 0 and [`TargetTransform::HEADROOM`] times
//! the largest value measured. It is finite for every pair of directions.

mod channels;
mod file;
mod global_scaling;
mod layer;
mod tuned;

use elm_datasets::brdf::EvalError;
use std::any::Any;
use std::path::Path;

use elm::solve::PseudoInverse;
use elm::{Activation, Elm, ElmParams, persist};
use ndarray::{Array2, ArrayView2, ArrayViewMut2};
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::features::Features;
use crate::fit::{Fit, Model, assign, check};
use crate::metrics::{Metric, Metrics};
use crate::target_transform::{FittedTransform, TargetTransform};
use elm_datasets::Brdf;
use elm_datasets::brdf::check_directions;
use elm_datasets::geometry::DirectionPair;
pub use global_scaling::GlobalScaling;
pub use layer::{Draw, Layer};
pub use tuned::{Compact, SideBySide, Tuned, changes_after_half_turn};

/// What a [`BrdfModel`] is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct BrdfParams {
    /// Inputs of the network.
    pub features: Features,
    /// Targets of the network.
    pub transform: TargetTransform,
    /// The network.
    pub network: ElmParams<f64>,
}

/// A fitted reflectance model.
///
/// ```
/// use elm_brdf::{fit::Fit, model::BrdfParams};
/// use elm_datasets::Brdf;
/// use elm_datasets::{Invalid, MaterialId, synthetic};
///
/// let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
/// let samples = data.samples(0).ok_or("no such material")?;
/// let pairs = &samples.directions;
/// let model = BrdfParams::paper(50).fit(pairs, samples.values.view())?;
/// assert_eq!(model.eval(pairs)?.dim(), (205, 3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "file::File", into = "file::File")]
pub struct BrdfModel {
    features: Features,
    transform: FittedTransform,
    layer: Layer,
    network: Elm<f64>,
    provenance: Provenance,
}

/// Where a model comes from and how good it is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Provenance {
    /// What was fitted: a file, a material.
    pub data: String,
    /// Name of each channel.
    pub channels: Vec<String>,
    /// Number of measurements.
    pub rows: usize,
    /// Seed of the random layer and of whatever else was drawn.
    pub seed: u64,
    /// The measure that settings were chosen by; `None` where all were given.
    pub metric: Option<Metric>,
    /// Errors of the network on measurements that were held out: its output weights found without
    /// them, its settings chosen with them. `None` where none were.
    pub held_out: Option<Metrics>,
    /// Standard deviation of the measurements' noise in 1/sr, from pairs that are reciprocal to
    /// each other; `None` where there are none.
    pub noise_floor: Option<f64>,
    /// The prior that the fit leans on.
    pub prior: Option<String>,
    /// The largest polar angles measured in radians, of the light and of the viewer.
    pub measured_to: Option<[f64; 2]>,
}

impl BrdfModel {
    /// Puts a model together; `network` must have the layer that `layer` draws.
    pub(crate) fn new(
        features: Features,
        transform: FittedTransform,
        layer: Layer,
        network: Elm<f64>,
    ) -> Self {
        Self {
            features,
            transform,
            layer,
            network,
            provenance: Provenance::default(),
        }
    }

    /// The model behind `brdf`, where it is one of these, for what only a network can do, such as
    /// [being exported](crate::export).
    #[must_use]
    pub fn of(brdf: &dyn Brdf) -> Option<&Self> {
        let any: &dyn Any = brdf;
        any.downcast_ref()
    }

    /// The inputs of the network.
    #[must_use]
    pub fn features(&self) -> Features {
        self.features
    }

    /// What turns the network's outputs into BRDF values.
    #[must_use]
    pub fn target_transform(&self) -> &FittedTransform {
        &self.transform
    }

    /// The fitted network.
    #[must_use]
    pub fn network(&self) -> &Elm<f64> {
        &self.network
    }

    /// Where the model comes from.
    #[must_use]
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }

    /// The same model with another account of where it comes from.
    #[must_use]
    pub fn with_provenance(mut self, provenance: Provenance) -> Self {
        self.provenance = provenance;
        self
    }

    /// All numbers that a file must hold to evaluate the model: output weights, constants, scales,
    /// transforms, which neurons were kept (32 to a number), but no weights that a seed regenerates.
    #[must_use]
    pub fn stored_floats(&self) -> usize {
        let scaler = self.network.scaler().map_or(0, |s| 2 * s.mean().len());
        self.network.beta().len()
            + self.network.outputs()
            + scaler
            + self.transform.floats()
            + self.layer.stored_floats()
    }

    /// Writes the model to a file, whole or not at all: JSON for a name ending in `.json`, else
    /// compact and checksummed.
    ///
    /// # Errors
    /// [`persist::Error`] naming the file, or for a network with a function of the user's own.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), persist::Error> {
        persist::save(self, path)
    }

    /// Reads a model of either form.
    ///
    /// # Errors
    /// [`persist::Error`] for a file that is none, damaged, or of a later version.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, persist::Error> {
        persist::load(path)
    }
}

impl BrdfParams {
    /// The paper's settings: its six inputs, the value itself as target, `neurons` sigmoid neurons
    /// (eq. 7, which has no constant term), and the pseudo-inverse (eq. 11).
    #[must_use]
    pub fn paper(neurons: usize) -> Self {
        Self {
            features: Features::Paper,
            transform: TargetTransform::Identity,
            network: ElmParams::new(neurons)
                .with_activation(Activation::Sigmoid)
                .with_solver(PseudoInverse::default())
                .with_intercept(false),
        }
    }

    /// The same with another seed of the random layer.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.network = self.network.with_seed(seed);
        self
    }

    /// As [`Fit::fit`], with the model itself for an answer.
    ///
    /// # Errors
    /// Where these measurements cannot be fitted.
    pub fn fit_model(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
    ) -> Result<BrdfModel> {
        check(pairs, values)?;
        let x = self.features.compute_training(pairs);
        let transform = self.transform.fit(values)?;
        let t = transform.to_targets(values)?;
        // Directions are bounded by themselves, and measurements end short of the horizon.
        let network = self.network.clone().with_bounded(false).fit(&x, &t)?;
        let layer = Layer::of(self.network.feature_map(), network.hidden());
        Ok(BrdfModel::new(self.features, transform, layer, network))
    }
}

impl Fit for BrdfParams {
    type Model = BrdfModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        self.fit_model(pairs, values)
    }
}

impl BrdfModel {
    fn values_at(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>> {
        check_directions(pairs)?;
        let targets = self.network.predict(&self.features.compute(pairs))?;
        let mut values = self.transform.to_values(targets)?;
        for (mut row, pair) in values.rows_mut().into_iter().zip(pairs) {
            if !pair.is_above_horizon() {
                row.fill(0.0);
            }
        }
        Ok(values)
    }
}

impl Brdf for BrdfModel {
    fn channels(&self) -> usize {
        self.transform.channels()
    }

    fn is_isotropic(&self) -> bool {
        self.features.is_isotropic()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        assign(self.values_at(pairs)?, values)
    }
}

impl Model for BrdfModel {
    fn multiply_adds(&self) -> usize {
        let neurons = self.network.hidden().neurons();
        let basis = self.transform.basis();
        neurons * (self.network.inputs() + self.network.outputs())
            + basis.map_or(0, |basis| basis.axes().len())
            + self
                .transform
                .color()
                .map_or(0, |weights| 3 * weights.len())
    }

    fn stored_floats(&self) -> usize {
        BrdfModel::stored_floats(self)
    }

    fn floats_per_channel(&self) -> usize {
        // What channels share counts whole for each.
        let channels = self.channels().max(1);
        let own = match (self.transform.basis(), self.transform.color()) {
            (None, None) => self.network.beta().nrows() + 1 + self.transform.floats_per_channel(),
            (Some(_), None) => self.transform.floats_per_channel(),
            // A colour takes all wavelengths.
            (_, Some(_)) => 0,
        };
        self.stored_floats() - own * (channels - 1)
    }
}
