//! Tuning: what it chooses is near the best there is, repeats itself, and keeps its budget.

use elm::tune::Criterion;
use elm::{Activation, Dataset, ElmParams, Error, metrics};
use ndarray::{Array1, Array2, Axis, Ix1, array};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::{StandardNormal, StandardUniform};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A wave in the first of three inputs, with a little noise; the others say nothing.
fn wave(rows: usize, seed: u64) -> (Array2<f64>, Array1<f64>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let x: Array2<f64> = Array2::random_using((rows, 3), StandardUniform, &mut random);
    let noise: Array1<f64> = Array1::random_using(rows, StandardNormal, &mut random);
    let t = x.column(0).mapv(|x| (9.0 * x).sin()) + 0.05 * noise;
    (x, t)
}

fn rmse(model: &elm::Elm<f64, Ix1>, (x, t): &(Array2<f64>, Array1<f64>)) -> f64 {
    metrics::rmse(&model.predict(x).unwrap(), t).unwrap()
}

#[test]
fn the_chosen_scale_is_nearly_as_good_as_the_best_of_a_dense_grid() {
    let (train, test) = (wave(250, 1), wave(1000, 2));
    let params = || {
        ElmParams::new(80)
            .with_activation(Activation::Tanh)
            .with_seed(3)
    };
    let tuned = params()
        .tuner()
        .tune(&Dataset::new(&train.0, &train.1).unwrap())
        .unwrap();
    let best = (-8..=8)
        .map(|step| {
            let scale = 10.0_f64.powf(f64::from(step) / 5.0);
            rmse(
                &params().with_scale(scale).fit(&train.0, &train.1).unwrap(),
                &test,
            )
        })
        .fold(f64::INFINITY, f64::min);
    let chosen = rmse(&tuned.model, &test);
    assert!(chosen <= 1.1 * best, "{chosen} against {best}");
}

#[test]
fn a_scale_per_input_silences_inputs_that_say_nothing() {
    let (train, test) = (wave(250, 1), wave(1000, 2));
    let tuner = ElmParams::new(80).with_activation(Activation::Tanh).tuner();
    let shared = tuner
        .tune(&Dataset::new(&train.0, &train.1).unwrap())
        .unwrap();
    let own = tuner
        .with_per_input(true)
        .with_budget(60)
        .tune(&Dataset::new(&train.0, &train.1).unwrap())
        .unwrap();
    let scales = &own.best.input_scales;
    assert!(
        scales[0] > 3.0 * scales[1] && scales[0] > 3.0 * scales[2],
        "{scales:?}"
    );
    assert!(rmse(&own.model, &test) < 0.8 * rmse(&shared.model, &test));
}

#[test]
fn a_simple_problem_gets_few_neurons() {
    let (x, _) = wave(400, 5);
    // A straight line needs few; noise is no reason for more.
    let noise: Array1<f64> =
        Array1::random_using(400, StandardNormal, &mut ChaCha8Rng::seed_from_u64(6));
    let straight = x.column(0).mapv(|x| 3.0 * x) + 0.1 * noise;
    let line = ElmParams::auto()
        .tune(&Dataset::new(&x, &straight).unwrap())
        .unwrap();
    assert!(line.best.neurons <= 200, "{}", line.best.neurons);
    assert_eq!(line.model.hidden().neurons(), line.best.neurons);
    // Many waves need many.
    let waves = x.column(0).mapv(|x| (150.0 * x).sin());
    let x = x.select(Axis(1), &[0]);
    let waves = ElmParams::auto()
        .tune(&Dataset::new(&x, &waves).unwrap())
        .unwrap();
    assert!(
        waves.best.neurons > line.best.neurons,
        "{}",
        waves.best.neurons
    );
}

#[test]
fn a_smooth_function_without_noise_is_left_to_the_exact_search() {
    let x = Array2::from_shape_fn((300, 2), |(row, column)| {
        (row as f64 * [0.618_034, 0.414_214][column]).fract()
    });
    let t: Array1<f64> = x.outer_iter().map(|x| (6.0 * x[0]).sin() * x[1]).collect();
    let data = Dataset::new(&x, &t).unwrap();
    let tuned = ElmParams::auto().tune(&data).unwrap();
    let quick = ElmParams::auto().quick().tune(&data).unwrap();
    assert_eq!(tuned.model, quick.model);
    assert!(tuned.trials.len() > quick.trials.len());
    let left_out = tuned.model.diagnosis().leave_one_out.as_ref().unwrap()[0];
    assert!(left_out < 1e-6, "{left_out}");
}

#[test]
fn a_seed_repeats_the_search_and_the_budget_bounds_it() {
    let (x, t) = wave(120, 1);
    for budget in [1, 5, 12] {
        let tuner = ElmParams::auto()
            .with_seed(9)
            .with_budget(budget)
            .with_search_rows(100);
        let first = tuner.tune(&Dataset::new(&x, &t).unwrap()).unwrap();
        assert_eq!(first, tuner.tune(&Dataset::new(&x, &t).unwrap()).unwrap());
        assert!(first.trials.len() <= budget);
        assert!(first.trials.contains(&first.best));
    }
}

#[test]
fn the_final_fit_is_that_of_the_reported_settings() {
    let (x, t) = wave(120, 1);
    let tuned = ElmParams::auto()
        .tune(&Dataset::new(&x, &t).unwrap())
        .unwrap();
    assert_eq!(tuned.params.fit(&x, &t).unwrap(), tuned.model);
    assert_eq!(ElmParams::auto().fit(&x, &t).unwrap(), tuned.model);
}

#[test]
fn k_fold_sees_through_rows_that_are_copies_of_each_other() {
    let (x, t) = wave(60, 1);
    let twice = |a: &Array2<f64>| ndarray::concatenate(Axis(0), &[a.view(), a.view()]).unwrap();
    let (x, t) = (twice(&x), twice(&t.insert_axis(Axis(1))));
    let k_fold = ElmParams::auto()
        .with_criterion(Criterion::KFold(5))
        .tune(&Dataset::new(&x, &t).unwrap())
        .unwrap();
    let one_out = ElmParams::auto()
        .tune(&Dataset::new(&x, &t).unwrap())
        .unwrap();
    // With its copy still there a row is easily predicted.
    assert!(one_out.best.score < k_fold.best.score);
}

#[test]
fn extreme_but_finite_data_are_tuned_without_harm() {
    for (x, t) in [
        (array![[1.0]], array![2.0]),
        (array![[1.0], [2.0]], array![1.0, 1.0]),
        (Array2::zeros((20, 3)), Array1::zeros(20)),
        (
            Array2::from_elem((20, 2), 1e300),
            Array1::linspace(-1e300, 1e300, 20),
        ),
        (
            Array1::linspace(0.0, 1e-310, 20).insert_axis(Axis(1)),
            Array1::linspace(0.0, 1e-310, 20),
        ),
    ] {
        let model = ElmParams::auto().fit(&x, &t).unwrap();
        assert!(
            model
                .predict(&x)
                .unwrap()
                .iter()
                .all(|y: &f64| y.is_finite())
        );
    }
}

#[test]
fn bad_settings_are_named() {
    let (x, t) = wave(30, 1);
    let refuse = |tuner: elm::Tuner<f64>| tuner.fit(&x, &t).unwrap_err();
    for (tuner, expected) in [
        (ElmParams::auto().with_budget(0), "budget"),
        (ElmParams::auto().with_max_neurons(0), "max_neurons"),
        (ElmParams::auto().with_search_rows(1), "search_rows"),
        (
            ElmParams::auto().with_criterion(Criterion::KFold(1)),
            "folds",
        ),
        (
            ElmParams::auto().with_criterion(Criterion::KFold(31)),
            "folds",
        ),
        (ElmParams::new(0).tuner(), "neurons"),
    ] {
        let error = refuse(tuner);
        assert!(
            matches!(error, Error::Parameter { name, .. } if name == expected),
            "{error}"
        );
    }
    let nan = ElmParams::auto()
        .fit(&array![[f64::NAN]], &array![1.0])
        .unwrap_err();
    assert!(matches!(
        nan,
        Error::NotFinite {
            what: "inputs",
            row: 0,
            column: 0
        }
    ));
}

/// RMSE on test rows of the best of a grid of scales and strengths, chosen with the test rows in
/// sight, for 200 neurons like those of `auto` but with one scale for all inputs.
fn best_of_grid(
    params: &ElmParams<f64>,
    (x, t): &(Array2<f64>, Array1<f64>),
    test: &(Array2<f64>, Array1<f64>),
) -> f64 {
    let center = (x.ncols() as f64).sqrt().recip();
    let mut best = f64::INFINITY;
    for step in -4..=4 {
        let params = params
            .clone()
            .with_scale(center * 10.0_f64.powf(f64::from(step) / 3.0));
        for strength in -7..=0 {
            let ridge = elm::solve::Ridge::relative(10.0_f64.powi(strength));
            let model = params.clone().with_solver(ridge).fit(x, t).unwrap();
            best = best.min(rmse(&model, test));
        }
    }
    best
}

#[test]
fn on_the_toy_problems_auto_and_the_tuner_are_within_a_tenth_of_the_best_of_a_dense_grid() {
    use elm_datasets::toy;
    type Draw = fn(usize, f64, u64) -> Result<toy::Toy, elm_datasets::Error>;
    let problems: [(&str, Draw, f64); 4] = [
        ("sinc", toy::sinc, 0.1),
        ("Friedman 1", toy::friedman1, 1.0),
        ("Friedman 2", toy::friedman2, 125.0),
        ("Friedman 3", toy::friedman3, 0.1),
    ];
    for (seed, (name, draw, noise)) in (1..).zip(problems) {
        let data = |rows, seed| {
            let toy = draw(rows, noise, seed).unwrap();
            (toy.inputs, toy.targets.column(0).to_owned())
        };
        let (train, test) = (data(300, seed), data(1000, seed + 1000));
        let given = ElmParams::new(200)
            .with_activation(Activation::Tanh)
            .with_biases(elm::Biases::AtTrainingRows)
            .with_seed(seed);
        let best = best_of_grid(&given, &train, &test);
        for (subject, tuner) in [
            ("auto", ElmParams::auto().with_seed(seed)),
            ("tuner", given.tuner()),
        ] {
            let ratio = rmse(&tuner.fit(&train.0, &train.1).unwrap(), &test) / best;
            assert!(ratio <= 1.1, "{subject}, {name}: {ratio}");
        }
    }
}

#[test]
fn weights_leave_as_many_neurons_as_are_needed() {
    let (x, _) = wave(400, 5);
    let x = x.select(Axis(1), &[0]);
    let waves = x.column(0).mapv(|x| (150.0 * x).sin());
    // No whole multiples of each other, so that no errors of rows left out are reported.
    let weights = Array1::from_shape_fn(400, |row| 1.0 + 0.001 * (row as f64).sqrt());
    let data = Dataset::new(&x, &waves).unwrap();
    let data = data.with_weights(&weights).unwrap();
    let tuned = ElmParams::auto().tune(&data).unwrap();
    assert!(tuned.best.neurons > 200, "{}", tuned.best.neurons);
}
