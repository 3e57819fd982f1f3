//! Rows that arrive in pieces give the answer of a batch fit.

use crate::common::{amplification, frobenius, normal, weights};
use elm::solve::{Inverse, PseudoInverse, Ridge, Route, Solver};
use elm::{Accumulator, Biases, Dataset, Elm, ElmParams, Error, Scalar, Scaler};
use ndarray::{Array1, Array2, Axis, array, s};

pub(crate) fn data<A: Scalar>(rows: usize, seed: u64) -> (Array2<A>, Array2<A>) {
    let x = normal::<A>(rows, 3, seed);
    let noise = normal::<A>(rows, 2, seed + 1).mapv(|v| v * A::from_f64(0.1));
    let mut t = Array2::zeros((rows, 2));
    t.column_mut(0)
        .assign(&x.map_axis(Axis(1), |row| (row[0] + row[1] * row[2]).sin()));
    t.column_mut(1)
        .assign(&x.map_axis(Axis(1), |row| row[2].exp() + A::from_f64(1e3)));
    (x, t + noise)
}

fn accumulated<A: Scalar>(
    params: &ElmParams<A>,
    x: &Array2<A>,
    t: &Array2<A>,
    chunk: usize,
) -> Accumulator<A> {
    let mut accumulator = Accumulator::from_sample(params, x, t.ncols()).unwrap();
    for (x, t) in x
        .axis_chunks_iter(Axis(0), chunk)
        .zip(t.axis_chunks_iter(Axis(0), chunk))
    {
        accumulator.push(&x, &t).unwrap();
    }
    accumulator
}

/// Both fits have residuals of their best to rounding error, so fitted values differ by epsilon
/// times the condition (of the residual, by perturbation theory: Higham 2002, ch. 20).
pub(crate) fn assert_same_fit<A: Scalar>(one: &Elm<A>, other: &Elm<A>, x: &Array2<A>, what: &str) {
    let (a, b) = (one.predict(x).unwrap(), other.predict(x).unwrap());
    let size = x.nrows() as f64 + x.ncols() as f64;
    let amplification = amplification(one.diagnosis()).min(amplification(other.diagnosis()));
    let bound = 4.0 * size.sqrt() * A::epsilon().as_f64() * amplification * frobenius(&a);
    let error = frobenius(&(&a - &b));
    assert!(error <= bound, "{what}: {error:e} > {bound:e}");
}

fn solvers() -> [Solver; 3] {
    [
        PseudoInverse::default().into(),
        Ridge::relative(1e-6).into(),
        Ridge::gcv().into(),
    ]
}

#[test]
fn chunks_of_any_size_give_the_batch_answer() {
    let (x, t) = data::<f64>(400, 1);
    for solver in solvers() {
        for (intercept, links) in [(true, false), (false, true)] {
            let params = ElmParams::new(15)
                .with_solver(solver)
                .with_intercept(intercept)
                .with_direct_links(links);
            let batch = params.fit(&x, &t).unwrap();
            for chunk in [1, 7, 100, 400] {
                let accumulator = accumulated(&params, &x, &t, chunk);
                assert_eq!(accumulator.rows(), 400);
                let model = accumulator.fit().unwrap();
                assert_same_fit(&model, &batch, &x, &format!("{solver}, chunks of {chunk}"));
                let (a, b) = (model.diagnosis(), batch.diagnosis());
                assert_eq!(a.lambda, b.lambda);
                for (a, b) in a.residual_norm.iter().zip(&b.residual_norm) {
                    approx::assert_relative_eq!(*a, *b, max_relative = 1e-8);
                }
            }
        }
    }
}

#[test]
fn the_order_of_rows_and_the_way_of_merging_do_not_matter() {
    let (x, t) = data::<f64>(600, 3);
    let params = ElmParams::new(12).with_solver(Ridge::gcv());
    let batch = params.fit(&x, &t).unwrap();
    let start = Accumulator::with_scaler(&params, Scaler::measured(&x).unwrap(), 2).unwrap();
    let part = |range: std::ops::Range<usize>| {
        let mut part = start.clone();
        part.push(&x.slice(s![range.clone(), ..]), &t.slice(s![range, ..]))
            .unwrap();
        part
    };
    let mut parts = [part(0..5), part(5..250), part(250..250), part(250..600)];
    // A chain, backwards; then a tree.
    let mut chain = start.clone();
    parts.iter().rev().for_each(|p| chain.merge(p).unwrap());
    let (left, right) = parts.split_at_mut(2);
    left[0].merge(&right[1]).unwrap();
    left[1].merge(&right[0]).unwrap();
    left[1].merge(&left[0].clone()).unwrap();
    for merged in [&chain, &left[1]] {
        assert_eq!(merged.rows(), 600);
        assert_same_fit(&merged.fit().unwrap(), &batch, &x, "merged");
    }
    // More rows after a fit.
    let mut more = part(0..250);
    more.fit().unwrap();
    more.push(&x.slice(s![250.., ..]), &t.slice(s![250.., ..]))
        .unwrap();
    assert_same_fit(&more.fit().unwrap(), &batch, &x, "continued");
}

#[test]
fn biases_on_the_data_come_from_the_sample() {
    let (x, t) = data::<f64>(200, 4);
    let params = ElmParams::new(10)
        .with_biases(Biases::AtTrainingRows)
        .with_solver(Ridge::gcv());
    let batch = params.fit(&x, &t).unwrap();
    let mut one = accumulated(&params, &x, &t, 50);
    assert_same_fit(&one.fit().unwrap(), &batch, &x, "one sample");
    one.merge(&Accumulator::from_sample(&params, &x, 2).unwrap())
        .unwrap();
    let scaler = Scaler::measured(&x).unwrap();
    assert!(matches!(
        <Accumulator<f64>>::with_scaler(&params, scaler, 2),
        Err(Error::Conflict { .. })
    ));
}

#[test]
fn weighted_rows_give_the_weighted_batch_answer() {
    let (x, t) = data::<f64>(200, 5);
    let mut w = weights::<f64>(200, 6);
    w.slice_mut(s![..;3]).fill(0.0);
    for factor in [1.0, 1e-200, 1e200] {
        let params = ElmParams::new(10).with_solver(Ridge::relative(1e-6));
        let w = &w * factor;
        let batch = params
            .fit_dataset(&Dataset::new(&x, &t).unwrap().with_weights(&w).unwrap())
            .unwrap();
        let scaler = Scaler::measured_weighted(&x, &w).unwrap();
        let mut accumulator = Accumulator::with_scaler(&params, scaler, 2).unwrap();
        for start in (0..200).step_by(30) {
            let range = start..200.min(start + 30);
            accumulator
                .push_dataset(
                    &Dataset::new(
                        &x.slice(s![range.clone(), ..]),
                        &t.slice(s![range.clone(), ..]),
                    )
                    .unwrap()
                    .with_weights(&w.slice(s![range]))
                    .unwrap(),
                )
                .unwrap();
        }
        let model = accumulator.fit().unwrap();
        assert_same_fit(&model, &batch, &x, "weighted");
        approx::assert_relative_eq!(
            model.diagnosis().largest_singular_value,
            batch.diagnosis().largest_singular_value,
            max_relative = 1e-9
        );
    }
}

#[test]
fn fewer_rows_than_neurons_give_the_batch_answer() {
    let (x, t) = data::<f64>(12, 7);
    for solver in [
        Solver::from(PseudoInverse::default()),
        Ridge::relative(1e-4).into(),
    ] {
        let params = ElmParams::new(30).with_solver(solver);
        let batch = params.fit(&x, &t).unwrap();
        for rows in [1, 5] {
            let model = accumulated(&params, &x, &t, rows).fit().unwrap();
            assert_same_fit(&model, &batch, &x, solver.name());
        }
    }
}

#[test]
fn inputs_without_information_are_answered_by_the_mean() {
    let (x, t) = (Array2::from_elem((50, 2), 0.1), normal::<f64>(50, 1, 8));
    for solver in solvers() {
        let params = ElmParams::new(9).with_solver(solver);
        let y = accumulated(&params, &x, &t, 7)
            .fit()
            .unwrap()
            .predict(&x)
            .unwrap();
        assert!((y - t.sum() / 50.0).iter().all(|d: &f64| d.abs() < 1e-13));
    }
}

#[test]
fn targets_of_any_size_give_the_answer_of_the_batch() {
    let (x, t) = data::<f64>(100, 9);
    let params = ElmParams::new(10).with_solver(Ridge::relative(1e-6));
    for (first, second) in [(1.0, 1.0), (1e-200, 1.0), (1.0, 1e200), (1e300, 1e300)] {
        let mut t = t.clone();
        t.slice_mut(s![..50, ..]).mapv_inplace(|v| v / 1e3 * first);
        t.slice_mut(s![50.., ..]).mapv_inplace(|v| v / 1e3 * second);
        let model = accumulated(&params, &x, &t, 25).fit().unwrap();
        assert_same_fit(&model, &params.fit(&x, &t).unwrap(), &x, "scaled");
    }
}

#[test]
fn leave_one_out_is_replaced_by_generalized_cross_validation() {
    let (x, t) = data::<f64>(150, 10);
    let params = |ridge: Ridge| ElmParams::new(10).with_solver(ridge);
    let default = accumulated(&params(Ridge::default()), &x, &t, 40)
        .fit()
        .unwrap();
    let gcv = accumulated(&params(Ridge::gcv()), &x, &t, 40)
        .fit()
        .unwrap();
    assert_eq!(default, gcv);
    assert_eq!(default.diagnosis().leave_one_out, None);
}

#[test]
fn what_cannot_be_taken_in_is_an_error_and_leaves_no_trace() {
    let (x, t) = data::<f64>(300, 11);
    let params = ElmParams::new(10);
    let mut accumulator = accumulated(&params, &x, &t, 50);
    let before = accumulator.clone();
    let (mut bad_x, mut bad_t) = (x.clone(), t.clone());
    bad_x[[299, 2]] = f64::NAN;
    bad_t[[0, 1]] = f64::INFINITY;
    let short = Array1::ones(2);
    let place = |what, row, column| Error::NotFinite { what, row, column };
    let shape = |what, expected, found| Error::Shape {
        what,
        expected,
        found,
    };
    for (result, expected) in [
        (accumulator.push(&bad_x, &t), place("inputs", 299, 2)),
        (accumulator.push(&x, &bad_t), place("targets", 0, 1)),
        (accumulator.push(&x, &x), shape("outputs", 2, 3)),
        (accumulator.push(&t, &t), shape("columns of inputs", 3, 2)),
        (
            accumulator.push(&x, &t.slice(s![..9, ..])),
            shape("rows of targets", 300, 9),
        ),
        (
            Dataset::new(&x, &t)
                .and_then(|data| data.with_weights(&short))
                .and_then(|data| accumulator.push_dataset(&data)),
            shape("row weights", 300, 2),
        ),
    ] {
        assert_eq!(result, Err(expected));
    }
    // In the range until it is weighted, in a few rows and in many.
    let huge = Array2::from_elem((300, 2), 1e308);
    for rows in [2, 300] {
        let w = Array1::from_elem(rows, 1e300);
        let (x, t) = (x.slice(s![..rows, ..]), huge.slice(s![..rows, ..]));
        assert!(matches!(
            accumulator.push_dataset(&Dataset::new(&x, &t).unwrap().with_weights(&w).unwrap()),
            Err(Error::Overflow { .. })
        ));
    }
    assert_eq!(accumulator, before);
    accumulator
        .push(&x.slice(s![..0, ..]), &t.slice(s![..0, ..]))
        .unwrap();
    assert_eq!(accumulator, before);
}

#[test]
fn accumulators_of_different_kinds_do_not_merge() {
    let (x, _) = data::<f64>(20, 12);
    let make = |params: ElmParams<f64>, outputs| {
        <Accumulator<f64>>::from_sample(&params, &x, outputs).unwrap()
    };
    let plain = || ElmParams::new(5).with_solver(Ridge::gcv());
    let elsewhere = &x + 1.0;
    let scaler = Scaler::measured(&elsewhere).unwrap();
    let other = Accumulator::with_scaler(&plain(), scaler, 2).unwrap();
    for (other, what) in [
        (make(plain().with_seed(1), 2), "random layers"),
        (other, "scalers of inputs"),
        (make(plain(), 1), "numbers of outputs"),
        (make(plain().with_direct_links(true), 2), "direct links"),
        (make(plain().with_intercept(false), 2), "intercepts"),
        (
            make(plain().with_solver(Ridge::relative(0.1)), 2),
            "solvers",
        ),
    ] {
        assert_eq!(
            make(plain(), 2).merge(&other),
            Err(Error::Mismatch { what })
        );
    }
}

#[test]
fn what_cannot_be_accumulated_is_an_error() {
    let (x, t) = data::<f64>(20, 13);
    let scaler = Scaler::measured(&x).unwrap();
    let inverse = ElmParams::new(20).with_solver(Inverse);
    assert!(matches!(
        <Accumulator<f64>>::from_sample(&inverse, &x, 1),
        Err(Error::Conflict { .. })
    ));
    let unscaled = ElmParams::new(5).with_standardize(false);
    assert!(matches!(
        <Accumulator<f64>>::with_scaler(&unscaled, scaler, 1),
        Err(Error::Conflict { .. })
    ));
    let params = ElmParams::new(5);
    assert!(matches!(
        <Accumulator<f64>>::from_sample(&params, &x, 0),
        Err(Error::Parameter {
            name: "outputs",
            ..
        })
    ));
    assert!(matches!(
        <Accumulator<f64>>::from_sample(&ElmParams::new(usize::MAX / 8), &x, 1),
        Err(Error::TooLarge { .. })
    ));
    let mut none = Accumulator::from_sample(&params, &x, 2).unwrap();
    assert!(matches!(none.fit(), Err(Error::Empty { .. })));
    none.push_dataset(
        &Dataset::new(&x, &t)
            .unwrap()
            .with_weights(&Array1::zeros(20))
            .unwrap(),
    )
    .unwrap();
    assert!(matches!(none.fit(), Err(Error::Empty { .. })));
    assert!(matches!(
        params.fit_chunks(std::iter::empty::<Result<(Array2<f64>, Array2<f64>), Error>>()),
        Err(Error::Empty { what: "chunks", .. })
    ));
    for (mean, deviation) in [
        (array![0.0, f64::NAN], array![1.0, 1.0]),
        (array![0.0], array![1.0, 1.0]),
        (array![0.0], array![-1.0]),
        (array![], array![]),
    ] {
        assert!(Scaler::new(&mean, &deviation).is_err());
    }
}

#[test]
fn chunks_from_an_iterator_are_fitted_and_its_error_is_passed_on() {
    let (x, t) = data::<f64>(90, 14);
    let params = ElmParams::new(8).with_solver(Ridge::gcv());
    let chunk = |i: usize| {
        (
            x.slice(s![i * 30..(i + 1) * 30, ..]).to_owned(),
            t.slice(s![i * 30..(i + 1) * 30, ..]).to_owned(),
        )
    };
    let model = params
        .fit_chunks((0..3).map(|i| Ok::<_, Error>(chunk(i))))
        .unwrap();
    // Fewer than a thousand rows are measured together.
    let mut expected = Accumulator::from_sample(&params, &x, 2).unwrap();
    expected.push(&x, &t).unwrap();
    assert_same_fit(&model, &expected.fit().unwrap(), &x, "chunks");

    let broken = (0..3).map(|i| {
        if i == 1 {
            Err(Error::NoConvergence { what: "reading" })
        } else {
            Ok(chunk(i))
        }
    });
    assert_eq!(
        params.fit_chunks(broken),
        Err(Error::NoConvergence { what: "reading" })
    );
}

#[cfg(feature = "rayon")]
#[test]
fn parts_of_chunks_give_one_answer_on_any_number_of_threads() {
    let (x, t) = data::<f64>(400, 14);
    let params = ElmParams::new(9).with_solver(Ridge::gcv());
    let chunks = |rows: usize| {
        let pieces = x
            .axis_chunks_iter(Axis(0), rows)
            .zip(t.axis_chunks_iter(Axis(0), rows));
        pieces.map(|(x, t)| Ok::<_, Error>((x.to_owned(), t.to_owned())))
    };
    let on = |threads: usize, rows: usize, parts: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| params.fit_chunks_parallel(chunks(rows), parts))
    };
    for (rows, parts) in [(30, 1), (30, 2), (7, 5), (150, 8), (400, 3)] {
        let model = on(1, rows, parts).unwrap();
        for threads in [2, 3] {
            assert_eq!(on(threads, rows, parts).unwrap(), model);
        }
        let sequential = params.fit_chunks(chunks(rows)).unwrap();
        assert_same_fit(&model, &sequential, &x, "parts");
    }
    // Errors: no parts, too many, none of the chunks, the reader's, a chunk's.
    assert!(matches!(
        on(1, 30, 0),
        Err(Error::Parameter { name: "parts", .. })
    ));
    assert!(matches!(on(1, 30, usize::MAX), Err(Error::TooLarge { .. })));
    let nothing = std::iter::empty::<Result<(Array2<f64>, Array2<f64>), Error>>();
    assert!(matches!(
        params.fit_chunks_parallel(nothing, 2),
        Err(Error::Empty { what: "chunks", .. })
    ));
    let broken = Error::NoConvergence { what: "reading" };
    let all = chunks(30).take(3).chain([Err(broken.clone())]);
    assert_eq!(params.fit_chunks_parallel(all, 2), Err(broken));
    let mut bad = (x.clone(), t.clone());
    bad.1[[3, 1]] = f64::NAN;
    let all = chunks(30).take(3).chain([Ok(bad)]);
    assert!(matches!(
        params.fit_chunks_parallel(all, 2),
        Err(Error::NotFinite {
            what: "targets",
            row: 3,
            column: 1
        })
    ));
}

#[test]
fn an_accumulator_survives_serialization() {
    let (x, t) = data::<f64>(200, 15);
    let params = ElmParams::new(10).with_solver(Ridge::gcv());
    let accumulator = accumulated(&params, &x, &t, 60);
    let text = serde_json::to_string(&accumulator).unwrap();
    let read: Accumulator<f64> = serde_json::from_str(&text).unwrap();
    assert_same_fit(
        &read.fit().unwrap(),
        &accumulator.fit().unwrap(),
        &x,
        "read back",
    );
}

#[test]
fn single_precision_accumulates_too() {
    let (x, t) = data::<f32>(300, 16);
    for solver in [Ridge::relative(1e-3), Ridge::gcv()] {
        let params = ElmParams::new(10).with_solver(solver);
        let model = accumulated(&params, &x, &t, 17).fit().unwrap();
        assert_same_fit(&model, &params.fit(&x, &t).unwrap(), &x, "f32");
    }
}

#[test]
fn a_damaged_accumulator_is_not_read() {
    let (x, t) = data::<f64>(200, 15);
    let params = ElmParams::new(4).with_solver(Ridge::gcv());
    let whole = serde_json::to_value(accumulated(&params, &x, &t, 60)).unwrap();
    let read = |value: &serde_json::Value| {
        serde_json::from_value::<Accumulator<f64>>(value.clone()).is_ok()
    };
    assert!(read(&whole));
    for (field, value) in [
        ("/outputs", serde_json::json!(1)),
        ("/outputs", serde_json::json!(u64::MAX)),
        ("/inputs", serde_json::json!(2)),
        ("/map/direct_links", serde_json::json!(true)),
        ("/intercept", serde_json::json!(false)),
        ("/pending", serde_json::json!([1.0])),
        ("/pending", serde_json::json!(vec![0.5; 7 * 28])),
        (
            "/map/scaler",
            serde_json::json!({"mean": {"v": 1, "dim": [1], "data": [0.0]},
                                      "factor": {"v": 1, "dim": [1], "data": [0.0]}}),
        ),
        (
            "/scales",
            serde_json::json!({"v": 1, "dim": [1], "data": [1.0]}),
        ),
        (
            "/scales",
            serde_json::json!({"v": 1, "dim": [7], "data": vec![0.0; 7]}),
        ),
        // Of six columns, not of seven; and no triangle.
        ("/kept", serde_json::json!(vec![0.0; 21])),
        ("/kept", serde_json::json!(vec![0.0; 27])),
        (
            "/solver",
            serde_json::json!({"ridge": {"lambda": {"relative": -1.0}, "shared": false}}),
        ),
    ] {
        let mut damaged = whole.clone();
        *damaged.pointer_mut(field).unwrap() = value;
        assert!(!read(&damaged), "{field}: {:?}", damaged.pointer(field));
    }
    // Zeros are well formed, and have no mean, be they a triangle or sums of products.
    for lambda in [
        serde_json::json!("gcv"),
        serde_json::json!({"relative": 0.1}),
    ] {
        let mut empty = whole.clone();
        empty["kept"] = serde_json::json!(vec![0.0; 28]);
        empty["pending"] = serde_json::json!([]);
        empty["solver"]["ridge"]["lambda"] = lambda;
        let empty: Accumulator<f64> = serde_json::from_value(empty).unwrap();
        assert!(matches!(empty.fit(), Err(Error::Overflow { .. })));
    }
}

#[test]
fn sums_of_products_lose_no_digits_to_means_that_move() {
    let (mut x, _) = data::<f64>(3000, 18);
    // In the order of an input, so that the first rows are unlike the rest.
    let mut column = x.column(0).to_vec();
    column.sort_by(f64::total_cmp);
    x.column_mut(0).assign(&Array1::from(column));
    let t = x.map_axis(Axis(1), |row| 1e6 + row[0] + (row[1] * row[2]).sin());
    let t = t.insert_axis(Axis(1));
    // As weak as is allowed: output weights, and with them what they add to the mean, may be off by epsilon
    // over the strength. Of uncentered sums rounding would be a share of 10^6 instead.
    let lambda = 3e-8;
    let params = ElmParams::new(30).with_solver(Ridge::relative(lambda));
    let batch = params.fit(&x, &t).unwrap().predict(&x).unwrap();
    let bound = f64::EPSILON / lambda * frobenius(&(&batch - t.mean().unwrap()));
    let assert_same = |model: &Elm<f64>, what: &str| {
        let error = frobenius(&(model.predict(&x).unwrap() - &batch));
        assert!(error <= bound, "{what}: {error:e} > {bound:e}");
    };
    for chunk in [7, 500] {
        let whole = accumulated(&params, &x, &t, chunk).fit().unwrap();
        assert_eq!(whole.diagnosis().route, Route::Gram);
        assert_same(&whole, "in order");
        let empty = Accumulator::from_sample(&params, &x, 1).unwrap();
        let mut parts = vec![empty.clone(), empty];
        for (place, range) in [0..2500, 2500..3000].into_iter().enumerate() {
            let range = s![range, ..];
            parts[place].push(&x.slice(range), &t.slice(range)).unwrap();
            parts[place].compact().unwrap();
        }
        let [mut first, second] = <[_; 2]>::try_from(parts).unwrap();
        first.merge(&second).unwrap();
        assert_same(&first.fit().unwrap(), "merged");
    }
}
