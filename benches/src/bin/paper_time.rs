//! The paper's protocol on all materials (50 sigmoid neurons, pseudo-inverse, 10 folds, every
//! measure of error) against the same in NumPy with one pseudo-inverse per material and fold:
//! `cargo run --release -p elm-benches --bin paper_time -- [CURET_DIR]`.
//!
//! Both use the same random layer and the same folds, so they must find the same errors. Without a
//! folder, on the built-in synthetic data.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;
use elm::ElmParams;
use elm::solve::PseudoInverse;
use elm_benches::peers::{Environment, Worker};
use elm_benches::timing::{median, processor_seconds};
use elm_brdf::features::Features;
use elm_brdf::metrics::Metrics;
use elm_brdf::model::BrdfParams;
use elm_brdf::protocol::{Folds, MaterialScores, cross_validate};
use elm_brdf::target_transform::TargetTransform;
use elm_datasets::{Invalid, MaterialId, Measurements, curet, synthetic};
use ndarray::{Array1, Array2, Axis};
use serde_json::{Value, json};

const SCRIPT: &str = include_str!("../../peers/every_material.py");
const NEURONS: usize = 50;
const SEED: u64 = 1;

/// The whole paper, ours and NumPy's in turn.
#[derive(Debug, Parser)]
#[command(name = "paper_time")]
struct Arguments {
    /// CUReT's folder; the synthetic green channel unless given
    curet: Option<PathBuf>,
    /// How many pairs of runs
    #[arg(long, default_value_t = 7)]
    pairs: usize,
    /// The Python to make the environment with; python3 or python unless given
    #[arg(long)]
    python: Option<String>,
}

fn main() -> Result<(), Box<dyn Error>> {
    elm_benches::timing::use_threads(1);
    let arguments = Arguments::parse();
    let all: Vec<MaterialId> = MaterialId::all().collect();
    let data = match &arguments.curet {
        Some(folder) => curet::read(folder, &all, Invalid::Clamp)?,
        None => one_channel(synthetic::measurements(1, &all, Invalid::Clamp)),
    };
    let folds = Folds::new(data.directions.len(), 10, SEED)?;
    let params = BrdfParams {
        features: Features::Paper,
        transform: TargetTransform::Identity,
        network: network(),
    };

    let program = std::env::current_exe()?;
    let target = program.parent().and_then(Path::parent);
    let environment = target
        .ok_or("no folder for the environment")?
        .join("peers-env");
    let environment = Environment::set_up(&environment, arguments.python.as_deref())?;
    let mut worker = Worker::of_script(&environment.python, SCRIPT)?;
    let folder = tempfile::tempdir()?;
    write(folder.path(), &data, &folds)?;
    let request = json!({
        "folder": folder.path(),
        "rows": data.directions.len(),
        "materials": data.materials.len(),
        "neurons": NEURONS,
    });

    let (mut ratios, mut ours_ms) = (Vec::new(), Vec::new());
    let (mut ours, mut theirs) = (Vec::new(), Value::Null);
    for _ in 0..arguments.pairs.max(1) {
        let start = processor_seconds();
        ours = cross_validate(&params, &data, &folds, |_, _| {})?;
        let seconds = processor_seconds() - start;
        theirs = worker.ask(request.clone())?;
        let numpy = theirs["seconds"].as_f64().ok_or("no seconds from NumPy")?;
        ratios.push(numpy / seconds);
        ours_ms.push(1e3 * seconds);
    }
    println!(
        "{} materials, {} directions, {} folds, {NEURONS} neurons",
        data.materials.len(),
        data.directions.len(),
        folds.count()
    );
    println!(
        "NumPy's processor time over ours (median of {} pairs): {:.0}; ours {:.1} ms",
        ratios.len(),
        median(ratios).unwrap_or(0.0),
        median(ours_ms).unwrap_or(0.0)
    );
    println!(
        "largest relative difference of a measure of error: {:.1e}",
        difference(&ours, &theirs["scores"])?
    );
    Ok(())
}

fn network() -> ElmParams<f64> {
    ElmParams::new(NEURONS)
        .with_solver(PseudoInverse::default())
        .with_intercept(false)
        .with_seed(SEED)
}

fn one_channel(mut data: Measurements) -> Measurements {
    const GREEN: usize = 1;
    data.channels = vec![data.channels[GREEN].clone()];
    for material in &mut data.materials {
        let green = material.values.column(GREEN).to_owned();
        material.values = green.insert_axis(Axis(1));
    }
    data
}

/// Inputs, values, cosines, folds and the random layer, as the script reads them.
fn write(folder: &Path, data: &Measurements, folds: &Folds) -> Result<(), Box<dyn Error>> {
    let pairs = &data.directions;
    let inputs = Features::Paper.compute(pairs);
    let columns: Vec<_> = data.materials.iter().map(|m| m.values.column(0)).collect();
    let values = ndarray::stack(Axis(1), &columns)?;
    // The layer depends on the seed and the number of inputs alone.
    let layer = network().fit(&inputs, &Array2::zeros((inputs.nrows(), 1)))?;
    let layer = layer.hidden();
    let rows = data.directions.len();
    let parts: [(&str, Vec<f64>); 6] = [
        ("inputs", inputs.iter().copied().collect()),
        ("values", values.iter().copied().collect()),
        (
            "cosine",
            pairs.iter().map(|p| p.outgoing[2].max(0.0)).collect(),
        ),
        (
            "fold",
            (0..rows).map(|row| folds.of_row(row) as f64).collect(),
        ),
        ("weights", layer.weights().iter().copied().collect()),
        ("biases", layer.biases().iter().copied().collect()),
    ];
    for (name, part) in parts {
        let bytes: Vec<u8> = part.iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(folder.join(name), bytes)?;
    }
    Ok(())
}

/// The largest relative difference between our measures and the script's.
fn difference(ours: &[MaterialScores], theirs: &Value) -> Result<f64, Box<dyn Error>> {
    let theirs: Vec<[[f64; 6]; 3]> = serde_json::from_value(theirs.clone())?;
    let mut largest = 0.0_f64;
    for (ours, theirs) in ours.iter().zip(&theirs) {
        let scores = &ours.channels[0];
        let kinds = [scores.train, scores.held_out, scores.held_out_fold_mean];
        for (ours, theirs) in kinds.iter().zip(theirs) {
            for (&a, &b) in flat(ours).iter().zip(theirs) {
                largest = largest.max((a - b).abs() / b.abs());
            }
        }
    }
    Ok(largest)
}

fn flat(metrics: &Metrics) -> Array1<f64> {
    ndarray::array![
        metrics.rmse,
        metrics.mae,
        metrics.correlation.unwrap_or(f64::NAN),
        metrics.relative_rmse.unwrap_or(f64::NAN),
        metrics.log_cosine_mae,
        metrics.cube_root_rmse,
    ]
}
