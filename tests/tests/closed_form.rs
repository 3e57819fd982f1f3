//! 10-fold cross-validation of all materials from one factorisation, inputs scaled once, is
//! refitting fold by fold.

// The lint knows test functions, but not the helpers beside them.
#![allow(clippy::unwrap_used)]

use std::sync::Mutex;

use elm::solve::{PseudoInverse, Ridge, Solver};
use elm::{Activation, Dataset, ElmParams, Scaler};
use elm_brdf::features::Features;
use elm_brdf::model::{BrdfParams, GlobalScaling};
use elm_brdf::protocol::{Folds, cross_validate};
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::{Invalid, MaterialId, Measurements, curet, synthetic};
use ndarray::{Array2, ArrayView2, Axis, concatenate};

fn all() -> Vec<MaterialId> {
    MaterialId::all().collect()
}

fn scaled(x: &Array2<f64>) -> Array2<f64> {
    let scaler = Scaler::measured(x).unwrap();
    (x - &scaler.mean()) * scaler.factor()
}

fn largest(values: ArrayView2<'_, f64>) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

fn one_factorization_is_refitting(data: &Measurements) {
    let x = Features::Paper.compute(&data.directions);
    let values: Vec<_> = data.materials.iter().map(|m| m.values.view()).collect();
    let t = concatenate(Axis(1), &values).unwrap();
    let folds = Folds::new(x.nrows(), 10, 1).unwrap();
    let labels: Vec<usize> = (0..x.nrows()).map(|row| folds.of_row(row)).collect();
    for solver in [
        Solver::from(PseudoInverse::default()),
        Ridge::relative(1e-9).into(),
    ] {
        let params = ElmParams::new(50)
            .with_solver(solver)
            .with_intercept(false)
            .with_bounded(false)
            .with_seed(1);
        // All folds of all materials, from one call and one factorisation.
        let fits = params
            .fold_predictions(&Dataset::new(&x, &t).unwrap(), &labels)
            .unwrap();
        assert_eq!(fits.len(), 10);

        // The same network fold by fold: inputs are scaled already, by all rows. Strengths are
        // relative to each fold's own matrix, so the absolute one is carried over.
        let x = scaled(&x);
        let refit = params.with_standardize(false);
        let whole = refit.clone().fit(&x, &t).unwrap();
        for fit in &fits {
            let kept: Vec<usize> = (0..x.nrows())
                .filter(|&r| labels[r] != fit.label())
                .collect();
            let (x_kept, t_kept) = (x.select(Axis(0), &kept), t.select(Axis(0), &kept));
            let mut fold = refit.clone();
            if let Solver::Ridge(_) = solver {
                let of_fold = refit.fit(&x_kept, &t_kept).unwrap();
                let size = |model: &elm::Elm<f64>| model.diagnosis().largest_singular_value;
                let ratio = size(&whole) / size(&of_fold);
                fold = fold.with_solver(Ridge::relative(1e-9 * ratio * ratio));
            }
            let truth = fold.fit(&x_kept, &t_kept).unwrap().predict(&x).unwrap();
            let error = largest((&fit.predictions() - &truth).view());
            let limit = 1e-9 * largest(t.view());
            assert!(
                error <= limit,
                "{solver}, fold {}: {error:e} > {limit:e}",
                fit.label()
            );
        }
    }
}

#[test]
fn where_nothing_is_scaled_scaling_once_is_scaling_in_each_fold() {
    let data = synthetic::measurements(1, &all()[..5], Invalid::Clamp);
    let folds = Folds::new(data.directions.len(), 10, 1).unwrap();
    let params = BrdfParams {
        features: Features::Paper,
        transform: TargetTransform::Identity,
        // Well conditioned, so that the two routes have the same digits.
        network: ElmParams::new(30)
            .with_activation(Activation::Sine)
            .with_scale(3.0)
            .with_solver(PseudoInverse::default())
            .with_standardize(false)
            .with_intercept(false),
    };
    let each = cross_validate(&params, &data, &folds, |_, _| {}).unwrap();
    let once = GlobalScaling::new(params).unwrap();
    let calls = Mutex::new(Vec::new());
    let done = |done, all| calls.lock().unwrap().push((done, all));
    let once = cross_validate(&once, &data, &folds, done).unwrap();
    assert_eq!(calls.into_inner().unwrap(), [(10, 10)]);
    for (a, b) in each.iter().zip(&once) {
        let limit = 1e-9 * largest(a.predicted.view());
        assert!(largest((&a.predicted - &b.predicted).view()) <= limit);
        for (a, b) in a.channels.iter().zip(&b.channels) {
            for (a, b) in [(&a.train, &b.train), (&a.held_out, &b.held_out)] {
                assert!((a.rmse - b.rmse).abs() <= limit);
            }
        }
    }
}

#[test]
fn ten_folds_of_all_materials_of_the_synthetic_data_are_those_of_refitting() {
    one_factorization_is_refitting(&synthetic::measurements(1, &all(), Invalid::Clamp));
}

#[test]
#[ignore = "needs data: CUReT"]
fn ten_folds_of_all_measured_materials_are_those_of_refitting() {
    if let Some(dir) = elm_test_support::curet() {
        one_factorization_is_refitting(&curet::read(&dir, &all(), Invalid::Clamp).unwrap());
    }
}
