//! What every reflectance model here can do, and what can make one from measurements.

use ndarray::{Array2, ArrayView2};

use crate::error::Result;
use crate::geometry::Pair;

/// A reflectance model, possibly of several channels, or of several materials side by side.
///
/// The value of one pair does not depend on the other pairs of a batch, bit for bit.
pub trait Brdf: Send + Sync {
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
}
