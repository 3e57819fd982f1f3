//! Learning from rows that arrive in chunks, on two machines, in little memory:
//!
//! `cargo run --release -p elm-learn --example online`

#![allow(clippy::print_stdout)]

use std::error::Error;

use elm::solve::Ridge;
use elm::{Accumulator, Activation, ElmParams, metrics};
use elm_datasets::toy;
use ndarray::Axis;

fn main() -> Result<(), Box<dyn Error>> {
    let params = ElmParams::new(400)
        .with_activation(Activation::Tanh)
        .with_scale(0.05)
        .with_solver(Ridge::gcv());
    let test = toy::friedman1(5_000, 0.0, 99)?;
    let truth = test.noiseless.remove_axis(Axis(1));

    // Scaling and layer are fixed by a first sample, so that every accumulator has the same.
    let sample = toy::friedman1(1_000, 1.0, 0)?;
    let (mut here, mut there) = (
        Accumulator::from_sample(&params, &sample.inputs, 1)?,
        Accumulator::from_sample(&params, &sample.inputs, 1)?,
    );
    for chunk in 1..=20 {
        let rows = toy::friedman1(1_000, 1.0, chunk)?;
        let target = if chunk % 2 == 0 {
            &mut here
        } else {
            &mut there
        };
        target.push(&rows.inputs, &rows.targets.remove_axis(Axis(1)))?;
        if chunk % 5 == 0 {
            // What each has seen so far, put together; both go on.
            let mut both = here.clone();
            both.merge(&there)?;
            let model = both.fit()?;
            let predicted = model.predict(&test.inputs)?;
            let rmse = metrics::rmse(&predicted, &truth)?;
            println!("{:>6} rows: rmse {rmse:.3}", chunk * 1_000);
        }
    }
    Ok(())
}
