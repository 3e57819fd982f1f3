//! Problems of many more rows than neurons, which are solved a tile of rows at a time: the answers are
//! those of the factorized hidden-layer matrix.

use elm::cross_validation::CrossValidator;
use elm::solve::{LeastSquares, PseudoInverse, Ridge, Route, Solver};
use elm::{Dataset, ElmParams, Scalar};
use ndarray::{Array1, Array2};

use crate::common::{largest, normal, weights};

/// A smooth function of three inputs, with noise.
fn data<A: Scalar>(rows: usize) -> (Array2<A>, Array2<A>) {
    let x = normal::<f64>(rows, 3, 1);
    let noise = normal::<f64>(rows, 2, 2);
    let t = Array2::from_shape_fn((rows, 2), |(i, j)| {
        (x[[i, 0]] + x[[i, j]] * x[[i, 2]]).sin() + 0.1 * noise[[i, j]]
    });
    (x.mapv(A::from_f64), t.mapv(A::from_f64))
}

fn agrees_with_the_matrix<A: Scalar>(params: ElmParams<A>, bound: f64) -> Route {
    let (x, t) = data::<A>(70_000);
    let weights: Array1<A> = weights(x.nrows(), 3);
    let params = params.with_bounded(false);
    let model = params
        .fit_dataset(
            &Dataset::new(&x, &t)
                .unwrap()
                .with_weights(&weights)
                .unwrap(),
        )
        .unwrap();
    let hidden = model.hidden_matrix(&x).unwrap();
    let (hidden, targets) = (hidden.mapv(Scalar::as_f64), t.mapv(Scalar::as_f64));
    let weights = weights.mapv(Scalar::as_f64);
    let problem = LeastSquares::new(&hidden, &targets)
        .unwrap()
        .with_intercept(true);
    let validator = CrossValidator::new(&problem.with_weights(&weights).unwrap()).unwrap();
    let diagnosis = model.diagnosis();
    let lambda = validator.select_lambda(Ridge::default()).unwrap();
    assert_eq!(diagnosis.lambda, lambda);
    let expected = validator.leave_one_out(&lambda).unwrap().rmse();
    for (found, expected) in diagnosis
        .leave_one_out
        .as_ref()
        .unwrap()
        .iter()
        .zip(&expected)
    {
        assert!(
            (found / expected - 1.0).abs() < 1e-6,
            "{found} is not {expected}"
        );
    }
    let solution = validator.solve(&lambda).unwrap();
    let expected = hidden.dot(&solution.beta) + &solution.intercept;
    let apart = largest(&(model.predict(&x).unwrap().mapv(Scalar::as_f64) - &expected));
    assert!(apart < bound * largest(&expected), "{apart:e}");
    diagnosis.route
}

/// 70,000 x 63, conditions of 1e3 with links and 1e8 without: 1e-8 is the bound by sums of products,
/// and beyond condition times epsilon times the root of the size, 5e-6, on the other way.
#[test]
fn leave_one_out_of_many_rows_is_that_of_the_matrix() {
    let steep = ElmParams::new(60).with_scale(2.0).with_direct_links(true);
    assert_eq!(agrees_with_the_matrix::<f64>(steep, 1e-8), Route::GramSvd);
    let flat = ElmParams::new(63).with_scale(0.1);
    assert_eq!(agrees_with_the_matrix::<f64>(flat, 5e-6), Route::QrSvd);
}

/// Rounding has its part in the score in single precision, so that the strength is another one.
#[test]
fn leave_one_out_of_many_rows_foretells_errors_in_single_precision() {
    let (x, t) = data::<f32>(70_000);
    let (test, expected) = data::<f32>(80_000);
    let rest = ndarray::s![70_000.., ..];
    for params in [
        ElmParams::new(63).with_scale(0.1),
        ElmParams::new(60).with_scale(2.0).with_direct_links(true),
    ] {
        let model = params.fit(&x, &t).unwrap();
        let errors = model.predict(&test.slice(rest)).unwrap() - expected.slice(rest);
        let foretold = model.diagnosis().leave_one_out.clone().unwrap();
        for (errors, foretold) in errors.columns().into_iter().zip(foretold) {
            let squares = errors.iter().map(|e| f64::from(*e).powi(2)).sum::<f64>();
            // 10,000 rows have a standard error of 1 %.
            let ratio = (squares / 10_000.0).sqrt() / foretold;
            assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
        }
    }
}

#[test]
fn other_solvers_of_many_rows_agree_with_the_matrix() {
    let (x, t) = data::<f64>(70_000);
    for solver in [
        Solver::from(PseudoInverse::default()),
        Ridge::relative(1e-10).into(),
        Ridge::gcv().into(),
    ] {
        let params = ElmParams::new(60)
            .with_scale(2.0)
            .with_solver(solver)
            .with_bounded(false);
        let model = params.fit(&x, &t).unwrap();
        let hidden = model.hidden_matrix(&x).unwrap();
        let problem = LeastSquares::new(&hidden, &t).unwrap().with_intercept(true);
        let validator = CrossValidator::new(&problem).unwrap();
        let expected = validator.solve(&model.diagnosis().lambda).unwrap();
        let fitted = hidden.dot(&expected.beta) + &expected.intercept;
        let apart = largest(&(model.predict(&x).unwrap() - &fitted));
        assert!(apart < 1e-8 * largest(&fitted), "{solver}: {apart:e}");
        assert_eq!(model.diagnosis().leave_one_out, None);
    }
}
