//! Error against the number of measurements of a new material, with a prior from the others and
//! without, at random directions and at those that the prior asks for first: the table of 'Few
//! measurements' in `docs/reports/accuracy.md`.
//!
//! `cargo run --release -p elm-benches --bin few -- CURET_DIR [SEEDS]`

#![allow(clippy::print_stdout, clippy::print_stderr)]

use elm_datasets::Brdf;
use std::error::Error;
use std::path::PathBuf;

use elm_brdf::fit::Fit;
use elm_brdf::model::Tuned;
use elm_brdf::prior::{Prior, PriorParams};
use elm_brdf::protocol::Folds;
use elm_datasets::geometry::DirectionPair;
use elm_datasets::{Invalid, MaterialId, curet};
use ndarray::{Array2, Axis};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

const FOLDS: usize = 10;
const COUNTS: [usize; 7] = [5, 10, 20, 50, 60, 100, 184];
const WAYS: [&str; 3] = ["alone", "prior", "prior, chosen directions"];

fn main() -> Result<(), Box<dyn Error>> {
    elm_benches::timing::use_threads(1);
    let mut arguments = std::env::args().skip(1);
    let dir = PathBuf::from(arguments.next().ok_or("usage: few CURET_DIR [SEEDS]")?);
    let seeds: u64 = arguments.next().map_or(Ok(3), |seeds| seeds.parse())?;
    let ids: Vec<MaterialId> = MaterialId::all().collect();
    let data = curet::read(&dir, &ids, Invalid::Clamp)?;
    let pairs = &data.directions;
    let shape = (pairs.len(), data.materials.len());
    let values = Array2::from_shape_fn(shape, |(row, m)| data.materials[m].values.row(row).sum());
    let values = values / data.channels.len() as f64;
    // By way and number, the geometric mean over materials of each seed.
    let mut errors = vec![vec![Vec::new(); COUNTS.len()]; WAYS.len()];
    for seed in 1..=seeds {
        let priors = priors(seed, pairs, &values, &ids)?;
        for (place, count) in COUNTS.into_iter().enumerate() {
            let found = run(seed, count, pairs, &values, &priors)?;
            for (way, squares) in found.into_iter().enumerate() {
                let rmse = squares.mapv(|square: f64| (square / pairs.len() as f64).sqrt());
                let logs = rmse.mapv(f64::ln);
                errors[way][place].push(logs.mean().unwrap_or(f64::NAN).exp());
            }
            eprint!(".");
        }
    }
    println!(
        "\nGeometric mean over {} materials of the held-out RMSE, mean and range over seeds 1 to {seeds}\n",
        ids.len()
    );
    println!("| measurements | {} |", WAYS.join(" | "));
    println!("|---|---|---|---|");
    for (place, count) in COUNTS.into_iter().enumerate() {
        print!("| {count} |");
        for errors in &errors {
            let errors = &errors[place];
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            let low = errors.iter().copied().fold(f64::INFINITY, f64::min);
            let high = errors.iter().copied().fold(0.0, f64::max);
            print!(" {mean:.4} ({low:.4} to {high:.4}) |");
        }
        println!();
    }
    Ok(())
}

/// For each material what all others teach, but other measurements of the same specimen.
fn priors(
    seed: u64,
    pairs: &[DirectionPair],
    values: &Array2<f64>,
    ids: &[MaterialId],
) -> Result<Vec<Prior>, Box<dyn Error>> {
    let params = PriorParams {
        seed,
        ..PriorParams::default()
    };
    let all = params.build(pairs, values.view())?;
    let without = |id: &MaterialId| {
        let same = |&place: &usize| ids[place].specimen() == id.specimen();
        let same: Vec<usize> = (0..ids.len()).filter(same).collect();
        Ok(all.without(&same)?)
    };
    ids.iter().map(without).collect()
}

/// For each way the sum of squared errors of each material over all held-out rows.
fn run(
    seed: u64,
    count: usize,
    pairs: &[DirectionPair],
    values: &Array2<f64>,
    priors: &[Prior],
) -> Result<Vec<ndarray::Array1<f64>>, Box<dyn Error>> {
    let folds = Folds::new(pairs.len(), FOLDS, seed)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(7);
    let mut squares = vec![ndarray::Array1::zeros(values.ncols()); WAYS.len()];
    for fold in 0..FOLDS {
        let (test, mut train): (Vec<usize>, Vec<usize>) =
            (0..pairs.len()).partition(|&row| folds.of_row(row) == fold);
        train.sort_unstable();
        let all: Vec<DirectionPair> = train.iter().map(|&row| pairs[row]).collect();
        let count = count.min(train.len());
        let mut drawn = train.clone();
        drawn.shuffle(&mut random);
        drawn.truncate(count);
        let at: Vec<DirectionPair> = drawn.iter().map(|&row| pairs[row]).collect();
        let asked: Vec<DirectionPair> = test.iter().map(|&row| pairs[row]).collect();
        let truth = values.select(Axis(0), &test);
        let few = values.select(Axis(0), &drawn);
        let tuned = Tuned {
            seed,
            ..Tuned::default()
        };
        let alone = tuned.fit(&at, few.view())?.eval(&asked)?;
        squares[0] += &(&alone - &truth).mapv(|e| e * e).sum_axis(Axis(0));
        for (material, prior) in priors.iter().enumerate() {
            let truth = truth.select(Axis(1), &[material]);
            let predicted = prior.fit(&at, few.select(Axis(1), &[material]).view())?;
            let error = &predicted.eval(&asked)? - &truth;
            squares[1][material] += error.mapv(|e| e * e).sum();
            let chosen = prior.design(&all, count)?;
            let rows: Vec<usize> = chosen.iter().map(|&place| train[place]).collect();
            let at: Vec<DirectionPair> = rows.iter().map(|&row| pairs[row]).collect();
            let few = values.select(Axis(0), &rows).select(Axis(1), &[material]);
            let error = &prior.fit(&at, few.view())?.eval(&asked)? - &truth;
            squares[2][material] += error.mapv(|e| e * e).sum();
        }
    }
    Ok(squares)
}
