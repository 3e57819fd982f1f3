//! What can go wrong in this crate; each error is one line that names the place.

use std::path::PathBuf;

use thiserror::Error;

/// Result of everything in this crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a model, a cross-validation or a report could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The measurements could not be had.
    #[error(transparent)]
    Data(#[from] elm_datasets::Error),
    /// The network could not be fitted or evaluated.
    #[error(transparent)]
    Elm(#[from] elm::Error),
    /// Files could not be fetched.
    #[cfg(feature = "fetch")]
    #[error(transparent)]
    Fetch(#[from] crate::fetch::Error),
    /// So many folds are impossible.
    #[error("{folds} folds of {rows} measurements: expected 2 to {rows} folds")]
    Folds {
        /// The folds asked for.
        folds: usize,
        /// The measurements there are.
        rows: usize,
    },
    /// A method is not made for so many measurements.
    #[error("{method} of {rows} measurements: expected at most {most}")]
    TooManyRows {
        /// The method.
        method: &'static str,
        /// The measurements there are.
        rows: usize,
        /// The most that it takes.
        most: usize,
    },
    /// A folder that was asked for does not exist.
    #[error("{}: there is no such folder", path.display())]
    NoFolder {
        /// The folder.
        path: PathBuf,
    },
    /// A result could not be written.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system or the encoder said.
        reason: std::io::Error,
    },
    /// A name that is not one of those known.
    #[error("unknown {what} '{name}' (expected one of: {expected})")]
    UnknownName {
        /// What was being named.
        what: &'static str,
        /// The name that was given.
        name: String,
        /// The names there are.
        expected: String,
    },
}
