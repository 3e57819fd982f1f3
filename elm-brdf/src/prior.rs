//! A prior for new materials, learnt from others.
//!
//! Materials measured at the same directions are alike: most are brighter towards grazing, most have
//! their highlight where light is mirrored, and the rig's own errors are the same for all. A
//! [`Prior`] is a normal distribution of output weights over one hidden layer, its mean and
//! covariance those of the networks fitted to the other materials. Fitted with it, a new material
//! needs fewer measurements, and is still one network, defined for every pair of directions and as
//! cheap to evaluate as without.
//!
//! # How
//! With $H$ the hidden-layer matrix, $\beta_m$ the output weights of $M$ other materials, $\mu$ their
//! mean and $B = (\beta_1 - \mu, \dots) / \sqrt M$, the new material's are
//! $$\beta = \mu + B z + \rho\, w, \qquad z \sim N(0, \sigma^2), \quad w \sim N(0, \sigma^2)$$
//! with one coordinate $z$ for each other material and one $w$ for each neuron, so that nothing is
//! impossible, only unlikely. That is ridge regression of what $H \mu$ leaves on the columns
//! $[H B, \rho H]$. Its strength and $\rho$ (relative to the size of $B$) are chosen by exact
//! leave-one-out.
//!
//! Targets are logarithms relative to each material's own median, so that a prior knows shapes, and
//! brightness does not matter.

mod design;

use elm::advanced::{FeatureMap, FeatureMapParams};
use elm::cross_validation::CrossValidator;
use elm::persist::Persist;
use elm::solve::{LeastSquares, Ridge, Solver};
use elm::{Activation, Biases, Distribution, Elm, ElmParams, NeuronGroup, Scaler};
use ndarray::{Array1, Array2, ArrayView2, Axis, concatenate};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::features::Features;
use crate::fit::{Fit, check};
use crate::metrics::Metrics;
use crate::model::{BrdfModel, Draw, Layer};
use crate::target_transform::TargetTransform;
use elm_datasets::geometry::DirectionPair;

/// How a [`Prior`] is built.
///
/// | name | default | purpose |
/// |---|---|---|
/// | `features` | [`Features::SumDifference`] | inputs |
/// | `neurons` | 900 | size of the layer, and of every network fitted with the prior; several times the directions, so that it follows each material |
/// | `seed` | 1 | the layer |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorParams {
    /// Inputs of the network.
    pub features: Features,
    /// Neurons.
    pub neurons: usize,
    /// Seed of the layer.
    pub seed: u64,
}

impl Default for PriorParams {
    fn default() -> Self {
        Self {
            features: Features::SumDifference,
            neurons: 900,
            seed: 1,
        }
    }
}

/// A distribution of networks, learnt from materials.
///
/// ```
/// use elm_brdf::{fit::Fit, prior::PriorParams};
/// use elm_datasets::Brdf;
/// use elm_datasets::{Invalid, MaterialId, synthetic};
/// use ndarray::{Array2, Axis};
///
/// let ids: Vec<MaterialId> = MaterialId::all().take(12).collect();
/// let data = synthetic::measurements(1, &ids, Invalid::Clamp);
/// let pairs = &data.directions;
/// // The first channel of every material, the first of which is the new one.
/// let values = Array2::from_shape_fn((205, 12), |(row, m)| data.materials[m].values[[row, 0]]);
/// let prior = PriorParams::default().build(pairs, values.view())?.without(&[0])?;
/// // Twenty measurements of it.
/// let rows: Vec<usize> = (0..200).step_by(10).collect();
/// let at: Vec<_> = rows.iter().map(|&row| pairs[row]).collect();
/// let few = values.select(Axis(0), &rows).select(Axis(1), &[0]);
/// let model = prior.fit(&at, few.view())?;
/// assert_eq!(model.eval(pairs)?.dim(), (205, 1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "File", into = "File")]
pub struct Prior {
    features: Features,
    params: FeatureMapParams<f64>,
    map: FeatureMap<f64>,
    mean: Weights<Array1<f64>>,
    /// $B$, one column for each material.
    deviations: Weights<Array2<f64>>,
    source: String,
}

/// Output weights, one row for each neuron, and constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Weights<A> {
    beta: A,
    constant: Array1<f64>,
}

#[derive(Serialize, Deserialize)]
struct File {
    source: String,
    features: Features,
    params: FeatureMapParams<f64>,
    scaler: Option<Scaler<f64>>,
    mean: Weights<Array1<f64>>,
    deviations: Weights<Array2<f64>>,
}

/// The strength that other materials' networks are fitted with, relative to the largest squared
/// singular value: weak, since the covariance smooths.
const SMOOTHING: f64 = 1e-6;
/// Sizes of the general part tried, as variances relative to the part that materials teach.
const GENERAL: [f64; 3] = [0.003, 0.03, 0.3];

impl PriorParams {
    /// Learns from `values` (BRDF in 1/sr, shape (pairs, materials)), all measured at `pairs`.
    ///
    /// # Errors
    /// Where these materials cannot be fitted; [`Error::Shape`] of a single material, which has
    /// no spread.
    pub fn build(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Prior> {
        check(pairs, values)?;
        if values.ncols() < 2 {
            return Err(Error::Shape {
                what: "materials of a prior",
                expected: 2,
                found: values.ncols(),
            });
        }
        let x = self.features.compute_training(pairs);
        let scaler = Scaler::measured(&x)?;
        let params = self.params(x.ncols()).feature_map().clone();
        let map = FeatureMap::new(Some(scaler), params.draw(x.ncols())?, false)?;
        let h = map.transform(&x)?;
        let targets = TargetTransform::default_log()
            .fit(values)?
            .to_targets(values)?;
        let problem = LeastSquares::new(&h, &targets)?.with_intercept(true);
        let solution = Solver::from(Ridge::relative(SMOOTHING)).solve(&problem)?;
        let mut prior = Prior {
            features: self.features,
            params,
            map,
            mean: Weights {
                beta: Array1::zeros(0),
                constant: Array1::zeros(1),
            },
            deviations: Weights {
                beta: solution.beta,
                constant: solution.intercept,
            },
            source: String::new(),
        };
        prior.center();
        Ok(prior)
    }

    fn params(&self, inputs: usize) -> ElmParams<f64> {
        // Three scales about that at which a weighted sum of standardised inputs has a deviation
        // of 1.
        let third = self.neurons / 3;
        let phase = Biases::Scaled(std::f64::consts::PI);
        let sine_features = |scale: f64| {
            NeuronGroup::new(third, Activation::Sine)
                .with_scale(scale)
                .with_biases(phase)
        };
        let params = ElmParams::new(self.neurons - 2 * third)
            .with_activation(Activation::Sine)
            .with_distribution(Distribution::Normal)
            .with_biases(phase)
            .with_scale(1.0 / (inputs as f64).sqrt())
            .with_seed(self.seed);
        if third == 0 {
            return params;
        }
        params
            .with_group(sine_features(0.3))
            .with_group(sine_features(3.0))
    }
}

impl Prior {
    /// From the weights of materials in `deviations` to mean and deviations.
    fn center(&mut self) {
        let Weights { beta, constant } = &mut self.deviations;
        let count = beta.ncols() as f64;
        let mean = beta.sum_axis(Axis(1)) / count;
        let level = constant.sum() / count;
        *beta -= &mean.view().insert_axis(Axis(1));
        *beta /= count.sqrt();
        constant.mapv_inplace(|c| (c - level) / count.sqrt());
        self.mean = Weights {
            beta: mean,
            constant: Array1::from_elem(1, level),
        };
    }

    /// The prior that the other materials alone have: without those at `places` in the order that
    /// it was built from.
    ///
    /// # Errors
    /// [`Error::Shape`] where fewer than two are left.
    pub fn without(&self, places: &[usize]) -> Result<Self> {
        let all = self.materials();
        let left: Vec<usize> = (0..all).filter(|place| !places.contains(place)).collect();
        if left.len() < 2 {
            return Err(Error::Shape {
                what: "materials of a prior",
                expected: 2,
                found: left.len(),
            });
        }
        let root = (all as f64).sqrt();
        let beta = self.deviations.beta.select(Axis(1), &left) * root
            + self.mean.beta.view().insert_axis(Axis(1));
        let constant =
            self.deviations.constant.select(Axis(0), &left) * root + self.mean.constant[0];
        let mut prior = Self {
            deviations: Weights { beta, constant },
            ..self.clone()
        };
        prior.center();
        Ok(prior)
    }

    /// How many materials it has learnt from.
    #[must_use]
    pub fn materials(&self) -> usize {
        self.deviations.beta.ncols()
    }

    /// What it has learnt from, in words.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The same prior with another account of what it has learnt from.
    #[must_use]
    pub fn with_source(mut self, source: String) -> Self {
        self.source = source;
        self
    }

    /// Fits one network for all channels of `values` (BRDF in 1/sr, shape (pairs, channels)), each
    /// channel with the strengths that leave-one-out of the targets chooses.
    ///
    /// # Errors
    /// Where these measurements cannot be fitted.
    pub fn fit_model(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
    ) -> Result<BrdfModel> {
        let mut left_out = Array2::zeros(values.dim());
        let model = self.fit_judged(pairs, values, Some(&mut left_out))?;
        let transform = model.target_transform();
        let predicted = transform.to_values(transform.to_targets(values)? - left_out)?;
        let mut about = model.provenance().clone();
        about.held_out = Some(Metrics::of(pairs, predicted.view(), values)?);
        Ok(model.with_provenance(about))
    }

    /// Adds leave-one-out residuals of the targets to `left_out` if they are wanted: they take
    /// factorisations of their own.
    pub(crate) fn fit_judged(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
        mut left_out: Option<&mut Array2<f64>>,
    ) -> Result<BrdfModel> {
        check(pairs, values)?;
        let x = self.features.compute(pairs);
        let h = self.map.transform(&x)?;
        let transform = TargetTransform::default_log().fit(values)?;
        let targets = transform.to_targets(values)?;
        let level = h.dot(&self.mean.beta) + self.mean.constant[0];
        let rest = &targets - &level.insert_axis(Axis(1));
        let taught = h.dot(&self.deviations.beta) + &self.deviations.constant;
        let mean_square = |a: &Array2<f64>| {
            let sum = a.iter().map(|v| v * v).sum::<f64>();
            (sum / a.nrows() as f64).max(f64::MIN_POSITIVE)
        };
        let relative = mean_square(&taught) / mean_square(&h);

        // The mean over the sizes tried: steadier than the one that leave-one-out likes best.
        let share = 1.0 / GENERAL.len() as f64;
        let mut beta = Array2::zeros((h.ncols(), values.ncols()));
        beta += &self.mean.beta.view().insert_axis(Axis(1));
        let mut intercept = Array1::from_elem(values.ncols(), self.mean.constant[0]);
        for general in GENERAL {
            let rho = (general * relative).sqrt();
            let design =
                concatenate(Axis(1), &[taught.view(), (&h * rho).view()]).map_err(|_| {
                    Error::Empty {
                        what: "columns of the prior",
                        rows: h.nrows(),
                        columns: h.ncols(),
                    }
                })?;
            let problem = LeastSquares::new(&design, &rest)?.with_intercept(true);
            if let Some(sum) = left_out.as_deref_mut() {
                let validator = CrossValidator::new(&problem)?;
                let lambda = validator.select_lambda(Ridge::leave_one_out())?;
                match validator.leave_one_out(&lambda) {
                    Ok(held_out) => sum.scaled_add(share, &held_out.residuals()),
                    // One measurement: nothing can be left out of it.
                    Err(elm::Error::Undetermined { .. }) => sum.scaled_add(share, &rest),
                    Err(error) => return Err(error.into()),
                }
            }
            let solution = Solver::from(Ridge::leave_one_out()).solve(&problem)?;
            let (z, w) = solution.beta.view().split_at(Axis(0), taught.ncols());
            beta.scaled_add(share, &self.deviations.beta.dot(&z));
            beta.scaled_add(share * rho, &w);
            intercept.scaled_add(share, &self.deviations.constant.dot(&z));
            intercept.scaled_add(share, &solution.intercept);
        }
        let network = Elm::from_parts(self.map.clone(), beta, intercept)?;
        let layer = Layer::Drawn(vec![Draw {
            params: self.params.clone(),
            kept: None,
            scales: 0,
        }]);
        let mut model = BrdfModel::new(self.features, transform, layer, network);
        let mut about = model.provenance().clone();
        about.rows = pairs.len();
        about.prior = Some(self.source.clone());
        model = model.with_provenance(about);
        Ok(model)
    }
}

impl Fit for Prior {
    type Model = BrdfModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        // Each channel has strengths of its own, so that one network serves them.
        self.fit_judged(pairs, values, None)
    }
}

impl From<Prior> for File {
    fn from(prior: Prior) -> Self {
        Self {
            source: prior.source,
            features: prior.features,
            params: prior.params,
            scaler: prior.map.scaler().cloned(),
            mean: prior.mean,
            deviations: prior.deviations,
        }
    }
}

impl TryFrom<File> for Prior {
    type Error = Error;

    fn try_from(file: File) -> Result<Self> {
        let inputs = file.features.inputs().len();
        let neurons = file.mean.beta.len();
        let (rows, materials) = file.deviations.beta.dim();
        for (what, expected, found) in [
            (
                "neurons of the prior's layer",
                neurons,
                file.params.neurons(),
            ),
            ("neurons of the prior's deviations", neurons, rows),
            ("constants of the prior's mean", 1, file.mean.constant.len()),
            (
                "constants of the prior's deviations",
                materials,
                file.deviations.constant.len(),
            ),
        ] {
            if expected != found {
                return Err(Error::Shape {
                    what,
                    expected,
                    found,
                });
            }
        }
        let numbers = file.mean.beta.iter().chain(&file.mean.constant);
        let numbers = numbers
            .chain(&file.deviations.beta)
            .chain(&file.deviations.constant);
        if numbers.into_iter().any(|number| !number.is_finite()) {
            return Err(Error::NotFinite {
                what: "weights of the prior",
                row: 0,
                column: 0,
            });
        }
        let map = FeatureMap::new(file.scaler, file.params.draw(inputs)?, false)?;
        Ok(Self {
            features: file.features,
            params: file.params,
            map,
            mean: file.mean,
            deviations: file.deviations,
            source: file.source,
        })
    }
}

impl Persist for Prior {
    const KIND: &'static str = "elm-brdf prior";
    const SCALAR: &'static str = "f64";
    const VERSION: u32 = 4;
}
