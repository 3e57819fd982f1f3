//! What can be wrong with samples for pbrt-v2.

/// What is wrong with a file whose words are all numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The file does not begin with a number of wavelengths that it could hold.
    #[error("expected the number of wavelengths, a whole number of at least 1, found {found:?}")]
    Wavelengths {
        /// The number that stands there.
        found: f64,
    },
    /// A wavelength that is none.
    #[error("expected a wavelength in nm above 0, found {found}")]
    Wavelength {
        /// The number that stands there.
        found: f64,
    },
    /// The file ends before its first sample is complete, or within another.
    #[error("expected more numbers, {expected} at least, found the end of the file")]
    Incomplete {
        /// Numbers missing.
        expected: usize,
    },
    /// A polar angle that is negative or below the horizon.
    #[error("expected {angle} from 0 to pi/2 radians, found {found}")]
    PolarAngle {
        /// Name of the angle.
        angle: &'static str,
        /// The angle found.
        found: f64,
    },
}
