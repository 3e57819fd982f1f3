//! What must hold for every solver, whatever the matrix.
//!
//! Tolerances are a condition number times epsilon times a constant for the dimension, as the
//! backward errors of Householder and LU factorizations are bounded by a small multiple of the
//! dimension times epsilon (Higham, Accuracy and Stability of Numerical Algorithms, 2002, ch. 9
//! and 19).

use crate::common::{
    Problem, amplification, deficient, frobenius, integers, largest, normal, problems, weights,
};
use elm::solve::{Inverse, LeastSquares, PseudoInverse, Reason, Ridge, Route, Solver};
use elm::{ElmParams, Scalar};
use ndarray::{Array2, Axis, concatenate};
use proptest::prelude::*;

/// Bound of a factorization's backward error, relative to the norm of the matrix.
fn backward_error<A: Scalar>(matrix: &Array2<A>) -> f64 {
    4.0 * (matrix.nrows() + matrix.ncols()) as f64 * A::epsilon().as_f64()
}

fn assert_close<A: Scalar>(a: &Array2<A>, b: &Array2<A>, bound: f64, what: &str) {
    let error = largest(&(a - b));
    assert!(error <= bound, "{what}: {error:e} > {bound:e}");
}

fn equations_10_and_11_agree<A: Scalar>(n: usize, seed: u64) {
    let problem = Problem::new(normal::<A>(n, n, seed), normal(n, 2, seed + 1));
    let general = problem.solve(PseudoInverse::default());
    let condition = general.diagnosis.condition.unwrap();
    // "Well-conditioned": half of the digits are left. The condition is that of the singular values
    // kept, so all must be.
    let full_rank = general.diagnosis.rank == Some(n);
    if !full_rank || condition * A::epsilon().as_f64().sqrt() > 1.0 {
        return;
    }
    let square = problem.solve(Inverse);
    let bound = condition * backward_error(&problem.hidden) * frobenius(&general.beta);
    assert_close(&square.beta, &general.beta, bound, "beta");
}

/// The four conditions that define the Moore-Penrose inverse, for the operator that the solver
/// applies: solving with the identity as targets gives it.
fn is_the_penrose_inverse<A: Scalar>(f: &Array2<A>) {
    let problem = Problem::new(f.clone(), Array2::eye(f.nrows()));
    let solution = problem.solve(PseudoInverse::default());
    let x = solution.beta;
    let (fx, xf) = (f.dot(&x), x.dot(f));
    let unit = solution.diagnosis.condition.unwrap() * backward_error(f);
    let rank = solution.diagnosis.rank.unwrap() as f64;
    assert_close(&fx.dot(f), f, unit * frobenius(f), "F X F = F");
    assert_close(&xf.dot(&x), &x, unit * frobenius(&x), "X F X = X");
    assert_close(&fx.t().to_owned(), &fx, unit * rank.sqrt(), "F X symmetric");
    assert_close(&xf.t().to_owned(), &xf, unit * rank.sqrt(), "X F symmetric");
}

/// The gradient $F^T (F\beta - T) + \lambda \beta$. A backward stable solution is the exact one
/// of a matrix off by epsilon, so it is zero to epsilon, without the condition number.
fn normal_equations_hold<A: Scalar>(problem: &Problem<A>, solver: Solver) {
    let solution = problem.solve(solver);
    let Problem { hidden: f, .. } = problem;
    let d = &solution.diagnosis;
    let mut residual = f.dot(&solution.beta) - &problem.targets;
    residual += &solution.intercept;
    if let Some(weights) = &problem.weights {
        residual *= &weights.view().insert_axis(Axis(1));
    }
    let absolute: Vec<A> = d
        .lambda
        .iter()
        .map(|l| A::from_f64(l * d.largest_singular_value.powi(2)))
        .collect();
    let gradient = f.t().dot(&residual) + &solution.beta * &ndarray::Array1::from(absolute);
    let size = frobenius(f) * (frobenius(f) * frobenius(&solution.beta) + frobenius(&residual));
    let bound = 4.0 * backward_error(f) * size;
    assert!(
        largest(&gradient) <= bound,
        "{:e} > {bound:e}",
        largest(&gradient)
    );
    if problem.intercept {
        let sums = residual.sum_axis(Axis(0)).insert_axis(Axis(0));
        assert!(largest(&sums) <= bound, "the constant's equation");
    }
}

/// Seventeen rows of which six count for nothing, and an intercept: rank 10 of 17. A factorization
/// by QR leaves 20 epsilon in a direction that is not there.
#[test]
fn a_square_matrix_whose_rows_are_absent_in_part_is_not_of_full_rank() {
    let mut problem = Problem::noisy(normal::<f64>(17, 17, 681), 1, 0.3, 682)
        .weighted(weights(17, 681))
        .with_intercept();
    for row in (1..17).step_by(3) {
        problem.weights.as_mut().unwrap()[row] = 0.0;
    }
    let solution = problem.solve(PseudoInverse::default());
    assert_eq!(solution.diagnosis.rank, Some(10));
}

/// Almost singular in single precision: the pseudo-inverse drops a direction, the inverse refuses.
#[test]
fn a_square_matrix_that_loses_a_direction_has_no_inverse() {
    let problem = Problem::new(normal::<f32>(29, 29, 91), normal(29, 2, 92));
    assert_eq!(
        problem.solve(PseudoInverse::default()).diagnosis.rank,
        Some(28)
    );
    assert!(matches!(
        Solver::from(Inverse).solve(&problem.view()),
        Err(elm::Error::Singular { .. })
    ));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn square_well_conditioned_systems_have_one_answer(n in 1_usize..40, seed: u64) {
        equations_10_and_11_agree::<f64>(n, seed % 1000);
        equations_10_and_11_agree::<f32>(n, seed % 1000);
    }

    #[test]
    fn the_pseudo_inverse_is_the_penrose_inverse(
        rows in 1_usize..40, columns in 1_usize..40, seed in 0_u64..1000,
    ) {
        is_the_penrose_inverse::<f64>(&normal(rows, columns, seed));
        is_the_penrose_inverse::<f32>(&normal(rows, columns, seed));
    }

    #[test]
    fn the_pseudo_inverse_of_an_exactly_deficient_matrix_is_the_penrose_inverse(
        rows in 1_usize..30, columns in 1_usize..30, rank in 1_usize..6, seed in 0_u64..1000,
    ) {
        is_the_penrose_inverse::<f64>(&deficient(rows, columns, rank, seed));
        is_the_penrose_inverse::<f32>(&deficient(rows, columns, rank, seed));
    }

    #[test]
    fn normal_equations_hold_for_every_least_squares_solver(
        rows in 2_usize..60, columns in 1_usize..30, seed in 0_u64..1000,
        lambda in -10.0..2.0, intercept: bool, weighted: bool,
    ) {
        let mut problem = Problem::noisy(normal::<f64>(rows, columns, seed), 2, 0.5, seed + 1);
        problem.intercept = intercept;
        if weighted {
            problem.weights = Some(weights(rows, seed));
        }
        for solver in [
            PseudoInverse::default().into(),
            Ridge::relative(10.0_f64.powf(lambda)).into(),
            Ridge::leave_one_out().into(),
            Ridge::gcv().into(),
        ] {
            normal_equations_hold(&problem, solver);
        }
    }

    /// With $F = [A, AM]$ the null space holds $(Mv, -v)$ for every $v$. The answer of minimum
    /// norm is orthogonal to it, and it interpolates.
    #[test]
    fn a_wide_matrix_gets_the_interpolant_of_minimum_norm(
        rows in 1_usize..15, extra in 1_usize..15, seed in 0_u64..1000,
    ) {
        let a = normal::<f64>(rows, rows, seed) + Array2::<f64>::eye(rows) * 4.0;
        let m = integers::<f64>(rows, extra, seed + 1);
        let f = concatenate(Axis(1), &[a.view(), a.dot(&m).view()]).unwrap();
        let problem = Problem::new(f, normal(rows, 2, seed + 2));
        let solution = problem.solve(PseudoInverse::default());
        prop_assume!(solution.diagnosis.condition.unwrap() < 1e8);
        let unit = solution.diagnosis.condition.unwrap() * backward_error(&problem.hidden);
        let size = frobenius(&solution.beta);
        let (top, bottom) = solution.beta.view().split_at(Axis(0), rows);
        assert_close(&m.t().dot(&top), &bottom.to_owned(), unit * size * (1.0 + frobenius(&m)), "orthogonal");
        let fitted = problem.hidden.dot(&solution.beta);
        assert_close(&fitted, &problem.targets, unit * frobenius(&problem.targets), "interpolates");
    }

    #[test]
    fn the_order_of_rows_does_not_matter(rows in 2_usize..50, columns in 1_usize..20, seed in 0_u64..1000) {
        let problem = Problem::noisy(normal::<f64>(rows, columns, seed), 2, 0.3, seed + 1)
            .weighted(weights(rows, seed))
            .with_intercept();
        let mut order: Vec<usize> = (0..rows).collect();
        order.rotate_left(rows / 3);
        order.reverse();
        same_answer(&problem, &problem.rows(&order));
    }

    #[test]
    fn a_row_twice_is_a_row_of_weight_two(rows in 2_usize..40, columns in 1_usize..20, seed in 0_u64..1000) {
        let problem = Problem::noisy(normal::<f64>(rows, columns, seed), 1, 0.3, seed + 1)
            .with_intercept();
        let mut order: Vec<usize> = (0..rows).collect();
        order.push(rows / 2);
        let mut weights = ndarray::Array1::ones(rows);
        weights[rows / 2] = 2.0;
        same_answer(&problem.rows(&order), &problem.weighted(weights));
    }

    #[test]
    fn a_row_of_weight_zero_is_absent(rows in 3_usize..40, columns in 1_usize..20, seed in 0_u64..1000) {
        let mut problem = Problem::noisy(normal::<f64>(rows, columns, seed), 1, 0.3, seed + 1)
            .weighted(weights(rows, seed))
            .with_intercept();
        let kept: Vec<usize> = (0..rows).filter(|row| row % 3 != 1).collect();
        let without = problem.rows(&kept);
        for row in (1..rows).step_by(3) {
            problem.weights.as_mut().unwrap()[row] = 0.0;
            // It may hold anything finite.
            problem.hidden.row_mut(row).fill(1e300);
            problem.targets.row_mut(row).fill(-1e300);
        }
        same_answer(&without, &problem);
    }

    #[test]
    fn scaling_by_powers_of_two_scales_the_answer_bit_for_bit(
        rows in 2_usize..40, columns in 1_usize..20, power in -300_i32..300, seed in 0_u64..1000,
    ) {
        let problem = Problem::noisy(normal::<f64>(rows, columns, seed), 2, 0.3, seed + 1)
            .with_intercept();
        let factor = 2.0_f64.powi(power);
        let mut scaled = problem.clone();
        scaled.targets *= factor;
        let mut wide = problem.clone();
        wide.hidden *= factor;
        for solver in all_least_squares() {
            let (one, other) = (problem.solve(solver), scaled.solve(solver));
            prop_assert_eq!(&one.beta * factor, other.beta);
            prop_assert_eq!(&one.intercept * factor, other.intercept);
            prop_assert_eq!(&one.diagnosis.lambda, &other.diagnosis.lambda);
            prop_assert_eq!(one.beta / factor, wide.solve(solver).beta);
        }
    }

    #[test]
    fn an_intercept_takes_up_a_constant(
        rows in 2_usize..40, columns in 1_usize..20, constant in -1e3..1e3, seed in 0_u64..1000,
    ) {
        let problem = Problem::noisy(normal::<f64>(rows, columns, seed), 1, 0.3, seed + 1)
            .with_intercept();
        let mut raised = problem.clone();
        raised.targets += constant;
        for solver in [Solver::from(PseudoInverse::default()), Ridge::relative(1e-4).into()] {
            let (one, other) = (problem.solve(solver), raised.solve(solver));
            // The raised targets are rounded to epsilon times the constant, and the smallest
            // singular value kept passes that on to beta.
            let d = &one.diagnosis;
            let size = f64::abs(constant) + frobenius(&problem.targets);
            let rounding = backward_error(&problem.hidden) * size;
            let smallest = d.smallest_singular_value.unwrap_or(d.largest_singular_value * 1e-2);
            let bound = rounding * amplification(d) / smallest;
            assert_close(&one.beta, &other.beta, bound, "beta");
            let shift = other.intercept[0] - one.intercept[0];
            let bound = rounding + bound * frobenius(&problem.hidden);
            prop_assert!((shift - constant).abs() <= bound, "{shift} {constant}");
        }
    }
}

fn all_least_squares() -> [Solver; 4] {
    [
        PseudoInverse::default().into(),
        Ridge::relative(1e-3).into(),
        Ridge::leave_one_out().into(),
        Ridge::gcv().into(),
    ]
}

/// Two forms of one problem have one answer, to the square of the condition number (the residual
/// is not small) times epsilon.
fn same_answer(one: &Problem<f64>, other: &Problem<f64>) {
    for solver in [
        Solver::from(PseudoInverse::default()),
        Ridge::relative(1e-3).into(),
    ] {
        let (a, b) = (one.solve(solver), other.solve(solver));
        let d = &a.diagnosis;
        // Shrunk directions pass on no more than 1 / sqrt(lambda).
        let condition = d.condition.unwrap_or(1.0 / d.lambda[0].sqrt());
        if condition > 1e5 {
            continue;
        }
        let scale =
            d.residual_norm.iter().chain(&d.beta_norm).sum::<f64>() + frobenius(&one.targets);
        let inverse = 1.0 + 1.0 / d.largest_singular_value.max(f64::MIN_POSITIVE);
        let bound = backward_error(&one.hidden) * condition.powi(2) * scale * inverse;
        assert_close(&a.beta, &b.beta, bound, "beta");
        let (a, b) = (
            a.intercept.insert_axis(Axis(0)),
            b.intercept.insert_axis(Axis(0)),
        );
        assert_close(&a, &b, bound * (1.0 + largest(&one.hidden)), "intercept");
    }
}

#[test]
fn one_seed_gives_one_network_bit_for_bit() {
    let (x, t) = (normal::<f64>(60, 3, 1), normal::<f64>(60, 2, 2));
    for solver in all_least_squares() {
        let fit = |seed| {
            ElmParams::new(20)
                .with_seed(seed)
                .with_solver(solver)
                .fit(&x, &t)
                .unwrap()
        };
        assert_eq!(fit(7), fit(7));
        assert_ne!(fit(7).beta(), fit(8).beta());
    }
}

/// Leave-one-out RMSE by fitting once without each row.
fn brute_force_leave_one_out<A: Scalar>(problem: &Problem<A>, output: usize, absolute: f64) -> f64 {
    let rows = problem.hidden.nrows();
    let (mut squares, mut total) = (0.0, 0.0);
    for row in 0..rows {
        let weight = problem.weights.as_ref().map_or(1.0, |w| w[row].as_f64());
        if weight == 0.0 {
            continue;
        }
        let predicted = if rows == 1 {
            0.0
        } else {
            problem.refit_without(&[row], absolute)[[0, output]].as_f64()
        };
        squares += weight * (problem.targets[[row, output]].as_f64() - predicted).powi(2);
        total += weight;
    }
    (squares / total).sqrt()
}

fn leave_one_out_is_refitting<A: Scalar>(limit: f64) {
    for (name, problem) in problems::<A>() {
        let diagnosis = problem.solve(Ridge::leave_one_out()).diagnosis;
        for (output, score) in diagnosis.leave_one_out.unwrap().into_iter().enumerate() {
            let absolute = diagnosis.lambda[output] * diagnosis.largest_singular_value.powi(2);
            let truth = brute_force_leave_one_out(&problem, output, absolute);
            assert!(
                (score - truth).abs() <= limit * truth,
                "{name}, lambda {:e}: {score} but {truth}",
                diagnosis.lambda[output]
            );
        }
    }
}

#[test]
fn the_leave_one_out_score_is_that_of_refitting_without_each_row() {
    leave_one_out_is_refitting::<f64>(1e-9);
    // epsilon over the smallest lambda that these problems choose (about 1e-3).
    leave_one_out_is_refitting::<f32>(1e-4);
}

#[test]
fn gcv_chooses_the_strongest_whose_score_is_within_a_hundredth_of_the_smallest() {
    for (name, problem) in problems::<f64>() {
        let rows = problem
            .weights
            .as_ref()
            .map_or(problem.hidden.nrows(), |w| {
                w.iter().filter(|w| **w > 0.0).count()
            }) as f64;
        let chosen = problem.solve(Ridge::gcv()).diagnosis.lambda;
        for (output, &chosen) in chosen.iter().enumerate() {
            // n RSS / (n - df)^2 from a separate fit at each strength, with the relative error
            // that the subtraction n - df brings (it is small where a wide matrix interpolates) and
            // that of the fast route.
            let score = |lambda: f64| {
                let d = problem.solve(Ridge::relative(lambda)).diagnosis;
                let spare = rows - d.degrees_of_freedom[output];
                let score = rows * d.residual_norm[output].powi(2) / spare.powi(2);
                let fast = if d.condition.is_none() {
                    1.0 / lambda
                } else {
                    0.0
                };
                (score, 8.0 * rows * f64::EPSILON * (1.0 + fast) / spare)
            };
            let (score_of_chosen, error) = score(chosen);
            let others = (-40..=8).map(|step| 10.0_f64.powf(f64::from(step) / 4.0));
            let others: Vec<_> = others.map(|lambda| (lambda, score(lambda))).collect();
            for &(_, (score, other_error)) in &others {
                let slack = 1e-9 + error + other_error;
                assert!(
                    score_of_chosen <= 1.01 * score * (1.0 + slack),
                    "{name}: {chosen:e}"
                );
            }
            // Every stronger one is worse than that.
            let smallest = others
                .iter()
                .fold(f64::INFINITY, |m, (_, (score, _))| m.min(*score));
            for &(lambda, (score, error)) in &others {
                if lambda > chosen * 1.1 {
                    let least = 1.01 * smallest * (1.0 - 1e-9 - error);
                    assert!(score >= least, "{name}: {lambda:e} for {chosen:e}");
                }
            }
        }
    }
}

#[test]
fn the_same_matrix_in_either_layout_gives_the_same_answer() {
    let problem = Problem::noisy(normal::<f64>(30, 6, 1), 2, 0.1, 2);
    let turned = problem.hidden.t().as_standard_layout().into_owned();
    let view = turned.t();
    for solver in all_least_squares() {
        let one = problem.solve(solver);
        let other = solver
            .solve(&LeastSquares::new(&view, &problem.targets).unwrap())
            .unwrap();
        let bound =
            amplification(&one.diagnosis) * backward_error(&problem.hidden) * frobenius(&one.beta);
        assert_close(&one.beta, &other.beta, bound, "beta");
    }
}

/// Beta by the fast route against QR and singular values, which a strength just below the fast
/// route's limit still takes: at nearly the same strength the two must nearly agree.
#[test]
fn the_fast_route_is_as_accurate_as_it_says() {
    // Strengths on both sides of each limit, epsilon over accuracy.
    let limit = f64::EPSILON / 1e-8;
    for (name, problem) in problems::<f64>() {
        if name == "only a constant" {
            continue;
        }
        let fast = problem.solve(Ridge::relative(limit * (1.0 + 1e-13)));
        let slow = problem.solve(Ridge::relative(limit * (1.0 - 1e-13)));
        assert!(matches!(
            fast.diagnosis.route,
            Route::Gram | Route::DualGram
        ));
        assert_eq!(fast.diagnosis.reason, Reason::StrongRidge);
        assert!(matches!(slow.diagnosis.route, Route::Svd | Route::QrSvd));
        assert_eq!(slow.diagnosis.reason, Reason::WeakRidge);
        let error = frobenius(&(&fast.beta - &slow.beta)) / frobenius(&slow.beta);
        assert!(error < 1e-8, "{name}: {error:e}");
        let (f, s) = (fast.diagnosis, slow.diagnosis);
        approx::assert_relative_eq!(
            f.largest_singular_value,
            s.largest_singular_value,
            max_relative = 1e-10
        );
        for output in 0..2 {
            let difference = f.degrees_of_freedom[output] - s.degrees_of_freedom[output];
            assert!(difference.abs() < 1e-6, "{name}: {difference:e}");
            let difference = f.residual_norm[output] - s.residual_norm[output];
            assert!(
                difference.abs() < 1e-8 * frobenius(&problem.targets),
                "{name}"
            );
        }
    }
}

#[test]
fn the_fast_route_in_single_precision_is_as_accurate_as_it_says() {
    let limit = f64::from(f32::EPSILON) / 1e-3;
    for (name, problem) in problems::<f32>() {
        let double = Problem {
            hidden: problem.hidden.mapv(f64::from),
            targets: problem.targets.mapv(f64::from),
            weights: problem.weights.as_ref().map(|w| w.mapv(f64::from)),
            intercept: problem.intercept,
        };
        let lambda = limit * 1.01;
        let (single, truth) = (
            problem.solve(Ridge::relative(lambda)).beta.mapv(f64::from),
            double.solve(Ridge::relative(lambda)).beta,
        );
        let error = frobenius(&(&single - &truth));
        assert!(error <= 1e-3 * frobenius(&truth), "{name}: {error:e}");
    }
}
