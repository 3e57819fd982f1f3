//! Regression problems of many sorts, each with the answer known.

use std::f64::consts::PI;

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
    /// Draws rows: the same inputs with and without noise on the targets.
    draw: fn(Draw) -> Option<Data>,
}

/// What rows to draw.
#[derive(Debug, Clone, Copy)]
struct Draw {
    rows: usize,
    seed: u64,
    noisy: bool,
    /// What the inputs' distances from their centres are multiplied by.
    stretch: f64,
}

/// Inputs and targets, a row for each observation.
pub type Data = (Array2<f64>, Array2<f64>);

impl Problem {
    /// Rows to fit to.
    #[must_use]
    pub fn train(&self, seed: u64) -> Option<Data> {
        let (rows, noisy, stretch) = (self.rows, true, 1.0);
        (self.draw)(Draw {
            rows,
            seed,
            noisy,
            stretch,
        })
    }

    /// Rows to judge by: inputs, targets as they are observed, and the function itself. With
    /// `stretch` above 1 they reach beyond the training rows by that factor.
    #[must_use]
    pub fn test(
        &self,
        seed: u64,
        rows: usize,
        stretch: f64,
    ) -> Option<(Array2<f64>, [Array2<f64>; 2])> {
        let draw = Draw {
            rows,
            seed: seed ^ 0x5eed_0000_0000,
            noisy: true,
            stretch,
        };
        let (x, observed) = (self.draw)(draw)?;
        let (_, exact) = (self.draw)(Draw {
            noisy: false,
            ..draw
        })?;
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
    "sinc", 200, |draw| sinc(draw, 0.1);
    "sinc, no noise", 200, |draw| sinc(draw, 0.0);
    "Friedman 1", 500, |draw| friedman1(draw, 1.0);
    "Friedman 2", 500, |draw| friedman2(draw, 125.0);
    "Friedman 3", 500, |draw| friedman3(draw, 0.1);
    "10 inputs, products and waves", 2000, |draw| uniform(draw, 10, 0.1, |x| {
        (3.0 * x[0]).sin() * x[1] + x[2] * x[3] + (x[4] + x[5] - x[6]).tanh() + 0.3 * x[7]
    });
    "30 rows", 30, |draw| friedman1(draw, 1.0);
    "60 rows of 2 inputs", 60, |draw| uniform(draw, 2, 0.1, |x| {
        (3.0 * x[0]).sin() + x[1] * x[1]
    });
    "100 rows", 100, |draw| friedman2(draw, 125.0);
    "50 inputs, 5 matter", 500, |draw| uniform(draw, 50, 0.3, |x| {
        2.0 * (x[0] * x[1]) + (3.0 * x[2]).sin() + x[3] - x[4]
    });
    "100 inputs, all matter", 1000, |draw| uniform(draw, 100, 0.3, |x| {
        let sum: f64 = x.iter().enumerate().map(|(j, x)| x * (j as f64).sin()).sum();
        (sum / 2.0).sin() + sum / 4.0
    });
    "heavy tails", 1000, |draw| normal(draw, 5, 0.1, |z| {
        (z.iter().map(|z| (1.5 * z).exp()).collect(), z[0].sin() + z[1] * z[2] + 0.5 * z[3])
    });
    "Student inputs, 2 degrees", 1000, |draw| student(draw);
    "mixed scales", 1000, |draw| normal(draw, 4, 0.1, |z| {
        let units = [1e-6, 1.0, 1e4, 1e8];
        let x = z.iter().zip(units).map(|(z, unit)| z * unit + 3.0 * unit);
        (x.collect(), (2.0 * z[0]).sin() + z[1] * z[2] + z[3])
    });
    "0/1 columns", 800, |draw| binary(draw);
    "constant columns", 500, |draw| {
        let (x, t) = friedman3(draw, 0.1)?;
        let ones = Array2::from_elem((draw.rows, 3), 7.5);
        Some((concatenate(Axis(1), &[x.view(), ones.view()]).ok()?, t))
    };
    "steps", 1000, |draw| uniform(draw, 3, 0.1, |x| {
        f64::from(x[0] > 0.2) + 2.0 * f64::from(x[1] > -0.3) * f64::from(x[2] < 0.5)
    });
    "many waves", 1000, |draw| uniform(draw, 1, 0.05, |x| (40.0 * x[0]).sin());
    "a straight line", 200, |draw| uniform(draw, 5, 0.5, |x| x[0] - 2.0 * x[1]);
    "noise alone", 300, |draw| uniform(draw, 5, 1.0, |_| 0.0);
    "3 outputs", 600, |draw| {
        let (x, t) = friedman1(draw, 1.0)?;
        let other = x.map_axis(Axis(1), |x| 1e6 * (4.0 * x[0]).sin() * x[1]).insert_axis(Axis(1));
        let third = x.map_axis(Axis(1), |x| 1e-6 * x[9]).insert_axis(Axis(1));
        Some((x, concatenate(Axis(1), &[t.view(), other.view(), third.view()]).ok()?))
    };
    "targets of 1e6", 300, |draw| {
        let (x, t) = friedman3(draw, 0.1)?;
        Some((x, t * 1e6 + 1e7))
    };
    "targets of 1e-6", 300, |draw| {
        let (x, t) = friedman3(draw, 0.1)?;
        Some((x, t * 1e-6))
    };
    "correlated inputs", 500, |draw| normal(draw, 8, 0.2, |z| {
        let x: Vec<f64> = z.iter().map(|own| z[0] + 0.1 * own).collect();
        let t = (2.0 * z[0]).sin() + 3.0 * (x[1] - x[2]);
        (x, t)
    });
    "20,000 rows of 20", 20_000, |draw| uniform(draw, 20, 0.2, |x| {
        (2.0 * x[0] * x[1]).sin() + x[2] * x[3] * x[4] + (x[5] + x[6]).abs() + x[7..].iter().sum::<f64>() / 5.0
    });
};

fn sinc(draw: Draw, noise: f64) -> Option<Data> {
    let toy = toy::sinc(draw.rows, noise, draw.seed).ok()?;
    Some(toy_rows(draw, toy, &[0.0], |x| {
        if x[0] == 0.0 { 1.0 } else { x[0].sin() / x[0] }
    }))
}

fn friedman1(draw: Draw, noise: f64) -> Option<Data> {
    let toy = toy::friedman1(draw.rows, noise, draw.seed).ok()?;
    Some(toy_rows(draw, toy, &[0.5; 10], |x| {
        let bend = 20.0 * (x[2] - 0.5).powi(2);
        10.0 * (PI * x[0] * x[1]).sin() + bend + 10.0 * x[3] + 5.0 * x[4]
    }))
}

/// The middles of the inputs of Friedman's second and third problem.
const CIRCUIT: [f64; 4] = [50.0, 300.0 * PI, 0.5, 6.0];

fn friedman2(draw: Draw, noise: f64) -> Option<Data> {
    let toy = toy::friedman2(draw.rows, noise, draw.seed).ok()?;
    Some(toy_rows(draw, toy, &CIRCUIT, |x| {
        x[0].hypot(x[1] * x[2] - 1.0 / (x[1] * x[3]))
    }))
}

fn friedman3(draw: Draw, noise: f64) -> Option<Data> {
    let toy = toy::friedman3(draw.rows, noise, draw.seed).ok()?;
    Some(toy_rows(draw, toy, &CIRCUIT, |x| {
        (x[1] * x[2] - 1.0 / (x[1] * x[3])).atan2(x[0])
    }))
}

/// The rows of a toy problem, stretched about its middle, where its formula says what they are.
fn toy_rows(draw: Draw, toy: Toy, middle: &[f64], formula: fn(&[f64]) -> f64) -> Data {
    let noise = toy.targets - &toy.noiseless;
    let (mut x, mut exact) = (toy.inputs, toy.noiseless);
    if draw.stretch != 1.0 {
        for (mut row, exact) in x.rows_mut().into_iter().zip(&mut exact) {
            for (x, middle) in row.iter_mut().zip(middle) {
                *x = middle + draw.stretch * (*x - middle);
            }
            *exact = formula(&row.to_vec());
        }
    }
    (x, if draw.noisy { exact + noise } else { exact })
}

/// Rows from a function that draws one, its exact target last; `deviation` of the noise.
fn rows(
    draw: Draw,
    inputs: usize,
    deviation: f64,
    mut row: impl FnMut(&mut ChaCha8Rng) -> (Vec<f64>, f64),
) -> Option<Data> {
    let Draw {
        rows: count,
        seed,
        noisy,
        ..
    } = draw;
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

fn uniform(draw: Draw, inputs: usize, deviation: f64, function: fn(&[f64]) -> f64) -> Option<Data> {
    rows(draw, inputs, deviation, |random| {
        let x: Vec<f64> = (0..inputs)
            .map(|_| draw.stretch * random.random_range(-1.0..1.0))
            .collect();
        let t = function(&x);
        (x, t)
    })
}

fn normals(random: &mut ChaCha8Rng, count: usize) -> Vec<f64> {
    (0..count).map(|_| StandardNormal.sample(random)).collect()
}

fn normal(
    draw: Draw,
    inputs: usize,
    deviation: f64,
    function: fn(&[f64]) -> (Vec<f64>, f64),
) -> Option<Data> {
    rows(draw, inputs, deviation, |random| {
        let z = normals(random, inputs);
        function(&z.iter().map(|z| draw.stretch * z).collect::<Vec<_>>())
    })
}

/// Infinite variance: single rows lie a hundred deviations out.
fn student(draw: Draw) -> Option<Data> {
    rows(draw, 3, 0.1, |random| {
        let x: Vec<f64> = (0..3)
            .map(|_| {
                let z = normals(random, 3);
                draw.stretch * z[0] / ((z[1] * z[1] + z[2] * z[2]) / 2.0).sqrt()
            })
            .collect();
        let t = x[0].tanh() + (x[1] / (1.0 + x[2] * x[2])).sin();
        (x, t)
    })
}

/// A category in six columns, four flags and two numbers.
fn binary(draw: Draw) -> Option<Data> {
    rows(draw, 12, 0.2, |random| {
        let category = random.random_range(0..6_usize);
        let mut x: Vec<f64> = (0..6).map(|k| f64::from(k == category)).collect();
        x.extend((0..4).map(|_| f64::from(random.random_bool(0.3))));
        x.extend([
            draw.stretch * random.random_range(-1.0..1.0),
            50.0 + draw.stretch * (random.random_range(0.0..100.0) - 50.0),
        ]);
        let effect = [0.0, 1.0, -1.0, 2.0, 0.5, -0.5][category];
        let t = effect + x[6] * x[7] + effect * x[10] + 0.01 * x[11] * x[8];
        (x, t)
    })
}
