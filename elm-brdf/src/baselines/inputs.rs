//! Standardised inputs and transformed targets, as all interpolators use them.

use elm::Scaler;
use ndarray::{Array2, ArrayView1, ArrayView2, Axis};

use crate::error::Result;
use crate::features::Features;
use crate::fit::check;
use crate::target_transform::{FittedTransform, TargetTransform};
use elm_datasets::brdf::check_directions;
use elm_datasets::geometry::DirectionPair;

/// From directions to points in a space where distance means something, and from predicted
/// targets to reflectance.
pub(super) struct Frame {
    features: Features,
    transform: FittedTransform,
    scaler: Scaler<f64>,
}

impl Frame {
    /// Measures inputs and targets of the training rows; returns them too, shapes (rows, inputs)
    /// and (rows, channels).
    pub(super) fn fit(
        features: Features,
        transform: TargetTransform,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
    ) -> Result<(Self, Array2<f64>, Array2<f64>)> {
        check(pairs, values)?;
        let transform = transform.fit(values)?;
        let targets = transform.to_targets(values)?;
        let raw = features.compute_training(pairs);
        let frame = Self {
            features,
            transform,
            scaler: Scaler::measured(&raw)?,
        };
        let x = frame.standardize(raw);
        Ok((frame, x, targets))
    }

    fn standardize(&self, raw: Array2<f64>) -> Array2<f64> {
        (raw - self.scaler.mean()) * self.scaler.factor()
    }

    /// Points of these directions, shape (pairs, inputs).
    ///
    /// # Errors
    /// For a direction that is not finite.
    pub(super) fn points(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>> {
        check_directions(pairs)?;
        Ok(self.standardize(self.features.compute(pairs)))
    }

    /// Reflectance for predicted targets: not negative, and black below the horizon.
    pub(super) fn values(
        &self,
        pairs: &[DirectionPair],
        targets: Array2<f64>,
    ) -> Result<Array2<f64>> {
        let mut values = self.transform.to_values(targets)?;
        for (mut row, pair) in values.rows_mut().into_iter().zip(pairs) {
            let above = pair.is_above_horizon();
            row.mapv_inplace(|value| if above { value.max(0.0) } else { 0.0 });
        }
        Ok(values)
    }

    pub(super) fn channels(&self) -> usize {
        self.transform.channels()
    }

    pub(super) fn inputs(&self) -> usize {
        self.scaler.mean().len()
    }

    /// Numbers kept for each channel.
    pub(super) fn floats_per_channel(&self) -> usize {
        2 * self.inputs() + self.transform.floats_per_channel()
    }
}

/// Squared Euclidean distance.
pub(super) fn squared_distance(a: ArrayView1<'_, f64>, b: ArrayView1<'_, f64>) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Squared distances between the rows of `a` and those of `b`, shape (rows of a, rows of b).
pub(super) fn squared_distances(a: &Array2<f64>, b: &Array2<f64>) -> Array2<f64> {
    Array2::from_shape_fn((a.nrows(), b.nrows()), |(i, j)| {
        squared_distance(a.row(i), b.row(j))
    })
}

/// Rows of `x` that lie at the same point joined into one with the mean of their targets.
///
/// Exact interpolation through two values at one point has no answer, and measurements that
/// differ only by exchanging light and viewer are one point of a reciprocal set of inputs.
pub(super) fn join_duplicates(
    x: &Array2<f64>,
    targets: &Array2<f64>,
) -> (Array2<f64>, Array2<f64>) {
    // Rounding of standardised inputs is some 1e-15; measured directions differ by far more.
    let same = 1e-8;
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for row in 0..x.nrows() {
        match groups
            .iter_mut()
            .find(|group| squared_distance(x.row(row), x.row(group[0])) <= same)
        {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
    }
    let first: Vec<usize> = groups.iter().map(|group| group[0]).collect();
    let mut joined = Array2::zeros((groups.len(), targets.ncols()));
    for (mut mean, group) in joined.rows_mut().into_iter().zip(&groups) {
        for &row in group {
            mean.scaled_add(1.0 / group.len() as f64, &targets.row(row));
        }
    }
    (x.select(Axis(0), &first), joined)
}
