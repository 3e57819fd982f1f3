//! What other materials teach.

use elm::persist;
use elm_brdf::metrics::Metrics;
use elm_brdf::model::Tuned;
use elm_brdf::prior::{Prior, PriorParams};
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;
use elm_datasets::{Invalid, MaterialId, synthetic};
use ndarray::{Array2, Axis, concatenate, s};

/// The first channel of these of the synthetic materials, side by side.
fn materials(numbers: impl Iterator<Item = usize>) -> (Vec<DirectionPair>, Array2<f64>) {
    let ids: Vec<MaterialId> = numbers.map(|n| MaterialId::new(n).unwrap()).collect();
    let data = synthetic::measurements(1, &ids, Invalid::Clamp);
    let columns: Vec<_> = data
        .materials
        .iter()
        .map(|m| m.values.slice(s![.., ..1]))
        .collect();
    let values = concatenate(Axis(1), &columns).unwrap();
    (data.directions, values)
}

fn small() -> PriorParams {
    PriorParams {
        neurons: 90,
        ..PriorParams::default()
    }
}

fn rmse(model: &dyn Brdf, pairs: &[DirectionPair], truth: &Array2<f64>) -> f64 {
    let predicted = model.eval(pairs).unwrap();
    Metrics::of(pairs, predicted.view(), truth.view())
        .unwrap()
        .rmse
}

#[test]
fn with_a_prior_few_measurements_do_better_than_without() {
    let (pairs, values) = materials(1..=24);
    let prior = PriorParams::default().build(&pairs, values.view()).unwrap();
    let (mut with, mut without) = (0.0, 0.0);
    for material in (0..24).step_by(4) {
        let truth = values.slice(s![.., material..=material]).to_owned();
        let prior = prior.without(&[material]).unwrap();
        let rows: Vec<usize> = (3..205).step_by(9).collect();
        let at: Vec<DirectionPair> = rows.iter().map(|&row| pairs[row]).collect();
        let few = truth.select(Axis(0), &rows);
        let taught = prior.fit_model(&at, few.view()).unwrap();
        let alone = Tuned::default().fit_model(&at, few.view()).unwrap();
        with += rmse(&taught, &pairs, &truth).ln();
        without += rmse(&alone, &pairs, &truth).ln();
    }
    // Geometric means over six materials.
    assert!(
        with < without + 0.8_f64.ln() * 6.0,
        "{}",
        ((with - without) / 6.0).exp()
    );
}

#[test]
fn leaving_materials_out_is_building_without_them() {
    let (pairs, values) = materials(1..=9);
    let prior = small().build(&pairs, values.view()).unwrap();
    let others = values.select(Axis(1), &[0, 1, 3, 4, 5, 6, 8]);
    let built = small().build(&pairs, others.view()).unwrap();
    let left = prior.without(&[2, 7]).unwrap();
    assert_eq!(left.materials(), 7);
    let few = values.slice(s![..60, 2..3]);
    let [one, other] = [built, left].map(|prior| {
        let model = prior.fit_model(&pairs[..60], few).unwrap();
        model.eval(&pairs).unwrap()
    });
    approx::assert_abs_diff_eq!(one, other, epsilon = 1e-6);
    assert!(prior.without(&[0, 1, 2, 3, 4, 5, 6, 7]).is_err());
}

#[test]
fn what_is_fitted_with_a_prior_is_one_network_of_its_layer() {
    let (pairs, values) = materials(1..=6);
    let prior = small().build(&pairs, values.view()).unwrap();
    let two = values.slice(s![..40, ..2]);
    let model = prior.fit_model(&pairs[..40], two).unwrap();
    assert_eq!(model.network().hidden().neurons(), 90);
    assert_eq!(model.channels(), 2);
    // Weights, constant and transform of each channel, four means and factors.
    assert_eq!(model.stored_floats(), 2 * (90 + 1 + 2) + 8);
    let at_once = model.eval(&pairs).unwrap();
    let alone = prior
        .fit_model(&pairs[..40], values.slice(s![..40, 1..2]))
        .unwrap();
    let one = alone.eval(&pairs).unwrap();
    approx::assert_abs_diff_eq!(at_once.column(1), one.column(0), epsilon = 1e-9);
}

#[test]
fn a_prior_comes_back_from_its_file_and_a_damaged_one_is_refused() {
    let (pairs, values) = materials(1..=4);
    let params = PriorParams {
        neurons: 12,
        ..PriorParams::default()
    };
    let prior = params
        .build(&pairs, values.view())
        .unwrap()
        .with_source("four".to_owned());
    let bytes = persist::to_bytes(&prior).unwrap();
    let again: Prior = persist::from_bytes(&bytes).unwrap();
    assert_eq!(again, prior);
    let json = persist::to_json(&prior).unwrap();
    assert_eq!(
        persist::from_bytes::<Prior>(json.as_bytes()).unwrap(),
        prior
    );
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x11;
        assert!(persist::from_bytes::<Prior>(&damaged).is_err(), "byte {at}");
    }
    for (from, to) in [
        ("\"count\": 4", "\"count\": 400000000000"),
        ("sum-difference", "paper"),
    ] {
        assert!(json.contains(from), "{from}");
        let lie = json.replacen(from, to, 1);
        assert!(
            persist::from_bytes::<Prior>(lie.as_bytes()).is_err(),
            "{to}"
        );
    }
}

#[test]
fn a_single_material_is_no_prior_and_a_single_measurement_is_enough_for_a_model() {
    let (pairs, values) = materials(1..=4);
    assert!(small().build(&pairs, values.slice(s![.., ..1])).is_err());
    let prior = small().build(&pairs, values.view()).unwrap();
    let one = prior
        .fit_model(&pairs[..1], values.slice(s![..1, ..1]))
        .unwrap();
    assert!(
        one.eval(&pairs)
            .unwrap()
            .iter()
            .all(|v| v.is_finite() && *v >= 0.0)
    );
}
