//! Fitting to chunks of rows: the memory it takes above the chunk, how near it comes to the batch
//! fit, and what a second thread gains: `cargo run --release -p elm-benches --bin accumulate`.
#![allow(clippy::print_stdout)]

use std::time::Instant;

use clap::Parser;
use elm::solve::{LeastSquares, Ridge, Solver};
use elm::{Accumulator, ElmParams, Error};
use ndarray::{Array2, Axis};
use peak_alloc::PeakAlloc;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Fits a smooth function of random inputs, chunk by chunk, each drawn when it is asked for.
#[derive(Debug, Parser)]
struct Arguments {
    /// Rows of the fit whose memory is counted.
    #[arg(long, default_value_t = 1_000_000)]
    rows: usize,
    #[arg(long, default_value_t = 20)]
    inputs: usize,
    #[arg(long, default_value_t = 500)]
    neurons: usize,
    /// Rows of a chunk.
    #[arg(long, default_value_t = 10_000)]
    chunk: usize,
    /// Rows that are also fitted in one piece; 0 for none.
    #[arg(long, default_value_t = 50_000)]
    batch: usize,
    /// Rows that are fitted on one thread and on several in turn; 0 for none.
    #[arg(long, default_value_t = 100_000)]
    timed: usize,
    /// Threads of that comparison.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Fits of that comparison each way.
    #[arg(long, default_value_t = 5)]
    repetitions: usize,
}

/// A given strength: what is compared is the solve, not the choice.
fn ridge() -> Ridge {
    Ridge::relative(1e-8)
}

type Chunk = (Array2<f64>, Array2<f64>);

impl Arguments {
    fn chunks(&self, rows: usize) -> impl Iterator<Item = Result<Chunk, Error>> {
        let (size, inputs) = (self.chunk.max(1), self.inputs);
        (0..rows.div_ceil(size)).map(move |index| {
            let mut random = ChaCha8Rng::seed_from_u64(index as u64);
            let shape = (size.min(rows - index * size), inputs);
            let x = Array2::from_shape_simple_fn(shape, || random.random_range(-1.0..1.0));
            let row = |row: ndarray::ArrayView1<'_, f64>| (2.0 * row.sum()).sin() + row[0] * row[0];
            let t = x.map_axis(Axis(1), row).insert_axis(Axis(1));
            Ok((x, t))
        })
    }

    fn params(&self) -> ElmParams<f64> {
        ElmParams::new(self.neurons).with_solver(ridge())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    elm_benches::timing::use_threads(1);
    let arguments = Arguments::parse();
    memory(&arguments)?;
    if arguments.batch > 0 {
        batch(&arguments)?;
    }
    if arguments.timed > 0 {
        threads(&arguments)?;
    }
    Ok(())
}

fn memory(arguments: &Arguments) -> Result<(), Error> {
    let params = arguments.params();
    let rows = arguments.chunk.min(arguments.rows);
    let chunk = (arguments.inputs + 1) * rows * size_of::<f64>();
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let start = Instant::now();
    let model = params.fit_chunks(arguments.chunks(arguments.rows))?;
    let seconds = start.elapsed().as_secs_f64();
    let peak = MEMORY.peak_usage() - before;
    println!(
        "{} rows x {} neurons in chunks of {rows}: {:.1} MB at most, {:.1} MB above the chunk of \
         {:.1} MB, {seconds:.0} s; residual {:.3e}",
        arguments.rows,
        arguments.neurons,
        megabytes(peak),
        megabytes(peak.saturating_sub(chunk)),
        megabytes(chunk),
        model.diagnosis().residual_norm[0]
    );
    Ok(())
}

fn megabytes(bytes: usize) -> f64 {
    bytes as f64 / 1e6
}

/// The difference from the batch fit, relative to what rounding allows: condition times epsilon
/// times the root of the size, of the norm of the fitted values.
fn batch(arguments: &Arguments) -> Result<(), Error> {
    let rows = arguments.batch;
    let mut whole = (
        Array2::zeros((rows, arguments.inputs)),
        Array2::zeros((rows, 1)),
    );
    let mut at = 0;
    for chunk in arguments.chunks(rows) {
        let (x, t) = chunk?;
        let place = ndarray::s![at..at + x.nrows(), ..];
        whole.0.slice_mut(place).assign(&x);
        whole.1.slice_mut(place).assign(&t);
        at += x.nrows();
    }
    let (x, t) = whole;
    let params = arguments.params();
    let chunked = params.fit_chunks(arguments.chunks(rows))?;
    // Standardised as the first chunk says, in one piece.
    let mut one = Accumulator::from_sample(
        &params,
        &x.slice(ndarray::s![..arguments.chunk.min(rows), ..]),
        1,
    )?;
    one.push(&x, &t)?;
    let one = one.fit()?;
    let hidden = chunked.hidden_matrix(&x)?;
    let problem = LeastSquares::new(&hidden, &t)?.with_intercept(true);
    let solution = Solver::from(ridge()).solve(&problem)?;
    let batch = hidden.dot(&solution.beta) + &solution.intercept;
    let condition = chunked.diagnosis().condition.unwrap_or(f64::NAN);
    let size = (rows as f64 + arguments.neurons as f64).sqrt();
    let norm = |values: &Array2<f64>| values.mapv(|v| v * v).sum().sqrt();
    let bound = condition * f64::EPSILON * size * norm(&batch);
    for (name, model) in [("chunks", &chunked), ("one piece, accumulated", &one)] {
        let difference = norm(&(&model.predict(&x)? - &batch));
        println!(
            "{rows} rows, {name} against the batch solve: difference {:.1e} of the fitted values' \
             norm, {:.1e} of condition {condition:.1e} x epsilon x root of the size",
            difference / norm(&batch),
            difference / bound,
        );
    }
    Ok(())
}

/// Pairs of fits, one thread and several in turn, the chunks drawn beforehand.
fn threads(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let params = arguments.params();
    let chunks: Vec<Chunk> = arguments
        .chunks(arguments.timed)
        .collect::<Result<_, _>>()?;
    let again = || chunks.iter().cloned().map(Ok::<Chunk, Error>);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()?;
    let mut ratios = Vec::new();
    for _ in 0..arguments.repetitions.max(1) {
        let start = Instant::now();
        params.fit_chunks(again())?;
        let one = start.elapsed();
        let start = Instant::now();
        pool.install(|| params.fit_chunks_parallel(again(), arguments.threads))?;
        ratios.push(one.as_secs_f64() / start.elapsed().as_secs_f64());
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "{} rows, {} threads against one: {:.2} times as fast (median of {} pairs, {:.2} to {:.2})",
        arguments.timed,
        arguments.threads,
        ratios[ratios.len() / 2],
        ratios.len(),
        ratios[0],
        ratios[ratios.len() - 1]
    );
    Ok(())
}
