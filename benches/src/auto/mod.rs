//! `ElmParams::auto` against the best of a dense grid that was chosen with the test rows in sight.

pub mod outside;
pub mod problems;

use std::time::Instant;

use elm::solve::Ridge;
use elm::{Activation, Biases, Dataset, ElmParams, Tuner};
use ndarray::{Array1, Array2, Axis, concatenate, s};
use serde::Serialize;

use crate::stress::oracle;
use problems::Problem;

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// [`ElmParams::auto`], which chooses everything; the grid is over scale, strength and neurons.
    Auto,
    /// Its quick level.
    Quick,
    /// [`ElmParams::tuner`] with 200 neurons; the grid is over scale and strength.
    Given,
}

impl Subject {
    /// The name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Quick => "quick",
            Self::Given => "tuner, 200 neurons",
        }
    }

    fn tuner(self, seed: u64) -> Tuner<f64> {
        match self {
            Self::Auto => ElmParams::auto().with_seed(seed),
            Self::Quick => ElmParams::auto().quick().with_seed(seed),
            Self::Given => base(200, seed).tuner(),
        }
    }

    fn sizes(self) -> &'static [usize] {
        match self {
            Self::Auto | Self::Quick => &[100, 400],
            Self::Given => &[200],
        }
    }
}

/// One problem at one seed.
#[derive(Debug, Clone, Serialize)]
pub struct Record {
    /// The problem.
    pub problem: &'static str,
    /// `auto`, its quick level, or the tuner of a given layer.
    pub subject: &'static str,
    /// Of data and layers.
    pub seed: u64,
    /// RMSE on test rows, the root mean square over outputs of RMSE over the targets' deviation.
    pub rmse: f64,
    /// `rmse` over that of the best on the grid.
    pub ratio: f64,
    /// The same against the function itself, without the noise that nothing can predict.
    pub rmse_exact: f64,
    /// `rmse_exact` over that of the best on the grid by this measure.
    pub ratio_exact: f64,
    /// What was chosen.
    pub neurons: usize,
    /// What was chosen.
    pub scale: f64,
    /// Settings tried.
    pub trials: usize,
    /// Of choosing and fitting, on one thread.
    pub seconds: f64,
}

/// Rows that judge.
const TEST_ROWS: usize = 2000;

/// The grid's layers: those that `auto` draws, but with one scale for all inputs.
fn base(neurons: usize, seed: u64) -> ElmParams<f64> {
    ElmParams::new(neurons)
        .with_activation(Activation::Tanh)
        .with_biases(Biases::AtTrainingRows)
        .with_seed(seed)
}

/// Runs a problem at a seed; nothing where it cannot be drawn or fitted, which its caller reports.
///
/// The grid has scales from 1/30 to 30 of the scale at which a weighted sum of standardised inputs
/// has deviation 1, four to a decade, and strengths by [`oracle::best`].
#[must_use]
pub fn run(problem: &Problem, subject: Subject, seed: u64) -> Option<Record> {
    let (x, t) = problem.train(seed)?;
    let (x_test, test) = problem.test(seed, TEST_ROWS, 1.0)?;
    let start = Instant::now();
    let tuned = subject.tuner(seed).tune(&Dataset::new(&x, &t).ok()?).ok()?;
    let seconds = start.elapsed().as_secs_f64();
    // Both measures at once, as outputs side by side.
    let test = concatenate(Axis(1), &[test[0].view(), test[1].view()]).ok()?;
    let twice = concatenate(Axis(1), &[t.view(), t.view()]).ok()?;
    let predicted = tuned.model.predict(&x_test).ok()?;
    let errors = concatenate(Axis(1), &[predicted.view(), predicted.view()]).ok()? - &test;
    let squares = errors.mapv(|e| e * e).mean_axis(Axis(0))?;
    let [rmse, rmse_exact] = relative(&squares, &t);
    let best = best_of_grid(&x, &twice, &x_test, &test, subject.sizes(), seed)?;
    let [best, best_exact] = relative(&best, &t);
    Some(Record {
        problem: problem.name,
        subject: subject.name(),
        seed,
        rmse,
        ratio: rmse / best,
        rmse_exact,
        ratio_exact: rmse_exact / best_exact,
        neurons: tuned.best.neurons,
        scale: tuned.best.scale,
        trials: tuned.trials.len(),
        seconds,
    })
}

/// From the mean squared errors of all outputs twice, the root mean square over outputs of the RMSE
/// over the training targets' deviation, twice.
fn relative(squares: &Array1<f64>, t: &Array2<f64>) -> [f64; 2] {
    let outputs = t.ncols();
    let variances = t.var_axis(Axis(0), 0.0);
    [0, outputs].map(|first| {
        let squares = squares.slice(s![first..first + outputs]);
        let sum: f64 = squares.iter().zip(&variances).map(|(e, v)| e / v).sum();
        (sum / outputs as f64).sqrt()
    })
}

/// The smallest mean squared error on the grid; each output has the layer and strength that suit it.
fn best_of_grid(
    x: &Array2<f64>,
    t: &Array2<f64>,
    x_test: &Array2<f64>,
    test: &Array2<f64>,
    sizes: &[usize],
    seed: u64,
) -> Option<Array1<f64>> {
    let center = (x.ncols() as f64).sqrt().recip();
    let mut best = Array1::from_elem(t.ncols(), f64::INFINITY);
    for &neurons in sizes {
        for step in -6..=6 {
            let scale = center * 10.0_f64.powf(f64::from(step) / 4.0);
            // Any strength: only the layer is needed.
            let any = Ridge::relative(1.0);
            let layer = base(neurons, seed)
                .with_scale(scale)
                .with_solver(any)
                .fit(x, t)
                .ok()?;
            let hidden = layer.hidden_matrix(x).ok()?;
            let hidden_test = layer.hidden_matrix(x_test).ok()?;
            let errors = oracle::best(
                hidden.view(),
                t.view(),
                hidden_test.view(),
                test.view(),
                true,
            )?;
            best.zip_mut_with(&errors, |best, &error| *best = best.min(error));
        }
    }
    Some(best)
}
