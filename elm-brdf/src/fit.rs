//! The traits of fitting: a method ([`Fit`]) makes a [`Model`] from measurements.

use std::sync::atomic::{AtomicUsize, Ordering};

use elm::advanced::parallel_map;
use elm_datasets::Brdf;
use elm_datasets::brdf::{ArgumentError, EvalError};
use elm_datasets::geometry::DirectionPair;
use ndarray::{Array2, ArrayView2, ArrayViewMut2, Axis};

use crate::error::{Error, Result};

/// A fitted reflectance model: a [`Brdf`] that says what it costs.
pub trait Model: Brdf {
    /// Multiplications and additions that one pair costs in matrix products; 0 for a formula.
    fn multiply_adds(&self) -> usize {
        0
    }

    /// Numbers that must be stored to evaluate one channel, the largest where channels differ:
    /// coefficients, scales and measurements kept, but nothing that a seed regenerates.
    fn floats_per_channel(&self) -> usize;

    /// Numbers that must be stored to evaluate all channels: those of each, unless the model knows
    /// what its channels share.
    fn stored_floats(&self) -> usize {
        self.channels() * self.floats_per_channel()
    }
}

impl<M: Model + ?Sized> Model for Box<M> {
    fn multiply_adds(&self) -> usize {
        (**self).multiply_adds()
    }

    fn floats_per_channel(&self) -> usize {
        (**self).floats_per_channel()
    }

    fn stored_floats(&self) -> usize {
        (**self).stored_floats()
    }
}

/// A way to make a [`Model`] from measurements.
pub trait Fit: Send + Sync {
    /// What it makes.
    type Model: Model;

    /// Fits `values` (BRDF in 1/sr, shape (pairs, channels)) measured at `pairs`.
    ///
    /// Channels are independent of each other and may be those of many materials: what they
    /// share, such as the factorisation of a hidden-layer matrix, is then done once.
    ///
    /// # Errors
    /// Where these measurements cannot be fitted.
    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model>;

    /// What the fit without each fold predicts at **all** pairs, those of the fold and those that
    /// it was fitted to: one array of shape (pairs, channels) per fold. `folds` has the fold of
    /// each pair, below `count`; `done` is told after each fold how many there have been.
    ///
    /// Refits fold by fold, several at a time on several [threads](elm::on_threads), unless a method knows a
    /// shorter way.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit) and of [`Brdf::eval`].
    fn cross_fits(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
        folds: &[usize],
        count: usize,
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<Vec<Array2<f64>>> {
        let finished = AtomicUsize::new(0);
        let without = |fold: usize| {
            let other = |row: &usize| folds.get(*row) != Some(&fold);
            let left: Vec<usize> = (0..pairs.len()).filter(other).collect();
            let left_pairs: Vec<DirectionPair> = left.iter().map(|&row| pairs[row]).collect();
            let model = self.fit(&left_pairs, values.select(Axis(0), &left).view())?;
            let predicted = model.eval(pairs)?;
            done(finished.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(predicted)
        };
        let fits = parallel_map((0..count).collect(), without);
        fits.into_iter().collect()
    }
}

/// Any method, whose models are of types that differ.
pub type AnyFit = dyn Fit<Model = Box<dyn Model>>;

/// A method as one of [any](AnyFit) type.
pub fn boxed<F: Fit + 'static>(method: F) -> Box<AnyFit> {
    Box::new(Boxed(method))
}

struct Boxed<F>(F);

impl<F: Fit + 'static> Fit for Boxed<F> {
    type Model = Box<dyn Model>;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        Ok(Box::new(self.0.fit(pairs, values)?))
    }

    fn cross_fits(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
        folds: &[usize],
        count: usize,
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<Vec<Array2<f64>>> {
        self.0.cross_fits(pairs, values, folds, count, done)
    }
}

/// What every method asks of measurements: at least one, one row of values per pair of
/// directions, and all numbers finite.
pub(crate) fn check(pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<()> {
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
    Ok(elm_datasets::brdf::check_directions(pairs)?)
}

/// Puts values that were computed where [`Brdf::eval_into`] wants them.
pub(crate) fn assign(
    found: Array2<f64>,
    mut values: ArrayViewMut2<'_, f64>,
) -> Result<(), EvalError> {
    if found.dim() != values.dim() {
        return Err(EvalError::new(ArgumentError::Shape {
            expected: found.dim(),
            found: values.dim(),
        }));
    }
    values.assign(&found);
    Ok(())
}
