//! Pruned networks: what is kept, by how much it beats chance, and that its error is as stated.

use elm::advanced::FeatureMap;
use elm::prune::{Keep, Pruned};
use elm::solve::{Inverse, PseudoInverse, Ridge};
use elm::{Activation, Biases, Dataset, Elm, ElmParams, Error, NeuronGroup, Scaler, metrics};
use elm_datasets::toy::{self, Toy};
use ndarray::{Array1, Array2, Axis, Ix1, array, s};

/// Smooth, of four inputs.
fn smooth(rows: usize, seed: u64) -> (Array2<f64>, Array1<f64>) {
    let x = toy::friedman2(rows, 0.0, seed).unwrap().inputs;
    let scale = array![0.02, 0.002, 2.0, 0.2];
    let x = x * scale;
    let t = x.map_axis(Axis(1), |x| {
        x[0].sin() * (-x[1]).exp() + (x[2] + x[3]).cos()
    });
    (x, t)
}

fn params(neurons: usize, seed: u64) -> ElmParams<f64> {
    ElmParams::new(neurons)
        .with_activation(Activation::Tanh)
        .with_biases(Biases::AtTrainingRows)
        .with_scale(0.4)
        .with_seed(seed)
}

fn rmse(model: &Elm<f64, Ix1>, (x, t): &(Array2<f64>, Array1<f64>)) -> f64 {
    metrics::rmse(&model.predict(x).unwrap(), t).unwrap()
}

#[test]
fn so_many_pruned_neurons_beat_as_many_random_ones_on_rows_held_out() {
    let test = smooth(1000, 99);
    for seed in 0..3 {
        let (x, t) = smooth(400, seed);
        let pruned = params(200, seed)
            .fit_pruned(&Dataset::new(&x, &t).unwrap(), Keep::Neurons(25))
            .unwrap();
        let random = params(25, seed).fit(&x, &t).unwrap();
        assert_eq!(pruned.model.hidden().neurons(), 25);
        let (pruned, random) = (rmse(&pruned.model, &test), rmse(&random, &test));
        assert!(pruned < 0.5 * random, "{pruned} against {random}");
    }
}

#[test]
fn the_neurons_kept_are_those_drawn_and_the_network_is_the_ordinary_fit_to_them() {
    let (x, t) = smooth(150, 1);
    let mixed = params(30, 4)
        .with_group(NeuronGroup::new(20, Activation::Sine))
        .with_group(NeuronGroup::rbf(20))
        .with_direct_links(true);
    let all = mixed.fit(&x, &t).unwrap();
    let Pruned { model, kept, .. } = mixed
        .fit_pruned(&Dataset::new(&x, &t).unwrap(), Keep::Neurons(18))
        .unwrap();
    assert!(kept.is_sorted() && kept.len() == 18);
    assert_eq!(
        model.hidden().weights(),
        all.hidden().weights().select(Axis(1), &kept)
    );
    let links = 70..74;
    let columns: Vec<usize> = kept.iter().copied().chain(links).collect();
    assert_eq!(
        model.hidden_matrix(&x).unwrap(),
        all.hidden_matrix(&x).unwrap().select(Axis(1), &columns)
    );
    let h = model.hidden_matrix(&x).unwrap();
    let t = t.insert_axis(Axis(1));
    let problem = elm::solve::LeastSquares::new(&h, &t)
        .unwrap()
        .with_intercept(true);
    let solution = elm::solve::Solver::from(Ridge::default())
        .solve(&problem)
        .unwrap();
    // The same fit, to rounding: the weights themselves are ill conditioned.
    let fitted = h.dot(&solution.beta) + &solution.intercept;
    let predicted = model.predict(&x).unwrap();
    approx::assert_abs_diff_eq!(predicted, fitted.column(0), epsilon = 1e-9);
}

#[test]
fn the_scores_of_all_sizes_are_those_of_leave_one_out_at_that_strength() {
    // The absolute strength is one for all sizes: relative to the whole layer's.
    let Toy {
        inputs, targets, ..
    } = toy::friedman2(60, 100.0, 1).unwrap();
    let lambda = 1e-4;
    let params = params(12, 2).with_solver(Ridge::relative(lambda));
    let all = params.fit(&inputs, &targets).unwrap();
    let absolute = lambda * all.diagnosis().largest_singular_value.powi(2);
    let pruned = params
        .fit_pruned(&Dataset::new(&inputs, &targets).unwrap(), Keep::Loss(0.0))
        .unwrap();
    assert_eq!(pruned.path.len(), 12);
    let spread = targets.std(0.0);
    for size in &pruned.path {
        let kept = params
            .fit_pruned(
                &Dataset::new(&inputs, &targets).unwrap(),
                Keep::Neurons(size.neurons),
            )
            .unwrap();
        let largest = kept.model.diagnosis().largest_singular_value.powi(2);
        let h = kept.model.hidden_matrix(&inputs).unwrap();
        let problem = elm::solve::LeastSquares::new(&h, &targets)
            .unwrap()
            .with_intercept(true);
        let validator = elm::cross_validation::CrossValidator::new(&problem).unwrap();
        let expected = validator
            .leave_one_out(&[absolute / largest])
            .unwrap()
            .rmse()[0]
            / spread;
        approx::assert_relative_eq!(size.score, expected, max_relative = 1e-9);
        approx::assert_relative_eq!(kept.path[0].score, expected, max_relative = 1e-9);
    }
}

#[test]
fn each_neuron_struck_out_is_the_one_whose_loss_costs_least() {
    // By refitting without each in turn, under the same absolute ridge.
    let (x, t) = smooth(80, 3);
    let t = (&t - t.mean().unwrap()).insert_axis(Axis(1));
    let lambda = 1e-3;
    let params = params(9, 5).with_solver(Ridge::relative(lambda));
    let all = params.fit(&x, &t).unwrap();
    let absolute = lambda * all.diagnosis().largest_singular_value.powi(2);
    let h = all.hidden_matrix(&x).unwrap();
    let h = &h - &h.mean_axis(Axis(0)).unwrap();
    let cost = |kept: &[usize]| {
        let mut rows = h.select(Axis(1), kept);
        rows.append(Axis(0), (Array2::eye(kept.len()) * absolute.sqrt()).view())
            .unwrap();
        let mut targets = t.clone();
        targets
            .append(Axis(0), Array2::zeros((kept.len(), 1)).view())
            .unwrap();
        let problem = elm::solve::LeastSquares::new(&rows, &targets).unwrap();
        let solver = elm::solve::Solver::from(PseudoInverse::default());
        solver.solve(&problem).unwrap().diagnosis.residual_norm[0].powi(2)
    };
    let mut left: Vec<usize> = (0..9).collect();
    while left.len() > 1 {
        let without = |k: usize| left.iter().copied().filter(|&j| j != k).collect::<Vec<_>>();
        let cheapest = left
            .iter()
            .copied()
            .min_by(|&a, &b| cost(&without(a)).total_cmp(&cost(&without(b))))
            .unwrap();
        left = without(cheapest);
        let pruned = params
            .fit_pruned(&Dataset::new(&x, &t).unwrap(), Keep::Neurons(left.len()))
            .unwrap();
        assert_eq!(pruned.kept, left);
    }
}

#[test]
fn a_loss_is_kept_to_by_leave_one_out_and_about_so_on_rows_held_out() {
    let Toy {
        noiseless,
        inputs: x_test,
        ..
    } = toy::friedman1(2000, 1.0, 77).unwrap();
    let test = (x_test, noiseless.column(0).to_owned());
    for seed in 0..3 {
        let Toy {
            inputs, targets, ..
        } = toy::friedman1(400, 1.0, seed).unwrap();
        let targets = targets.column(0);
        let params = params(120, seed);
        let all = params.fit(&inputs, &targets).unwrap();
        let pruned = params
            .fit_pruned(&Dataset::new(&inputs, &targets).unwrap(), Keep::Loss(0.1))
            .unwrap();
        let loo = |model: &Elm<f64, Ix1>| model.diagnosis().leave_one_out.clone().unwrap()[0];
        // 1 % for generalized cross-validation in place of leave-one-out.
        assert!(loo(&pruned.model) <= 1.11 * loo(&all), "seed {seed}");
        assert!(pruned.kept.len() < 80, "{}", pruned.kept.len());
        // The same rows chose: held out, the loss may be larger, but not by much.
        assert!(
            rmse(&pruned.model, &test) < 1.3 * rmse(&all, &test),
            "seed {seed}"
        );
        let stricter = params
            .fit_pruned(&Dataset::new(&inputs, &targets).unwrap(), Keep::Loss(0.02))
            .unwrap();
        assert!(stricter.kept.len() > pruned.kept.len());
    }
}

#[test]
fn several_outputs_and_single_precision_are_pruned_alike() {
    let (x, t) = smooth(200, 6);
    // Units must not matter: the second output is the first in others.
    let both = ndarray::stack![Axis(1), t, &t * 1e6 + 3.0];
    let one = params(40, 1)
        .fit_pruned(&Dataset::new(&x, &t).unwrap(), Keep::Neurons(12))
        .unwrap();
    let two = params(40, 1)
        .fit_pruned(&Dataset::new(&x, &both).unwrap(), Keep::Neurons(12))
        .unwrap();
    assert_eq!(one.kept, two.kept);
    let (single_x, single_t) = (x.mapv(|v| v as f32), t.mapv(|v| v as f32));
    let single = ElmParams::<f32>::new(40)
        .with_activation(Activation::Tanh)
        .with_biases(Biases::AtTrainingRows)
        .with_scale(0.4)
        .with_seed(1)
        .fit_pruned(
            &Dataset::new(&single_x, &single_t).unwrap(),
            Keep::Neurons(12),
        )
        .unwrap();
    let error = metrics::rmse(&single.model.predict(&single_x).unwrap(), &single_t);
    let double = rmse(&one.model, &(x, t));
    assert!(error.unwrap() < 2.0 * double + 1e-3);
}

#[test]
fn hard_problems_are_pruned_without_harm() {
    let same = Array2::ones((30, 2));
    let wide = smooth(20, 1);
    for (x, t) in [
        (array![[1.0]], array![2.0]),
        (array![[1.0], [2.0]], array![1.0, 1.0]),
        (same, Array1::linspace(-1e300, 1e300, 30)),
        wide,
    ] {
        for keep in [Keep::Neurons(3), Keep::Loss(0.1), Keep::Loss(0.0)] {
            for scale in [1e-3, 1.0, 1e3] {
                let pruned = params(50, 1)
                    .with_scale(scale)
                    .fit_pruned(&Dataset::new(&x, &t).unwrap(), keep)
                    .unwrap();
                assert!(
                    pruned
                        .model
                        .predict(&x)
                        .unwrap()
                        .iter()
                        .all(|y| y.is_finite())
                );
            }
        }
    }
}

#[test]
fn what_cannot_be_pruned_is_named() {
    let (x, t) = smooth(30, 1);
    for keep in [
        Keep::Neurons(0),
        Keep::Neurons(31),
        Keep::Loss(-0.1),
        Keep::Loss(f64::NAN),
        Keep::Loss(f64::INFINITY),
    ] {
        let error = params(30, 1)
            .fit_pruned(&Dataset::new(&x, &t).unwrap(), keep)
            .unwrap_err();
        assert!(matches!(error, Error::Parameter { .. }), "{error}");
    }
    let by = |params: ElmParams<f64>| {
        params
            .fit_pruned(&Dataset::new(&x, &t).unwrap(), Keep::Neurons(3))
            .unwrap_err()
    };
    for error in [
        by(params(30, 1).with_solver(Inverse)),
        by(params(30, 1).with_solver(PseudoInverse::default())),
    ] {
        assert!(matches!(error, Error::Conflict { .. }), "{error}");
    }
}

#[test]
fn rows_without_weight_have_no_say_in_what_is_kept() {
    let (x, t) = smooth(300, 5);
    let checked = params(60, 5).with_solver(Ridge::relative(1e-8));
    // Every third row is wrong, and does not count.
    let wrong = |row: usize| row.is_multiple_of(3);
    let spoilt = Array1::from_shape_fn(300, |row| if wrong(row) { 1e3 } else { t[row] });
    let weights = Array1::from_shape_fn(300, |row| if wrong(row) { 0.0 } else { 2.0 });
    let kept = |t: &Array1<f64>, weights: &Array1<f64>| {
        let keep = Keep::Neurons(20);
        let pruned = checked.fit_pruned(
            &Dataset::new(&x, t).unwrap().with_weights(weights).unwrap(),
            keep,
        );
        pruned.unwrap()
    };
    let (clean, weighted) = (kept(&t, &weights), kept(&spoilt, &weights));
    assert_eq!(clean.kept, weighted.kept);
    assert_ne!(kept(&spoilt, &Array1::ones(300)).kept, weighted.kept);
    let difference = clean.model.predict(&x).unwrap() - weighted.model.predict(&x).unwrap();
    assert!(difference.iter().all(|d| d.abs() < 1e-9));
}

#[test]
fn a_layer_that_is_there_already_is_fitted_as_when_it_was_drawn() {
    let (x, t) = smooth(200, 7);
    for solver in [Ridge::relative(1e-6), Ridge::leave_one_out()] {
        let checked = ElmParams::new(30).with_seed(7).with_solver(solver);
        let drawn = checked.fit(&x, &t).unwrap();
        let map = checked.feature_map().draw_on(&x).unwrap();
        let given = checked.fit_map(map.clone(), &Dataset::new(&x, &t).unwrap());
        let difference = given.unwrap().predict(&x).unwrap() - drawn.predict(&x).unwrap();
        assert!(difference.iter().all(|d| d.abs() < 1e-9));
        let keep = Keep::Neurons(9);
        let given = checked.prune_map(map.clone(), &Dataset::new(&x, &t).unwrap(), keep);
        assert_eq!(
            given.unwrap(),
            checked
                .fit_pruned(&Dataset::new(&x, &t).unwrap(), keep)
                .unwrap()
        );

        let narrow = Scaler::measured(&x.slice(s![.., ..2])).unwrap();
        let layer = checked.feature_map().draw(3).unwrap();
        let refused = FeatureMap::new(Some(narrow), layer.clone(), false);
        assert!(matches!(refused, Err(Error::Shape { .. })), "{refused:?}");
        for (map, t) in [
            (FeatureMap::new(None, layer, false).unwrap(), &t),
            (map, &t.slice(s![..9]).to_owned()),
        ] {
            let data = || Dataset::new(&x, t);
            let refused = data().and_then(|data| checked.fit_map(map.clone(), &data));
            assert!(matches!(refused, Err(Error::Shape { .. })), "{refused:?}");
            let refused = data().and_then(|data| checked.prune_map(map, &data, Keep::Neurons(2)));
            assert!(matches!(refused, Err(Error::Shape { .. })), "{refused:?}");
        }
    }
}
