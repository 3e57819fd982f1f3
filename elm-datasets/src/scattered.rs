//! Scattered samples of a BRDF as CSV: a pair of directions and a value per channel on each line.
//!
//! The first line names the columns, in any order and either case. Directions are four angles,
//! `theta_i, phi_i, theta_o, phi_o`, or two unit vectors, `wi_x, wi_y, wi_z, wo_x, wo_y, wo_z`:
//! `i` towards the light, `o` towards the viewer, in the frame of the surface with its normal
//! along z. All other columns are channels, if their names can be those of reflectance: a colour, a
//! wavelength, `brdf` and the like, or names of which none is known here. A name that says something
//! else (`std`, `row`), or nothing beside one that does say reflectance, is an error, until
//! [`Columns`] says what is what.
//!
//! ```text
//! theta_i,phi_i,theta_o,phi_o,r,g,b
//! 1.404838,-0.060443,0.802262,-0.412098,0,7.33722e-05,0.0010182
//! ```
//!
//! With a column of wavelengths (`wavelength`, `lambda`, with or without a unit) beside one of values
//! the rows of one pair of directions become one, with a channel per wavelength.
//!
//! # What is assumed of directions
//! - A direction up to 5e-4 radians (0.029 degrees) below the horizon is on it: the rounding of
//!   numbers with three decimals.
//! - A negative polar angle, as scans in a plane have them, is on the other side of the normal: half
//!   a turn is added to its azimuth.
//! - Rows whose viewer is below the surface are transmitted light, and left out, if any others are
//!   left.
//! - Degrees that are all below 1.571, with azimuths up to 6.28, are radians, and an error.
//!
//! # Other tables
//! Cells may be separated by semicolons, tabs or blanks, with commas in the numbers for points; lines
//! that begin with `#`, `%`, `!` or `//` are comments, and so is what stands before the names of the
//! columns. Angles are known by other names, too (`Theta_in (deg)`, `thi`, `phi_r`, `view zenith`, `SZA`),
//! and `phi`, `dphi` or `relative azimuth` is the difference of the azimuths; azimuths that are no column
//! are 0. A unit in the names is taken, one in the comments where the angles bear it out. Columns named `BRF`
//! or `reflectance factor` are divided by pi. Each of these is one of the [notes](Note). Files compressed
//! by gzip are read as what they hold, and the path `-` is standard input.

mod angles;
mod columns;
mod dialect;
mod directions;
mod long;
mod names;
mod note;
mod write;

use std::io::Read;
use std::path::Path;

use ndarray::Axis;

use crate::csv::{Cells, Table, line_of};
pub use crate::error::scattered::{ANGLES, AngleUnit, List, Problem};
use crate::text::shorten;
use crate::{Error, Samples, channel, file};
pub(crate) use angles::HORIZON_TOLERANCE;
use angles::{Found, Reader};
use columns::{Angle, Plan};
use dialect::{Separator, Text};
pub use directions::DirectionTable;
pub use note::Note;
pub use write::{to_writer, write};

/// What the file itself does not say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Unit of the angles; of no matter to vectors.
    pub unit: AngleUnit,
    /// Whether the values are BRDF times the cosine of `theta_i`. They are then divided by it.
    pub cosine_weighted: bool,
}

/// Which columns are channels, and what their values are, where their names do not say it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Columns {
    /// The channels, in this order; all that can be reflectance if there are none here. Names are
    /// those of columns, or colours or wavelengths that they are of.
    pub channels: Vec<String>,
    /// Columns to leave out.
    pub ignore: Vec<String>,
    /// Whether the values are BRDF times the cosine of `theta_o`, the scatter angle. They are then
    /// divided by it.
    pub scatter_cosine: bool,
    /// Angles that are the same in every row and so no column, in the order of [`ANGLES`] and the unit
    /// of the file.
    pub angles: [Option<f64>; 4],
    /// Whether the values are reflectance factors, BRDF times pi. They are then divided by pi.
    pub reflectance_factor: bool,
    /// The wavelengths of the channels in nm, in their order, where their names do not say them.
    pub wavelengths: Vec<f64>,
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
/// assert!((samples.directions[0].incident[2] - 0.5).abs() < 1e-15);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// - Those of [`Table::read`] for what is no table of numbers.
/// - [`Error::Scattered`] for what is no table of samples, with the line and the [`Problem`].
pub fn read(path: impl AsRef<Path>, options: &Options) -> Result<Samples, Error> {
    let path = path.as_ref();
    whole(path, &file::read(path)?, options)
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
        Ok(_) => whole(path, &bytes, options),
        Err(reason) => Err(Error::Read {
            path: path.to_owned(),
            reason,
        }),
    }
}

/// Whether one of the first lines names directions.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    let whole = std::str::from_utf8(bytes);
    let text = whole.or_else(|error| std::str::from_utf8(&bytes[..error.valid_up_to()]));
    text.is_ok_and(|text| text.lines().any(dialect::is_header))
}

/// What was in a table: samples, of which a value that is missing is NaN, and what was assumed.
pub(crate) struct Parsed {
    pub(crate) samples: Samples,
    pub(crate) notes: Vec<Note>,
}

/// A table in which no value is missing.
fn whole(path: &Path, bytes: &[u8], options: &Options) -> Result<Samples, Error> {
    let samples = parse(path, bytes, options, &Columns::default(), Cells::Numbers)?.samples;
    // A value per wavelength and pair may be missing though no cell of the table is.
    match samples.values.indexed_iter().find(|(_, v)| v.is_nan()) {
        None => Ok(samples),
        Some(((_, column), _)) => Err(Error::Scattered {
            path: path.to_owned(),
            line: line_of(bytes, 0),
            problem: Problem::NoValue {
                channel: shorten(&samples.channels[column]),
            },
        }),
    }
}

/// As [`read`], of a table whose values may be missing.
pub(crate) fn read_with(path: &Path, options: &Options, choice: &Columns) -> Result<Parsed, Error> {
    parse(path, &file::read(path)?, options, choice, Cells::Missing)
}

fn parse(
    path: &Path,
    bytes: &[u8],
    options: &Options,
    choice: &Columns,
    values: Cells,
) -> Result<Parsed, Error> {
    let error = |line, problem| Error::Scattered {
        path: path.to_owned(),
        line,
        problem,
    };
    let text = Text::of(bytes);
    let bytes = text.as_ref().map_or(bytes, |text| &text.bytes);
    // A byte order mark is no line.
    let head = || line_of(bytes, 0);
    let names = Table::names(path, bytes)?;
    let plan = Plan::new(&names, choice).map_err(|problem| error(head(), problem))?;
    let (table, begins) = Table::parse(path, bytes, |column| {
        if plan.channels.contains(&column) {
            values
        } else if plan.directions.contains(column) || plan.wavelength == Some(column) {
            Cells::Numbers
        } else {
            Cells::Anything
        }
    })?;
    let at = |row: usize, problem| {
        let begin = begins.get(row).copied().unwrap_or(u64::MAX);
        error(line_of(bytes, begin), problem)
    };
    let (options, mut notes) =
        unit(text.as_ref(), &table, &plan, options).map_err(|problem| error(head(), problem))?;
    let Reflected {
        rows,
        mut samples,
        notes: more,
    } = reflected(&table, &plan, &options, choice).map_err(|(row, problem)| {
        row.map_or_else(
            || error(head(), problem.clone()),
            |row| at(row, problem.clone()),
        )
    })?;
    notes.extend(more);
    let mut channels = plan.channels.iter();
    let named = channels.all(|&column| channel::is_reflectance_factor(&names[column]));
    if named {
        // Read again, they must not be divided again.
        samples.channels = without_factors(&samples.channels);
    }
    if named || choice.reflectance_factor {
        samples.values /= std::f64::consts::PI;
        notes.push(Note::ReflectanceFactors);
    }
    if let Some(column) = plan.wavelength {
        let wavelengths = table.values.column(column).select(Axis(0), &rows).to_vec();
        samples = long::pivot(&samples, &wavelengths, &names[column])
            .map_err(|(row, found)| at(rows[row], Problem::Wavelength { found }))?;
        notes.push(Note::Pivoted {
            rows: rows.len(),
            channels: samples.channels.len(),
            pairs: samples.directions.len(),
        });
        samples = wavelengths_asked_for(samples, &names, &plan, choice)
            .map_err(|problem| error(head(), problem))?;
    }
    if !plan.left_out.is_empty() {
        let columns = List::of(plan.left_out.iter().map(|&c| &names[c]));
        notes.push(Note::LeftOut { columns });
    }
    Ok(Parsed { samples, notes })
}

/// Names of reflectance factors as those of values of the BRDF, each once.
fn without_factors(channels: &[String]) -> Vec<String> {
    let mut renamed: Vec<String> = Vec::with_capacity(channels.len());
    for name in channels {
        let name = channel::without_factor(name);
        let numbered = (2..).map(|number| format!("{name} ({number})"));
        let mut names = std::iter::once(name.clone()).chain(numbered);
        renamed.extend(names.find(|name| !renamed.contains(name)));
    }
    renamed
}

/// The options with the unit that the file says, and what was assumed of its text and names.
fn unit(
    text: Option<&Text>,
    table: &Table,
    plan: &Plan,
    options: &Options,
) -> Result<(Options, Vec<Note>), Problem> {
    let mut options = *options;
    let mut notes = Vec::new();
    if let Some(text) = text {
        if text.separator != Separator::Comma {
            notes.push(Note::Separated {
                separator: text.separator.name(),
                decimal_commas: text.decimal_commas,
            });
        }
        if text.comments > 0 {
            notes.push(Note::Comments {
                lines: text.comments,
            });
        }
    }
    notes.extend(plan.notes.iter().cloned());
    let columns::Directions::Angles(angles) = plan.directions else {
        return Ok((options, notes));
    };
    let largest = |angle: &Angle| match *angle {
        Angle::Column(column) => {
            let sizes = table.values.column(column).mapv(f64::abs);
            sizes.into_iter().fold(0.0, f64::max)
        }
        Angle::Constant(constant) => constant.abs(),
    };
    let theta = largest(&angles[0]).max(largest(&angles[2]));
    let can_be_radians = theta <= std::f64::consts::PI + HORIZON_TOLERANCE;
    match (plan.unit, text.and_then(|text| text.unit), options.unit) {
        (Some(AngleUnit::Radians), _, AngleUnit::Degrees) => {
            return Err(Problem::Units {
                said: "radians",
                advice: "leave out --degrees",
            });
        }
        (Some(AngleUnit::Degrees), _, AngleUnit::Radians) => {
            options.unit = AngleUnit::Degrees;
            notes.push(Note::Unit {
                unit: options.unit,
                place: "the columns' names say",
            });
        }
        // What comments say may be of something else: the angles must bear it out.
        (None, Some(AngleUnit::Degrees), AngleUnit::Radians) if !can_be_radians => {
            options.unit = AngleUnit::Degrees;
            notes.push(Note::Unit {
                unit: options.unit,
                place: "the comments say",
            });
        }
        _ => {}
    }
    Ok((options, notes))
}

/// The rows of a table that are above the surface, with their samples, and what was assumed.
struct Reflected {
    rows: Vec<usize>,
    samples: Samples,
    notes: Vec<Note>,
}

/// Reads directions and values; in an error the row, if it is one's.
fn reflected(
    table: &Table,
    plan: &Plan,
    options: &Options,
    choice: &Columns,
) -> Result<Reflected, (Option<usize>, Problem)> {
    let mut reader = Reader::new(options.unit);
    let (mut rows, mut pairs) = (Vec::new(), Vec::new());
    let (mut below, mut transmitted) = (None, 0);
    for (row, cells) in table.values.rows().into_iter().enumerate() {
        let found = plan.directions.read(&mut reader, cells);
        match found.map_err(|problem| (Some(row), problem))? {
            Found::Reflected(pair) => {
                rows.push(row);
                pairs.push(pair);
            }
            Found::Transmitted(problem) => {
                below = below.or(Some((Some(row), problem)));
                transmitted += 1;
            }
        }
    }
    if let (true, Some(problem)) = (rows.is_empty(), below) {
        return Err(problem);
    }
    let mut notes = reader.finish().map_err(|problem| (None, problem))?;
    if transmitted > 0 {
        notes.push(Note::Transmitted {
            rows: transmitted,
            unit: options.unit,
        });
    }
    let mut values = table
        .values
        .select(Axis(1), &plan.channels)
        .select(Axis(0), &rows);
    for (index, pair) in pairs.iter().enumerate() {
        for (weighted, cos, direction, angle) in [
            (
                options.cosine_weighted,
                pair.incident[2],
                "the light",
                "theta_i",
            ),
            (
                choice.scatter_cosine,
                pair.outgoing[2],
                "the viewer",
                "theta_o",
            ),
        ] {
            if !weighted {
                continue;
            }
            // The cosine of the closest number to pi/2 is 6e-17.
            if cos <= f64::EPSILON {
                return Err((Some(rows[index]), Problem::NoCosine { direction, angle }));
            }
            values.row_mut(index).mapv_inplace(|value| value / cos);
        }
    }
    let names = plan.channels.iter().map(|&c| table.columns[c].clone());
    let samples = Samples {
        directions: pairs,
        values,
        channels: names.collect(),
    };
    Ok(Reflected {
        rows,
        samples,
        notes,
    })
}

/// Of the channels that wavelengths have become those that were asked for, if any were.
fn wavelengths_asked_for(
    samples: Samples,
    names: &[String],
    plan: &Plan,
    choice: &Columns,
) -> Result<Samples, Problem> {
    let is_column = |name: &String| {
        let mut values = plan.channels.iter();
        values.any(|&c| names[c].trim().eq_ignore_ascii_case(name.trim()))
    };
    let asked: Vec<String> = choice
        .channels
        .iter()
        .filter(|name| !is_column(name))
        .cloned()
        .collect();
    if asked.is_empty() {
        return Ok(samples);
    }
    let mut places = Vec::with_capacity(asked.len());
    for name in &asked {
        match channel::place(name, &samples.channels) {
            Some(place) if !places.contains(&place) => places.push(place),
            _ => {
                return Err(Problem::NoSuchColumn {
                    name: shorten(name),
                    columns: List::of(&samples.channels),
                });
            }
        }
    }
    Ok(samples.with_channels(&places))
}
