//! Regression problems of many sorts, each with the answer known.

use elm_datasets::toy::{self, Toy};
use ndarray::{Array2, Axis, concatenate, s};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A problem by name.
#[derive(Debug, Clone, Copy)]
pub struct Problem {
    /// Its name in tables.
    pub name: &'static str,
    /// Training rows.
    pub rows: usize,
    /// Draws rows from a seed: the same inputs with and without noise on the targets.
    draw: fn(usize, u64, bool) -> Option<Data>,
}

/// Inputs and targets, a row for each observation.
pub type Data = (Array2<f64>, Array2<f64>);

impl Problem {
    /// Rows to fit to.
    #[must_use]
    pub fn train(&self, seed: u64) -> Option<Data> {
        (self.draw)(self.rows, seed, true)
    }

    /// Rows to judge by: inputs, targets as they are observed, and the function itself.
    #[must_use]
    pub fn test(&self, seed: u64, rows: usize) -> Option<(Array2<f64>, [Array2<f64>; 2])> {
        let seed = seed ^ 0x5eed_0000_0000;
        let (x, observed) = (self.draw)(rows, seed, true)?;
        let (_, exact) = (self.draw)(rows, seed, false)?;
        Some((x, [observed, exact]))
    }
}

macro_rules! problems {
    ($($name:literal, $rows:expr, $draw:expr;)*) => {
        &[$(Problem { name: $name, rows: $rows, draw: $draw }),*]
    };
}

/// The toy problems, and what else a table may hold.
pub const PROBLEMS: &[Problem] = problems! {
    "sinc", 200, |n, seed, noisy| pick(toy::sinc(n, 0.1, seed), noisy);
    "sinc, no noise", 200, |n, seed, noisy| pick(toy::sinc(n, 0.0, seed), noisy);
    "Friedman 1", 500, |n, seed, noisy| pick(toy::friedman1(n, 1.0, seed), noisy);
    "Friedman 2", 500, |n, seed, noisy| pick(toy::friedman2(n, 125.0, seed), noisy);
    "Friedman 3", 500, |n, seed, noisy| pick(toy::friedman3(n, 0.1, seed), noisy);
    "10 inputs, products and waves", 2000, |n, seed, noisy| uniform(n, 10, seed, noisy, 0.1, |x| {
        (3.0 * x[0]).sin() * x[1] + x[2] * x[3] + (x[4] + x[5] - x[6]).tanh() + 0.3 * x[7]
    });
    "30 rows", 30, |n, seed, noisy| pick(toy::friedman1(n, 1.0, seed), noisy);
    "60 rows of 2 inputs", 60, |n, seed, noisy| uniform(n, 2, seed, noisy, 0.1, |x| {
        (3.0 * x[0]).sin() + x[1] * x[1]
    });
    "100 rows", 100, |n, seed, noisy| pick(toy::friedman2(n, 125.0, seed), noisy);
    "50 inputs, 5 matter", 500, |n, seed, noisy| uniform(n, 50, seed, noisy, 0.3, |x| {
        2.0 * (x[0] * x[1]) + (3.0 * x[2]).sin() + x[3] - x[4]
    });
    "100 inputs, all matter", 1000, |n, seed, noisy| uniform(n, 100, seed, noisy, 0.3, |x| {
        let sum: f64 = x.iter().enumerate().map(|(j, x)| x * (j as f64).sin()).sum();
        (sum / 2.0).sin() + sum / 4.0
    });
    "heavy tails", 1000, |n, seed, noisy| normal(n, 5, seed, noisy, 0.1, |z| {
        (z.iter().map(|z| (1.5 * z).exp()).collect(), z[0].sin() + z[1] * z[2] + 0.5 * z[3])
    });
    "Student inputs, 2 degrees", 1000, |n, seed, noisy| student(n, seed, noisy);
    "mixed scales", 1000, |n, seed, noisy| normal(n, 4, seed, noisy, 0.1, |z| {
        let units = [1e-6, 1.0, 1e4, 1e8];
        let x = z.iter().zip(units).map(|(z, unit)| z * unit + 3.0 * unit);
        (x.collect(), (2.0 * z[0]).sin() + z[1] * z[2] + z[3])
    });
    "0/1 columns", 800, |n, seed, noisy| binary(n, seed, noisy);
    "constant columns", 500, |n, seed, noisy| {
        let (x, t) = pick(toy::friedman3(n, 0.1, seed), noisy)?;
        let ones = Array2::from_elem((n, 3), 7.5);
        Some((concatenate(Axis(1), &[x.view(), ones.view()]).ok()?, t))
    };
    "steps", 1000, |n, seed, noisy| uniform(n, 3, seed, noisy, 0.1, |x| {
        f64::from(x[0] > 0.2) + 2.0 * f64::from(x[1] > -0.3) * f64::from(x[2] < 0.5)
    });
    "many waves", 1000, |n, seed, noisy| uniform(n, 1, seed, noisy, 0.05, |x| (40.0 * x[0]).sin());
    "a straight line", 200, |n, seed, noisy| uniform(n, 5, seed, noisy, 0.5, |x| x[0] - 2.0 * x[1]);
    "noise alone", 300, |n, seed, noisy| uniform(n, 5, seed, noisy, 1.0, |_| 0.0);
    "3 outputs", 600, |n, seed, noisy| {
        let (x, t) = pick(toy::friedman1(n, 1.0, seed), noisy)?;
        let other = x.map_axis(Axis(1), |x| 1e6 * (4.0 * x[0]).sin() * x[1]).insert_axis(Axis(1));
        let third = x.map_axis(Axis(1), |x| 1e-6 * x[9]).insert_axis(Axis(1));
        Some((x, concatenate(Axis(1), &[t.view(), other.view(), third.view()]).ok()?))
    };
    "targets of 1e6", 300, |n, seed, noisy| {
        let (x, t) = pick(toy::friedman3(n, 0.1, seed), noisy)?;
        Some((x, t * 1e6 + 1e7))
    };
    "targets of 1e-6", 300, |n, seed, noisy| {
        let (x, t) = pick(toy::friedman3(n, 0.1, seed), noisy)?;
        Some((x, t * 1e-6))
    };
    "correlated inputs", 500, |n, seed, noisy| normal(n, 8, seed, noisy, 0.2, |z| {
        let x: Vec<f64> = z.iter().map(|own| z[0] + 0.1 * own).collect();
        let t = (2.0 * z[0]).sin() + 3.0 * (x[1] - x[2]);
        (x, t)
    });
    "20,000 rows of 20", 20_000, |n, seed, noisy| uniform(n, 20, seed, noisy, 0.2, |x| {
        (2.0 * x[0] * x[1]).sin() + x[2] * x[3] * x[4] + (x[5] + x[6]).abs() + x[7..].iter().sum::<f64>() / 5.0
    });
};

fn pick<E>(toy: Result<Toy, E>, noisy: bool) -> Option<Data> {
    let toy = toy.ok()?;
    Some((toy.inputs, if noisy { toy.targets } else { toy.noiseless }))
}

/// Rows from a function that draws one, its exact target last; `deviation` of the noise.
fn rows(
    count: usize,
    inputs: usize,
    seed: u64,
    noisy: bool,
    deviation: f64,
    mut row: impl FnMut(&mut ChaCha8Rng) -> (Vec<f64>, f64),
) -> Option<Data> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = random.clone();
    noise.set_stream(1);
    let (mut x, mut t) = (Array2::zeros((count, inputs)), Array2::zeros((count, 1)));
    for i in 0..count {
        let (input, target) = row(&mut random);
        x.slice_mut(s![i, ..])
            .iter_mut()
            .zip(input)
            .for_each(|(to, from)| *to = from);
        let error: f64 = StandardNormal.sample(&mut noise);
        t[[i, 0]] = target + if noisy { deviation * error } else { 0.0 };
    }
    Some((x, t))
}

fn uniform(
    count: usize,
    inputs: usize,
    seed: u64,
    noisy: bool,
    deviation: f64,
    function: fn(&[f64]) -> f64,
) -> Option<Data> {
    rows(count, inputs, seed, noisy, deviation, |random| {
        let x: Vec<f64> = (0..inputs)
            .map(|_| random.random_range(-1.0..1.0))
            .collect();
        let t = function(&x);
        (x, t)
    })
}

fn normals(random: &mut ChaCha8Rng, count: usize) -> Vec<f64> {
    (0..count).map(|_| StandardNormal.sample(random)).collect()
}

fn normal(
    count: usize,
    inputs: usize,
    seed: u64,
    noisy: bool,
    deviation: f64,
    function: fn(&[f64]) -> (Vec<f64>, f64),
) -> Option<Data> {
    rows(count, inputs, seed, noisy, deviation, |random| {
        function(&normals(random, inputs))
    })
}

/// Infinite variance: single rows lie a hundred deviations out.
fn student(count: usize, seed: u64, noisy: bool) -> Option<Data> {
    rows(count, 3, seed, noisy, 0.1, |random| {
        let x: Vec<f64> = (0..3)
            .map(|_| {
                let z = normals(random, 3);
                z[0] / ((z[1] * z[1] + z[2] * z[2]) / 2.0).sqrt()
            })
            .collect();
        let t = x[0].tanh() + (x[1] / (1.0 + x[2] * x[2])).sin();
        (x, t)
    })
}

/// A category in six columns, four flags and two numbers.
fn binary(count: usize, seed: u64, noisy: bool) -> Option<Data> {
    rows(count, 12, seed, noisy, 0.2, |random| {
        let category = random.random_range(0..6_usize);
        let mut x: Vec<f64> = (0..6).map(|k| f64::from(k == category)).collect();
        x.extend((0..4).map(|_| f64::from(random.random_bool(0.3))));
        x.extend([
            random.random_range(-1.0..1.0),
            random.random_range(0.0..100.0),
        ]);
        let effect = [0.0, 1.0, -1.0, 2.0, 0.5, -0.5][category];
        let t = effect + x[6] * x[7] + effect * x[10] + 0.01 * x[11] * x[8];
        (x, t)
    })
}
