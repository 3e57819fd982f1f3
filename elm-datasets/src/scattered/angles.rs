//! Polar angles and vectors as tables have them: rounded at the horizon, signed, and of rows that
//! look through the surface.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::Note;
use crate::error::scattered::{ANGLES, AngleUnit, Problem};
use crate::geometry::{Angles, DirectionPair, Vector, dot};

/// How far from 1 the length of a direction may be: numbers with three decimals are each up to
/// 0.0005 off, so the length up to `sqrt(3) * 0.0005`.
const LENGTH_TOLERANCE: f64 = 1e-3;

/// How far below the horizon a direction may be to count as on it, in radians, and as a part of
/// its vector: the rounding of numbers with three decimals.
pub(crate) const HORIZON_TOLERANCE: f64 = 5e-4;

/// What a row's directions are.
pub(super) enum Found {
    /// Both above the surface, or on its horizon.
    Reflected(DirectionPair),
    /// The viewer is below the surface: what is wrong with that, should no other row be better.
    Transmitted(Problem),
}

/// Reads the directions of rows, and keeps account of what it had to assume.
pub(super) struct Reader {
    unit: AngleUnit,
    /// The largest sizes of a polar angle and of an azimuth, in the file's unit.
    theta: f64,
    phi: f64,
    horizon: usize,
    mirrored: usize,
}

impl Reader {
    pub(super) fn new(unit: AngleUnit) -> Self {
        Self {
            unit,
            theta: 0.0,
            phi: 0.0,
            horizon: 0,
            mirrored: 0,
        }
    }

    pub(super) fn angles(&mut self, found: [f64; 4]) -> Result<Found, Problem> {
        let mut radians = found.map(|angle| match self.unit {
            AngleUnit::Radians => angle,
            AngleUnit::Degrees => angle.to_radians(),
        });
        let mut below = None;
        for index in [0, 2] {
            self.theta = self.theta.max(found[index].abs());
            self.phi = self.phi.max(found[index + 1].abs());
            let problem = || Problem::PolarAngle {
                angle: ANGLES[index],
                unit: self.unit,
                found: found[index],
            };
            let theta = radians[index];
            let size = theta.abs();
            if size > FRAC_PI_2 + HORIZON_TOLERANCE {
                // Only a viewer can be behind the surface, and no further than straight behind.
                if index == 0 || size > PI + HORIZON_TOLERANCE {
                    return Err(problem());
                }
                below = Some(problem());
                continue;
            }
            if theta < 0.0 {
                // Of in-plane scans: on the other side of the normal.
                if size > HORIZON_TOLERANCE {
                    self.mirrored += 1;
                }
                radians[index + 1] += PI;
            }
            if size > FRAC_PI_2 {
                self.horizon += 1;
            }
            radians[index] = size.min(FRAC_PI_2);
        }
        let [theta_i, phi_i, theta_o, phi_o] = radians;
        Ok(match below {
            Some(problem) => Found::Transmitted(problem),
            None => Found::Reflected(DirectionPair::from(Angles {
                theta_i,
                phi_i,
                theta_o,
                phi_o,
            })),
        })
    }

    pub(super) fn vectors(&mut self, parts: [f64; 6]) -> Result<Found, Problem> {
        let [ix, iy, iz, ox, oy, oz] = parts;
        let mut check = |vector, direction: Vector| {
            let length = dot(direction, direction).sqrt();
            if (length - 1.0).abs() > LENGTH_TOLERANCE {
                let found = length;
                return Err(Problem::Length { vector, found });
            }
            let [x, y, z] = direction;
            if z < -HORIZON_TOLERANCE {
                return Ok(Err(Problem::BelowHorizon { vector, found: z }));
            }
            if z < 0.0 {
                self.horizon += 1;
            }
            Ok(Ok([x, y, z.max(0.0)]))
        };
        let light = check("wi", [ix, iy, iz])??;
        Ok(match check("wo", [ox, oy, oz])? {
            Ok(viewer) => {
                let pair = DirectionPair {
                    incident: light,
                    outgoing: viewer,
                };
                // Vectors with few digits become unit vectors.
                Found::Reflected(pair.through_angles())
            }
            Err(problem) => Found::Transmitted(problem),
        })
    }

    /// What was assumed of angles.
    ///
    /// # Errors
    /// [`Problem::LooksLikeRadians`] for degrees that can hardly be any.
    pub(super) fn finish(&self) -> Result<Vec<Note>, Problem> {
        let mut notes = Vec::new();
        match self.unit {
            AngleUnit::Degrees if self.theta > 0.0 => {
                let most = FRAC_PI_2 + HORIZON_TOLERANCE;
                if self.theta <= most && self.phi <= TAU + HORIZON_TOLERANCE {
                    // A scan within 1.57 degrees of the normal may be one in its plane, but then
                    // its azimuths are 0 and 180.
                    if self.phi > most {
                        let (theta, phi) = (self.theta, self.phi);
                        return Err(Problem::LooksLikeRadians { theta, phi });
                    }
                    notes.push(Note::LooksLikeRadians { theta: self.theta });
                }
            }
            // More than one and a half turns is no way to write an azimuth in radians.
            AngleUnit::Radians if self.phi > 1.5 * TAU => {
                notes.push(Note::LooksLikeDegrees { phi: self.phi });
            }
            _ => {}
        }
        if self.horizon > 0 {
            let directions = self.horizon;
            notes.push(Note::Horizon { directions });
        }
        if self.mirrored > 0 {
            let angles = self.mirrored;
            notes.push(Note::Mirrored { angles });
        }
        Ok(notes)
    }
}
