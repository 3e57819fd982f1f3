//! Several threads beside one: `cargo run --release -p elm-benches --bin threads -- [THREADS]`.
//!
//! Both in turn, time by the clock, medians over pairs; results must be the same bits.
#![allow(clippy::print_stdout)]

use std::time::Instant;

use elm::{Accumulator, ElmParams, on_this_thread};
use elm_benches::timing::median;
use ndarray::{Array1, Array2, Ix1, s};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Uniform};

type Numbers = Vec<f64>;
type Error = Box<dyn std::error::Error>;

/// Rows of a smooth function with noise.
fn rows(rows: usize, inputs: usize) -> Result<(Array2<f64>, Array1<f64>), Error> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let uniform = Uniform::new(-1.0, 1.0)?;
    let mut draw = || uniform.sample(&mut random);
    let x = Array2::from_shape_simple_fn((rows, inputs), &mut draw);
    let noise = Array1::from_shape_simple_fn(rows, &mut draw);
    let smooth = |row: ndarray::ArrayView1<'_, f64>| (3.0 * row[0]).sin() + row[1] * row[2];
    let t = x.map_axis(ndarray::Axis(1), smooth) + noise * 0.1;
    Ok((x, t))
}

/// A line of the table.
fn compare(
    what: &str,
    threads: usize,
    pairs: usize,
    work: impl Fn() -> Result<Numbers, elm::Error> + Sync,
) -> Result<(), Error> {
    // Threads that are there already, as those of a program's own pool are.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?;
    let timed = |work: &dyn Fn() -> Result<Numbers, elm::Error>| {
        let start = Instant::now();
        let found = work()?;
        Ok::<_, elm::Error>((start.elapsed().as_secs_f64(), found))
    };
    let (mut alone, mut ratios) = (Vec::new(), Vec::new());
    for _ in 0..pairs {
        let (one, expected) = timed(&|| on_this_thread(&work))?;
        let (several, found) = timed(&|| pool.install(&work))?;
        let same = expected
            .iter()
            .zip(&found)
            .all(|(a, b)| a.to_bits() == b.to_bits());
        if !same || expected.len() != found.len() {
            return Err(format!("{what}: other digits on {threads} threads").into());
        }
        alone.push(one);
        ratios.push(one / several);
    }
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let most = ratios.iter().copied().fold(0.0, f64::max);
    let (alone, middle) = (median(alone).unwrap_or(0.0), median(ratios).unwrap_or(0.0));
    println!("| {what} | {alone:.3} | {middle:.2} | {least:.2} - {most:.2} |");
    Ok(())
}

fn main() -> Result<(), Error> {
    let cores = std::thread::available_parallelism().map_or(2, usize::from);
    let threads = std::env::args().nth(1).map_or(Ok(cores), |n| n.parse())?;
    println!(
        "| work | seconds, one thread | times as fast on {threads} | least - most |\n|---|---|---|---|"
    );
    let fit = |what: &str, size: (usize, usize, usize), pairs| {
        let (x, t) = rows(size.0, size.1)?;
        let params = ElmParams::new(size.2);
        compare(what, threads, pairs, || {
            Ok(params.fit(&x, &t)?.beta().iter().copied().collect())
        })
    };
    fit("fit, 185 x 6, 60 neurons", (185, 6, 60), 101)?;
    fit("fit, 2000 x 10, 200 neurons", (2000, 10, 200), 21)?;
    fit("fit, 20000 x 20, 500 neurons", (20_000, 20, 500), 9)?;
    fit("fit, 100000 x 20, 1000 neurons", (100_000, 20, 1000), 3)?;
    let (x, t) = rows(20_000, 20)?;
    compare("auto, 20000 x 20", threads, 7, || {
        Ok(ElmParams::auto()
            .fit(&x, &t)?
            .beta()
            .iter()
            .copied()
            .collect())
    })?;
    let model = ElmParams::new(500).fit(&x, &t)?;
    for (count, pairs) in [(20_000, 21), (200_000, 9)] {
        let (x, _) = rows(count, 20)?;
        let what = format!("predictions, {count} x 20, 500 neurons");
        compare(&what, threads, pairs, || Ok(model.predict(&x)?.to_vec()))?;
    }
    let (x, t) = rows(100_000, 20)?;
    let params = ElmParams::new(300);
    compare("accumulation, 100000 x 20, 300 neurons", threads, 5, || {
        let mut sums = Accumulator::<f64, Ix1>::from_sample(&params, &x.slice(s![..2000, ..]), 1)?;
        sums.push(&x, &t)?;
        Ok(sums.fit()?.beta().iter().copied().collect())
    })
}
