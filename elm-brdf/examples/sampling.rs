//! How well materials are sampled: the relative variance of $f \cos\theta_i$ over the density of the
//! renderer's sampler and of the cosine, the table of
//! [docs/decisions/0017-sampled-by-lobes.md](../../docs/decisions/0017-sampled-by-lobes.md).
//!
//! `cargo run --release -p elm-brdf --example sampling -- MODEL...`, models as `elm-brdf fit` writes them.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::path::Path;

use elm_brdf::render::{Material, MaterialLoader};
use elm_brdf::scene_materials::{MaterialTable, SceneMaterialLoader};
use elm_datasets::geometry::{DirectionPair, Vector, cartesian};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Viewing angles in degrees.
const VIEWS: [f64; 5] = [0.0, 20.0, 40.0, 60.0, 80.0];
const DRAWS: usize = 100_000;

/// Variance over the square of the mean, and the largest value over the mean, of the luminance of f cos /
/// density.
fn spread(
    material: &Material,
    outgoing: Vector,
    mut draw: impl FnMut() -> (Vector, f64),
) -> Result<(f64, f64), Box<dyn Error + Send + Sync>> {
    let (pairs, factors): (Vec<DirectionPair>, Vec<f64>) = (0..DRAWS)
        .map(|_| {
            let (incident, density) = draw();
            (DirectionPair { incident, outgoing }, incident[2] / density)
        })
        .unzip();
    let colors = material.eval(&pairs)?;
    let values: Vec<f64> = colors
        .iter()
        .zip(&factors)
        .map(|([r, g, b], factor)| (0.2126 * r + 0.7152 * g + 0.0722 * b) * factor)
        .collect();
    let mean = values.iter().sum::<f64>() / DRAWS as f64;
    let squares = values.iter().map(|v| (v - mean) * (v - mean));
    let variance = squares.sum::<f64>() / DRAWS as f64;
    let largest = values.iter().copied().fold(0.0, f64::max);
    Ok((variance / (mean * mean), largest / mean))
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    if files.is_empty() {
        return Err("usage: sampling MODEL...".into());
    }
    let loader = SceneMaterialLoader::new(None);
    println!("| model | viewer in degrees | variance | of the cosine | largest over mean |");
    println!("|---|---|---|---|---|");
    let mut logarithms = Vec::new();
    for file in &files {
        let asked = MaterialTable {
            model: Some(file.into()),
            ..MaterialTable::default()
        };
        let material = Material::new(loader.load(&asked, Path::new(""))?.brdf, [1.0; 3], false)?;
        for degrees in VIEWS {
            let outgoing = cartesian(degrees.to_radians(), 0.3);
            let mut random = ChaCha8Rng::seed_from_u64(1);
            let (variance, largest) = spread(&material, outgoing, || {
                material.sample(outgoing, [random.random(), random.random()])
            })?;
            let (cosine, _) = spread(&material, outgoing, || {
                let (u, phi) = (random.random::<f64>(), TAU * random.random::<f64>());
                let (radius, height) = (u.sqrt(), (1.0 - u).sqrt());
                (
                    [radius * phi.cos(), radius * phi.sin(), height],
                    height / PI,
                )
            })?;
            println!("| {file} | {degrees} | {variance:.4} | {cosine:.2} | {largest:.1} |");
            logarithms.push((variance.ln(), cosine.ln()));
        }
    }
    let n = logarithms.len() as f64;
    let mixture = (logarithms.iter().map(|l| l.0).sum::<f64>() / n).exp();
    let cosine = (logarithms.iter().map(|l| l.1).sum::<f64>() / n).exp();
    println!(
        "\nGeometric means: {mixture:.4}, of the cosine {cosine:.3}, ratio {:.3}",
        mixture / cosine
    );
    Ok(())
}
