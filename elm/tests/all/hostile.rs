//! What somebody who wants to break the library would try: an error that names the place, or an
//! answer that is right.

use elm::cross_validation::{CrossValidator, assign_folds};
use elm::solve::{PseudoInverse, Ridge, Solver};
use elm::tune::Criterion;
use elm::{Accumulator, Activation, Dataset, ElmParams, Error, Scaler, metrics, solve};
use ndarray::{Array1, Array2, ArrayView2, Axis, ShapeBuilder, array, s};

fn wave(rows: usize) -> (Array2<f64>, Array1<f64>) {
    let x = Array2::from_shape_fn((rows, 2), |(i, j)| ((i * (j + 2)) as f64 * 0.37).sin());
    let t = x.map_axis(Axis(1), |row| row[0] * row[1] + 0.1 * row[0]);
    (x, t)
}

#[test]
fn views_of_any_strides_are_fitted_and_predicted_as_their_copies() {
    let (x, t) = wave(24);
    let params = ElmParams::new(7);
    let expected = params.fit(&x, &t).unwrap();
    let backwards = {
        let mut flipped = x.slice(s![..;-1, ..;-1]).to_owned();
        flipped.invert_axis(Axis(0));
        flipped.invert_axis(Axis(1));
        flipped
    };
    let by_columns = Array2::from_shape_fn((24, 2).f(), |place| x[place]);
    let mut spread = Array2::zeros((48, 6));
    spread.slice_mut(s![..;2, 1..;3]).assign(&x);
    let every_other: ArrayView2<'_, f64> = spread.slice(s![..;2, 1..;3]);
    let mut targets = Array2::zeros((24, 3));
    targets.column_mut(1).assign(&t);
    let reversed_t = t.slice(s![..;-1]).to_owned();
    for (what, view) in [
        ("negative strides", backwards.view()),
        ("by columns", by_columns.view()),
        ("every other", every_other),
    ] {
        for model in [
            params.fit(&view, &t).unwrap(),
            params.fit(&view, &targets.column(1)).unwrap(),
            params.fit(&view, &reversed_t.slice(s![..;-1])).unwrap(),
        ] {
            assert_eq!(model, expected, "{what}");
            assert_eq!(
                model.predict(&view).unwrap(),
                expected.predict(&x).unwrap(),
                "{what}"
            );
        }
    }
}

#[test]
fn sizes_that_no_memory_holds_are_errors() {
    let (x, t) = wave(24);
    let model = ElmParams::new(7).fit(&x, &t).unwrap();
    // One row, seen as very many: a view has any length without memory.
    let row = x.slice(s![..1, ..]);
    let many = row.broadcast((1 << 55, 2)).unwrap();
    assert!(matches!(model.predict(&many), Err(Error::TooLarge { .. })));
    for rows in [usize::MAX, 1 << 60] {
        assert!(matches!(
            assign_folds(rows, 2, 0),
            Err(Error::TooLarge { .. })
        ));
    }
    for neurons in [usize::MAX, usize::MAX / 2, 1 << 60] {
        let params = ElmParams::<f64>::new(neurons);
        assert!(matches!(params.fit(&x, &t), Err(Error::TooLarge { .. })));
        assert!(matches!(
            params.with_direct_links(true).fit(&x, &t),
            Err(Error::TooLarge { .. })
        ));
    }
    let params = ElmParams::new(5);
    for outputs in [usize::MAX, 1 << 40] {
        let accumulator = <Accumulator<f64>>::from_sample(&params, &x, outputs);
        assert!(matches!(accumulator, Err(Error::TooLarge { .. })));
    }
    let tuner = ElmParams::<f64>::new(usize::MAX).tuner();
    assert!(matches!(
        tuner.tune(&Dataset::new(&x, &t).unwrap()),
        Err(Error::TooLarge { .. })
    ));
}

#[test]
fn one_row_and_two_are_fitted_by_every_solver_and_way() {
    for rows in [1, 2, 3] {
        let (x, t) = wave(rows);
        for solver in [
            Solver::from(Ridge::default()),
            Ridge::gcv().into(),
            Ridge::relative(1e-6).into(),
            PseudoInverse::default().into(),
        ] {
            let params = ElmParams::new(5).with_solver(solver);
            let model = params.fit(&x, &t).unwrap();
            assert!(
                model.predict(&x).unwrap().iter().all(|y| y.is_finite()),
                "{solver}"
            );
            let checked = params;
            let chunks = [Ok::<_, Error>((x.clone(), t.clone().insert_axis(Axis(1))))];
            let chunked = checked.fit_chunks(chunks).unwrap();
            assert!(
                chunked.predict(&x).unwrap().iter().all(|y| y.is_finite()),
                "{solver}"
            );
        }
        match ElmParams::new(5).fit_uncertain(&Dataset::new(&x, &t).unwrap()) {
            Ok(model) => {
                assert!(rows > 1);
                let deviation = model.predict_deviation(&x).unwrap();
                assert!(deviation.iter().all(|d| *d >= 0.0));
            }
            Err(error) => assert!(matches!(error, Error::Undetermined { .. }), "{error}"),
        }
        match ElmParams::auto().tune(&Dataset::new(&x, &t).unwrap()) {
            Ok(tuned) => assert!(
                tuned
                    .model
                    .predict(&x)
                    .unwrap()
                    .iter()
                    .all(|y| y.is_finite())
            ),
            Err(error) => assert!(
                matches!(
                    error,
                    Error::Undetermined { .. } | Error::Empty { .. } | Error::Parameter { .. }
                ),
                "{error}"
            ),
        }
    }
}

#[test]
fn intervals_of_any_coverage_are_ordered_or_refused() {
    let (x, t) = wave(24);
    let model = ElmParams::new(7)
        .fit_uncertain(&Dataset::new(&x, &t).unwrap())
        .unwrap();
    for coverage in [
        f64::MIN_POSITIVE,
        1e-300,
        1e-10,
        0.01,
        0.5,
        0.9,
        0.99,
        1.0 - 1e-16,
    ] {
        let (low, high) = model.predict_interval(&x, coverage).unwrap();
        assert!(
            low.iter().chain(&high).all(|end| !end.is_nan()),
            "{coverage}"
        );
        if coverage >= 0.5 {
            assert!(
                low.iter().zip(&high).all(|(low, high)| low <= high),
                "{coverage}"
            );
        }
    }
    for coverage in [0.0, 1.0, -1.0, 2.0, f64::NAN, f64::INFINITY] {
        let refused = model.predict_interval(&x, coverage);
        assert!(matches!(
            refused,
            Err(Error::Parameter {
                name: "coverage",
                ..
            })
        ));
    }
}

#[test]
fn folds_that_leave_nothing_are_named() {
    let (x, t) = wave(24);
    let all_one = vec![9; 24];
    let mut singles: Vec<usize> = (0..24).collect();
    singles[3] = usize::MAX;
    for intercept in [true, false] {
        for solver in [
            Solver::from(Ridge::relative(1e-3)),
            PseudoInverse::default().into(),
        ] {
            let params = ElmParams::new(5)
                .with_solver(solver)
                .with_intercept(intercept);
            let checked = params;
            let refused = checked.cross_val_predict(&Dataset::new(&x, &t).unwrap(), &all_one);
            assert!(matches!(
                refused,
                Err(Error::Parameter {
                    name: "fold labels",
                    ..
                })
            ));
            assert!(
                checked
                    .cross_val_predict(&Dataset::new(&x, &t).unwrap(), &singles)
                    .is_ok()
            );
            for folds in [&singles[..0], &singles[..23]] {
                let refused = checked.cross_val_predict(&Dataset::new(&x, &t).unwrap(), folds);
                assert!(matches!(refused, Err(Error::Shape { .. })));
            }
        }
    }
    for (rows, folds) in [
        (0, 0),
        (0, 2),
        (1, 1),
        (1, 2),
        (5, 0),
        (5, 1),
        (5, 6),
        (5, usize::MAX),
    ] {
        assert!(matches!(
            assign_folds(rows, folds, 0),
            Err(Error::Parameter { .. })
        ));
    }
}

#[test]
fn strengths_at_the_ends_of_the_range_are_solved_or_refused() {
    let (x, t) = wave(24);
    for lambda in [
        0.0,
        5e-324,
        1e-300,
        1e-100,
        1e-31,
        1.0,
        1e100,
        1e300,
        f64::MAX,
    ] {
        let params = ElmParams::new(7).with_solver(Ridge::relative(lambda));
        match params.fit(&x, &t) {
            Ok(model) => {
                let y = model.predict(&x).unwrap();
                // Between the mean, where nothing is kept, and twice the largest target.
                assert!(y.iter().all(|y| y.abs() <= 2.0 * 1.1), "{lambda:e}: {y}");
                let largest = model.diagnosis().degrees_of_freedom[0];
                assert!(
                    (1.0 - 1e-9..=8.0 + 1e-9).contains(&largest),
                    "{lambda:e}: {largest}"
                );
            }
            Err(error) => assert!(
                matches!(error, Error::Parameter { .. }),
                "{lambda:e}: {error}"
            ),
        }
    }
    for lambda in [-0.5, -f64::MIN_POSITIVE, f64::NAN, f64::INFINITY] {
        let refused = ElmParams::new(7)
            .with_solver(Ridge::relative(lambda))
            .fit(&x, &t);
        assert!(matches!(refused, Err(Error::Parameter { .. })), "{lambda}");
    }
    let hidden: Array2<f64> = array![[1.0, 2.0], [0.5, 1.0], [3.0, -1.0]];
    let targets = array![[1.0], [2.0], [3.0]];
    let problem = solve::LeastSquares::new(&hidden, &targets).unwrap();
    let validator = CrossValidator::new(&problem).unwrap();
    for lambda in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = validator.leave_one_out(&[lambda]);
        assert!(matches!(refused, Err(Error::Parameter { .. })));
        assert!(validator.k_fold_path(&[0, 1, 2], &[1.0, lambda]).is_err());
    }
    assert!(matches!(
        validator.leave_one_out(&[]),
        Err(Error::Shape { .. })
    ));
    assert!(matches!(
        validator.k_fold_path(&[0, 1, 2], &[]),
        Err(Error::Empty { .. })
    ));
    for lambda in [1e-300_f64, 1e300, f64::MAX] {
        let held_out = validator.leave_one_out(&[lambda]);
        assert!(
            held_out.is_ok_and(|h| h.predictions().iter().all(|p| p.is_finite())),
            "{lambda}"
        );
    }
}

#[test]
fn single_precision_at_the_end_of_its_range_overflows_with_an_error_or_not_at_all() {
    let (x, t) = wave(24);
    for size in [1e-45_f32, 1e-38, 1e-20, 1e20, 1e37, 3e38] {
        let x = x.mapv(|v| v as f32 * size);
        for target in [1e-44_f32, 1e-20, 1.0, 1e30, 3e38] {
            let t = t.mapv(|v| v as f32 * target);
            for params in [
                ElmParams::<f32>::new(7),
                ElmParams::new(7).with_standardize(false),
            ] {
                if let Ok(model) = params.fit(&x, &t)
                    && let Ok(y) = model.predict(&x)
                {
                    assert!(y.iter().all(|y| y.is_finite()), "{size:e} {target:e}");
                }
            }
        }
    }
    // What a fit can answer in the middle of the range it answers at 1e37 too.
    let big = |v: &f64| *v as f32 * 1e37;
    let model = ElmParams::<f32>::new(7)
        .fit(&x.map(big), &t.map(big))
        .unwrap();
    let plain = ElmParams::<f32>::new(7)
        .fit(&x.mapv(|v| v as f32), &t.mapv(|v| v as f32))
        .unwrap();
    let (a, b) = (
        model.predict(&x.map(big)).unwrap(),
        plain.predict(&x.mapv(|v| v as f32)).unwrap(),
    );
    approx::assert_abs_diff_eq!(a / 1e37, b, epsilon = 1e-4);
}

#[test]
fn functions_that_are_not_finite_are_an_error_in_the_fit_and_in_the_prediction() {
    let (x, t) = wave(24);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let always = Activation::custom("bad", move |_| bad);
        let fitted = ElmParams::new(3).with_activation(always).fit(&x, &t);
        assert!(matches!(fitted, Err(Error::NotFinite { .. })), "{bad}");
        let later = Activation::custom("later", move |z: f64| if z > 100.0 { bad } else { z });
        let params = ElmParams::new(3).with_activation(later).with_bounded(false);
        let model = params.fit(&x, &t).unwrap();
        let far = array![[1e9, 1e9], [-1e9, 1e9], [1e9, -1e9], [-1e9, -1e9]];
        assert!(
            matches!(model.predict(&far), Err(Error::Overflow { .. })),
            "{bad}"
        );
    }
    // Every built-in function on rows as far out as there are.
    for activation in Activation::<f64>::BUILT_IN {
        let model = ElmParams::new(3)
            .with_activation(activation.clone())
            .fit(&x, &t)
            .unwrap();
        for far in [1e300, f64::MAX] {
            match model.predict(&array![[far, -far], [far, far]]) {
                Ok(y) => assert!(y.iter().all(|y| y.is_finite()), "{activation}"),
                Err(error) => assert!(matches!(error, Error::Overflow { .. }), "{error}"),
            }
        }
    }
}

#[test]
fn settings_read_from_outside_are_checked_where_they_are_used() {
    for text in [
        r#"{"mean": {"v": 1, "dim": [2], "data": [0.0, 0.0]}, "factor": {"v": 1, "dim": [1], "data": [1.0]}}"#,
        r#"{"mean": {"v": 1, "dim": [0], "data": []}, "factor": {"v": 1, "dim": [0], "data": []}}"#,
        r#"{"mean": {"v": 1, "dim": [1], "data": [1e999]}, "factor": {"v": 1, "dim": [1], "data": [1.0]}}"#,
    ] {
        assert!(serde_json::from_str::<Scaler<f64>>(text).is_err(), "{text}");
    }
    let params = serde_json::to_value(ElmParams::<f64>::new(0)).unwrap();
    let params: ElmParams<f64> = serde_json::from_value(params).unwrap();
    assert!(matches!(
        params.check(),
        Err(Error::Parameter {
            name: "neurons",
            ..
        })
    ));
}

#[test]
fn a_tuner_with_odd_settings_finds_something_or_names_them() {
    let (x, t) = wave(24);
    let tuner = || ElmParams::<f64>::auto().with_budget(3);
    for (what, tuner) in [
        ("no budget", tuner().with_budget(0)),
        ("no neurons", tuner().with_max_neurons(0)),
        ("no rows", tuner().with_search_rows(0)),
        ("one row", tuner().with_search_rows(1)),
        ("no folds", tuner().with_criterion(Criterion::KFold(0))),
        ("one fold", tuner().with_criterion(Criterion::KFold(1))),
        (
            "folds without end",
            tuner().with_criterion(Criterion::KFold(usize::MAX)),
        ),
    ] {
        assert!(
            matches!(
                tuner.tune(&Dataset::new(&x, &t).unwrap()),
                Err(Error::Parameter { .. })
            ),
            "{what}"
        );
    }
    for (what, tuner) in [
        ("one try", tuner().with_budget(1)),
        ("one neuron", tuner().with_max_neurons(1)),
        ("all rows and more", tuner().with_search_rows(usize::MAX)),
        ("two rows", tuner().with_search_rows(2)),
        (
            "a fold for each row",
            tuner().with_criterion(Criterion::KFold(24)),
        ),
    ] {
        let tuned = tuner
            .tune(&Dataset::new(&x, &t).unwrap())
            .unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(tuned.best.score.is_finite(), "{what}");
    }
}

#[test]
fn measures_of_error_hold_at_the_ends_of_the_range() {
    let (p, t) = (array![1.0, 2.0, 4.0], array![1.5, 1.0, 4.5]);
    let plain = metrics::correlation(&p, &t).unwrap().unwrap();
    for size in [1e-300, 1e-200, 1e150, 1e200, 3e307] {
        let (p, t) = (&p * size, &t * size);
        let r = metrics::correlation(&p, &t).unwrap().unwrap();
        approx::assert_relative_eq!(r, plain, max_relative = 1e-12);
        let rmse = metrics::rmse(&p, &t).unwrap() / size;
        approx::assert_relative_eq!(rmse, 0.5_f64.sqrt(), max_relative = 1e-12);
        approx::assert_relative_eq!(
            metrics::mae(&p, &t).unwrap() / size,
            2.0 / 3.0,
            max_relative = 1e-12
        );
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let worse = array![1.0, bad, 3.0];
        let place = |what| Error::NotFinite {
            what,
            row: 1,
            column: 0,
        };
        assert_eq!(metrics::rmse(&worse, &t), Err(place("predictions")));
        assert_eq!(metrics::mae(&t, &worse), Err(place("truth")));
        assert_eq!(metrics::correlation(&t, &worse), Err(place("truth")));
    }
}

#[test]
fn an_accumulator_does_not_mind_empty_chunks_and_rows_without_weight() {
    let (x, t) = wave(24);
    let params = ElmParams::new(5).with_solver(Ridge::relative(1e-4));
    let mut plain = Accumulator::from_sample(&params, &x, 1).unwrap();
    let mut odd = plain.clone();
    plain.push(&x, &t).unwrap();
    odd.push(&x.slice(s![..0, ..]), &t.slice(s![..0])).unwrap();
    odd.push(&x, &t).unwrap();
    odd.push_dataset(
        &Dataset::new(&x, &t.mapv(|t| t + 100.0))
            .unwrap()
            .with_weights(&Array1::zeros(24))
            .unwrap(),
    )
    .unwrap();
    odd.merge(&Accumulator::from_sample(&params, &x, 1).unwrap())
        .unwrap();
    let (a, b) = (plain.fit().unwrap(), odd.fit().unwrap());
    approx::assert_abs_diff_eq!(
        a.predict(&x).unwrap(),
        b.predict(&x).unwrap(),
        epsilon = 1e-12
    );
}
