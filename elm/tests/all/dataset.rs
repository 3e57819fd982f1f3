//! Datasets: weights and groups in every verb that takes them, and the dimension of predictions.

use std::collections::BTreeMap;

use elm::solve::Ridge;
use elm::tune::Criterion;
use elm::{Dataset, Elm, ElmParams, Error, metrics, persist};
use ndarray::{Array1, Array2, Axis, Ix1, Ix2, array};

use crate::common::normal;

fn problem(rows: usize) -> (Array2<f64>, Array1<f64>) {
    let x = normal::<f64>(rows, 2, 1);
    let noise = normal::<f64>(rows, 1, 2);
    let t = x.map_axis(Axis(1), |row| (2.0 * row[0]).sin() + row[1]);
    (x, t + 0.1 * noise.remove_axis(Axis(1)))
}

#[test]
fn no_group_is_in_two_folds_and_folds_have_like_numbers_of_groups() {
    let (x, t) = problem(60);
    let groups: Vec<usize> = (0..60).map(|row| 7 * ((row * row) % 13)).collect();
    let data = Dataset::new(&x, &t).unwrap().with_groups(&groups).unwrap();
    let folds = data.folds(3, 5).unwrap();
    let mut of_group = BTreeMap::new();
    for (group, fold) in groups.iter().zip(&folds) {
        assert_eq!(of_group.entry(group).or_insert(fold), &fold);
    }
    let sizes = |fold: usize| of_group.values().filter(|own| ***own == fold).count();
    let sizes: Vec<usize> = (0..3).map(sizes).collect();
    assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1);
    assert_eq!(folds, data.folds(3, 5).unwrap());
    let many = data.folds(of_group.len() + 1, 5);
    assert!(matches!(many, Err(Error::Parameter { name: "folds", .. })));
    assert!(matches!(
        Dataset::new(&x, &t).unwrap().with_groups(&groups[1..]),
        Err(Error::Shape { .. })
    ));
}

#[test]
fn the_tuner_leaves_out_groups_whole() {
    // Each row ten times: left out alone, a row is known from its copies.
    let (x, t) = problem(40);
    let copies: Vec<usize> = (0..400).map(|row| row % 40).collect();
    let (x, t) = (x.select(Axis(0), &copies), t.select(Axis(0), &copies));
    let data = Dataset::new(&x, &t).unwrap();
    let grouped = data.with_groups(&copies).unwrap();
    for criterion in [Criterion::LeaveOneOut, Criterion::KFold(5)] {
        let tuner = ElmParams::new(30).tuner().with_budget(4);
        let score = |data: &Dataset<'_, f64, Ix1>| {
            let tuner = tuner.clone().with_criterion(criterion);
            tuner.tune(data).unwrap().trials[0].score
        };
        assert!(score(&grouped) > 1.1 * score(&data), "{criterion:?}");
    }
    let same = vec![3; 400];
    let one = data.with_groups(&same).unwrap();
    assert!(matches!(
        ElmParams::new(30).tuner().tune(&one),
        Err(Error::Parameter { name: "groups", .. })
    ));
}

#[test]
fn rows_of_weight_0_are_no_rows_for_validation_and_the_tuner() {
    let (x, t) = problem(80);
    let weights = Array1::from_shape_fn(80, |row| {
        if row < 50 {
            1.0 + (row % 3) as f64
        } else {
            0.0
        }
    });
    let wild = Array1::from_shape_fn(80, |row| if row < 50 { t[row] } else { 1e3 });
    let part = ndarray::s![..50];
    let (x_50, t_50, w_50) = (
        x.slice(ndarray::s![..50, ..]),
        t.slice(part),
        weights.slice(part),
    );
    let all = Dataset::new(&x, &wild)
        .unwrap()
        .with_weights(&weights)
        .unwrap();
    let some = Dataset::new(&x_50, &t_50)
        .unwrap()
        .with_weights(&w_50)
        .unwrap();
    let params = ElmParams::new(15).with_solver(Ridge::relative(1e-6));
    let folds: Vec<usize> = (0..80).map(|row| row % 5).collect();
    let of_all = params.cross_val_predict(&all, &folds).unwrap();
    let of_some = params.cross_val_predict(&some, &folds[..50]).unwrap();
    approx::assert_relative_eq!(
        of_all.predictions().slice(part),
        of_some.predictions(),
        max_relative = 1e-6,
        epsilon = 1e-9
    );
    approx::assert_relative_eq!(of_all.rmse(), of_some.rmse(), max_relative = 1e-6);
    let tuner = ElmParams::new(15).tuner().with_budget(6);
    let (of_all, of_some) = (tuner.tune(&all).unwrap(), tuner.tune(&some).unwrap());
    assert_eq!(of_all.trials, of_some.trials);
    assert_eq!(of_all.model, of_some.model);
    // A factor of all weights says nothing.
    let doubled = &w_50 * 2.0;
    let doubled = Dataset::new(&x_50, &t_50)
        .unwrap()
        .with_weights(&doubled)
        .unwrap();
    assert_eq!(tuner.tune(&doubled).unwrap().best, of_some.best);
}

#[test]
fn equal_weights_are_none_for_uncertainty() {
    let (x, t) = problem(20);
    let weights = Array1::from_elem(20, 4.0);
    let data = Dataset::new(&x, &t).unwrap();
    let plain = ElmParams::new(5).fit_uncertain(&data).unwrap();
    let weighted = data.with_weights(&weights).unwrap();
    let weighted = ElmParams::new(5).fit_uncertain(&weighted).unwrap();
    assert_eq!(
        weighted.predict_interval(&x, 0.8).unwrap(),
        plain.predict_interval(&x, 0.8).unwrap()
    );
    assert_eq!(weighted.noise(), plain.noise());
}

#[test]
fn predictions_have_the_dimension_of_the_targets_and_files_either() {
    let (x, t) = problem(30);
    let params = ElmParams::new(8);
    let vector = params.fit(&x, &t).unwrap();
    let matrix = params.fit(&x, &t.view().insert_axis(Axis(1))).unwrap();
    let predicted: Array1<f64> = vector.predict(&x).unwrap();
    let as_matrix: Array2<f64> = matrix.predict(&x).unwrap();
    assert_eq!(as_matrix.column(0), predicted);
    assert_eq!(params.fit(&x, &t.to_vec()).unwrap(), vector);
    assert_eq!(params.fit(&x, t.as_slice().unwrap()).unwrap(), vector);

    let bytes = persist::to_bytes(&vector).unwrap();
    assert_eq!(bytes, persist::to_bytes(&matrix).unwrap());
    assert_eq!(
        persist::from_bytes::<Elm<f64, Ix1>>(&bytes).unwrap(),
        vector
    );
    assert_eq!(
        persist::from_bytes::<Elm<f64, Ix2>>(&bytes).unwrap(),
        matrix
    );

    let two = params.fit(&x, &ndarray::stack![Axis(1), t, t]).unwrap();
    let bytes = persist::to_bytes(&two).unwrap();
    assert!(persist::from_bytes::<Elm<f64, Ix1>>(&bytes).is_err());
    assert!(two.clone().into_dimensionality::<Ix1>().is_err());

    // R2 of one output, and the mean over two.
    let r2 = metrics::r2(&predicted, &t).unwrap();
    assert_eq!(vector.score(&x, &t).unwrap(), r2);
    let mean = two.score(&x, &ndarray::stack![Axis(1), t, t]).unwrap();
    approx::assert_relative_eq!(mean, r2, max_relative = 1e-9);

    let mut out = Array1::zeros(30);
    let predictor = vector.predictor();
    predictor
        .predict_into(&x, &mut out, &mut predictor.scratch())
        .unwrap();
    assert_eq!(out, predicted);
    assert_eq!(vector.predict(&array![[0.5, 0.5]]).unwrap().len(), 1);
}
