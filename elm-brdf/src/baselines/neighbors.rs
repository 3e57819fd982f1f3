//! Nearest neighbours and inverse distance weighting.

use elm_datasets::brdf::EvalError;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, ArrayViewMut2};

use super::inputs::{Frame, squared_distances};
use crate::error::{Error, Result};
use crate::features::Features;
use crate::fit::{Fit, Model, assign};
use crate::target_transform::TargetTransform;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;

/// The mean of the targets at the nearest nodes, each weighted by $r^{-p}$ of its distance $r$
/// over standardised inputs; at a node itself its own target.
///
/// The power $p$ is the one of 1 to 8 with the smallest leave-one-out error in the target, per
/// channel.
///
/// D. Shepard, *A Two-Dimensional Interpolation Function for Irregularly-Spaced Data*, 1968.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbors {
    /// Inputs.
    pub features: Features,
    /// Target.
    pub transform: TargetTransform,
    /// How many neighbours, at least 1; all nodes where there are fewer.
    pub count: usize,
}

const POWERS: std::ops::RangeInclusive<i32> = 1..=8;

/// The most rows that leave-one-out is measured on, evenly spread over all.
const MAX_TRIALS: usize = 1000;

/// Measurements kept by [`Neighbors`].
pub struct NeighborsModel {
    frame: Frame,
    count: usize,
    nodes: Array2<f64>,
    /// Shape (nodes, channels).
    targets: Array2<f64>,
    /// One per channel.
    powers: Vec<i32>,
}

impl Neighbors {
    /// A single neighbour.
    #[must_use]
    pub fn nearest(features: Features, transform: TargetTransform) -> Self {
        Self {
            features,
            transform,
            count: 1,
        }
    }
}

impl Fit for Neighbors {
    type Model = NeighborsModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        if self.count == 0 {
            return Err(Error::Parameter {
                name: "number of neighbours",
                value: 0.0,
                expected: "at least 1",
            });
        }
        let (frame, nodes, targets) = Frame::fit(self.features, self.transform, pairs, values)?;
        let powers = if self.count == 1 {
            vec![*POWERS.start(); targets.ncols()]
        } else {
            best_powers(&nodes, &targets, self.count)
        };
        Ok(NeighborsModel {
            frame,
            count: self.count,
            nodes,
            targets,
            powers,
        })
    }
}

/// The power of the smallest leave-one-out error, for each column of targets.
fn best_powers(nodes: &Array2<f64>, targets: &Array2<f64>, count: usize) -> Vec<i32> {
    let step = nodes.nrows().div_ceil(MAX_TRIALS);
    let mut best = vec![(f64::INFINITY, *POWERS.start()); targets.ncols()];
    let mut errors = Array2::<f64>::zeros((POWERS.count(), targets.ncols()));
    for row in (0..nodes.nrows()).step_by(step) {
        let point = nodes.row(row).insert_axis(ndarray::Axis(0)).to_owned();
        let distances = squared_distances(&point, nodes);
        let near = nearest(distances.row(0), count, Some(row));
        for (mut errors, power) in errors.rows_mut().into_iter().zip(POWERS) {
            let predicted = weighted(&near, targets, power);
            let wrong = &predicted - &targets.row(row);
            errors += &(&wrong * &wrong);
        }
    }
    for (errors, power) in errors.rows().into_iter().zip(POWERS) {
        for (best, &error) in best.iter_mut().zip(errors) {
            if error < best.0 {
                *best = (error, power);
            }
        }
    }
    best.into_iter().map(|(_, power)| power).collect()
}

/// Rows and squared distances of the `count` nearest nodes, one left out.
fn nearest(
    distances: ArrayView1<'_, f64>,
    count: usize,
    without: Option<usize>,
) -> Vec<(usize, f64)> {
    let mut near: Vec<(usize, f64)> = distances
        .iter()
        .copied()
        .enumerate()
        .filter(|&(row, _)| Some(row) != without)
        .collect();
    if near.len() > count {
        // Of equally far ones the first, so that the choice does not depend on the algorithm.
        let order = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0));
        near.select_nth_unstable_by(count - 1, order);
        near.truncate(count);
    }
    near
}

/// The weighted mean of the targets of these nodes, of each column.
fn weighted(near: &[(usize, f64)], targets: &Array2<f64>, power: i32) -> Array1<f64> {
    let smallest = near.iter().map(|&(_, d)| d).fold(f64::INFINITY, f64::min);
    let mut sum = Array1::zeros(targets.ncols());
    let mut total = 0.0;
    for &(row, squared) in near {
        // Relative to the nearest, so that no distance over- or underflows.
        let weight = if squared == smallest {
            1.0
        } else {
            (smallest / squared).sqrt().powi(power)
        };
        sum.scaled_add(weight, &targets.row(row));
        total += weight;
    }
    if total > 0.0 { sum / total } else { sum }
}

impl NeighborsModel {
    fn values_at(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>> {
        let points = self.frame.points(pairs)?;
        let mut targets = Array2::zeros((pairs.len(), self.channels()));
        for (row, mut out) in targets.rows_mut().into_iter().enumerate() {
            let point = points.row(row).insert_axis(ndarray::Axis(0)).to_owned();
            let distances = squared_distances(&point, &self.nodes);
            let near = nearest(distances.row(0), self.count, None);
            for power in POWERS.filter(|power| self.powers.contains(power)) {
                let predicted = weighted(&near, &self.targets, power);
                for (channel, &of_channel) in self.powers.iter().enumerate() {
                    if of_channel == power {
                        out[channel] = predicted[channel];
                    }
                }
            }
        }
        self.frame.values(pairs, targets)
    }
}

impl Brdf for NeighborsModel {
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

impl Model for NeighborsModel {
    fn floats_per_channel(&self) -> usize {
        // Nodes and targets, and the power.
        self.nodes.len() + self.nodes.nrows() + 1 + self.frame.floats_per_channel()
    }
}
