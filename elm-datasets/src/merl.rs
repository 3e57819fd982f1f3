//! The `.binary` files of the MERL database: 100 isotropic materials in red, green and blue.
//!
//! W. Matusik, H. Pfister, M. Brand, L. McMillan, *A Data-Driven Reflectance Model*, ACM
//! Transactions on Graphics 22(3), 2003. The database does not come with this crate. pbrt-v2 calls
//! the format "regular half-angle".
//!
//! A file is three little-endian 32-bit integers, 90, 90 and 180, and then a table of 64-bit
//! numbers for each channel, over S. Rusinkiewicz's coordinates (*A New Change of Variables for
//! Efficient BRDF Representation*, EGWR 1998), the last index running fastest:
//!
//! | coordinate | steps | index of an angle |
//! |---|---|---|
//! | $\theta_h$, between the normal and the half vector | 90 | $\lfloor 90 \sqrt{\theta_h / (\pi/2)} \rfloor$ |
//! | $\theta_d$, between the half vector and the light | 90 | $\lfloor 90\\, \theta_d / (\pi/2) \rfloor$ |
//! | $\phi_d$, of the light around the half vector, modulo $\pi$ | 180 | $\lfloor 180\\, \phi_d / \pi \rfloor$ |
//!
//! A number times 1/1500 for red, 1.15/1500 for green and 1.66/1500 for blue is the BRDF in 1/sr.
//! Where a combination of angles lies below the horizon or was not measured the number is
//! negative. $\phi_d$ and $\phi_d + \pi$ share an entry, so that the table is reciprocal. In the
//! plane of incidence $\phi_d$ is at the edge of two cells, and rounding takes the one or the other.

// Formulas are not code.
#![allow(clippy::doc_markdown)]

use std::f64::consts::{FRAC_PI_2, PI};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use ndarray::{Array2, ArrayViewMut2};

use crate::brdf::{Brdf, EvalError, check_arguments};
pub use crate::error::merl::Problem;
use crate::error::merl::{DIMENSIONS, HEADER, LENGTH};
use crate::geometry::{DirectionPair, Vector, cartesian, half_vector, reflect};
use crate::{Error, Samples, Sampling, file};

/// Steps of the half vector's polar angle.
pub const THETA_H: usize = 90;
/// Steps of the difference vector's polar angle.
pub const THETA_D: usize = 90;
/// Steps of the difference vector's azimuth.
pub const PHI_D: usize = 180;

/// Entries of one channel.
const CELLS: usize = THETA_H * THETA_D * PHI_D;
/// BRDF per unit of the file: red, green, blue.
const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
const CHANNELS: [&str; 3] = ["red", "green", "blue"];
/// What the table holds where there is no measurement.
const NOTHING: f64 = -1.0;

/// A MERL table. It holds 35 MB.
///
/// ```
/// use elm_datasets::{Angles, DirectionPair, lobes, merl::Merl};
/// let red_plastic = Merl::from_fn(|d| {
///     let gloss = lobes::ggx(d, 0.04, 0.2);
///     [0.2 + gloss, gloss, gloss]
/// });
/// let head_on = DirectionPair::from(Angles { theta_i: 0.0, phi_i: 0.0, theta_o: 0.0, phi_o: 0.0 });
/// let [red, green, blue] = red_plastic.at(&head_on);
/// assert!((red - 0.2 - green).abs() < 1e-12 && green == blue);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Merl {
    /// As in the file, unscaled.
    numbers: Vec<f64>,
}

impl Merl {
    /// Reads a file. Its length is looked at before anything is allocated.
    ///
    /// # Errors
    /// [`Error::Read`] if the file cannot be read, [`Error::Merl`] if it is no such table.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let failed = |reason| Error::Read {
            path: path.to_owned(),
            reason,
        };
        let file = File::open(path).map_err(failed)?;
        let found = file.metadata().map_err(failed)?.len();
        let stream = BufReader::with_capacity(1 << 16, file);
        Self::parse(stream, Some(found), path)
    }

    /// As [`read`](Self::read), from a stream, whose length shows only as it is read. `name` takes
    /// the place of the file in errors.
    ///
    /// # Errors
    /// As for [`read`](Self::read).
    pub fn from_reader(stream: impl Read, name: impl AsRef<Path>) -> Result<Self, Error> {
        Self::parse(stream, None, name.as_ref())
    }

    fn parse(mut stream: impl Read, length: Option<u64>, path: &Path) -> Result<Self, Error> {
        let failed = |reason| Error::Read {
            path: path.to_owned(),
            reason,
        };
        let refused = |problem| {
            Err(Error::Merl {
                path: path.to_owned(),
                problem,
            })
        };
        let mut header = Vec::new();
        let start = stream.by_ref().take(HEADER).read_to_end(&mut header);
        start.map_err(failed)?;
        if header.len() as u64 == HEADER {
            let found = dimensions(&mut &*header).map_err(failed)?;
            if found != DIMENSIONS {
                return refused(Problem::Dimensions { found });
            }
        }
        match length {
            Some(found) if found != LENGTH => return refused(Problem::Length { found }),
            _ => {}
        }
        let mut numbers = Vec::new();
        if length.is_some() {
            numbers.reserve_exact(3 * CELLS);
        }
        let mut block = Vec::with_capacity(8 * PHI_D);
        while numbers.len() < 3 * CELLS {
            block.clear();
            let mut row = stream.by_ref().take(8 * PHI_D as u64);
            row.read_to_end(&mut block).map_err(failed)?;
            let words = block.as_chunks::<8>().0.iter();
            numbers.extend(words.map(|&bytes| f64::from_le_bytes(bytes)));
            if block.len() < 8 * PHI_D {
                let found = (header.len() + 8 * numbers.len() + block.len() % 8) as u64;
                return refused(Problem::Length { found });
            }
        }
        let more = io::copy(&mut stream.take(1), &mut io::sink()).map_err(failed)?;
        if more > 0 {
            return refused(Problem::Length {
                found: LENGTH + more,
            });
        }
        Ok(Self { numbers })
    }

    /// Tabulates a BRDF in 1/sr: red, green and blue at the [middle of each cell](cell). Cells
    /// below the horizon, and values that are negative or not finite, become entries without a
    /// measurement, in all three channels.
    pub fn from_fn(mut brdf: impl FnMut(&DirectionPair) -> [f64; 3]) -> Self {
        let mut numbers = vec![NOTHING; 3 * CELLS];
        for index in 0..CELLS {
            let (row, phi_d) = (index / PHI_D, index % PHI_D);
            let Some(values) = cell(row / THETA_D, row % THETA_D, phi_d).map(|d| brdf(&d)) else {
                continue;
            };
            if values
                .iter()
                .all(|&value| value >= 0.0 && value.is_finite())
            {
                for channel in 0..3 {
                    numbers[channel * CELLS + index] = values[channel] / SCALE[channel];
                }
            }
        }
        Self { numbers }
    }

    /// Writes a file, which comes into place in one step.
    ///
    /// # Errors
    /// [`Error::Write`] if the file system refuses.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        file::replace(path.as_ref(), |out| {
            for number in DIMENSIONS {
                out.write_all(&number.to_le_bytes())?;
            }
            for number in &self.numbers {
                out.write_all(&number.to_le_bytes())?;
            }
            Ok(())
        })
    }

    /// The BRDF in 1/sr: red, green and blue of the cell that the directions fall into, without
    /// interpolation, as in the program that comes with the database.
    ///
    /// Negative where there is no measurement and below the horizon; NaN for a direction that is
    /// not finite, and for opposite directions, which have no half vector.
    #[must_use]
    pub fn at(&self, directions: &DirectionPair) -> [f64; 3] {
        let number = |channel: usize, index: usize| self.numbers.get(channel * CELLS + index);
        let DirectionPair {
            incident: light,
            outgoing: viewer,
        } = *directions;
        let Some(index) = index_of(light, viewer) else {
            return [f64::NAN; 3];
        };
        if light[2] < 0.0 || viewer[2] < 0.0 {
            return SCALE.map(|scale| NOTHING * scale);
        }
        [0, 1, 2].map(|channel| {
            number(channel, index).map_or(f64::NAN, |number| number * SCALE[channel])
        })
    }

    /// How many of the 4,374,000 entries hold no measurement: negative or not finite numbers.
    #[must_use]
    pub fn invalid(&self) -> usize {
        let valid = |number: &&f64| **number >= 0.0 && number.is_finite();
        self.numbers.len() - self.numbers.iter().filter(valid).count()
    }

    /// Looks the table up at the pairs of directions that `sampling` gives. Rows without a
    /// measurement in all three channels are left out; their number is the second value.
    ///
    /// # Errors
    /// [`Error::Rows`] if `sampling` gives no rows or too many.
    pub fn samples(&self, sampling: &Sampling) -> Result<(Samples, usize), Error> {
        let mut pairs = sampling.directions()?;
        let all = pairs.len();
        let mut numbers = Vec::with_capacity(3 * all);
        pairs.retain(|directions| {
            let values = self.at(directions);
            let valid = values.iter().all(|&v| v >= 0.0 && v.is_finite());
            if valid {
                numbers.extend(values);
            }
            valid
        });
        let rows = pairs.len();
        let mut values = Array2::zeros((rows, 3));
        for (to, from) in values.iter_mut().zip(numbers) {
            *to = from;
        }
        let samples = Samples {
            directions: pairs,
            values,
            channels: CHANNELS.map(str::to_owned).to_vec(),
        };
        Ok((samples, all - rows))
    }
}

/// Entries that hold no measurement are black.
impl Brdf for Merl {
    fn channels(&self) -> usize {
        3
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        mut values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        check_arguments(pairs, &values, 3)?;
        for (mut row, pair) in values.rows_mut().into_iter().zip(pairs) {
            for (to, value) in row.iter_mut().zip(self.at(pair)) {
                // NaN, too, becomes 0.
                *to = value.max(0.0);
            }
        }
        Ok(())
    }
}

/// The pair of directions in the middle of a cell, with `phi` of the half vector 0; `None` if one
/// of them is at or below the horizon, or if there is no such cell.
///
/// The middle is that of the indices: $\theta_h = ((i + 1/2)/90)^2\\, \pi/2$.
#[must_use]
#[allow(clippy::cast_precision_loss)]
pub fn cell(theta_h: usize, theta_d: usize, phi_d: usize) -> Option<DirectionPair> {
    if theta_h >= THETA_H || theta_d >= THETA_D || phi_d >= PHI_D {
        return None;
    }
    let middle = |index: usize, steps: usize| (index as f64 + 0.5) / steps as f64;
    let theta_h = middle(theta_h, THETA_H).powi(2) * FRAC_PI_2;
    let [x, y, z] = cartesian(
        middle(theta_d, THETA_D) * FRAC_PI_2,
        middle(phi_d, PHI_D) * PI,
    );
    // The difference vector, in a frame along the half vector, turned into that of the surface.
    let (sin, cos) = theta_h.sin_cos();
    let light = [cos * x + sin * z, y, cos * z - sin * x];
    let viewer = reflect(light, cartesian(theta_h, 0.0));
    (light[2] > 0.0 && viewer[2] > 0.0).then(|| {
        let pair = DirectionPair {
            incident: light,
            outgoing: viewer,
        };
        pair.through_angles()
    })
}

/// Where a pair of directions stands in a channel; `None` without a half vector.
#[allow(clippy::cast_precision_loss)]
fn index_of(light: Vector, viewer: Vector) -> Option<usize> {
    let [x, y, z] = half_vector(light, viewer).filter(|half| half[2].is_finite())?;
    let theta_h = z.clamp(-1.0, 1.0).acos();
    let phi_h = y.atan2(x);
    // The light, turned by -phi_h about z and then by -theta_h about y.
    let ((sin, cos), [x, y, z]) = (phi_h.sin_cos(), light);
    let [x, y] = [cos * x + sin * y, cos * y - sin * x];
    let (sin, cos) = theta_h.sin_cos();
    let [x, z] = [cos * x - sin * z, sin * x + cos * z];
    let theta_d = z.clamp(-1.0, 1.0).acos();
    let phi_d = y.atan2(x);
    let phi_d = if phi_d < 0.0 { phi_d + PI } else { phi_d };
    let step = |share: f64, steps: usize| floor(share * steps as f64).min(steps - 1);
    let row = step((theta_h / FRAC_PI_2).sqrt(), THETA_H) * THETA_D;
    Some((row + step(theta_d / FRAC_PI_2, THETA_D)) * PHI_D + step(phi_d / PI, PHI_D))
}

/// The cast takes NaN and what is negative to 0.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn floor(number: f64) -> usize {
    number as usize
}

fn dimensions(stream: &mut impl Read) -> io::Result<[i32; 3]> {
    let mut found = [0; 3];
    for number in &mut found {
        let mut bytes = [0; 4];
        stream.read_exact(&mut bytes)?;
        *number = i32::from_le_bytes(bytes);
    }
    Ok(found)
}

/// Whether a file that begins with these bytes claims to be such a table.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    dimensions(&mut &*bytes).is_ok_and(|found| found == DIMENSIONS)
}
