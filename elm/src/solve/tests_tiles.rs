//! Problems answered a tile of rows at a time against the same from their matrix.
//!
//! Both are backward stable: predictions differ by the condition, of the matrix or as far as the strength
//! lets it count, times epsilon times a number for the size. Where sums of products were allowed,
//! output weights may be off by 1e-8 of themselves, in directions of a condition of up to 1e4.

use ndarray::{Array1, Array2, Axis, concatenate, s};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::StandardNormal;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::normal_equations::{HiddenRows, RowSource};
use super::tiles::{Threshold, Tiles};
use super::{Diagnosis, LeastSquares, PseudoInverse, Ridge, Route, Solution, Solver};
use crate::linalg::{Backend, QrFactor};
use crate::scalar::Scalar;

#[derive(Clone)]
struct Problem<A: Scalar> {
    hidden: Array2<A>,
    targets: Array2<A>,
    weights: Option<Array1<A>>,
    intercept: bool,
}

fn normal(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    Array2::random_using((rows, columns), StandardNormal, &mut random)
}

impl Problem<f64> {
    /// Targets that the matrix explains but for noise of this size.
    fn new(hidden: Array2<f64>, outputs: usize, noise: f64) -> Self {
        let truth = normal(hidden.ncols(), outputs, 91);
        let noise = normal(hidden.nrows(), outputs, 92) * noise;
        Self {
            targets: hidden.dot(&truth) + noise + 3.0,
            hidden,
            weights: None,
            intercept: true,
        }
    }

    fn single(&self) -> Problem<f32> {
        Problem {
            hidden: self.hidden.mapv(|v| v as f32),
            targets: self.targets.mapv(|v| v as f32),
            weights: self.weights.as_ref().map(|w| w.mapv(|v| v as f32)),
            intercept: self.intercept,
        }
    }
}

impl<A: Scalar> Problem<A> {
    fn source(&self) -> RowSource<'_, A> {
        RowSource {
            hidden: HiddenRows::Matrix(self.hidden.view()),
            targets: self.targets.view(),
            weights: self.weights.as_ref().map(|weights| weights.view()),
            intercept: self.intercept,
        }
    }

    fn wide(&self) -> Problem<f64> {
        Problem {
            hidden: self.hidden.mapv(Scalar::as_f64),
            targets: self.targets.mapv(Scalar::as_f64),
            weights: self.weights.as_ref().map(|w| w.mapv(Scalar::as_f64)),
            intercept: self.intercept,
        }
    }

    fn by_tiles(&self, ridge: Ridge) -> Solution<f64> {
        let source = self.source();
        let mut tiles = Tiles::new(&source, Threshold::PRODUCTS).unwrap().unwrap();
        let roundoff = A::epsilon().as_f64() / 2.0;
        let found = ridge.search_many(&mut tiles, true, roundoff).unwrap();
        found.unwrap()
    }

    fn by_matrix(&self, ridge: Ridge) -> Solution<f64> {
        let wide = self.wide();
        let mut problem = LeastSquares::new(&wide.hidden, &wide.targets).unwrap();
        if let Some(weights) = &wide.weights {
            problem = problem.with_weights(weights).unwrap();
        }
        let roundoff = A::epsilon().as_f64() / 2.0;
        ridge
            .search(&problem.with_intercept(self.intercept), roundoff)
            .unwrap()
    }

    /// The largest difference of predictions for rows that count, relative to the largest target.
    fn apart(&self, one: &Solution<f64>, other: &Solution<f64>) -> f64 {
        let wide = self.wide();
        let mut change = wide.hidden.dot(&(&one.beta - &other.beta));
        change += &(&one.intercept - &other.intercept);
        if let Some(weights) = &wide.weights {
            change *= &weights.mapv(f64::sqrt).insert_axis(Axis(1));
        }
        let largest = |m: &Array2<f64>| m.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        largest(&change) / largest(&wide.targets)
    }

    /// Same strengths, predictions and errors; returns the route that was taken.
    fn agrees(&self, name: &str) -> Route {
        let mut route = Route::Given;
        for ridge in [
            Ridge::leave_one_out(),
            Ridge::gcv(),
            Ridge::leave_one_out().with_shared(true),
        ] {
            let (tiles, matrix) = (self.by_tiles(ridge), self.by_matrix(ridge));
            let (d, e) = (&tiles.diagnosis, &matrix.diagnosis);
            route = d.route;
            assert_eq!(d.lambda, e.lambda, "{name}, {ridge:?}");
            let weakest = d.lambda.iter().copied().fold(1.0, f64::min);
            let condition = e.condition.unwrap().min(weakest.sqrt().recip());
            let bound = bound(route, condition, self.hidden.dim());
            let apart = self.apart(&tiles, &matrix);
            assert!(apart <= bound, "{name}, {ridge:?}: {apart:e} > {bound:e}");
            if d.rank.is_some() {
                assert_eq!(d.rank, e.rank, "{name}");
            }
            // The share that is kept of a direction is not refined.
            let rounding = f64::EPSILON / weakest;
            let bound = bound.max(if route == Route::GramSvd {
                rounding
            } else {
                0.0
            });
            close(&d.degrees_of_freedom, &e.degrees_of_freedom, bound, name);
            close(&d.residual_norm, &e.residual_norm, 1e-6, name);
            if let (Some(d), Some(e)) = (&d.leave_one_out, &e.leave_one_out) {
                // What fits without a row predict for it is off by `bound` of the largest target, as
                // predictions are: their problems are conditioned no worse. 1.6e-6 has been seen (a
                // condition of 1e7, OpenBLAS), where that allows 1e-3; 1e-5 keeps the test sharp.
                let targets = self.wide().targets;
                for (output, (&one, &other)) in d.iter().zip(e).enumerate() {
                    let column = targets.column(output);
                    let largest = column.fold(0.0, |m: f64, t| m.max(t.abs()));
                    let allowed = (bound * largest / other).clamp(1e-6, 1e-5);
                    close(&[one], &[other], allowed, name);
                }
            } else {
                assert_eq!(d.leave_one_out, e.leave_one_out);
            }
        }
        route
    }
}

fn bound(route: Route, condition: f64, (rows, columns): (usize, usize)) -> f64 {
    let size = ((rows + columns) as f64).sqrt();
    match route {
        Route::GramSvd => 1e-8,
        _ => 10.0 * condition * size * f64::EPSILON,
    }
}

fn close(one: &[f64], other: &[f64], bound: f64, name: &str) {
    for (one, other) in one.iter().zip(other) {
        let apart = (one - other).abs();
        assert!(apart <= bound * other.abs(), "{name}: {one} is not {other}");
    }
}

/// A matrix whose columns shrink, to a condition of about this.
fn graded(rows: usize, columns: usize, condition: f64) -> Array2<f64> {
    let step = condition.ln() / (columns - 1) as f64;
    let sizes = Array1::from_shape_fn(columns, |j| (-step * j as f64).exp());
    (normal(rows, columns, 1) * &sizes).dot(&normal(columns, columns, 2))
}

/// The hidden layer of one input: numerically of low rank.
fn smooth(rows: usize, columns: usize) -> Array2<f64> {
    let (x, w) = (normal(rows, 1, 3), normal(2, columns, 4));
    Array2::from_shape_fn((rows, columns), |(i, j)| {
        (x[[i, 0]] * w[[0, j]] + w[[1, j]]).tanh()
    })
}

#[test]
fn well_conditioned_problems_go_by_sums_of_products_and_agree() {
    for intercept in [true, false] {
        let mut problem = Problem::new(normal(900, 12, 5), 3, 0.5);
        problem.intercept = intercept;
        assert_eq!(problem.agrees("normal"), Route::GramSvd);
        problem.hidden = graded(1000, 9, 300.0);
        problem.targets = normal(1000, 2, 6);
        assert_eq!(problem.agrees("graded"), Route::GramSvd);
    }
}

/// Problems whose sums of products are of rounding in some directions.
fn badly_conditioned() -> [(&'static str, Array2<f64>); 3] {
    [
        ("graded", graded(900, 14, 1e9)),
        ("smooth", smooth(1100, 20)),
        ("deficient", normal(900, 4, 7).dot(&normal(4, 15, 8))),
    ]
}

#[test]
fn badly_conditioned_problems_go_by_sums_of_products_where_noise_calls_for_strength() {
    for (name, hidden) in badly_conditioned() {
        for intercept in [true, false] {
            let mut problem = Problem::new(hidden.clone(), 2, 0.0);
            // Strengths are relative to the largest squared singular value.
            let size = hidden.mapv(|h| h * h).sum().sqrt();
            problem.targets += &(normal(hidden.nrows(), 2, 93) * (0.1 * size));
            problem.intercept = intercept;
            assert_eq!(problem.agrees(name), Route::GramSvd, "{name}");
            assert_eq!(problem.by_tiles(Ridge::default()).diagnosis.rank, None);
        }
    }
}

/// Strengths below 2.2e-8, at which the sums alone leave more than 1e-8 of error in predictions.
#[test]
fn weak_strengths_are_searched_by_sums_of_products_and_refined() {
    let (rows, columns) = (900, 14);
    let mut problem = Problem::new(graded(rows, columns, 1e9), 1, 0.0);
    let mut weakest = 1.0_f64;
    for explained in 4..=6 {
        let parts = normal(rows, columns, 1);
        let parts = parts.slice(s![.., ..explained]).sum_axis(Axis(1));
        problem.targets = parts.insert_axis(Axis(1)) + normal(rows, 1, 93) * 3.0;
        for intercept in [true, false] {
            problem.intercept = intercept;
            assert_eq!(problem.agrees("graded"), Route::GramSvd, "{explained}");
            let (tiles, matrix) = (
                problem.by_tiles(Ridge::default()),
                problem.by_matrix(Ridge::default()),
            );
            let strength = tiles.diagnosis.lambda[0];
            // Without the step 3e-10 at a strength of 1e-8.
            let apart = problem.apart(&tiles, &matrix);
            assert!(apart < 1e-11, "{strength:e}: {apart:e}");
            weakest = weakest.min(strength);
        }
    }
    assert!(weakest < 2e-8, "{weakest:e}");
}

/// As columns of zeros and a one are beside large ones: without ridge the row would determine its own fit.
#[test]
fn rows_that_ridge_keeps_from_determining_their_own_fit_are_scored_as_they_are() {
    for (name, mut hidden) in badly_conditioned() {
        let size = hidden.mapv(|h| h * h).sum().sqrt();
        for (row, own) in [(5, 1e-5), (300, 1e-3)] {
            let mut column = Array2::zeros((hidden.nrows(), 1));
            column[[row, 0]] = own * size;
            hidden.append(Axis(1), column.view()).unwrap();
        }
        let mut problem = Problem::new(hidden.clone(), 2, 0.0);
        problem.targets += &(normal(hidden.nrows(), 2, 93) * (0.1 * size));
        assert_eq!(problem.agrees(name), Route::GramSvd, "{name}");
    }
}

/// The leave-one-out error of the only output by as many fits, at the strength of `solution`.
fn by_refits(problem: &Problem<f64>, solution: &Solution<f64>) -> f64 {
    let (rows, columns) = problem.hidden.dim();
    let Diagnosis {
        largest_singular_value,
        lambda,
        ..
    } = &solution.diagnosis;
    let root = lambda[0].sqrt() * largest_singular_value;
    let square_of = |row: usize| {
        let kept: Vec<usize> = (0..rows).filter(|other| *other != row).collect();
        let hidden = problem.hidden.select(Axis(0), &kept);
        let targets = problem.targets.select(Axis(0), &kept);
        let (mean, constant) = (hidden.mean_axis(Axis(0)).unwrap(), targets.mean().unwrap());
        let held = Array2::<f64>::eye(columns) * root;
        let hidden = concatenate![Axis(0), hidden - &mean, held];
        let targets = concatenate![Axis(0), targets - constant, Array2::zeros((columns, 1))];
        let QrFactor { r, qtb, .. } = f64::triangularize(hidden.view(), targets.view()).unwrap();
        let beta = f64::solve_upper(r.view(), qtb.view()).unwrap();
        let place = &problem.hidden.row(row) - &mean;
        (problem.targets[[row, 0]] - constant - place.dot(&beta.column(0))).powi(2)
    };
    ((0..rows).map(square_of).sum::<f64>() / rows as f64).sqrt()
}

/// Such rows have a column of their own; beside weak directions their residuals drown in rounding.
#[test]
fn rows_that_determine_their_own_fit_at_every_strength_are_left_out_exactly() {
    for (name, mut hidden) in badly_conditioned() {
        let size = hidden.mapv(|h| h * h).sum().sqrt();
        for row in [300, 800] {
            let mut column = Array2::zeros((hidden.nrows(), 1));
            column[[row, 0]] = size;
            hidden.append(Axis(1), column.view()).unwrap();
        }
        let mut problem = Problem::new(hidden.clone(), 1, 0.0);
        problem.targets += &(normal(hidden.nrows(), 1, 93) * (0.1 * size));
        let (tiles, matrix) = (
            problem.by_tiles(Ridge::default()),
            problem.by_matrix(Ridge::default()),
        );
        assert_eq!(tiles.diagnosis.lambda, matrix.diagnosis.lambda, "{name}");
        let error = by_refits(&problem, &matrix);
        for solution in [tiles, matrix] {
            let found = solution.diagnosis.leave_one_out.unwrap();
            close(&found, &[error], 1e-7, name);
        }
    }
}

/// A few strong directions explain half of the targets, many weaker ones nothing, the weakest the rest.
#[test]
fn a_score_that_falls_again_below_what_sums_serve_is_seen() {
    let (strong, weak) = (6, 66);
    let size = 3e-6;
    let mut hidden = normal(1200, 72, 20);
    let mut rest = hidden.slice_mut(s![.., strong..weak]);
    rest.mapv_inplace(|h| 2e-4 * h);
    let mut rest = hidden.slice_mut(s![.., weak..]);
    rest.mapv_inplace(|h| size * h);
    let mut truth = Array2::ones((72, 1));
    truth.slice_mut(s![strong..weak, ..]).fill(0.0);
    truth.slice_mut(s![weak.., ..]).fill(size.recip());
    let mut problem = Problem::new(hidden.clone(), 1, 0.0);
    problem.targets = hidden.dot(&truth) + normal(1200, 1, 21) * 0.1;
    let lambda = problem.by_matrix(Ridge::default()).diagnosis.lambda[0];
    assert!(lambda < 1e-11, "{lambda:e}");
    problem.agrees("falls again");
}

#[test]
fn badly_conditioned_problems_of_little_noise_go_by_the_triangle_and_agree() {
    for (name, hidden) in badly_conditioned() {
        for intercept in [true, false] {
            let mut problem = Problem::new(hidden.clone(), 2, 1e-9);
            // A constant is noise to a fit without an intercept.
            problem.targets -= 3.0;
            problem.intercept = intercept;
            assert_eq!(problem.agrees(name), Route::QrSvd, "{name}");
        }
    }
}

#[test]
fn weights_count_and_rows_without_weight_may_hold_anything() {
    for hidden in [normal(1200, 10, 9), smooth(1200, 18)] {
        let mut problem = Problem::new(hidden, 2, 0.3);
        let mut weights = normal(1200, 1, 10).column(0).mapv(f64::abs);
        problem.weights = Some(weights.clone());
        problem.agrees("weighted");
        for row in (0..1200).step_by(7) {
            weights[row] = 0.0;
            problem.hidden.row_mut(row).fill(1e200);
            problem.targets.row_mut(row).fill(-1e200);
        }
        problem.weights = Some(weights);
        let (tiles, matrix) = (
            problem.by_tiles(Ridge::default()),
            problem.by_matrix(Ridge::default()),
        );
        assert_eq!(tiles.diagnosis.lambda, matrix.diagnosis.lambda);
        let apart = (&tiles.beta - &matrix.beta).mapv(f64::abs).sum();
        assert!(
            apart <= 1e-7 * matrix.beta.mapv(f64::abs).sum(),
            "{apart:e}"
        );
    }
}

#[test]
fn rows_that_all_but_determine_their_own_fit_are_left_out_exactly() {
    // A condition of 1e7 in both cases.
    for (name, mut hidden, unit) in [
        ("normal", normal(900, 10, 11), 1e4),
        ("graded", graded(900, 10, 100.0), 1e2),
    ] {
        for (size, row) in [(1.0, 17), (1e2, 500), (1e3, 899)] {
            let own = normal(1, hidden.ncols(), row as u64) * (size * unit);
            hidden.row_mut(row).assign(&own.row(0));
        }
        let mut problem = Problem::new(hidden, 2, 0.3);
        problem.agrees(name);
        // One that the others do not foretell.
        problem
            .targets
            .slice_mut(s![500, ..])
            .mapv_inplace(|t| 2.0 * t);
        problem.agrees(name);
        problem.intercept = false;
        problem.agrees(name);
    }
}

#[test]
fn constant_columns_and_targets_carry_nothing() {
    let mut hidden = normal(900, 8, 12);
    hidden.column_mut(2).fill(0.1);
    hidden.column_mut(5).fill(1e6 / 3.0);
    let mut problem = Problem::new(hidden, 2, 0.3);
    problem.targets.column_mut(1).fill(0.7);
    let (tiles, matrix) = (
        problem.by_tiles(Ridge::default()),
        problem.by_matrix(Ridge::default()),
    );
    assert_eq!(tiles.diagnosis.rank, Some(6));
    assert_eq!(tiles.diagnosis.lambda[0], matrix.diagnosis.lambda[0]);
    assert!(problem.apart(&tiles, &matrix) < 1e-10);
    assert!(tiles.beta.column(1).iter().all(|b| *b == 0.0));
    assert_eq!(tiles.intercept[1], 0.7);
}

#[test]
fn sorted_rows_and_large_means_cost_nothing() {
    let mut hidden = smooth(2000, 15);
    hidden.mapv_inplace(|v| v + 50.0);
    let mut problem = Problem::new(hidden, 1, 0.1);
    let mut order: Vec<usize> = (0..2000).collect();
    order.sort_by(|&a, &b| problem.hidden[[a, 0]].total_cmp(&problem.hidden[[b, 0]]));
    problem.hidden = problem.hidden.select(Axis(0), &order);
    problem.targets = problem.targets.select(Axis(0), &order);
    problem.agrees("sorted");
}

#[test]
fn single_precision_is_searched_in_double() {
    for hidden in [normal(900, 10, 13), smooth(900, 16)] {
        Problem::new(hidden, 2, 0.3).single().agrees("single");
    }
}

#[test]
fn targets_without_noise_are_met_as_closely() {
    for hidden in [normal(900, 10, 14), graded(900, 12, 1e6), smooth(900, 16)] {
        let problem = Problem::new(hidden, 1, 0.0);
        let error = |solution: &Solution<f64>| {
            let fitted = problem.hidden.dot(&solution.beta) + &solution.intercept;
            (fitted - &problem.targets).mapv(|e| e * e).sum().sqrt()
        };
        let tiles = error(&problem.by_tiles(Ridge::default()));
        let matrix = error(&problem.by_matrix(Ridge::default()));
        let size = problem.targets.mapv(|t| t * t).sum().sqrt();
        assert!(
            tiles <= 10.0 * matrix + 1e-13 * size,
            "{tiles:e}, {matrix:e}"
        );
    }
}

#[test]
fn the_triangle_serves_the_pseudo_inverse_and_weak_strengths() {
    for hidden in [normal(900, 10, 15), smooth(900, 16)] {
        let problem = Problem::new(hidden, 2, 0.3);
        let whole = LeastSquares::new(&problem.hidden, &problem.targets).unwrap();
        let whole = whole.with_intercept(true);
        let source = problem.source();
        let mut tiles = Tiles::new(&source, Threshold::TRIANGLE).unwrap().unwrap();
        let (triangle, frame) = tiles.centered_triangle().unwrap().unwrap();
        let solver = PseudoInverse::default();
        let tiles = solver.solve_centered(triangle, frame).unwrap();
        let matrix = Solver::from(solver).solve(&whole).unwrap();
        assert_eq!(tiles.diagnosis.rank, matrix.diagnosis.rank);
        assert_eq!(tiles.diagnosis.route, matrix.diagnosis.route);
        let condition = matrix.diagnosis.condition.unwrap();
        let bound = bound(Route::Qr, condition, problem.hidden.dim());
        assert!(problem.apart(&tiles, &matrix) <= bound);
    }
}

#[test]
fn sums_of_products_serve_few_rows_where_their_condition_allows_it() {
    let taken = |problem: &Problem<f64>| {
        let solution = Ridge::default().solve_rows(&problem.source()).unwrap();
        solution.map(|solution| solution.diagnosis.route)
    };
    for rows in [2000, 1000, 605] {
        let problem = Problem::new(normal(rows, 300, 17), 2, 0.3);
        assert_eq!(problem.agrees("two rows per column"), Route::GramSvd);
        assert_eq!(taken(&problem), Some(Route::GramSvd));
        let problem = Problem::new(graded(rows, 300, 1e6), 2, 1e-9);
        assert_eq!(taken(&problem), None);
    }
    let few = Problem::new(normal(595, 300, 18), 2, 0.3);
    assert_eq!(taken(&few), None);
    let mut problem = Problem::new(normal(1250, 150, 17), 2, 0.3);
    // They may be numbers of rows, of which one is left out.
    problem.weights = Some(Array1::from_shape_fn(1250, |row| 1.0 + (row % 3) as f64));
    assert_eq!(taken(&problem), None);
    problem.weights = Some(Array1::from_elem(1250, 3.0));
    assert_eq!(taken(&problem), Some(Route::GramSvd));
}
