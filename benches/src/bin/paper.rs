//! How the paper's method fares by number of neurons, over several seeds: the table of
//! `docs/reports/paper.md`.
//!
//! `cargo run --release -p elm-benches --bin paper -- CURET_DIR`

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::PathBuf;

use elm::ElmParams;
use elm::solve::{PseudoInverse, Ridge, Solver};
use elm_brdf::features::Features;
use elm_brdf::model::BrdfParams;
use elm_brdf::protocol::{Folds, MaterialScores, Scores, cross_validate};
use elm_brdf::published;
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::{Invalid, Measurements, curet};

const SEEDS: u64 = 8;

fn main() -> Result<(), Box<dyn Error>> {
    elm_benches::timing::use_threads(1);
    let dir = std::env::args()
        .nth(1)
        .map(PathBuf::from)
        .ok_or("usage: paper CURET_DIR")?;
    let data = curet::read(&dir, &published::materials(), Invalid::Clamp)?;
    println!(
        "| neurons | held-out ratio, mean (range) | training ratio, mean (range) | correlation held out | correlation training |"
    );
    println!("|---|---|---|---|---|");
    for neurons in [10, 20, 30, 50, 80, 100, 120] {
        row(
            &data,
            &neurons.to_string(),
            neurons,
            PseudoInverse::default().into(),
        )?;
    }
    row(
        &data,
        "200, ridge by leave-one-out",
        200,
        Ridge::leave_one_out().into(),
    )
}

fn row(
    data: &Measurements,
    label: &str,
    neurons: usize,
    solver: Solver,
) -> Result<(), Box<dyn Error>> {
    let mut figures: Vec<[f64; 4]> = Vec::new();
    for seed in 1..=SEEDS {
        let network = ElmParams::new(neurons)
            .with_solver(solver)
            .with_intercept(false)
            .with_seed(seed);
        let params = BrdfParams {
            features: Features::Paper,
            transform: TargetTransform::Identity,
            network,
        };
        let folds = Folds::new(data.directions.len(), 10, seed)?;
        let scores = cross_validate(&params, data, &folds, |_, _| {})?;
        figures.push([
            ratio(data, &scores, |scores| scores.held_out.rmse),
            ratio(data, &scores, |scores| scores.train.rmse),
            correlation(data, &scores, |scores| scores.held_out.correlation),
            correlation(data, &scores, |scores| scores.train.correlation),
        ]);
    }
    let column = |i: usize| figures.iter().map(move |f| f[i]);
    let mean = |i: usize| column(i).sum::<f64>() / SEEDS as f64;
    let range = |i: usize| {
        let (low, high) = (
            column(i).fold(f64::MAX, f64::min),
            column(i).fold(0.0, f64::max),
        );
        format!("{:.2} ({low:.2} to {high:.2})", mean(i))
    };
    println!(
        "| {label} | {} | {} | {:.3} | {:.3} |",
        range(0),
        range(1),
        mean(2),
        mean(3)
    );
    Ok(())
}

/// Geometric mean of the RMSE over the printed RMSE.
fn ratio(data: &Measurements, scores: &[MaterialScores], rmse: fn(&Scores) -> f64) -> f64 {
    let logs = pairs(data, scores).map(|(scores, printed)| (rmse(scores) / printed.rmse).ln());
    let logs: Vec<f64> = logs.collect();
    (logs.iter().sum::<f64>() / logs.len() as f64).exp()
}

/// Mean correlation over the materials that have one in print.
fn correlation(
    data: &Measurements,
    scores: &[MaterialScores],
    correlation: fn(&Scores) -> Option<f64>,
) -> f64 {
    let values: Vec<f64> = pairs(data, scores)
        .filter(|(_, printed)| printed.correlation.is_some())
        .filter_map(|(scores, _)| correlation(scores))
        .collect();
    values.iter().sum::<f64>() / values.len() as f64
}

fn pairs<'a>(
    data: &'a Measurements,
    scores: &'a [MaterialScores],
) -> impl Iterator<Item = (&'a Scores, published::Figures)> {
    scores.iter().flat_map(move |material| {
        material
            .channels
            .iter()
            .zip(&data.channels)
            .filter_map(move |(scores, channel)| {
                Some((scores, published::figures(material.id?, channel)?))
            })
    })
}
