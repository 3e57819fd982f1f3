//! Time to error: the best that each peer ELM reaches within a size, and the cheapest setting of
//! ours that reaches as much.

use super::data::{Problem, Size};
use super::rivals::{CrateElm, Ours, Rival, Setting};
use super::worker::Worker;

/// Settings of this project, cheapest first within a number of neurons.
const SCALES: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.8];
const LAMBDAS: [f64; 3] = [1e-3, 1e-5, 1e-7];
/// Of the peers, relative to the number of rows.
const ALPHAS: [f64; 3] = [1e-6, 1e-4, 1e-2];

/// Seeds whose mean error counts; drawing another layer costs a fit of each size.
fn seeds(size: Size) -> u64 {
    if size.rows > 50_000 { 1 } else { 3 }
}

/// A peer's setting and its test error, the mean over seeds.
pub(super) struct Best {
    pub(super) setting: Setting,
    pub(super) rmse: f64,
}

/// The setting of a peer with the smallest error, of neurons up to the size's; of nearly equal
/// ones (to 1 %) the one with the fewest neurons.
pub(super) fn best_of(
    rival: Rival,
    size: Size,
    worker: &mut Worker,
    lists: &CrateElm,
) -> Result<Best, String> {
    let alphas: &[f64] = if rival.is_regularized() {
        &ALPHAS
    } else {
        &[0.0]
    };
    let mut tried: Vec<Best> = Vec::new();
    for share in [16, 8, 4, 2, 1] {
        for alpha in alphas {
            let mut setting = Setting {
                rival,
                neurons: (size.neurons / share).max(2),
                our_layer: false,
                alpha: alpha * size.rows as f64,
                seed: 0,
            };
            let mut sum = 0.0;
            for seed in 1..=seeds(size) {
                setting.seed = seed;
                sum += if rival == Rival::CrateElm {
                    lists.error(&lists.fit(setting.neurons))
                } else {
                    worker.fit(&setting, 0.0)?.1
                };
            }
            tried.push(Best {
                setting,
                rmse: sum / seeds(size) as f64,
            });
        }
    }
    let smallest = tried
        .iter()
        .map(|best| best.rmse)
        .fold(f64::INFINITY, f64::min);
    tried
        .into_iter()
        .find(|best| best.rmse <= smallest * 1.01)
        .ok_or_else(|| format!("{} has no finite error", rival.name()))
}

/// The fewest of our neurons, with the scale and strength that go with them, whose error (the mean
/// over seeds) is at most `target`; `None` where the size's number does not reach it.
pub(super) fn cheapest(
    target: f64,
    size: Size,
    problem: &Problem,
) -> Result<Option<(Ours, f64)>, String> {
    let mut neurons = (size.neurons as f64 / 32.0).max(2.0);
    loop {
        let count = (neurons.round() as usize).min(size.neurons);
        let mut best: Option<(Ours, f64)> = None;
        for scale in SCALES {
            for lambda in LAMBDAS {
                let mut ours = Ours {
                    neurons: count,
                    scale,
                    lambda,
                    seed: 0,
                };
                let mut sum = 0.0;
                for seed in 1..=seeds(size) {
                    ours.seed = seed;
                    sum += ours.score(problem)?.1;
                }
                let error = sum / seeds(size) as f64;
                if best.is_none_or(|(_, least)| error < least) {
                    best = Some((ours, error));
                }
            }
        }
        if let Some((ours, error)) = best
            && error <= target
        {
            return Ok(Some((ours, error)));
        }
        if count == size.neurons {
            return Ok(None);
        }
        neurons *= std::f64::consts::SQRT_2;
    }
}
