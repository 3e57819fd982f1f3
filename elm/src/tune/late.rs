//! The last steps of the full search: the fit to all rows, once more with scales by its own slopes, and with
//! fewer neurons.
//!
//! The network of all rows has more of them and more neurons than those of the search, and better slopes.

use ndarray::{Array1, Axis, s};

use super::full::FEW_ROWS;
use super::metric::{SLOPE_ROWS, by_slopes, spread, variances, wide};
use super::rows::deviation;
use crate::dataset::{Dataset, TargetDim};
use crate::error::Result;
use crate::model::ElmParams;
use crate::network::Elm;
use crate::scalar::Scalar;

/// What the second fit must win by, of the squared error of rows left out: that of rows whose slopes were
/// used is a little too good.
const MARGIN: f64 = 0.02;

/// The share of the squared error of rows left out that fewer neurons may cost.
const FEWER: f64 = 0.01;
/// Neurons that are not halved any more.
const FEWEST: usize = 50;

/// The fit, and its settings: of half the neurons, and half of these, while that costs little.
pub(super) fn fit<A: Scalar, D: TargetDim>(
    params: ElmParams<A>,
    data: &Dataset<'_, A, D>,
) -> Result<(ElmParams<A>, Elm<A, D>)> {
    let (mut params, mut model) = fit_twice(params, data)?;
    let mut least = left_out(&model, data);
    while params.neurons() >= 2 * FEWEST {
        let half = params.clone().with_neurons(params.neurons() / 2);
        let Ok(smaller) = half.fit_dataset(data) else {
            break;
        };
        let error = left_out(&smaller, data);
        if error.is_nan() || error > (1.0 + FEWER) * least {
            break;
        }
        least = least.min(error);
        (params, model) = (half, smaller);
    }
    Ok((params, model))
}

/// Of few rows the search has seen all, and leave-one-out is too kind to slopes.
fn fit_twice<A: Scalar, D: TargetDim>(
    params: ElmParams<A>,
    data: &Dataset<'_, A, D>,
) -> Result<(ElmParams<A>, Elm<A, D>)> {
    let model = params.fit_dataset(data)?;
    if data.rows() > FEW_ROWS
        && let Some(again) = with_slopes(&params, &model, data)
        // Weights that overflow are no better.
        && let Ok(other) = again.fit_dataset(data)
        && left_out(&other, data) < (1.0 - MARGIN) * left_out(&model, data)
    {
        return Ok((again, other));
    }
    Ok((params, model))
}

/// These settings with scales of columns by the slopes of a network, and weighted sums of the same size.
fn with_slopes<A: Scalar, D: TargetDim>(
    params: &ElmParams<A>,
    model: &Elm<A, D>,
    data: &Dataset<'_, A, D>,
) -> Option<ElmParams<A>> {
    let every = data.rows().div_ceil(SLOPE_ROWS);
    let some = data.inputs().slice_move(s![..;every, ..]);
    let weights = data.weights().map(|weights| weights.mapv(Scalar::as_f64));
    let weights = weights.map(|weights| weights.slice_move(s![..;every]));
    let u = model.map().embed(some);
    let mut squares = Array1::<f64>::zeros(u.ncols());
    for (beta, deviation) in model.beta().columns().into_iter().zip(deviations(data)) {
        let slopes = model.map().slopes(u.view(), beta);
        let own = slopes.mapv(|slope| (slope.as_f64() / deviation).powi(2));
        squares += &match &weights {
            None => own.sum_axis(Axis(0)),
            Some(weights) => own.t().dot(weights),
        };
    }
    let scales = by_slopes(&squares)?;
    let weights = weights.as_ref().map(|weights| weights.view());
    let variances = variances(wide(u.view()).view(), weights);
    let before = match params.input_scales() {
        [] => vec![1.0; scales.len()],
        own => own.to_vec(),
    };
    let factor = spread(&before, &variances) / spread(&scales, &variances);
    (factor > 0.0 && factor.is_finite()).then(|| {
        let params = params.clone().with_scale(params.scale() * factor);
        params.with_input_scales(scales)
    })
}

/// The sum over outputs of squared errors of rows left out, relative to the targets' variances; not a number,
/// which is neither more nor less than any, where they are not known.
pub(super) fn left_out<A: Scalar, D: TargetDim>(
    model: &Elm<A, D>,
    data: &Dataset<'_, A, D>,
) -> f64 {
    let Some(errors) = &model.diagnosis().leave_one_out else {
        return f64::NAN;
    };
    let relative = errors.iter().zip(deviations(data));
    relative
        .map(|(error, deviation)| (error / deviation).powi(2))
        .sum()
}

/// The deviation of each output.
fn deviations<A: Scalar, D: TargetDim>(data: &Dataset<'_, A, D>) -> Vec<f64> {
    let weights = data.weights().map(|weights| weights.mapv(Scalar::as_f64));
    let weights = weights.as_ref().map(|weights| weights.view());
    let targets = data.target_matrix();
    let columns = targets.columns().into_iter();
    columns
        .map(|t| deviation(t.mapv(Scalar::as_f64).view(), weights))
        .collect()
}
