//! Held-out predictions in closed form are those of refitting.

use crate::common::{Problem, doubled_rows, frobenius, normal, problems, weights};
use elm::cross_validation::{CrossValidator, assign_folds};
use elm::solve::{Inverse, LeastSquares, PseudoInverse, Ridge, Solver};
use elm::{Dataset, ElmParams, Error, Scalar, metrics};
use ndarray::{Array1, Array2, Axis, array};

/// Divisions into folds of every kind: single rows, a few rows, halves, and one that is large
/// beside single ones, under labels that are just names.
fn divisions(rows: usize) -> Vec<Vec<usize>> {
    let mut all = vec![(0..rows).collect::<Vec<_>>()];
    for folds in [2, 7] {
        if folds <= rows {
            all.push(assign_folds(rows, folds, 3).unwrap());
        }
    }
    all.push((0..rows).map(|row| row / 2 * 1000).collect());
    all.push((0..rows).map(|row| row.min(rows / 3)).collect());
    all
}

/// Refits without each fold in turn at this absolute strength.
fn refitted<A: Scalar>(problem: &Problem<A>, folds: &[usize], absolute: f64) -> Array2<A> {
    let mut predictions = Array2::zeros(problem.targets.dim());
    let mut labels = folds.to_vec();
    labels.sort_unstable();
    labels.dedup();
    for label in labels {
        let out: Vec<usize> = (0..folds.len())
            .filter(|&row| folds[row] == label)
            .collect();
        let fold = problem.refit_without(&out, absolute);
        for (&row, prediction) in out.iter().zip(fold.rows()) {
            predictions.row_mut(row).assign(&prediction);
        }
    }
    predictions
}

fn k_fold_is_refitting<A: Scalar>(lambdas: &[f64], limit: impl Fn(f64) -> f64) {
    for (name, problem) in problems::<A>() {
        let rows = problem.hidden.nrows();
        if rows < 2 {
            continue;
        }
        let validator = CrossValidator::new(&problem.view()).unwrap();
        let s = problem
            .solve(Ridge::relative(1.0))
            .diagnosis
            .largest_singular_value;
        for &lambda in lambdas {
            for folds in divisions(rows) {
                let held_out = validator.k_fold(&folds, &[lambda]).unwrap();
                let truth = refitted(&problem, &folds, lambda * s * s);
                let error = frobenius(&(&held_out.predictions() - &truth));
                let scale = frobenius(&truth) + frobenius(&problem.targets);
                assert!(
                    error <= limit(lambda) * scale,
                    "{name}, lambda {lambda:e}, folds {folds:?}: {:e}",
                    error / scale
                );
            }
        }
    }
}

#[test]
fn k_fold_predictions_are_those_of_refitting_without_each_fold() {
    k_fold_is_refitting::<f64>(&[1e-6, 1e-2, 10.0], |_| 1e-9);
    // The condition of the regularized equations is at most 1 / lambda.
    k_fold_is_refitting::<f64>(&[1e-10], |lambda| 4.0 * f64::EPSILON / lambda);
    k_fold_is_refitting::<f32>(&[1e-3, 1.0], |lambda| {
        4.0 * f64::from(f32::EPSILON) / lambda.min(0.1)
    });
}

#[test]
fn the_fits_without_each_fold_are_those_of_refitting_on_all_rows() {
    for (name, problem) in problems::<f64>() {
        let rows = problem.hidden.nrows();
        if rows < 2 {
            continue;
        }
        let validator = CrossValidator::new(&problem.view()).unwrap();
        let s = problem
            .solve(Ridge::relative(1.0))
            .diagnosis
            .largest_singular_value;
        for (lambda, folds) in [1e-6, 1e-2].into_iter().flat_map(|lambda| {
            let divisions = divisions(rows).into_iter();
            divisions.map(move |folds| (lambda, folds))
        }) {
            let held_out = validator.k_fold(&folds, &[lambda]).unwrap();
            let fits = validator.fold_predictions(&folds, &[lambda]).unwrap();
            let mut labels = folds.clone();
            labels.sort_unstable();
            labels.dedup();
            assert!(
                fits.iter()
                    .map(elm::cross_validation::FoldPredictions::label)
                    .eq(labels)
            );
            for fit in &fits {
                let out: Vec<usize> = (0..rows).filter(|&r| folds[r] == fit.label()).collect();
                for &row in &out {
                    // Rows without weight are predicted by another route in each.
                    let (a, b) = (fit.predictions(), held_out.predictions());
                    let error = (&a.row(row) - &b.row(row)).mapv(f64::abs).sum();
                    assert!(
                        error <= 1e-12 * frobenius(&problem.targets),
                        "{name}: {error:e}"
                    );
                }
                let truth = problem.fit_without(&out, lambda * s * s);
                let error = frobenius(&(&fit.predictions() - &truth));
                let scale = frobenius(&truth) + frobenius(&problem.targets);
                assert!(
                    error <= 1e-9 * scale,
                    "{name}, lambda {lambda:e}, folds {folds:?}: {:e}",
                    error / scale
                );
            }
        }
    }
}

#[test]
fn leave_one_out_is_k_fold_with_one_row_in_each_fold() {
    for (name, problem) in problems::<f64>() {
        let rows = problem.hidden.nrows();
        let validator = CrossValidator::new(&problem.view()).unwrap();
        let each: Vec<usize> = (0..rows).collect();
        for lambda in [1e-8, 1e-3, 1.0] {
            let one = validator.leave_one_out(&[lambda]).unwrap();
            let other = validator.k_fold(&each, &[lambda]).unwrap();
            let error = frobenius(&(&one.predictions() - &other.predictions()));
            let scale = frobenius(&problem.targets) + frobenius(&one.predictions().to_owned());
            assert!(
                error <= 4.0 * f64::EPSILON / lambda.min(1e-2) * scale,
                "{name}: {error:e}"
            );
        }
    }
}

#[test]
fn the_pseudo_inverse_is_validated_where_the_rows_left_determine_it() {
    for (name, problem) in problems::<f64>() {
        let rows = problem.hidden.nrows();
        // Wide matrices and rows with a neuron of their own have no such fold.
        let spare = rows as f64 > 2.5 * problem.hidden.ncols() as f64;
        if !spare || name.contains("of its own") {
            continue;
        }
        let validator = CrossValidator::new(&problem.view()).unwrap();
        for folds in [(0..rows).collect(), assign_folds(rows, 4, 1).unwrap()] {
            let held_out = validator.k_fold(&folds, &[0.0]).unwrap();
            for (row, &label) in folds.iter().enumerate() {
                let kept: Vec<usize> = (0..rows).filter(|&r| folds[r] != label).collect();
                let refit = problem.rows(&kept).solve(PseudoInverse::default());
                let truth = problem.hidden.row(row).dot(&refit.beta) + &refit.intercept;
                let found = held_out.predictions().row(row).to_owned();
                let error = (&found - &truth).mapv(f64::abs).sum();
                let limit = 1e-9 * frobenius(&problem.targets);
                assert!(error <= limit, "{name}, row {row}: {error:e}");
            }
        }
    }
}

#[test]
fn a_fold_that_the_other_rows_do_not_determine_is_named() {
    // Twelve rows and thirty neurons: every row is interpolated.
    let wide = Problem::noisy(normal::<f64>(12, 30, 4), 1, 1.0, 5);
    let validator = CrossValidator::new(&wide.view()).unwrap();
    assert_eq!(
        validator.leave_one_out(&[0.0]).unwrap_err(),
        Error::Undetermined { fold: 0 }
    );
    // Only row 3 sees neuron 2.
    let mut own = normal::<f64>(40, 8, 1);
    own.column_mut(2).fill(0.0);
    own[[3, 2]] = 1.0;
    let own = Problem::noisy(own, 1, 1.0, 2);
    let validator = CrossValidator::new(&own.view()).unwrap();
    assert_eq!(
        validator.leave_one_out(&[0.0]).unwrap_err(),
        Error::Undetermined { fold: 3 }
    );
    let folds: Vec<usize> = (0..40).map(|row| 7 + row / 10).collect();
    for folds in [
        folds,
        (0..40).map(|row| if row < 25 { 7 } else { 2 }).collect(),
    ] {
        assert_eq!(
            validator.k_fold(&folds, &[0.0]).unwrap_err(),
            Error::Undetermined { fold: 7 }
        );
        assert!(validator.k_fold(&folds, &[1e-3]).is_ok());
    }
    // Without any row there is nothing to place an intercept by, however strong the ridge.
    let all = Problem::noisy(normal::<f64>(20, 3, 4), 1, 1.0, 5).with_intercept();
    let validator = CrossValidator::new(&all.view()).unwrap();
    assert_eq!(
        validator.k_fold(&[5; 20], &[1.0]).unwrap_err(),
        Error::Undetermined { fold: 5 }
    );
}

#[test]
fn without_any_row_ridge_predicts_zero() {
    let problem = Problem::noisy(normal::<f64>(20, 3, 4), 2, 1.0, 5);
    let validator = CrossValidator::new(&problem.view()).unwrap();
    let held_out = validator.k_fold(&[5; 20], &[0.1]).unwrap();
    assert!(frobenius(&held_out.predictions().to_owned()) < 1e-13);
}

#[test]
fn each_output_may_have_its_own_strength() {
    let problem = Problem::noisy(normal::<f64>(30, 6, 1), 3, 1.0, 2).with_intercept();
    let validator = CrossValidator::new(&problem.view()).unwrap();
    let folds = assign_folds(30, 5, 1).unwrap();
    let lambdas = [1e-4, 1.0, 1e-4];
    let mixed = validator.k_fold(&folds, &lambdas).unwrap();
    for (output, lambda) in lambdas.into_iter().enumerate() {
        let shared = validator.k_fold(&folds, &[lambda]).unwrap();
        approx::assert_relative_eq!(
            mixed.predictions().column(output),
            shared.predictions().column(output),
            max_relative = 1e-12
        );
    }
}

#[test]
fn scores_are_weighted_root_mean_squares_of_the_residuals() {
    let problem = Problem::noisy(normal::<f64>(30, 6, 1), 2, 1.0, 2).with_intercept();
    let validator = CrossValidator::new(&problem.view()).unwrap();
    let held_out = validator.leave_one_out(&[1e-3]).unwrap();
    for output in 0..2 {
        let rmse = metrics::rmse(
            &held_out.predictions().column(output),
            &problem.targets.column(output),
        );
        approx::assert_relative_eq!(held_out.rmse()[output], rmse.unwrap(), max_relative = 1e-12);
    }
    // A weight of two counts as the row twice, in the fit and in the score. (Leaving out "the
    // row" then means both of the pair, hence the folds.)
    let folds = assign_folds(30, 5, 1).unwrap();
    let twice = Problem {
        hidden: doubled_rows(&problem.hidden),
        targets: doubled_rows(&problem.targets),
        ..problem.clone()
    };
    let twice_folds = [folds.clone(), folds.clone()].concat();
    let weighted = problem.weighted(ndarray::Array1::from_elem(30, 2.0));
    let one = CrossValidator::new(&weighted.view())
        .unwrap()
        .k_fold(&folds, &[1e-3])
        .unwrap();
    let other = CrossValidator::new(&twice.view())
        .unwrap()
        .k_fold(&twice_folds, &[1e-3])
        .unwrap();
    for (a, b) in one.rmse().into_iter().zip(other.rmse()) {
        approx::assert_relative_eq!(a, b, max_relative = 1e-12);
    }
}

#[test]
fn a_path_has_the_scores_of_its_strengths_and_finds_the_best() {
    let problem = Problem::noisy(normal::<f64>(30, 20, 1), 2, 3.0, 2).weighted(weights(30, 3));
    let validator = CrossValidator::new(&problem.view()).unwrap();
    let folds = assign_folds(30, 5, 1).unwrap();
    let lambdas = Ridge::lambda_grid();
    for (path, score) in [
        (
            validator.k_fold_path(&folds, &lambdas).unwrap(),
            Box::new(|l: f64| validator.k_fold(&folds, &[l]).unwrap().rmse())
                as Box<dyn Fn(f64) -> Array1<f64>>,
        ),
        (
            validator.leave_one_out_path(&lambdas).unwrap(),
            Box::new(|l: f64| validator.leave_one_out(&[l]).unwrap().rmse()),
        ),
    ] {
        assert_eq!(path.lambdas(), lambdas);
        for (row, &lambda) in path.rmse().rows().into_iter().zip(&lambdas) {
            assert_eq!(row, score(lambda));
        }
        for (output, best) in path.best().into_iter().enumerate() {
            let smallest = path
                .rmse()
                .column(output)
                .fold(f64::INFINITY, |m, &v| m.min(v));
            assert!(score(best)[output] <= smallest * (1.0 + 1e-9));
        }
        assert!(lambdas.contains(&path.best_shared()));
    }
    // The path of leave-one-out is what ridge chooses by where rows are alike: of strengths whose squared
    // errors are within 1 % of the least, the strongest.
    let problem = Problem::noisy(normal::<f64>(30, 20, 1), 2, 3.0, 2);
    let validator = CrossValidator::new(&problem.view()).unwrap();
    let path = validator.leave_one_out_path(&lambdas).unwrap();
    let chosen = validator.select_lambda(Ridge::leave_one_out()).unwrap();
    for (output, (best, chosen)) in path.best().into_iter().zip(chosen).enumerate() {
        let error = |lambda| validator.leave_one_out(&[lambda]).unwrap().rmse()[output];
        assert!(
            chosen >= best && error(chosen) <= error(best) * 1.005,
            "{chosen} {best}"
        );
    }
}

#[test]
fn a_network_is_cross_validated_as_if_refitted_fold_by_fold() {
    let x = normal::<f64>(50, 3, 1);
    let t = x.map_axis(Axis(1), |row| (row[0] + row[1] * row[2]).sin());
    let folds = assign_folds(50, 5, 2).unwrap();
    // Standardized beforehand, which is what the closed form does: every fold has one layer.
    for solver in [Ridge::relative(1e-4), Ridge::leave_one_out()] {
        let params = ElmParams::new(20)
            .with_standardize(false)
            .with_solver(solver);
        let full = params.fit(&x, &t).unwrap();
        let d = full.diagnosis();
        let absolute = d.lambda[0] * d.largest_singular_value.powi(2);
        let held_out = params
            .cross_val_predict(&Dataset::new(&x, &t).unwrap(), &folds)
            .unwrap();
        for label in 0..5 {
            let pick = |inside: bool| -> Vec<usize> {
                (0..50)
                    .filter(|&row| (folds[row] == label) == inside)
                    .collect()
            };
            let (kept, out) = (pick(false), pick(true));
            let (x_kept, t_kept) = (x.select(Axis(0), &kept), t.select(Axis(0), &kept));
            let fit = |lambda| {
                let params = ElmParams::new(20)
                    .with_standardize(false)
                    .with_bounded(false);
                params
                    .with_solver(Ridge::relative(lambda))
                    .fit(&x_kept, &t_kept)
                    .unwrap()
            };
            let s = fit(1.0).diagnosis().largest_singular_value;
            let refit = fit(absolute / (s * s))
                .predict(&x.select(Axis(0), &out))
                .unwrap();
            approx::assert_relative_eq!(
                held_out.predictions().select(Axis(0), &out),
                refit,
                max_relative = 1e-9
            );
        }
    }
}

#[test]
fn what_has_no_closed_form_or_no_sense_is_an_error() {
    let (x, t) = (normal::<f64>(10, 2, 1), normal::<f64>(10, 1, 2));
    let folds = assign_folds(10, 5, 0).unwrap();
    let validate = |params: ElmParams<f64>, folds: &[usize]| {
        params.cross_val_predict(&Dataset::new(&x, &t).unwrap(), folds)
    };
    for params in [
        ElmParams::new(10).with_solver(Inverse),
        ElmParams::new(3).with_solver(PseudoInverse::with_cutoff(1e-3)),
    ] {
        assert!(matches!(
            validate(params, &folds),
            Err(Error::Conflict { .. })
        ));
    }
    assert!(matches!(
        validate(ElmParams::new(3), &[0, 1]),
        Err(Error::Shape {
            what: "fold labels",
            expected: 10,
            found: 2
        })
    ));
    let problem = Problem::new(x.clone(), t.clone());
    let validator = CrossValidator::new(&problem.view()).unwrap();
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            validator.leave_one_out(&[bad]),
            Err(Error::Parameter { name: "lambda", .. })
        ));
    }
    assert!(matches!(
        validator.leave_one_out(&[1.0, 2.0]),
        Err(Error::Shape { .. })
    ));
    assert!(matches!(
        validator.leave_one_out(&[]),
        Err(Error::Shape { .. })
    ));
    assert!(matches!(
        validator.leave_one_out_path(&[]),
        Err(Error::Empty { .. })
    ));
    assert!(matches!(
        validator.select_lambda(Ridge::relative(-1.0)),
        Err(Error::Parameter { .. })
    ));
    for folds in [0, 1, 11] {
        assert!(matches!(
            assign_folds(10, folds, 0),
            Err(Error::Parameter { name: "folds", .. })
        ));
    }
}

#[test]
fn folds_are_balanced_and_repeatable() {
    let labels = assign_folds(23, 5, 9).unwrap();
    assert_eq!(labels, assign_folds(23, 5, 9).unwrap());
    let mut sizes = [0; 5];
    labels.iter().for_each(|&label| sizes[label] += 1);
    sizes.sort_unstable();
    assert_eq!(sizes, [4, 4, 5, 5, 5]);
}

#[test]
fn values_at_the_ends_of_the_range_are_validated_alike() {
    let problem = Problem::noisy(normal::<f64>(30, 6, 1), 2, 1.0, 2).with_intercept();
    let folds = assign_folds(30, 5, 1).unwrap();
    let truth = CrossValidator::new(&problem.view())
        .unwrap()
        .k_fold(&folds, &[1e-3])
        .unwrap();
    for power in [-1000, 1000] {
        let factor = 2.0_f64.powi(power);
        let mut scaled = problem.clone();
        scaled.hidden *= factor;
        scaled.targets *= factor;
        let found = CrossValidator::new(&scaled.view())
            .unwrap()
            .k_fold(&folds, &[1e-3])
            .unwrap();
        assert_eq!(
            found.predictions().mapv(|p| p / factor),
            truth.predictions()
        );
        assert_eq!(found.rmse(), truth.rmse() * factor);
    }
    // A perfect fit of nothing.
    let zero = Problem::new(array![[1.0], [2.0], [4.0]], Array2::zeros((3, 1)));
    let held_out = CrossValidator::new(&zero.view())
        .unwrap()
        .leave_one_out(&[1e-3])
        .unwrap();
    assert_eq!(held_out.rmse(), array![0.0]);
}

#[test]
fn a_validator_solves_as_ridge_does() {
    for (name, problem) in problems::<f64>() {
        let validator = CrossValidator::new(&problem.view()).unwrap();
        for lambda in [1e-10, 1e-3] {
            let (found, truth) = (
                validator.solve(&[lambda]).unwrap(),
                problem.solve(Ridge::relative(lambda)),
            );
            // Both have errors of about epsilon / lambda.
            let bound = 1e-15 / lambda * (1.0 + frobenius(&truth.beta));
            let error = frobenius(&(&found.beta - &truth.beta));
            assert!(error <= 100.0 * bound, "{name} at {lambda}: {error}");
        }
    }
}

/// Lower triangle of the Cholesky factorization, by the textbook.
fn cholesky(a: &Array2<f64>) -> Array2<f64> {
    let mut l = Array2::<f64>::zeros(a.dim());
    for i in 0..a.nrows() {
        for j in 0..=i {
            let sum = a[[i, j]] - (0..j).map(|k| l[[i, k]] * l[[j, k]]).sum::<f64>();
            l[[i, j]] = if i == j { sum.sqrt() } else { sum / l[[j, j]] };
        }
    }
    l
}

/// $L^{-1} b$.
fn forward(l: &Array2<f64>, b: &[f64]) -> Vec<f64> {
    let mut x: Vec<f64> = Vec::new();
    for (i, b) in b.iter().enumerate() {
        let known: f64 = x.iter().enumerate().map(|(k, x)| l[[i, k]] * x).sum();
        x.push((b - known) / l[[i, i]]);
    }
    x
}

#[test]
fn evidence_is_the_density_of_the_targets_under_the_model_that_ridge_stands_for() {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for (rows, neurons) in [(12, 5), (8, 20)] {
        let h = Array2::from_shape_fn((rows, neurons), |(i, j)| {
            ((i * i) as f64 * 0.37 + (j * (i + 2)) as f64 * 1.3).sin()
        });
        let t = Array2::from_shape_fn((rows, 2), |(i, o)| {
            100.0 + ((i * (o + 3)) as f64 * 0.9).cos()
        });
        for intercept in [false, true] {
            let problem = LeastSquares::new(&h, &t).unwrap().with_intercept(intercept);
            let validator = CrossValidator::new(&problem).unwrap();
            let largest = Solver::from(Ridge::relative(1.0))
                .solve(&problem)
                .unwrap()
                .diagnosis
                .largest_singular_value;
            for lambda in [1e-6, 1e-2, 10.0] {
                let found = validator.log_evidence(&[lambda]).unwrap();
                // Covariance over sigma^2: I + H H^T / lambda.
                let covariance =
                    Array2::<f64>::eye(rows) + h.dot(&h.t()) / (lambda * largest * largest);
                let l = cholesky(&covariance);
                let log_determinant: f64 = 2.0 * l.diag().mapv(f64::ln).sum();
                let ones = forward(&l, &vec![1.0; rows]);
                for (output, found) in found.into_iter().enumerate() {
                    let z = forward(&l, &t.column(output).to_vec());
                    // Without a constant the density itself; with one the density of what remains
                    // of the targets when it is taken out (Harville, Biometrika 61(2), 1974).
                    let (m, q, more) = if intercept {
                        let q = dot(&z, &z) - dot(&z, &ones).powi(2) / dot(&ones, &ones);
                        (rows - 1, q, (dot(&ones, &ones) / rows as f64).ln())
                    } else {
                        (rows, dot(&z, &z), 0.0)
                    };
                    let m = m as f64;
                    let expected = -0.5
                        * (m * ((std::f64::consts::TAU * q / m).ln() + 1.0)
                            + log_determinant
                            + more);
                    assert!(
                        (found - expected).abs() < 1e-6 * expected.abs().max(1.0),
                        "{rows} x {neurons}, {intercept}, {lambda}: {found} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn evidence_needs_a_strength_and_a_row_to_judge() {
    let (h, t) = (array![[1.0], [2.0]], array![[1.0], [3.0]]);
    let validator = CrossValidator::new(&LeastSquares::new(&h, &t).unwrap()).unwrap();
    for lambda in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            validator.log_evidence(&[lambda]),
            Err(Error::Parameter { name: "lambda", .. })
        ));
    }
    assert!(matches!(
        validator.log_evidence(&[1.0, 1.0, 1.0]),
        Err(Error::Shape { .. })
    ));
    let one = array![[1.0]];
    let alone = LeastSquares::new(&one, &one).unwrap().with_intercept(true);
    assert!(matches!(
        CrossValidator::new(&alone).unwrap().log_evidence(&[1.0]),
        Err(Error::Undetermined { .. })
    ));
}
