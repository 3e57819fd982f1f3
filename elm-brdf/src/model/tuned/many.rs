//! Many measurements: a search on part of the rows, then pruning, then one solve on all of them.

use elm::prune::Keep;
use elm::solve::Ridge;
use elm::{Elm, Scaler};
use ndarray::{Array2, ArrayView2, Axis};
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use super::{Blank, Tuned, provenance, solve, without_weights};
use crate::error::Result;
use crate::features::Features;
use crate::geometry::Pair;
use crate::link::{FittedLink, Link};
use crate::metrics::Metrics;
use crate::model::{BrdfModel, Layer};

/// Neurons unless said otherwise.
const NEURONS: usize = 213;
/// Neurons drawn for each one that is kept.
const DRAWN: usize = 2;
/// Rows that the search fits to, and as many others that judge.
const SEARCH_ROWS: usize = 1500;
/// Rows that decide which neurons are kept.
const PRUNE_ROWS: usize = 4000;
/// Neurons of the search.
const SEARCH_NEURONS: usize = 96;
/// Weak, but strong enough for the normal equations.
const RIDGE: f64 = 3e-8;
/// Steps of a scale: by this factor, then by its root.
const STEPS: [f64; 2] = [2.0, 1.414];

pub(super) fn fit(tuned: &Tuned, pairs: &[Pair], values: ArrayView2<'_, f64>) -> Result<BrdfModel> {
    let link = Link::default_log().fit(values)?;
    let targets = link.to_targets(values)?;
    let mut random = ChaCha8Rng::seed_from_u64(tuned.seed);
    random.set_stream(5);
    let mut order = index::sample(&mut random, pairs.len(), pairs.len().min(PRUNE_ROWS)).into_vec();
    let judged = (order.len() / 2).min(SEARCH_ROWS);
    let search = Search {
        tuned,
        link: &link,
        fitted: part(pairs, values, &targets, &order[..judged]),
        judged: part(pairs, values, &targets, &order[judged..2 * judged]),
    };
    let mut best: Option<Setting> = None;
    for set in tuned.sets() {
        let found = search.scales(set)?;
        if best.as_ref().is_none_or(|best| found.score < best.score) {
            best = Some(found);
        }
    }
    let best = best.unwrap_or(Setting {
        set: Features::Highlight,
        scales: vec![1.0; Features::Highlight.inputs().len()],
        score: f64::INFINITY,
    });

    let x = best.set.compute(pairs);
    let scaler = Scaler::measured(&x)?;
    let channels = values.ncols();
    let neurons = tuned.size(NEURONS, x.ncols(), channels, 2, DRAWN as f64)?;
    order.sort_unstable();
    let (few_x, few_t) = (x.select(Axis(0), &order), targets.select(Axis(0), &order));
    let params = tuned.waves(DRAWN * neurons, &best.scales);
    let pruned = params.clone().solver(Ridge::relative(RIDGE)).fit_pruned(
        &few_x,
        &few_t,
        Keep::Neurons(neurons),
    )?;
    let mut blank = Blank::new(params, x.ncols(), &scaler)?;
    let mut kept = vec![false; DRAWN * neurons];
    for &number in &pruned.kept {
        kept[number] = true;
    }
    blank.draw.kept = Some(kept);
    let hidden = blank.network.hidden().subset(&pruned.kept)?;
    let h = without_weights(&scaler, hidden.clone())?.hidden_matrix(&x)?;
    let (beta, intercept) = solve(&h, &targets, Ridge::relative(RIDGE))?;
    let network = Elm::from_parts(Some(scaler), hidden, beta, intercept)?;
    let about = provenance(tuned, pairs, values);
    let model = BrdfModel::new(
        best.set,
        link.clone(),
        Layer::Drawn(vec![blank.draw]),
        network,
    );
    Ok(model.with_provenance(about))
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
    score: f64,
}

struct Search<'a> {
    tuned: &'a Tuned,
    link: &'a FittedLink,
    fitted: Part,
    judged: Part,
}

impl Search<'_> {
    /// The scales of a set's inputs: all together first, then one after the other.
    fn scales(&self, set: Features) -> Result<Setting> {
        let (x, judged) = (
            set.compute(&self.fitted.pairs),
            set.compute(&self.judged.pairs),
        );
        let scaler = Scaler::measured(&x)?;
        let inputs = x.ncols();
        let score = |scales: &[f64]| -> Result<f64> {
            let blank = Blank::new(self.tuned.waves(SEARCH_NEURONS, scales), inputs, &scaler)?;
            let ridge = Ridge::relative(RIDGE);
            let (beta, constant) = solve(&blank.matrix(&x)?, &self.fitted.targets, ridge)?;
            let targets = blank.matrix(&judged)?.dot(&beta) + &constant;
            let predicted = self.link.to_values(targets)?;
            let truth = self.judged.values.view();
            let metrics = Metrics::of(&self.judged.pairs, predicted.view(), truth)?;
            Ok(self.tuned.metric.of(&metrics))
        };
        let mut best = vec![0.7; inputs];
        let mut least = score(&best)?;
        for (round, step) in STEPS.into_iter().enumerate() {
            // In the first round all inputs move together before each does.
            let together = (round == 0).then_some((0..inputs).collect::<Vec<_>>());
            let moves = together
                .into_iter()
                .chain((0..inputs).map(|input| vec![input]));
            for moved in moves {
                for factor in [step, 1.0 / step] {
                    let mut scales = best.clone();
                    for &input in &moved {
                        scales[input] *= factor;
                    }
                    let found = score(&scales)?;
                    if found < least {
                        (best, least) = (scales, found);
                        break;
                    }
                }
            }
        }
        Ok(Setting {
            set,
            scales: best,
            score: least,
        })
    }
}
