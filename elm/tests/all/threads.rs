//! The number of threads changes no digit, whatever a call does.

use elm::cross_validation::{CrossValidator, assign_folds};
use elm::solve::{LeastSquares, Ridge};
use elm::{Accumulator, Dataset, ElmParams, on_threads};
use ndarray::{Array1, Array2, Axis, Ix1, s};

/// Rows of a smooth function, with what looks like noise.
fn rows(rows: usize, inputs: usize) -> (Array2<f64>, Array1<f64>) {
    let value = |i: usize, j: usize| ((i * (2 * j + 3)) as f64 * 0.618_034).sin();
    let x = Array2::from_shape_fn((rows, inputs), |(i, j)| value(i, j) + value(i, j + 9) / 3.0);
    let t = x.map_axis(Axis(1), |row| row[0] * row[1] + (2.0 * row[2]).sin());
    let noise = Array1::from_shape_fn(rows, |i| 0.1 * value(i, 77));
    (x, t + noise)
}

/// What `work` gives on 1, 2, 3 and 5 threads, which must be the same.
fn same<R: PartialEq + std::fmt::Debug + Send>(what: &str, work: impl Fn() -> R + Sync) {
    same_on(&[2, 3, 5], what, work);
}

fn same_on<R: PartialEq + std::fmt::Debug + Send>(
    numbers: &[usize],
    what: &str,
    work: impl Fn() -> R + Sync,
) {
    let alone = on_threads(1, &work).unwrap();
    for &threads in numbers {
        assert!(
            on_threads(threads, &work).unwrap() == alone,
            "{what} on {threads} threads"
        );
    }
}

#[test]
fn fits_are_the_same_bits() {
    let (x, t) = rows(6000, 5);
    let single = (x.mapv(|v| v as f32), t.mapv(|v| v as f32));
    let weights = Array1::from_shape_fn(6000, |i| 0.5 + (i % 3) as f64);
    let weighted = Dataset::new(&x, &t)
        .unwrap()
        .with_weights(&weights)
        .unwrap();
    for (what, solver) in [
        ("leave-one-out", Ridge::leave_one_out()),
        ("gcv", Ridge::gcv()),
        ("a strong ridge", Ridge::relative(1e-3)),
        ("a weak ridge", Ridge::relative(1e-12)),
    ] {
        let params = ElmParams::new(150).with_solver(solver);
        same(what, || params.fit(&x, &t).unwrap());
        same(what, || params.fit_dataset(&weighted).unwrap());
        let params = ElmParams::<f32>::new(150).with_solver(solver);
        same(what, || params.fit(&single.0, &single.1).unwrap());
    }
    // Nearly linear neurons: sums of products do not do, and the triangle decides.
    let steep = ElmParams::new(150).with_scale(0.01);
    same("an ill-conditioned layer", || steep.fit(&x, &t).unwrap());
    // Fewer rows for each neuron: from the matrix.
    let few = (
        x.slice(s![..1000, ..]).to_owned(),
        t.slice(s![..1000]).to_owned(),
    );
    let wide = ElmParams::new(400);
    same("many neurons", || wide.fit(&few.0, &few.1).unwrap());
}

#[test]
fn what_is_built_on_fits_is_the_same_bits() {
    let (x, t) = rows(5000, 4);
    let few = (
        x.slice(s![..700, ..]).to_owned(),
        t.slice(s![..700]).to_owned(),
    );
    let data = Dataset::new(&few.0, &few.1).unwrap();
    let params = ElmParams::new(80);
    // Of what searches are made of most is compared on more threads by itself.
    same_on(&[3], "the quick search", || {
        ElmParams::auto()
            .quick()
            .with_budget(30)
            .fit(&few.0, &few.1)
            .unwrap()
    });
    same_on(&[3], "the full search", || {
        let tuner = ElmParams::auto().with_max_neurons(200);
        tuner.tune(&data).unwrap().model
    });
    same("uncertainty", || {
        let model = params.fit_uncertain(&data).unwrap();
        (
            model.predict_deviation(&x).unwrap(),
            model.predict_interval(&x, 0.9).unwrap(),
        )
    });
    let folds = assign_folds(700, 5, 1).unwrap();
    same("folds", || {
        params
            .cross_val_predict(&data, &folds)
            .unwrap()
            .predictions()
            .to_owned()
    });
    let hidden = params
        .fit(&few.0, &few.1)
        .unwrap()
        .hidden_matrix(&x)
        .unwrap();
    let targets = t.view().insert_axis(Axis(1)).to_owned();
    let problem = LeastSquares::new(&hidden, &targets).unwrap();
    same("a strength", || {
        let validator = CrossValidator::new(&problem).unwrap();
        validator.select_lambda(Ridge::leave_one_out()).unwrap()
    });
    let labels: Vec<u8> = t
        .iter()
        .map(|t| u8::from(*t > 0.0) + u8::from(*t > 0.8))
        .collect();
    same("classes", || {
        let model = params.fit_classifier(&x, &labels).unwrap();
        model.predict_proba(&x).unwrap()
    });
    let model = params.fit(&x, &t).unwrap();
    same("predictions", || model.predict(&x).unwrap());
    let sample = x.slice(s![..500, ..]).to_owned();
    let params = ElmParams::new(40);
    same("accumulation", || {
        let mut sum = Accumulator::<f64, Ix1>::from_sample(&params, &sample, 1).unwrap();
        sum.push(&x, &t).unwrap();
        sum.push(&few.0, &few.1).unwrap();
        sum.fit().unwrap()
    });
}
