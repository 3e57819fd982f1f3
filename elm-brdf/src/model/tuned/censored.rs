//! Values that noise would have made negative and that a reader has set to 0.
//!
//! Their mean is not known, but what it is expected to be: that of the part below 0 of a normal
//! distribution about the value fitted (J. Tobin, *Estimation of Relationships for Limited Dependent
//! Variables*, Econometrica 26(1), 1958; by expectation and maximisation, A. Dempster, N. Laird, D. Rubin,
//! Journal of the Royal Statistical Society B 39(1), 1977). Left at 0 they would make a dark coating too
//! bright. Where the value fitted is far above the noise, next to nothing is changed.

use std::f64::consts::{PI, SQRT_2};

use ndarray::{Array2, ArrayView2};

/// Rounds of working residuals without, and with values cut off.
const ROUNDS: usize = 3;
const MORE_ROUNDS: usize = 10;
/// Noise is learnt from rows whose value is below this multiple of its standard deviation.
const DARK: f64 = 4.0;

/// The noise of each channel whose zeros are negative values cut off.
pub(super) struct Censored {
    /// Standard deviation, 0 for channels that are as they were measured.
    noise: Vec<f64>,
    /// Expected squares of the noise at dark rows of this round, and how many.
    squares: Vec<(f64, f64)>,
}

impl Censored {
    /// A channel with zeros and without negative values is taken to be cut off; `noise` is a first
    /// guess.
    pub(super) fn new(values: ArrayView2<'_, f64>, noise: &[f64]) -> Self {
        let of = |(values, &noise): (ndarray::ArrayView1<'_, f64>, &f64)| {
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let all = values.iter().all(|&value| value == 0.0);
            if least == 0.0 && !all { noise } else { 0.0 }
        };
        let noise: Vec<f64> = values.columns().into_iter().zip(noise).map(of).collect();
        Self {
            squares: vec![(0.0, 0.0); noise.len()],
            noise,
        }
    }

    /// How many rounds it takes.
    pub(super) fn rounds(&self) -> usize {
        if self.noise.iter().any(|&noise| noise > 0.0) {
            MORE_ROUNDS
        } else {
            ROUNDS
        }
    }

    /// The values, with those cut off replaced by what they are expected to have been; `means` are the
    /// values fitted.
    pub(super) fn completed(
        &mut self,
        values: ArrayView2<'_, f64>,
        means: ArrayView2<'_, f64>,
    ) -> Array2<f64> {
        let mut completed = values.to_owned();
        let channels = completed.columns_mut().into_iter().zip(means.columns());
        let known = self.noise.iter().zip(&mut self.squares);
        for ((mut values, means), (&noise, squares)) in channels.zip(known) {
            if noise <= 0.0 {
                continue;
            }
            for (value, &mean) in values.iter_mut().zip(means) {
                let square = if *value <= 0.0 {
                    let edge = -mean / noise;
                    let ratio = density_over_share(edge);
                    *value = mean - noise * ratio;
                    noise * noise * (1.0 - edge * ratio)
                } else {
                    (*value - mean).powi(2)
                };
                if mean <= DARK * noise {
                    squares.0 += square;
                    squares.1 += 1.0;
                }
            }
        }
        completed
    }

    /// Ends a round: the noise is what its expected squares say.
    pub(super) fn learn(&mut self) {
        for (noise, squares) in self.noise.iter_mut().zip(&mut self.squares) {
            if squares.1 > 0.0 {
                *noise = (squares.0 / squares.1).sqrt();
            }
            *squares = (0.0, 0.0);
        }
    }
}

/// $\varphi(a) / \Phi(a)$ of the normal distribution.
fn density_over_share(a: f64) -> f64 {
    if a < -3.5 {
        // Mills' ratio, to 0.2 %.
        return -a - 1.0 / a + 2.0 / a.powi(3) - 10.0 / a.powi(5);
    }
    let density = (-0.5 * a * a).exp() / (2.0 * PI).sqrt();
    density / share(a)
}

/// $\Phi(a)$, to 1.5e-7: Abramowitz and Stegun, *Handbook of Mathematical Functions*, 7.1.26.
fn share(a: f64) -> f64 {
    let x = a.abs() / SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let series = [
        0.254_829_592,
        -0.284_496_736,
        1.421_413_741,
        -1.453_152_027,
        1.061_405_429,
    ];
    let sum = series.iter().rev().fold(0.0, |sum, c| t * (c + sum));
    let above = 0.5 * sum * (-x * x).exp();
    if a > 0.0 { 1.0 - above } else { above }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_mean_of_what_is_cut_off_is_that_of_the_normal_distribution() {
        // Tables of the normal distribution.
        for (a, expected) in [
            (0.0, 0.797_885),
            (-1.0, 1.525_135),
            (1.0, 0.287_600),
            (-4.0, 4.225_607),
            (-8.0, 8.121_168),
        ] {
            assert!((density_over_share(a) / expected - 1.0).abs() < 3e-3, "{a}");
        }
    }

    #[test]
    fn mean_and_noise_of_values_cut_off_at_0_are_found() {
        for mean in [0.5, 1.0, 2.0] {
            let mut random = ChaCha8Rng::seed_from_u64(1);
            // The sum of twelve uniform deviates less 6 is near to normal, of deviation 1.
            let values = Array2::from_shape_fn((20_000, 1), |_| {
                let sum: f64 = (0..12).map(|_| random.random_range(0.0..1.0)).sum();
                (mean + sum - 6.0_f64).max(0.0)
            });
            let mut censored = Censored::new(values.view(), &[0.6]);
            let mut fitted = 0.3;
            for _ in 0..60 {
                let means = Array2::from_elem(values.dim(), fitted);
                let completed = censored.completed(values.view(), means.view());
                fitted = completed.mean().unwrap();
                censored.learn();
            }
            // Four standard errors.
            assert!((fitted - mean).abs() < 0.03, "{fitted} for {mean}");
            assert!((censored.noise[0] - 1.0).abs() < 0.03);
        }
    }
}
