//! Scattered samples of a BRDF as CSV: a pair of directions and a value per channel on each line.
//!
//! The first line names the columns, in any order and either case. Directions are four angles,
//! `theta_i, phi_i, theta_o, phi_o`, or two unit vectors, `wi_x, wi_y, wi_z, wo_x, wo_y, wo_z`:
//! `i` towards the light, `o` towards the viewer, in the frame of the surface with its normal
//! along z. All other columns are channels.
//!
//! ```text
//! theta_i,phi_i,theta_o,phi_o,r,g,b
//! 1.404838,-0.060443,0.802262,-0.412098,0,7.33722e-05,0.0010182
//! ```

use std::f64::consts::FRAC_PI_2;
use std::io::{self, Read, Write};
use std::path::Path;

use ndarray::{Array2, Axis};

use crate::csv::{Table, line_of};
use crate::error::shorten;
use crate::vector::{Vector, directions, dot};
use crate::{Directions, Error, Samples, file};

const ANGLES: [&str; 4] = ["theta_i", "phi_i", "theta_o", "phi_o"];
const VECTORS: [&str; 6] = ["wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z"];

/// How far from 1 the length of a direction may be: numbers with three decimals are each up to
/// 0.0005 off, so the length up to `sqrt(3) * 0.0005`.
const LENGTH_TOLERANCE: f64 = 1e-3;

/// The unit of the angles in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum AngleUnit {
    /// A right angle is pi/2.
    #[default]
    Radians,
    /// A right angle is 90.
    Degrees,
}

/// What the file itself does not say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Unit of the angles; of no matter to vectors.
    pub unit: AngleUnit,
    /// Whether the values are BRDF times the cosine of `theta_i`. They are then divided by it.
    pub cosine_weighted: bool,
}

/// What is wrong with a table of samples.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// Neither set of direction columns is complete.
    #[error(
        "expected the columns {}, or {}; missing {}",
        ANGLES.join(", "),
        VECTORS.join(", "),
        missing.join(", ")
    )]
    NoDirections {
        /// The columns missing of the set that is more nearly complete.
        missing: Vec<&'static str>,
    },
    /// Columns of both sets.
    #[error("expected directions as angles or as vectors, found columns of both")]
    BothDirections,
    /// No column is left for the values.
    #[error("expected a column of values beside those of the directions")]
    NoValues,
    /// A polar angle that is negative or below the horizon.
    #[error(
        "expected {angle} from 0 to {}, found {found}",
        if *unit == AngleUnit::Radians { "pi/2 radians" } else { "90 degrees" }
    )]
    PolarAngle {
        /// Name of the column.
        angle: &'static str,
        /// Unit of the angles.
        unit: AngleUnit,
        /// The angle found, in that unit.
        found: f64,
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
        "expected the light above the horizon, for the values are to be divided by cos theta_i"
    )]
    NoCosine,
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

/// Reads samples from a CSV file.
///
/// ```
/// use elm_datasets::scattered::{self, AngleUnit, Options};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// let path = dir.path().join("paint.csv");
/// std::fs::write(&path, "theta_i,phi_i,theta_o,phi_o,grey\n60,0,30,180,0.25\n")?;
/// let degrees = Options { unit: AngleUnit::Degrees, ..Options::default() };
/// let samples = scattered::read(&path, &degrees)?;
/// assert_eq!(samples.channels, ["grey"]);
/// assert!((samples.directions[0].theta_i.cos() - 0.5).abs() < 1e-15);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// - Those of [`Table::read`] for what is no table of numbers.
/// - [`Error::Scattered`] for what is no table of samples, with the line and the [`Problem`].
pub fn read(path: impl AsRef<Path>, options: &Options) -> Result<Samples, Error> {
    let path = path.as_ref();
    parse(path, &file::read(path)?, options)
}

/// As [`read`], from a stream. `name` takes the place of the file in errors.
///
/// # Errors
/// As for [`read`].
pub fn from_reader(
    mut stream: impl Read,
    name: impl AsRef<Path>,
    options: &Options,
) -> Result<Samples, Error> {
    let path = name.as_ref();
    let mut bytes = Vec::new();
    match stream.read_to_end(&mut bytes) {
        Ok(_) => parse(path, &bytes, options),
        Err(reason) => Err(Error::Read {
            path: path.to_owned(),
            reason,
        }),
    }
}

/// Whether the first line names directions.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    let text = bytes.trim_ascii_start();
    let line = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let is = |name: &&str| {
        let mut words = line.split(|&byte| byte == b',').map(<[u8]>::trim_ascii);
        words.any(|word| word.eq_ignore_ascii_case(name.as_bytes()))
    };
    ANGLES.iter().all(is) || VECTORS.iter().all(is)
}

fn parse(path: &Path, bytes: &[u8], options: &Options) -> Result<Samples, Error> {
    let (table, begins) = Table::parse(path, bytes)?;
    let error = |row: Option<usize>, problem| {
        let line = match row {
            Some(row) => line_of(bytes, begins.get(row).copied().unwrap_or(u64::MAX)),
            // A byte order mark is no line.
            None => line_of(bytes, 0),
        };
        Error::Scattered {
            path: path.to_owned(),
            line,
            problem,
        }
    };
    let (set, channels) = split(&table.columns).map_err(|problem| error(None, problem))?;
    let mut values = table.values.select(Axis(1), &channels);
    let mut pairs = Vec::with_capacity(table.values.nrows());
    for (row, cells) in table.values.rows().into_iter().enumerate() {
        let pair = match set {
            Columns::Angles(columns) => from_angles(columns.map(|c| cells[c]), options.unit),
            Columns::Vectors(columns) => from_vectors(columns.map(|c| cells[c])),
        }
        .map_err(|problem| error(Some(row), problem))?;
        if options.cosine_weighted {
            let cos = pair.theta_i.cos();
            // The cosine of the closest number to pi/2 is 6e-17.
            if cos <= f64::EPSILON {
                return Err(error(Some(row), Problem::NoCosine));
            }
            values.row_mut(row).mapv_inplace(|value| value / cos);
        }
        pairs.push(pair);
    }
    let names = channels
        .iter()
        .filter_map(|&c| table.columns.get(c).cloned());
    Ok(Samples {
        directions: pairs,
        values,
        channels: names.collect(),
    })
}

/// Where the directions stand.
#[derive(Clone, Copy)]
enum Columns {
    Angles([usize; 4]),
    Vectors([usize; 6]),
}

/// The columns of the directions, and those of the values.
fn split(columns: &[String]) -> Result<(Columns, Vec<usize>), Problem> {
    let place = |name: &&str| columns.iter().position(|c| c.eq_ignore_ascii_case(name));
    let (angles, vectors) = (ANGLES.map(|n| place(&n)), VECTORS.map(|n| place(&n)));
    let some = |places: &[Option<usize>]| places.iter().any(Option::is_some);
    if some(&angles) && some(&vectors) {
        return Err(Problem::BothDirections);
    }
    let missing = |names: &[&'static str]| {
        let names = names.iter().copied();
        names.filter(|name| place(name).is_none()).collect()
    };
    let set = match (all(angles), all(vectors)) {
        (Some(places), _) => Columns::Angles(places),
        (_, Some(places)) => Columns::Vectors(places),
        _ => {
            let missing = missing(if some(&vectors) { &VECTORS } else { &ANGLES });
            return Err(Problem::NoDirections { missing });
        }
    };
    let channels: Vec<usize> = (0..columns.len())
        .filter(|&column| match set {
            Columns::Angles(places) => !places.contains(&column),
            Columns::Vectors(places) => !places.contains(&column),
        })
        .collect();
    if channels.is_empty() {
        return Err(Problem::NoValues);
    }
    // Two spellings of one name would leave an angle among the values.
    match channels.iter().find(|&&c| is_direction(&columns[c])) {
        Some(_) => Err(Problem::BothDirections),
        None => Ok((set, channels)),
    }
}

fn all<const N: usize>(places: [Option<usize>; N]) -> Option<[usize; N]> {
    let mut found = [0; N];
    for (to, from) in found.iter_mut().zip(places) {
        *to = from?;
    }
    Some(found)
}

fn is_direction(name: &str) -> bool {
    let mut names = ANGLES.iter().chain(&VECTORS);
    names.any(|direction| direction.eq_ignore_ascii_case(name))
}

fn from_angles(found: [f64; 4], unit: AngleUnit) -> Result<Directions, Problem> {
    let radians = found.map(|angle| match unit {
        AngleUnit::Radians => angle,
        AngleUnit::Degrees => angle.to_radians(),
    });
    for index in [0, 2] {
        if !(0.0..=FRAC_PI_2).contains(&radians[index]) {
            return Err(Problem::PolarAngle {
                angle: ANGLES[index],
                unit,
                found: found[index],
            });
        }
    }
    let [theta_i, phi_i, theta_o, phi_o] = radians;
    Ok(Directions {
        theta_i,
        phi_i,
        theta_o,
        phi_o,
    })
}

fn from_vectors([ix, iy, iz, ox, oy, oz]: [f64; 6]) -> Result<Directions, Problem> {
    let check = |vector, direction: Vector| {
        let length = dot(direction, direction).sqrt();
        if (length - 1.0).abs() > LENGTH_TOLERANCE {
            let found = length;
            return Err(Problem::Length { vector, found });
        }
        if direction[2] < 0.0 {
            let found = direction[2];
            return Err(Problem::BelowHorizon { vector, found });
        }
        Ok(direction)
    };
    Ok(directions(
        check("wi", [ix, iy, iz])?,
        check("wo", [ox, oy, oz])?,
    ))
}

/// Writes samples as angles in radians and their values, each number with as many digits as it
/// takes to read back the same number. The file comes into place in one step.
///
/// # Errors
/// - [`Error::Scattered`], before anything is written, for samples that [`read`] would refuse: the
///   [`Problem`] with the line that it would have been on.
/// - [`Error::Write`] if the file system refuses.
pub fn write(path: impl AsRef<Path>, samples: &Samples) -> Result<(), Error> {
    let path = path.as_ref();
    check(path, samples)?;
    file::replace(path, |out| write_checked(out, samples))
}

/// As [`write()`], to a stream. `name` takes the place of the file in errors.
///
/// # Errors
/// As for [`write()`].
pub fn to_writer(
    mut stream: impl Write,
    name: impl AsRef<Path>,
    samples: &Samples,
) -> Result<(), Error> {
    let path = name.as_ref();
    check(path, samples)?;
    write_checked(&mut stream, samples).map_err(|reason| Error::Write {
        path: path.to_owned(),
        reason,
    })
}

fn write_checked(out: &mut dyn Write, samples: &Samples) -> io::Result<()> {
    let mut writer = ::csv::Writer::from_writer(out);
    let channels = samples.channels.iter().map(String::as_str);
    writer.write_record(ANGLES.into_iter().chain(channels))?;
    for (pair, values) in samples.directions.iter().zip(samples.values.rows()) {
        let numbers = angles(pair).into_iter().chain(values.iter().copied());
        writer.write_record(numbers.map(|number| format!("{number:?}")))?;
    }
    writer.flush()
}

fn angles(pair: &Directions) -> [f64; 4] {
    [pair.theta_i, pair.phi_i, pair.theta_o, pair.phi_o]
}

/// Refuses what `read` would refuse.
fn check(path: &Path, samples: &Samples) -> Result<(), Error> {
    check_samples(samples).map_err(|(line, problem)| Error::Scattered {
        path: path.to_owned(),
        line,
        problem,
    })
}

/// What `read` would refuse, with its line.
fn check_samples(samples: &Samples) -> Result<(), (usize, Problem)> {
    let Samples {
        directions,
        values,
        channels,
    } = samples;
    let (rows, columns) = values.dim();
    if rows != directions.len() || columns != channels.len() {
        let problem = Problem::Shape {
            directions: directions.len(),
            names: channels.len(),
            shape: values.dim(),
        };
        return Err((1, problem));
    }
    if rows == 0 || columns == 0 {
        return Err((1, Problem::NoValues));
    }
    for (index, name) in channels.iter().enumerate() {
        let again = channels[..index].contains(name);
        // The reader trims names.
        if again || name.is_empty() || name.trim() != name || is_direction(name) {
            let name = shorten(name);
            return Err((1, Problem::ChannelName { name }));
        }
    }
    for (row, pair) in directions.iter().enumerate() {
        let line = row + 2;
        check_row(pair, values, row, channels).map_err(|problem| (line, problem))?;
    }
    Ok(())
}

fn check_row(
    pair: &Directions,
    values: &Array2<f64>,
    row: usize,
    channels: &[String],
) -> Result<(), Problem> {
    let names = ANGLES
        .into_iter()
        .chain(channels.iter().map(String::as_str));
    let numbers = angles(pair).into_iter().chain(values.row(row).to_vec());
    for (column, found) in names.zip(numbers) {
        if !found.is_finite() {
            let column = shorten(column);
            return Err(Problem::NotFinite { column, found });
        }
    }
    from_angles(angles(pair), AngleUnit::Radians).map(|_| ())
}
