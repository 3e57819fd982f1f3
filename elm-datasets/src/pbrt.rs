//! The `.brdf` files of pbrt-v2: scattered samples of an isotropic material at some wavelengths.
//!
//! M. Pharr, G. Humphreys, *Physically Based Rendering*, 2nd edition, 2010; pbrt-v2's material
//! `measured` calls the format "irregularly sampled isotropic BRDF" (what it calls "regular
//! half-angle" is a [MERL table](crate::merl)). It is text; `#` begins a comment that ends with
//! the line, and line ends mean nothing else:
//!
//! - the number of wavelengths, and the wavelengths in nm;
//! - for each sample `theta_i phi_i theta_o phi_o` in radians, the light first, and the BRDF in
//!   1/sr, without the cosine, at each wavelength.

use std::f64::consts::FRAC_PI_2;
use std::io::Read;
use std::path::Path;

use ndarray::Array2;

use crate::error::Column;
pub use crate::error::pbrt::Problem;
use crate::geometry::{Angles, DirectionPair};
use crate::scattered::HORIZON_TOLERANCE;
use crate::text::shorten;
use crate::{Error, Samples, file};

const ANGLES: [&str; 4] = ["theta_i", "phi_i", "theta_o", "phi_o"];

/// Reads a file. The channels are the wavelengths, such as `550 nm`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let dir = tempfile::tempdir()?;
/// let path = dir.path().join("clay.brdf");
/// std::fs::write(&path, "2 450 650  # wavelengths\n 0.1 0 0.2 3.14  0.25 0.5\n")?;
/// let samples = elm_datasets::pbrt::read(&path)?;
/// assert_eq!(samples.channels, ["450 nm", "650 nm"]);
/// assert_eq!(samples.values[[0, 1]], 0.5);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Read`], [`Error::NotUtf8`], [`Error::NotANumber`] for what is no text of numbers;
/// [`Error::Pbrt`] with the line and the [`Problem`] for what is no such file.
pub fn read(path: impl AsRef<Path>) -> Result<Samples, Error> {
    let path = path.as_ref();
    parse(path, &file::read(path)?, false)
}

/// As [`read`], from a stream. `name` takes the place of the file in errors.
///
/// # Errors
/// As for [`read`].
pub fn from_reader(mut stream: impl Read, name: impl AsRef<Path>) -> Result<Samples, Error> {
    let path = name.as_ref();
    let mut bytes = Vec::new();
    match stream.read_to_end(&mut bytes) {
        Ok(_) => parse(path, &bytes, false),
        Err(reason) => Err(Error::Read {
            path: path.to_owned(),
            reason,
        }),
    }
}

/// As [`read`], with NaN for values that are missing: `nan` in place of a number.
pub(crate) fn read_with_missing(path: &Path) -> Result<Samples, Error> {
    parse(path, &file::read(path)?, true)
}

fn parse(path: &Path, bytes: &[u8], missing: bool) -> Result<Samples, Error> {
    let mut words = Words::new(path, bytes);
    let first = words.need(1)?;
    // Each wavelength takes two bytes at least.
    let count = whole(first, bytes.len() / 2)
        .ok_or_else(|| words.error(Problem::Wavelengths { found: first }))?;
    let mut channels = Vec::new();
    while channels.len() < count {
        let found = words.need(count - channels.len() + ANGLES.len() + count)?;
        if found <= 0.0 {
            return Err(words.error(Problem::Wavelength { found }));
        }
        channels.push(format!("{found} nm"));
    }
    let (mut directions, mut values) = (Vec::new(), Vec::new());
    loop {
        let theta_i = match words.next()? {
            Some(number) => number,
            None if directions.is_empty() => words.need(ANGLES.len() + count)?,
            None => break,
        };
        let mut angles = [theta_i; 4];
        for index in 0..4 {
            if index > 0 {
                angles[index] = words.need(ANGLES.len() - index + count)?;
            }
            let (angle, found) = (ANGLES[index], angles[index]);
            if angle.starts_with("theta") {
                if !(-HORIZON_TOLERANCE..=FRAC_PI_2 + HORIZON_TOLERANCE).contains(&found) {
                    return Err(words.error(Problem::PolarAngle { angle, found }));
                }
                angles[index] = found.clamp(0.0, FRAC_PI_2);
            }
        }
        for channel in 0..count {
            values.push(words.value(count - channel, missing)?);
        }
        let [theta_i, phi_i, theta_o, phi_o] = angles;
        directions.push(DirectionPair::from(Angles {
            theta_i,
            phi_i,
            theta_o,
            phi_o,
        }));
    }
    let mut table = Array2::zeros((directions.len(), count));
    for (to, from) in table.iter_mut().zip(values) {
        *to = from;
    }
    Ok(Samples {
        directions,
        values: table,
        channels,
    })
}

/// A whole number from 1 to `most`.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss
)]
fn whole(number: f64, most: usize) -> Option<usize> {
    (number.fract() == 0.0 && number >= 1.0 && number <= most as f64).then_some(number as usize)
}

/// The numbers of a file, one after another.
struct Words<'a> {
    path: &'a Path,
    lines: std::slice::Split<'a, u8, fn(&u8) -> bool>,
    words: std::str::SplitAsciiWhitespace<'a>,
    /// Line of the last number, counted from 1, and its place there.
    line: usize,
    place: usize,
}

impl<'a> Words<'a> {
    fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self {
            path,
            lines: bytes.split(|&byte| byte == b'\n'),
            words: "".split_ascii_whitespace(),
            line: 0,
            place: 0,
        }
    }

    fn next(&mut self) -> Result<Option<f64>, Error> {
        loop {
            if let Some(word) = self.words.next() {
                self.place += 1;
                let number = word.parse().ok().filter(|number: &f64| number.is_finite());
                return number.map(Some).ok_or_else(|| Error::NotANumber {
                    path: self.path.to_owned(),
                    line: self.line,
                    column: Column::Index(self.place),
                    text: shorten(word),
                });
            }
            let Some(line) = self.lines.next() else {
                return Ok(None);
            };
            (self.line, self.place) = (self.line + 1, 0);
            let content = line.split(|&byte| byte == b'#').next().unwrap_or_default();
            let text = std::str::from_utf8(content).map_err(|_| Error::NotUtf8 {
                path: self.path.to_owned(),
                line: self.line,
            })?;
            self.words = text.split_ascii_whitespace();
        }
    }

    /// The next number, of `expected` that there must be.
    fn need(&mut self, expected: usize) -> Result<f64, Error> {
        match self.next()? {
            Some(number) => Ok(number),
            None => Err(self.error(Problem::Incomplete { expected })),
        }
    }

    /// As [`need`](Self::need), with NaN for a word that says so, if values may be missing.
    fn value(&mut self, expected: usize, missing: bool) -> Result<f64, Error> {
        match self.need(expected) {
            Err(Error::NotANumber { text, .. })
                if missing && text.parse::<f64>().is_ok_and(|number| !number.is_finite()) =>
            {
                Ok(f64::NAN)
            }
            found => found,
        }
    }

    fn error(&self, problem: Problem) -> Error {
        Error::Pbrt {
            path: self.path.to_owned(),
            line: self.line,
            problem,
        }
    }
}
