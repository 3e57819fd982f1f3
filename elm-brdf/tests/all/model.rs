//! Fitted reflectance models: sane everywhere, and the same after a file.

use std::f64::consts::{FRAC_PI_2, PI};

use elm::{Activation, ElmParams, persist};
use elm_datasets::{Invalid, MaterialId, OpenOptions, paint, synthetic};
use ndarray::{Array2, s};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use elm_brdf::features::Features;
use elm_brdf::metrics::{Metric, Metrics};
use elm_brdf::model::{BrdfModel, BrdfParams, Tuned};
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::Brdf;
use elm_datasets::geometry::{DirectionPair, cartesian};

/// Directions of every kind: anywhere above the surface, grazing, coincident, mirrored.
fn directions(count: usize, seed: u64) -> Vec<DirectionPair> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|kind| {
            let mut theta = || match kind % 4 {
                0 => FRAC_PI_2 - random.random_range(0.0..1e-6),
                _ => random.random_range(0.0..FRAC_PI_2),
            };
            let (theta_i, theta_o) = (theta(), theta());
            let phi = random.random_range(-PI..PI);
            let incident = cartesian(theta_i, phi);
            DirectionPair {
                incident,
                outgoing: match kind % 5 {
                    0 => incident,
                    1 => cartesian(theta_i, phi + PI),
                    _ => cartesian(theta_o, random.random_range(-PI..PI)),
                },
            }
        })
        .collect()
}

fn measured(material: usize) -> (Vec<DirectionPair>, Array2<f64>) {
    let id = MaterialId::new(material).unwrap();
    let data = synthetic::measurements(1, &[id], Invalid::Clamp);
    let samples = data.samples(0).unwrap();
    (samples.directions, samples.values)
}

fn tuned(features: Option<Features>) -> Tuned {
    Tuned {
        features,
        neurons: Some(40),
        ..Tuned::default()
    }
}

#[test]
fn values_are_finite_and_not_negative_for_every_pair_of_directions() {
    let (pairs, values) = measured(7);
    let few = tuned(None).fit_model(&pairs, values.view()).unwrap();
    let paint = paint::samples(3200, 1).unwrap();
    let many = tuned(None)
        .fit_model(&paint.directions, paint.values.view())
        .unwrap();
    for model in [few, many] {
        let values = model.eval(&directions(20_000, 3)).unwrap();
        assert!(values.iter().all(|&v| v.is_finite() && v >= 0.0));
    }
}

/// The models of `docs/reports/accuracy.md`, at a million pairs each.
#[test]
#[ignore = "needs data: rgl"]
fn a_million_values_of_each_rgl_material_are_finite_and_not_negative() {
    let Some(rgl) = elm_test_support::folder("rgl") else {
        return;
    };
    let everywhere = directions(1_000_000, 4);
    for material in ["cc_iris_purple_gem", "paper_white", "vch_golden_yellow"] {
        let file = rgl.join(format!("{material}_rgb_train.csv"));
        let samples = elm_datasets::open(&file, &OpenOptions::default())
            .unwrap()
            .samples;
        let tuned = Tuned {
            metric: Metric::LogCosine,
            max_floats: Some(675),
            ..Tuned::default()
        };
        let pairs = &samples.directions;
        let model = tuned.fit_model(pairs, samples.values.view()).unwrap();
        assert!(model.stored_floats() <= 675);
        let values = model.eval(&everywhere).unwrap();
        assert!(
            values.iter().all(|&v| v.is_finite() && v >= 0.0),
            "{material}"
        );
    }
}

#[test]
fn a_metallic_paint_from_one_in_a_hundred_thousand_to_six_hundred_is_met_over_its_whole_range() {
    let (train, test) = (
        paint::samples(4000, 1).unwrap(),
        paint::samples(1000, 2).unwrap(),
    );
    let tuned = Tuned {
        metric: Metric::LogCosine,
        neurons: Some(120),
        ..Tuned::default()
    };
    let model = tuned
        .fit_model(&train.directions, train.values.view())
        .unwrap();
    let pairs = &test.directions;
    let predicted = model.eval(pairs).unwrap();
    let ceiling = TargetTransform::HEADROOM * train.values.iter().copied().fold(0.0, f64::max);
    assert!(predicted.iter().all(|&v| (0.0..=ceiling).contains(&v)));
    let errors = Metrics::of(pairs, predicted.view(), test.values.view()).unwrap();
    // Of logarithms: black is off by the mean of all, and a constant by half of that at best.
    let black = Array2::zeros(test.values.dim());
    let black = Metrics::of(pairs, black.view(), test.values.view()).unwrap();
    assert!(
        errors.log_cosine_mae < 0.05 * black.log_cosine_mae,
        "{errors:?} {black:?}"
    );
}

#[test]
fn a_model_of_reciprocal_inputs_is_reciprocal_to_the_last_bit() {
    let (pairs, values) = measured(39);
    for set in Features::ALL.into_iter().filter(|set| set.is_reciprocal()) {
        let model = tuned(Some(set)).fit_model(&pairs, values.view()).unwrap();
        let there = directions(500, 5);
        let back: Vec<DirectionPair> = there.iter().map(|pair| pair.swapped()).collect();
        assert_eq!(
            model.eval(&there).unwrap(),
            model.eval(&back).unwrap(),
            "{set}"
        );
    }
}

#[test]
fn below_either_horizon_a_model_is_black() {
    let (pairs, values) = measured(39);
    let model = tuned(None).fit_model(&pairs, values.view()).unwrap();
    let (above, below) = (cartesian(0.4, 0.0), cartesian(2.0, 1.0));
    for (incident, outgoing) in [(above, below), (below, above), (below, below)] {
        let value = model.eval(&[DirectionPair { incident, outgoing }]).unwrap();
        assert!(value.iter().all(|&v| v == 0.0));
    }
}

/// Models of every kind of layer: of few measurements, of a given size, of many, given, laid on rows,
/// with direct links.
fn kinds() -> Vec<BrdfModel> {
    let (pairs, values) = measured(12);
    let paint = paint::samples(3200, 1).unwrap();
    let params = |network: ElmParams<f64>| BrdfParams {
        features: Features::HalfDiff,
        transform: TargetTransform::CubeRoot,
        network,
    };
    let plain = ElmParams::new(20).with_activation(Activation::Tanh);
    vec![
        Tuned::default()
            .fit_model(&pairs, values.slice(s![.., ..1]))
            .unwrap(),
        tuned(Some(Features::SumDifference))
            .fit_model(&pairs, values.view())
            .unwrap(),
        tuned(Some(Features::Highlight))
            .fit_model(&paint.directions, paint.values.view())
            .unwrap(),
        params(plain.clone())
            .fit_model(&pairs, values.view())
            .unwrap(),
        params(plain.clone().with_biases(elm::Biases::AtTrainingRows))
            .fit_model(&pairs, values.view())
            .unwrap(),
        params(plain.with_direct_links(true))
            .fit_model(&pairs, values.view())
            .unwrap(),
    ]
}

#[test]
fn models_come_back_from_files_of_both_forms_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    for (kind, model) in kinds().into_iter().enumerate() {
        for name in ["model.elm", "model.json"] {
            let path = dir.path().join(name);
            model.save(&path).unwrap();
            let again = BrdfModel::load(&path).unwrap();
            let at = directions(100, 1);
            assert_eq!(again.eval(&at).unwrap(), model.eval(&at).unwrap(), "{kind}");
            assert_eq!(again.stored_floats(), model.stored_floats());
            assert_eq!(again.provenance(), model.provenance());
        }
    }
}

#[test]
fn stored_numbers_are_those_that_the_file_holds() {
    let [few, sized, pruned, given, on_rows, linked] = kinds().try_into().unwrap();
    // Weights; for each input its mean, its factor and its scale; constant, offset and ceiling; a bit for
    // each neuron drawn, two for one that is kept.
    let (neurons, inputs) = (few.network().hidden().neurons(), few.network().inputs());
    assert_eq!(
        few.stored_floats(),
        neurons + 3 * inputs + 3 + (2 * neurons).div_ceil(32)
    );
    assert_eq!(few.stored_floats(), 205);
    assert_eq!(
        sized.stored_floats(),
        (40 + 3) * 3 + 4 + 8 + 80_usize.div_ceil(32)
    );
    // 160 drawn, a bit each.
    let channels = pruned.channels();
    assert_eq!(
        pruned.stored_floats(),
        (40 + 3) * channels + 4 + 8 + 160 / 32
    );
    // Five inputs; the ceiling of a cube root.
    assert_eq!(given.stored_floats(), (20 + 2) * 3 + 10);
    // The layer itself too.
    assert_eq!(on_rows.stored_floats(), given.stored_floats() + 20 * 6);
    // An output weight more for each input and channel.
    assert_eq!(linked.stored_floats(), given.stored_floats() + 5 * 3);
    let bytes = persist::to_bytes(&pruned).unwrap();
    assert!(
        bytes.len() < 8 * pruned.stored_floats() + 1200,
        "{}",
        bytes.len()
    );
}

#[test]
fn no_more_numbers_are_stored_than_allowed() {
    let (pairs, values) = measured(3);
    let paint = paint::samples(3200, 1).unwrap();
    let many = &paint.directions;
    for most in [40, 100, 675] {
        let tuned = Tuned {
            max_floats: Some(most),
            ..Tuned::default()
        };
        for model in [
            tuned.fit_model(&pairs, values.view()).unwrap(),
            tuned.fit_model(many, paint.values.view()).unwrap(),
        ] {
            let stored = model.stored_floats();
            assert!(stored <= most && stored + 4 > most, "{stored} of {most}");
        }
    }
    let none = Tuned {
        max_floats: Some(10),
        ..Tuned::default()
    };
    assert!(none.fit_model(&pairs, values.view()).is_err());
}

#[test]
fn one_seed_gives_one_model_and_another_gives_another() {
    let (pairs, values) = measured(3);
    let fit = |seed: u64| {
        let tuned = Tuned {
            seed,
            ..tuned(None)
        };
        tuned.fit_model(&pairs, values.view()).unwrap()
    };
    assert_eq!(fit(1), fit(1));
    assert_ne!(fit(1), fit(2));
}

#[test]
fn damaged_and_lying_files_are_refused() {
    let (pairs, values) = measured(3);
    let model = tuned(Some(Features::SumDifference))
        .fit_model(&pairs, values.view())
        .unwrap();
    let bytes = persist::to_bytes(&model).unwrap();
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x55;
        assert!(
            persist::from_bytes::<BrdfModel>(&damaged).is_err(),
            "byte {at}"
        );
        assert!(persist::from_bytes::<BrdfModel>(&bytes[..at]).is_err());
    }
    let json = persist::to_json(&model).unwrap();
    let lie = |from: &str, to: &str| {
        assert!(json.contains(from), "{from}");
        let text = json.replacen(from, to, 1);
        assert!(
            persist::from_bytes::<BrdfModel>(text.as_bytes()).is_err(),
            "{to}"
        );
    };
    lie("\"sum-difference\"", "\"half-diff\"");
    lie("\"sum-difference\"", "\"no such inputs\"");
    // More neurons than there are weights, and more than memory holds.
    let (_, rest) = json.split_once("\"count\": ").unwrap();
    let digits = rest.split(|c: char| !c.is_ascii_digit()).next().unwrap();
    let count: usize = digits.parse().unwrap();
    let neurons = format!("\"count\": {count}");
    lie(&neurons, &format!("\"count\": {}", count + 1));
    lie(&neurons, "\"count\": 18446744073709551615");
    lie("\"offset\": ", "\"offset\": -");
    lie("elm-brdf model", "elm model");
}

#[test]
fn bad_measurements_are_refused_and_name_the_place() {
    let (pairs, values) = measured(3);
    let mut bad = values.clone();
    bad[[7, 1]] = f64::NAN;
    for (pairs, values) in [
        (&pairs[..], bad.view()),
        (&pairs[..10], values.view()),
        (&[][..], values.slice(s![..0, ..])),
    ] {
        assert!(tuned(None).fit_model(pairs, values).is_err());
    }
    // A single measurement makes a constant.
    let one = tuned(None)
        .fit_model(&pairs[..1], values.slice(s![..1, ..]))
        .unwrap();
    assert!(one.eval(&pairs).unwrap().iter().all(|v| v.is_finite()));
}
