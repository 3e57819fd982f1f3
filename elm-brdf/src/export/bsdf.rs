//! A model as a tensor file of Dupuy and Jakob (2018), for Mitsuba 3 and pbrt-v4.

use elm_datasets::Brdf;
use elm_datasets::rgl::{Channels, Encoded, encode};

use super::spectrum::{self, Mixed, PRIMARIES};
use crate::error::Result;

/// The file of any model, whose channels have these `names`: with `is_spectral` as spectra, else as red,
/// green and blue. See [`encode`] for `resolution`.
///
/// Red, green and blue become [spectra](super::PRIMARIES) that have these colours; one channel stands for
/// all.
///
/// # Errors
/// [`ExportError::Colours`](super::ExportError::Colours) where the names are neither colours nor wavelengths,
/// or wavelengths for a file of colours; [`Error::Tensor`](crate::Error::Tensor) for what no file can hold,
/// and where the model cannot be evaluated.
pub fn bsdf(
    brdf: impl Brdf,
    names: &[String],
    about: &str,
    is_spectral: bool,
    resolution: Option<usize>,
) -> Result<Encoded> {
    let count = brdf.channels();
    let (found, mixed) = if count == 1 {
        let channels = if is_spectral { PRIMARIES.0.len() } else { 3 };
        (Channels::Rgb, Mixed::grey(brdf, channels))
    } else {
        let (found, places) = spectrum::channels(names, count)?;
        let mixed = match (&found, is_spectral) {
            (Channels::Rgb, true) => Mixed::upsampled(brdf, &places),
            _ => Mixed::selected(brdf, &places),
        };
        (found, mixed)
    };
    let channels = match (found, is_spectral) {
        (Channels::Rgb, true) => Channels::Spectrum(PRIMARIES.0.to_vec()),
        (Channels::Spectrum(_), false) => {
            return Err(super::ExportError::Colours { channels: count }.into());
        }
        (found, _) => found,
    };
    Ok(encode(&mixed, &channels, about, resolution)?)
}
