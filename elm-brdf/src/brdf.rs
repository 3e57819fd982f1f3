//! What every reflectance model here can do, and what can make one from measurements.

use std::any::Any;

use ndarray::{Array2, ArrayView2, Axis};

use crate::error::{Error, Result};
use elm_datasets::geometry::Pair;

/// A reflectance model, possibly of several channels, or of several materials side by side.
///
/// The value of one pair does not depend on the other pairs of a batch, bit for bit.
pub trait Brdf: Any + Send + Sync {
    /// Number of values per pair of directions.
    fn channels(&self) -> usize;

    /// Multiplications and additions that one pair costs in matrix products; 0 for a formula.
    fn multiply_adds(&self) -> usize {
        0
    }

    /// BRDF in 1/sr, without the cosine, at each pair of directions: shape (pairs, channels).
    ///
    /// # Errors
    /// Where a value cannot be computed, such as for a direction that is not finite.
    fn eval(&self, pairs: &[Pair]) -> Result<Array2<f64>>;

    /// Numbers that must be stored to evaluate one channel, the largest where channels differ:
    /// coefficients, scales and measurements kept, but nothing that a seed regenerates.
    fn floats_per_channel(&self) -> usize;

    /// Numbers that must be stored to evaluate all channels: those of each, unless the model knows
    /// what its channels share.
    fn stored_floats(&self) -> usize {
        self.channels() * self.floats_per_channel()
    }
}

/// A way to make a [`Brdf`] from measurements.
pub trait Fit {
    /// Fits `values` (BRDF in 1/sr, shape (pairs, channels)) measured at `pairs`.
    ///
    /// Channels are independent of each other and may be those of many materials: what they
    /// share, such as the factorisation of a hidden-layer matrix, is then done once.
    ///
    /// # Errors
    /// Where these measurements cannot be fitted.
    fn fit(&self, pairs: &[Pair], values: ArrayView2<'_, f64>) -> Result<Box<dyn Brdf>>;

    /// What the fit without each fold predicts at **all** pairs, those of the fold and those that
    /// it was fitted to: one array of shape (pairs, channels) per fold. `folds` has the fold of
    /// each pair, below `count`; `done` is told after each fold how many there have been.
    ///
    /// Refits fold by fold, unless a method knows a shorter way.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit) and of [`Brdf::eval`].
    fn cross_fits(
        &self,
        pairs: &[Pair],
        values: ArrayView2<'_, f64>,
        folds: &[usize],
        count: usize,
        done: &mut dyn FnMut(usize),
    ) -> Result<Vec<Array2<f64>>> {
        let without = |fold: usize| {
            let other = |row: &usize| folds.get(*row) != Some(&fold);
            let left: Vec<usize> = (0..pairs.len()).filter(other).collect();
            let left_pairs: Vec<Pair> = left.iter().map(|&row| pairs[row]).collect();
            let model = self.fit(&left_pairs, values.select(Axis(0), &left).view())?;
            let predicted = model.eval(pairs)?;
            done(fold + 1);
            Ok(predicted)
        };
        (0..count).map(without).collect()
    }
}

/// What every method asks of measurements: at least one, one row of values per pair of
/// directions, and all numbers finite.
pub(crate) fn check(pairs: &[Pair], values: ArrayView2<'_, f64>) -> Result<()> {
    if values.is_empty() {
        return Err(Error::Empty {
            what: "measurements",
            rows: values.nrows(),
            columns: values.ncols(),
        });
    }
    if values.nrows() != pairs.len() {
        return Err(Error::Shape {
            what: "rows of values",
            expected: pairs.len(),
            found: values.nrows(),
        });
    }
    if let Some(((row, column), _)) = values.indexed_iter().find(|(_, v)| !v.is_finite()) {
        return Err(Error::NotFinite {
            what: "measurements",
            row,
            column,
        });
    }
    check_directions(pairs)
}

/// All components finite; in the error, columns count those of the light, then the viewer's.
pub(crate) fn check_directions(pairs: &[Pair]) -> Result<()> {
    for (row, pair) in pairs.iter().enumerate() {
        let mut components = pair.incident.iter().chain(&pair.outgoing);
        if let Some(column) = components.position(|c| !c.is_finite()) {
            return Err(Error::NotFinite {
                what: "directions",
                row,
                column,
            });
        }
    }
    Ok(())
}
