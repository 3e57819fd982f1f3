//! Bad or extreme input gives a correct result or a typed error that names the place: never a
//! panic, a hang or a silent NaN.

use crate::common::{Problem, amplification, frobenius, normal};
use elm::solve::{Inverse, LeastSquares, PseudoInverse, Ridge, Solver};
use elm::{Activation, Biases, Dataset, Elm, ElmParams, Error, Result, Scalar, TargetDim};
use ndarray::{Array, Array1, Array2, array, s};

fn solvers() -> [Solver; 5] {
    [
        Inverse.into(),
        PseudoInverse::default().into(),
        Ridge::relative(1e-6).into(),
        Ridge::leave_one_out().into(),
        Ridge::gcv().into(),
    ]
}

fn expect_error<T>(result: Result<T>, expected: &Error, what: &str) {
    match result {
        // Not `==`: a NaN in the error is not equal to itself.
        Err(error) => assert_eq!(format!("{error:?}"), format!("{expected:?}"), "{what}"),
        Ok(_) => panic!("{what}: accepted"),
    }
}

#[test]
fn values_that_are_not_finite_are_named_by_row_and_column() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for solver in solvers() {
            let mut x = normal::<f64>(5, 2, 1);
            let mut t = normal::<f64>(5, 3, 2);
            let model = ElmParams::new(5).with_solver(solver).fit(&x, &t).unwrap();
            x[[3, 1]] = bad;
            let place = |what, row, column| Error::NotFinite { what, row, column };
            let params = ElmParams::new(5).with_solver(solver);
            expect_error(params.fit(&x, &t), &place("inputs", 3, 1), "inputs");
            expect_error(model.predict(&x), &place("inputs", 3, 1), "prediction");
            x[[3, 1]] = 0.0;
            t[[4, 2]] = bad;
            expect_error(params.fit(&x, &t), &place("targets", 4, 2), "targets");
            expect_error(
                LeastSquares::new(&t, &x),
                &place("hidden-layer matrix", 4, 2),
                "matrix",
            );
        }
    }
    let spike = Activation::custom("spike", |z: f64| 1.0 / (z - z));
    expect_error(
        ElmParams::new(4)
            .with_activation(spike)
            .fit(&array![[1.0], [2.0]], &array![1.0, 2.0]),
        &Error::NotFinite {
            what: "hidden-layer matrix",
            row: 0,
            column: 0,
        },
        "an activation of the user's own",
    );
}

#[test]
fn shapes_that_do_not_fit_are_named_with_both_sizes() {
    let (x, t) = (normal::<f64>(4, 2, 1), normal::<f64>(3, 1, 2));
    let empty = |what, rows, columns| Error::Empty {
        what,
        rows,
        columns,
    };
    let shape = |what, expected, found| Error::Shape {
        what,
        expected,
        found,
    };
    let params = ElmParams::<f64>::new(3);
    let none = |rows, columns| Array2::<f64>::zeros((rows, columns));
    expect_error(
        params.fit(&x, &t),
        &shape("rows of targets", 4, 3),
        "fewer targets",
    );
    expect_error(
        params.fit(&none(0, 2), &none(0, 1)),
        &empty("inputs", 0, 2),
        "no rows",
    );
    expect_error(
        params.fit(&none(4, 0), &none(4, 1)),
        &empty("inputs", 4, 0),
        "no inputs",
    );
    expect_error(
        params.fit(&x, &none(4, 0)),
        &empty("targets", 4, 0),
        "no outputs",
    );
    let model = params.fit(&x, &normal(4, 1, 3)).unwrap();
    expect_error(
        model.predict(&normal(5, 3, 4)),
        &shape("columns of inputs", 2, 3),
        "a third input",
    );
    assert_eq!(model.predict(&none(0, 2)).unwrap().dim(), (0, 1));
    let weights = array![1.0, 2.0];
    let t = normal(4, 1, 3);
    expect_error(
        Dataset::new(&x, &t).unwrap().with_weights(&weights),
        &shape("row weights", 4, 2),
        "weights",
    );
}

#[test]
fn row_weights_out_of_range_are_named_with_their_value() {
    let (x, t) = (normal::<f64>(3, 2, 1), normal::<f64>(3, 1, 2));
    for (weights, value) in [
        (array![1.0, -2.0, 1.0], -2.0),
        (array![1.0, 1.0, f64::NAN], f64::NAN),
        (array![f64::INFINITY, 1.0, 1.0], f64::INFINITY),
        (array![0.0, 0.0, 0.0], 0.0),
    ] {
        let data = Dataset::new(&x, &t).unwrap().with_weights(&weights);
        expect_error(
            data.and_then(|data| ElmParams::new(2).fit_dataset(&data)),
            &Error::Parameter {
                name: "row weight",
                value,
                expected: "finite, not negative, not all zero",
            },
            "weights",
        );
    }
}

#[test]
fn settings_out_of_range_are_named_with_their_value() {
    let good = || ElmParams::<f64>::new(3);
    for (params, name, value) in [
        (ElmParams::new(0), "neurons", 0.0),
        (good().with_scale(0.0), "scale", 0.0),
        (good().with_scale(-1.0), "scale", -1.0),
        (good().with_scale(f64::NAN), "scale", f64::NAN),
        (good().with_scale(f64::INFINITY), "scale", f64::INFINITY),
        (good().with_biases(Biases::Scaled(-0.5)), "biases", -0.5),
        (
            good().with_biases(Biases::Scaled(f64::NAN)),
            "biases",
            f64::NAN,
        ),
        (good().with_solver(Ridge::relative(0.0)), "lambda", 0.0),
        (good().with_solver(Ridge::relative(-1.0)), "lambda", -1.0),
        (
            good().with_solver(Ridge::relative(f64::NAN)),
            "lambda",
            f64::NAN,
        ),
        (
            good().with_solver(PseudoInverse::with_cutoff(1.0)),
            "cutoff",
            1.0,
        ),
        (
            good().with_solver(PseudoInverse::with_cutoff(f64::NAN)),
            "cutoff",
            f64::NAN,
        ),
    ] {
        match params.check() {
            Err(Error::Parameter {
                name: found,
                value: given,
                ..
            }) => {
                assert_eq!((found, given.to_bits()), (name, value.to_bits()));
            }
            other => panic!("{name} = {value}: {other:?}"),
        }
    }
}

#[test]
fn a_layer_that_no_memory_can_hold_is_an_error() {
    let (x, t) = (normal::<f64>(3, 2, 1), normal::<f64>(3, 1, 2));
    for neurons in [usize::MAX, usize::MAX / 8, usize::MAX / 64] {
        assert!(matches!(
            ElmParams::new(neurons).fit(&x, &t),
            Err(Error::TooLarge { .. })
        ));
    }
}

#[test]
fn equation_10_refuses_what_it_cannot_answer() {
    let solve = |h: &Array2<f64>| {
        Solver::from(Inverse).solve(&LeastSquares::new(h, &normal(h.nrows(), 1, 1)).unwrap())
    };
    expect_error(
        solve(&normal(3, 2, 1)),
        &Error::NotSquare {
            rows: 3,
            neurons: 2,
        },
        "three rows",
    );
    for singular in [
        Array2::zeros((3, 3)),
        Array2::ones((3, 3)),
        array![[1.0, 2.0], [2.0, 4.0]],
        array![[1.0, 0.0], [0.0, 1e-17]],
    ] {
        assert!(matches!(
            solve(&singular),
            Err(Error::Singular { reciprocal_condition }) if reciprocal_condition < 1e-15
        ));
    }
    let (h, t) = (Array2::<f64>::eye(2), array![[1.0], [2.0]]);
    let weights = array![1.0, 2.0];
    for problem in [
        LeastSquares::new(&h, &t).unwrap().with_intercept(true),
        LeastSquares::new(&h, &t)
            .unwrap()
            .with_weights(&weights)
            .unwrap(),
    ] {
        assert!(matches!(
            Solver::from(Inverse).solve(&problem),
            Err(Error::Conflict { .. })
        ));
    }
}

/// Whatever was fitted is finite, and so is what it reports.
fn assert_sound<A: Scalar, D: TargetDim>(
    model: &Elm<A, D>,
    x: &Array2<A>,
    what: &str,
) -> Array<A, D> {
    let d = model.diagnosis();
    let numbers = [
        d.condition.unwrap_or(1.0),
        d.largest_singular_value,
        d.smallest_singular_value.unwrap_or(0.0),
    ];
    let vectors = [
        &d.lambda,
        &d.degrees_of_freedom,
        &d.residual_norm,
        &d.beta_norm,
    ];
    let all = numbers
        .iter()
        .chain(vectors.into_iter().flatten())
        .chain(d.leave_one_out.iter().flatten());
    for number in all {
        assert!(number.is_finite() && *number >= 0.0, "{what}: {d:?}");
    }
    let y = model.predict(x).unwrap();
    assert!(y.iter().all(|v| v.is_finite()), "{what}");
    y
}

#[test]
fn unusual_shapes_and_columns_are_fitted() {
    let mut constant = normal::<f64>(20, 3, 1);
    constant.column_mut(1).fill(-7.5);
    let mut huge = constant.clone();
    huge.column_mut(1).fill(1e300);
    let cases = [
        ("one row", normal(1, 3, 2)),
        ("two rows", normal(2, 3, 2)),
        ("one input", normal(30, 1, 3)),
        ("more inputs than rows", normal(4, 9, 4)),
        ("a constant column", constant),
        ("a huge constant column", huge),
        ("zeros", Array2::zeros((12, 2))),
        ("one row, many times", Array2::from_elem((12, 2), 0.1)),
    ];
    for (name, x) in &cases {
        for outputs in [1, 3] {
            let t = normal::<f64>(x.nrows(), outputs, 5);
            for solver in solvers() {
                for neurons in [1, 7, 50] {
                    let what = format!("{name}, {solver}, {neurons}");
                    match ElmParams::new(neurons).with_solver(solver).fit(x, &t) {
                        Ok(model) => {
                            assert_sound(&model, x, &what);
                        }
                        // Only equation 10 may decline, and then with its reason.
                        Err(Error::NotSquare { .. } | Error::Singular { .. }) => {
                            assert_eq!(solver.name(), "inverse", "{what}");
                        }
                        Err(error) => panic!("{what}: {error}"),
                    }
                }
            }
        }
    }
}

#[test]
fn inputs_without_information_are_answered_by_the_mean() {
    let t = array![[1.0, -5.0], [2.0, 0.0], [6.0, 2.0]];
    for x in [Array2::zeros((3, 2)), Array2::from_elem((3, 2), 0.1)] {
        for solver in &solvers()[1..] {
            for standardize in [true, false] {
                let model = ElmParams::new(9)
                    .with_solver(*solver)
                    .with_standardize(standardize)
                    .fit(&x, &t)
                    .unwrap();
                let y = assert_sound(&model, &x, "constant inputs");
                approx::assert_relative_eq!(
                    y,
                    array![[3.0, -1.0], [3.0, -1.0], [3.0, -1.0]],
                    max_relative = 1e-14
                );
            }
        }
    }
}

#[test]
fn constant_targets_are_predicted_exactly() {
    let x = normal::<f64>(30, 2, 1);
    for constant in [0.0, 0.1, -3e200, 5e-320] {
        let t = Array1::from_elem(30, constant);
        for solver in &solvers()[1..] {
            let model = ElmParams::new(9).with_solver(*solver).fit(&x, &t).unwrap();
            for y in assert_sound(&model, &x, "constant targets") {
                // The mean of 30 equal numbers, and its correction, round.
                assert!((y - constant).abs() <= 4.0 * f64::EPSILON * constant.abs());
            }
        }
    }
}

/// Multiplying inputs (standardized) and targets by any power of ten changes the fit by rounding
/// only, up to the ends of the range.
#[test]
fn values_from_one_end_of_the_range_to_the_other_give_the_same_fit() {
    let (x, t) = (normal::<f64>(40, 2, 1), normal::<f64>(40, 2, 2));
    for solver in &solvers()[1..] {
        let params = ElmParams::new(10).with_solver(*solver);
        let y = params.fit(&x, &t).unwrap().predict(&x).unwrap();
        for power in [-300, -200, -20, 20, 200, 300] {
            let factor = 10.0_f64.powi(power);
            let (big_x, big_t) = (&x * factor, &t * factor);
            let model = params.fit(&big_x, &big_t).unwrap();
            let found = assert_sound(&model, &big_x, "scaled") / factor;
            // Each scaled value is rounded once; the fit passes that on by its condition.
            let bound = 1e3 * f64::EPSILON * amplification(model.diagnosis()) * frobenius(&y);
            let error = frobenius(&(&found - &y));
            assert!(error <= bound, "{solver}, 1e{power}: {error:e} > {bound:e}");
        }
    }
}

#[test]
fn matrices_from_one_end_of_the_range_to_the_other_are_solved() {
    // beta = diag(2, 4) exactly representable at every power of two.
    for power in [-1070, -1022, -600, 0, 600, 1020] {
        // In two halves, as powi inverts a positive power, which would be infinite.
        let unit = 2.0_f64.powi(power / 2) * 2.0_f64.powi(power - power / 2);
        let h = array![[unit, 0.0], [0.0, unit]];
        let t = array![[2.0 * unit, 0.0], [0.0, 4.0 * unit]];
        for solver in [Solver::from(Inverse), PseudoInverse::default().into()] {
            let problem = LeastSquares::new(&h, &t).unwrap();
            let beta = solver.solve(&problem).unwrap().beta;
            approx::assert_relative_eq!(beta, array![[2.0, 0.0], [0.0, 4.0]], max_relative = 1e-15);
        }
    }
}

#[test]
fn a_column_of_subnormals_beside_ordinary_ones_does_no_harm() {
    let mut problem = Problem::noisy(normal::<f64>(30, 5, 1), 1, 0.1, 2);
    let clean = problem.hidden.slice(s![.., ..4]).to_owned();
    problem.hidden.column_mut(4).mapv_inplace(|v| v * 1e-310);
    for intercept in [false, true] {
        problem.intercept = intercept;
        let mut without = Problem::new(clean.clone(), problem.targets.clone());
        without.intercept = intercept;
        for solver in &solvers()[1..4] {
            let (one, other) = (problem.solve(*solver), without.solve(*solver));
            let difference = &one.beta.slice(s![..4, ..]) - &other.beta;
            let bound = 1e3 * f64::EPSILON * amplification(&one.diagnosis) * frobenius(&one.beta);
            assert!(frobenius(&difference) <= bound, "{solver}");
        }
    }
}

#[test]
fn weights_from_one_end_of_the_range_to_the_other_are_honoured() {
    // Rows of weight 1e-300 beside rows of weight 1 decide nothing.
    let problem = Problem::noisy(normal::<f64>(30, 5, 1), 1, 0.1, 2).with_intercept();
    let heavy: Vec<usize> = (0..30).filter(|row| row % 3 != 0).collect();
    for (light, full) in [(1e-300, 1.0), (5e-324, 1.0), (1.0, 1e300), (1e-300, 1e300)] {
        let weights = Array1::from_shape_fn(30, |row| if row % 3 == 0 { light } else { full });
        let weighted = problem.clone().weighted(weights);
        for solver in &solvers()[1..3] {
            let (one, other) = (weighted.solve(*solver), problem.rows(&heavy).solve(*solver));
            let difference = frobenius(&(&one.beta - &other.beta));
            let bound = 1e3 * f64::EPSILON * amplification(&other.diagnosis) * frobenius(&one.beta);
            assert!(difference <= bound, "{solver}: {difference:e} > {bound:e}");
        }
        assert!(
            weighted
                .solve(Ridge::leave_one_out())
                .beta
                .iter()
                .all(|b| b.is_finite())
        );
    }
}

#[test]
fn what_overflows_says_so() {
    // The answer would be 1e400.
    let (h, t) = (array![[1e-200], [2e-200]], array![[1e200], [2e200]]);
    let problem = LeastSquares::new(&h, &t).unwrap();
    for solver in &solvers()[1..4] {
        assert!(matches!(
            solver.solve(&problem),
            Err(Error::Overflow { .. })
        ));
    }
    // Ten times further out than a slope of 1e307 reaches.
    let x = array![[0.0], [1.0], [2.0]];
    let model = ElmParams::new(3)
        .with_activation(Activation::Linear)
        .with_bounded(false)
        .fit(&x, &x.mapv(|x| x * 1e307))
        .unwrap();
    assert!(matches!(
        model.predict(&array![[1e3]]),
        Err(Error::Overflow { .. })
    ));
}

#[test]
fn single_precision_has_the_same_answers_at_the_ends_of_its_range() {
    let (x, t) = (normal::<f32>(40, 2, 1), normal::<f32>(40, 1, 2));
    for solver in &solvers()[1..] {
        let params = ElmParams::new(8).with_solver(*solver);
        let y = params.fit(&x, &t).unwrap().predict(&x).unwrap();
        for power in [-36, -20, 20, 36] {
            let factor = 10.0_f32.powi(power);
            let (big_x, big_t) = (&x * factor, &t * factor);
            let model = params.fit(&big_x, &big_t).unwrap();
            let found = assert_sound(&model, &big_x, "scaled") / factor;
            let bound =
                1e3 * f64::from(f32::EPSILON) * amplification(model.diagnosis()) * frobenius(&y);
            assert!(frobenius(&(&found - &y)) <= bound, "{solver}, 1e{power}");
        }
    }
}

#[test]
fn a_student_t_distribution_needs_a_degree_of_freedom() {
    let params = ElmParams::<f64>::new(3).with_distribution(elm::Distribution::StudentT(0));
    assert!(matches!(
        params.check(),
        Err(Error::Parameter {
            name: "degrees of freedom",
            ..
        })
    ));
}
