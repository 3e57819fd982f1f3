//! Fits, saves, loads, and asks the network that was loaded how sure it is:
//!
//! `cargo run --release -p elm-learn --example save_load`

#![allow(clippy::print_stdout)]

use std::error::Error;

use elm::uncertainty::CompactUncertainElm;
use elm::{Dataset, ElmParams, persist};
use elm_datasets::toy;
use ndarray::{Axis, Ix1};

fn main() -> Result<(), Box<dyn Error>> {
    let rows = toy::friedman3(500, 0.1, 1)?;
    let targets = rows.targets.remove_axis(Axis(1));
    let data = Dataset::new(&rows.inputs, &targets)?;
    let tuned = ElmParams::auto().tune(&data)?;

    let path = std::env::temp_dir().join("friedman3.elm");
    let fitted = tuned.params.fit_uncertain(&data)?.compact();
    persist::save(&fitted, &path)?;
    let model: CompactUncertainElm<f64, Ix1> = persist::load(&path)?;
    assert_eq!(model, fitted);
    println!("saved to and loaded from {}", path.display());

    let new = toy::friedman3(5, 0.1, 2)?;
    let (low, high) = model.predict_interval(&new.inputs, 0.9)?;
    let predicted = model.model().predict(&new.inputs)?;
    for row in 0..5 {
        println!(
            "predicted {:.3}, 90 % interval {:.3} to {:.3}, observed {:.3}",
            predicted[row],
            low[row],
            high[row],
            new.targets[[row, 0]],
        );
    }
    Ok(())
}
