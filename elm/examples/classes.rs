//! Classes and their probabilities, and how far these can be trusted:
//!
//! `cargo run --release -p elm-learn --example classes`

#![allow(clippy::print_stdout)]

use std::error::Error;

use elm::ElmParams;
use elm::classify::{ClassWeights, LabeledRows};
use elm::metrics::{accuracy, calibration_error, confusion_matrix, log_loss};
use elm_datasets::toy;
use ndarray::Array2;

/// The value of a noisy function, in three parts.
fn labels(targets: &Array2<f64>) -> Vec<&'static str> {
    let label = |&t: &f64| match t {
        t if t < 11.0 => "low",
        t if t < 17.0 => "middle",
        _ => "high",
    };
    targets.iter().map(label).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let rows = toy::friedman1(500, 1.0, 1)?;
    let new = toy::friedman1(5000, 1.0, 2)?;
    let (known, truth) = (labels(&rows.targets), labels(&new.targets));

    let data = LabeledRows::new(&rows.inputs, &known)?.with_class_weights(ClassWeights::Equal)?;
    let tuned = ElmParams::auto().tune_classifier(&data)?;
    let model = tuned.classifier;
    let p = model.predict_proba(&new.inputs)?;
    let predicted = model.predict(&new.inputs)?;
    let classes = model.classes();
    println!("{} neurons, classes {classes:?}", tuned.best.neurons);
    println!("accuracy {:.3}", accuracy(&predicted, &truth)?);
    println!("log loss {:.3}", log_loss(&p, &truth, classes)?);
    println!(
        "calibration error {:.3}",
        calibration_error(&p, &truth, classes, 10)?
    );
    println!(
        "true classes down, predicted across:\n{}",
        confusion_matrix(&predicted, &truth, classes)?
    );
    Ok(())
}
