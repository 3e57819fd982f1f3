//! Chooses pairs of directions at which to evaluate a tabulated BRDF.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::Error;
use crate::geometry::{Angles, DirectionPair, Vector, cartesian, reflect};
use crate::toy::MAX_ROWS;

/// Cosine of the polar angles' upper limit, 85 degrees, when directions are drawn at random.
const MIN_COSINE: f64 = 0.087;

/// Largest angle between the normal and a half vector near it, in radians.
const MAX_TILT: f64 = 0.3;

/// A choice of pairs of directions, all of them above the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Sampling {
    /// At random, the same for the same seed. Every other pair is uniform over both hemispheres
    /// as far as 85 degrees from the normal; the rest are near the mirror direction, their half
    /// vector tilted by an angle uniform up to 0.3 radians, so that highlights are not missed.
    Random {
        /// How many pairs, 1 to 10 million.
        rows: usize,
        /// Seed of the random numbers.
        seed: u64,
    },
    /// Every combination of the middles of equal steps of `theta_i` and `theta_o` from 0 to pi/2
    /// and of `phi_o` from 0 to pi, with `phi_i = 0`: half the azimuths, of which the other half
    /// is the mirror image for isotropic materials.
    Grid {
        /// Steps of each polar angle, at least 1.
        polar: usize,
        /// Steps of the azimuth, at least 1.
        azimuth: usize,
    },
}

impl Default for Sampling {
    /// 20,000 at random, with seed 1.
    fn default() -> Self {
        Self::Random {
            rows: 20_000,
            seed: 1,
        }
    }
}

impl Sampling {
    /// The pairs of directions.
    ///
    /// ```
    /// use elm_datasets::{Angles, Sampling};
    /// # fn main() -> Result<(), elm_datasets::Error> {
    /// let pairs = Sampling::Grid { polar: 3, azimuth: 2 }.directions()?;
    /// assert_eq!(pairs.len(), 3 * 3 * 2);
    /// assert_eq!(Angles::of(&pairs[0]).theta_i, std::f64::consts::PI / 12.0);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`Error::Rows`] for none, or for more than 10 million.
    pub fn directions(&self) -> Result<Vec<DirectionPair>, Error> {
        let rows = match *self {
            Self::Random { rows, .. } => Some(rows),
            Self::Grid { polar, azimuth } => polar
                .checked_mul(polar)
                .and_then(|pairs| pairs.checked_mul(azimuth)),
        };
        let found = rows.unwrap_or(usize::MAX);
        if !(1..=MAX_ROWS).contains(&found) {
            let last = MAX_ROWS;
            return Err(Error::Rows { found, last });
        }
        Ok(match *self {
            Self::Random { rows, seed } => random(rows, seed),
            Self::Grid { polar, azimuth } => grid(polar, azimuth),
        })
    }
}

fn random(rows: usize, seed: u64) -> Vec<DirectionPair> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..rows)
        .map(|row| {
            let light = above(&mut rng);
            let viewer = if row % 2 == 0 {
                above(&mut rng)
            } else {
                near_mirror(&mut rng, light)
            };
            let pair = DirectionPair {
                incident: light,
                outgoing: viewer,
            };
            // So that the same seed gives what it gave when samples were kept as angles.
            pair.through_angles()
        })
        .collect()
}

/// Uniform over the cap where the cosine is at least [`MIN_COSINE`].
fn above(rng: &mut impl Rng) -> Vector {
    let cos: f64 = rng.random_range(MIN_COSINE..=1.0);
    cartesian(cos.acos(), rng.random_range(-PI..PI))
}

fn near_mirror(rng: &mut impl Rng, light: Vector) -> Vector {
    // For half of the azimuths the tilt lifts the viewer, so that few trials are needed.
    loop {
        let tilt = rng.random_range(0.0..=MAX_TILT);
        let viewer = reflect(light, cartesian(tilt, rng.random_range(-PI..PI)));
        if viewer[2] >= MIN_COSINE {
            return viewer;
        }
    }
}

#[allow(clippy::cast_precision_loss)]
fn grid(polar: usize, azimuth: usize) -> Vec<DirectionPair> {
    let middle = |step: usize, steps: usize| (step as f64 + 0.5) / steps as f64;
    let mut pairs = Vec::with_capacity(polar * polar * azimuth);
    for i in 0..polar {
        for o in 0..polar {
            pairs.extend((0..azimuth).map(|phi| {
                DirectionPair::from(Angles {
                    theta_i: middle(i, polar) * FRAC_PI_2,
                    phi_i: 0.0,
                    theta_o: middle(o, polar) * FRAC_PI_2,
                    phi_o: middle(phi, azimuth) * PI,
                })
            }));
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::half_vector;

    fn random(rows: usize, seed: u64) -> Vec<DirectionPair> {
        Sampling::Random { rows, seed }.directions().unwrap()
    }

    #[test]
    fn random_pairs_follow_from_the_seed_and_rows_are_only_added() {
        assert_eq!(random(50, 3), random(80, 3)[..50]);
        assert_ne!(random(50, 3), random(50, 4));
    }

    #[test]
    fn random_pairs_stay_clear_of_the_horizon_and_half_are_near_the_mirror() {
        let pairs = random(4000, 1);
        let mut near = 0;
        for (row, both) in pairs.iter().enumerate() {
            let DirectionPair {
                incident: light,
                outgoing: viewer,
            } = *both;
            // Through the arc cosine and back costs a few units in the last place.
            assert!(light[2] >= MIN_COSINE - 1e-15 && viewer[2] >= MIN_COSINE - 1e-15);
            let tilt = half_vector(light, viewer).unwrap()[2].acos();
            assert!(row % 2 == 0 || tilt <= MAX_TILT + 1e-7, "{tilt}");
            near += usize::from(tilt <= MAX_TILT);
        }
        assert!((2000..3000).contains(&near), "{near}");
    }

    #[test]
    fn uniform_pairs_fill_the_cap_evenly() {
        // The mean of a uniform cosine; its standard deviation over 4000 is 0.264 / sqrt(4000).
        let pairs = random(8000, 2);
        let even = pairs.iter().step_by(2);
        let mean = even.map(|both| both.outgoing[2]).sum::<f64>() / 4000.0;
        let expected = f64::midpoint(MIN_COSINE, 1.0);
        assert!((mean - expected).abs() < 4.0 * 0.264 / 4000_f64.sqrt());
    }

    #[test]
    fn no_rows_and_too_many_are_errors() {
        let grid = |polar, azimuth| Sampling::Grid { polar, azimuth };
        for sampling in [
            Sampling::Random { rows: 0, seed: 1 },
            Sampling::Random {
                rows: MAX_ROWS + 1,
                seed: 1,
            },
            grid(0, 1),
            grid(1, 0),
            grid(usize::MAX, 2),
        ] {
            assert!(matches!(sampling.directions(), Err(Error::Rows { .. })));
        }
    }

    #[test]
    fn vectors_and_angles_are_the_same_directions() {
        for pair in random(100, 5) {
            assert_eq!(DirectionPair::from(Angles::of(&pair)), pair);
        }
    }
}
