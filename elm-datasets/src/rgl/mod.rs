//! The `.bsdf` files of the RGL material database, in RGB or as spectra.
//!
//! J. Dupuy, W. Jakob, *An Adaptive Parameterization for Efficient Material Acquisition and
//! Rendering*, ACM Transactions on Graphics 37(6), 2018. The database does not come with this
//! crate.
//!
//! With $\omega_m$ the half vector, $D$ the distribution of microfacet normals and $\sigma$ their
//! projected area, a file holds samples of the smooth function that is left of the BRDF $f$ when
//! the shape of the highlight is taken out of it,
//!
//! $$ S = \frac{4\\, \sigma(\omega_i)}{D(\omega_m)}\\, f(\omega_i, \omega_o) \cos\theta_o $$
//!
//! on a grid that follows the highlight. Its fields:
//!
//! | field | shape | content |
//! |---|---|---|
//! | `theta_i`, `phi_i` | (n), (m) | the incident directions measured, in radians |
//! | `ndf`, `sigma` | (v, u) each | $D$ and $\sigma$ over the unit square of $\omega_m$, $\omega_i$ |
//! | `vndf` | (`phi_i`, `theta_i`, v, u) | density of the normals that are seen from $\omega_i$, over the unit square of $\omega_m$ |
//! | `rgb` | (`phi_i`, `theta_i`, 3, k, k) | $S$ over the square that `vndf` is flattened to |
//! | `spectra`, `wavelengths` | (`phi_i`, `theta_i`, w, k, k), (w) | the same at wavelengths in nm |
//! | `jacobian` | (1) | whether $S$ is as above (1), or without the factor $4 \sigma / D$ (0) |
//!
//! The unit square of a direction is $u = \sqrt{2 \theta / \pi}$, $v = (\phi + \pi) / 2\pi$; an
//! isotropic material's $\phi_m$ counts from $\phi_i$. All else is interpolated linearly, and held
//! beyond the ends of `theta_i`. `luminance` serves to draw directions, which nothing here does.
//!
//! A file with more than two azimuths `phi_i` is of a material with a grain. They span a whole turn; or half
//! of one, where half a turn changes nothing; or a quarter, where mirroring at x or y changes nothing.
//! Directions from other azimuths are those of their images.
//!
//! **Not checked on a file of the database**, for none was at hand: this was written from the
//! publication and its authors' description of the format. It is checked on files made from
//! formulas: where every step has a known answer, and, for isotropic ones, against the authors' renderer,
//! which gives the same values to its 32 bits for an RGB and a spectral file (`benches/peers/rgl_mitsuba.py`
//! makes them). That renderer, Mitsuba 3.9.1, takes the viewer
//! for $\omega_i$ and the light for $\omega_o$; here they are what their names say. For a material
//! that is reciprocal it makes no difference.

// Formulas are not code.
#![allow(clippy::doc_markdown)]

mod azimuths;
mod facets;
mod points;
mod tensor;
mod warp;
mod write;

use std::f64::consts::{FRAC_2_PI, PI, TAU};
use std::path::Path;

use ndarray::{Array2, ArrayViewMut2};

use crate::brdf::{Brdf, EvalError, check_arguments};
pub use crate::error::rgl::Problem;
use crate::geometry::{DirectionPair, half_vector, polar};
use crate::{Error, Samples, Sampling, file};
use azimuths::Azimuths;
use tensor::{F32, Field, U8};
use warp::{Axis, Size, Warp};
pub use write::{Encoded, WriteError, encode};

/// The channels of a file.
#[derive(Debug, Clone, PartialEq)]
pub enum Channels {
    /// Linear red, green and blue.
    Rgb,
    /// A value per wavelength, in nm.
    Spectrum(Vec<f32>),
}

impl Channels {
    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::Rgb => 3,
            Self::Spectrum(wavelengths) => wavelengths.len(),
        }
    }

    /// `red`, `green`, `blue`, or wavelengths such as `550 nm`.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        match self {
            Self::Rgb => ["red", "green", "blue"].map(str::to_owned).to_vec(),
            Self::Spectrum(wavelengths) => {
                let names = wavelengths
                    .iter()
                    .map(|wavelength| format!("{wavelength} nm"));
                names.collect()
            }
        }
    }
}

/// A material of the RGL database.
///
/// ```no_run
/// use elm_datasets::{Sampling, rgl::Rgl};
///
/// let material = Rgl::read("acrylic_felt_green_rgb.bsdf")?;
/// let samples = material.samples(&Sampling::Random { rows: 20_000, seed: 1 })?;
/// assert_eq!(samples.channels, ["red", "green", "blue"]);
/// # Ok::<(), elm_datasets::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Rgl {
    channels: Channels,
    jacobian: bool,
    phi_i: Azimuths,
    theta_i: Axis,
    ndf: Table,
    sigma: Table,
    vndf: Warp,
    /// Tables by azimuth, elevation and channel.
    values: Table,
}

/// Tables of one size, one after another.
#[derive(Debug, Clone, PartialEq)]
struct Table {
    size: Size,
    numbers: Vec<f32>,
}

impl Table {
    fn at(&self, index: usize, point: [f64; 2]) -> f64 {
        let begin = index * self.size.area();
        let table = self.numbers.get(begin..).unwrap_or_default();
        self.size.interpolate(table, point)
    }
}

impl Rgl {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Read`] if the file cannot be read, [`Error::Rgl`] with the [`Problem`] if it is no
    /// such material.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::from_bytes(&file::read(path)?).map_err(|problem| Error::Rgl {
            path: path.to_owned(),
            problem,
        })
    }

    /// As [`read`](Self::read), from the bytes of a file.
    ///
    /// # Errors
    /// The [`Problem`], if it is no such material.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Problem> {
        let fields = Fields(tensor::fields(bytes)?);
        let phi_i = Azimuths::new(fields.axis("phi_i")?)?;
        let theta_i = fields.axis("theta_i")?;
        let incident = [phi_i.count() as u64, theta_i.0.len() as u64];
        let jacobian = fields.layout("jacobian", U8, "one byte", |shape| shape == [1])?;
        let channels = match fields.find("rgb") {
            Some(_) => Channels::Rgb,
            None => {
                Channels::Spectrum(fields.floats("wavelengths", "floats in a row", |shape| {
                    matches!(shape, [1_u64..=u64::MAX])
                })?)
            }
        };
        let (name, expected) = match channels {
            Channels::Rgb => ("rgb", "floats of shape (phi_i, theta_i, 3, v, u)"),
            Channels::Spectrum(_) => (
                "spectra",
                "floats of shape (phi_i, theta_i, wavelengths, v, u)",
            ),
        };
        let count = channels.count() as u64;
        let values = fields.table(name, expected, &[incident[0], incident[1], count])?;
        let expected = "floats of shape (phi_i, theta_i, v, u)";
        let vndf = fields.density("vndf", expected, &incident)?;
        Ok(Self {
            channels,
            jacobian: jacobian.bytes.first().is_some_and(|&byte| byte != 0),
            ndf: fields.density("ndf", "floats of shape (v, u)", &[])?,
            sigma: fields.table("sigma", "floats of shape (v, u)", &[])?,
            vndf: Warp::new(vndf.size, vndf.numbers.into_iter())
                .map_err(|table| Problem::NoDensity { table })?,
            phi_i,
            theta_i,
            values,
        })
    }

    /// The channels of the file.
    #[must_use]
    pub fn channels(&self) -> &Channels {
        &self.channels
    }

    /// The BRDF in 1/sr, without the cosine, per channel.
    ///
    /// Zero where the light or the viewer is at or below the horizon. Red, green and blue are
    /// never negative: where the measured spectrum is outside of what they can show, the file has
    /// negative numbers, which become zero as in the authors' program. A spectrum is left as it
    /// is. NaN for azimuths that are not finite.
    #[must_use]
    pub fn at(&self, directions: &DirectionPair) -> Vec<f64> {
        let mut values = vec![0.0; self.channels.count()];
        self.write_at(directions, &mut values);
        values
    }

    /// `values` has a zero for each channel.
    fn write_at(&self, pair: &DirectionPair, values: &mut [f64]) {
        let (
            DirectionPair {
                incident: light,
                outgoing: viewer,
            },
            azimuths,
        ) = self.phi_i.place(pair);
        let Some(normal) = half_vector(light, viewer).filter(|_| light[2] > 0.0 && viewer[2] > 0.0)
        else {
            return;
        };
        let ((theta_i, phi_i), (theta_m, phi_m)) = (polar(light), polar(normal));
        let zero = if self.phi_i.is_isotropic() {
            phi_i
        } else {
            0.0
        };
        let azimuth = (phi_m - zero + PI) / TAU;
        let seen = [square(theta_m), azimuth - azimuth.floor()];
        let blend = Axis::blend(azimuths, &self.theta_i, theta_i);
        let flat = self.vndf.flatten(&blend, seen);
        let highlight = if self.jacobian {
            let area = self.sigma.at(0, [square(theta_i), (phi_i + PI) / TAU]);
            // Nothing is reflected by what has no area.
            if area <= 0.0 {
                return;
            }
            self.ndf.at(0, seen) / (4.0 * area)
        } else {
            1.0
        };
        let count = values.len();
        for (channel, value) in values.iter_mut().enumerate() {
            let part = |&(slice, weight): &(usize, f64)| {
                weight * self.values.at(slice * count + channel, flat)
            };
            let smooth: f64 = blend.iter().map(part).sum();
            let smooth = match self.channels {
                Channels::Rgb if smooth < 0.0 => 0.0,
                _ => smooth,
            };
            *value = smooth * highlight / viewer[2];
        }
    }

    /// Evaluates the BRDF at the pairs of directions that `sampling` gives.
    ///
    /// # Errors
    /// [`Error::Rows`] if `sampling` gives no rows or too many.
    pub fn samples(&self, sampling: &Sampling) -> Result<Samples, Error> {
        let directions = sampling.directions()?;
        let mut values = Array2::zeros((directions.len(), self.channels.count()));
        for (mut row, pair) in values.rows_mut().into_iter().zip(&directions) {
            for (to, from) in row.iter_mut().zip(self.at(pair)) {
                *to = from;
            }
        }
        Ok(Samples {
            directions,
            values,
            channels: self.channels.names(),
        })
    }
}

/// Negative values of a spectrum, which noise leaves, are black.
impl Brdf for Rgl {
    fn channels(&self) -> usize {
        self.channels.count()
    }

    fn is_isotropic(&self) -> bool {
        self.phi_i.is_isotropic()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        mut values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        let channels = self.channels.count();
        check_arguments(pairs, &values, channels)?;
        let mut found = vec![0.0; channels];
        for (mut row, pair) in values.rows_mut().into_iter().zip(pairs) {
            found.fill(0.0);
            self.write_at(pair, &mut found);
            for (to, value) in row.iter_mut().zip(&found) {
                *to = value.max(0.0);
            }
        }
        Ok(())
    }
}

/// The first coordinate of a direction in its unit square.
fn square(theta: f64) -> f64 {
    (theta * FRAC_2_PI).sqrt()
}

/// The fields of a file, and what they must be.
struct Fields<'a>(Vec<Field<'a>>);

impl Fields<'_> {
    fn find(&self, name: &str) -> Option<&Field<'_>> {
        self.0.iter().find(|field| field.name == name)
    }

    fn layout(
        &self,
        name: &'static str,
        code: u8,
        expected: &'static str,
        fits: impl FnOnce(&[u64]) -> bool,
    ) -> Result<&Field<'_>, Problem> {
        let field = self.find(name).ok_or(Problem::NoField { field: name })?;
        if field.code == code && fits(&field.shape) {
            return Ok(field);
        }
        Err(Problem::Layout {
            field: name,
            expected,
            code: field.code,
            shape: field.shape.clone(),
        })
    }

    /// Finite 32-bit numbers.
    fn floats(
        &self,
        name: &'static str,
        expected: &'static str,
        fits: impl FnOnce(&[u64]) -> bool,
    ) -> Result<Vec<f32>, Problem> {
        let numbers: Vec<f32> = self.layout(name, F32, expected, fits)?.floats().collect();
        match numbers.iter().position(|number| !number.is_finite()) {
            None => Ok(numbers),
            Some(index) => Err(Problem::Number {
                field: name,
                index,
                expected: "a finite number",
                found: numbers[index],
            }),
        }
    }

    fn axis(&self, name: &'static str) -> Result<Axis, Problem> {
        let numbers = self.floats(name, "floats in a row", |shape| {
            matches!(shape, [1_u64..=u64::MAX])
        })?;
        match numbers.windows(2).position(|pair| pair[0] >= pair[1]) {
            None => Ok(Axis(numbers.into_iter().map(f64::from).collect())),
            Some(index) => Err(Problem::Number {
                field: name,
                index: index + 1,
                expected: "a number larger than the one before",
                found: numbers[index + 1],
            }),
        }
    }

    /// As [`table`](Self::table), of numbers that are not negative.
    fn density(
        &self,
        name: &'static str,
        expected: &'static str,
        leading: &[u64],
    ) -> Result<Table, Problem> {
        let table = self.table(name, expected, leading)?;
        match table.numbers.iter().position(|&number| number < 0.0) {
            None => Ok(table),
            Some(index) => Err(Problem::Number {
                field: name,
                index,
                expected: "no negative density",
                found: table.numbers[index],
            }),
        }
    }

    /// Tables of at least 2 x 2, as many as the product of `leading`.
    fn table(
        &self,
        name: &'static str,
        expected: &'static str,
        leading: &[u64],
    ) -> Result<Table, Problem> {
        let mut size = None;
        let numbers = self.floats(name, expected, |shape| {
            let Some((&[height, width], first)) =
                shape.split_last_chunk::<2>().map(|(a, b)| (b, a))
            else {
                return false;
            };
            if let (Ok(width @ 2..), Ok(height @ 2..)) = (width.try_into(), height.try_into()) {
                size = Some(Size { width, height });
            }
            size.is_some() && first == leading
        })?;
        // `floats` has failed if there is no size.
        let size = size.ok_or(Problem::NoField { field: name })?;
        Ok(Table { size, numbers })
    }
}

/// Whether a file that begins with these bytes is in RGL's container.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    bytes.starts_with(tensor::MAGIC)
}
