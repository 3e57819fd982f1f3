//! The regression problems of the stress suite, each drawn from a seed.

use ndarray::{Array1, Array2, Axis, concatenate, s};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::reference::orthonormal;

/// Standard deviation of the noise relative to the signal's, unless a case says otherwise.
const NOISE: f64 = 0.1;
/// Rows that a fit is judged on.
const TEST_ROWS: usize = 600;

/// A kind of problem, one per seed.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// What is hard about it.
    pub name: &'static str,
    make: fn(&mut Draw) -> Problem,
}

impl Case {
    /// The problem of this seed.
    #[must_use]
    pub fn problem(&self, seed: u64) -> Problem {
        (self.make)(&mut Draw(ChaCha8Rng::seed_from_u64(seed)))
    }
}

/// What the rows are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Level {
    /// Inputs of a network.
    Data {
        /// Number of hidden neurons.
        neurons: usize,
        /// Scale of the random weights.
        scale: f64,
    },
    /// Rows of a hidden-layer matrix; no intercept.
    Matrix,
}

/// Rows to learn from and rows to be judged on.
#[derive(Debug, Clone)]
pub struct Problem {
    /// What the rows are.
    pub level: Level,
    /// Shape (rows, inputs or neurons).
    pub train: Array2<f64>,
    /// Shape (rows, outputs), of the order of 1, with noise.
    pub targets: Array2<f64>,
    /// Shape (test rows, inputs or neurons).
    pub test: Array2<f64>,
    /// Shape (test rows, outputs), with noise.
    pub test_targets: Array2<f64>,
    /// Standard deviation of the noise relative to the signal's.
    pub noise: f64,
    /// What the targets are multiplied by once they have the type that is tested.
    pub magnitude: Magnitude,
}

/// The order of magnitude of the targets, by the range of the type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Magnitude {
    /// As they are.
    One,
    /// 1e150 in `f64`, 1e18 in `f32`: about the root of the largest number.
    Huge,
    /// 1e-318 in `f64`, 1e-41 in `f32`: below the smallest normal number.
    Subnormal,
}

macro_rules! cases {
    ($($name:literal: $make:expr;)*) => {
        /// All cases.
        pub const CASES: &[Case] = &[$(Case { name: $name, make: $make }),*];
    };
}

cases! {
    "plain": |d| d.smooth(200, 60, |z, _| z);
    "duplicated features": |d| d.smooth(200, 60, |z, _| {
        concatenate![Axis(1), z.view(), z.view(), z.view()]
    });
    "duplicated neurons": |d| d.features(200, |h, _| concatenate![Axis(1), h.view(), h.view()]);
    "neurons = rows": |d| d.smooth(150, 150, |z, _| z);
    "neurons just below rows": |d| d.smooth(150, 146, |z, _| z);
    "neurons twice the rows": |d| d.smooth(120, 240, |z, _| z);
    "one input, 200 neurons": |d| d.wave(300, 200, 3.0, NOISE);
    "saturated neurons": |d| {
        let mut problem = d.smooth(200, 60, |z, _| z);
        problem.level = Level::Data { neurons: 60, scale: 1000.0 };
        problem
    };
    "features x 1e6": |d| d.smooth(200, 60, |z, _| z * 1e6);
    "features x 1e-8": |d| d.smooth(200, 60, |z, _| z * 1e-8);
    "features of scale 1e-6 to 1e6": |d| d.smooth(200, 60, |z, _| {
        z * Array1::from(vec![1e-6, 1e-2, 1e2, 1e6])
    });
    "constant columns": |d| d.smooth(200, 60, |z, _| {
        let constant = Array2::from_shape_fn((z.nrows(), 3), |(_, j)| [0.0, 0.1, -1e5][j]);
        concatenate![Axis(1), z.view(), constant.view()]
    });
    "a feature of 1e5": |d| d.smooth(200, 60, |mut z, _| {
        // Its information is in the last of the digits that f32 has.
        z.column_mut(0).mapv_inplace(|v| 1e5 + v);
        z
    });
    "a feature of 1e5 and noise": |d| d.smooth(200, 60, |z, d| {
        let large = d.normal(z.nrows(), 1).mapv(|v| 1e5 + 1e-3 * v);
        concatenate![Axis(1), z.view(), large.view()]
    });
    "a column of 1e5 in F": |d| d.features(200, |mut h, _| {
        h.column_mut(7).fill(1e5);
        h
    });
    "columns of scale 1e-6 to 1e6 in F": |d| d.features(200, |h, _| {
        let scales = Array1::logspace(10.0, -6.0, 6.0, h.ncols());
        h * scales
    });
    "F of rank 10": |d| {
        let factor = d.normal(10, 40);
        let rows = d.normal(200 + TEST_ROWS, 10);
        d.matrix(rows.dot(&factor), 200, None)
    };
    "F of condition 1e6": |d| d.conditioned(1e6, Target::Smooth);
    "F of condition 1e10": |d| d.conditioned(1e10, Target::Smooth);
    "F of condition 1e14": |d| d.conditioned(1e14, Target::Smooth);
    "F of condition 1e6, rough target": |d| d.conditioned(1e6, Target::Rough);
    "F of condition 1e10, rough target": |d| d.conditioned(1e10, Target::Rough);
    "F of condition 1e14, rough target": |d| d.conditioned(1e14, Target::Rough);
    "20 rows": |d| d.smooth(20, 30, |z, _| z.slice(s![.., ..2]).to_owned());
    "30 outputs": |d| d.many_outputs(200, 60, 30);
    "collinear features and an outlying row": |d| {
        let mut problem = d.smooth(200, 60, |z, d| {
            let near = d.normal(z.nrows(), 4).mapv(|v| 1e-9 * v) + &z;
            concatenate![Axis(1), z.view(), near.view()]
        });
        problem.train.row_mut(3).mapv_inplace(|v| 30.0 * v);
        problem
    };
    "an outlying target": |d| {
        let mut problem = d.smooth(200, 60, |z, _| z);
        problem.targets[[3, 0]] = 20.0;
        problem
    };
    "huge targets": |d| Problem {
        magnitude: Magnitude::Huge,
        ..d.smooth(200, 60, |z, _| z)
    };
    "subnormal targets": |d| Problem {
        magnitude: Magnitude::Subnormal,
        ..d.smooth(200, 60, |z, _| z)
    };
    "noise of 1e-4": |d| d.wave(300, 100, 1.0, 1e-4);
    "noise of 1e-8": |d| d.wave(300, 100, 1.0, 1e-8);
    "no noise": |d| d.wave(300, 100, 1.0, 0.0);
    "no noise, neurons = rows": |d| d.wave(150, 150, 3.0, 0.0);
    "a constant target": |d| {
        let mut problem = d.smooth(200, 60, |z, _| z);
        problem.targets.fill(0.1);
        problem.test_targets.fill(0.1);
        problem
    };
}

/// How a target lies in the singular directions of its matrix.
#[derive(Debug, Clone, Copy)]
enum Target {
    /// As a combination of columns with coefficients of one size: little in the small directions.
    Smooth,
    /// As much in the smallest direction as in the largest.
    Rough,
}

/// Random numbers, and the problems made of them.
struct Draw(ChaCha8Rng);

impl Draw {
    fn normal(&mut self, rows: usize, columns: usize) -> Array2<f64> {
        Array2::from_shape_simple_fn((rows, columns), || self.0.sample(StandardNormal))
    }

    fn uniform(&mut self, rows: usize, columns: usize) -> Array2<f64> {
        Array2::from_shape_simple_fn((rows, columns), || self.0.random_range(-1.0..1.0))
    }

    /// The signal with noise of this size relative to it.
    fn noisy(&mut self, signal: &Array2<f64>, noise: f64) -> Array2<f64> {
        let deviation = signal.std_axis(Axis(0), 0.0) * noise;
        signal + self.normal(signal.nrows(), signal.ncols()) * deviation
    }

    /// A smooth function of four inputs, which the learner sees as `disguise` makes them.
    fn smooth(
        &mut self,
        rows: usize,
        neurons: usize,
        disguise: fn(Array2<f64>, &mut Self) -> Array2<f64>,
    ) -> Problem {
        let z = self.uniform(rows + TEST_ROWS, 4);
        let signal = z.map_axis(Axis(1), |z| {
            (3.0 * z[0]).sin() + 2.0 * z[0] * z[1] + 0.5 * z[2]
        });
        let targets = self.noisy(&signal.insert_axis(Axis(1)), NOISE);
        let inputs = disguise(z, self);
        split(network(neurons), &inputs, &targets, rows)
    }

    /// A wave of one input.
    fn wave(&mut self, rows: usize, neurons: usize, frequency: f64, noise: f64) -> Problem {
        let x = self.uniform(rows + TEST_ROWS, 1);
        let signal = x.mapv(|x| (3.0 * frequency * x).sin() / (1.0 + x * x));
        let targets = self.noisy(&signal, noise);
        Problem {
            noise,
            ..split(network(neurons), &x, &targets, rows)
        }
    }

    /// Thirty different smooth functions, the later ones with more noise.
    fn many_outputs(&mut self, rows: usize, neurons: usize, outputs: usize) -> Problem {
        let z = self.uniform(rows + TEST_ROWS, 4);
        let signal =
            (z.dot(&(self.normal(4, outputs) * 1.5)) + self.normal(1, outputs)).mapv(f64::sin);
        let noise = Array1::logspace(10.0, -3.0, 0.0, outputs);
        let error = self.normal(z.nrows(), outputs) * signal.std_axis(Axis(0), 0.0) * noise;
        split(network(neurons), &z, &(signal + error), rows)
    }

    /// Forty random tanh features of a smooth function's inputs, seen as `disguise` makes them.
    fn features(
        &mut self,
        rows: usize,
        disguise: fn(Array2<f64>, &mut Self) -> Array2<f64>,
    ) -> Problem {
        let z = self.uniform(rows + TEST_ROWS, 4);
        let signal = z.map_axis(Axis(1), |z| {
            (3.0 * z[0]).sin() + 2.0 * z[0] * z[1] + 0.5 * z[2]
        });
        let hidden = (z.dot(&self.normal(4, 40)) + self.normal(1, 40)).mapv(f64::tanh);
        let targets = self.noisy(&signal.insert_axis(Axis(1)), NOISE);
        let hidden = disguise(hidden, self);
        split(Level::Matrix, &hidden, &targets, rows)
    }

    /// A matrix of all rows with a target that is a combination of its columns, or this one.
    fn matrix(&mut self, hidden: Array2<f64>, rows: usize, signal: Option<Array2<f64>>) -> Problem {
        let signal = signal.unwrap_or_else(|| hidden.dot(&self.normal(hidden.ncols(), 1)));
        let targets = self.noisy(&signal, NOISE);
        split(Level::Matrix, &hidden, &targets, rows)
    }

    /// A matrix with singular values that fall evenly on a log scale, as those of a Hilbert matrix
    /// do, from 1 to 1 / `condition` (over all rows; over the training rows about that).
    fn conditioned(&mut self, condition: f64, target: Target) -> Problem {
        let (rows, columns) = (200, 40);
        let u = orthonormal(self.normal(rows + TEST_ROWS, columns));
        let v = orthonormal(self.normal(columns, columns));
        let s = Array1::logspace(10.0, 0.0, -condition.log10(), columns);
        let signal = match target {
            Target::Smooth => None,
            Target::Rough => Some(u.dot(&self.normal(columns, 1))),
        };
        self.matrix((u * s).dot(&v.t()), rows, signal)
    }
}

/// A matrix of this condition with a smooth target, for the curve of error against condition.
#[must_use]
pub fn conditioned(condition: f64, seed: u64) -> Problem {
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(seed));
    draw.conditioned(condition, Target::Smooth)
}

fn network(neurons: usize) -> Level {
    Level::Data {
        neurons,
        scale: 1.0,
    }
}

fn split(level: Level, rows: &Array2<f64>, targets: &Array2<f64>, train: usize) -> Problem {
    let (first, last) = rows.view().split_at(Axis(0), train);
    let (targets, test_targets) = targets.view().split_at(Axis(0), train);
    Problem {
        level,
        train: first.to_owned(),
        targets: targets.to_owned(),
        test: last.to_owned(),
        test_targets: test_targets.to_owned(),
        noise: NOISE,
        magnitude: Magnitude::One,
    }
}
