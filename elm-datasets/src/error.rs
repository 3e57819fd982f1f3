//! The errors of reading and checking data.

pub(crate) mod merl;
pub(crate) mod pbrt;
pub(crate) mod rgl;
pub(crate) mod scattered;
mod wavelengths;

use std::fmt;
use std::path::PathBuf;

use crate::text::none_or_list;
pub use wavelengths::WavelengthProblem;

/// Bytes that a file may have, unless its format says how many there are.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 30;

/// What a numbered line of a CUReT file describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Entry {
    /// One of the materials, a line of a value file.
    Material,
    /// One of the pairs of directions, a line of `table.txt`.
    Measurement,
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Material => "material",
            Self::Measurement => "measurement",
        })
    }
}

/// Everything that reading, writing and looking up data can fail with.
///
/// The text of each variant is one line that names the place and what was expected there; an
/// input/output error's own text is part of it, so there is no further source to print.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened or read.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        reason: std::io::Error,
    },
    /// A parameter of a [formula](crate::lobes::Formula) out of its range.
    #[error("{what} is {value}, expected {least} to {most}")]
    LobeParameter {
        /// The parameter.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The least it may be.
        least: f64,
        /// The most it may be.
        most: f64,
    },
    /// A file too large to be what it should be.
    #[error(
        "{}: expected at most {} bytes, found {found}",
        path.display(),
        MAX_FILE_BYTES
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its length in bytes.
        found: u64,
    },
    /// A file could not be written or moved into place.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        reason: std::io::Error,
    },
    /// A folder holds no complete set of CUReT value files.
    #[error(
        "{} has no complete set of values: looked for abrdf.dat, or rbrdf.dat with gbrdf.dat and \
         bbrdf.dat; found {}",
        dir.display(),
        none_or_list(found)
    )]
    NoValues {
        /// The folder.
        dir: PathBuf,
        /// The value files that are there.
        found: Vec<&'static str>,
    },
    /// Bytes that are not UTF-8.
    #[error("{}, line {line}: expected text in UTF-8, found other bytes", path.display())]
    NotUtf8 {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
    },
    /// A line with too few or too many numbers.
    #[error("{}, line {line}: expected {expected} numbers, found {found}", path.display())]
    Count {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// How many there are.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// A text that is not a finite number.
    #[error(
        "{}, line {line}, {}: expected a finite number, found {text:?}",
        path.display(),
        column_text(column)
    )]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// Where in the line.
        column: Column,
        /// What stands there, shortened if long.
        text: String,
    },
    /// A line that does not begin with a number in range.
    #[error(
        "{}, line {line}: expected the number of a {entry} (1 to {last}), found {text:?}",
        path.display()
    )]
    EntryNumber {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// What the lines of this file describe.
        entry: Entry,
        /// The largest number that exists.
        last: usize,
        /// What stands there, shortened if long.
        text: String,
    },
    /// The same number on two lines.
    #[error(
        "{}, line {line}: {entry} {number} has a line already, line {first}; expected each once",
        path.display()
    )]
    DuplicateEntry {
        /// The file.
        path: PathBuf,
        /// Line of the second, counted from 1.
        line: usize,
        /// Line of the first, counted from 1.
        first: usize,
        /// What the lines of this file describe.
        entry: Entry,
        /// The number met twice.
        number: usize,
    },
    /// A number without a line.
    #[error(
        "{}: {entry} {number} is missing after the last line, line {lines}; expected each of 1 to \
         {last} on a line",
        path.display()
    )]
    MissingEntry {
        /// The file.
        path: PathBuf,
        /// What the lines of this file describe.
        entry: Entry,
        /// The smallest number that is missing.
        number: usize,
        /// The largest number that exists.
        last: usize,
        /// Lines in the file, blank ones at the end left out.
        lines: usize,
    },
    /// An angle outside the range that has a meaning.
    #[error(
        "{}, line {line}: expected {angle} {expected} radians, found {value}",
        path.display()
    )]
    Angle {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// Name of the angle, as in [`Angles`](crate::Angles).
        angle: &'static str,
        /// The value found, in radians.
        value: f64,
        /// The range it must be in.
        expected: &'static str,
    },
    /// A material number outside 1 to 61.
    #[error("there is no material {number}: they are numbered 1 to {last}")]
    MaterialNumber {
        /// The number asked for.
        number: usize,
        /// The largest number that exists.
        last: usize,
    },
    /// A name that no material has.
    #[error(
        "no material is called {name:?}; the closest names are {}",
        none_or_list(closest)
    )]
    UnknownMaterial {
        /// The name asked for.
        name: String,
        /// The names nearest to it, nearest first.
        closest: Vec<&'static str>,
    },
    /// A name that fits several materials.
    #[error(
        "{name:?} may mean any of {}: give the whole name or the number",
        none_or_list(candidates)
    )]
    AmbiguousMaterial {
        /// The name asked for.
        name: String,
        /// The names it fits.
        candidates: Vec<&'static str>,
    },
    /// A text that names no way of treating invalid values.
    #[error("{text:?} is no way to treat invalid values: expected clamp, keep or drop")]
    UnknownInvalid {
        /// The text.
        text: String,
    },
    /// Measurements that cannot be written in CUReT's layout.
    #[error("these measurements do not fit CUReT's files: {0}")]
    Layout(#[from] Layout),
    /// CSV that cannot be read for a reason without a variant of its own.
    #[error("{}, line {line}: expected comma-separated values", path.display())]
    Csv {
        /// The file, or the name given to the stream.
        path: PathBuf,
        /// Line, counted from 1; 0 if unknown.
        line: usize,
    },
    /// A table without a header or without rows.
    #[error("{}: expected a header and at least one row, found {found}", path.display())]
    EmptyTable {
        /// The file, or the name given to the stream.
        path: PathBuf,
        /// What there is instead.
        found: &'static str,
    },
    /// Numbers where the names of the columns should be.
    #[error("{}, line {line}: expected the names of the columns, found numbers", path.display())]
    NoHeader {
        /// The file, or the name given to the stream.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
    },
    /// A column whose name is empty.
    #[error("{}, line {line}: column {column} has no name", path.display())]
    UnnamedColumn {
        /// The file, or the name given to the stream.
        path: PathBuf,
        /// Line of the header, counted from 1.
        line: usize,
        /// Number of the column, counted from 1.
        column: usize,
    },
    /// Two columns of one name.
    #[error("{}, line {line}: expected distinct column names, found {name:?} twice", path.display())]
    DuplicateColumn {
        /// The file, or the name given to the stream.
        path: PathBuf,
        /// Line of the header, counted from 1.
        line: usize,
        /// The name, shortened if long.
        name: String,
    },
    /// A column that the table does not have.
    #[error("there is no column {name:?}; the table has {}", none_or_list(columns))]
    UnknownColumn {
        /// The name asked for, shortened if long.
        name: String,
        /// The names there are.
        columns: Vec<String>,
    },
    /// A target column named twice.
    #[error("column {name:?} is named twice among the targets")]
    RepeatedTarget {
        /// The name.
        name: String,
    },
    /// A split that leaves no inputs or no targets.
    #[error(
        "expected at least one target and one input among {columns} columns, found {targets} targets"
    )]
    Split {
        /// Target columns asked for.
        targets: usize,
        /// Columns of the table.
        columns: usize,
    },
    /// A table of scattered samples that is none.
    #[error("{}, line {line}: {problem}", path.display())]
    Scattered {
        /// The file, or the name given to the stream.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// What is wrong there.
        problem: scattered::Problem,
    },
    /// A file that is no MERL table.
    #[error("{}: {problem}", path.display())]
    Merl {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: merl::Problem,
    },
    /// A file that is no isotropic material of the RGL database.
    #[error("{}: {problem}", path.display())]
    Rgl {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: rgl::Problem,
    },
    /// A file that is no list of samples for pbrt-v2.
    #[error("{}, line {line}: {problem}", path.display())]
    Pbrt {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1; 0 if there is none.
        line: usize,
        /// What is wrong there.
        problem: pbrt::Problem,
    },
    /// A file of no format that is known.
    #[error(
        "{}: expected scattered samples (.csv), a MERL table (.binary), a material of RGL (.bsdf) \
         or samples for pbrt-v2 (.brdf); found neither such a file nor such a name",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// A file of a format that has no reader.
    #[error(
        "{}: this is {what}, which cannot be read; expected scattered samples (.csv), a MERL table \
         (.binary), a material of RGL (.bsdf, binary) or samples for pbrt-v2 (.brdf)",
        path.display()
    )]
    OtherFormat {
        /// The file.
        path: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// A channel asked for that a file does not have, or twice.
    #[error("{}: expected {name:?} to be one of the channels {}", path.display(), none_or_list(channels))]
    UnknownChannel {
        /// The file.
        path: PathBuf,
        /// The name asked for, shortened if long.
        name: String,
        /// The channels there are.
        channels: Vec<String>,
    },
    /// Wavelengths given for the channels of a file that cannot be theirs.
    #[error("{}: {problem}", path.display())]
    Wavelengths {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        problem: WavelengthProblem,
    },
    /// A spectrum whose colour was asked for and that has none.
    #[error(transparent)]
    Color(#[from] crate::color::Problem),
    /// A text that names no format.
    #[error("{text:?} is no file format: expected csv, merl, rgl or pbrt")]
    UnknownFormatName {
        /// The text.
        text: String,
    },
    /// A file without a row that can be used.
    #[error("{}: expected at least one measurement, found none that is valid", path.display())]
    NothingMeasured {
        /// The file.
        path: PathBuf,
    },
    /// No rows asked for, or too many.
    #[error("expected 1 to {last} rows, found {found}")]
    Rows {
        /// Rows asked for.
        found: usize,
        /// Most rows there can be.
        last: usize,
    },
    /// A standard deviation that is none.
    #[error("expected a finite standard deviation of the noise of 0 or more, found {found}")]
    NoiseSd {
        /// The value.
        found: f64,
    },
}

/// Where in a line a number stands.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Column {
    /// The n-th number of the line, counted from 1, the line's own number included.
    Index(usize),
    /// A column with a name.
    Name(String),
}

/// Why measurements do not fit CUReT's files.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Layout {
    /// The wrong number of directions.
    #[error("expected {expected} pairs of directions, found {found}")]
    Directions {
        /// How many there are.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// An angle that the reader would refuse.
    #[error("measurement {measurement}: expected {angle} {expected} radians, found {value}")]
    Angle {
        /// Number of the pair of directions, counted from 1.
        measurement: usize,
        /// Name of the angle.
        angle: &'static str,
        /// The value found, in radians.
        value: f64,
        /// The range it must be in.
        expected: &'static str,
    },
    /// Channels that have no file.
    #[error("expected the channels average, or red, green and blue; found {}", none_or_list(.0))]
    Channels(
        /// The channels found.
        Vec<String>,
    ),
    /// A material is not there.
    #[error("expected all {last} materials once, found {count} of material {number}")]
    Materials {
        /// The first number that does not occur exactly once.
        number: usize,
        /// How often it occurs.
        count: usize,
        /// The largest number that exists.
        last: usize,
    },
    /// A material without all its rows, or with values of another shape.
    #[error(
        "material {number}: expected values for all {expected} measurements in order, found {rows} \
         rows and values of shape {shape:?}"
    )]
    Rows {
        /// Number of the material.
        number: usize,
        /// Rows there are.
        rows: usize,
        /// Shape of the values.
        shape: (usize, usize),
        /// Rows there must be.
        expected: usize,
    },
    /// A value that is not finite.
    #[error("material {number}, measurement {measurement}: expected a finite value, found {value}")]
    NotFinite {
        /// Number of the material.
        number: usize,
        /// Number of the pair of directions, counted from 1.
        measurement: usize,
        /// The value.
        value: f64,
    },
}

fn column_text(column: &Column) -> String {
    match column {
        Column::Index(index) => format!("number {index}"),
        Column::Name(name) => format!("column {name:?}"),
    }
}
