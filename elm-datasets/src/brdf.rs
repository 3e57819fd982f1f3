//! [`Brdf`], the interface of every reflectance model and every measured table.

use std::any::Any;
use std::error::Error;
use std::fmt;
use std::sync::Arc;

use ndarray::{Array2, ArrayViewMut2};

use crate::geometry::DirectionPair;

/// Why a value could not be computed: an error of whatever crate the [`Brdf`] is of.
#[derive(Debug)]
pub struct EvalError(Box<dyn Error + Send + Sync>);

impl EvalError {
    /// The error of an evaluation.
    pub fn new(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self(error.into())
    }

    /// The error itself, where it is of this type.
    ///
    /// # Errors
    /// This, where it is not.
    pub fn downcast<E: Error + 'static>(self) -> Result<E, Self> {
        self.0.downcast().map(|error| *error).map_err(Self)
    }
}

impl fmt::Display for EvalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Error for EvalError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.0.source()
    }
}

impl From<ArgumentError> for EvalError {
    fn from(error: ArgumentError) -> Self {
        Self::new(error)
    }
}

/// A reflectance, possibly of several channels, or of several materials side by side.
///
/// The value of one pair does not depend on the other pairs of a batch, bit for bit.
///
/// ```
/// use elm_datasets::geometry::{DirectionPair, cartesian};
/// use elm_datasets::{Brdf, lobes::Formula};
///
/// let paint = Formula::lambert(0.5)?;
/// let pair = DirectionPair { incident: cartesian(0.3, 0.0), outgoing: cartesian(0.8, 2.0) };
/// let values = paint.eval(&[pair])?;
/// assert_eq!(values.dim(), (1, 1));
/// assert!((values[[0, 0]] - 0.5 / std::f64::consts::PI).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Brdf: Any + Send + Sync {
    /// Number of values per pair of directions.
    fn channels(&self) -> usize;

    /// Whether turning the surface about its normal changes no value. Where it does, the azimuths of
    /// directions count from the surface's own tangent.
    fn is_isotropic(&self) -> bool {
        true
    }

    /// Writes the BRDF in 1/sr, without the cosine, at each pair of directions; `values` has shape
    /// (pairs, channels). 0 where light or viewer is not above the horizon.
    ///
    /// # Errors
    /// Where a value cannot be computed, such as for a direction that is not finite, and where
    /// `values` has another shape.
    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError>;

    /// As [`eval_into`](Self::eval_into), into a new array.
    ///
    /// # Errors
    /// Those of [`eval_into`](Self::eval_into).
    fn eval(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>, EvalError> {
        let mut values = Array2::zeros((pairs.len(), self.channels()));
        self.eval_into(pairs, values.view_mut())?;
        Ok(values)
    }
}

impl<B: Brdf + ?Sized> Brdf for Box<B> {
    fn channels(&self) -> usize {
        (**self).channels()
    }

    fn is_isotropic(&self) -> bool {
        (**self).is_isotropic()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        (**self).eval_into(pairs, values)
    }
}

impl<B: Brdf + ?Sized> Brdf for Arc<B> {
    fn channels(&self) -> usize {
        (**self).channels()
    }

    fn is_isotropic(&self) -> bool {
        (**self).is_isotropic()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        (**self).eval_into(pairs, values)
    }
}

/// What an implementation of [`Brdf::eval_into`] asks of its arguments: a row of `values` for each
/// pair, a column for each of `channels`, and finite directions.
///
/// # Errors
/// [`ArgumentError`] at the first fault.
pub fn check_arguments(
    pairs: &[DirectionPair],
    values: &ArrayViewMut2<'_, f64>,
    channels: usize,
) -> Result<(), ArgumentError> {
    let (found, expected) = (values.dim(), (pairs.len(), channels));
    if found != expected {
        return Err(ArgumentError::Shape { expected, found });
    }
    check_directions(pairs)
}

/// All components finite.
///
/// # Errors
/// [`ArgumentError::NotFinite`] at the first that is not.
pub fn check_directions(pairs: &[DirectionPair]) -> Result<(), ArgumentError> {
    for (row, pair) in pairs.iter().enumerate() {
        let mut components = pair.incident.iter().chain(&pair.outgoing);
        if let Some(column) = components.position(|c| !c.is_finite()) {
            return Err(ArgumentError::NotFinite { row, column });
        }
    }
    Ok(())
}

/// What can be wrong with the arguments of an evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ArgumentError {
    /// A NaN or infinity among the directions.
    #[error("directions: the value at row {row}, column {column} (counted from 0) is not finite")]
    NotFinite {
        /// The pair.
        row: usize,
        /// The component: those of the light, then those of the viewer.
        column: usize,
    },
    /// Room for other values than there are.
    #[error("values: expected {} x {}, found {} x {}", expected.0, expected.1, found.0, found.1)]
    Shape {
        /// Pairs and channels.
        expected: (usize, usize),
        /// Rows and columns of the array.
        found: (usize, usize),
    },
}
