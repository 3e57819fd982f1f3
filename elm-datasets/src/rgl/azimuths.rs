//! Incident azimuths of a file, and which others stand for them.
//!
//! A material with a grain is measured from azimuths over a whole turn, or over half or a quarter of one
//! where it looks the same after half a turn, or mirrored at either of its axes. As in the authors'
//! program the symmetry is the whole turn over the azimuths' span, rounded.

use std::f64::consts::TAU;

use super::Problem;
use super::warp::{Axis, Pair};
use crate::geometry::{DirectionPair, Vector};

/// What can be done to the surface without changing its look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Symmetry {
    /// Any turn.
    Isotropic,
    /// Nothing.
    None,
    /// Half a turn.
    HalfTurn,
    /// Mirroring at the planes of x and of y.
    Mirrors,
}

/// The incident azimuths of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Azimuths {
    axis: Axis,
    symmetry: Symmetry,
}

impl Azimuths {
    /// # Errors
    /// [`Problem::Azimuths`] for several that are no part of a turn that a symmetry fills up.
    pub(super) fn new(axis: Axis) -> Result<Self, Problem> {
        let symmetry = match axis.0.as_slice() {
            [] | [_] | [_, _] => Symmetry::Isotropic,
            [first, .., last] => match (TAU / (last - first)).round() {
                1.0 => Symmetry::None,
                2.0 | 3.0 => Symmetry::HalfTurn,
                4.0 => Symmetry::Mirrors,
                _ => {
                    return Err(Problem::Azimuths {
                        span: (last - first).to_degrees(),
                    });
                }
            },
        };
        Ok(Self { axis, symmetry })
    }

    pub(super) fn count(&self) -> usize {
        self.axis.0.len()
    }

    pub(super) fn is_isotropic(&self) -> bool {
        self.symmetry == Symmetry::Isotropic
    }

    /// The pair that stands for `pair` among those from the azimuths of the file, and the slices of its
    /// incident azimuth `phi_i`, in radians from -pi to pi, with their weights.
    pub(super) fn place(&self, pair: &DirectionPair) -> (DirectionPair, Pair) {
        let azimuth = |pair: &DirectionPair| pair.incident[1].atan2(pair.incident[0]);
        let signs: &[[f64; 2]] = match self.symmetry {
            Symmetry::Isotropic => return (*pair, self.axis.around(azimuth(pair))),
            Symmetry::None => &[[1.0, 1.0]],
            Symmetry::HalfTurn => &[[1.0, 1.0], [-1.0, -1.0]],
            Symmetry::Mirrors => &[[1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]],
        };
        let first = self.axis.0.first().copied().unwrap_or(0.0);
        let mut best = (*pair, f64::INFINITY);
        for &[sign_x, sign_y] in signs {
            let image = |[x, y, z]: Vector| [sign_x * x, sign_y * y, z];
            let image = DirectionPair {
                incident: image(pair.incident),
                outgoing: image(pair.outgoing),
            };
            // How far after the first azimuth.
            let after = (azimuth(&image) - first).rem_euclid(TAU);
            if after < best.1 {
                best = (image, after);
            }
        }
        let (image, after) = best;
        // A whole turn ends where it begins.
        let slices = match self.symmetry {
            Symmetry::None => self.axis.around_a_turn(first + after),
            _ => self.axis.around(first + after),
        };
        (image, slices)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cartesian;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn steps(first: f64, span: f64, steps: u32) -> Axis {
        Axis(
            (0..=steps)
                .map(|k| first + span * f64::from(k) / f64::from(steps))
                .collect(),
        )
    }

    fn pair(phi_i: f64) -> DirectionPair {
        DirectionPair {
            incident: cartesian(0.5, phi_i),
            outgoing: cartesian(0.7, phi_i + 1.0),
        }
    }

    #[test]
    fn azimuths_not_measured_are_those_of_their_images() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        for first in [-PI, 0.0, 0.3] {
            for (span, symmetric) in [(PI, &[0.0, PI][..]), (TAU, &[0.0][..])] {
                let azimuths = Azimuths::new(steps(first, span, 4)).unwrap();
                for turn in symmetric {
                    let (found, [(low, a), (_, b)]) =
                        azimuths.place(&pair(first + 0.1 * span + turn));
                    let expected = pair(first + 0.1 * span);
                    for (found, expected) in found.incident.iter().zip(expected.incident) {
                        assert!(near(*found, expected), "{first} {span} {turn}");
                    }
                    for (found, expected) in found.outgoing.iter().zip(expected.outgoing) {
                        assert!(near(*found, expected), "{first} {span} {turn}");
                    }
                    assert!(low == 0 && near(a, 0.6) && near(b, 0.4), "{a} {b}");
                }
            }
        }
        // Mirrored at both axes a quarter of a turn is all.
        let azimuths = Azimuths::new(steps(-PI, FRAC_PI_2, 2)).unwrap();
        for phi in [0.4, -0.4, PI - 0.4, 0.4 - PI] {
            let (image, [(low, weight), _]) = azimuths.place(&pair(phi));
            let expected = cartesian(0.5, 0.4 - PI);
            for (found, expected) in image.incident.iter().zip(expected) {
                assert!(near(*found, expected), "{phi}");
            }
            assert!(
                low == 0 && near(weight, 1.0 - 0.4 / (FRAC_PI_2 / 2.0)),
                "{weight}"
            );
        }
    }

    #[test]
    fn a_turn_whose_last_azimuth_is_its_first_need_not_say_it_twice() {
        let azimuths = Azimuths::new(Axis(vec![-PI, -PI / 2.0, 0.0, PI / 2.0])).unwrap();
        let (_, [(a, u), (b, v)]) = azimuths.place(&pair(0.75 * PI));
        assert_eq!((a, b), (3, 0));
        assert!((u - 0.5).abs() < 1e-12 && (v - 0.5).abs() < 1e-12);
    }

    #[test]
    fn azimuths_of_no_symmetry_are_refused() {
        let problem = Azimuths::new(steps(0.0, 0.5, 4)).unwrap_err();
        assert!(problem.to_string().contains("28.6"), "{problem}");
    }
}
