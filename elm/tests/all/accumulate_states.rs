//! States that forget, are merged, and are made compact.

use crate::accumulate::{assert_same_fit, data};
use elm::solve::Ridge;
use elm::{Accumulator, Dataset, ElmParams, Error, Scaler, persist};
use ndarray::{Array1, Axis, s};

#[test]
fn what_is_forgotten_weighs_as_much_as_in_a_weighted_batch() {
    let (x, t) = data::<f64>(120, 5);
    let age = |row: usize| 5 - row / 20;
    let weights = Array1::from_shape_fn(120, |row| 0.7_f64.powi(age(row) as i32));
    let params = ElmParams::new(10).with_solver(Ridge::relative(1e-6));
    let batch = Dataset::new(&x, &t).unwrap();
    let batch = batch.with_weights(&weights).unwrap();
    let batch = params.fit_dataset(&batch).unwrap();
    let scaler = Scaler::measured_weighted(&x, &weights).unwrap();
    let mut recent = Accumulator::with_scaler(&params, scaler, 2).unwrap();
    for start in (0..120).step_by(20) {
        recent.forget(0.7).unwrap();
        let range = s![start..start + 20, ..];
        recent.push(&x.slice(range), &t.slice(range)).unwrap();
    }
    assert_same_fit(&recent.fit().unwrap(), &batch, &x, "forgotten");
    assert_eq!(recent.rows(), 120);
    for wrong in [-0.1, 1.1, f64::NAN] {
        let error = recent.forget(wrong).unwrap_err();
        assert!(matches!(error, Error::Parameter { name: "factor", .. }));
    }
    recent.forget(0.0).unwrap();
    assert!(matches!(recent.fit(), Err(Error::Empty { .. })));
}

#[test]
fn after_all_is_forgotten_an_accumulator_is_as_good_as_new() {
    let (x, t) = data::<f64>(40, 7);
    let (other, targets) = data::<f64>(40, 8);
    let other = other.mapv(|x| 100.0 * x);
    for intercept in [true, false] {
        let params = ElmParams::new(10)
            .with_solver(Ridge::relative(1e-6))
            .with_intercept(intercept);
        let scaler = Scaler::measured(&x).unwrap();
        let new = Accumulator::with_scaler(&params, scaler, 2).unwrap();
        let new = new.with_unlike_rows(true);
        let mut fresh = new.clone();
        fresh.push(&x, &t).unwrap();
        // Rows that still wait, those of weights that vanish by and by, and rows in the triangle.
        for (factor, times) in [(0.0, 1), (1e-200, 5)] {
            for compact in [false, true] {
                let mut used = new.clone();
                used.push(&other, &targets).unwrap();
                for _ in 0..times {
                    used.forget(factor).unwrap();
                }
                if compact {
                    used.compact().unwrap();
                }
                used.push(&x, &t).unwrap();
                let fitted = used.fit().unwrap();
                assert!(fitted.beta().iter().all(|value| value.is_finite()));
                let difference = fitted.beta().to_owned() - fresh.fit().unwrap().beta();
                let largest = difference.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
                let size = fitted.beta().iter().fold(0.0_f64, |m, b| m.max(b.abs()));
                assert!(largest <= 1e-9 * size, "{largest} of {size}");
            }
        }
    }
}

#[test]
fn a_fit_that_forgets_follows_a_drift_for_ever() {
    let (x, _) = data::<f64>(60, 5);
    let scaler = Scaler::measured(&x).unwrap();
    let params = ElmParams::new(12).with_solver(Ridge::relative(1e-8));
    let none = Accumulator::<f64>::with_scaler(&params, scaler, 1).unwrap();
    let target = |day: f64| x.column(0).mapv(|x| x * day).insert_axis(Axis(1));
    let mut recent = none.clone();
    for day in 0..3000 {
        recent.forget(0.5).unwrap();
        recent.push(&x, &target(f64::from(day))).unwrap();
    }
    // Rows are of age 1 in the mean, and a fit of a given strength is linear in the targets.
    let mut once = none;
    once.push(&x, &target(2998.0)).unwrap();
    let [recent, once] = [recent, once].map(|rows| rows.fit().unwrap().predict(&x).unwrap());
    let most = once.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let error = (recent - &once).mapv(f64::abs);
    assert!(error.iter().all(|e| *e < 1e-6 * most), "{error}");
}

#[test]
fn states_of_few_rows_are_merged_as_if_their_rows_had_been_pushed() {
    let (x, t) = data::<f64>(300, 5);
    let scaler = Scaler::measured(&x).unwrap();
    let none = Accumulator::with_scaler(&ElmParams::new(20), scaler, 2).unwrap();
    let (mut pushed, mut merged) = (none.clone(), none.clone());
    for start in (0..300).step_by(10) {
        let range = s![start..start + 10, ..];
        let mut group = none.clone();
        group.push(&x.slice(range), &t.slice(range)).unwrap();
        merged.merge(&group).unwrap();
        pushed.push(&x.slice(range), &t.slice(range)).unwrap();
    }
    assert_eq!(merged, pushed);
}

#[test]
fn a_compact_accumulator_has_the_same_fit_and_a_small_file() {
    let (x, t) = data::<f64>(300, 5);
    let scaler = Scaler::measured(&x).unwrap();
    let mut rows = Accumulator::with_scaler(&ElmParams::new(100), scaler, 2).unwrap();
    rows.push(&x, &t).unwrap();
    let (fit, bytes) = (rows.fit().unwrap(), persist::to_bytes(&rows).unwrap());
    rows.compact().unwrap();
    let small = persist::to_bytes(&rows).unwrap();
    // The triangle of 103 columns, and what describes the layer.
    assert!(small.len() < 8 * (103 * 104 / 2) + 8_000, "{}", small.len());
    assert!(bytes.len() > 4 * small.len());
    let again: Accumulator<f64> = persist::from_bytes(&small).unwrap();
    assert_eq!(again, rows);
    assert_eq!(again.fit().unwrap(), fit);
    rows.push(&x, &t).unwrap();
    assert_eq!(rows.rows(), 600);
}
