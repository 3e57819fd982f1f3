//! What can be wrong with a table.

use std::fmt;

use crate::text::shorten;

/// Columns of directions as angles.
pub const ANGLES: [&str; 4] = ["theta_i", "phi_i", "theta_o", "phi_o"];
/// Columns of directions as unit vectors.
pub(crate) const VECTORS: [&str; 6] = ["wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z"];

/// The unit of the angles in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum AngleUnit {
    /// A right angle is pi/2.
    #[default]
    Radians,
    /// A right angle is 90.
    Degrees,
}

/// Names of columns in an error: not more, and not longer ones, than a line can hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct List(Vec<String>);

impl List {
    pub(crate) fn of<'a>(names: impl IntoIterator<Item = &'a String>) -> Self {
        const MAX: usize = 8;
        let mut names: Vec<String> = names.into_iter().map(|name| shorten(name)).collect();
        if names.len() > MAX {
            names.truncate(MAX);
            names.push("...".to_owned());
        }
        Self(names)
    }
}

impl fmt::Display for List {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, name) in self.0.iter().enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            write!(f, "{comma}{}", name.escape_debug())?;
        }
        if self.0.is_empty() {
            f.write_str("none")?;
        }
        Ok(())
    }
}

/// What is wrong with a table of samples.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// Neither set of direction columns is complete.
    #[error(
        "expected the columns {}, or {}; missing {}{}",
        ANGLES.join(", "),
        VECTORS.join(", "),
        missing.join(", "),
        if missing.iter().all(|name| ANGLES.contains(name)) {
            format!(" (an angle that is the same in every row can be given as --angle {}=NUMBER)", missing[0])
        } else {
            String::new()
        }
    )]
    NoDirections {
        /// The columns missing of the set that is more nearly complete.
        missing: Vec<&'static str>,
    },
    /// Columns of both sets.
    #[error("expected directions as angles or as vectors, found columns of both")]
    BothDirections,
    /// Two columns of one angle.
    #[error("columns {first:?} and {second:?} are both {angle}; leave one out with --ignore")]
    SameAngle {
        /// Name of the angle.
        angle: &'static str,
        /// The columns' names, shortened if long.
        first: String,
        /// The other's.
        second: String,
    },
    /// A column of which it cannot be told whether it is of the light or of the viewer.
    #[error(
        "column {column:?} may be of the light or of the viewer; name the columns {}",
        ANGLES.join(", ")
    )]
    WhichSide {
        /// The column's name, shortened if long.
        column: String,
    },
    /// An angle given for all rows that is a column, too.
    #[error("{angle} is given for all rows, and the table has the column {column:?}")]
    AngleTwice {
        /// Name of the angle.
        angle: &'static str,
        /// The column's name, shortened if long.
        column: String,
    },
    /// Angles in different units, or in another than was asked for.
    #[error("the columns' names say {said}: {advice}")]
    Units {
        /// What the names say.
        said: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// No column is left for the values.
    #[error("expected a column of values beside those of the directions")]
    NoValues,
    /// A polar angle that is negative or below the horizon.
    #[error(
        "expected {angle} from 0 to {}, found {found}{}",
        if *unit == AngleUnit::Radians { "pi/2 radians" } else { "90 degrees" },
        if *unit == AngleUnit::Radians { " (angles in degrees need --degrees)" } else { "" }
    )]
    PolarAngle {
        /// Name of the column.
        angle: &'static str,
        /// Unit of the angles.
        unit: AngleUnit,
        /// The angle found, in that unit.
        found: f64,
    },
    /// Angles said to be degrees that can hardly be any.
    #[error(
        "no polar angle is above {theta} degrees and no azimuth above {phi}: these are radians, so \
         leave out --degrees"
    )]
    LooksLikeRadians {
        /// The largest polar angle.
        theta: f64,
        /// The largest azimuth.
        phi: f64,
    },
    /// Columns whose names are not those of reflectance.
    #[error(
        "these columns do not look like reflectance: {columns}; leave them out with --ignore, or \
         name the columns of reflectance with --channels"
    )]
    NotReflectance {
        /// The names.
        columns: List,
    },
    /// A column asked for that is not there, or named twice.
    #[error("expected {name:?} to be one column of reflectance; there are {columns}")]
    NoSuchColumn {
        /// The name asked for, shortened if long.
        name: String,
        /// The names there are.
        columns: List,
    },
    /// Two columns of one wavelength.
    #[error(
        "columns {first:?} and {second:?} are of the same wavelength; leave one out with --ignore"
    )]
    SameWavelength {
        /// The one's name, shortened if long.
        first: String,
        /// The other's.
        second: String,
    },
    /// A table with a row per wavelength that has several values in a row.
    #[error(
        "expected one column of values beside the wavelength, found {columns}; name it with --channels"
    )]
    SeveralPerWavelength {
        /// The names.
        columns: List,
    },
    /// A wavelength that is none.
    #[error("expected a wavelength, and at most 1000 different ones, found {found}")]
    Wavelength {
        /// The number.
        found: f64,
    },
    /// A row that lacks a value, where nothing can be left out.
    #[error("expected a value in every row, found none for {channel}")]
    NoValue {
        /// The channel, shortened if long.
        channel: String,
    },
    /// A vector that is no direction.
    #[error("expected {vector} to be a unit vector, found length {found}")]
    Length {
        /// `wi` or `wo`.
        vector: &'static str,
        /// The length.
        found: f64,
    },
    /// A vector that points into the surface.
    #[error("expected {vector} above the surface, found {vector}_z = {found}")]
    BelowHorizon {
        /// `wi` or `wo`.
        vector: &'static str,
        /// The third component.
        found: f64,
    },
    /// A cosine-weighted value from which the BRDF cannot be had back.
    #[error(
        "expected {direction} above the horizon, for the values are to be divided by cos {angle}"
    )]
    NoCosine {
        /// The light or the viewer.
        direction: &'static str,
        /// Its polar angle.
        angle: &'static str,
    },
    /// Samples to be written that do not fit together.
    #[error(
        "expected as many directions as rows, and names as columns; found {directions} directions \
         and {names} names for values of shape {shape:?}"
    )]
    Shape {
        /// Pairs of directions.
        directions: usize,
        /// Names of channels.
        names: usize,
        /// Shape of the values.
        shape: (usize, usize),
    },
    /// A channel to be written whose name would not be read back as one.
    #[error("expected a name of its own for each channel, found {name:?}")]
    ChannelName {
        /// The name, shortened if long.
        name: String,
    },
    /// A number to be written that is not finite.
    #[error("expected finite numbers, found {found} in the column {column:?}")]
    NotFinite {
        /// Name of the column, shortened if long.
        column: String,
        /// The number.
        found: f64,
    },
}
