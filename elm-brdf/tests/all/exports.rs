//! Models of everything that can be exported, and how far an evaluation in single precision may be off.

use elm::advanced::NeuronBlock;
use elm::{Activation, Biases, ElmParams, NeuronGroup, solve::Ridge};
use elm_brdf::features::Features;
use elm_brdf::fit::Fit;
use elm_brdf::model::{BrdfModel, BrdfParams, Provenance, Tuned};
use elm_brdf::recipes;
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::Brdf;
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::{Invalid, MaterialId, Samples, synthetic};
use ndarray::{Array2, s};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) fn samples(material: usize) -> Samples {
    let id = MaterialId::new(material).unwrap();
    let data = synthetic::measurements(1, &[id], Invalid::Clamp);
    data.samples(0).unwrap()
}

pub(crate) fn network(neurons: usize, activation: Activation<f64>) -> ElmParams<f64> {
    ElmParams::new(neurons)
        .with_activation(activation)
        .with_solver(Ridge::leave_one_out())
        .with_seed(3)
}

/// A model of everything that can be exported, each with the name of its functions.
pub(crate) fn models() -> Vec<(String, Box<dyn Brdf>)> {
    let mut all: Vec<(BrdfParams, usize)> = Vec::new();
    let mut add = |features, transform, network, channels| {
        all.push((
            BrdfParams {
                features,
                transform,
                network,
            },
            channels,
        ));
    };
    let log = TargetTransform::default_log();
    for features in Features::ALL {
        add(features, log, network(30, Activation::Sine), 3);
    }
    for activation in Activation::BUILT_IN {
        // 22 neurons leave two of the last four without one.
        add(Features::Cosines, log, network(22, activation), 3);
    }
    for transform in [TargetTransform::Identity, TargetTransform::CubeRoot] {
        add(
            Features::Highlight,
            transform,
            network(30, Activation::Tanh),
            3,
        );
    }
    add(
        Features::Cosines,
        log,
        network(9, Activation::Sigmoid).with_direct_links(true),
        1,
    );
    add(
        Features::Cosines,
        log,
        network(9, Activation::Tanh).with_standardize(false),
        1,
    );
    // Several functions in one layer, of sums and of distances.
    let mixed = network(10, Activation::Tanh)
        .with_group(NeuronGroup::new(7, Activation::Sine).with_biases(Biases::AtTrainingRows))
        .with_group(NeuronGroup::rbf(9).with_scale(0.5))
        .with_group(NeuronGroup::rbf(6).with_scale(0.2));
    add(Features::Highlight, log, mixed, 3);
    let samples = samples(7);
    let pairs = &samples.directions;
    let mut models: Vec<(String, Box<dyn Brdf>)> = all
        .into_iter()
        .enumerate()
        .map(|(index, (params, channels))| {
            let values = samples.values.slice(s![.., ..channels]);
            let model: Box<dyn Brdf> = Box::new(params.fit(pairs, values).unwrap());
            (format!("m{index}"), model)
        })
        .collect();
    models.extend(spectral(&samples));
    let usual = recipes::network(None);
    models.push((
        "usual".to_owned(),
        usual.fit(pairs, samples.values.view()).unwrap(),
    ));
    models
}

/// Spectra made of red, green and blue, with a basis and without, whose wavelengths are no multiple of four.
fn spectral(samples: &Samples) -> Vec<(String, Box<dyn Brdf>)> {
    let of = |count: usize| {
        let values = Array2::from_shape_fn((samples.values.nrows(), count), |(row, k)| {
            let x = 2.0 * k as f64 / (count - 1) as f64;
            let share = |place: f64| (1.0 - (x - place).abs()).max(0.0);
            let rgb = samples.values.row(row);
            rgb[2] * share(0.0) + rgb[1] * share(1.0) + rgb[0] * share(2.0)
        });
        let step = 300.0 / (count - 1) as f64;
        let names: Vec<String> = (0..count)
            .map(|k| format!("{} nm", 400.0 + step * k as f64))
            .collect();
        (values, names)
    };
    let pairs = &samples.directions;
    let colored = |model: BrdfModel, channels: Vec<String>| -> Box<dyn Brdf> {
        let about = Provenance {
            channels,
            ..model.provenance().clone()
        };
        Box::new(model.with_provenance(about).in_color().unwrap())
    };
    let tuned = Tuned {
        neurons: Some(30),
        ..Tuned::default()
    };
    let (values, names) = of(9);
    let few = tuned.fit_model(pairs, values.view()).unwrap();
    let cubes = BrdfParams {
        features: Features::Cosines,
        transform: TargetTransform::CubeRoot,
        network: network(22, Activation::Sine),
    };
    let (others, other_names) = of(6);
    let all = cubes.fit_model(pairs, others.view()).unwrap();
    vec![
        ("spectrum".to_owned(), colored(few, names)),
        ("cubes".to_owned(), colored(all, other_names)),
    ]
}

/// Random pairs and every special one, in single precision as the exports take them.
pub(crate) fn directions() -> Vec<DirectionPair> {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut pairs: Vec<DirectionPair> = (0..400)
        .map(|_| {
            let mut direction = || {
                cartesian(
                    random.random_range(0.0..1.7),
                    random.random_range(-3.2..3.2),
                )
            };
            DirectionPair {
                incident: direction(),
                outgoing: direction(),
            }
        })
        .collect();
    for theta in [0.0, 1e-4, 0.3, 0.785, 1.2, 1.55, 1.57] {
        let at = |phi| cartesian(theta, phi);
        for (incident, outgoing) in [
            (at(0.4), at(0.4)),
            (at(0.4), at(0.4 + std::f64::consts::PI)),
            (at(0.0), at(1.5)),
            (at(0.0), [0.0, 0.0, 1.0]),
            ([0.0, 0.0, -1.0], at(0.0)),
        ] {
            pairs.push(DirectionPair { incident, outgoing });
        }
    }
    let single = |w: [f64; 3]| w.map(|c| f64::from(c as f32));
    for pair in &mut pairs {
        *pair = DirectionPair {
            incident: single(pair.incident),
            outgoing: single(pair.outgoing),
        };
    }
    pairs
}

/// What the export should say: the model's value, or black.
fn expected(model: &dyn Brdf, pairs: &[DirectionPair]) -> Vec<[f64; 3]> {
    let values = model.eval(pairs).unwrap();
    values
        .rows()
        .into_iter()
        .zip(pairs)
        .map(|(row, pair)| {
            if pair.is_above_horizon() {
                [0, 1, 2].map(|c: usize| row[c.min(row.len() - 1)].max(0.0))
            } else {
                [0.0; 3]
            }
        })
        .collect()
}

/// Half the distance of numbers next to 1 in single precision: the relative error of a rounding.
const EPS: f64 = 5.960_464_477_539_063e-8;

/// By how much an evaluation in single precision may be off, channel by channel: roundings
/// followed through the network to first order, each taken at its worst. `None` for a
/// discontinuous activation within reach of its step.
///
/// exp is allowed the (3 + 2 |x|) units (2 EPS each) that WGSL and Vulkan allow, so that a saturating
/// activation, which takes exp of -2|z|, is off by at most 8 EPS; inputs are a handful of
/// correctly rounded operations and the arc tangent, 16 EPS with theirs.
fn bounds(model: &BrdfModel, pairs: &[DirectionPair]) -> Vec<Option<[f64; 3]>> {
    if model
        .target_transform()
        .to_targets(Array2::zeros((1, 3)).view())
        .is_err()
        && model.channels() == 3
    {
        // Of a spectrum the model's own account: the largest of the standard deviations of errors, or errors
        // themselves, over the hemisphere. Six of these are never reached.
        let most = 6.0 * model.single_precision_error().unwrap().largest;
        return vec![Some([most; 3]); pairs.len()];
    }
    let network = model.network();
    let hidden = network.hidden();
    let (inputs, neurons) = (network.inputs(), hidden.neurons());
    let beta = network.beta();
    let of_group = hidden.groups().iter();
    let groups: Vec<&NeuronBlock<f64>> = of_group
        .flat_map(|group| std::iter::repeat_n(group, group.neurons()))
        .collect();
    let factor = |i: usize| network.scaler().map_or(1.0, |s| s.factor()[i]);
    let mean = |i: usize| network.scaler().map_or(0.0, |s| s.mean()[i]);
    let x = model.features().compute(pairs);
    let values = model.eval(pairs).unwrap();
    (0..pairs.len())
        .map(|row| {
            let x = |i: usize| x[[row, i]];
            let input_error = |i: usize| 16.0 * EPS * (1.0 + x(i).abs());
            let outputs = beta.ncols();
            // Sums of magnitudes and of errors, by output.
            let (mut size, mut error) = (vec![0.0; outputs], vec![0.0; outputs]);
            let mut term = |k: usize, value: f64, off: f64| {
                for c in 0..outputs {
                    size[c] += (beta[[k, c]] * value).abs();
                    error[c] += beta[[k, c]].abs() * off;
                }
            };
            for (k, group) in groups.iter().enumerate() {
                let activation = group.activation();
                let (mut z, mut z_size, mut z_error) =
                    (hidden.biases()[k], hidden.biases()[k].abs(), 0.0);
                for i in 0..inputs {
                    let own = hidden.weights()[[i, k]];
                    if let Some(scales) = group.input_scales() {
                        // A distance moves by no more than what it is the length of.
                        let w = scales[i] * factor(i);
                        z += (w * (x(i) - mean(i)) - own).powi(2);
                        z_size += (w * x(i)).abs() + (w * mean(i)).abs() + own.abs();
                        z_error += w.abs() * input_error(i);
                        continue;
                    }
                    let w = own * factor(i);
                    z += w * (x(i) - mean(i));
                    z_size += (w * x(i)).abs() + (w * mean(i)).abs();
                    z_error += w.abs() * input_error(i);
                }
                if group.input_scales().is_some() {
                    z = z.sqrt();
                }
                z_error += (inputs + 3) as f64 * EPS * z_size;
                if *activation == Activation::HardLimit && z.abs() < z_error {
                    return None;
                }
                let value = activation.apply(z);
                // All are Lipschitz with constant 1 but the step, and the square, whose slope is 2z.
                // The sine reduces z first.
                let lipschitz = match activation {
                    Activation::HardLimit => 0.0,
                    Activation::SquaredRelu => z_error * (2.0 * z.abs() + z_error),
                    _ => z_error,
                };
                term(
                    k,
                    value,
                    lipschitz + EPS * (8.0 + 2.0 * z.abs() + value.abs()),
                );
            }
            for transform in neurons..beta.nrows() {
                let i = transform - neurons;
                let value = factor(i) * (x(i) - mean(i));
                let size = factor(i) * (x(i).abs() + mean(i).abs());
                term(
                    transform,
                    value,
                    factor(i) * input_error(i) + 4.0 * EPS * size,
                );
            }
            let bound = |c: usize| {
                let c = c.min(outputs - 1);
                let t = network.intercept()[c];
                let sum = (beta.nrows() + 4) as f64 * EPS * (size[c] + t.abs());
                let t_error = error[c] + sum;
                let value = values[[row, c]];
                // The slope of the transform's inverse, from its values a little to both sides: it is
                // monotonic, and the model's own target is not at hand.
                reach(model, c, value, t_error)
            };
            Some([bound(0), bound(1), bound(2)])
        })
        .collect()
}

/// How far the value may move when the target moves by `t_error`.
fn reach(model: &BrdfModel, channel: usize, value: f64, t_error: f64) -> f64 {
    let channels = model.channels();
    let transform = model.target_transform();
    let row = |value: f64| ndarray::Array2::from_elem((1, channels), value);
    let target = transform.to_targets(row(value).view()).unwrap()[[0, channel]];
    let at = |t: f64| transform.to_values(row(t)).unwrap()[[0, channel]];
    let reach = (at(target + t_error) - at(target)).max(at(target) - at(target - t_error));
    // The exponential and what follows it, of a value a little larger than the result.
    let scale = value.abs() + (at(target + 1.0) - at(target)).abs();
    reach + EPS * scale * (12.0 + 4.0 * target.abs())
}

/// Holds what an evaluation found against the model, and returns the largest relative error.
pub(crate) fn check(
    name: &str,
    model: &dyn Brdf,
    pairs: &[DirectionPair],
    found: &[[f64; 3]],
) -> f64 {
    assert_eq!(found.len(), pairs.len(), "{name}");
    let expected = expected(model, pairs);
    let bounds = bounds(BrdfModel::of(model).unwrap(), pairs);
    let mut worst: f64 = 0.0;
    let mut compared = 0;
    for (row, pair) in pairs.iter().enumerate() {
        for c in 0..3 {
            let (found, expected) = (found[row][c], expected[row][c]);
            if !pair.is_above_horizon() {
                assert_eq!(found, 0.0, "{name} {pair:?}");
                continue;
            }
            let Some(bound) = bounds[row] else { continue };
            let error = (found - expected).abs();
            assert!(
                error <= bound[c],
                "{name} {pair:?}: {found} for {expected}, off by {error}, bound {}",
                bound[c]
            );
            worst = worst.max(error / (expected.abs() + 1e-3));
            compared += 1;
        }
    }
    assert!(
        compared > 3 * pairs.len() / 2,
        "{name}: {compared} compared"
    );
    worst
}
