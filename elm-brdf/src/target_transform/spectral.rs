//! Transforms of many channels: their basis, and the colors of a spectrum.

use elm_datasets::color::SpectralColor;
use ndarray::{Array2, ArrayView2};

use super::{FittedTransform, wrong_channels};
use crate::basis::Basis;
use crate::error::Result;

impl FittedTransform {
    /// The same whose targets are coordinates in a basis of the targets of all channels.
    pub(crate) fn with_basis(&self, basis: Basis) -> Self {
        Self {
            basis: Some(basis),
            ..self.clone()
        }
    }

    /// The same whose targets are those of all channels.
    pub(crate) fn plain(&self) -> Self {
        Self {
            basis: None,
            ..self.clone()
        }
    }

    pub(crate) fn basis(&self) -> Option<&Basis> {
        self.basis.as_ref()
    }

    /// What each channel adds to red, green and blue, where values are colors.
    pub(crate) fn color(&self) -> Option<&[[f64; 3]]> {
        self.color.as_deref()
    }

    /// The same whose values are the colors of the channels.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) for colors of another number of channels.
    pub(crate) fn colored(&self, color: &SpectralColor) -> Result<Self> {
        let weights = color.weights();
        if weights.len() != self.channels.len() {
            return Err(wrong_channels(self.channels.len(), weights.len()));
        }
        Ok(Self {
            color: Some(weights.to_vec()),
            ..self.clone()
        })
    }

    /// The targets of all channels at the outputs of a network.
    pub(crate) fn in_channels(&self, outputs: ArrayView2<'_, f64>) -> Array2<f64> {
        self.expand(outputs.to_owned())
    }

    pub(super) fn expand(&self, outputs: Array2<f64>) -> Array2<f64> {
        match &self.basis {
            Some(basis) => basis.expand(&outputs),
            None => outputs,
        }
    }

    /// What the outputs of a network should be for targets of all channels.
    pub(crate) fn project(&self, targets: Array2<f64>) -> Array2<f64> {
        match &self.basis {
            Some(basis) => basis.project(&targets),
            None => targets,
        }
    }

    /// Whether basis and color are of as many channels as there are.
    pub(super) fn check_shapes(&self) -> Result<()> {
        let channels = self.channels.len();
        if let Some(basis) = &self.basis {
            basis.check()?;
            if basis.channels() != channels {
                return Err(wrong_channels(channels, basis.channels()));
            }
        }
        match &self.color {
            Some(weights) if weights.len() != channels => {
                Err(wrong_channels(channels, weights.len()))
            }
            _ => Ok(()),
        }
    }
}

/// Red, green and blue of spectra, what is negative cut off.
pub(super) fn colors(values: &Array2<f64>, weights: &[[f64; 3]]) -> Array2<f64> {
    let mut colors = Array2::zeros((values.nrows(), 3));
    for (mut to, from) in colors.rows_mut().into_iter().zip(values.rows()) {
        for (value, weights) in from.iter().zip(weights) {
            for (sum, weight) in to.iter_mut().zip(weights) {
                *sum += value * weight;
            }
        }
        to.mapv_inplace(|part| if part < 0.0 { 0.0 } else { part });
    }
    colors
}
