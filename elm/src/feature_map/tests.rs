use ndarray::{Array1, array, s};

use super::*;
use crate::activation::Activation;

fn plan<A: Scalar>(neurons: usize, seed: u64) -> FeatureMapParams<A> {
    FeatureMapParams {
        neurons: NeuronGroup::new(neurons, Activation::Tanh),
        seed,
        ..FeatureMapParams::new(0)
    }
}

fn draw(neurons: usize, seed: u64) -> HiddenLayer<f64> {
    plan(neurons, seed).sample(array![[0.5, -1.0, 2.0]].view(), None)
}

#[test]
fn a_seed_gives_the_same_layer_on_every_platform() {
    // The first neuron of ChaCha8 seeded with 7: a change here changes every saved figure.
    let layer = draw(2, 7);
    assert_eq!(
        layer.weights.column(0).to_vec(),
        [
            -0.684_407_805_958_761_3,
            -0.664_021_274_455_797_4,
            0.408_552_256_072_912_9
        ]
    );
    assert_eq!(layer.biases[0], 0.453_482_593_426_530_1);
    assert_ne!(layer, draw(2, 8));
}

#[test]
fn a_small_layer_is_the_beginning_of_a_larger_one() {
    let (small, large) = (draw(4, 1), draw(9, 1));
    assert_eq!(small.weights, large.weights.slice(s![.., ..4]));
    assert_eq!(small.biases, large.biases.slice(s![..4]));
}

/// Tanh, sine with its biases on the data, and radial neurons.
fn mixed<A: Scalar>(counts: [usize; 3], seed: u64) -> FeatureMapParams<A> {
    let [tanh, sine, radial] = counts;
    FeatureMapParams {
        neurons: NeuronGroup::new(tanh, Activation::Tanh),
        others: vec![
            NeuronGroup::new(sine, Activation::Sine)
                .with_scale(2.0)
                .with_biases(Biases::AtTrainingRows),
            NeuronGroup::rbf(radial).with_scale(0.5),
        ],
        scale: 0.8,
        input_scales: vec![1.0, 0.25],
        ..plan(0, seed)
    }
}

/// 13 rows of two inputs, all different.
fn rows() -> Array2<f64> {
    Array2::from_shape_fn((13, 2), |(i, j)| ((3 * i + 5 * j + 1) as f64 * 0.7).sin())
}

#[test]
fn in_a_mixed_layer_each_group_is_the_beginning_of_a_larger_one_whatever_the_others() {
    let x = rows();
    let small = mixed::<f64>([4, 3, 9], 5).sample(x.view(), None);
    let large = mixed::<f64>([6, 8, 31], 5).sample(x.view(), None);
    for (few, from, to) in [(4, 0, 0), (3, 4, 6), (9, 7, 14)] {
        let (few_from, few_to) = (s![.., from..from + few], s![.., to..to + few]);
        assert_eq!(small.weights.slice(few_from), large.weights.slice(few_to));
        let (few_from, few_to) = (s![from..from + few], s![to..to + few]);
        assert_eq!(small.biases.slice(few_from), large.biases.slice(few_to));
    }
    // The first group is a plain layer.
    let plain = FeatureMapParams {
        neurons: NeuronGroup::new(4, Activation::Tanh),
        others: Vec::new(),
        ..mixed::<f64>([0; 3], 5)
    };
    assert_eq!(
        plain.sample(x.view(), None).weights,
        small.weights.slice(s![.., ..4])
    );
}

#[test]
fn centers_are_scaled_rows_and_none_comes_twice_before_all_have_come_once() {
    let x = rows();
    let plan = FeatureMapParams {
        neurons: NeuronGroup::rbf(30).with_scale(3.0),
        scale: 0.5,
        input_scales: vec![1.0, 0.25],
        ..plan::<f64>(0, 2)
    };
    let layer = plan.sample(x.view(), None);
    let scaled = &x * &array![1.5, 0.375];
    let mut uses = vec![0; x.nrows()];
    for center in layer.weights.columns() {
        let row = scaled.rows().into_iter().position(|row| row == center);
        uses[row.unwrap()] += 1;
    }
    assert!(uses.iter().all(|&n| n == 2 || n == 3), "{uses:?}");
    assert!(layer.biases.iter().all(|b| *b == 0.0));
}

#[test]
fn f32_is_the_rounded_f64_layer() {
    let x = rows();
    for normal in [true, false] {
        let (mut single, mut double) = (mixed::<f32>([5, 0, 4], 9), mixed([5, 0, 4], 9));
        if normal {
            single.distribution = Distribution::Normal;
            double.distribution = Distribution::Normal;
            single.neurons.biases = Biases::Scaled(2.0);
            double.neurons.biases = Biases::Scaled(2.0);
        }
        let single = single.sample(x.mapv(|x| x as f32).view(), None);
        let double: HiddenLayer<f64> = double.sample(x.view(), None);
        let (drawn, centers) = (s![.., ..5], s![.., 5..]);
        let rounded = double.weights.mapv(|w| w as f32);
        assert_eq!(single.weights.slice(drawn), rounded.slice(drawn));
        assert_eq!(single.biases, double.biases.mapv(|b| b as f32));
        // Rounded as inputs, as scales and as their product.
        approx::assert_relative_eq!(
            single.weights.slice(centers),
            rounded.slice(centers),
            max_relative = 2.0 * f32::EPSILON
        );
    }
}

#[test]
fn biases_on_data_put_every_neuron_at_a_row() {
    let x = array![[0.5, -1.0], [3.0, 0.25], [-2.0, 8.0]];
    let plan = FeatureMapParams {
        neurons: NeuronGroup::new(20, Activation::Tanh).with_biases(Biases::AtTrainingRows),
        scale: 50.0,
        ..plan(20, 4)
    };
    let layer = plan.sample(x.view(), None);
    let z = x.dot(&layer.weights) + &layer.biases;
    for column in z.columns() {
        assert!(column.iter().any(|z: &f64| z.abs() < 1e-12), "{column}");
    }
}

#[test]
fn input_scales_multiply_the_weights_of_their_input() {
    let x = array![[0.5, -1.0]];
    let scaled = FeatureMapParams {
        input_scales: vec![1.0, 0.0],
        ..plan(3, 1)
    };
    let layer = scaled.sample(x.view(), None);
    let whole = plan::<f64>(3, 1).sample(x.view(), None);
    assert_eq!(layer.weights.row(0), whole.weights.row(0));
    assert_eq!(layer.weights.row(1).sum(), 0.0);
}

#[test]
fn the_forward_pass_is_equation_7() {
    let layer = draw(4, 3);
    let x = ndarray::array![[0.5, -1.0, 2.0], [0.0, 0.0, 0.0]];
    let h = layer.forward(x.view());
    for i in 0..2 {
        for k in 0..4 {
            let z: f64 = (0..3).map(|j| x[[i, j]] * layer.weights[[j, k]]).sum();
            approx::assert_abs_diff_eq!(h[[i, k]], (z + layer.biases[k]).tanh(), epsilon = 1e-15);
        }
    }
}

#[test]
fn a_mixed_layer_is_its_groups_side_by_side_and_radial_neurons_are_bumps_at_their_rows() {
    let x = rows();
    let layer = mixed::<f64>([4, 3, 20], 1).sample(x.view(), None);
    let h = layer.forward(x.view());
    for (i, row) in x.rows().into_iter().enumerate() {
        for k in 0..27 {
            let weights = layer.weights.column(k);
            let expected = if k < 7 {
                let z = row.dot(&weights) + layer.biases[k];
                if k < 4 { z.tanh() } else { z.sin() }
            } else {
                // The scale of the layer times that of the neurons times that of the input.
                let apart = [
                    0.8 * 0.5 * row[0] - weights[0],
                    0.8 * 0.5 * 0.25 * row[1] - weights[1],
                ];
                (-apart[0].powi(2) - apart[1].powi(2)).exp()
            };
            approx::assert_abs_diff_eq!(h[[i, k]], expected, epsilon = 2e-15);
        }
    }
    for column in h.slice(s![.., 7..]).columns() {
        assert!(
            column.iter().any(|h| *h == 1.0),
            "at its own row a bump is 1"
        );
    }
}

#[test]
fn a_distance_keeps_its_digits_far_from_the_origin() {
    // Rows 1e6 from the origin and about 1 apart, in f64 exact: 20 bits of whole numbers and
    // eighths. The product form would lose 1e12 of 1e16.
    let x = Array2::from_shape_fn((9, 3), |(i, j)| 1e6 + ((5 * i + 3 * j) % 11) as f64 / 8.0);
    let plan = FeatureMapParams {
        neurons: NeuronGroup::rbf(9).with_node_type(NodeType::Rbf),
        ..plan::<f64>(0, 3)
    };
    let layer = plan.sample(x.view(), None);
    let z = distance::distances(x.view(), layer.weights.view());
    for ((i, k), z) in z.indexed_iter() {
        let apart = &x.row(i) - &layer.weights.column(k);
        // (d / 2 + 2) units: the differences are exact.
        let expected = apart.dot(&apart).sqrt();
        approx::assert_abs_diff_eq!(*z, expected, epsilon = 3.5 * f64::EPSILON * expected);
    }
}

#[test]
fn student_t_weights_have_their_variance_and_a_root_in_common() {
    let x = Array2::<f64>::zeros((1, 2));
    let draw = |count| {
        let mut plan = plan::<f64>(count, 4);
        plan.distribution = Distribution::StudentT(5);
        plan.neurons.biases = Biases::Scaled(1.0);
        plan.sample(x.view(), None)
    };
    let layer = draw(40_000);
    let squares = layer.weights.mapv(|w| w * w);
    // Of t with 5 degrees of freedom 5 / 3; of fourth moment 25, so that the mean of 80,000
    // squares has a deviation of 0.02. Biases are normal.
    let variance = squares.mean().unwrap();
    assert!((variance - 5.0 / 3.0).abs() < 0.1, "{variance}");
    let biases = layer.biases.mapv(|b| b * b).mean().unwrap();
    assert!((biases - 1.0).abs() < 0.05, "{biases}");
    // Weights of one neuron are large together: E[w1^2 w2^2] = 25 / 3, not 25 / 9.
    let together = (&squares.row(0) * &squares.row(1)).mean().unwrap();
    assert!(together > 4.0, "{together}");
    // Fewer neurons are the beginning of more.
    let few = draw(10);
    assert_eq!(few.weights, layer.weights.slice(s![.., ..10]));
    assert_eq!(few.biases, layer.biases.slice(s![..10]));
}

#[test]
fn gradients_are_those_of_the_weighted_sum() {
    // Central differences of squares are exact.
    let square = Activation::custom("square", |z: f64| z * z);
    let layer = FeatureMapParams {
        neurons: NeuronGroup::new(4, square.clone()),
        others: vec![
            NeuronGroup::new(5, square)
                .with_node_type(NodeType::Rbf)
                .with_scale(0.3),
        ],
        input_scales: vec![1.0, 0.25],
        ..plan(0, 5)
    }
    .sample(rows().view(), None);
    // Away from the centers, which lie on rows.
    let x = rows() + 3.0;
    let beta = Array1::from_shape_fn(9, |k| (k as f64).cos());
    let gradient = layer.gradient(x.view(), beta.view());
    let step = 1e-3;
    for input in 0..2 {
        let moved = |by: f64| {
            let mut x = x.clone();
            x.column_mut(input).mapv_inplace(|x| x + by);
            layer.forward(x.view()).dot(&beta)
        };
        let expected = (moved(step) - moved(-step)) / (2.0 * step);
        approx::assert_relative_eq!(gradient.column(input), expected, max_relative = 1e-8);
    }
}
