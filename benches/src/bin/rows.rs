//! Fits to many rows that are all in memory: processor time, and the most memory that there ever was,
//! inputs and targets included: `cargo run --release -p elm-benches --bin rows`.
#![allow(clippy::print_stdout)]

use clap::{Parser, ValueEnum};
use elm::solve::{PseudoInverse, Ridge};
use elm::{Elm, ElmParams, Scalar, metrics};
use elm_benches::timing::processor_seconds;
use ndarray::{Array1, Array2, ArrayView1, Axis, Ix1};
use peak_alloc::PeakAlloc;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Fits a smooth function of uniform random inputs, with noise.
#[derive(Debug, Parser)]
struct Arguments {
    #[arg(long, default_value_t = 1_000_000)]
    rows: usize,
    #[arg(long, default_value_t = 20)]
    inputs: usize,
    #[arg(long, default_value_t = 200)]
    neurons: usize,
    /// Multiplies the random weights.
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// The noise lies between plus and minus this.
    #[arg(long, default_value_t = 0.2)]
    noise: f64,
    /// What is fitted, in turn.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Fit::Relative, Fit::LeaveOneOut, Fit::Auto])]
    fits: Vec<Fit>,
    /// In single precision.
    #[arg(long)]
    single: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Fit {
    /// A strength of 1e-6.
    Relative,
    /// A strength of 1e-12, too weak for the normal equations.
    Weak,
    /// The default: a strength chosen by exact leave-one-out.
    LeaveOneOut,
    /// A strength chosen by generalised cross-validation.
    Gcv,
    /// No strength.
    PseudoInverse,
    /// Everything chosen.
    Auto,
}

impl Arguments {
    fn data<A: Scalar>(&self, rows: usize, noise: f64, seed: u64) -> (Array2<A>, Array1<A>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let draw = || A::from_f64(random.random_range(-1.0..1.0));
        let x = Array2::from_shape_simple_fn((rows, self.inputs), draw);
        let truth = |row: ArrayView1<'_, A>| {
            let sum: f64 = row.iter().map(|x| x.as_f64()).sum();
            let first = row.first().map_or(0.0, |x| x.as_f64());
            A::from_f64((2.0 * sum / (self.inputs as f64).sqrt()).sin() + first * first)
        };
        let mut t = x.map_axis(Axis(1), truth);
        if noise > 0.0 {
            t.mapv_inplace(|t| t + A::from_f64(random.random_range(-noise..noise)));
        }
        (x, t)
    }

    fn fit<A: Scalar>(&self, fit: Fit, x: &Array2<A>, t: &Array1<A>) -> elm::Result<Elm<A, Ix1>> {
        let params = ElmParams::new(self.neurons).with_scale(self.scale);
        match fit {
            Fit::Relative => params.with_solver(Ridge::relative(1e-6)),
            Fit::Weak => params.with_solver(Ridge::relative(1e-12)),
            Fit::LeaveOneOut => params,
            Fit::Gcv => params.with_solver(Ridge::gcv()),
            Fit::PseudoInverse => params.with_solver(PseudoInverse::default()),
            Fit::Auto => return ElmParams::auto().fit(x, t),
        }
        .fit(x, t)
    }

    fn run<A: Scalar>(&self) -> elm::Result<()> {
        let (x, t) = self.data::<A>(self.rows, self.noise, 0);
        let (test, truth) = self.data::<A>(10_000, 0.0, 1);
        println!(
            "{} rows of {} inputs in {}, by {}: {:.0} MB with the targets",
            self.rows,
            self.inputs,
            A::NAME,
            elm::backend(),
            megabytes((x.len() + t.len()) * size_of::<A>())
        );
        for &fit in &self.fits {
            MEMORY.reset_peak_usage();
            let start = processor_seconds();
            let model = self.fit(fit, &x, &t)?;
            let seconds = processor_seconds() - start;
            let peak = MEMORY.peak_usage();
            let error = metrics::rmse(&model.predict(&test)?, &truth)?;
            let diagnosis = model.diagnosis();
            println!(
                "{fit:?}: {} neurons, {seconds:.1} s, {:.0} MB at most; RMSE {error:.5}, lambda \
                 {:.1e}, rank {:?}, condition {:.1e}, {:?}",
                model.hidden().neurons(),
                megabytes(peak),
                diagnosis.lambda[0],
                diagnosis.rank,
                diagnosis.condition.unwrap_or(f64::NAN),
                diagnosis.route,
            );
        }
        Ok(())
    }
}

fn megabytes(bytes: usize) -> f64 {
    bytes as f64 / 1e6
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    elm_benches::timing::use_threads(1);
    let arguments = Arguments::parse();
    if arguments.single {
        arguments.run::<f32>()?;
    } else {
        arguments.run::<f64>()?;
    }
    Ok(())
}
