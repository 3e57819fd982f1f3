//! What being reciprocal by construction costs: the tuned network on every set of inputs, the table
//! of 'Reciprocal or not' in `docs/reports/accuracy.md`.
//!
//! `cargo run --release -p elm-benches --bin inputs -- CURET_DIR [SEEDS]`

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::PathBuf;

use elm_brdf::features::Features;
use elm_brdf::model::Tuned;
use elm_brdf::protocol::{Folds, cross_validate};
use elm_datasets::{Invalid, MaterialId, curet};

fn main() -> Result<(), Box<dyn Error>> {
    elm_benches::timing::use_threads(1);
    let mut arguments = std::env::args().skip(1);
    let dir = PathBuf::from(arguments.next().ok_or("usage: inputs CURET_DIR [SEEDS]")?);
    let seeds: u64 = arguments.next().map_or(Ok(5), |seeds| seeds.parse())?;
    let ids: Vec<MaterialId> = MaterialId::all().collect();
    let data = curet::read(&dir, &ids, Invalid::Clamp)?;
    println!(
        "Mean held-out RMSE over {} materials and seeds 1 to {seeds} (range over seeds), and the geometric mean over materials\n",
        ids.len()
    );
    println!("| inputs | reciprocal | mean | geometric mean |");
    println!("|---|---|---|---|");
    for features in Features::ALL {
        let (mut means, mut logs) = (Vec::new(), Vec::new());
        for seed in 1..=seeds {
            let tuned = Tuned {
                features: Some(features),
                seed,
                ..Tuned::default()
            };
            let folds = Folds::new(data.directions.len(), 10, seed)?;
            let scores = cross_validate(&tuned, &data, &folds, |_, _| {})?;
            let errors: Vec<f64> = scores
                .iter()
                .flat_map(|material| &material.channels)
                .map(|channel| channel.held_out.rmse)
                .collect();
            let count = errors.len() as f64;
            means.push(errors.iter().sum::<f64>() / count);
            logs.push(errors.iter().map(|error| error.ln()).sum::<f64>() / count);
        }
        let count = means.len() as f64;
        println!(
            "| {} | {} | {:.4} ({:.4} to {:.4}) | {:.4} |",
            features.name(),
            if features.is_reciprocal() {
                "yes"
            } else {
                "no"
            },
            means.iter().sum::<f64>() / count,
            means.iter().copied().fold(f64::INFINITY, f64::min),
            means.iter().copied().fold(0.0, f64::max),
            (logs.iter().sum::<f64>() / count).exp(),
        );
    }
    Ok(())
}
