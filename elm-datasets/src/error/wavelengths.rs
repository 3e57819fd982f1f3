//! What can be wrong with wavelengths.

/// What is wrong with wavelengths that are given for the channels of a file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WavelengthProblem {
    /// Too few or too many.
    #[error("{given} wavelengths are given for {channels} channels")]
    Count {
        /// How many are given.
        given: usize,
        /// How many channels the file has.
        channels: usize,
    },
    /// One that cannot be, or that is given twice.
    #[error("expected wavelengths in nm that are positive and all different, found {found}")]
    Number {
        /// The number.
        found: f64,
    },
}
