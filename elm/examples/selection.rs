//! Choosing between settings by held-out error, all in closed form:
//!
//! `cargo run --release -p elm-learn --example selection`

#![allow(clippy::print_stdout)]

use std::error::Error;

use elm::validate::assign_folds;
use elm::{Activation, ElmParams};
use elm_datasets::toy;

fn main() -> Result<(), Box<dyn Error>> {
    let data = toy::friedman1(500, 1.0, 1)?;
    let folds = assign_folds(500, 10, 1)?;
    println!("activation   scale  10-fold rmse");
    for activation in [Activation::Sigmoid, Activation::Tanh, Activation::Sine] {
        for scale in [0.03, 0.1, 0.3, 1.0] {
            let params = ElmParams::new(200)
                .activation(activation.clone())
                .scale(scale)
                .check()?;
            let rmse = params
                .cross_validate(&data.inputs, &data.targets, &folds)?
                .rmse()[0];
            println!("{activation:<12} {scale:<6} {rmse:.3}");
        }
    }

    let shared = ElmParams::auto()
        .per_input(false)
        .tune(&data.inputs, &data.targets)?;
    let own = ElmParams::auto().tune(&data.inputs, &data.targets)?;
    let deviation = data.targets.std_axis(ndarray::Axis(0), 0.0)[0];
    println!(
        "tuned, one scale:        {:.3}",
        shared.best.score * deviation
    );
    println!("tuned, scale per input:  {:.3}", own.best.score * deviation);
    println!("(noise in the targets: 1; inputs 6 to 10 say nothing)");
    println!("scales: {:.2?}", own.best.input_scales);
    Ok(())
}
