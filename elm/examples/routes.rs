//! What the fast route of ridge and the closed-form validation gain, as ratios of times measured
//! in one run: `cargo run --release -p elm-learn --example routes`.
//!
//! The slow route is the same solve at a strength just below the fast route's limit; refitting is
//! one fast solve per fold.

use std::time::Instant;

use elm::cross_validation::{CrossValidator, assign_folds};
use elm::solve::{LeastSquares, Ridge, Solver};
use ndarray::{Array2, Axis};

fn main() -> elm::Result<()> {
    let mut lines = vec![format!(
        "{:>7} {:>7} {:>10} {:>10} {:>6} {:>14} {:>12} {:>6}",
        "rows", "neurons", "QR+SVD ms", "Gram ms", "ratio", "10 refits ms", "10-fold ms", "ratio"
    )];
    for (rows, neurons) in [(205, 50), (2_000, 200), (20_000, 500), (200, 1_000)] {
        // Sines of rising frequency: as ill-conditioned as hidden layers are.
        let h = Array2::from_shape_fn((rows, neurons), |(i, j)| {
            ((i as f64 / rows as f64) * (0.1 * j as f64 + 1.0) + j as f64).sin()
                + 0.01 * ((i * 7919 + j * 104_729) % 1009) as f64 / 1009.0
        });
        let t = Array2::from_shape_fn((rows, 3), |(i, j)| (i as f64 * 0.01 + j as f64).cos());
        let problem = LeastSquares::new(&h, &t)?.with_intercept(true);
        let solve = |lambda| Solver::from(Ridge::relative(lambda)).solve(&problem);
        let slow = best_of(3, || solve(2e-8))?;
        let fast = best_of(3, || solve(3e-8))?;

        let folds = assign_folds(rows, 10, 0)?;
        let refit = best_of(3, || {
            for label in 0..10 {
                let kept: Vec<usize> = (0..rows).filter(|&row| folds[row] != label).collect();
                let (h, t) = (h.select(Axis(0), &kept), t.select(Axis(0), &kept));
                let problem = LeastSquares::new(&h, &t)?.with_intercept(true);
                Solver::from(Ridge::relative(1e-6)).solve(&problem)?;
            }
            Ok(())
        })?;
        let closed = best_of(3, || CrossValidator::new(&problem)?.k_fold(&folds, &[1e-6]))?;
        lines.push(format!(
            "{rows:>7} {neurons:>7} {slow:>10.2} {fast:>10.2} {:>6.1} {refit:>14.2} {closed:>12.2} {:>6.1}",
            slow / fast,
            refit / closed
        ));
    }
    #[allow(clippy::print_stdout)]
    {
        println!("{}", lines.join("\n"));
    }
    Ok(())
}

/// The shortest of some runs, in milliseconds.
fn best_of<T>(runs: usize, mut work: impl FnMut() -> elm::Result<T>) -> elm::Result<f64> {
    let mut best = f64::INFINITY;
    for _ in 0..runs {
        let start = Instant::now();
        std::hint::black_box(work()?);
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(best)
}
