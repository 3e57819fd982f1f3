//! Transforms BRDF values into regression targets, and back.
//!
//! The way back is the plain inverse, so that a model of the mean target gives a BRDF a little below
//! its mean (Jensen's inequality): by $\sigma^2 / 2$ of it where $\sigma$ is the relative noise, and by
//! much more where the noise is as large as the values. [`Tuned`](crate::model::Tuned) therefore lays the
//! offset above the noise and fits the mean of the values; other models make no correction. (Measured on
//! CUReT with a Gaussian process of the log, held out: multiplying by Duan's smearing factor, JASA
//! 78(383), 1983, or by $e^{s^2/2}$ changes the RMSE by 0.5 % at most.)
//!
//! A [`TargetTransform`] is a setting. Fitted to the values of a training set it becomes a
//! [`FittedTransform`], which knows the scale of each channel and belongs to the model.
//!
//! ```
//! use elm_brdf::target_transform::TargetTransform;
//! use ndarray::array;
//!
//! let values = array![[0.0], [0.2], [40.0]];
//! let transform = TargetTransform::default_log().fit(values.view())?;
//! let targets = transform.to_targets(values.view())?;
//! let back = transform.to_values(targets)?;
//! assert!((&back - &values).iter().all(|error| error.abs() < 1e-12));
//! # Ok::<(), elm_brdf::Error>(())
//! ```

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

mod spectral;

use crate::basis::Basis;
use crate::error::{Error, Result};
use spectral::colors;

/// The regression target made of a BRDF value $f$.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum TargetTransform {
    /// The value itself, as in the paper; predictions may be negative.
    #[default]
    Identity,
    /// $\ln(1 + f/o)$, so that errors count relative to the value where it is far above $o$, and
    /// as they are where it is far below.
    Log {
        /// $o$ as a fraction of the median of the channel's positive training values; positive
        /// and finite.
        offset: f64,
    },
    /// $f^{1/3}$: between the two, and without a scale.
    CubeRoot,
}

impl TargetTransform {
    /// The names that [`FromStr`] reads.
    pub const NAMES: [&'static str; 3] = ["identity", "log", "cube-root"];

    /// A [`FittedTransform`] never returns more than this many times the largest value of its channel
    /// in the training set (identity excepted): where a log target is extrapolated, a small error
    /// of the target would else be a firefly, or infinite.
    pub const HEADROOM: f64 = 2.0;

    /// [`TargetTransform::Log`] with the offset at a tenth of the median.
    #[must_use]
    pub fn default_log() -> Self {
        Self::Log { offset: 0.1 }
    }

    /// The transform's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Identity => "identity",
            Self::Log { .. } => "log",
            Self::CubeRoot => "cube-root",
        }
    }

    /// Measures the scale of each channel of `values`, BRDF in 1/sr of shape (pairs, channels).
    ///
    /// # Errors
    /// [`Error::Parameter`] for an offset that is not positive and finite.
    pub fn fit(self, values: ArrayView2<'_, f64>) -> Result<FittedTransform> {
        if let Self::Log { offset } = self
            && !(offset > 0.0 && offset.is_finite())
        {
            return Err(Error::Parameter {
                name: "offset of the log transform",
                value: offset,
                expected: "positive and finite",
            });
        }
        let channels = values.columns().into_iter();
        Ok(FittedTransform {
            channels: channels.map(|values| self.channel(values)).collect(),
            basis: None,
            color: None,
        })
    }

    fn channel(self, values: ArrayView1<'_, f64>) -> Channel {
        let largest = values.iter().copied().fold(0.0, f64::max);
        let ceiling = (largest * Self::HEADROOM).min(f64::MAX);
        match self {
            Self::Identity => Channel::Identity,
            Self::CubeRoot => Channel::CubeRoot { ceiling },
            Self::Log { offset } => {
                let fraction = offset;
                let offset = fraction * median_of_positive(values).unwrap_or(1.0);
                Channel::Log {
                    // Dividing by a subnormal could overflow.
                    offset: offset.clamp(f64::MIN_POSITIVE, f64::MAX),
                    ceiling,
                }
            }
        }
    }
}

fn median_of_positive(values: ArrayView1<'_, f64>) -> Option<f64> {
    let mut positive: Vec<f64> = values.iter().copied().filter(|&v| v > 0.0).collect();
    let middle = positive.len() / 2;
    (!positive.is_empty()).then(|| *positive.select_nth_unstable_by(middle, f64::total_cmp).1)
}

impl fmt::Display for TargetTransform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for TargetTransform {
    type Err = Error;

    /// The transform of this name, with its default offset.
    fn from_str(name: &str) -> Result<Self> {
        match name {
            "identity" => Ok(Self::Identity),
            "log" => Ok(Self::default_log()),
            "cube-root" => Ok(Self::CubeRoot),
            _ => Err(Error::UnknownName {
                what: "transform",
                name: name.to_owned(),
                expected: Self::NAMES.join(", "),
            }),
        }
    }
}

/// A [`TargetTransform`] that knows the scale of each channel; of many channels, what their targets have in
/// common too, so that a network needs fewer outputs than there are channels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedTransform {
    channels: Vec<Channel>,
    /// What the network's outputs are coordinates in; the targets themselves without one.
    basis: Option<Basis>,
    /// What each channel adds to red, green and blue, where the values are colours of these channels.
    color: Option<Vec<[f64; 3]>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Channel {
    Identity,
    Log {
        /// In 1/sr.
        offset: f64,
        /// The largest value ever returned, in 1/sr.
        ceiling: f64,
    },
    CubeRoot {
        /// The largest value ever returned, in 1/sr.
        ceiling: f64,
    },
}

impl Channel {
    fn target(self, value: f64) -> f64 {
        match self {
            Self::Identity => value,
            // The quotient is finite unless the value is beyond 1e300 offsets.
            Self::Log { offset, .. } => (value / offset).clamp(-0.5, f64::MAX).ln_1p(),
            Self::CubeRoot { .. } => value.cbrt(),
        }
    }

    fn value(self, target: f64) -> f64 {
        let bounded = |value: f64, ceiling: f64| {
            if value.is_nan() {
                value
            } else {
                value.clamp(0.0, ceiling)
            }
        };
        match self {
            Self::Identity => target,
            Self::Log { offset, ceiling } => bounded(offset * target.exp_m1(), ceiling),
            Self::CubeRoot { ceiling } => bounded(target.powi(3), ceiling),
        }
    }
}

impl FittedTransform {
    /// Number of channels of the values.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.color.as_ref().map_or(self.channels.len(), |_| 3)
    }

    /// Number of outputs of a network: of the targets.
    #[must_use]
    pub fn outputs(&self) -> usize {
        let basis = self.basis.as_ref();
        basis.map_or(self.channels.len(), Basis::outputs)
    }

    /// The transform of each channel.
    pub(crate) fn by_channel(&self) -> &[Channel] {
        &self.channels
    }

    /// The transforms of these channels, in this order.
    pub(crate) fn select(&self, places: &[usize]) -> Self {
        let channels = places.iter().filter_map(|&place| self.channels.get(place));
        Self {
            channels: channels.copied().collect(),
            basis: None,
            color: None,
        }
    }

    /// Whether a transform from outside makes sense: every offset positive and finite, every ceiling
    /// finite and not negative.
    ///
    /// # Errors
    /// [`Error::Parameter`] for the first that is not.
    pub(crate) fn check(&self) -> Result<()> {
        let parameter = |name, value, expected| {
            Err(Error::Parameter {
                name,
                value,
                expected,
            })
        };
        self.check_shapes()?;
        for channel in &self.channels {
            let ceiling = match *channel {
                Channel::Identity => continue,
                Channel::Log { offset, .. } if !(offset > 0.0 && offset.is_finite()) => {
                    return parameter("offset of the transform", offset, "positive and finite");
                }
                Channel::Log { ceiling, .. } | Channel::CubeRoot { ceiling } => ceiling,
            };
            if !(ceiling >= 0.0 && ceiling.is_finite()) {
                return parameter(
                    "ceiling of the transform",
                    ceiling,
                    "finite and not negative",
                );
            }
        }
        Ok(())
    }

    /// The offset of each channel's logarithm, 0 where there is none.
    pub(crate) fn offsets(&self) -> Vec<f64> {
        let offset = |channel: &Channel| match *channel {
            Channel::Log { offset, .. } => offset,
            Channel::Identity | Channel::CubeRoot { .. } => 0.0,
        };
        self.channels.iter().map(offset).collect()
    }

    /// Raises the offset of each channel's logarithm to three standard deviations of its noise, in
    /// 1/sr, where it is less than half of that: there a logarithm has nothing to resolve, and makes noise
    /// of one size one of all sizes. Of each channel by what factor, 1 where it was left.
    pub(crate) fn raise_offsets(&mut self, noise: &[f64]) -> Vec<f64> {
        let raise = |(channel, noise): (&mut Channel, &f64)| {
            let floor = 3.0 * noise;
            match channel {
                Channel::Log { offset, .. } if floor > 2.0 * *offset && floor.is_finite() => {
                    let factor = floor / *offset;
                    *offset = floor;
                    factor
                }
                _ => 1.0,
            }
        };
        self.channels.iter_mut().zip(noise).map(raise).collect()
    }

    /// Targets that fitted ones `fitted` must be moved to for the mean of the **values** to be met, to
    /// first order: of a logarithm $t$ that is $t + (y - f) / (f + o)$, where $y$ is the value and $f$ that
    /// of $t$. Where a value is more than $e$ times as large as fitted the logarithm takes over, lest one
    /// value decide.
    pub(crate) fn working_targets(
        &self,
        fitted: ArrayView2<'_, f64>,
        values: ArrayView2<'_, f64>,
    ) -> Result<Array2<f64>> {
        let fitted = self.in_channels(fitted);
        let mut working = self.map(values.to_owned(), Channel::target)?;
        for ((mut working, fitted), (values, channel)) in working
            .columns_mut()
            .into_iter()
            .zip(fitted.columns())
            .zip(values.columns().into_iter().zip(&self.channels))
        {
            let Channel::Log { offset, .. } = *channel else {
                continue;
            };
            for ((working, &fitted), &value) in working.iter_mut().zip(fitted).zip(values) {
                let ratio = (value + offset) / (offset * fitted.exp());
                let residual = if ratio <= std::f64::consts::E {
                    ratio - 1.0
                } else {
                    std::f64::consts::E - 2.0 + ratio.ln()
                };
                *working = fitted + residual.max(-2.0);
            }
        }
        Ok(self.project(working))
    }

    /// Numbers kept for each channel alone.
    pub(crate) fn floats_per_channel(&self) -> usize {
        let own = match self.channels.first() {
            None | Some(Channel::Identity) => 0,
            Some(Channel::CubeRoot { .. }) => 1,
            Some(Channel::Log { .. }) => 2,
        };
        let basis = self.basis.as_ref().map_or(0, |basis| 1 + basis.outputs());
        own + basis + self.color.as_ref().map_or(0, |_| 3)
    }

    /// Numbers kept for all channels.
    pub(crate) fn floats(&self) -> usize {
        self.channels.len() * self.floats_per_channel()
    }

    /// Targets for BRDF values in 1/sr, shape (pairs, channels).
    ///
    /// Negative values, which noise makes of dark ones, go on as the logarithm does, down to half of
    /// the offset below 0.
    ///
    /// # Errors
    /// [`Error::Shape`] for another number of channels than the transform was fitted to; [`Error::Conflict`]
    /// where values are colours, which no spectrum follows from.
    pub fn to_targets(&self, values: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        if self.color.is_some() {
            return Err(Error::Conflict {
                first: "colours of a spectrum",
                second: "targets of a fit",
            });
        }
        Ok(self.project(self.map(values.to_owned(), Channel::target)?))
    }

    /// BRDF values in 1/sr for predicted targets, shape (pairs, outputs).
    ///
    /// Unless the transform is the identity they are not negative and at most
    /// [`TargetTransform::HEADROOM`] times the largest value that the transform was fitted to. A target that
    /// is NaN stays NaN.
    ///
    /// # Errors
    /// [`Error::Shape`] for another number of channels than the transform was fitted to.
    pub fn to_values(&self, targets: Array2<f64>) -> Result<Array2<f64>> {
        if targets.ncols() != self.outputs() {
            return Err(wrong_channels(self.outputs(), targets.ncols()));
        }
        self.values_of_channels(self.expand(targets))
    }

    /// BRDF values for the targets of all channels.
    pub(crate) fn values_of_channels(&self, targets: Array2<f64>) -> Result<Array2<f64>> {
        let values = self.map(targets, Channel::value)?;
        Ok(match &self.color {
            None => values,
            Some(weights) => colors(&values, weights),
        })
    }

    fn map(&self, mut matrix: Array2<f64>, f: fn(Channel, f64) -> f64) -> Result<Array2<f64>> {
        if matrix.ncols() != self.channels.len() {
            return Err(wrong_channels(self.channels.len(), matrix.ncols()));
        }
        for (mut column, &channel) in matrix.columns_mut().into_iter().zip(&self.channels) {
            column.mapv_inplace(|entry| f(channel, entry));
        }
        Ok(matrix)
    }
}

fn wrong_channels(expected: usize, found: usize) -> Error {
    Error::Shape {
        what: "channels of the transform",
        expected,
        found,
    }
}

#[cfg(test)]
mod tests;
