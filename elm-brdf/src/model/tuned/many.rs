//! Many measurements: a search on part of the rows, then pruning, then one solve on all of them.

use elm::Scaler;
use elm::prune::Keep;
use elm::solve::Ridge;
use ndarray::{Array1, Array2, ArrayView2, Axis};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use super::{Blank, Tuned, provenance};
use crate::error::Result;
use crate::features::Features;
use crate::geometry::Pair;
use crate::link::{FittedLink, Link};
use crate::metrics::{Metric, Metrics};
use crate::model::{BrdfModel, Layer};

/// Neurons unless said otherwise: some 675 numbers for three channels.
pub(super) const NEURONS: usize = 213;
/// Rows that the search fits to, and as many others that judge.
const SEARCH_ROWS: usize = 1500;
/// Rows that decide which neurons are kept.
const PRUNE_ROWS: usize = 1500;
/// Neurons of the search.
const SEARCH_NEURONS: usize = 96;
/// Weak, but strong enough for the normal equations.
pub(super) const RIDGE: f64 = 3e-8;
/// A scale is moved by this factor, then by its root.
const STEPS: [f64; 2] = [2.0, 1.414];
/// Where every scale begins.
const FIRST_SCALE: f64 = 0.7;

/// Neurons drawn for so many to be kept: four to one of few, three to two of many, as elimination
/// costs the cube.
fn drawn(neurons: usize) -> usize {
    (4 * neurons).min((neurons + neurons / 2).max(320))
}

pub(super) fn fit(tuned: &Tuned, pairs: &[Pair], values: ArrayView2<'_, f64>) -> Result<BrdfModel> {
    let link = Link::default_log().fit(values)?;
    let targets = link.to_targets(values)?;
    let mut random = ChaCha8Rng::seed_from_u64(tuned.seed);
    random.set_stream(5);
    let wanted = pairs.len().min(2 * SEARCH_ROWS);
    let rows = index::sample(&mut random, pairs.len(), wanted).into_vec();
    let (fitted, judged) = rows.split_at(wanted / 2);
    let search = Search {
        tuned,
        link: &link,
        fitted: part(pairs, values, &targets, fitted),
        judged: part(pairs, values, &targets, judged),
    };
    let setting = search.best()?;

    let x = setting.set.compute_training(pairs);
    let scaler = Scaler::measured(&x)?;
    let neurons = tuned.size(NEURONS, x.ncols(), values.ncols(), 2, drawn)?;
    let count = drawn(neurons);
    let few = &rows[..rows.len().min(PRUNE_ROWS.max(count))];
    let params = tuned.waves(count, &setting.scales);
    let mut blank = Blank::new(params.clone(), x.ncols(), &scaler)?;
    let params = params.solver(Ridge::relative(RIDGE)).check()?;
    let weights = row_weights(tuned.metric, pairs, values, &link);
    let few_weights = weights.as_ref().map(|weights| weights.select(Axis(0), few));
    let pruned = params.prune_layer(
        Some(scaler.clone()),
        blank.network.hidden().clone(),
        &x.select(Axis(0), few),
        &targets.select(Axis(0), few),
        Keep::Neurons(neurons),
        few_weights.as_ref().map(|weights| weights.view()),
    )?;
    let mut kept = vec![false; count];
    for &number in &pruned.kept {
        kept[number] = true;
    }
    blank.draw.kept = Some(kept);
    let hidden = blank.network.hidden().subset(&pruned.kept)?;
    let weights = weights.as_ref().map(|weights| weights.view());
    let network = params.fit_layer(Some(scaler), hidden, &x, &targets, weights)?;
    let mut about = provenance(tuned.seed, tuned.metric, pairs, values);
    about.held_out = Some(setting.held_out);
    let layer = Layer::Drawn(vec![blank.draw]);
    Ok(BrdfModel::new(setting.set, link, layer, network).with_provenance(about))
}

/// What an error of a row's target is in the metric: to first order
/// $(f + o) \cos\theta_o / (1 + f \cos\theta_o)$ for the log-cosine error of a target $\ln(1 + f/o)$,
/// mean over channels. As a weight of *squares* it stands between least squares and the least
/// absolute errors that the metric asks for. `None` for metrics that targets serve as they are: the
/// cube root, which is near to them, and RMSE, of which a few bright rows would leave nothing to the
/// others.
pub(super) fn row_weights(
    metric: Metric,
    pairs: &[Pair],
    values: ArrayView2<'_, f64>,
    link: &FittedLink,
) -> Option<Array1<f64>> {
    if metric != Metric::LogCosine {
        return None;
    }
    let offsets = link.offsets();
    let weights = pairs.iter().zip(values.rows()).map(|(pair, values)| {
        // At grazing every error counts little, but a row of no weight would be no row.
        let cosine = pair.outgoing[2].max(1e-3);
        let sum: f64 = values
            .iter()
            .zip(&offsets)
            .map(|(&f, o)| (f.max(0.0) + o) * cosine / (1.0 + f.max(0.0) * cosine))
            .sum();
        sum / values.len() as f64
    });
    Some(weights.collect())
}

/// Some of the rows.
struct Part {
    pairs: Vec<Pair>,
    values: Array2<f64>,
    targets: Array2<f64>,
}

fn part(
    pairs: &[Pair],
    values: ArrayView2<'_, f64>,
    targets: &Array2<f64>,
    rows: &[usize],
) -> Part {
    Part {
        pairs: rows.iter().map(|&row| pairs[row]).collect(),
        values: values.select(Axis(0), rows),
        targets: targets.select(Axis(0), rows),
    }
}

struct Setting {
    set: Features,
    scales: Vec<f64>,
    held_out: Metrics,
}

struct Search<'a> {
    tuned: &'a Tuned,
    link: &'a FittedLink,
    fitted: Part,
    judged: Part,
}

/// One set of inputs at the rows of both parts.
struct Inputs {
    set: Features,
    fitted: Array2<f64>,
    judged: Array2<f64>,
    scaler: Scaler<f64>,
}

impl Search<'_> {
    fn inputs(&self, set: Features) -> Result<Inputs> {
        let fitted = set.compute_training(&self.fitted.pairs);
        Ok(Inputs {
            set,
            scaler: Scaler::measured(&fitted)?,
            fitted,
            judged: set.compute(&self.judged.pairs),
        })
    }

    /// The set that is best at the first scale of all inputs and its neighbours, with each input's
    /// scale moved until that no longer pays.
    fn best(&self) -> Result<Setting> {
        let sets = self
            .tuned
            .sets(&[Features::Highlight, Features::SumDifference]);
        let mut best: Option<(Inputs, Setting)> = None;
        for set in sets {
            let inputs = self.inputs(set)?;
            for scale in [1.0, 2.0, 0.5].map(|factor| factor * FIRST_SCALE) {
                let found = self.try_scales(&inputs, vec![scale; inputs.fitted.ncols()])?;
                if best
                    .as_ref()
                    .is_none_or(|(_, best)| self.beats(&found, best))
                {
                    best = Some((self.inputs(set)?, found));
                }
            }
        }
        let Some((inputs, mut best)) = best else {
            let inputs = self.inputs(Features::Highlight)?;
            return self.try_scales(&inputs, vec![FIRST_SCALE; inputs.fitted.ncols()]);
        };
        for step in STEPS {
            for input in 0..best.scales.len() {
                for factor in [step, 1.0 / step] {
                    let mut scales = best.scales.clone();
                    scales[input] *= factor;
                    let found = self.try_scales(&inputs, scales)?;
                    if self.beats(&found, &best) {
                        best = found;
                        break;
                    }
                }
            }
        }
        Ok(best)
    }

    fn beats(&self, one: &Setting, other: &Setting) -> bool {
        let score = |setting: &Setting| self.tuned.metric.of(&setting.held_out);
        score(one) < score(other)
    }

    fn try_scales(&self, inputs: &Inputs, scales: Vec<f64>) -> Result<Setting> {
        let params = self.tuned.waves(SEARCH_NEURONS, &scales);
        let params = params.solver(Ridge::relative(RIDGE)).check()?;
        let network = params.fit_layer(
            Some(inputs.scaler.clone()),
            params.hidden_layer(scales.len())?,
            &inputs.fitted,
            &self.fitted.targets,
            None,
        )?;
        let predicted = self.link.to_values(network.predict(&inputs.judged)?)?;
        let truth = self.judged.values.view();
        Ok(Setting {
            set: inputs.set,
            scales,
            held_out: Metrics::of(&self.judged.pairs, predicted.view(), truth)?,
        })
    }
}
