//! How many neurons the limits on stored numbers leave.

use super::Tuned;
use crate::error::{Error, Result};
use crate::target_transform::FittedTransform;

/// How many channels values have, and how many outputs a network has for them.
#[derive(Clone, Copy)]
pub(super) struct Width {
    pub(super) channels: usize,
    pub(super) outputs: usize,
}

impl Width {
    pub(super) fn of(transform: &FittedTransform) -> Self {
        Self {
            channels: transform.channels(),
            outputs: transform.outputs(),
        }
    }
}

impl Tuned {
    /// The most numbers to be stored: what is asked for, or what was measured, or of many half of it;
    /// `None` where the neurons are given and the numbers are not.
    fn most_floats(&self, rows: usize, channels: usize) -> Option<usize> {
        let measured = rows * channels;
        let warranted = if measured > 1000 {
            measured / 2
        } else {
            measured
        };
        match (self.max_floats, self.neurons) {
            (None, None) => Some(warranted),
            (asked, _) => asked,
        }
    }

    /// The neurons that the limits allow, or `usual`. `drawn(n)` is the number of candidates
    /// drawn to keep n; which of them are kept costs a bit each.
    pub(super) fn size(
        &self,
        usual: usize,
        rows: usize,
        inputs: usize,
        Width { channels, outputs }: Width,
        drawn: impl Fn(usize) -> usize,
    ) -> Result<usize> {
        let wanted = self.neurons.unwrap_or(usual);
        let Some(most) = self.most_floats(rows, channels) else {
            return Ok(wanted);
        };
        // Of fewer outputs than channels a mean, and a part of every axis, of each channel.
        let basis = if outputs < channels { 1 + outputs } else { 0 };
        // Mean, factor and scale of each input; constant of each output, transform of each channel.
        let fixed = 3 * inputs + outputs + channels * (2 + basis);
        let floats = |neurons: usize| fixed + outputs * neurons + drawn(neurons).div_ceil(32);
        let largest = match (self.neurons, self.max_floats) {
            (Some(neurons), _) => neurons,
            (None, Some(most)) => most / outputs,
            (None, None) => usual,
        };
        let found = (1..=largest).rev().find(|&neurons| floats(neurons) <= most);
        // Of few measurements the scales leave nothing: one neuron for each then.
        let least = rows.min(Self::FEWEST).min(usual);
        match (found, self.max_floats) {
            (Some(neurons), None) if self.neurons.is_none() => Ok(neurons.max(least)),
            (Some(neurons), _) => Ok(neurons),
            (None, None) => Ok(least),
            (None, Some(_)) => Err(Error::Parameter {
                name: "max_floats",
                value: most as f64,
                expected: "enough for input scales, one neuron and a few numbers for each channel: about 20 or more",
            }),
        }
    }
}
