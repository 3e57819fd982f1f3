use ndarray::{Array1, Array2, Axis, ShapeBuilder, s};
use ndarray_rand::RandomExt;
use ndarray_rand::rand_distr::{StandardNormal, Uniform};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::activation::Activation;
use crate::simd::Level;
use crate::{Biases, ElmParams, NeuronGroup, NodeType};

/// Uniform on [-2, 2).
fn inputs(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
    let uniform = Uniform::new(-2.0, 2.0).unwrap();
    Array2::random_using(
        (rows, columns),
        uniform,
        &mut ChaCha8Rng::seed_from_u64(seed),
    )
}

fn targets(rows: usize, outputs: usize) -> Array2<f64> {
    Array2::random_using(
        (rows, outputs),
        StandardNormal,
        &mut ChaCha8Rng::seed_from_u64(99),
    )
}

/// Without bounds, which are no part of the formula.
fn model(params: &ElmParams<f64>, inputs_count: usize, outputs: usize) -> Elm<f64> {
    let x = inputs(40, inputs_count, 1);
    let fitted = params.fit(&x, &targets(40, outputs)).unwrap();
    fitted.with_bounded(false)
}

/// The plain formula, equation 7, by ndarray and the standard library; and the sum of the
/// magnitudes of its terms, by which its rounding errors are bounded.
fn plain(model: &Elm<f64>, x: &Array2<f64>) -> (Array2<f64>, Array2<f64>) {
    let x = model
        .scaler()
        .map_or_else(|| x.clone(), |s| s.transform(x.view()));
    let hidden = model.hidden();
    let mut z = x.dot(&hidden.weights()) + hidden.biases();
    // The slope of no function here exceeds 1, but for the squared ReLU's.
    let mut z_size =
        x.mapv(f64::abs).dot(&hidden.weights().mapv(f64::abs)) + hidden.biases().mapv(f64::abs);
    let mut neuron = 0;
    for group in hidden.groups() {
        for k in neuron..neuron + group.neurons() {
            if let Some(scales) = group.input_scales() {
                let (scaled, center) = (&x * &scales, hidden.weights().column(k).to_owned());
                for (i, row) in scaled.rows().into_iter().enumerate() {
                    let apart = &row - &center;
                    z[[i, k]] = apart.dot(&apart).sqrt();
                    // Inputs and centers are rounded before their difference.
                    z_size[[i, k]] = z[[i, k]] + row.dot(&row).sqrt();
                }
            }
            if *group.activation() == Activation::SquaredRelu {
                let slope = z.column(k).mapv(|z| 2.0 * z.abs());
                z_size
                    .column_mut(k)
                    .zip_mut_with(&slope, |size, s| *size *= s);
            }
            z.column_mut(k)
                .mapv_inplace(|z| group.activation().apply(z));
        }
        neuron += group.neurons();
    }
    let mut h = z;
    let mut h_size = h.mapv(f64::abs) + z_size;
    if model.beta().nrows() > hidden.neurons() {
        h = ndarray::concatenate(Axis(1), &[h.view(), x.view()]).unwrap();
        h_size = ndarray::concatenate(Axis(1), &[h_size.view(), x.mapv(f64::abs).view()]).unwrap();
    }
    let out = h.dot(&model.beta()) + model.intercept();
    let size = h_size.dot(&model.beta().mapv(f64::abs)) + model.intercept().mapv(f64::abs);
    (out, size)
}

/// Both sides round each weighted sum of d + 1 terms, the activation (3 units) and the sum of
/// n + d + 1 products: at most 2 (2 d + n + 8) half units of the sum of magnitudes.
fn assert_is_plain(model: &Elm<f64>, x: &Array2<f64>, out: &Array2<f64>) {
    let (expected, size) = plain(model, x);
    let terms = (2 * model.inputs() + model.hidden().neurons() + 8) as f64;
    for ((place, &expected), (&out, &size)) in expected.indexed_iter().zip(out.iter().zip(&size)) {
        let bound = terms * f64::EPSILON * size;
        assert!(
            (out - expected).abs() <= bound,
            "{place:?}: {out} for {expected}, {bound:e}"
        );
    }
}

#[test]
fn every_activation_with_links_and_intercept_is_the_plain_formula_on_every_level() {
    let own = Activation::custom("reciprocal", |z: f64| 1.0 / (1e-9 + z).abs().max(1.0));
    for activation in Activation::BUILT_IN.into_iter().chain([own]) {
        for (links, intercept, standardize) in [
            (false, true, true),
            (true, true, false),
            (true, false, true),
        ] {
            let params = ElmParams::new(21)
                .with_activation(activation.clone())
                .with_direct_links(links)
                .with_intercept(intercept)
                .with_standardize(standardize);
            let model = model(&params, 5, 2);
            let x = inputs(37, 5, 2);
            for level in Level::all() {
                let out = model.predictor().level(level).predict(&x).unwrap();
                assert_is_plain(&model, &x, &out);
            }
        }
    }
}

/// Sigmoid-like, sine and radial neurons, and functions of the user's own on either argument.
fn mixed(counts: [usize; 3]) -> ElmParams<f64> {
    let own = Activation::custom("reciprocal", |z: f64| 1.0 / (1e-9 + z).abs().max(1.0));
    ElmParams::new(counts[0])
        .with_activation(Activation::Tanh)
        .with_group(
            NeuronGroup::new(counts[1], Activation::Sine).with_biases(Biases::AtTrainingRows),
        )
        .with_group(NeuronGroup::rbf(counts[2]).with_scale(0.5))
        .with_group(NeuronGroup::new(3, own.clone()))
        .with_group(NeuronGroup::new(5, own).with_node_type(NodeType::Rbf))
        .with_group(NeuronGroup::rbf(9).with_scale(0.7))
}

#[test]
fn mixed_layers_are_the_plain_formula_on_every_level_alone_and_in_batches() {
    for (counts, links) in [
        ([21, 13, 8], true),
        ([1, 1, 1], false),
        ([0, 150, 170], true),
    ] {
        let model = model(&mixed(counts).with_direct_links(links), 5, 2);
        let x = inputs(37, 5, 2);
        for level in Level::all() {
            let predictor = model.predictor().level(level);
            let out = predictor.predict(&x).unwrap();
            assert_is_plain(&model, &x, &out);
            let alone = predictor.predict(&x.slice(s![17..18, ..])).unwrap();
            assert_eq!(alone.row(0), out.row(17));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_shape_is_the_plain_formula(
        rows in 0_usize..40,
        columns in 1_usize..23,
        neurons in 1_usize..300,
        outputs in 1_usize..9,
        links: bool,
        seed: u64,
    ) {
        let params = ElmParams::new(neurons)
            .with_activation(Activation::Tanh)
            .with_direct_links(links)
            .with_solver(crate::solve::PseudoInverse::default())
            .with_seed(seed);
        let model = model(&params, columns, outputs);
        let x = inputs(rows, columns, seed);
        for level in Level::all() {
            let out = model.predictor().level(level).predict(&x).unwrap();
            prop_assert_eq!(out.dim(), (rows, outputs));
            assert_is_plain(&model, &x, &out);
        }
    }
}

#[test]
fn a_row_has_the_same_bits_alone_and_in_batches_of_any_size() {
    let model = model(&ElmParams::new(150).with_direct_links(true), 3, 4);
    let x = inputs(2 * TILE_ROWS + 3, 3, 5);
    for level in Level::all() {
        let predictor = model.predictor().level(level);
        let whole = predictor.predict(&x).unwrap();
        for rows in [
            0,
            1,
            7,
            8,
            9,
            TILE_ROWS - 1,
            TILE_ROWS,
            TILE_ROWS + 1,
            2 * TILE_ROWS,
        ] {
            let part = predictor.predict(&x.slice(s![..rows, ..])).unwrap();
            assert_eq!(part, whole.slice(s![..rows, ..]), "{rows} rows");
        }
        let mut scratch = predictor.scratch();
        for (x, expected) in x.rows().into_iter().zip(whole.rows()) {
            let mut out = [0.0; 4];
            predictor
                .predict_row(&x.to_vec(), &mut out, &mut scratch)
                .unwrap();
            assert_eq!(out[..], expected.to_vec());
        }
    }
}

#[test]
fn levels_with_fused_multiply_add_give_the_same_bits() {
    let model = model(&ElmParams::new(150), 3, 4);
    let x = inputs(21, 3, 5);
    let mut fused = Level::all()
        .into_iter()
        .filter(|level| level.is_fused())
        .map(|level| model.predictor().level(level).predict(&x).unwrap());
    if let Some(first) = fused.next() {
        assert!(fused.all(|other| other == first));
    }
}

#[test]
fn strides_of_inputs_and_predictions_change_nothing() {
    let model = model(&ElmParams::new(30), 4, 3);
    let predictor = model.predictor();
    let x = inputs(27, 4, 8);
    let expected = predictor.predict(&x).unwrap();

    let mut fortran = Array2::zeros((27, 4).f());
    fortran.assign(&x);
    let mut scratch = predictor.scratch();
    let mut out = Array2::zeros((27, 3).f());
    predictor
        .predict_into(&fortran, &mut out, &mut scratch)
        .unwrap();
    assert_eq!(out, expected);

    let mut spaced = Array2::zeros((54, 8));
    spaced.slice_mut(s![..;2, ..;2]).assign(&x);
    assert_eq!(
        predictor.predict(&spaced.slice(s![..;2, ..;2])).unwrap(),
        expected
    );
    let backwards = predictor.predict(&x.slice(s![..;-1, ..])).unwrap();
    assert_eq!(backwards, expected.slice(s![..;-1, ..]));
}

#[test]
fn single_precision_is_double_precision_rounded_at_every_step() {
    let double = model(&ElmParams::new(100).with_activation(Activation::Tanh), 4, 2);
    let x = inputs(50, 4, 8);
    let t = targets(40, 2).mapv(|t| t as f32);
    let single = ElmParams::new(100)
        .with_activation(Activation::Tanh)
        .with_bounded(false)
        .fit(&inputs(40, 4, 1).mapv(|x| x as f32), &t)
        .unwrap();
    // The same weights in double precision: beta differs between the fits, so take it over.
    let (_, size) = plain(&double, &x);
    let mut promoted = double.clone();
    promoted.set_readout(
        single.beta().mapv(f64::from),
        single.intercept().mapv(f64::from),
    );
    let (expected, promoted_size) = plain(&promoted, &x);
    assert!(size.iter().all(|size| size.is_finite()));
    for level in Level::all() {
        let out = single
            .predictor()
            .level(level)
            .predict(&x.mapv(|x| x as f32))
            .unwrap();
        for ((&out, expected), size) in out.iter().zip(&expected).zip(&promoted_size) {
            // As in double precision, and inputs, mean, factor and weights are rounded too: their
            // relative errors reach a weighted sum at most 4 + 4 times.
            let bound = (2.0 * 4.0 + 100.0 + 16.0) * f64::from(f32::EPSILON) * size;
            assert!(
                (f64::from(out) - expected).abs() <= bound,
                "{out} for {expected}"
            );
        }
    }
}

#[test]
fn fast_predictions_differ_by_at_most_the_stated_error_times_the_output_weights() {
    for activation in [
        Activation::Sigmoid,
        Activation::Tanh,
        Activation::Sine,
        Activation::Gaussian,
    ] {
        let model = model(&ElmParams::new(64).with_activation(activation), 4, 2);
        let x = inputs(50, 4, 8);
        let full = model.predictor().predict(&x).unwrap();
        let fast = model
            .predictor()
            .with_accuracy(Accuracy::Fast)
            .predict(&x)
            .unwrap();
        let bound = model.beta().mapv(f64::abs).sum_axis(Axis(0)) * 6e-7;
        for (full, fast) in full.rows().into_iter().zip(fast.rows()) {
            for ((full, fast), bound) in full.iter().zip(fast).zip(&bound) {
                assert!((full - fast).abs() <= *bound);
            }
        }
        assert_ne!(full, fast);
    }
}

#[test]
fn a_large_mean_with_a_small_deviation_keeps_its_digits() {
    // x = 2^26 + k / 8 is exact; folded into weights, the mean would cost 26 of 53 digits.
    let offset = 67_108_864.0;
    let k = Array1::linspace(0.0, 63.0, 64).insert_axis(Axis(1));
    let t = k.mapv(|k: f64| (k / 10.0).sin());
    let params = ElmParams::new(20).with_activation(Activation::Tanh);
    let near = params.fit(&k.mapv(|k| k / 8.0), &t).unwrap();
    let far = params.fit(&k.mapv(|k| offset + k / 8.0), &t).unwrap();
    let difference = near.predict(&k.mapv(|k| k / 8.0)).unwrap()
        - far.predict(&k.mapv(|k| offset + k / 8.0)).unwrap();
    assert!(difference.iter().all(|d| d.abs() < 1e-6), "{difference}");
}

#[test]
fn wrong_sizes_and_values_are_named() {
    let model = model(&ElmParams::new(9), 3, 2);
    let predictor = model.predictor();
    let mut scratch = predictor.scratch();
    let shape = |what, expected, found| Error::Shape {
        what,
        expected,
        found,
    };
    let mut out = Array2::zeros((4, 2));
    let mut try_into = |x: &Array2<f64>, out: &mut Array2<f64>| {
        predictor.predict_into(x, out, &mut scratch).unwrap_err()
    };
    assert_eq!(
        try_into(&Array2::zeros((4, 2)), &mut out),
        shape("columns of inputs", 3, 2)
    );
    assert_eq!(
        try_into(&Array2::zeros((5, 3)), &mut out),
        shape("rows of predictions", 5, 4)
    );
    assert_eq!(
        try_into(&Array2::zeros((4, 3)), &mut Array2::zeros((4, 1))),
        shape("columns of predictions", 2, 1)
    );
    let mut x = inputs(40, 3, 1);
    x[[33, 1]] = f64::NAN;
    let not_finite = Error::NotFinite {
        what: "inputs",
        row: 33,
        column: 1,
    };
    assert_eq!(predictor.predict(&x).unwrap_err(), not_finite);
    assert_eq!(model.predict(&x).unwrap_err(), not_finite);

    let mut other = self::model(&ElmParams::new(9), 4, 2).predictor().scratch();
    let error = predictor
        .predict_into(&inputs(4, 3, 1), &mut out, &mut other)
        .unwrap_err();
    assert_eq!(error, shape("scratch", 48, 64));
}

#[test]
fn a_prediction_beyond_the_range_of_the_type_is_an_overflow() {
    let params = ElmParams::new(4).with_activation(Activation::Linear);
    let model = model(&params, 2, 1);
    let x = Array2::from_elem((20, 2), f64::MAX);
    assert_eq!(
        model.predictor().predict(&x).unwrap_err(),
        Error::Overflow {
            what: "a prediction"
        }
    );
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let model = model(&ElmParams::new(50), 3, 2);
    let predictor = model.predictor();
    let x = inputs(3000, 3, 4);
    let expected = predictor.predict(&x).unwrap();
    for threads in [1, 2, 5] {
        let mut out = Array2::zeros((3000, 2));
        crate::on_threads(threads, || predictor.predict_into_parallel(&x, &mut out))
            .unwrap()
            .unwrap();
        assert_eq!(out, expected, "{threads} threads");
    }
    let mut bad = x.clone();
    bad[[2999, 2]] = f64::INFINITY;
    let error = predictor.predict_into_parallel(&bad, &mut Array2::zeros((3000, 2)));
    let place = Error::NotFinite {
        what: "inputs",
        row: 2999,
        column: 2,
    };
    assert_eq!(error.unwrap_err(), place);
}
