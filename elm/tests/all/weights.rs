//! A row of weight 0 is no row, one of weight 2 is two, and a factor of all weights says nothing.

use crate::common::{normal, weights};
use elm::advanced::FeatureMap;
use elm::cross_validation::CrossValidator;
use elm::prune::Keep;
use elm::solve::{LeastSquares, PseudoInverse, Ridge, Solver};
use elm::{
    Accumulator, Activation, Biases, Dataset, ElmParams, NeuronGroup, Scalar, Scaler, ScalerBuilder,
};
use ndarray::{Array1, Array2, Axis, s};
use proptest::prelude::*;

/// Rows, some of which are impossible and have weight 0, and the others by number.
struct Masked<A> {
    x: Array2<A>,
    t: Array2<A>,
    w: Array1<A>,
    kept: Vec<usize>,
}

impl<A: Scalar> Masked<A> {
    fn new(rows: usize, absent: &[bool], seed: u64) -> Self {
        let mut x = normal::<A>(rows, 3, seed);
        let mut t = x.map_axis(Axis(1), |row| (row[0] + row[1] * row[2]).sin());
        let mut w = weights::<A>(rows, seed + 1);
        let mut kept = Vec::new();
        for row in 0..rows {
            if absent[row % absent.len()] {
                x.row_mut(row).fill(A::from_f64(1e6));
                t[row] = A::from_f64(1e6);
                w[row] = A::zero();
            } else {
                kept.push(row);
            }
        }
        let t = t.insert_axis(Axis(1));
        Self { x, t, w, kept }
    }

    fn omitted(&self) -> (Array2<A>, Array2<A>, Array1<A>) {
        let (axis, kept) = (Axis(0), &self.kept);
        (
            self.x.select(axis, kept),
            self.t.select(axis, kept),
            self.w.select(axis, kept),
        )
    }
}

fn settings<A: Scalar>() -> Vec<ElmParams<A>> {
    let plain = ElmParams::new(12).with_solver(Ridge::relative(1e-3));
    vec![
        plain.clone(),
        ElmParams::new(12),
        plain.clone().with_solver(PseudoInverse::default()),
        plain
            .clone()
            .with_solver(Ridge::gcv())
            .with_intercept(false),
        plain
            .clone()
            .with_biases(Biases::AtTrainingRows)
            .with_direct_links(true),
        plain.with_group(NeuronGroup::rbf(8)),
    ]
}

fn every_route_omits_rows_of_no_weight<A: Scalar>(masked: &Masked<A>) {
    let (x, t, w) = masked.omitted();
    let scaler = Scaler::measured(&x).unwrap();
    for params in settings::<A>() {
        let params = params;
        let fitted = params.fit_dataset(
            &Dataset::new(&masked.x, &masked.t)
                .unwrap()
                .with_weights(&masked.w)
                .unwrap(),
        );
        let expected = params
            .fit_dataset(&Dataset::new(&x, &t).unwrap().with_weights(&w).unwrap())
            .unwrap();
        assert_eq!(fitted.unwrap(), expected);
        let ones = Array1::ones(x.nrows());
        let unweighted =
            params.fit_dataset(&Dataset::new(&x, &t).unwrap().with_weights(&ones).unwrap());
        assert_eq!(unweighted.unwrap(), params.fit(&x, &t).unwrap());
        if let Ok(layer) = params.feature_map().draw(3) {
            let links = params.feature_map().neurons() < expected.beta().nrows();
            let map = FeatureMap::new(Some(scaler.clone()), layer, links).unwrap();
            let fit = |x: &Array2<A>, t: &Array2<A>, w: &Array1<A>| {
                params.fit_map(
                    map.clone(),
                    &Dataset::new(x, t).unwrap().with_weights(w).unwrap(),
                )
            };
            assert_eq!(
                fit(&masked.x, &masked.t, &masked.w).unwrap(),
                fit(&x, &t, &w).unwrap()
            );
        }
    }
    let params = ElmParams::new(12).with_biases(Biases::AtTrainingRows);
    for keep in [Keep::Neurons(5), Keep::Loss(0.1)] {
        let data = Dataset::new(&masked.x, &masked.t).unwrap();
        let pruned = params.fit_pruned(&data.with_weights(&masked.w).unwrap(), keep);
        let expected = params.fit_pruned(
            &Dataset::new(&x, &t).unwrap().with_weights(&w).unwrap(),
            keep,
        );
        assert_eq!(pruned.unwrap(), expected.unwrap());
    }
    let params = ElmParams::new(12).with_solver(Ridge::gcv());
    let accumulate = |x: &Array2<A>, t: &Array2<A>, w: &Array1<A>| {
        let mut rows = Accumulator::with_scaler(&params, scaler.clone(), 1).unwrap();
        rows.push_dataset(&Dataset::new(x, t).unwrap().with_weights(w).unwrap())
            .unwrap();
        rows.fit().unwrap()
    };
    let expected = accumulate(&x, &t, &w);
    assert_eq!(accumulate(&masked.x, &masked.t, &masked.w), expected);
    let mut builder = ScalerBuilder::new(3).unwrap();
    builder.push_weighted(&masked.x, &masked.w).unwrap();
    assert_eq!(
        builder.build().unwrap(),
        Scaler::measured_weighted(&x, &w).unwrap()
    );
}

#[test]
fn masked_rows_change_nothing() {
    // A quarter of the rows is impossible, and says so.
    every_route_omits_rows_of_no_weight(&Masked::<f64>::new(120, &[true, false, false, false], 1));
    every_route_omits_rows_of_no_weight(&Masked::<f32>::new(120, &[true, false, false, false], 1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn a_row_of_weight_0_is_no_row(
        absent in proptest::collection::vec(any::<bool>(), 1..9),
        rows in 9_usize..60,
        seed in 0_u64..1000,
    ) {
        prop_assume!(absent.contains(&false));
        every_route_omits_rows_of_no_weight(&Masked::<f64>::new(rows, &absent, seed));
    }

    /// At a given strength, which is relative to the largest singular value of the weighted matrix.
    #[test]
    fn whole_weights_are_repetitions(
        counts in proptest::collection::vec(0_usize..4, 30..60),
        seed in 0_u64..1000,
    ) {
        prop_assume!(counts.iter().filter(|count| **count > 0).count() > 20);
        let rows = counts.len();
        let x = normal::<f64>(rows, 2, seed);
        let noise = normal::<f64>(rows, 1, seed + 1).remove_axis(Axis(1));
        let t = x.map_axis(Axis(1), |row| row[0].sin() * row[1]) + noise;
        let w: Array1<f64> = counts.iter().map(|&count| count as f64).collect();
        let repeated: Vec<usize> = (0..rows)
            .flat_map(|row| std::iter::repeat_n(row, counts[row]))
            .collect();
        let (many_x, many_t) = (x.select(Axis(0), &repeated), t.select(Axis(0), &repeated));
        for biases in [Biases::AsWeights, Biases::AtTrainingRows] {
            let params = ElmParams::new(10)
                .with_biases(biases)
                .with_activation(Activation::Tanh)
                .with_solver(Ridge::relative(1e-6));
            let expected = params.fit(&many_x, &many_t).unwrap().predict(&x).unwrap();
            // A factor of all weights says nothing.
            for factor in [1.0, 3.0, 1e-200, 1e200] {
                let w = &w * factor;
                let found = params.fit_dataset(&Dataset::new(&x, &t).unwrap().with_weights(&w).unwrap()).unwrap();
                let found = found.predict(&x).unwrap();
                let apart = (&found - &expected).fold(0.0, |m: f64, d| m.max(d.abs()));
                // Rounding, times 1 / lambda.
                prop_assert!(apart < 1e-8, "{:?}, {}: {:e}", biases, factor, apart);
            }
        }
    }
}

#[test]
fn a_problem_with_rows_of_no_weight_is_that_without_them() {
    // Fewer rows of positive weight than columns, more rows in all: what the rank is judged by.
    let masked = Masked::<f64>::new(40, &[true, true, false], 3);
    let (_, t, w) = masked.omitted();
    let h = normal::<f64>(40, 14, 4);
    let few = h.select(Axis(0), &masked.kept);
    for solver in [
        Solver::from(PseudoInverse::default()),
        Ridge::relative(1e-3).into(),
        Ridge::relative(1e-12).into(),
        Ridge::gcv().into(),
        Ridge::leave_one_out().into(),
    ] {
        let problem = LeastSquares::new(&h, &masked.t)
            .unwrap()
            .with_intercept(true);
        let omitted = LeastSquares::new(&few, &t).unwrap().with_intercept(true);
        let one = solver
            .solve(&problem.with_weights(&masked.w).unwrap())
            .unwrap();
        let other = solver.solve(&omitted.with_weights(&w).unwrap()).unwrap();
        assert_eq!(one, other, "{solver}");
    }
    let problem = LeastSquares::new(&h, &masked.t).unwrap();
    let problem = problem
        .with_weights(&masked.w)
        .unwrap()
        .with_intercept(true);
    let omitted = LeastSquares::new(&few, &t)
        .unwrap()
        .with_weights(&w)
        .unwrap();
    let all = CrossValidator::new(&problem).unwrap();
    let some = CrossValidator::new(&omitted.with_intercept(true)).unwrap();
    let lambda = some.select_lambda(Ridge::leave_one_out()).unwrap();
    assert_eq!(all.select_lambda(Ridge::leave_one_out()).unwrap(), lambda);
    let (all, some) = (
        all.leave_one_out(&lambda).unwrap(),
        some.leave_one_out(&lambda).unwrap(),
    );
    approx::assert_relative_eq!(all.rmse()[0], some.rmse()[0], max_relative = 1e-10);
}

#[test]
fn heavy_rows_draw_neurons_to_them() {
    // A thousand rows at 0, one at 1 that weighs as much as all of them.
    let mut x = Array2::zeros((1001, 1));
    x[[1000, 0]] = 1.0;
    let mut w = Array1::ones(1001);
    w[1000] = 1000.0;
    let t = x.mapv(|x: f64| x + 1.0);
    let params = ElmParams::new(1)
        .with_group(NeuronGroup::new(400, Activation::Tanh).with_biases(Biases::AtTrainingRows))
        .with_standardize(false)
        .with_solver(Ridge::relative(1e-3));
    let model = params
        .fit_dataset(&Dataset::new(&x, &t).unwrap().with_weights(&w).unwrap())
        .unwrap();
    let layer = model.hidden();
    let at_one = (1..401).filter(|&k| layer.biases()[k] != 0.0).count();
    // Binomial with deviation 10.
    assert!((150..250).contains(&at_one), "{at_one}");
    // None twice, and the heavy one among the first of nearly every seed.
    let first = |seed: u64| {
        let params = ElmParams::new(1)
            .with_seed(seed)
            .with_standardize(false)
            .with_group(NeuronGroup::rbf(3));
        let params = params.with_solver(Ridge::relative(1e-3));
        let model = params
            .fit_dataset(&Dataset::new(&x, &t).unwrap().with_weights(&w).unwrap())
            .unwrap();
        model.hidden().weights().slice(s![0, 1..]).sum()
    };
    let sums: Vec<f64> = (0..40).map(first).collect();
    assert!(sums.iter().all(|sum| [0.0, 1.0].contains(sum)), "{sums:?}");
    // Missed three times with a probability of an eighth.
    assert!(
        sums.iter().filter(|sum| **sum == 1.0).count() >= 28,
        "{sums:?}"
    );
}
