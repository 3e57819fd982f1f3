//! The errors of this crate: each is one line that names what failed and what was expected.

use std::path::PathBuf;

use elm_datasets::brdf::{ArgumentError, EvalError};
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
    /// A setting is out of range.
    #[error("{name} is {value}, but must be {expected}")]
    Parameter {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// There is nothing to work on.
    #[error("{what} is empty ({rows} x {columns})")]
    Empty {
        /// Which array.
        what: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
    },
    /// Sizes do not fit each other.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// Which size.
        what: &'static str,
        /// What it should be.
        expected: usize,
        /// What it is.
        found: usize,
    },
    /// A NaN or infinity.
    #[error("{what}: the value at row {row}, column {column} (counted from 0) is not finite")]
    NotFinite {
        /// Which array.
        what: &'static str,
        /// Its row, counted from 0.
        row: usize,
        /// Its column, counted from 0.
        column: usize,
    },
    /// Two things that cannot be had together.
    #[error("{first} and {second} exclude each other")]
    Conflict {
        /// One of them.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// A search or an iteration came to no result.
    #[error("{what} did not converge")]
    NoConvergence {
        /// Which.
        what: &'static str,
    },
    /// A reflectance of another crate could not be evaluated.
    #[error(transparent)]
    Evaluation(EvalError),
    /// A model's file could not be written or read.
    #[error(transparent)]
    File(#[from] elm::persist::Error),
    /// The weights of a network trained elsewhere could not be read.
    #[error("{}: {reason}", path.display())]
    Weights {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Files could not be fetched.
    #[cfg(feature = "fetch")]
    #[error(transparent)]
    Fetch(#[from] crate::fetch::Error),
    /// A model could not be exported.
    #[error(transparent)]
    Export(#[from] crate::export::error::ExportError),
    /// A model could not be written as a tensor file.
    #[error(transparent)]
    Tensor(#[from] elm_datasets::rgl::WriteError),
    /// A scene could not be read or rendered.
    #[cfg(feature = "render")]
    #[error(transparent)]
    Scene(#[from] elm_brdf_render::Error),
    /// So many folds are impossible.
    #[error("{folds} folds of {rows} measurements: expected 2 to {rows} folds")]
    Folds {
        /// The folds asked for.
        folds: usize,
        /// The measurements there are.
        rows: usize,
    },
    /// More measurements than a method can take.
    #[error("{method} of {rows} measurements: expected at most {most}")]
    TooManyRows {
        /// The method.
        method: &'static str,
        /// The measurements there are.
        rows: usize,
        /// The most that it takes.
        most: usize,
    },
    /// A material of a scene that names no source, or several.
    #[error("expected exactly one of curet, csv, model, table and analytic")]
    MaterialSource,
    /// A material's rotation that is not finite.
    #[error("rotation = {found}, expected a number of degrees")]
    Rotation {
        /// What was given.
        found: f64,
    },
    /// A model with a number of channels that is no colour.
    #[error(
        "a model of {channels} channels has no color: expected 1, 3 or at least 4 that are wavelengths, such as \
         '550 nm' (or --wavelengths)"
    )]
    Channels {
        /// Its channels.
        channels: usize,
    },
    /// Samples that lack a channel of the model, or have it twice.
    #[error(
        "expected the channels of the samples to be those of the model, {model}, by name, color or \
         wavelength; found {samples}"
    )]
    ChannelNames {
        /// The model's.
        model: String,
        /// The samples'.
        samples: String,
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

impl Error {
    /// The one of `all` whose name is `name`, or an error that lists the names of a `what`.
    pub(crate) fn find<T: Copy, const N: usize>(
        what: &'static str,
        name: &str,
        all: [T; N],
        name_of: impl Fn(T) -> &'static str,
    ) -> Result<T> {
        let found = all.into_iter().find(|&one| name_of(one) == name);
        found.ok_or_else(|| Self::UnknownName {
            what,
            name: name.to_owned(),
            expected: all.map(name_of).join(", "),
        })
    }
}

impl From<EvalError> for Error {
    fn from(error: EvalError) -> Self {
        let other = match error.downcast() {
            Ok(own) => return own,
            Err(other) => other,
        };
        match other.downcast::<ArgumentError>() {
            Ok(argument) => argument.into(),
            Err(other) => Self::Evaluation(other),
        }
    }
}

impl From<ArgumentError> for Error {
    fn from(error: ArgumentError) -> Self {
        match error {
            ArgumentError::NotFinite { row, column } => Self::NotFinite {
                what: "directions",
                row,
                column,
            },
            other => Self::Evaluation(other.into()),
        }
    }
}

impl From<Error> for EvalError {
    fn from(error: Error) -> Self {
        Self::new(error)
    }
}
