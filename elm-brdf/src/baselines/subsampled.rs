//! Limits the number of measurements that a method is given.

use ndarray::{ArrayView2, Axis};
use rand::seq::index;

use crate::error::Result;
use crate::fit::{AnyFit, Fit, Model};
use crate::streams::{self, generator};
use elm_datasets::geometry::DirectionPair;

/// A method that is fitted to a random subset where there are more measurements than it can
/// afford: dense kernel matrices grow with the square of the rows, their decompositions with the
/// cube.
pub(crate) struct Subsampled {
    pub(crate) method: Box<AnyFit>,
    /// The most measurements that it is given.
    pub(crate) max_rows: usize,
    /// Seed of the subset.
    pub(crate) seed: u64,
}

impl Fit for Subsampled {
    type Model = Box<dyn Model>;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        if pairs.len() <= self.max_rows || pairs.len() != values.nrows() {
            return self.method.fit(pairs, values);
        }
        let mut random = generator(self.seed, streams::SUBSAMPLE);
        let mut rows = index::sample(&mut random, pairs.len(), self.max_rows).into_vec();
        rows.sort_unstable();
        let kept: Vec<DirectionPair> = rows.iter().map(|&row| pairs[row]).collect();
        self.method.fit(&kept, values.select(Axis(0), &rows).view())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::Neighbors;
    use crate::features::Features;
    use crate::fit::boxed;
    use crate::target_transform::TargetTransform;
    use elm_datasets::Brdf;
    use elm_datasets::geometry::cartesian;
    use ndarray::Array2;

    #[test]
    fn no_more_rows_than_allowed_are_used_and_the_seed_says_which() {
        let pairs: Vec<DirectionPair> = (0..50)
            .map(|i| DirectionPair {
                incident: cartesian(0.02 * f64::from(i), 0.0),
                outgoing: cartesian(0.5, 0.1 * f64::from(i)),
            })
            .collect();
        let values = Array2::from_shape_fn((50, 1), |(row, _)| row as f64);
        let fit = |max_rows, seed| {
            let method = boxed(Neighbors::nearest(
                Features::Cosines,
                TargetTransform::Identity,
            ));
            let subsampled = Subsampled {
                method,
                max_rows,
                seed,
            };
            let model = subsampled.fit(&pairs, values.view()).unwrap();
            model.eval(&pairs).unwrap()
        };
        // The nearest neighbour gives back a row's own value where the row was kept.
        let kept = |predicted: &Array2<f64>| {
            let same = predicted.iter().zip(&values).filter(|(a, b)| a == b);
            same.count()
        };
        assert_eq!(kept(&fit(50, 1)), 50);
        assert_eq!(kept(&fit(12, 1)), 12);
        assert_eq!(fit(12, 1), fit(12, 1));
        assert_ne!(fit(12, 1), fit(12, 2));
    }
}
