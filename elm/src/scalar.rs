//! The floating-point types that a network can be made of.

use std::iter::Sum;

use ndarray::{ArrayView, CowArray, Dimension, NdFloat};
use serde::{Serialize, de::DeserializeOwned};

use crate::activation::Coefficients;
use crate::linalg::Kernel;

/// `f32` or `f64`. Sealed: the linear algebra and the vector code behind it exist for these
/// two.
pub trait Scalar: NdFloat + Kernel + Coefficients + Sum + Serialize + DeserializeOwned {
    /// The type's name, `"f32"` or `"f64"`.
    const NAME: &'static str;

    /// The nearest value of this type (infinite when out of range).
    fn from_f64(value: f64) -> Self;

    /// This value as `f64`; exact.
    fn as_f64(self) -> f64;

    /// These values as `f64`: a copy of `f32`, the array itself of `f64`.
    fn widen<D: Dimension>(values: ArrayView<'_, Self, D>) -> CowArray<'_, f64, D>;
}

impl Scalar for f32 {
    const NAME: &'static str = "f32";

    #[allow(clippy::cast_possible_truncation)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    fn as_f64(self) -> f64 {
        f64::from(self)
    }

    fn widen<D: Dimension>(values: ArrayView<'_, Self, D>) -> CowArray<'_, f64, D> {
        values.mapv(f64::from).into()
    }
}

impl Scalar for f64 {
    const NAME: &'static str = "f64";

    fn from_f64(value: f64) -> Self {
        value
    }

    fn as_f64(self) -> f64 {
        self
    }

    fn widen<D: Dimension>(values: ArrayView<'_, Self, D>) -> CowArray<'_, f64, D> {
        values.into()
    }
}
