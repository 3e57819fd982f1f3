//! What `ElmParams::auto` predicts outside the rows that it was fitted to.

use elm::{Dataset, ElmParams};
use ndarray::{Array2, Axis};
use serde::Serialize;

use super::TEST_ROWS;
use super::problems::Problem;

/// One problem at one seed, judged on rows whose inputs are stretched about their middle.
#[derive(Debug, Clone, Serialize)]
pub struct Outside {
    /// The problem.
    pub problem: &'static str,
    /// Of data and layers.
    pub seed: u64,
    /// Share of the rows at 1.2 times the extent that lie outside the box of the training rows.
    pub outside: f64,
    /// RMSE at 1 and 1.2 times the extent, over the training targets' deviation.
    pub rmse: [f64; 2],
    /// The same without bounds.
    pub unbounded: [f64; 2],
    /// How often intervals that are asked to cover 0.9 do, at 1 and 1.2 times the extent.
    pub coverage: [f64; 2],
    /// How far a prediction at 3 times the extent leaves the range of the training targets at most,
    /// in units of that range.
    pub excess: f64,
}

/// Runs a problem at a seed; nothing where it cannot be drawn or fitted, which its caller reports.
#[must_use]
pub fn run(problem: &Problem, seed: u64) -> Option<Outside> {
    let (x, t) = problem.train(seed)?;
    let tuned = ElmParams::auto()
        .with_seed(seed)
        .tune(&Dataset::new(&x, &t).ok()?)
        .ok()?;
    let free = tuned.model.clone().with_bounded(false);
    let uncertain = tuned
        .params
        .fit_uncertain(&Dataset::new(&x, &t).ok()?)
        .ok()?;
    let deviation = t.std_axis(Axis(0), 0.0);
    let (mut rmse, mut unbounded, mut coverage) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let mut outside = 0.0;
    for (place, stretch) in [1.0, 1.2].into_iter().enumerate() {
        let (x, [observed, _]) = problem.test(seed, TEST_ROWS, stretch)?;
        let relative = |predicted: Array2<f64>| {
            let errors = (predicted - &observed) / &deviation;
            (errors.mapv(|e| e * e).sum() / errors.len() as f64).sqrt()
        };
        rmse[place] = relative(tuned.model.predict(&x).ok()?);
        unbounded[place] = relative(free.predict(&x).ok()?);
        let (low, high) = uncertain.predict_interval(&x, 0.9).ok()?;
        let inside = |((t, low), high): ((&f64, &f64), &f64)| low <= t && t <= high;
        let covered = observed.iter().zip(&low).zip(&high).filter(|&v| inside(v));
        coverage[place] = covered.count() as f64 / observed.len() as f64;
        let distances = tuned.model.distance_outside(&x).ok()?;
        outside = distances.iter().filter(|d| **d > 0.0).count() as f64 / TEST_ROWS as f64;
    }
    let (x, _) = problem.test(seed, TEST_ROWS, 3.0)?;
    let predicted = tuned.model.predict(&x).ok()?;
    let mut excess = 0.0_f64;
    for (predicted, t) in predicted.columns().into_iter().zip(t.columns()) {
        let ends = |ends: (f64, f64), &v: &f64| (ends.0.min(v), ends.1.max(v));
        let (least, greatest) = t.iter().fold((f64::MAX, f64::MIN), ends);
        for y in predicted {
            let beyond = (y - greatest).max(least - y).max(0.0);
            excess = excess.max(beyond / (greatest - least));
        }
    }
    Some(Outside {
        problem: problem.name,
        seed,
        outside,
        rmse,
        unbounded,
        coverage,
        excess,
    })
}
