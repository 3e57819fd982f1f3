//! A reflectance model whose settings are chosen by held-out errors.

mod albedo_check;
mod anchors;
mod anisotropy;
mod censored;
mod compact;
mod covariance;
mod distill;
mod errors;
mod finish;
mod large_data;
mod limit;
mod normal_equations;
mod outputs;
mod problem;
mod rows;
mod size;
mod small_data;

use elm::advanced::{FeatureMap, parallel_map};

use elm::{Activation, Biases, Dataset, Distribution, ElmParams, NeuronGroup, Scaler};
use elm_datasets::brdf::{EvalError, check_arguments};
use ndarray::{Array1, Array2, ArrayView2, ArrayViewMut2, Axis, Slice};

use super::{BrdfModel, Draw, Provenance};
use crate::error::Result;
use crate::features::Features;
use crate::fit::{Fit, Model, check};
use crate::metrics::Metric;
use crate::quality;
use crate::target_transform::{FittedTransform, TargetTransform};
pub use anisotropy::changes_after_half_turn;
pub use compact::Compact;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;
use finish::Finished;
use problem::Problem;
use size::Width;

/// Fits a network and chooses what is left open: inputs, the scale of each input, regularisation,
/// and, of many neurons drawn, which to keep.
///
/// # Parameters
///
/// | name | default | purpose |
/// |---|---|---|
/// | `features` | chosen | the inputs |
/// | `reciprocal` | no | whether to choose among reciprocal inputs only |
/// | `metric` | RMSE | the held-out error that is made small |
/// | `neurons` | see below | size of the network |
/// | `max_floats` | none | most numbers that the model may store |
/// | `seed` | 1 | random layers, and rows drawn for the search |
///
/// **Few measurements** (up to [`FEW`](Tuned::FEW)): sine neurons with random frequencies. The inputs are
/// those, of three sets, of which the evidence of a network of infinitely many neurons is largest, and
/// their scales are what makes it so; that network is a Gaussian process, solved in closed form. The
/// most useful of the neurons drawn are [kept](elm::prune) and fitted to what it says, where something was
/// measured and where nothing was.
///
/// **Many measurements** (more than [`LIMIT`](Tuned::LIMIT)): inputs and scales by a search on part of the
/// rows, judged on others, among all sets but the paper's; of networks that are equally good to 3 % a
/// reciprocal one is taken. Then more neurons than wanted are drawn and the less useful are pruned. One
/// solve on all rows finds the output weights; its strength of regularisation makes small the error at
/// rows left out, five folds in turn. Where nothing was measured the nearest measurements pull weakly, so
/// that the network is tame there.
///
/// **In between** both are done. The second is taken where its error at rows left out is at most 0.8 times
/// that of the first, which is tamer between them, or where noise is as large as values are.
///
/// Rows are weighted by what the metric makes of an error, and the error that single precision would make
/// counts in the choice of the strength. A network whose [albedo](crate::albedo) is physical, at no
/// angle above 1 unless that of the nearest measurements is, is taken before any other. Noise of dark
/// values is accounted for: the transform's offset is at least three of its standard deviations, and where
/// RMSE is asked for the fit is of the mean value, not of the value of the mean target.
///
/// **Many channels** (more than [`Tuned::DIRECT`]), such as wavelengths, share a few outputs, of which their
/// targets are combinations: as many as the error at rows left out asks for.
///
/// **Size**, unless it is given: at most 213 neurons, which for three channels is 675 stored numbers; no more
/// numbers than were measured, and of more than 1,000 at most half as many, but always
/// a few neurons.
///
/// The errors in the model's [provenance](super::Provenance) are those of the network itself at rows left
/// out, its output weights found without them; its inputs and their scales were chosen with all rows.
///
/// As [`Fit`] every channel is chosen for by itself; [`fit_model`](Self::fit_model) makes one network
/// for all channels.
///
/// ```
/// use elm_brdf::{fit::Model, model::Tuned};
/// use elm_datasets::{Invalid, MaterialId, synthetic};
///
/// let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
/// let samples = data.samples(0).ok_or("no such material")?;
/// let pairs = &samples.directions;
/// let tuned = Tuned { neurons: Some(60), ..Tuned::default() };
/// let model = tuned.fit_model(pairs, samples.values.view())?;
/// assert_eq!(model.network().hidden().neurons(), 60);
/// println!("{} numbers, held-out {:?}", model.stored_floats(), model.provenance().held_out);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuned {
    /// Inputs; `None` to choose.
    pub features: Option<Features>,
    /// Whether to choose among reciprocal inputs only.
    pub reciprocal: bool,
    /// The error that is made small.
    pub metric: Metric,
    /// Neurons; `None` for the default.
    pub neurons: Option<usize>,
    /// The most numbers that the model may store; `None` for no limit.
    pub max_floats: Option<usize>,
    /// Seed.
    pub seed: u64,
}

impl Default for Tuned {
    fn default() -> Self {
        Self {
            features: None,
            reciprocal: false,
            metric: Metric::Rmse,
            neurons: None,
            max_floats: None,
            seed: 1,
        }
    }
}

impl Tuned {
    /// With no more measurements than this they count as few.
    pub const FEW: usize = 600;
    /// With more measurements than this they count as many.
    pub const LIMIT: usize = 1500;
    /// With no more channels than this each has an output of its own.
    pub const DIRECT: usize = 3;
    /// Sets of inputs for many measurements: all but the paper's, which no material is best served by.
    const MANY_SETS: [Features; 7] = [
        Features::HalfDiff,
        Features::Cosines,
        Features::SumDifference,
        Features::ReciprocalCosines,
        Features::Highlight,
        Features::Algebraic,
        Features::HighlightCosines,
    ];
    /// For fewer: one that tells light from viewer and two reciprocal ones, of which one spreads out
    /// highlights and the other what returns to the light. The evidence of few measurements tells these
    /// apart; of others, chosen on part of the directions, it did not say how they go on beyond
    /// (docs/decisions/0016-few-measurements-by-the-limit.md).
    const FEW_SETS: [Features; 3] = [Features::Cosines, Features::Highlight, Features::HalfDiff];
    /// Neurons that measurements always warrant, if there are as many.
    const FEWEST: usize = 16;

    /// Fits one network for all channels of `values` (BRDF in 1/sr, shape (pairs, channels)).
    ///
    /// # Errors
    /// Where these measurements cannot be fitted, or `max_floats` leaves no neuron.
    pub fn fit_model(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
    ) -> Result<BrdfModel> {
        check(pairs, values)?;
        let mut transform = TargetTransform::default_log().fit(values)?;
        let direction = match self.features {
            Some(set) if set.is_isotropic() => None,
            _ => anisotropy::detect(pairs, transform.to_targets(values)?.view())?,
        };
        if pairs.len() > Self::LIMIT {
            let rows = large_data::search_rows(self, pairs.len());
            let sets = self.sets(&Self::MANY_SETS, direction);
            let mut settings = large_data::search(self, &transform, pairs, values, &rows, &sets)?;
            let noise = settings
                .first()
                .map_or(Vec::new(), large_data::Setting::noise);
            let raised = transform.raise_offsets(&noise);
            if raised.iter().any(|&factor| factor > 1.0) {
                settings = large_data::search(self, &transform, pairs, values, &rows, &sets)?;
            }
            let anisotropic = settings
                .first()
                .is_some_and(large_data::Setting::is_anisotropic);
            if let Some(setting) = settings.first() {
                transform =
                    large_data::with_outputs(self, transform, pairs, values, &rows, setting)?;
            }
            let problem = self.problem(pairs, values, transform, noise, &raised, anisotropic)?;
            let found = large_data::best(&problem, &settings, &rows)?;
            return model_of(&problem, found);
        }
        let mut search = small_data::Search::new(self, pairs, values, &transform, direction)?;
        let noise = search.noise(&transform)?;
        let raised = transform.raise_offsets(&noise);
        if raised.iter().any(|&factor| factor > 1.0) {
            search.retarget(pairs, values, &transform)?;
        }
        search.refine()?;
        let anisotropic = search.is_anisotropic();
        transform = search.with_outputs(transform, pairs)?;
        let problem = self.problem(pairs, values, transform, noise, &raised, anisotropic)?;
        let mut found = search.best(&problem)?;
        if pairs.len() > Self::FEW {
            let rows = large_data::search_rows(self, pairs.len());
            let sets = self.sets(&Self::FEW_SETS, direction);
            let settings = large_data::search(
                self,
                &problem.transform.plain(),
                pairs,
                values,
                &rows,
                &sets,
            )?;
            let other = large_data::best(&problem, &settings, &rows)?;
            if problem.noisy && other.excess <= found.excess {
                // Of noisy rows all count, and the limit has some of them.
                found = other;
            } else if other.score < SURELY * found.score || found.excess > 0.0 {
                found = better(found, other);
            }
        }
        model_of(&problem, found)
    }

    fn problem<'a>(
        &'a self,
        pairs: &'a [DirectionPair],
        values: ArrayView2<'a, f64>,
        transform: FittedTransform,
        noise: Vec<f64>,
        raised: &[f64],
        anisotropic: bool,
    ) -> Result<Problem<'a>> {
        let noisy = raised.iter().any(|&factor| factor > NOISY);
        Problem::new(self, pairs, values, transform, noise, noisy, anisotropic)
    }

    /// The sets of inputs to choose among: one where it is given; else these, and those of a grain where one
    /// is found.
    fn sets(&self, sets: &[Features], grain: Option<Features>) -> Vec<Features> {
        match self.features {
            // In the direction that is found.
            Some(set) if !set.is_isotropic() => vec![grain.unwrap_or(set)],
            Some(set) => vec![set],
            None => {
                let allowed = |set: &Features| !self.reciprocal || set.is_reciprocal();
                sets.iter().copied().filter(allowed).chain(grain).collect()
            }
        }
    }

    /// Sine neurons of normal frequencies at three scales: heavier tails than one scale has.
    fn sine_features(&self, neurons: usize, input_scales: &[f64]) -> ElmParams<f64> {
        let third = neurons / 3;
        let params = ElmParams::new(neurons - 2 * third)
            .with_activation(Activation::Sine)
            .with_distribution(Distribution::Normal)
            .with_biases(Biases::Scaled(std::f64::consts::PI))
            .with_input_scales(input_scales.to_vec())
            // Directions are bounded by themselves, and measurements end short of the horizon.
            .with_bounded(false)
            .with_seed(self.seed);
        let group = |scale: f64| {
            NeuronGroup::new(third, Activation::Sine)
                .with_scale(scale)
                .with_biases(Biases::Scaled(std::f64::consts::PI))
        };
        if third == 0 {
            return params;
        }
        params.with_group(group(0.6)).with_group(group(1.7))
    }
}

impl Fit for Tuned {
    type Model = SideBySide;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        check(pairs, values)?;
        let models = parallel_map((0..values.ncols()).collect(), |channel| {
            self.fit_model(pairs, values.select(Axis(1), &[channel]).view())
        });
        Ok(SideBySide(models.into_iter().collect::<Result<_>>()?))
    }
}

/// Models of one channel or more each, side by side.
pub struct SideBySide(pub(crate) Vec<BrdfModel>);

impl Brdf for SideBySide {
    fn channels(&self) -> usize {
        self.0.iter().map(Brdf::channels).sum()
    }

    fn is_isotropic(&self) -> bool {
        self.0.iter().all(Brdf::is_isotropic)
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        mut values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        check_arguments(pairs, &values, self.channels())?;
        let mut first = 0;
        for model in &self.0 {
            let next = first + model.channels();
            model.eval_into(
                pairs,
                values.slice_axis_mut(Axis(1), Slice::from(first..next)),
            )?;
            first = next;
        }
        Ok(())
    }
}

impl Model for SideBySide {
    fn multiply_adds(&self) -> usize {
        self.0.iter().map(Model::multiply_adds).sum()
    }

    fn floats_per_channel(&self) -> usize {
        self.0
            .iter()
            .map(Model::floats_per_channel)
            .max()
            .unwrap_or(0)
    }
}

/// A drawn feature map, and what draws it again.
struct Drawn {
    draw: Draw,
    map: FeatureMap<f64>,
}

impl Drawn {
    fn new(params: &ElmParams<f64>, scales: usize, scaler: &Scaler<f64>) -> Result<Self> {
        let params = params.feature_map();
        let layer = params.draw(scaler.mean().len())?;
        Ok(Self {
            draw: Draw {
                params: params.clone(),
                kept: None,
                scales,
            },
            map: FeatureMap::new(Some(scaler.clone()), layer, false)?,
        })
    }

    /// The neurons that pruning keeps, of all that were drawn.
    fn pruned(mut self, kept: &[usize]) -> Result<Self> {
        let mut is_kept = vec![false; self.map.layer().neurons()];
        for &number in kept {
            is_kept[number] = true;
        }
        self.map = self.map.subset(kept)?;
        self.draw.kept = Some(is_kept);
        Ok(self)
    }
}

/// Noise counts as large where it raises a transform's offset by more than this: from a sixth of the median
/// value on.
const NOISY: f64 = 5.0;
/// How much worse a reciprocal network may be and still be taken.
const TIE: f64 = 1.03;

/// A network of few measurements is as smooth as they say; another must have an error this much smaller
/// to be taken instead: on a grid, rows left out say little of what is between its lines.
const SURELY: f64 = 0.8;

/// The better of two networks: one whose albedo is physical, then the one with the smaller error, where
/// that of what is not reciprocal counts [`TIE`] times.
fn better(one: Finished, other: Finished) -> Finished {
    let physical = |finished: &Finished| finished.excess <= 0.0;
    match (physical(&one), physical(&other)) {
        (true, false) => return one,
        (false, true) => return other,
        (false, false) => {
            return if other.excess < one.excess {
                other
            } else {
                one
            };
        }
        (true, true) => {}
    }
    let handicap = |finished: &Finished| {
        let reciprocal = finished.features.is_reciprocal();
        if reciprocal {
            finished.score
        } else {
            TIE * finished.score
        }
    };
    if handicap(&other) < handicap(&one) {
        other
    } else {
        one
    }
}

fn model_of(problem: &Problem<'_>, finished: Finished) -> Result<BrdfModel> {
    let Problem {
        tuned,
        pairs,
        values,
        transform,
        ..
    } = problem;
    let mut about = provenance(tuned.seed, tuned.metric, pairs, *values);
    about.held_out = finished.held_out;
    let Finished {
        features,
        layer,
        network,
        ..
    } = finished;
    Ok(BrdfModel::new(features, transform.clone(), layer, network).with_provenance(about))
}

/// What is known of measurements whatever is fitted to them.
fn provenance(
    seed: u64,
    metric: Metric,
    pairs: &[DirectionPair],
    values: ArrayView2<'_, f64>,
) -> Provenance {
    let exchanged = quality::reciprocal_pairs(pairs);
    let floors: Vec<f64> = values
        .columns()
        .into_iter()
        .filter_map(|column| quality::NoiseFloor::of(&exchanged, column))
        .map(|floor| floor.sigma)
        .collect();
    let channels = floors.len();
    let largest = |cosine: fn(&DirectionPair) -> f64| {
        let least = pairs.iter().map(cosine).fold(1.0, f64::min);
        least.acos()
    };
    Provenance {
        measured_to: Some([
            largest(|pair| pair.incident[2]),
            largest(|pair| pair.outgoing[2]),
        ]),
        rows: pairs.len(),
        seed,
        metric: Some(metric),
        noise_floor: (channels > 0).then(|| floors.iter().sum::<f64>() / channels as f64),
        ..Provenance::default()
    }
}

/// Rows that may have weights.
fn dataset<'a>(
    x: &'a Array2<f64>,
    targets: &'a Array2<f64>,
    weights: Option<&'a Array1<f64>>,
) -> Result<Dataset<'a, f64>> {
    let data = Dataset::new(x, targets)?;
    Ok(match weights {
        Some(weights) => data.with_weights(weights)?,
        None => data,
    })
}
