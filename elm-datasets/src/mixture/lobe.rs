//! Densities of directions in closed form, each with the integral 1 over the hemisphere.

use std::f64::consts::{PI, TAU};

use crate::geometry::{Vector, dot, tangents};

/// Between which widths in radians and roughnesses are.
const WIDTHS: (f64, f64) = (0.005, 4.0);
/// The most that a lobe like the cosine is tilted.
const MAX_TILT: f64 = 0.95;

/// A density of directions in closed form. What falls below the horizon is reflected upwards.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Lobe {
    /// In proportion to the cosine of the angle from the normal.
    Cosine,
    /// All directions alike.
    Uniform,
    /// The cosine's disc moved towards the mirror direction, or with a negative factor towards the viewer, by
    /// a conformal map of the disc onto itself.
    Tilted {
        /// How far, from -1 to 1: the middle of the disc goes there times the sine of the viewer's angle.
        factor: f64,
    },
    /// The viewer reflected at normals of the GGX distribution that are visible to it: its highlight grows
    /// longer towards grazing angles.
    Ggx {
        /// Roughness along and across a direction of the surface.
        alpha: [f64; 2],
        /// That direction's angle from x in radians.
        turn: f64,
    },
    /// As round at every angle, about the mirror direction or the viewer: in proportion to
    /// $(s + 1 - \cos\delta)^{-2}$ with $\delta$ the angle to its axis and $s$ half the square of its width.
    Round {
        /// In radians.
        width: f64,
        /// Whether about the viewer, not the mirror direction.
        retro: bool,
    },
}

/// The direction on the other side of the surface.
fn below([x, y, z]: Vector) -> Vector {
    [x, y, -z]
}

impl Lobe {
    /// Density in solid angle at `incident`, above the horizon.
    #[must_use]
    pub fn density(self, outgoing: Vector, incident: Vector) -> f64 {
        let [x, y, z] = outgoing;
        match self {
            Self::Cosine => incident[2] / PI,
            Self::Uniform => 1.0 / TAU,
            Self::Tilted { factor } => {
                let (a, b) = (-factor * x, -factor * y);
                let moved = a * a + b * b;
                let sine = incident[0] * incident[0] + incident[1] * incident[1];
                let distance = 1.0 - 2.0 * (a * incident[0] + b * incident[1]) + moved * sine;
                incident[2] / PI * ((1.0 - moved) / distance).powi(2)
            }
            Self::Ggx { alpha, turn } => {
                let [x, y, z] = about_normal(outgoing, -turn);
                let incident = about_normal(incident, -turn);
                let normals = |to: Vector| {
                    let sum = [x + to[0], y + to[1], z + to[2]];
                    let stretched = [sum[0] / alpha[0], sum[1] / alpha[1], sum[2]];
                    let ratio = dot(sum, sum) / dot(stretched, stretched);
                    if sum[2] > 0.0 { ratio * ratio } else { 0.0 }
                };
                let stretched = [alpha[0] * x, alpha[1] * y, z];
                let visible = z + dot(stretched, stretched).sqrt();
                let both = normals(incident) + normals(below(incident));
                both / (TAU * alpha[0] * alpha[1] * visible)
            }
            Self::Round { width, retro } => {
                let s = width * width / 2.0;
                let axis = if retro { outgoing } else { [-x, -y, z] };
                // 1 - cos delta as half the square of a chord, which keeps its digits for a small one.
                let about = |to: Vector| {
                    let chord = [0, 1, 2].map(|k| axis[k] - to[k]);
                    (s + dot(chord, chord) / 2.0).powi(-2)
                };
                s * (s + 2.0) / (2.0 * TAU) * (about(incident) + about(below(incident)))
            }
        }
    }

    /// An incident direction for two uniform numbers.
    #[must_use]
    pub fn sample(self, outgoing: Vector, [a, b]: [f64; 2]) -> Vector {
        let (sin, cos) = (TAU * a).sin_cos();
        let [x, y, z] = outgoing;
        let found = match self {
            Self::Cosine => [b.sqrt() * cos, b.sqrt() * sin, (1.0 - b).sqrt()],
            Self::Uniform => {
                let radius = (b * (2.0 - b)).sqrt();
                [radius * cos, radius * sin, 1.0 - b]
            }
            Self::Tilted { factor } => {
                // (z + w) / (1 + conj(w) z) with z in the disc, w where its middle goes.
                let w = (-factor * x, -factor * y);
                let z = (b.sqrt() * cos, b.sqrt() * sin);
                let above = (z.0 + w.0, z.1 + w.1);
                let below = (1.0 + w.0 * z.0 + w.1 * z.1, w.0 * z.1 - w.1 * z.0);
                let size = below.0 * below.0 + below.1 * below.1;
                let re = (above.0 * below.0 + above.1 * below.1) / size;
                let im = (above.1 * below.0 - above.0 * below.1) / size;
                // 1 - |.|^2, which would be lost next to the horizon.
                let left = (1.0 - w.0 * w.0 - w.1 * w.1) * (1.0 - b) / size;
                [re, im, left.max(0.0).sqrt()]
            }
            Self::Ggx { alpha, turn } => {
                // A cap of the sphere, as the stretched surface shows it (Dupuy and Benyoub, 2023).
                let outgoing = about_normal(outgoing, -turn);
                let [x, y, z] = outgoing;
                let stretched = unit([alpha[0] * x, alpha[1] * y, z]);
                let below_pole = b * (1.0 + stretched[2]);
                let radius = (below_pole * (2.0 - below_pole)).max(0.0).sqrt();
                let normal = unit([
                    alpha[0] * (radius * cos + stretched[0]),
                    alpha[1] * (radius * sin + stretched[1]),
                    (1.0 - b) * (1.0 + stretched[2]),
                ]);
                let along = 2.0 * dot(outgoing, normal);
                let reflected = [0, 1, 2].map(|k| along * normal[k] - outgoing[k]);
                about_normal(reflected, turn)
            }
            Self::Round { width, retro } => {
                let s = width * width / 2.0;
                let off = 2.0 * b * s / (s + 2.0 * (1.0 - b));
                let radius = (off * (2.0 - off)).max(0.0).sqrt();
                let axis = if retro { outgoing } else { [-x, -y, z] };
                let [tangent, bitangent] = tangents(axis);
                [0, 1, 2].map(|k| {
                    radius * (cos * tangent[k] + sin * bitangent[k]) + (1.0 - off) * axis[k]
                })
            }
        };
        let [x, y, z] = unit(found);
        [x, y, z.abs()]
    }

    /// The same with its width or tilt times a factor and divided by it, and with its direction turned.
    pub(super) fn variations(self, factor: f64) -> Vec<Self> {
        let wider = |width: f64, factor: f64| (width * factor).clamp(WIDTHS.0, WIDTHS.1);
        let rougher = |alpha: f64, factor: f64| wider(alpha, factor).min(1.0);
        let both = [factor, 1.0 / factor];
        match self {
            Self::Cosine | Self::Uniform => Vec::new(),
            Self::Tilted { factor: tilt } => {
                let tilted = both.map(|factor| Self::Tilted {
                    factor: (tilt * factor).clamp(-MAX_TILT, MAX_TILT),
                });
                tilted.to_vec()
            }
            Self::Ggx {
                alpha: [a, b],
                turn,
            } if a == b => {
                let ggx = both.map(|factor| Self::Ggx {
                    alpha: [rougher(a, factor); 2],
                    turn,
                });
                ggx.to_vec()
            }
            Self::Ggx {
                alpha: [a, b],
                turn,
            } => {
                let mut all = vec![
                    Self::Ggx {
                        alpha: [a, b],
                        turn: turn + (factor - 1.0),
                    },
                    Self::Ggx {
                        alpha: [a, b],
                        turn: turn - (factor - 1.0),
                    },
                ];
                for factor in both {
                    all.push(Self::Ggx {
                        alpha: [rougher(a, factor), b],
                        turn,
                    });
                    all.push(Self::Ggx {
                        alpha: [a, rougher(b, factor)],
                        turn,
                    });
                }
                all
            }
            Self::Round { width, retro } => {
                let round = both.map(|factor| Self::Round {
                    width: wider(width, factor),
                    retro,
                });
                round.to_vec()
            }
        }
    }
}

/// A direction turned about the normal.
fn about_normal([x, y, z]: Vector, angle: f64) -> Vector {
    if angle == 0.0 {
        return [x, y, z];
    }
    let (sin, cos) = angle.sin_cos();
    [cos * x - sin * y, sin * x + cos * y, z]
}

fn unit(v: Vector) -> Vector {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > 0.0 {
        v.map(|x| x / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cartesian;
    use crate::mixture::low_discrepancy;
    use std::f64::consts::FRAC_PI_2;

    const LOBES: [Lobe; 11] = [
        Lobe::Cosine,
        Lobe::Uniform,
        Lobe::Tilted { factor: -0.4 },
        Lobe::Tilted { factor: 0.75 },
        Lobe::Ggx {
            alpha: [0.1; 2],
            turn: 0.0,
        },
        Lobe::Ggx {
            alpha: [0.15, 0.5],
            turn: 0.3,
        },
        Lobe::Ggx {
            alpha: [0.7; 2],
            turn: 0.0,
        },
        Lobe::Round {
            width: 0.1,
            retro: false,
        },
        Lobe::Round {
            width: 1.0,
            retro: false,
        },
        Lobe::Round {
            width: 0.1,
            retro: true,
        },
        Lobe::Round {
            width: 1.0,
            retro: true,
        },
    ];

    /// Shares of the hemisphere's parts, 8 in theta and 8 in phi, by midpoints in cosine and azimuth, denser
    /// towards the plane of the viewer, where lobes are narrow at grazing angles.
    fn integrals(lobe: Lobe, outgoing: Vector) -> Vec<f64> {
        const FINE: usize = 90;
        let mut parts = vec![0.0; 64];
        for row in 0..8 * FINE {
            let angle = |row: usize| row as f64 / (8 * FINE) as f64 * FRAC_PI_2;
            let (near, far) = (angle(row).cos(), angle(row + 1).cos());
            let theta = ((near + far) / 2.0).acos();
            for column in 0..8 * FINE {
                let phi = |step: f64| {
                    let t = ((column % FINE) as f64 + step) / FINE as f64;
                    ((column / FINE) as f64 + t * t * (3.0 - 2.0 * t)) / 8.0 * TAU
                };
                let density = lobe.density(outgoing, cartesian(theta, phi(0.5)));
                let area = (near - far) * (phi(1.0) - phi(0.0));
                parts[row / FINE * 8 + column / FINE] += density * area;
            }
        }
        parts
    }

    #[test]
    fn every_lobe_has_the_integral_1_and_is_sampled_by_its_density() {
        for lobe in LOBES {
            for theta in [0.0, 0.6, 1.2, 1.54] {
                let outgoing = cartesian(theta, 0.0);
                let parts = integrals(lobe, outgoing);
                let total: f64 = parts.iter().sum();
                // Midpoints at a tenth of the narrowest lobe's width.
                assert!((total - 1.0).abs() < 2e-3, "{lobe:?} at {theta}: {total}");
                let mut counts = vec![0.0; 64];
                let draws = 16384;
                for index in 0..draws {
                    let w = lobe.sample(outgoing, low_discrepancy(index));
                    let row = (w[2].acos() / FRAC_PI_2 * 8.0) as usize;
                    let column = (w[1].atan2(w[0]).rem_euclid(TAU) / TAU * 8.0) as usize;
                    counts[row.min(7) * 8 + column.min(7)] += 1.0 / f64::from(draws);
                }
                for (count, part) in counts.iter().zip(&parts) {
                    // Five deviations of independent draws; an even sequence has less.
                    let deviation = (part / f64::from(draws)).sqrt();
                    let bound = 5.0 * deviation + 2e-3 * part + 1.0 / f64::from(draws);
                    assert!(
                        (count - part).abs() < bound,
                        "{lobe:?} at {theta}: {count} {part}"
                    );
                }
            }
        }
    }
}
