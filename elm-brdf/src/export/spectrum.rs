//! The channels of a file of colours or spectra, and red, green and blue as spectra.

use ndarray::ArrayViewMut2;

use elm_datasets::Brdf;
use elm_datasets::brdf::{EvalError, check_arguments};
use elm_datasets::channel::{self, Meaning};
use elm_datasets::geometry::DirectionPair;
use elm_datasets::rgl::Channels;

use super::error::ExportError;
/// Wavelengths in nm, and the reflectances at these that stand for linear red, green and blue of sRGB.
///
/// Interpolated linearly, and seen under D65 by the observer of 1931, each has the colour it stands for to
/// four digits, none is negative, and all together are 1. Among those that are so, they have the least sum of
/// squares of steps. By quadratic programming (SLSQP) on Mitsuba 3.9.1's tables of the observer and of D65;
/// the idea is of I. Mallett and C. Yuksel, *Spectral Primary Decomposition for Rendering with sRGB
/// Reflectance*, EGSR 2019.
pub const PRIMARIES: ([f32; 21], [[f32; 21]; 3]) = (
    [
        360.0, 380.0, 400.0, 420.0, 440.0, 460.0, 480.0, 500.0, 520.0, 540.0, 560.0, 580.0, 600.0,
        620.0, 640.0, 660.0, 680.0, 700.0, 720.0, 740.0, 830.0,
    ],
    [
        [
            0.0578, 0.0577, 0.0575, 0.0538, 0.0299, 0.0046, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000,
            0.1347, 0.7975, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000, 1.0000,
        ],
        [
            0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.2588, 0.7470, 1.0000, 1.0000, 1.0000,
            0.7935, 0.2002, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000,
        ],
        [
            0.9422, 0.9423, 0.9425, 0.9462, 0.9701, 0.9954, 0.7412, 0.2530, 0.0000, 0.0000, 0.0000,
            0.0718, 0.0023, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000,
        ],
    ],
);

/// What a file's channels are: red, green and blue, or wavelengths; and the places of these among `names`.
/// Three wavelengths are red, green and blue, as everywhere in this project, and so are three channels
/// without names.
///
/// # Errors
/// [`ExportError::Colours`] where names say neither.
pub(super) fn channels(
    names: &[String],
    count: usize,
) -> Result<(Channels, Vec<usize>), ExportError> {
    let wavelength = |name: &String| match Meaning::of(name) {
        Meaning::Wavelength(nm) => Some(nm as f32),
        _ => None,
    };
    let wavelengths: Option<Vec<f32>> = names.iter().map(wavelength).collect();
    match wavelengths {
        Some(found) if found.len() > 3 && found.len() == count => {
            let mut places: Vec<usize> = (0..count).collect();
            places.sort_by(|&a, &b| found[a].total_cmp(&found[b]));
            let wavelengths = places.iter().map(|&place| found[place]).collect();
            Ok((Channels::Spectrum(wavelengths), places))
        }
        _ if count == 3 && names.is_empty() => Ok((Channels::Rgb, vec![0, 1, 2])),
        _ => match channel::rgb(names) {
            Some(places) if count == 3 => Ok((Channels::Rgb, places.to_vec())),
            _ => Err(ExportError::Colours { channels: count }),
        },
    }
}

/// A model whose channels are sums of another's.
pub(super) struct Mixed<B> {
    pub(super) brdf: B,
    /// By channel what it takes of each of the other's.
    pub(super) rows: Vec<Vec<f64>>,
}

impl<B: Brdf> Mixed<B> {
    /// The channels at `places`.
    pub(super) fn selected(brdf: B, places: &[usize]) -> Self {
        let count = brdf.channels();
        let unit = |&place: &usize| (0..count).map(|k| f64::from(k == place)).collect();
        let rows = places.iter().map(unit).collect();
        Self { brdf, rows }
    }

    /// One channel as `channels` equal ones.
    pub(super) fn grey(brdf: B, channels: usize) -> Self {
        let rows = vec![vec![1.0]; channels];
        Self { brdf, rows }
    }

    /// Red, green and blue at `places` as the spectra of [`PRIMARIES`].
    pub(super) fn upsampled(brdf: B, places: &[usize]) -> Self {
        let count = brdf.channels();
        let row = |wavelength: usize| {
            let mut row = vec![0.0; count];
            for (primary, &place) in PRIMARIES.1.iter().zip(places) {
                row[place] = f64::from(primary[wavelength]);
            }
            row
        };
        let rows = (0..PRIMARIES.0.len()).map(row).collect();
        Self { brdf, rows }
    }
}

impl<B: Brdf> Brdf for Mixed<B> {
    fn channels(&self) -> usize {
        self.rows.len()
    }

    fn is_isotropic(&self) -> bool {
        self.brdf.is_isotropic()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        mut values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        check_arguments(pairs, &values, self.channels())?;
        let all = self.brdf.eval(pairs)?;
        for (mut to, from) in values.rows_mut().into_iter().zip(all.rows()) {
            for (value, row) in to.iter_mut().zip(&self.rows) {
                let parts = row.iter().zip(from).filter(|(weight, _)| **weight != 0.0);
                *value = parts.map(|(weight, value)| weight * value).sum();
            }
        }
        Ok(())
    }
}
