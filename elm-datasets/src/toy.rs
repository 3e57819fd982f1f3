//! Regression problems with known answers.
//!
//! | problem | inputs | source |
//! |---|---|---|
//! | [`sinc`] | 1 | Huang, Zhu, Siew 2006 |
//! | [`friedman1`] | 10, of which 5 matter | Friedman 1991 |
//! | [`friedman2`], [`friedman3`] | 4 | Friedman 1991 |
//!
//! G.-B. Huang, Q.-Y. Zhu, C.-K. Siew, *Extreme Learning Machine: Theory and Applications*,
//! Neurocomputing 70, 2006. J. H. Friedman, *Multivariate Adaptive Regression Splines*, Annals of
//! Statistics 19(1), 1991.

// Formulas are not code.
#![allow(clippy::doc_markdown)]

use std::f64::consts::PI;
use std::ops::Range;

use ndarray::Array2;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal, StandardUniform};

use crate::Error;

/// Most rows that a problem can be asked for.
pub const MAX_ROWS: usize = 10_000_000;

/// Inputs with targets, with and without noise.
///
/// ```
/// use elm_datasets::toy;
///
/// let toy = toy::friedman1(200, 1.0, 7)?;
/// assert_eq!((toy.inputs.dim(), toy.targets.dim()), ((200, 10), (200, 1)));
/// let noise = &toy.targets - &toy.noiseless;
/// assert!((0.8..1.2).contains(&noise.std(0.0)));
/// # Ok::<(), elm_datasets::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Toy {
    /// Shape (rows, inputs), evenly distributed over the problem's domain.
    pub inputs: Array2<f64>,
    /// What a learner is given: the function with Gaussian noise, shape (rows, 1).
    pub targets: Array2<f64>,
    /// The function itself, shape (rows, 1).
    pub noiseless: Array2<f64>,
}

/// One input from -10 to 10: $y = \sin(x) / x$, and 1 at 0.
///
/// Huang et al. train with noise that is even over \[-0.2, 0.2\], whose standard deviation is
/// 0.115; here it is Gaussian.
///
/// # Parameters
/// `rows`, 1 to [`MAX_ROWS`]; `noise_sd`, the standard deviation of the noise, not negative;
/// `seed` of the random numbers. Same seed, same inputs, whatever the noise.
///
/// # Errors
/// [`Error::Rows`], [`Error::NoiseSd`]: out of the ranges above.
pub fn sinc(rows: usize, noise_sd: f64, seed: u64) -> Result<Toy, Error> {
    make(rows, noise_sd, seed, &[-10.0..10.0], |[x]| {
        if x == 0.0 { 1.0 } else { x.sin() / x }
    })
}

/// Ten inputs from 0 to 1, of which the last five do not matter:
///
/// $$ y = 10 \sin(\pi x_1 x_2) + 20 (x_3 - 0.5)^2 + 10 x_4 + 5 x_5 $$
///
/// Friedman's noise has standard deviation 1.
///
/// # Parameters
/// As for [`sinc`].
///
/// # Errors
/// As for [`sinc`].
pub fn friedman1(rows: usize, noise_sd: f64, seed: u64) -> Result<Toy, Error> {
    let domain = std::array::from_fn::<_, 10, _>(|_| 0.0..1.0);
    make(rows, noise_sd, seed, &domain, |[x1, x2, x3, x4, x5, ..]| {
        10.0 * (PI * x1 * x2).sin() + 20.0 * (x3 - 0.5).powi(2) + 10.0 * x4 + 5.0 * x5
    })
}

/// Four inputs, the impedance of an alternating current circuit from resistance, angular
/// frequency, inductance and capacitance:
///
/// $$ y = \sqrt{x_1^2 + \left( x_2 x_3 - \frac{1}{x_2 x_4} \right)^2} $$
///
/// with $x_1$ from 0 to 100, $x_2$ from $40 \pi$ to $560 \pi$, $x_3$ from 0 to 1, $x_4$ from 1 to
/// 11. Friedman's noise has a third of the function's standard deviation (about 125).
///
/// # Parameters
/// As for [`sinc`].
///
/// # Errors
/// As for [`sinc`].
pub fn friedman2(rows: usize, noise_sd: f64, seed: u64) -> Result<Toy, Error> {
    make(rows, noise_sd, seed, &circuit(), |[x1, x2, x3, x4]| {
        x1.hypot(x2 * x3 - 1.0 / (x2 * x4))
    })
}

/// The phase of the circuit of [`friedman2`], in radians:
///
/// $$ y = \arctan \left( \frac{x_2 x_3 - 1 / (x_2 x_4)}{x_1} \right) $$
///
/// Friedman's noise has a third of the function's standard deviation (about 0.1).
///
/// # Parameters
/// As for [`sinc`].
///
/// # Errors
/// As for [`sinc`].
pub fn friedman3(rows: usize, noise_sd: f64, seed: u64) -> Result<Toy, Error> {
    // The same as the quotient's arctangent, x_1 being positive, and finite at x_1 = 0 too.
    make(rows, noise_sd, seed, &circuit(), |[x1, x2, x3, x4]| {
        (x2 * x3 - 1.0 / (x2 * x4)).atan2(x1)
    })
}

fn circuit() -> [Range<f64>; 4] {
    [0.0..100.0, 40.0 * PI..560.0 * PI, 0.0..1.0, 1.0..11.0]
}

fn make<const INPUTS: usize>(
    rows: usize,
    noise_sd: f64,
    seed: u64,
    domain: &[Range<f64>; INPUTS],
    function: impl Fn([f64; INPUTS]) -> f64,
) -> Result<Toy, Error> {
    if !(1..=MAX_ROWS).contains(&rows) {
        return Err(Error::Rows {
            found: rows,
            last: MAX_ROWS,
        });
    }
    if !(noise_sd >= 0.0 && noise_sd.is_finite()) {
        return Err(Error::NoiseSd { found: noise_sd });
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    // A stream of its own, so that the inputs do not depend on the noise.
    let mut noise = random.clone();
    noise.set_stream(1);
    let mut toy = Toy {
        inputs: Array2::zeros((rows, INPUTS)),
        targets: Array2::zeros((rows, 1)),
        noiseless: Array2::zeros((rows, 1)),
    };
    for row in 0..rows {
        let input = domain.each_ref().map(|range| {
            let share: f64 = StandardUniform.sample(&mut random);
            range.start + (range.end - range.start) * share
        });
        let exact = function(input);
        let deviation: f64 = StandardNormal.sample(&mut noise);
        toy.inputs
            .row_mut(row)
            .iter_mut()
            .zip(input)
            .for_each(|(cell, value)| *cell = value);
        toy.noiseless[[row, 0]] = exact;
        toy.targets[[row, 0]] = exact + noise_sd * deviation;
    }
    Ok(toy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    type Problem = fn(usize, f64, u64) -> Result<Toy, Error>;

    const PROBLEMS: [(&str, Problem, usize); 4] = [
        ("sinc", sinc, 1),
        ("friedman1", friedman1, 10),
        ("friedman2", friedman2, 4),
        ("friedman3", friedman3, 4),
    ];

    fn mean_and_sd(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
        let count = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / count;
        (
            mean,
            (values.map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt(),
        )
    }

    #[test]
    fn shapes_are_those_of_the_problem_and_values_finite() {
        for (name, problem, inputs) in PROBLEMS {
            let toy = problem(50, 0.1, 1).unwrap();
            assert_eq!(toy.inputs.dim(), (50, inputs), "{name}");
            assert_eq!(
                (toy.targets.dim(), toy.noiseless.dim()),
                ((50, 1), (50, 1)),
                "{name}"
            );
            assert!(
                toy.inputs
                    .iter()
                    .chain(&toy.targets)
                    .all(|value| value.is_finite()),
                "{name}"
            );
        }
    }

    #[test]
    fn the_seed_decides_and_inputs_do_not_depend_on_the_noise() {
        for (name, problem, _) in PROBLEMS {
            let (a, b) = (problem(20, 0.5, 3).unwrap(), problem(20, 0.5, 3).unwrap());
            assert_eq!(a, b, "{name}");
            let quiet = problem(20, 0.0, 3).unwrap();
            assert_eq!(
                (&quiet.inputs, &quiet.targets),
                (&a.inputs, &a.noiseless),
                "{name}"
            );
            assert_ne!(a.inputs, problem(20, 0.5, 4).unwrap().inputs, "{name}");
        }
    }

    #[test]
    fn the_noise_has_the_standard_deviation_asked_for() {
        for (name, problem, _) in PROBLEMS {
            let toy = problem(20_000, 0.5, 5).unwrap();
            let noise = &toy.targets - &toy.noiseless;
            let (mean, sd) = mean_and_sd(noise.iter().copied());
            assert!(
                mean.abs() < 0.02 && (sd - 0.5).abs() < 0.02,
                "{name}: {mean} {sd}"
            );
        }
    }

    #[test]
    fn moments_are_those_of_the_functions() {
        // From midpoint sums over the domain; for the last two a third of the standard
        // deviation is the noise that Friedman states, 125 and 0.1.
        for (problem, mean, sd) in [
            (friedman1 as Problem, 14.41, 4.88),
            (friedman2, 479.5, 378.9),
            (friedman3, 1.324, 0.315),
        ] {
            let toy = problem(40_000, 0.0, 1).unwrap();
            let found = mean_and_sd(toy.targets.iter().copied());
            assert_relative_eq!(found.0, mean, max_relative = 0.01);
            assert_relative_eq!(found.1, sd, max_relative = 0.02);
        }
    }

    #[test]
    fn only_five_inputs_of_friedman_1_matter() {
        let toy = friedman1(30, 0.0, 8).unwrap();
        for (x, &y) in toy.inputs.rows().into_iter().zip(&toy.targets) {
            let expected = 10.0 * (PI * x[0] * x[1]).sin()
                + 20.0 * (x[2] - 0.5) * (x[2] - 0.5)
                + 10.0 * x[3]
                + 5.0 * x[4];
            assert_relative_eq!(y, expected, max_relative = 1e-12);
        }
    }

    #[test]
    fn rows_and_noise_out_of_range_are_errors() {
        for (_, problem, _) in PROBLEMS {
            for rows in [0, MAX_ROWS + 1, usize::MAX] {
                assert!(matches!(problem(rows, 0.0, 1), Err(Error::Rows { .. })));
            }
            for sd in [-0.1, f64::NAN, f64::INFINITY] {
                assert!(matches!(problem(5, sd, 1), Err(Error::NoiseSd { .. })));
            }
        }
    }
}
