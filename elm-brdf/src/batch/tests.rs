//! Columns against pairs, block ends, and what is refused.

use super::*;
use crate::features::Features;
use crate::model::{BrdfModel, BrdfParams};
use crate::target_transform::TargetTransform;
use elm::solve::Ridge;
use elm::{Activation, ElmParams, NodeType};
use elm_datasets::Brdf;
use elm_datasets::geometry::cartesian;
use ndarray::Array2;
use ndarray::Axis;

/// Directions all over the hemisphere, coincident and mirror ones among them.
fn directions(count: usize) -> Vec<DirectionPair> {
    (0..count)
        .map(|number| {
            let i = number as f64;
            let (theta, phi) = ((0.37 * i) % 1.45, (0.9 * i) % 6.2);
            let incident = cartesian(theta, phi);
            let outgoing = match number % 10 {
                0 => incident,
                1 => [-incident[0], -incident[1], incident[2]],
                _ => cartesian((0.73 * i) % 1.45, (1.13 * i) % 6.0),
            };
            DirectionPair { incident, outgoing }
        })
        .collect()
}

fn model(
    features: Features,
    transform: TargetTransform,
    network: ElmParams<f64>,
    channels: usize,
) -> BrdfModel {
    let pairs = directions(200);
    let values = Array2::from_shape_fn((200, channels), |(row, channel)| {
        let pair = &pairs[row];
        let angles = pair.half_difference();
        0.1 + 0.2 * channel as f64 + 3.0 * angles.cos_theta_h().powi(20) + pair.incident[2]
    });
    BrdfParams {
        features,
        transform,
        network: network.with_solver(Ridge::relative(1e-6)),
    }
    .fit_model(&pairs, values.view())
    .unwrap()
}

#[test]
fn every_set_of_inputs_link_and_function_gives_what_the_general_way_gives() {
    let pairs = directions(333);
    let transforms = [
        TargetTransform::Identity,
        TargetTransform::default_log(),
        TargetTransform::CubeRoot,
    ];
    for (number, features) in Features::ALL.into_iter().enumerate() {
        for (other, function) in Activation::<f64>::BUILT_IN.into_iter().enumerate() {
            // The step has no value to compare where a rounding decides on which side it is.
            if function == Activation::HardLimit {
                continue;
            }
            let transform = transforms[(number + other) % 3];
            let channels = [1, 3, 4][other % 3];
            let network = ElmParams::new(25)
                .with_activation(function.clone())
                .with_seed(3);
            let model = model(features, transform, network, channels);
            let expected = model.eval(&pairs).unwrap();
            let packed: Packed<f64> = Packed::new(&model).unwrap();
            // Weights are of the order of 1e3 at this strength, so that of 16 digits 12 are left.
            approx::assert_relative_eq!(
                packed.eval(&pairs).unwrap(),
                expected,
                epsilon = 1e-10,
                max_relative = 1e-10
            );
            let single: Packed<f32> = Packed::new(&model).unwrap();
            approx::assert_relative_eq!(
                single.eval(&pairs).unwrap(),
                expected,
                epsilon = 1e-2,
                max_relative = 1e-2
            );
        }
    }
}

#[test]
fn a_row_does_not_depend_on_the_rows_beside_it() {
    let network = ElmParams::new(20).with_activation(Activation::SquaredRelu);
    let model = model(
        Features::Algebraic,
        TargetTransform::default_log(),
        network,
        3,
    );
    let packed: Packed<f32> = Packed::new(&model).unwrap();
    let pairs = directions(2 * ROWS + 5);
    let all = packed.eval(&pairs).unwrap();
    for first in [0, 1, ROWS - 1, ROWS, 2 * ROWS + 4] {
        let one = packed.eval(&pairs[first..=first]).unwrap();
        assert_eq!(one.row(0), all.row(first), "{first}");
    }
    assert_eq!(packed.eval(&[]).unwrap().dim(), (0, 3));
}

#[test]
fn neurons_of_two_functions_are_evaluated_each_by_its_own() {
    let network = ElmParams::new(7)
        .with_activation(Activation::Sine)
        .with_group(elm::NeuronGroup::new(5, Activation::SquaredRelu))
        .with_group(elm::NeuronGroup::new(4, Activation::Tanh));
    let model = model(
        Features::Cosines,
        TargetTransform::default_log(),
        network,
        3,
    );
    let packed: Packed<f64> = Packed::new(&model).unwrap();
    let pairs = directions(70);
    let expected = model.eval(&pairs).unwrap();
    approx::assert_relative_eq!(packed.eval(&pairs).unwrap(), expected, epsilon = 1e-10);
}

#[test]
fn below_the_horizon_and_for_what_is_no_direction_values_are_black_or_finite() {
    let network = ElmParams::new(20).with_activation(Activation::Relu);
    let model = model(
        Features::Algebraic,
        TargetTransform::default_log(),
        network,
        3,
    );
    let packed: Packed<f32> = Packed::new(&model).unwrap();
    let up = [0.0, 0.0, 1.0];
    let pair = |incident: [f64; 3]| DirectionPair {
        incident,
        outgoing: up,
    };
    let below = [pair([0.6, 0.0, -0.8]), pair([1.0, 0.0, 0.0])];
    assert!(
        packed
            .eval(&below)
            .unwrap()
            .iter()
            .all(|&value| value == 0.0)
    );
    let strange = [f32::NAN, f32::INFINITY, 1e38].map(|z| [vec![0.0], vec![z], vec![1.0]]);
    for incident in strange {
        let outgoing = [vec![0.0], vec![0.0], vec![1.0]];
        let columns = Columns::from_components(incident, outgoing).unwrap();
        let mut values = [0.0; 3];
        packed.eval_into(&columns, &mut values).unwrap();
        assert!(values.iter().all(|value| value.is_finite()), "{values:?}");
    }
    let nan = [pair([f64::NAN, 0.0, 1.0])];
    assert!(packed.eval(&nan).is_err());
}

#[test]
fn what_does_not_fit_is_refused() {
    let own = Activation::custom("cube", |z: f64| z * z * z);
    let networks = [
        (ElmParams::new(9).with_activation(own), "own"),
        (ElmParams::new(9).with_direct_links(true), "transforms"),
        (
            ElmParams::new(9)
                .with_activation(Activation::Gaussian)
                .with_node_type(NodeType::Rbf),
            "radial",
        ),
    ];
    for (network, part) in networks {
        let model = model(Features::Cosines, TargetTransform::Identity, network, 1);
        let error = Packed::<f32>::new(&model).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
    let model = model(
        Features::Cosines,
        TargetTransform::Identity,
        ElmParams::new(9),
        1,
    );
    let packed: Packed<f64> = Packed::new(&model).unwrap();
    let columns = Columns::new(&directions(4));
    assert!(packed.eval_into(&columns, &mut [0.0; 3]).is_err());
    let uneven = Columns::from_components(
        [vec![0.0], vec![0.0], vec![1.0]],
        [vec![0.0], vec![0.0, 1.0], vec![1.0]],
    );
    assert!(uneven.is_err());
}

#[test]
fn a_model_of_many_channels_is_that_of_each_by_itself() {
    let network = ElmParams::new(20).with_activation(Activation::SquaredRelu);
    let model = model(Features::Algebraic, TargetTransform::CubeRoot, network, 7);
    let packed: Packed<f64> = Packed::new(&model).unwrap();
    let pairs = directions(80);
    let (values, expected) = (packed.eval(&pairs).unwrap(), model.eval(&pairs).unwrap());
    for channel in 0..7 {
        approx::assert_relative_eq!(
            values.index_axis(Axis(1), channel),
            expected.index_axis(Axis(1), channel),
            epsilon = 1e-10
        );
    }
}
