//! The paper's equations on the paper's own inputs, through every crate.

// The lint knows test functions, but not the helpers beside them.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

use approx::assert_abs_diff_eq;
use elm::ElmParams;
use elm::solve::{Inverse, PseudoInverse};
use elm_brdf::features::Features;
use elm_brdf::fit::Fit;
use elm_brdf::model::BrdfParams;
use elm_brdf::protocol::{Folds, cross_validate};
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;
use elm_datasets::{Invalid, MaterialId, Measurements, synthetic};
use ndarray::{Axis, s};

fn synthetic_data() -> Measurements {
    let all: Vec<MaterialId> = MaterialId::all().collect();
    synthetic::measurements(1, &all, Invalid::Clamp)
}

fn params(network: ElmParams<f64>) -> BrdfParams {
    BrdfParams {
        features: Features::Paper,
        transform: TargetTransform::Identity,
        network: network.with_intercept(false),
    }
}

#[test]
fn fitting_materials_together_gives_what_fitting_each_alone_gives() {
    let together = synthetic_data();
    let folds = Folds::new(205, 10, 3).unwrap();
    let paper = params(ElmParams::new(50).with_solver(PseudoInverse::default()));
    let all = cross_validate(&paper, &together, &folds, |_, _| {}).unwrap();
    for id in [1, 30, 61] {
        let id = MaterialId::new(id).unwrap();
        let alone = synthetic::measurements(1, &[id], Invalid::Clamp);
        let alone = cross_validate(&paper, &alone, &folds, |_, _| {}).unwrap();
        for (a, b) in all[id.index()].channels.iter().zip(&alone[0].channels) {
            // The same factorisation; only the blocking of the products differs, and its rounding
            // is amplified by the condition of the hidden-layer matrix, here up to 1e8.
            assert_abs_diff_eq!(a.held_out.rmse, b.held_out.rmse, epsilon = 1e-8);
            assert_abs_diff_eq!(a.train.mae, b.train.mae, epsilon = 1e-8);
        }
    }
}

#[test]
fn with_as_many_neurons_as_rows_equation_10_interpolates_and_agrees_with_equation_11() {
    let data = synthetic_data();
    let samples = data.samples(0).unwrap();
    // Sine neurons at a large scale give a well-conditioned square matrix, which the paper's
    // smooth sigmoid on six dependent inputs does not.
    let network = |scale| {
        ElmParams::new(40)
            .with_activation(elm::Activation::Sine)
            .with_scale(scale)
            .with_seed(2)
    };
    let rows = &samples.directions[..40];
    let values = samples.values.slice(s![..40, ..]);
    let exact = params(network(30.0).with_solver(Inverse))
        .fit(rows, values)
        .unwrap();
    let least = params(network(30.0).with_solver(PseudoInverse::default()))
        .fit(rows, values)
        .unwrap();
    let (exact, least) = (exact.eval(rows).unwrap(), least.eval(rows).unwrap());
    assert_abs_diff_eq!(exact, values, epsilon = 1e-9);
    assert_abs_diff_eq!(least, values, epsilon = 1e-9);
}

#[test]
fn repeating_the_first_input_as_the_third_is_a_wider_weight_and_nothing_else() {
    // The paper lists cos(theta_i) beside L.N, which it equals.
    let data = synthetic_data();
    let x = Features::Paper.compute(&data.directions);
    assert_abs_diff_eq!(x.column(0), x.column(2), epsilon = 1e-15);
    let without = x.select(Axis(1), &[0, 1, 3, 4, 5]);
    let rank = |x: &ndarray::Array2<f64>| {
        let t = ndarray::Array2::<f64>::zeros((x.nrows(), 1));
        let problem = elm::solve::LeastSquares::new(x, &t).unwrap();
        let solver = elm::solve::Solver::from(PseudoInverse::default());
        solver.solve(&problem).unwrap().diagnosis.rank.unwrap()
    };
    assert_eq!((rank(&x), rank(&without)), (5, 5));
}

#[test]
fn the_papers_inputs_are_not_reciprocal() {
    // V.R is symmetric in light and viewer, the order of the cosines is not.
    let pair = DirectionPair::from(elm_datasets::Angles {
        theta_i: 0.3,
        phi_i: 0.1,
        theta_o: 1.1,
        phi_o: 2.0,
    });
    let x = Features::Paper.compute(&[pair, pair.swapped()]);
    assert_abs_diff_eq!(x[[0, 1]], x[[1, 1]], epsilon = 1e-15);
    assert!((x[[0, 0]] - x[[1, 0]]).abs() > 0.4);
}
