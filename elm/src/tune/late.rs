//! The last steps of the full search: the fit to all rows, once more with scales by its own slopes, and with
//! fewer neurons.
//!
//! The network of all rows has more of them and more neurons than those of the search, and better slopes.

use ndarray::{Array1, Axis, s};

use super::full::FEW_ROWS;
use super::metric::{SLOPE_ROWS, spread, variances, wide};
use super::rows::deviation;
use super::slopes::proportional;
use crate::dataset::{Dataset, TargetDim};
use crate::error::Result;
use crate::model::ElmParams;
use crate::network::Elm;
use crate::scalar::Scalar;

/// What the second fit must win by, of the squared error of rows left out: that of rows whose slopes were
/// used is a little too good.
const MARGIN: f64 = 0.02;

/// What twice the neurons must win by, of the squared error of rows left out, up to the usual number and
/// beyond it; half of them are taken where they cost no more than the first.
const MORE: (f64, f64) = (0.01, 0.02);
/// Neurons that are not halved any more.
const FEWEST: usize = 50;
/// Rows to a column of the hidden layer below which there are not more neurons than usual: they take long
/// there and win little.
const ROWS: usize = 2;

/// The fit, and its settings. These come with the usual number of neurons: half of them at first, twice as
/// many while that pays, with slopes once more where these paid before or as they are, up to twice the usual
/// number and within `most`; else half as many while that costs little.
pub(super) fn fit<A: Scalar, D: TargetDim>(
    params: ElmParams<A>,
    most: Option<usize>,
    data: &Dataset<'_, A, D>,
) -> Result<(ElmParams<A>, Elm<A, D>)> {
    let usual = params.neurons();
    let few = (usual / 2).max(usual.min(FEWEST));
    let given = params.input_scales().to_vec();
    let (mut params, mut model) = fit_twice(params.with_neurons(few), data)?;
    let slopes_paid = params.input_scales() != given;
    let mut least = left_out(&model, data);
    let with = |params: ElmParams<A>| {
        // Weights that overflow are no better.
        let model = params.fit_dataset(data).ok()?;
        let error = left_out(&model, data);
        Some((params, model, error))
    };
    let links = model.beta().nrows() - few;
    let room = (data.rows() / ROWS).saturating_sub(links);
    let beyond = room.min(2 * usual).min(most.unwrap_or(usize::MAX));
    for (neurons, margin) in [(usual, MORE.0), (beyond, MORE.1)] {
        if 2 * neurons < 3 * params.neurons() {
            break;
        }
        let again = slopes_paid.then(|| with_slopes(&params, &model, data));
        // Slopes once more can make worse what more neurons would mend.
        let settings = again.flatten().into_iter().chain([params.clone()]);
        let mut tried = settings.filter_map(|settings| with(settings.with_neurons(neurons)));
        match tried.find(|(_, _, error)| *error < (1.0 - margin) * least) {
            Some((twice, larger, error)) => (params, model, least) = (twice, larger, error),
            None => break,
        }
        if !slopes_paid && neurons == usual {
            // More neurons have better slopes.
            (params, model) = once_more(params, model, data);
            least = left_out(&model, data);
        }
    }
    let grown = params.neurons() > few;
    while !grown
        && params.neurons() >= 2 * FEWEST
        && let half = params.neurons() / 2
        && let Some((half, smaller, error)) = with(params.clone().with_neurons(half))
        && error <= (1.0 + MORE.0) * least
    {
        least = least.min(error);
        (params, model) = (half, smaller);
    }
    Ok((params, model))
}

/// Once with the scales given, and [once more](once_more).
fn fit_twice<A: Scalar, D: TargetDim>(
    params: ElmParams<A>,
    data: &Dataset<'_, A, D>,
) -> Result<(ElmParams<A>, Elm<A, D>)> {
    let model = params.fit_dataset(data)?;
    Ok(once_more(params, model, data))
}

/// With slopes of its own, where that is better. Of few rows the search has seen all, and leave-one-out is
/// too kind to slopes.
fn once_more<A: Scalar, D: TargetDim>(
    params: ElmParams<A>,
    model: Elm<A, D>,
    data: &Dataset<'_, A, D>,
) -> (ElmParams<A>, Elm<A, D>) {
    if data.rows() > FEW_ROWS
        && let Some(again) = with_slopes(&params, &model, data)
        // Weights that overflow are no better.
        && let Ok(other) = again.fit_dataset(data)
        && left_out(&other, data) < (1.0 - MARGIN) * left_out(&model, data)
    {
        return (again, other);
    }
    (params, model)
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
    let scales = proportional(&squares.mapv_into(f64::sqrt).to_vec(), 1.0)?;
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

#[test]
fn slopes_of_many_rows_find_the_input_that_matters() {
    use crate::activation::Activation;
    use crate::solve::Ridge;
    use crate::{Embedding, Ramps};
    use ndarray::Array2;

    let x = Array2::from_shape_fn((1600, 4), |(row, input)| {
        (row as f64 * [0.618_034, 0.414_214, 0.732_051, 0.236_068][input]).fract()
    });
    let t = x.column(1).mapv(|x| (8.0 * x).sin());
    let ramps = Ramps::of(x.view(), None, 4);
    let params = ElmParams::new(100)
        .with_activation(Activation::Tanh)
        .with_direct_links(true)
        .with_embedding(Embedding::Ramps(ramps))
        .with_solver(Ridge::leave_one_out());
    let data = Dataset::new(&x, &t).unwrap();
    let once = params.fit_dataset(&data).unwrap();
    let (found, twice) = fit_twice(params.clone(), &data).unwrap();
    assert!(left_out(&twice, &data) < (1.0 - MARGIN) * left_out(&once, &data));
    let relevance = found.relevance(4);
    let others = [0, 2, 3].map(|other| relevance[other]);
    assert!(
        others.iter().all(|other| relevance[1] > 2.0 * other),
        "{relevance:?}"
    );
    // Few rows keep what the search gave them.
    let few = (x.slice(s![..400, ..]), t.slice(s![..400]));
    let data = Dataset::new(&few.0, &few.1).unwrap();
    assert_eq!(fit_twice(params.clone(), &data).unwrap().0, params);
}

#[test]
fn neurons_are_doubled_where_that_pays_and_never_beyond_what_is_asked_for() {
    use crate::activation::Activation;
    use crate::solve::Ridge;
    use ndarray::Array2;

    let x = Array2::from_shape_fn((1600, 2), |(row, input)| {
        (row as f64 * [0.618_034, 0.414_214][input]).fract()
    });
    let noise = |row: usize| (row as f64 * 0.732_051).fract() - 0.5;
    let wave = Array1::from_shape_fn(1600, |row| {
        (9.0 * x[[row, 0]]).sin() * (11.0 * x[[row, 1]]).cos() + 0.02 * noise(row)
    });
    let plane = Array1::from_shape_fn(1600, |row| x[[row, 0]] - x[[row, 1]] + noise(row));
    let params = ElmParams::new(120)
        .with_activation(Activation::Tanh)
        .with_direct_links(true)
        .with_scale(3.0)
        .with_solver(Ridge::leave_one_out());
    let neurons = |t: &Array1<f64>, most| {
        let data = Dataset::new(&x, t).unwrap();
        fit(params.clone(), most, &data).unwrap().0.neurons()
    };
    assert_eq!(neurons(&wave, None), 240);
    assert_eq!(neurons(&wave, Some(200)), 200);
    assert_eq!(neurons(&wave, Some(120)), 120);
    assert_eq!(neurons(&plane, None), 60);
}

#[test]
fn neurons_are_doubled_where_that_pays_without_slopes_once_more() {
    use crate::activation::Activation;
    use crate::solve::Ridge;
    use crate::{Embedding, Ramps};
    use ndarray::Array2;

    let x = Array2::from_shape_fn((1600, 5), |(row, input)| {
        let step = [0.618_034, 0.414_214, 0.732_051, 0.236_068, 0.831][input];
        (row as f64 * step + 0.658).fract()
    });
    // A value of its own for each of 64 cells.
    let t = x.map_axis(Axis(1), |x| {
        let (one, other) = ((8.0 * x[0]).floor(), (8.0 * x[1]).floor());
        let angle: f64 = one * 12.9898 + other * 78.233 + 34.0;
        (angle.sin() * 43_758.545_3).fract() + 0.3 * x[2]
    });
    let ramps = Ramps::of(x.view(), None, 8);
    let params = ElmParams::new(160)
        .with_activation(Activation::Tanh)
        .with_direct_links(true)
        .with_seed(34)
        .with_embedding(Embedding::Ramps(ramps))
        .with_solver(Ridge::leave_one_out());
    let data = Dataset::new(&x, &t).unwrap();
    let (few, model) = fit_twice(params.clone().with_neurons(80), &data).unwrap();
    // Slopes paid before, and would not again.
    assert!(!few.input_scales().is_empty());
    let again = with_slopes(&few, &model, &data).unwrap().with_neurons(160);
    let again = again.fit_dataset(&data).unwrap();
    let least = (1.0 - MORE.0) * left_out(&model, &data);
    assert!(left_out(&again, &data) > least);
    assert_eq!(fit(params, None, &data).unwrap().0.neurons(), 320);
}
