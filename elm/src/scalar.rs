//! [`Scalar`]: the floating-point types that a network can use.

use std::iter::Sum;

use ndarray::{ArrayView, CowArray, Dimension, NdFloat};

/// `f32` or `f64`. Sealed: the linear algebra and the vector code behind it exist for these
/// two.
pub trait Scalar: NdFloat + Sum + sealed::Sealed {
    /// The type's name, `"f32"` or `"f64"`.
    const NAME: &'static str;

    /// The nearest value of this type (infinite when out of range).
    fn from_f64(value: f64) -> Self;

    /// This value as `f64`; exact.
    fn as_f64(self) -> f64;

    /// These values as `f64`: a copy of `f32`, the array itself of `f64`.
    fn widen<D: Dimension>(values: ArrayView<'_, Self, D>) -> CowArray<'_, f64, D>;
}

mod sealed {
    use crate::linalg::Backend;
    use crate::simd::Coefficients;

    /// What the library itself asks of a scalar.
    pub trait Sealed: Backend + Coefficients + Stored {
        /// These values, where this type is `f64`.
        fn of_wide(values: &mut [f64]) -> Option<&mut [Self]>;
    }

    impl Sealed for f32 {
        fn of_wide(_: &mut [f64]) -> Option<&mut [Self]> {
            None
        }
    }
    impl Sealed for f64 {
        fn of_wide(values: &mut [f64]) -> Option<&mut [Self]> {
            Some(values)
        }
    }

    #[cfg(feature = "serde")]
    pub trait Stored: serde::Serialize + serde::de::DeserializeOwned {}
    #[cfg(feature = "serde")]
    impl<T: serde::Serialize + serde::de::DeserializeOwned> Stored for T {}

    #[cfg(not(feature = "serde"))]
    pub trait Stored {}
    #[cfg(not(feature = "serde"))]
    impl<T> Stored for T {}
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

/// The power of two at or just below a magnitude (so that dividing by it rounds nothing), or 1
/// for 0.
pub(crate) fn power_of_two<A: Scalar>(magnitude: A) -> A {
    if magnitude == A::zero() {
        return A::one();
    }
    // log2 of a subnormal is fine; 2^1024 is not, hence the bounds of a normal power.
    let lowest = A::min_positive_value().log2();
    let exponent = magnitude.log2().floor().max(lowest).min(-lowest);
    A::from_f64(2.0).powf(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_are_exact_over_the_whole_range() {
        for (magnitude, power) in [
            (1.0, 1.0),
            (1.999, 1.0),
            (2.0, 2.0),
            (0.75, 0.5),
            (f64::MAX, 2.0_f64.powi(1022)),
            (f64::MIN_POSITIVE, f64::MIN_POSITIVE),
            (5e-324, f64::MIN_POSITIVE),
            (0.0, 1.0),
        ] {
            assert_eq!(power_of_two(magnitude), power, "{magnitude:e}");
        }
    }
}
