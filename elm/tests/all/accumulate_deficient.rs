//! Hidden matrices without full rank and targets with noise: the residual must stay out of the
//! directions that are rounding error.

use crate::common::{amplification, frobenius, normal};
use elm::solve::{PseudoInverse, Ridge, Solver};
use elm::{Accumulator, Elm, ElmParams, Scalar, metrics};
use ndarray::{Array1, Array2, Axis, s};
use proptest::prelude::*;

fn accumulated<A: Scalar>(
    params: &ElmParams<A>,
    x: &Array2<A>,
    t: &Array2<A>,
    chunk: usize,
) -> Elm<A> {
    let mut accumulator = Accumulator::from_sample(params, x, t.ncols()).unwrap();
    for (x, t) in x
        .axis_chunks_iter(Axis(0), chunk)
        .zip(t.axis_chunks_iter(Axis(0), chunk))
    {
        accumulator.push(&x, &t).unwrap();
    }
    accumulator.fit().unwrap()
}

fn rmse<A: Scalar>(one: &Array2<A>, other: &Array2<A>) -> f64 {
    let difference = one - other;
    frobenius(&difference) / (difference.len() as f64).sqrt()
}

/// The residual that a fit reports must be that of its predictions.
fn assert_reported_residual_is_true<A: Scalar>(model: &Elm<A>, x: &Array2<A>, t: &Array2<A>) {
    let residuals = t - &model.predict(x).unwrap();
    for (found, column) in model
        .diagnosis()
        .residual_norm
        .iter()
        .zip(residuals.columns())
    {
        let norm = column.iter().map(|v| v.as_f64().powi(2)).sum::<f64>();
        approx::assert_relative_eq!(*found, norm.sqrt(), max_relative = 1e-2);
    }
}

/// Rows of x in [-3, 3] with what passes for noise on a sine, and the sine.
fn noisy_sine<A: Scalar>() -> (Array2<A>, Array2<A>, Array2<A>) {
    let x = Array1::linspace(-3.0, 3.0, 200).insert_axis(Axis(1));
    let sine = x.mapv(f64::sin);
    let mut t = sine.clone();
    for (row, t) in t.iter_mut().enumerate() {
        *t += 0.424 * (1.7 * (row * row) as f64).sin();
    }
    let narrow = |a: Array2<f64>| a.mapv(A::from_f64);
    (narrow(x), narrow(t), narrow(sine))
}

fn a_noisy_sine_is_accumulated<A: Scalar>() {
    let (x, t, sine) = noisy_sine::<A>();
    for solver in [Solver::default(), Ridge::gcv().into()] {
        let params = ElmParams::new(50).with_solver(solver);
        let batch = rmse(&params.fit(&x, &t).unwrap().predict(&x).unwrap(), &sine);
        for chunk in [200, 30] {
            let model = accumulated(&params, &x, &t, chunk);
            let error = rmse(&model.predict(&x).unwrap(), &sine);
            assert!(error < 1.4 * batch, "{error} for {batch}");
            assert_reported_residual_is_true(&model, &x, &t);
        }
    }
}

#[test]
fn a_noisy_sine_is_accumulated_as_well_as_it_is_fitted() {
    a_noisy_sine_is_accumulated::<f64>();
    a_noisy_sine_is_accumulated::<f32>();
}

#[test]
fn more_neurons_than_two_inputs_need_are_accumulated_as_well_as_they_are_fitted() {
    let x = normal::<f64>(1000, 2, 41);
    let truth = x
        .map_axis(Axis(1), |row| (row[0] - row[1] * row[1]).sin())
        .insert_axis(Axis(1));
    let t = &truth + &normal::<f64>(1000, 1, 42).mapv(|v| 0.3 * v);
    let params = ElmParams::new(200).with_solver(Ridge::gcv());
    let batch = params.fit(&x, &t).unwrap();
    let model = accumulated(&params, &x, &t, 130);
    let error = |model: &Elm<f64>| rmse(&model.predict(&x).unwrap(), &truth);
    let (found, expected) = (error(&model), error(&batch));
    assert!(found < 1.1 * expected, "{found} for {expected}");
    assert_reported_residual_is_true(&model, &x, &t);
}

/// `points` different rows in three dimensions, each several times with noise of its own: the
/// hidden matrix has exactly that rank, or one less for the intercept.
fn repeated<A: Scalar>(points: usize, rows: usize, seed: u64) -> (Array2<A>, Array2<A>) {
    let places = normal::<A>(points, 3, seed);
    let order: Vec<usize> = (0..rows).map(|row| row * 7919 % points).collect();
    let x = places.select(Axis(0), &order);
    let noise = normal::<A>(rows, 2, seed + 1).mapv(|v| v * A::from_f64(0.3));
    let t = x.slice(s![.., ..2]).mapv(A::sin) + noise;
    (x, t)
}

/// For each row the mean target of the rows with the same inputs.
fn means<A: Scalar>(x: &Array2<A>, t: &Array2<A>) -> Array2<A> {
    let mut means = Array2::zeros(t.dim());
    for (row, mut mean) in x.rows().into_iter().zip(means.rows_mut()) {
        let same: Vec<usize> = (0..x.nrows()).filter(|&i| x.row(i) == row).collect();
        let count = A::from_f64(same.len() as f64);
        mean.assign(&(t.select(Axis(0), &same).sum_axis(Axis(0)) / count));
    }
    means
}

fn accumulated_equals_batch<A: Scalar>(
    points: usize,
    chunk: usize,
    seed: u64,
) -> Result<(), TestCaseError> {
    let (x, t) = repeated::<A>(points, 240, seed);
    for solver in [
        Solver::from(PseudoInverse::default()),
        Ridge::relative(1e-9).into(),
        Ridge::relative(1e-3).into(),
        Ridge::gcv().into(),
    ] {
        let params = ElmParams::new(40)
            .with_scale(1.5)
            .with_solver(solver)
            .with_seed(seed);
        let params = params;
        let batch = params.fit(&x, &t).unwrap();
        let model = accumulated(&params, &x, &t, chunk);
        let (a, b) = (model.predict(&x).unwrap(), batch.predict(&x).unwrap());
        let amplification = amplification(model.diagnosis()).min(amplification(batch.diagnosis()));
        // By perturbation theory, as residuals are as large as fitted values: epsilon times the
        // condition, times the root of the size for errors that add up (Higham 2002, ch. 20).
        let bound = 4.0 * 280_f64.sqrt() * A::epsilon().as_f64() * amplification * frobenius(&t);
        let error = frobenius(&(&a - &b));
        // Where two strengths have the same score to rounding either may be chosen; near a minimum
        // of the score, its relative rounding error of 1e-9 is one of 3e-5 in the fit.
        let tie = if model.diagnosis().lambda == batch.diagnosis().lambda {
            0.0
        } else {
            1e-4 * frobenius(&t)
        };
        prop_assert!(error <= bound + tie, "{solver}: {error:e} > {bound:e}");
        // All neurons together can place every point on the mean of its targets.
        if solver.name() == "pseudo-inverse" && points <= 20 {
            let error = frobenius(&(a - means(&x, &t)));
            prop_assert!(error <= bound, "means: {error:e} > {bound:e}");
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn accumulated_fits_equal_batches_at_every_rank(
        points in 2_usize..60,
        chunk in 1_usize..240,
        seed in 0_u64..1000,
    ) {
        accumulated_equals_batch::<f64>(points, chunk, seed)?;
        accumulated_equals_batch::<f32>(points, chunk, seed)?;
    }
}

#[test]
fn metrics_of_a_mean_are_those_of_an_accumulated_constant() {
    // One point alone: nothing but the intercept is left.
    let (x, t) = repeated::<f64>(1, 60, 3);
    let params = ElmParams::new(10);
    let y = accumulated(&params, &x, &t, 11).predict(&x).unwrap();
    let error = metrics::rmse(&y.column(0), &means(&x, &t).column(0)).unwrap();
    assert!(error < 1e-14);
}
