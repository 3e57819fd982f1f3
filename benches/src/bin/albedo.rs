//! Whether fitted networks return more light than they receive: the largest directional albedo of the
//! default network of every material, the table of 'Energy' in `docs/reports/accuracy.md`.
//!
//! `cargo run --release -p elm-benches --bin albedo -- CURET_DIR SEEDS [FILE...]`
//!
//! `FILE` is any that `elm-brdf fit` reads without options. Beside the albedo stands what the five nearest
//! measurements give, by inverse distance.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::{Path, PathBuf};

use elm_brdf::albedo;
use elm_brdf::model::Tuned;
use elm_brdf::registry;
use elm_datasets::Brdf;
use elm_datasets::{Invalid, MaterialId, OpenOptions, Samples, curet, open, paint, synthetic};

/// Rows of a synthetic paint: few, and many.
const PAINTS: [usize; 3] = [300, 1300, 4000];

/// The largest albedo of any channel at any of the angles, and the angle.
fn largest(brdf: &dyn Brdf) -> elm_brdf::Result<(f64, f64)> {
    let mut most = (0.0, 0.0);
    for degrees in albedo::ANGLES {
        let channels = albedo::directional(brdf, degrees.to_radians())?;
        let found = channels.into_iter().fold(0.0, f64::max);
        if found > most.0 {
            most = (found, degrees);
        }
    }
    Ok(most)
}

fn nearest() -> Result<Box<elm_brdf::fit::AnyFit>, Box<dyn Error>> {
    let found = registry::baselines()
        .into_iter()
        .find(|entry| entry.full_name() == "inverse-distance-5 (cosines, log)");
    Ok(found.ok_or("no such reference")?.method)
}

/// One row of the table.
fn row(name: &str, samples: &Samples, seeds: u64) -> Result<f64, Box<dyn Error>> {
    let pairs = &samples.directions;
    let values = samples.values.view();
    let implied = largest(nearest()?.fit(pairs, values)?.as_ref())?;
    let mut most = (0.0, 0.0, String::new());
    for seed in 1..=seeds {
        let tuned = Tuned {
            seed,
            ..Tuned::default()
        };
        let model = tuned.fit_model(pairs, values)?;
        let (found, degrees) = largest(&model)?;
        if found > most.0 {
            most = (found, degrees, model.features().to_string());
        }
    }
    let (found, degrees, inputs) = most;
    println!(
        "| {name} | {} | {inputs} | {found:.3} at {degrees} | {:.3} |",
        pairs.len(),
        implied.0
    );
    Ok(found / implied.0.max(1.0))
}

fn main() -> Result<(), Box<dyn Error>> {
    elm_benches::timing::use_threads(1);
    let mut arguments = std::env::args().skip(1);
    let usage = "usage: albedo CURET_DIR SEEDS [FILE...]";
    let dir = PathBuf::from(arguments.next().ok_or(usage)?);
    let seeds: u64 = arguments.next().ok_or(usage)?.parse()?;
    println!(
        "| material | rows | inputs | largest albedo over seeds | of the nearest measurements |"
    );
    println!("|---|---|---|---|---|");
    let mut most = 0.0_f64;
    let ids: Vec<MaterialId> = MaterialId::all().collect();
    let measured = curet::read(&dir, &ids, Invalid::Clamp)?;
    let formulas = synthetic::measurements(1, &ids, Invalid::Clamp);
    for data in [&measured, &formulas] {
        for (index, material) in data.materials.iter().enumerate() {
            let samples = data.samples(index).ok_or("no such material")?;
            most = most.max(row(&material.name, &samples, seeds)?);
        }
    }
    for rows in PAINTS {
        let name = format!("synthetic paint, {rows} rows");
        most = most.max(row(&name, &paint::samples(rows, 1)?, seeds)?);
    }
    for file in arguments {
        let path = Path::new(&file);
        let samples = open(path, &OpenOptions::default())?.samples;
        let name = path.file_stem().unwrap_or(path.as_os_str());
        most = most.max(row(&name.to_string_lossy(), &samples, seeds)?);
    }
    println!("\nLargest over 1 or over that of the nearest measurements: {most:.3}");
    Ok(())
}
