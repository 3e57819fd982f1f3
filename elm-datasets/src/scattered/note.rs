//! Notes on the assumptions made while reading a table.

use std::fmt;

use super::{AngleUnit, List};

/// What was assumed of a table, or left out of it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// Directions a rounding below the horizon.
    Horizon {
        /// How many.
        directions: usize,
    },
    /// Negative polar angles.
    Mirrored {
        /// How many.
        angles: usize,
    },
    /// Rows with the viewer below the surface.
    Transmitted {
        /// How many.
        rows: usize,
        /// Unit of the angles.
        unit: AngleUnit,
    },
    /// Rows of a table of directions with the viewer below the surface.
    BelowSurface {
        /// How many.
        rows: usize,
        /// Unit of the angles.
        unit: AngleUnit,
    },
    /// Degrees that may be radians.
    LooksLikeRadians {
        /// The largest polar angle.
        theta: f64,
    },
    /// Radians that may be degrees.
    LooksLikeDegrees {
        /// The largest azimuth.
        phi: f64,
    },
    /// A table that is not separated by commas.
    Separated {
        /// What separates its cells.
        separator: &'static str,
        /// Whether numbers have commas for points.
        decimal_commas: bool,
    },
    /// Comments, and lines before the names of the columns.
    Comments {
        /// How many lines.
        lines: usize,
    },
    /// Columns of angles by other names.
    Names {
        /// What the names are taken for.
        columns: List,
    },
    /// A unit that the file says.
    Unit {
        /// The unit.
        unit: AngleUnit,
        /// Where it says so.
        place: &'static str,
    },
    /// Azimuths of which there is only the difference.
    Difference {
        /// Name of the column.
        column: String,
    },
    /// Azimuths that are not there.
    NoAzimuth {
        /// Their names.
        angles: List,
    },
    /// Reflectance factors.
    ReflectanceFactors,
    /// Columns that are no channels.
    LeftOut {
        /// Their names.
        columns: List,
    },
    /// A row per wavelength.
    Pivoted {
        /// Rows of the file.
        rows: usize,
        /// Wavelengths.
        channels: usize,
        /// Pairs of directions.
        pairs: usize,
    },
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Horizon { directions } => write!(
                f,
                "{directions} directions up to 0.029 degrees below the horizon were taken to be on it"
            ),
            Self::Mirrored { angles } => write!(
                f,
                "{angles} polar angles are negative: taken as on the other side of the normal, half a \
                 turn added to their azimuths"
            ),
            Self::Transmitted { rows, unit } => {
                write!(
                    f,
                    "{rows} rows have the viewer below the surface (transmitted light) and were left out"
                )?;
                or_degrees(f, *unit)
            }
            Self::BelowSurface { rows, unit } => {
                write!(
                    f,
                    "{rows} rows have the viewer below the surface, where the reflectance is 0"
                )?;
                or_degrees(f, *unit)
            }
            Self::LooksLikeRadians { theta } => write!(
                f,
                "no polar angle is above {theta} degrees: if these are radians, leave out --degrees"
            ),
            Self::LooksLikeDegrees { phi } => write!(
                f,
                "azimuths go up to {phi} radians: if the angles are degrees, say --degrees"
            ),
            Self::Separated {
                separator,
                decimal_commas,
            } => {
                write!(f, "cells are separated by {separator}")?;
                if *decimal_commas {
                    f.write_str(", and numbers have commas for points")?;
                }
                Ok(())
            }
            Self::Comments { lines } => write!(f, "{lines} lines of comments were passed over"),
            Self::Names { columns } => write!(f, "columns taken as angles: {columns}"),
            Self::Unit { unit, place } => write!(
                f,
                "angles are in {}, as {place}",
                match unit {
                    AngleUnit::Radians => "radians",
                    AngleUnit::Degrees => "degrees",
                }
            ),
            Self::Difference { column } => write!(
                f,
                "{column} is taken as phi_o - phi_i: 0 where the viewer is on the light's side"
            ),
            Self::NoAzimuth { angles } => {
                write!(f, "no column of {angles}: taken as 0 in every row")
            }
            Self::ReflectanceFactors => {
                f.write_str("values are reflectance factors: divided by pi")
            }
            Self::LeftOut { columns } => write!(f, "columns left out: {columns}"),
            Self::Pivoted {
                rows,
                channels,
                pairs,
            } => write!(
                f,
                "{rows} rows of one wavelength each became {pairs} pairs of directions with \
                 {channels} channels"
            ),
        }
    }
}

/// What may be the reason of polar angles beyond the horizon.
fn or_degrees(f: &mut fmt::Formatter<'_>, unit: AngleUnit) -> fmt::Result {
    match unit {
        AngleUnit::Radians => f.write_str("; if the angles are degrees, say --degrees"),
        AngleUnit::Degrees => Ok(()),
    }
}
