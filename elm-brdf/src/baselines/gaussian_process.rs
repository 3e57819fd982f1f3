//! Gaussian process regression.

use elm_datasets::brdf::EvalError;
use ndarray::{Array1, Array2, ArrayView2, ArrayViewMut2, Axis};

use super::inputs::{Frame, squared_distances};
use super::kernel::{Projected, Weights, check_rows};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::fit::{Fit, Model, assign};
use crate::scales::spread;
use crate::target_transform::TargetTransform;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;

/// Correlation of the process at a distance $r$ in units of the length scales.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Covariance {
    /// $e^{-r^2/2}$: infinitely smooth.
    SquaredExponential,
    /// $(1 + \sqrt 5 r + 5 r^2 / 3) e^{-\sqrt 5 r}$: twice differentiable.
    Matern52,
    /// $(1 + \sqrt 3 r) e^{-\sqrt 3 r}$: once differentiable.
    Matern32,
}

impl Covariance {
    fn of_squared(self, squared: f64) -> f64 {
        match self {
            Self::SquaredExponential => (-0.5 * squared).exp(),
            Self::Matern52 => {
                let r = (5.0 * squared).sqrt();
                (1.0 + r + r * r / 3.0) * (-r).exp()
            }
            Self::Matern32 => {
                let r = (3.0 * squared).sqrt();
                (1.0 + r) * (-r).exp()
            }
        }
    }
}

/// A Gaussian process with a constant mean of unknown height, one length scale per input, and
/// noise.
///
/// Length scales and noise maximise the restricted likelihood, of each channel by itself. The
/// candidates for the length scales are a fixed low-discrepancy set, so that one decomposition
/// per candidate serves all channels; noise and height are exact on that.
///
/// C. Rasmussen, C. Williams, *Gaussian Processes for Machine Learning*, 2006, chapters 2 and 5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianProcess {
    /// Inputs.
    pub features: Features,
    /// Target.
    pub transform: TargetTransform,
    /// Correlation.
    pub covariance: Covariance,
    /// Number of candidates for the length scales, at least 1.
    pub candidates: usize,
}

/// Length scales tried, in standard deviations of the inputs.
const LENGTHS: (f64, f64) = (0.3, 20.0);

/// Variances of the noise tried, relative to that of the process: two to a decade. Below the
/// first the kernel matrix would be singular to working precision.
fn noises() -> impl Iterator<Item = f64> {
    (-16..=2).map(|step| 10.0_f64.powf(f64::from(step) / 2.0))
}

/// A fitted [`GaussianProcess`].
pub struct GaussianProcessModel {
    frame: Frame,
    covariance: Covariance,
    nodes: Array2<f64>,
    /// One process per candidate that some channel chose.
    processes: Vec<Process>,
}

struct Process {
    /// 1 / length scale of each input.
    scales: Array1<f64>,
    /// The channels that chose it.
    members: Vec<usize>,
    weights: Weights,
}

#[derive(Clone, Copy)]
struct Choice {
    likelihood: f64,
    candidate: usize,
    noise: f64,
}

impl GaussianProcess {
    /// Candidates for the length scales unless said otherwise: on CUReT twice as many gain 2 % of
    /// the error, half as many lose 8 %.
    pub const CANDIDATES: usize = 128;

    /// With Matérn's covariance of 5/2, the best of the three on CUReT.
    #[must_use]
    pub fn new(features: Features, transform: TargetTransform) -> Self {
        Self {
            features,
            transform,
            covariance: Covariance::Matern52,
            candidates: Self::CANDIDATES,
        }
    }

    fn kernel(&self, a: &Array2<f64>, b: &Array2<f64>) -> Array2<f64> {
        kernel(self.covariance, a, b)
    }
}

fn kernel(covariance: Covariance, a: &Array2<f64>, b: &Array2<f64>) -> Array2<f64> {
    squared_distances(a, b).mapv_into(|d| covariance.of_squared(d))
}

impl Fit for GaussianProcess {
    type Model = GaussianProcessModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        if self.candidates == 0 {
            return Err(Error::Parameter {
                name: "candidates",
                value: 0.0,
                expected: "at least 1",
            });
        }
        let (frame, x, targets) = Frame::fit(self.features, self.transform, pairs, values)?;
        check_rows("a Gaussian process", x.nrows())?;
        let mean = Array2::ones((x.nrows(), 1));
        let none = Choice {
            likelihood: f64::NEG_INFINITY,
            candidate: 0,
            noise: 1.0,
        };
        let mut choices = vec![none; targets.ncols()];
        // 1 / length scale of each input.
        let scales = spread(self.candidates, frame.inputs(), LENGTHS).mapv_into(f64::recip);
        let decompose = |candidate: usize| {
            let scaled = &x * &scales.row(candidate);
            let kernel = self.kernel(&scaled, &scaled);
            Ok::<_, Error>((Projected::new(kernel.clone(), mean.view())?, kernel))
        };
        for candidate in 0..self.candidates {
            let (projected, _) = decompose(candidate)?;
            let squared = projected.coordinates(targets.view()).mapv_into(|z| z * z);
            for noise in noises() {
                let likelihoods = projected.log_likelihood(squared.view(), noise);
                for (choice, &likelihood) in choices.iter_mut().zip(&likelihoods) {
                    if likelihood > choice.likelihood {
                        *choice = Choice {
                            likelihood,
                            candidate,
                            noise,
                        };
                    }
                }
            }
        }
        let mut processes = Vec::new();
        for candidate in 0..self.candidates {
            let members: Vec<usize> = (0..choices.len())
                .filter(|&channel| choices[channel].candidate == candidate)
                .collect();
            if members.is_empty() {
                continue;
            }
            let (projected, kernel) = decompose(candidate)?;
            let noise: Vec<f64> = members.iter().map(|&m| choices[m].noise).collect();
            let targets = targets.select(Axis(1), &members);
            processes.push(Process {
                scales: scales.row(candidate).to_owned(),
                weights: projected.weights(kernel.view(), targets.view(), &noise),
                members,
            });
        }
        Ok(GaussianProcessModel {
            frame,
            covariance: self.covariance,
            nodes: x,
            processes,
        })
    }
}

impl GaussianProcessModel {
    fn values_at(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>> {
        let x = self.frame.points(pairs)?;
        let mut targets = Array2::zeros((pairs.len(), self.channels()));
        for process in &self.processes {
            let (x, nodes) = (&x * &process.scales, &self.nodes * &process.scales);
            let predicted = kernel(self.covariance, &x, &nodes).dot(&process.weights.kernel)
                + &process.weights.tail;
            for (&member, column) in process.members.iter().zip(predicted.columns()) {
                targets.column_mut(member).assign(&column);
            }
        }
        self.frame.values(pairs, targets)
    }
}

impl Brdf for GaussianProcessModel {
    fn channels(&self) -> usize {
        self.frame.channels()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        assign(self.values_at(pairs)?, values)
    }
}

impl Model for GaussianProcessModel {
    fn floats_per_channel(&self) -> usize {
        // Nodes and their weights; length scales and mean.
        self.nodes.len()
            + self.nodes.nrows()
            + self.frame.inputs()
            + 1
            + self.frame.floats_per_channel()
    }
}
