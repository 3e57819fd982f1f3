//! Reads samples from a file of any format that this crate knows.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use ndarray::Axis;

use crate::error::WavelengthProblem;
use crate::merl::Merl;
use crate::rgl::Rgl;
use crate::text::shorten;
use crate::{
    Error, Invalid, Samples, Sampling, channel, file, fill_values, merl, pbrt, rgl, scattered,
};

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// [Scattered samples as CSV](scattered), `.csv`, and other tables of text, `.tsv`.
    Scattered,
    /// [A MERL table](merl), `.binary`.
    Merl,
    /// [A material of the RGL database](rgl), `.bsdf`.
    Rgl,
    /// [Scattered samples of pbrt-v2](pbrt), `.brdf`.
    Pbrt,
}

impl Format {
    /// Every format there is.
    pub const ALL: [Self; 4] = [Self::Scattered, Self::Merl, Self::Rgl, Self::Pbrt];

    /// The name that [`FromStr`] reads.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scattered => "csv",
            Self::Merl => "merl",
            Self::Rgl => "rgl",
            Self::Pbrt => "pbrt",
        }
    }

    /// What the names of its files end in, in small letters.
    #[must_use]
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Scattered => &["csv", "tsv"],
            Self::Merl => &["binary"],
            Self::Rgl => &["bsdf"],
            Self::Pbrt => &["brdf"],
        }
    }

    /// Whether channels and other columns are chosen while the file is read, not afterwards.
    fn chooses_columns(self) -> bool {
        match self {
            Self::Scattered => true,
            Self::Merl | Self::Rgl | Self::Pbrt => false,
        }
    }

    /// Whether values are as they were measured, so that some may stand for none; a table of a formula has
    /// no such fill values.
    fn is_measured(self) -> bool {
        match self {
            Self::Scattered | Self::Pbrt => true,
            Self::Merl | Self::Rgl => false,
        }
    }

    /// The format of a file: by its first bytes where they tell, otherwise by the end of its name. A file
    /// compressed by gzip is of the format of what it holds; `-`, standard input, is a table.
    ///
    /// # Errors
    /// [`Error::Read`] if the file cannot be read, [`Error::OtherFormat`] if it is of a format that
    /// has no reader here, [`Error::UnknownFormat`] if nothing tells.
    pub fn of(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        if path == Path::new(file::STANDARD_INPUT) {
            return Ok(Self::Scattered);
        }
        let start = file::start(path, 1 << 12).map_err(|reason| Error::Read {
            path: path.to_owned(),
            reason,
        })?;
        if rgl::begins(&start) {
            return Ok(Self::Rgl);
        }
        if merl::begins(&start) {
            return Ok(Self::Merl);
        }
        if let Some(what) = other_format(&start) {
            return Err(Error::OtherFormat {
                path: path.to_owned(),
                what,
            });
        }
        let inner = uncompressed(path);
        let end = inner.extension().unwrap_or_default();
        let is_of = |format: &Self| {
            let extensions = format.extensions().iter();
            extensions
                .clone()
                .any(|name| end.eq_ignore_ascii_case(name))
        };
        let named = Self::ALL.into_iter().find(is_of);
        named
            .or_else(|| scattered::begins(&start).then_some(Self::Scattered))
            .ok_or_else(|| Error::UnknownFormat {
                path: path.to_owned(),
            })
    }
}

/// The name of what is in a file: without the `.gz` of one compressed by gzip.
///
/// ```
/// use std::path::Path;
/// assert_eq!(elm_datasets::uncompressed(Path::new("a/paint.csv.gz")), Path::new("a/paint.csv"));
/// ```
#[must_use]
pub fn uncompressed(path: &Path) -> PathBuf {
    match path.extension() {
        Some(end) if end.eq_ignore_ascii_case("gz") => path.with_extension(""),
        _ => path.to_owned(),
    }
}

/// What a file is that no reader here reads, where its beginning tells.
fn other_format(start: &[u8]) -> Option<&'static str> {
    let text: Vec<&str> = start
        .split(|&byte| byte == b'\n')
        .filter_map(|line| std::str::from_utf8(line).ok())
        .map(|line| line.trim_matches(['\u{feff}', ' ', '\t', '\r']))
        .filter(|line| !line.is_empty())
        .collect();
    let first = text.first()?;
    let begins = |line: &str, word: &str| {
        let found = line.split_ascii_whitespace().next().unwrap_or_default();
        found.eq_ignore_ascii_case(word)
    };
    let has = |word: &str| text.iter().any(|line| begins(line, word));
    let mentions = |word: &str| text.iter().any(|line| line.contains(word));
    if first.starts_with("#?RADIANCE") {
        Some("a file of Radiance")
    } else if first.starts_with('<') && mentions("WindowElement") {
        Some("a BSDF of Radiance or WINDOW in XML")
    } else if first.starts_with('<') {
        Some("XML")
    } else if [
        "ScatterType",
        "AngleOfIncidence",
        "ScatterRadial",
        "SpectralContent",
    ]
    .iter()
    .filter(|&&word| has(word))
    .count()
        >= 2
    {
        Some("a BSDF table of Zemax (Radiant Zemax, in text)")
    } else {
        None
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Format {
    type Err = Error;

    /// # Errors
    /// [`Error::UnknownFormatName`] for anything but a [name](Self::name), in either case.
    fn from_str(text: &str) -> Result<Self, Error> {
        Self::ALL
            .into_iter()
            .find(|format| format.name().eq_ignore_ascii_case(text.trim()))
            .ok_or_else(|| Error::UnknownFormatName {
                text: shorten(text),
            })
    }
}

/// How to read a file whose format is found out.
///
/// | field | default | purpose |
/// |---|---|---|
/// | `format` | none | the format, where it is not to be found out |
/// | `scattered` | radians, without the cosine | what a CSV file does not say itself |
/// | `columns` | all that can be reflectance | which columns of a CSV file are channels |
/// | `sampling` | 20,000 at random | where to look up a tabulated BRDF: MERL and RGL |
/// | `invalid` | clamp | what to do with negative values that are measured |
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OpenOptions {
    /// The format; `None` to find it out.
    pub format: Option<Format>,
    /// For CSV files.
    pub scattered: scattered::Options,
    /// For CSV files.
    pub columns: scattered::Columns,
    /// For MERL and RGL files.
    pub sampling: Sampling,
    /// For all files.
    pub invalid: Invalid,
}

/// What was in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Opened {
    /// The samples.
    pub samples: Samples,
    /// The format of the file.
    pub format: Format,
    /// How many values were negative and no fill values, whatever became of them.
    pub invalid: usize,
    /// How many values were missing: cells without a number, and
    /// [fill values](crate::fill_values) unless they are kept. Their rows are not among the
    /// samples.
    pub missing: usize,
    /// The fill values met, the most negative first.
    pub fills: Vec<f64>,
    /// How many rows were left out, because a value was missing or, with [`Invalid::Drop`],
    /// negative.
    pub left_out: usize,
    /// What was assumed of a CSV file.
    pub notes: Vec<scattered::Note>,
    /// How many of the pairs of directions asked for a table has no measurement at. They are not
    /// among the samples.
    pub unmeasured: usize,
}

/// Reads samples from a file of any of the [formats](Format).
///
/// ```
/// use elm_datasets::{Format, OpenOptions, open};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// let path = dir.path().join("paint.csv");
/// std::fs::write(&path, "theta_i,phi_i,theta_o,phi_o,y\n1,0,0.5,3,0.25\n0,0,0,0,-0.01\n")?;
/// let paint = open(&path, &OpenOptions::default())?;
/// assert_eq!((paint.format, paint.invalid), (Format::Scattered, 1));
/// assert_eq!(paint.samples.values[[1, 0]], 0.0);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Those of the format's reader, and those of [`Format::of`] and [`Sampling::directions`];
/// [`Error::NothingMeasured`] if no row is left.
pub fn open(path: impl AsRef<Path>, options: &OpenOptions) -> Result<Opened, Error> {
    let path = path.as_ref();
    let format = match options.format {
        Some(format) => format,
        None => Format::of(path)?,
    };
    let (mut samples, unmeasured, notes) = match format {
        Format::Scattered => {
            let parsed = scattered::read_with(path, &options.scattered, &options.columns)?;
            (parsed.samples, 0, parsed.notes)
        }
        Format::Merl => {
            let (samples, unmeasured) = Merl::read(path)?.samples(&options.sampling)?;
            (samples, unmeasured, Vec::new())
        }
        Format::Rgl => (Rgl::read(path)?.samples(&options.sampling)?, 0, Vec::new()),
        Format::Pbrt => (pbrt::read_with_missing(path)?, 0, Vec::new()),
    };
    if !format.chooses_columns() {
        samples = chosen(path, samples, &options.columns)?;
    }
    if !options.columns.wavelengths.is_empty() {
        samples.channels = at_wavelengths(path, &samples.channels, &options.columns.wavelengths)?;
    }
    let fills = if format.is_measured() && options.invalid != Invalid::Keep {
        fill_values(&samples.values)
    } else {
        Vec::new()
    };
    if !fills.is_empty() {
        let blank = |value: f64| {
            if fills.contains(&value) {
                f64::NAN
            } else {
                value
            }
        };
        samples.values.mapv_inplace(blank);
    }
    let missing = samples.values.iter().filter(|value| value.is_nan()).count();
    let all = samples.values.nrows();
    let (rows, values, invalid) = options.invalid.treat(samples.values);
    if values.len_of(Axis(0)) == 0 {
        return Err(Error::NothingMeasured {
            path: path.to_owned(),
        });
    }
    let left_out = all - rows.len();
    let pairs = rows.iter().filter_map(|&row| samples.directions.get(row));
    Ok(Opened {
        samples: Samples {
            directions: pairs.copied().collect(),
            values,
            channels: samples.channels,
        },
        format,
        invalid,
        missing,
        fills,
        left_out,
        notes,
        unmeasured,
    })
}

/// The names of channels whose wavelengths are given.
fn at_wavelengths(
    path: &Path,
    channels: &[String],
    wavelengths: &[f64],
) -> Result<Vec<String>, Error> {
    let wrong = |problem| Error::Wavelengths {
        path: path.to_owned(),
        problem,
    };
    if wavelengths.len() != channels.len() {
        return Err(wrong(WavelengthProblem::Count {
            given: wavelengths.len(),
            channels: channels.len(),
        }));
    }
    let mut sorted = wavelengths.to_vec();
    sorted.sort_by(f64::total_cmp);
    let twice = sorted.windows(2).find(|two| two[0] >= two[1]);
    let mut numbers = wavelengths.iter();
    let none = numbers.find(|nm| !(**nm > 0.0 && nm.is_finite()));
    match none.or(twice.map(|two| &two[1])) {
        Some(&found) => Err(wrong(WavelengthProblem::Number { found })),
        None => Ok(wavelengths.iter().map(|nm| format!("{nm} nm")).collect()),
    }
}

/// The channels asked for, of a file that is no table of columns.
fn chosen(path: &Path, samples: Samples, columns: &scattered::Columns) -> Result<Samples, Error> {
    let unknown = |name: &String| Error::UnknownChannel {
        path: path.to_owned(),
        name: shorten(name),
        channels: samples.channels.clone(),
    };
    let place =
        |name: &String| channel::place(name, &samples.channels).ok_or_else(|| unknown(name));
    let ignored: Vec<usize> = columns.ignore.iter().map(place).collect::<Result<_, _>>()?;
    let mut places: Vec<usize> = Vec::new();
    if columns.channels.is_empty() {
        places.extend((0..samples.channels.len()).filter(|place| !ignored.contains(place)));
    }
    for name in &columns.channels {
        let place = place(name)?;
        if places.contains(&place) || ignored.contains(&place) {
            return Err(unknown(name));
        }
        places.push(place);
    }
    if places.is_empty() {
        return Err(Error::NothingMeasured {
            path: path.to_owned(),
        });
    }
    if places.len() == samples.channels.len() && places.is_sorted() {
        return Ok(samples);
    }
    Ok(samples.with_channels(&places))
}
