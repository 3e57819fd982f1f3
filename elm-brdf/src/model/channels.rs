//! Matches the channels of a model by name, colour or wavelength.

use elm::Elm;
use elm_datasets::color::SpectralColor;
use elm_datasets::{Samples, channel};
use ndarray::Axis;

use super::BrdfModel;
use crate::error::{Error, Result};
use elm_datasets::Brdf;

impl BrdfModel {
    /// A name for each channel: those of the measurements, or `channel 1` and so on where they have none.
    #[must_use]
    pub fn channel_names(&self) -> Vec<String> {
        let own = &self.provenance.channels;
        if own.len() == self.channels() {
            return own.clone();
        }
        let numbers = 1..=self.channels();
        numbers.map(|number| format!("channel {number}")).collect()
    }

    /// The samples with the channels of this model, in its order: matched by name, colour or
    /// wavelength. A model whose channels have no names takes them as they come.
    ///
    /// # Errors
    /// [`Error::ChannelNames`] for samples that lack one; [`Error::Shape`] for another number
    /// of channels than that of a model without names.
    pub fn matched(&self, samples: Samples) -> Result<Samples> {
        let own = &self.provenance.channels;
        if own.len() == self.channels() {
            return samples.matched(own).ok_or_else(|| Error::ChannelNames {
                model: channel::described(own),
                samples: channel::described(&samples.channels),
            });
        }
        if samples.channels.len() == self.channels() {
            return Ok(samples);
        }
        Err(Error::Shape {
            what: "channels of the samples",
            expected: self.channels(),
            found: samples.channels.len(),
        })
    }

    /// The model as red, green and blue: the [colours](elm_datasets::color) of a spectrum, else as
    /// [`in_rgb_order`](Self::in_rgb_order).
    ///
    /// # Errors
    /// [`Error::Data`] for a spectrum that has no colour.
    pub fn in_color(&self) -> Result<Self> {
        let names = &self.provenance.channels;
        let color = SpectralColor::of(names).map_err(elm_datasets::Error::from)?;
        match color.filter(|_| names.len() == self.channels()) {
            None => self.in_rgb_order(),
            Some(color) => {
                let mut provenance = self.provenance.clone();
                provenance.channels = SpectralColor::CHANNELS.map(str::to_owned).to_vec();
                Ok(Self {
                    transform: self.transform.colored(&color)?,
                    provenance,
                    ..self.clone()
                })
            }
        }
    }

    /// The model with red first, then green, then blue, where its three channels are called by
    /// colours or wavelengths; as it is where they are not.
    ///
    /// # Errors
    /// Those of [`Elm::from_parts`], for a network that none of this crate's makes.
    pub fn in_rgb_order(&self) -> Result<Self> {
        let places = match channel::rgb(&self.provenance.channels) {
            Some(places) if self.network.outputs() == 3 && places != [0, 1, 2] => places,
            _ => return Ok(self.clone()),
        };
        let network = Elm::from_parts(
            self.network.map().clone(),
            self.network.beta().select(Axis(1), &places),
            self.network.intercept().select(Axis(0), &places),
        )?;
        let mut provenance = self.provenance.clone();
        provenance.channels = places.map(|p| self.provenance.channels[p].clone()).to_vec();
        Ok(Self {
            transform: self.transform.select(&places),
            network,
            provenance,
            ..self.clone()
        })
    }
}
