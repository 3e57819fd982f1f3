//! How a model's file keeps its hidden layer: as what draws it again, wherever that can be.

use elm::advanced::{FeatureMapParams, HiddenLayer};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// A random layer that is drawn again from its settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// The settings, seed included.
    pub params: FeatureMapParams<f64>,
    /// For each neuron drawn whether it was kept; all of them without this.
    pub kept: Option<Vec<bool>>,
    /// Numbers among the settings that were chosen for the data: the scales of inputs.
    pub scales: usize,
}

/// Where a hidden layer comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layer {
    /// Draws whose neurons stand side by side.
    Drawn(Vec<Draw>),
    /// Weights that no seed gives, as those laid on training rows.
    Stored(HiddenLayer<f64>),
}

impl Layer {
    /// The layer that a fit with these settings has drawn.
    pub(crate) fn of(params: &FeatureMapParams<f64>, drawn: &HiddenLayer<f64>) -> Self {
        match params.draw(drawn.inputs()) {
            Ok(layer) if layer == *drawn => Self::Drawn(vec![Draw {
                params: params.clone(),
                kept: None,
                scales: 0,
            }]),
            _ => Self::Stored(drawn.clone()),
        }
    }

    /// The layer of `neurons` neurons for this many inputs.
    ///
    /// # Errors
    /// [`Error`] for settings out of range, or of another number of neurons.
    pub(crate) fn hidden(&self, inputs: usize, neurons: usize) -> Result<HiddenLayer<f64>> {
        let draws = match self {
            Self::Stored(layer) => return Ok(layer.clone()),
            Self::Drawn(draws) => draws,
        };
        // Before anything is drawn: a file says how many there are, and it may lie.
        let count = draws.iter().fold(0_usize, |sum, draw| {
            sum.saturating_add(draw.kept.as_ref().map_or_else(
                || draw.params.neurons(),
                |kept| kept.iter().filter(|&&k| k).count(),
            ))
        });
        check("neurons of the layer", neurons, count)?;
        let mut layers = Vec::new();
        for draw in draws {
            if let Some(kept) = &draw.kept {
                check(
                    "neurons that may be kept",
                    kept.len(),
                    draw.params.neurons(),
                )?;
            }
            let layer = draw.params.draw(inputs)?;
            layers.push(match &draw.kept {
                None => layer,
                Some(kept) => {
                    let numbers = kept.iter().enumerate().filter(|(_, kept)| **kept);
                    layer.subset(&numbers.map(|(number, _)| number).collect::<Vec<_>>())?
                }
            });
        }
        Ok(HiddenLayer::joined(&layers)?)
    }

    /// Numbers that must be kept.
    pub(crate) fn stored_floats(&self) -> usize {
        match self {
            Self::Stored(layer) => layer.weights().len() + layer.biases().len(),
            Self::Drawn(draws) => draws
                .iter()
                .map(|draw| {
                    let bits = draw.kept.as_ref().map_or(0, Vec::len);
                    draw.scales + bits.div_ceil(32)
                })
                .sum(),
        }
    }
}

fn check(what: &'static str, expected: usize, found: usize) -> Result<()> {
    if expected == found {
        Ok(())
    } else {
        Err(Error::Shape {
            what,
            expected,
            found,
        })
    }
}
