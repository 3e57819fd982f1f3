//! Choosing between settings by held-out error, all in closed form:
//!
//! `cargo run --release -p elm-learn --example selection`

#![allow(clippy::print_stdout)]

use std::error::Error;

use elm::{Activation, Dataset, ElmParams};
use elm_datasets::toy;
use ndarray::Axis;

fn main() -> Result<(), Box<dyn Error>> {
    let rows = toy::friedman1(500, 1.0, 1)?;
    let targets = rows.targets.remove_axis(Axis(1));
    let data = Dataset::new(&rows.inputs, &targets)?;
    let folds = data.folds(10, 1)?;
    println!("activation   scale  10-fold rmse");
    for activation in [Activation::Sigmoid, Activation::Tanh, Activation::Sine] {
        for scale in [0.03, 0.1, 0.3, 1.0] {
            let params = ElmParams::new(200)
                .with_activation(activation.clone())
                .with_scale(scale);
            let rmse = params.cross_val_predict(&data, &folds)?.rmse();
            println!("{activation:<12} {scale:<6} {rmse:.3}");
        }
    }

    let shared = ElmParams::auto().with_per_input(false).tune(&data)?;
    let own = ElmParams::auto().tune(&data)?;
    let deviation = targets.std(0.0);
    println!(
        "tuned, one scale:        {:.3}",
        shared.best.score * deviation
    );
    println!("tuned, scale per input:  {:.3}", own.best.score * deviation);
    println!("(noise in the targets: 1; inputs 6 to 10 say nothing)");
    println!("scales: {:.2?}", own.params.relevance(10));
    Ok(())
}
