//! Permutation importance of leave-one-out predictions: against refitting, and by what matters.

use approx::assert_relative_eq;
use elm::advanced::Stream;
use elm::solve::{LeastSquares, Ridge, Solver};
use elm::{Dataset, ElmParams, Error, UncertainElm};
use ndarray::{Array1, Array2, Axis, Ix1, array};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::StandardUniform;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// The third input says nothing.
fn problem(rows: usize) -> (Array2<f64>, Array1<f64>) {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let x: Array2<f64> = Array2::random_using((rows, 3), StandardUniform, &mut random);
    let noise: Array1<f64> = Array1::random_using(rows, StandardUniform, &mut random);
    let t = x.map_axis(Axis(1), |x| (4.0 * x[0]).sin() + 0.3 * x[1] * x[1]);
    (x, t + 0.1 * noise)
}

fn params() -> ElmParams<f64> {
    ElmParams::new(25).with_scale(1.5).with_bounded(false)
}

/// The mean square, of these weights, of what refits without each row's label leave of `t` at `x`, over that
/// of `t` about its mean.
fn by_refits(
    fitted: &UncertainElm<f64, Ix1>,
    data: &Dataset<'_, f64, Ix1>,
    x: &Array2<f64>,
    labels: &[usize],
) -> f64 {
    let model = fitted.model();
    let h = model.hidden_matrix(&data.inputs()).unwrap();
    let changed = model.hidden_matrix(x).unwrap();
    let t = data.targets();
    let ones = Array1::ones(t.len());
    let weights = data.weights().unwrap_or(ones.view());
    let diagnosis = model.diagnosis();
    let absolute = diagnosis.lambda[0] * diagnosis.largest_singular_value.powi(2);
    let mean = t.dot(&weights) / weights.sum();
    let (mut squares, mut total) = (0.0, 0.0);
    for row in (0..t.len()).filter(|&row| weights[row] > 0.0) {
        let rest: Vec<usize> = (0..t.len()).filter(|&r| labels[r] != labels[row]).collect();
        let h_rest = h.select(Axis(0), &rest);
        let t_rest = t.select(Axis(0), &rest).insert_axis(Axis(1));
        let w_rest = weights.select(Axis(0), &rest);
        let problem = LeastSquares::new(&h_rest, &t_rest).unwrap();
        let problem = problem.with_intercept(true).with_weights(&w_rest).unwrap();
        let solve = |lambda| {
            Solver::from(Ridge::relative(lambda))
                .solve(&problem)
                .unwrap()
        };
        let largest = solve(1e-3).diagnosis.largest_singular_value;
        let refit = solve(absolute / largest.powi(2));
        let error = t[row] - changed.row(row).dot(&refit.beta.column(0)) - refit.intercept[0];
        squares += weights[row] * error * error;
        total += weights[row] * (t[row] - mean).powi(2);
    }
    squares / total
}

#[test]
fn importance_is_that_of_refitting_without_each_row_or_group() {
    let (x, t) = problem(24);
    // Several have the largest, which weights are relative to; two are no rows.
    let weights = Array1::from_shape_fn(24, |row| [1.0, 0.5, 0.2][row % 3] * f64::from(row > 1));
    let pairs: Vec<usize> = (0..24).map(|row| 7 * (row / 2)).collect();
    let plain = Dataset::new(&x, &t).unwrap();
    let weighted = plain.with_weights(&weights).unwrap();
    let alone: Vec<usize> = (0..24).collect();
    let all = [
        (plain, &alone),
        (weighted, &alone),
        (plain.with_groups(&pairs).unwrap(), &pairs),
        (weighted.with_groups(&pairs).unwrap(), &pairs),
    ];
    for (data, labels) in all {
        let solver = Ridge::relative(1e-3);
        let fitted = params().with_solver(solver).fit_uncertain(&data).unwrap();
        let falls = fitted.permutation_importance(&data, 2, 9).unwrap();
        assert_eq!(falls.dim(), (3, 1, 2));
        let before = by_refits(&fitted, &data, &x, labels);
        let present: Vec<usize> = match data.weights() {
            Some(weights) => (0..24).filter(|&row| weights[row] > 0.0).collect(),
            None => alone.clone(),
        };
        for input in 0..3 {
            let mut random = ChaCha8Rng::seed_from_u64(9);
            random.set_stream(Stream::Permutations(input as u32).number());
            for repeat in 0..2 {
                let mut others = present.clone();
                others.shuffle(&mut random);
                let mut changed = x.clone();
                for (&row, &other) in present.iter().zip(&others) {
                    changed[[row, input]] = x[[other, input]];
                }
                let after = by_refits(&fitted, &data, &changed, labels);
                let fall = falls[[input, 0, repeat]];
                assert_relative_eq!(fall, after - before, max_relative = 1e-8, epsilon = 1e-10);
            }
        }
    }
}

#[test]
fn inputs_that_say_nothing_are_not_important() {
    let (x, t) = problem(300);
    let both = ndarray::stack![Axis(1), t, 5.0 - 3.0 * &t];
    let data = Dataset::new(&x, &both).unwrap();
    for members in [1, 3] {
        let fitted = params().fit_ensemble(members, &data).unwrap();
        let falls = fitted.permutation_importance(&data, 10, 1).unwrap();
        let mean = falls.mean_axis(Axis(2)).unwrap();
        // Independent inputs: twice the share of the variance that an input accounts for, 0.92 and 0.07 here.
        let share = |input: usize| mean[[input, 0]] / 2.0;
        assert!((0.8..1.05).contains(&share(0)), "{mean}");
        assert!((0.01..0.1).contains(&share(1)), "{mean}");
        assert!(share(2).abs() < 0.01, "{mean}");
        // Neither unit nor sign nor mean counts.
        for row in mean.rows() {
            assert_relative_eq!(row[0], row[1], max_relative = 1e-6, epsilon = 1e-9);
        }
    }
    let map = params().fit_dataset(&data).unwrap().map().clone();
    let again = params().fit_map_uncertain(map, &data).unwrap();
    let fitted = params().fit_uncertain(&data).unwrap();
    assert_eq!(
        again.permutation_importance(&data, 2, 1).unwrap(),
        fitted.permutation_importance(&data, 2, 1).unwrap()
    );
}

#[test]
fn other_rows_and_no_repeats_are_errors() {
    let (x, t) = problem(30);
    let data = Dataset::new(&x, &t).unwrap();
    let fitted = params().fit_uncertain(&data).unwrap();
    let none = fitted.permutation_importance(&data, 0, 0).unwrap_err();
    assert!(
        matches!(
            none,
            Error::Parameter {
                name: "repeats",
                ..
            }
        ),
        "{none}"
    );
    let (fewer, shorter) = problem(29);
    let rows = fitted.permutation_importance(&Dataset::new(&fewer, &shorter).unwrap(), 1, 0);
    assert!(
        matches!(rows, Err(Error::Shape { what: "rows", .. })),
        "{rows:?}"
    );
    let narrow = x.slice(ndarray::s![.., ..2]).to_owned();
    let inputs = fitted.permutation_importance(&Dataset::new(&narrow, &t).unwrap(), 1, 0);
    assert!(
        matches!(inputs, Err(Error::Shape { what: "inputs", .. })),
        "{inputs:?}"
    );
    let constant = array![2.0, 2.0, 2.0, 2.0];
    let few = x.slice(ndarray::s![..4, ..]).to_owned();
    let data = Dataset::new(&few, &constant).unwrap();
    let fitted = params().fit_uncertain(&data).unwrap();
    let falls = fitted.permutation_importance(&data, 2, 0).unwrap();
    assert!(falls.iter().all(|fall| *fall == 0.0), "{falls}");
}
