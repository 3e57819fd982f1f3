//! Predictions outside the training rows.

use crate::common::normal;
use elm::bounds::MARGIN;
use elm::solve::Ridge;
use elm::{Accumulator, Dataset, Elm, ElmParams, Error, Scalar, metrics, persist, prune::Keep};
use ndarray::{Array1, Array2, Axis, Ix1, array, s};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::Uniform;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Uniform inputs in [-1, 1].
fn cube(rows: usize, inputs: usize, seed: u64) -> Array2<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    Array2::random_using((rows, inputs), Uniform::new(-1.0, 1.0).unwrap(), &mut rng)
}

fn wave(x: &Array2<f64>) -> Array1<f64> {
    x.column(0).mapv(|x| (3.0 * x).sin())
}

fn noisy_wave(rows: usize, seed: u64) -> (Array2<f64>, Array1<f64>) {
    let x = cube(rows, 3, seed);
    let noise = normal::<f64>(rows, 1, seed + 1).remove_axis(Axis(1));
    let t = wave(&x) + noise.mapv(|v| 0.1 * v);
    (x, t)
}

/// The range that predictions may have by the documentation.
fn allowed(t: &Array1<f64>) -> (f64, f64) {
    let (least, greatest) = t
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), &v| (a.min(v), b.max(v)));
    let margin = MARGIN * (greatest - least);
    (least - margin - 1e-12, greatest + margin + 1e-12)
}

#[test]
fn a_default_model_does_not_explode_outside_the_data() {
    let (x, t) = noisy_wave(300, 1);
    let test = cube(2000, 3, 9);
    let (least, greatest) = allowed(&t);
    for model in [
        ElmParams::auto().fit(&x, &t).unwrap(),
        ElmParams::new(100).fit(&x, &t).unwrap(),
    ] {
        for stretch in [1.0, 1.2, 2.0, 3.0, 50.0, 1e300] {
            let y = model.predict(&test.mapv(|x| x * stretch)).unwrap();
            assert!(y.iter().all(|y| (least..=greatest).contains(y)));
        }
        // Of a function within 1 and noise of 0.1.
        for stretch in [1.2, 1.5] {
            let stretched = test.mapv(|x| x * stretch);
            let y = model.predict(&stretched).unwrap();
            let error = metrics::rmse(&y, &wave(&stretched)).unwrap();
            assert!(error < 0.7, "{stretch}: {error}");
        }
    }
}

#[test]
fn inside_the_data_the_bound_changes_nothing() {
    let (x, t) = noisy_wave(100, 3);
    let held = ElmParams::new(30).fit(&x, &t).unwrap();
    let free = ElmParams::new(30).with_bounded(false).fit(&x, &t).unwrap();
    assert_eq!(held.predict(&x).unwrap(), free.predict(&x).unwrap());
    assert_eq!(
        held.hidden_matrix(&x).unwrap(),
        free.hidden_matrix(&x).unwrap()
    );
    assert_eq!(held.diagnosis(), free.diagnosis());
}

#[test]
fn beyond_an_edge_a_prediction_is_that_at_the_edge() {
    let x = array![[0.0, 5.0], [1.0, 6.0], [2.0, 9.0], [3.0, 7.0], [1.5, 8.0]];
    let t = array![[0.0, 1.0], [1.0, 4.0], [0.5, 2.0], [2.0, 2.0], [1.0, 0.0]];
    let model = ElmParams::new(12).fit(&x, &t).unwrap();
    let outside = array![[-7.0, 6.0], [1.0, 1e9], [4.0, -1e9]];
    // A two-hundredth of the range beyond the last values.
    let (lower, upper) = model.bounds().unwrap().held_inputs();
    approx::assert_relative_eq!(lower, array![-0.015, 4.98], max_relative = 1e-14);
    approx::assert_relative_eq!(upper, array![3.015, 9.02], max_relative = 1e-14);
    let edge = array![[lower[0], 6.0], [1.0, upper[1]], [upper[0], lower[1]]];
    let at_edge = model.predict(&edge).unwrap();
    assert_eq!(model.predict(&outside).unwrap(), at_edge);
    let predictor = model.predictor();
    for (row, expected) in outside.rows().into_iter().zip(at_edge.rows()) {
        let mut y = [0.0; 2];
        let row = row.to_vec();
        let scratch = &mut predictor.scratch();
        predictor.predict_row(&row, &mut y, scratch).unwrap();
        assert_eq!(expected.to_vec(), y);
    }
    // Switched off after the fit it is the sum of the neurons.
    let free = model.clone().with_bounded(false);
    let by_hand = free.hidden_matrix(&outside).unwrap().dot(&free.beta()) + free.intercept();
    approx::assert_relative_eq!(
        free.predict(&outside).unwrap(),
        by_hand,
        max_relative = 1e-10
    );
    assert_eq!(
        free.with_bounded(true).predict(&outside).unwrap(),
        model.predict(&outside).unwrap()
    );
}

#[test]
fn the_distance_from_the_data_is_told_in_standard_deviations() {
    let x = array![[0.0, 5.0, 1.0], [1.0, 6.0, 1.0], [2.0, 7.0, 1.0]];
    let model = ElmParams::new(4).fit(&x, &array![0.0, 1.0, 1.0]).unwrap();
    // Deviations are twice the root of 2 / 3, and none.
    let rows = array![[1.0, 6.0, 1.0], [5.0, 6.0, 1.0], [-3.0, 11.0, 7.0]];
    let distance = model.distance_outside(&rows).unwrap();
    let expected = array![0.0, 3.0, 5.0] / (2.0_f64 / 3.0).sqrt();
    approx::assert_relative_eq!(distance, expected, max_relative = 1e-14);
    let given = <Elm<f64>>::from_parts(
        model.map().clone(),
        model.beta().to_owned(),
        model.intercept().to_owned(),
    );
    assert!(matches!(
        given.unwrap().distance_outside(&rows),
        Err(Error::Conflict { .. })
    ));
    assert_eq!(
        model
            .distance_outside(&rows.slice(s![..0, ..]))
            .unwrap()
            .len(),
        0
    );
}

fn bounds_travel<A: Scalar>() {
    let x = normal::<A>(60, 2, 5);
    let t = x.map_axis(Axis(1), |row| row[0] * row[1]);
    let params = ElmParams::new(15).with_solver(Ridge::gcv());
    let model = params.fit(&x, &t).unwrap();
    let far = normal::<A>(40, 2, 6).mapv(|v| v * A::from_f64(30.0));
    let expected = model.predict(&far).unwrap();
    for again in [
        persist::from_bytes::<Elm<A, Ix1>>(&persist::to_bytes(&model).unwrap()).unwrap(),
        persist::from_bytes(persist::to_json(&model).unwrap().as_bytes()).unwrap(),
    ] {
        assert_eq!(again.predict(&far).unwrap(), expected);
    }
    let mut one = Accumulator::from_sample(&params, &x, 1).unwrap();
    let mut other = one.clone();
    one.push(&x.slice(s![..20, ..]), &t.slice(s![..20]))
        .unwrap();
    other
        .push(&x.slice(s![20.., ..]), &t.slice(s![20..]))
        .unwrap();
    one.merge(&other).unwrap();
    let one =
        persist::from_bytes::<Accumulator<A, Ix1>>(&persist::to_bytes(&one).unwrap()).unwrap();
    assert_eq!(one.fit().unwrap().bounds(), model.bounds());
    let pruned = params
        .fit_pruned(&Dataset::new(&x, &t).unwrap(), Keep::Neurons(5))
        .unwrap();
    assert_eq!(pruned.model.bounds(), model.bounds());
    let mean = params
        .fit_ensemble(2, &Dataset::new(&x, &t).unwrap())
        .unwrap();
    assert_eq!(mean.model().bounds(), model.bounds());
}

#[test]
fn bounds_are_part_of_files_accumulators_pruned_networks_and_ensembles() {
    bounds_travel::<f64>();
    bounds_travel::<f32>();
}

#[test]
fn a_skewed_input_just_beyond_its_largest_value_is_predicted_sanely() {
    // Incomes: x = exp(6.8 + 0.45 z), t = 80 + x / 2 + noise in proportion to x.
    for draw in 0..40 {
        let z = normal::<f64>(176, 2, 100 + draw);
        let x = z.column(0).mapv(|z| (6.8 + 0.45 * z).exp());
        let t = Array1::from_iter(
            x.iter()
                .zip(z.column(1))
                .map(|(x, z)| 80.0 + x / 2.0 + 0.06 * x * z),
        );
        let largest = x.fold(0.0, |m: f64, x| m.max(*x));
        let x = x.insert_axis(Axis(1));
        let beyond = array![[1.05 * largest]];
        let truth = 80.0 + beyond[[0, 0]] / 2.0;
        for model in [
            ElmParams::auto().fit(&x, &t).unwrap(),
            ElmParams::new(100).fit(&x, &t).unwrap(),
        ] {
            let y = model.predict(&beyond).unwrap()[0];
            assert!(
                (y - truth).abs() < 0.5 * truth,
                "draw {draw}: {y} for {truth}"
            );
        }
    }
}

#[test]
fn intervals_and_deviations_widen_outside_the_data() {
    let (mut covered, mut rows) = (0, 0);
    for seed in 0..6 {
        let (x, t) = noisy_wave(200, 20 + 2 * seed);
        let model = ElmParams::new(60)
            .fit_uncertain(&Dataset::new(&x, &t).unwrap())
            .unwrap();
        let mut test = noisy_wave(500, 90 + 2 * seed);
        let noise = test.1 - wave(&test.0);
        test.0 *= 1.2;
        let observed = wave(&test.0) + noise;
        let (low, high) = model.predict_interval(&test.0, 0.9).unwrap();
        rows += observed.len();
        covered += observed
            .iter()
            .zip(&low)
            .zip(&high)
            .filter(|((t, low), high)| low <= t && t <= high)
            .count();
        // Along a line outwards both grow with the distance.
        let line =
            Array2::from_shape_fn((4, 3), |(i, j)| if j == 0 { 1.0 + i as f64 } else { 0.0 });
        let deviation = model.predict_deviation(&line).unwrap();
        let (low, high) = model.predict_interval(&line, 0.9).unwrap();
        let width = high - low;
        for i in 1..4 {
            assert!(deviation[i] > deviation[i - 1]);
            assert!(width[i] > width[i - 1]);
        }
    }
    let share = covered as f64 / rows as f64;
    assert!(share > 0.9, "{share}");
}

#[test]
fn leave_one_out_of_skewed_inputs_has_bounded_output_weights() {
    // Of strengths with equally good errors the strongest: never weaker than by the smallest error.
    for draw in 0..10 {
        let z = normal::<f64>(176, 2, 200 + draw);
        let x = z.slice(s![.., ..1]).mapv(|z| (6.8 + 0.45 * z).exp());
        let t = x.column(0).mapv(|x| 80.0 + x / 2.0) + 0.06 * &x.column(0) * z.column(1);
        let params = ElmParams::new(100);
        let model = params.fit(&x, &t).unwrap();
        let hidden = model.hidden_matrix(&x).unwrap();
        let targets = t.insert_axis(Axis(1));
        let problem = elm::solve::LeastSquares::new(&hidden, &targets).unwrap();
        let validator =
            elm::cross_validation::CrossValidator::new(&problem.with_intercept(true)).unwrap();
        let path = validator.leave_one_out_path(&Ridge::lambda_grid()).unwrap();
        let scores = path.rmse().column(0).to_owned();
        let smallest = scores.iter().copied().fold(f64::INFINITY, f64::min);
        let found = model.diagnosis().leave_one_out.as_ref().unwrap()[0];
        assert!(
            found <= smallest * 1.01_f64.sqrt() * (1.0 + 1e-6),
            "{found} {smallest}"
        );
    }
}
