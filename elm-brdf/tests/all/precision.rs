//! What single precision costs: known before anything is exported.

use elm::solve::Ridge;
use elm::{Activation, ElmParams};
use elm_brdf::batch::Packed;
use elm_brdf::export::{ExportError, Language, source};
use elm_brdf::features::Features;
use elm_brdf::metrics::Metrics;
use elm_brdf::model::{BrdfModel, BrdfParams};
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::Brdf;
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::{Invalid, MaterialId, synthetic};
use ndarray::array;

/// A network of sine neurons that hardly differ from each other, so that without a ridge worth the
/// name their weights nearly cancel.
fn model(lambda: f64) -> BrdfModel {
    let data = synthetic::measurements(1, &[MaterialId::new(7).unwrap()], Invalid::Clamp);
    let samples = data.samples(0).unwrap();
    let params = BrdfParams {
        features: Features::ReciprocalCosines,
        transform: TargetTransform::default_log(),
        network: ElmParams::new(120)
            .with_activation(Activation::Sine)
            .with_scale(0.05)
            .with_solver(Ridge::relative(lambda)),
    };
    params
        .fit_model(&samples.directions, samples.values.view())
        .unwrap()
}

/// Root mean square of the difference between the packed evaluator in `f32` and the model, over a
/// grid of directions.
fn measured(model: &BrdfModel) -> f64 {
    let mut grid = Vec::new();
    for theta_i in 0..15 {
        for theta_o in 0..15 {
            for phi in 0..12 {
                grid.push(DirectionPair {
                    incident: cartesian(f64::from(theta_i) * 0.1, 0.0),
                    outgoing: cartesian(f64::from(theta_o) * 0.1, f64::from(phi) * 0.3),
                });
            }
        }
    }
    let single = Packed::<f32>::new(model).unwrap().eval(&grid).unwrap();
    let difference = single - model.eval(&grid).unwrap();
    (difference.iter().map(|d| d * d).sum::<f64>() / difference.len() as f64).sqrt()
}

#[test]
fn the_error_of_single_precision_is_foretold_and_not_far_too_large() {
    for lambda in [1e-4, 1e-8, 1e-12] {
        let model = model(lambda);
        let (found, measured) = (model.single_precision_error().unwrap(), measured(&model));
        let ratio = found.rmse / measured;
        // Each rounding counts at its bound, some 2.5 times its root mean square, and each function
        // with one more than this evaluator's make; directions near the mirror direction, where
        // inputs round most, are a quarter of those surveyed.
        assert!(
            (0.5..30.0).contains(&ratio),
            "{lambda}: {found:?} {measured}"
        );
        assert!(found.largest >= found.rmse && found.scale > 0.0);
    }
}

/// The model with `times` its error of single precision for a held-out RMSE.
fn with_held_out(model: &BrdfModel, times: f64) -> BrdfModel {
    let pairs = [DirectionPair {
        incident: cartesian(0.3, 0.0),
        outgoing: cartesian(0.5, 1.0),
    }];
    let error = times * model.single_precision_error().unwrap().rmse;
    let mut about = model.provenance().clone();
    let one = array![[1.0]];
    about.held_out = Some(Metrics::of(&pairs, (&one + error).view(), one.view()).unwrap());
    model.clone().with_provenance(about)
}

#[test]
fn a_model_that_single_precision_would_spoil_is_not_exported() {
    let model = model(1e-12);
    for language in [Language::C, Language::Glsl, Language::Hlsl, Language::Wgsl] {
        // A quarter of the held-out error is the limit.
        assert!(source(&with_held_out(&model, 4.1), language, "m").is_ok());
        let error = source(&with_held_out(&model, 3.9), language, "m").unwrap_err();
        assert!(
            matches!(
                error,
                elm_brdf::Error::Export(ExportError::Precision { .. })
            ),
            "{error}"
        );
        let message = error.to_string();
        assert!(
            message.contains("--neurons") && !message.contains('\n'),
            "{message}"
        );
    }
}

#[test]
fn held_out_errors_set_the_limit_where_there_are_any() {
    let error = model(1e-4).single_precision_error().unwrap();
    assert_eq!(error.limit(Some(0.4)), 0.1);
    assert_eq!(error.limit(None), 0.01 * error.scale);
    // Of a model that meets its measurements exactly nothing better than roundings is asked.
    assert_eq!(error.limit(Some(0.0)), 1e-5 * error.scale);
}
