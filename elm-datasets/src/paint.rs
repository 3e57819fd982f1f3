//! A metallic paint from formulas, whose reflectance spans seven powers of ten: what a model must
//! stay sane on.
//!
//! Layers as car paint has them, in red, green and blue:
//!
//! - a clear coat: a narrow [Ward](crate::lobes::ward) lobe with a dielectric's reflectance,
//!   the same in every channel;
//! - metal flakes under it: a wide, tinted lobe of the same kind;
//! - a base that is all but black, which is all that is left far from the mirror direction.
//!
//! At the directions of [`Sampling::Random`] values run from about 1e-5 to about 600 per
//! steradian. No result on it says anything about real paints.

use std::array;
use std::f64::consts::FRAC_1_PI;

use ndarray::Array2;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::geometry::DirectionPair;
use crate::lobes::Cosines;
use crate::{Error, Samples, Sampling};

const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// Reflectance of the clear coat seen head-on: that of common lacquers.
const COAT_F0: f64 = 0.04;
/// Its roughness.
const COAT_ALPHA: f64 = 0.1;
/// Share of light that the flakes return.
const FLAKES: [f64; 3] = [0.45, 0.12, 0.03];
/// Spread of the flakes' slopes.
const FLAKE_ALPHA: f64 = 0.25;
/// Albedo of the base.
const BASE: [f64; 3] = [1e-3, 3e-4, 1e-4];

/// Standard deviation of a value's noise over the value.
const NOISE: f64 = 0.02;

/// The BRDF in 1/sr at one pair of directions, red, green and blue, without noise; 0 where light
/// or viewer is below the horizon.
#[must_use]
pub fn truth(directions: &DirectionPair) -> [f64; 3] {
    let Some(angles) = Cosines::of(directions) else {
        return [0.0; 3];
    };
    let fresnel = COAT_F0 + (1.0 - COAT_F0) * angles.schlick();
    let (coat, flakes) = (angles.ward(COAT_ALPHA), angles.ward(FLAKE_ALPHA));
    // The coat takes its share on the way in and on the way out.
    let passed = (1.0 - fresnel).powi(2);
    array::from_fn(|c| fresnel * coat + passed * (FLAKES[c] * flakes + BASE[c] * FRAC_1_PI))
}

/// Measures the paint at `rows` pairs of directions drawn as [`Sampling::Random`] draws them, with
/// noise of 2 % of each value. The same seed gives the same numbers, and more rows only add some.
///
/// ```
/// let paint = elm_datasets::paint::samples(2000, 1)?;
/// assert_eq!(paint.values.dim(), (2000, 3));
/// let (least, most) = paint.values.iter().fold((f64::MAX, 0.0_f64), |(a, b), &v| (a.min(v), b.max(v)));
/// assert!(least < 1e-4 && most > 100.0);
/// # Ok::<(), elm_datasets::Error>(())
/// ```
///
/// # Errors
/// [`Error::Rows`] for none, or for more than 10 million.
pub fn samples(rows: usize, seed: u64) -> Result<Samples, Error> {
    let directions = Sampling::Random { rows, seed }.directions()?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    // Directions are drawn from stream 0 of the same seed.
    random.set_stream(1);
    let mut values = Array2::zeros((directions.len(), CHANNELS.len()));
    for (mut row, pair) in values.rows_mut().into_iter().zip(&directions) {
        for (value, exact) in row.iter_mut().zip(truth(pair)) {
            let normal: f64 = StandardNormal.sample(&mut random);
            // Fifty deviations from a negative factor.
            *value = exact * (1.0 + NOISE * normal);
        }
    }
    Ok(Samples {
        directions,
        values,
        channels: CHANNELS.map(str::to_owned).to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_span_a_hundred_thousandth_to_six_hundred() {
        for seed in 1..=3 {
            let paint = samples(20_000, seed).unwrap();
            let least = paint.values.iter().copied().fold(f64::MAX, f64::min);
            let most = paint.values.iter().copied().fold(0.0, f64::max);
            assert!((0.5e-5..1.5e-5).contains(&least), "{least}");
            assert!((500.0..800.0).contains(&most), "{most}");
        }
    }

    #[test]
    fn the_noise_is_two_percent_of_the_truth() {
        let paint = samples(5000, 4).unwrap();
        let mut squares = 0.0;
        for (row, pair) in paint.values.rows().into_iter().zip(&paint.directions) {
            for (&value, exact) in row.iter().zip(truth(pair)) {
                squares += (value / exact - 1.0).powi(2);
            }
        }
        // 15,000 draws: the deviation is known to 1 / sqrt(30,000), 0.6 %.
        let noise = (squares / 15_000.0_f64).sqrt();
        assert!((noise / NOISE - 1.0).abs() < 0.03, "{noise}");
    }

    #[test]
    fn it_is_reciprocal_and_black_below_the_horizon() {
        for pair in &samples(500, 5).unwrap().directions {
            for (a, b) in truth(pair).into_iter().zip(truth(&pair.swapped())) {
                assert!((a - b).abs() <= 1e-12 * a);
            }
            let below = DirectionPair {
                outgoing: [0.0, 0.1, -0.9],
                ..*pair
            };
            assert_eq!(truth(&below), [0.0; 3]);
        }
    }

    #[test]
    fn a_seed_gives_the_same_numbers_and_rows_are_only_added() {
        let (few, many) = (samples(50, 7).unwrap(), samples(80, 7).unwrap());
        assert!(
            few.values
                .iter()
                .eq(many.values.iter().take(few.values.len()))
        );
        assert_ne!(few.values, samples(50, 8).unwrap().values);
        assert!(matches!(samples(0, 1), Err(Error::Rows { .. })));
    }
}
