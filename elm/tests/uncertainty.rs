//! Standard deviations and intervals: against refitting, and by what they cover.

#![allow(clippy::unwrap_used)]

use approx::assert_relative_eq;
use elm::solve::{Lambda, LeastSquares, PseudoInverse, Ridge, Solver};
use elm::{Activation, ElmParams, Error};
use ndarray::{Array1, Array2, Axis, array};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::{StandardNormal, StandardUniform};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn problem(rows: usize, noise: f64, seed: u64) -> (Array2<f64>, Array1<f64>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let x: Array2<f64> = Array2::random_using((rows, 2), StandardUniform, &mut random);
    let e: Array1<f64> = Array1::random_using(rows, StandardNormal, &mut random);
    let t = x
        .rows()
        .into_iter()
        .map(|x| (4.0 * x[0]).sin() + x[1] * x[1])
        .collect::<Array1<f64>>();
    (x, t + noise * e)
}

fn params() -> ElmParams<f64> {
    ElmParams::new(25)
        .activation(Activation::Tanh)
        .scale(1.5)
        .seed(2)
}

#[test]
fn the_deviation_is_that_of_the_ridge_posterior() {
    // Straight from the formula, on the hidden-layer matrix, with the normal equations; they lose
    // condition^2 x eps, and lambda = 1e-4 keeps the squared condition below 1e5.
    let (x, t) = problem(60, 0.1, 1);
    let fitted = params()
        .solver(Ridge::relative(1e-4))
        .fit_uncertain(&x, &t)
        .unwrap();
    let (new, _) = problem(5, 0.0, 9);
    let h = fitted.model().hidden_matrix(&x).unwrap();
    let mean = h.mean_axis(Axis(0)).unwrap();
    let centred = &h - &mean;
    let lambda = 1e-4 * fitted.model().diagnosis().largest_singular_value.powi(2);
    let gram = centred.t().dot(&centred) + Array2::<f64>::eye(25) * lambda;
    let h_new = fitted.model().hidden_matrix(&new).unwrap() - &mean;
    let solution = Solver::from(PseudoInverse::default())
        .solve(&LeastSquares::new(&gram, &h_new.t()).unwrap());
    let inverse_times = solution.unwrap().beta;
    let deviation = fitted.predict_deviation(&new).unwrap();
    for row in 0..5 {
        let spread = 1.0 / 60.0 + h_new.row(row).dot(&inverse_times.column(row));
        let expected = fitted.noise()[0] * (1.0 + spread).sqrt();
        assert_relative_eq!(deviation[[row, 0]], expected, max_relative = 1e-9);
    }
}

#[test]
fn intervals_are_those_of_refitting_without_each_row() {
    // Jackknife+ by its definition, at the same layer, scaling and absolute lambda.
    let (x, t) = problem(24, 0.2, 3);
    let fitted = params()
        .solver(Ridge::relative(1e-3))
        .fit_uncertain(&x, &t)
        .unwrap();
    let model = fitted.model();
    let absolute = 1e-3 * model.diagnosis().largest_singular_value.powi(2);
    let h = model.hidden_matrix(&x).unwrap();
    let new = array![[0.3, 0.8]];
    let h_new = model.hidden_matrix(&new).unwrap();
    let (mut lower, mut upper) = (Vec::new(), Vec::new());
    for left_out in 0..24 {
        let rest: Vec<usize> = (0..24).filter(|&row| row != left_out).collect();
        let (h_rest, t_rest) = (h.select(Axis(0), &rest), t.select(Axis(0), &rest));
        let t_rest = t_rest.insert_axis(Axis(1));
        let problem = LeastSquares::new(&h_rest, &t_rest).unwrap().intercept(true);
        let probe = Solver::from(Ridge::relative(1e-3)).solve(&problem).unwrap();
        let relative = absolute / probe.diagnosis.largest_singular_value.powi(2);
        let refit = Solver::from(Ridge::relative(relative))
            .solve(&problem)
            .unwrap();
        let at =
            |h: ndarray::ArrayView1<'_, f64>| h.dot(&refit.beta.column(0)) + refit.intercept[0];
        let residual = (t[left_out] - at(h.row(left_out))).abs();
        lower.push(at(h_new.row(0)) - residual);
        upper.push(at(h_new.row(0)) + residual);
    }
    lower.sort_by(f64::total_cmp);
    upper.sort_by(f64::total_cmp);
    // alpha (n + 1) = 0.2 * 25 = 5: the fifth from either end.
    let (low, high) = fitted.predict_interval(&new, 0.8).unwrap();
    assert_relative_eq!(low[[0, 0]], lower[4], max_relative = 1e-9);
    assert_relative_eq!(high[[0, 0]], upper[19], max_relative = 1e-9);
}

#[test]
fn intervals_and_deviations_cover_what_they_promise() {
    // 20 training sets of 100 rows, 200 new rows each. The deviation of a mean of 4000 hits at 0.9
    // is below 0.01 even if rows of one set were four times as dependent as they are.
    let (mut inside_interval, mut inside_deviation, mut count) = (0, 0, 0);
    for seed in 0..20 {
        let (x, t) = problem(100, 0.2, 100 + seed);
        let (new, truth) = problem(200, 0.2, 1000 + seed);
        let fitted = params()
            .solver(Ridge::leave_one_out())
            .fit_uncertain(&x, &t)
            .unwrap();
        let predicted = fitted.model().predict(&new).unwrap();
        let deviation = fitted.predict_deviation(&new).unwrap();
        let (low, high) = fitted.predict_interval(&new, 0.9).unwrap();
        for row in 0..200 {
            let y = truth[row];
            count += 1;
            inside_interval += usize::from(low[[row, 0]] <= y && y <= high[[row, 0]]);
            // 1.645: the two-sided 90 % point of the normal distribution.
            let within = (y - predicted[[row, 0]]).abs() <= 1.645 * deviation[[row, 0]];
            inside_deviation += usize::from(within);
        }
    }
    for inside in [inside_interval, inside_deviation] {
        let share = inside as f64 / f64::from(count);
        assert!((0.87..0.94).contains(&share), "{share}");
    }
}

#[test]
fn what_cannot_be_answered_is_an_error_or_infinite() {
    let (x, t) = problem(30, 0.1, 1);
    let plain = params()
        .solver(PseudoInverse::default())
        .fit_uncertain(&x, &t)
        .unwrap_err();
    assert!(matches!(plain, Error::Conflict { .. }), "{plain}");
    let fitted = params().fit_uncertain(&x, &t).unwrap();
    assert!(matches!(Solver::default(), Solver::Ridge(r) if r.lambda() == Lambda::LeaveOneOut));
    for coverage in [0.0, 1.0, f64::NAN, -1.0] {
        let error = fitted.predict_interval(&x, coverage).unwrap_err();
        assert!(
            matches!(
                error,
                Error::Parameter {
                    name: "coverage",
                    ..
                }
            ),
            "{error}"
        );
    }
    // 30 rows cannot tell 99 %.
    let (low, high) = fitted.predict_interval(&x, 0.99).unwrap();
    assert!(
        low.iter().all(|v| *v == f64::NEG_INFINITY) && high.iter().all(|v| *v == f64::INFINITY)
    );
    let one = params()
        .fit_uncertain(&array![[1.0]], &array![1.0])
        .unwrap_err();
    assert!(matches!(one, Error::Undetermined { .. }), "{one}");
}
