//! Analytic models, fitted by least squares in 1/sr.

mod family;
mod nonnegative;
mod search;

use elm_datasets::brdf::EvalError;
use elm_datasets::lobes::Cosines;
use ndarray::{Array2, ArrayView2, ArrayViewMut2};

pub use family::{Analytic, Shape};
use family::{MAX_SHAPES, MAX_TERMS};
use search::Problem;

use crate::error::Result;
use crate::fit::{Fit, Model, assign, check};
use elm_datasets::Brdf;
use elm_datasets::brdf::check_directions;
use elm_datasets::geometry::DirectionPair;

/// Analytic models with the parameters found for each channel.
///
/// ```
/// use elm_datasets::Brdf;
/// use elm_datasets::geometry::{DirectionPair, cartesian};
/// use elm_brdf::baselines::Analytic;
/// use ndarray::Array2;
///
/// let pairs: Vec<DirectionPair> = (0..40)
///     .map(|i| DirectionPair {
///         incident: cartesian(0.03 * f64::from(i), 0.0),
///         outgoing: cartesian(0.5, 0.2 * f64::from(i)),
///     })
///     .collect();
/// let grey = Array2::from_elem((40, 1), 0.1);
/// let model = Analytic::GgxLambert.fit_analytic(&pairs, grey.view())?;
/// // All of it is diffuse: albedo 0.1 pi.
/// assert!((model.weights(0)[0] - 0.1 * std::f64::consts::PI).abs() < 1e-9);
/// # Ok::<(), elm_brdf::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct AnalyticModel {
    family: Analytic,
    channels: Vec<Parameters>,
}

/// The parameters of one channel; entries beyond those of the family are 0.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Parameters {
    shapes: [f64; MAX_SHAPES],
    weights: [f64; MAX_TERMS],
}

impl AnalyticModel {
    /// The shape parameters of a channel, in the order of [`Analytic::shapes`]; empty for a
    /// channel that does not exist.
    #[must_use]
    pub fn shapes(&self, channel: usize) -> &[f64] {
        self.channels
            .get(channel)
            .map_or(&[], |c| &c.shapes[..self.family.shapes().len()])
    }

    /// The weights of a channel's terms, in the order of [`Analytic::terms`]; empty for a channel
    /// that does not exist.
    #[must_use]
    pub fn weights(&self, channel: usize) -> &[f64] {
        self.channels
            .get(channel)
            .map_or(&[], |c| &c.weights[..self.family.terms().len()])
    }
}

impl Analytic {
    /// Fits the weights of the terms, which are not negative, and the shape parameters, which
    /// keep to their bounds, to `values` (BRDF in 1/sr, shape (pairs, channels)); each channel by
    /// itself.
    ///
    /// The weights are eliminated (variable projection: G. Golub, V. Pereyra, SIAM Journal on
    /// Numerical Analysis 10(2), 1973). The shapes start from the best points of a grid over
    /// their bounds and go down by Levenberg and Marquardt's method. Measurements below the
    /// horizon, which every model sees black, take no part.
    ///
    /// # Errors
    /// [`elm::Error`] naming measurements that are empty, not finite, or of other shapes.
    pub fn fit_analytic(
        self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
    ) -> Result<AnalyticModel> {
        check(pairs, values)?;
        let above: Vec<(usize, Cosines)> = pairs
            .iter()
            .enumerate()
            .filter_map(|(row, pair)| Some((row, Cosines::of(pair)?)))
            .collect();
        let angles: Vec<Cosines> = above.iter().map(|&(_, angles)| angles).collect();
        let problem = Problem::new(self, &angles);
        let channels = values.columns().into_iter().map(|column| {
            let measured: Vec<f64> = above.iter().map(|&(row, _)| column[row]).collect();
            let (shapes, weights) = problem.fit(&measured);
            Parameters { shapes, weights }
        });
        Ok(AnalyticModel {
            family: self,
            channels: channels.collect(),
        })
    }
}

impl Fit for Analytic {
    type Model = AnalyticModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        self.fit_analytic(pairs, values)
    }
}

impl AnalyticModel {
    fn values_at(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>> {
        check_directions(pairs)?;
        let mut out = Array2::zeros((pairs.len(), self.channels.len()));
        for (mut row, pair) in out.rows_mut().into_iter().zip(pairs) {
            let Some(angles) = Cosines::of(pair) else {
                continue;
            };
            for (value, channel) in row.iter_mut().zip(&self.channels) {
                let basis = self.family.basis(&angles, &channel.shapes);
                *value = basis.iter().zip(&channel.weights).map(|(b, w)| b * w).sum();
            }
        }
        Ok(out)
    }
}

impl Brdf for AnalyticModel {
    fn channels(&self) -> usize {
        self.channels.len()
    }

    fn is_isotropic(&self) -> bool {
        self.family.is_isotropic()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        assign(self.values_at(pairs)?, values)
    }
}

impl Model for AnalyticModel {
    fn floats_per_channel(&self) -> usize {
        self.family.shapes().len() + self.family.terms().len()
    }
}
