//! What can be wrong with a MERL table.

/// The three numbers that a table begins with.
pub(crate) const DIMENSIONS: [i32; 3] = [90, 90, 180];
pub(crate) const HEADER: u64 = 12;
/// Bytes of a table.
pub(crate) const LENGTH: u64 = HEADER + 3 * 8 * 90 * 90 * 180;

/// What is wrong with a file that is no table.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The file is too short or too long.
    #[error("expected {LENGTH} bytes, found {found}")]
    Length {
        /// Bytes in the file.
        found: u64,
    },
    /// A table of another size.
    #[error("at byte 0, expected the dimensions {DIMENSIONS:?}, found {found:?}")]
    Dimensions {
        /// The three numbers that stand there.
        found: [i32; 3],
    },
}
