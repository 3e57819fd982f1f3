//! Samples from a file of any format that this crate reads.

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::str::FromStr;

use ndarray::Axis;

use crate::error::shorten;
use crate::merl::Merl;
use crate::rgl::Rgl;
use crate::{Error, Invalid, Samples, Sampling, merl, pbrt, rgl, scattered};

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// [Scattered samples as CSV](scattered), `.csv`.
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

    /// The format of a file: by its first bytes where they tell, otherwise by the end of its name.
    ///
    /// # Errors
    /// [`Error::Read`] if the file cannot be read, [`Error::UnknownFormat`] if neither tells.
    pub fn of(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let mut start = Vec::new();
        File::open(path)
            .and_then(|file| file.take(1 << 12).read_to_end(&mut start))
            .map_err(|reason| Error::Read {
                path: path.to_owned(),
                reason,
            })?;
        if rgl::begins(&start) {
            return Ok(Self::Rgl);
        }
        if merl::begins(&start) {
            return Ok(Self::Merl);
        }
        let end = path.extension().unwrap_or_default();
        [
            ("csv", Self::Scattered),
            ("binary", Self::Merl),
            ("bsdf", Self::Rgl),
            ("brdf", Self::Pbrt),
        ]
        .into_iter()
        .find(|(name, _)| end.eq_ignore_ascii_case(name))
        .map(|(_, format)| format)
        .or_else(|| scattered::begins(&start).then_some(Self::Scattered))
        .ok_or_else(|| Error::UnknownFormat {
            path: path.to_owned(),
        })
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
    /// [`Error::UnknownFormatName`] for anything but the four names, in either case.
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
/// | `sampling` | 20,000 at random | where to look up a tabulated BRDF: MERL and RGL |
/// | `invalid` | clamp | what to do with negative values that are measured |
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct OpenOptions {
    /// The format; `None` to find it out.
    pub format: Option<Format>,
    /// For CSV files.
    pub scattered: scattered::Options,
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
    /// How many values were negative, whatever became of them.
    pub invalid: usize,
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
    let (samples, unmeasured) = match format {
        Format::Scattered => (scattered::read(path, &options.scattered)?, 0),
        Format::Merl => Merl::read(path)?.samples(&options.sampling)?,
        Format::Rgl => (Rgl::read(path)?.samples(&options.sampling)?, 0),
        Format::Pbrt => (pbrt::read(path)?, 0),
    };
    let (rows, values, invalid) = options.invalid.treat(samples.values);
    if values.len_of(Axis(0)) == 0 {
        return Err(Error::NothingMeasured {
            path: path.to_owned(),
        });
    }
    let pairs = rows.iter().filter_map(|&row| samples.directions.get(row));
    Ok(Opened {
        samples: Samples {
            directions: pairs.copied().collect(),
            values,
            channels: samples.channels,
        },
        format,
        invalid,
        unmeasured,
    })
}
