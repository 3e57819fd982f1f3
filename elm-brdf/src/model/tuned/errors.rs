//! Weights of errors of targets, and the noise that they show.

use ndarray::{Array1, ArrayView1, ArrayView2};

use crate::error::Error;
use crate::metrics::Metric;
use crate::target_transform::FittedTransform;
use elm_datasets::geometry::DirectionPair;

/// Of the errors the largest are cut off at this quantile, lest a few rows decide.
const QUANTILE: f64 = 0.99;

pub(super) fn no_fit() -> Error {
    Error::NoConvergence {
        what: "the search for a strength of regularisation",
    }
}

/// What an error of a row's target is in the metric: to first order
/// $(f + o) \cos\theta_o / (1 + f \cos\theta_o)$ for the log-cosine error of a target $\ln(1 + f/o)$,
/// mean over channels. As a weight of *squares* it stands between least squares and the least
/// absolute errors that the metric asks for. `None` for metrics that targets serve as they are: the
/// cube root, which is near to them, and RMSE, of which a few bright rows would leave nothing to the
/// others.
pub(super) fn row_weights(
    metric: Metric,
    pairs: &[DirectionPair],
    values: ArrayView2<'_, f64>,
    transform: &FittedTransform,
) -> Option<Array1<f64>> {
    if metric != Metric::LogCosine {
        return None;
    }
    let offsets = transform.offsets();
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

/// The mean of each column of squared errors, the largest cut off.
pub(super) fn cut_off_means(squares: ArrayView2<'_, f64>) -> Vec<f64> {
    let mean = |column: ArrayView1<'_, f64>| {
        let mut sorted = column.to_vec();
        let place = (sorted.len() as f64 * QUANTILE).ceil() as usize;
        let place = place.clamp(1, sorted.len()) - 1;
        let most = *sorted.select_nth_unstable_by(place, f64::total_cmp).1;
        column.iter().map(|&square| square.min(most)).sum::<f64>() / column.len() as f64
    };
    squares.columns().into_iter().map(mean).collect()
}

/// The geometric mean of the roots.
pub(super) fn geometric_root(variances: &[f64]) -> f64 {
    let logs = variances.iter().map(|variance| variance.max(1e-300).ln());
    (0.5 * logs.sum::<f64>() / variances.len() as f64).exp()
}

/// The standard deviation that the errors at the darker half of the rows have, by their median
/// distance from their median.
pub(super) fn dark_noise(fitted: ArrayView1<'_, f64>, values: ArrayView1<'_, f64>) -> f64 {
    let middle = |values: &mut Vec<f64>| {
        let place = values.len() / 2;
        *values.select_nth_unstable_by(place, f64::total_cmp).1
    };
    if fitted.is_empty() {
        return 0.0;
    }
    let dark = middle(&mut fitted.to_vec());
    let rows = fitted
        .iter()
        .zip(values)
        .filter(|(fitted, _)| **fitted <= dark);
    let mut errors: Vec<f64> = rows.map(|(fitted, value)| value - fitted).collect();
    if errors.is_empty() {
        return 0.0;
    }
    let center = middle(&mut errors);
    errors
        .iter_mut()
        .for_each(|error| *error = (*error - center).abs());
    // The median of a normal deviate's size is 0.6745 standard deviations.
    middle(&mut errors) / 0.6745
}
