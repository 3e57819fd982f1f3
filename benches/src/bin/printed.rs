//! Which protocol comes closest to the paper's printed tables, and whether the printed figures fit
//! together: the tables of "What the printed figures are" in `docs/reports/paper.md`.
//!
//! `cargo run --release -p elm-benches --bin printed -- CURET_DIR`

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::PathBuf;

use elm_brdf::metrics::Metrics;
use elm_brdf::model::BrdfParams;
use elm_brdf::protocol::{Folds, Scores, cross_validate};
use elm_brdf::published::{self, Figures};
use elm_datasets::{Invalid, Measurements, curet};

const SEEDS: u64 = 5;
const FOLDS: usize = 10;
const NEURONS: [usize; 9] = [10, 20, 30, 50, 80, 100, 120, 150, 180];

/// A way to come by the figures of a table.
type Protocol = (&'static str, fn(&Scores) -> Metrics);

const PROTOCOLS: [Protocol; 3] = [
    ("training", |scores| scores.train),
    ("held out, together", |scores| scores.held_out),
    ("held out, mean of folds", |scores| {
        scores.held_out_fold_mean
    }),
];

fn main() -> Result<(), Box<dyn Error>> {
    elm_benches::timing::use_threads(1);
    let dir = std::env::args()
        .nth(1)
        .map(PathBuf::from)
        .ok_or("usage: printed CURET_DIR")?;
    let data = curet::read(&dir, &published::materials(), Invalid::Clamp)?;
    distances(&data)?;
    println!();
    spreads(&data)
}

/// How far each protocol is from each printed table.
fn distances(data: &Measurements) -> Result<(), Box<dyn Error>> {
    println!("| figures | neurons | Table I, RMSE | Table II, MAE | Table III, correlation |");
    println!("|---|---|---|---|---|");
    let mut closest: [(f64, String); 3] = std::array::from_fn(|_| (f64::INFINITY, String::new()));
    let mut rows = Vec::new();
    for neurons in NEURONS {
        let runs = (1..=SEEDS)
            .map(|seed| {
                let params = BrdfParams::paper(neurons).seed(seed);
                let folds = Folds::new(data.directions.len(), FOLDS, seed)?;
                cross_validate(&params, data, &folds, |_, _| {})
            })
            .collect::<Result<Vec<_>, _>>()?;
        for (name, metrics) in PROTOCOLS {
            let ours = |m: usize, c: usize| -> Option<Metrics> {
                let of_seeds = runs.iter().filter_map(|run| run.get(m)?.channels.get(c));
                Metrics::mean(&of_seeds.map(metrics).collect::<Vec<_>>())
            };
            rows.push((name, neurons, tables(data, ours)));
        }
    }
    rows.sort_by_key(|&(name, neurons, _)| (PROTOCOLS.iter().position(|p| p.0 == name), neurons));
    for (name, neurons, tables) in rows {
        let cells: Vec<String> = tables
            .iter()
            .map(|(distance, bias)| format!("{distance:.3} ({bias:+.3})"))
            .collect();
        println!("| {name} | {neurons} | {} |", cells.join(" | "));
        for (closest, (distance, _)) in closest.iter_mut().zip(tables) {
            if distance < closest.0 {
                *closest = (distance, format!("{name}, {neurons} neurons"));
            }
        }
    }
    println!();
    for (table, (distance, name)) in ["I", "II", "III"].into_iter().zip(closest) {
        println!("- Closest to Table {table}: {name} ({distance:.3}).");
    }
    Ok(())
}

/// For each table the root mean square over its materials of the difference to print, and the mean
/// difference: of logarithms for the two errors, of the figures themselves for correlation.
fn tables(data: &Measurements, ours: impl Fn(usize, usize) -> Option<Metrics>) -> [(f64, f64); 3] {
    let mut differences: [Vec<f64>; 3] = Default::default();
    for (m, material) in data.materials.iter().enumerate() {
        for (c, channel) in data.channels.iter().enumerate() {
            let (Some(paper), Some(ours)) = (published::figures(material.id, channel), ours(m, c))
            else {
                continue;
            };
            differences[0].push((ours.rmse / paper.rmse).ln());
            if let Some(mae) = paper.mae.filter(|_| !paper.impossible_mae) {
                differences[1].push((ours.mae / mae).ln());
            }
            if let (Some(ours), Some(paper)) = (ours.correlation, paper.correlation) {
                differences[2].push(ours - paper);
            }
        }
    }
    differences.map(|values| {
        let count = values.len() as f64;
        let squares: f64 = values.iter().map(|value| value * value).sum();
        ((squares / count).sqrt(), values.iter().sum::<f64>() / count)
    })
}

/// The smallest spread of the measurements that a printed RMSE and correlation allow, beside the
/// spread there is.
///
/// Predictions of correlation r with values of deviation s err by s sqrt(1 - r^2) at least, as
/// that is the error of their best linear correction. So s is at most RMSE / sqrt(1 - r^2).
fn spreads(data: &Measurements) -> Result<(), Box<dyn Error>> {
    println!(
        "| material | RMSE / sqrt(1 - r^2), printed | deviation of the measurements | mean deviation \
         within a fold | printed MAE / RMSE |"
    );
    println!("|---|---|---|---|---|");
    for material in &data.materials {
        for (c, channel) in data.channels.iter().enumerate() {
            let Some((allowed, shape)) = allowed(material.id, channel) else {
                continue;
            };
            let values = material.values.column(c);
            let mut within = Vec::new();
            for seed in 1..=SEEDS {
                let folds = Folds::new(data.directions.len(), FOLDS, seed)?;
                for fold in 0..FOLDS {
                    let rows = material.rows.iter().zip(values);
                    let held = rows.filter(|&(&row, _)| folds.of_row(row) == fold);
                    within.push(deviation(
                        &held.map(|(_, &value)| value).collect::<Vec<_>>(),
                    ));
                }
            }
            println!(
                "| {} {} | {allowed:.3} | {:.3} | {:.3} | {shape:.2} |",
                material.id,
                material.name,
                deviation(&values.to_vec()),
                within.iter().sum::<f64>() / within.len() as f64,
            );
        }
    }
    Ok(())
}

/// RMSE / sqrt(1 - r^2) and MAE / RMSE as printed; for the average channel the means of three.
fn allowed(id: elm_datasets::MaterialId, channel: &str) -> Option<(f64, f64)> {
    let of = |channel: &str| -> Option<(f64, f64)> {
        let Figures {
            rmse,
            mae,
            correlation,
            ..
        } = published::figures(id, channel)?;
        Some((rmse / (1.0 - correlation?.powi(2)).sqrt(), mae? / rmse))
    };
    if channel != "average" {
        return of(channel);
    }
    // Deviations, like errors: that of an average is at most the average of the three.
    let all: Vec<(f64, f64)> = ["red", "green", "blue"]
        .into_iter()
        .filter_map(of)
        .collect();
    let count = all.len() as f64;
    let mean = |value: fn(&(f64, f64)) -> f64| all.iter().map(value).sum::<f64>() / count;
    (all.len() == 3).then(|| (mean(|v| v.0), mean(|v| v.1)))
}

fn deviation(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}
