//! The relative strengths of ridge that are tried, and the choice among them by their scores.

use ndarray::ArrayView1;

use super::design_svd::DesignSvd;
use crate::scalar::Scalar;

/// Steps of the grid to a decade.
const STEPS_PER_DECADE: i32 = 4;
/// Of the weakest and the strongest candidate.
pub(super) const FIRST_STEP: i32 = -31 * STEPS_PER_DECADE;
const LAST_STEP: i32 = 2 * STEPS_PER_DECADE;

/// The steps from `first` to the strongest.
pub(super) fn grid(first: i32) -> impl Iterator<Item = i32> {
    first..=LAST_STEP
}

/// The strength of a step.
pub(super) fn strength(step: i32) -> f64 {
    10.0_f64.powf(f64::from(step) / f64::from(STEPS_PER_DECADE))
}

/// The candidates that make a difference to this problem and that its spectrum serves, rising.
pub(super) fn distinguishable_lambdas<A: Scalar>(spectrum: &DesignSvd<A>) -> Vec<f64> {
    let weakest = spectrum.weakest.unwrap_or(0.0);
    let mut candidates = all_distinguishable_lambdas(spectrum);
    candidates.retain(|strength| *strength >= weakest);
    candidates
}

/// Also those that the spectrum does not serve.
pub(super) fn all_distinguishable_lambdas<A: Scalar>(spectrum: &DesignSvd<A>) -> Vec<f64> {
    let smallest = match (spectrum.s.first(), spectrum.s.last()) {
        (Some(&first), Some(&last)) => (last / first).as_f64().powi(2),
        _ => 1.0,
    };
    let step = |strength: f64| {
        let step = (strength.log10() * f64::from(STEPS_PER_DECADE)).floor();
        (step as i32).clamp(FIRST_STEP, LAST_STEP)
    };
    // Below `dense` only the last per cent of the smallest direction is at stake.
    let (first, dense) = (step(smallest * f64::EPSILON), step(smallest * 1e-2));
    grid(first)
        .filter(|step| *step >= dense || (dense - step) % (2 * STEPS_PER_DECADE) == 0)
        .map(strength)
        .collect()
}

/// Strengths, two to a decade, down to where the smallest direction of a matrix of this condition is no
/// longer held back.
pub(crate) fn coarse_grid(condition: f64) -> Vec<f64> {
    let least = (condition.powi(-2) * 1e-2).max(1e-12);
    grid(FIRST_STEP)
        .filter(|step| step % 2 == 0)
        .map(strength)
        .filter(|strength| *strength >= least)
        .collect()
}

/// The share of a held-out squared error that is given for a stronger ridge: half a per cent of an
/// RMSE, which some thousands of rows do not tell from chance. Scores are often as flat over many
/// decades of the strength, and the weakest of those has output weights thousands of times larger,
/// which only cancel among the rows that the choice was made on.
pub(crate) const TOLERANCE: f64 = 0.01;

/// A share of a score that makes no difference.
pub(super) const FLAT: f64 = 1e-2 * TOLERANCE;

/// The index of the last score that exceeds the smallest finite one by no more than this share.
pub(crate) fn last_within(scores: ArrayView1<'_, f64>, tolerance: f64) -> usize {
    let smallest = scores.iter().copied().fold(f64::INFINITY, f64::min);
    let bound = smallest * (1.0 + tolerance);
    scores
        .iter()
        .rposition(|&score| score <= bound)
        .unwrap_or(scores.len() - 1)
}
