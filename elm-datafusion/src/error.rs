//! Errors as DataFusion carries them.

use std::fmt::Display;

use datafusion::error::DataFusionError;

/// An error of a function at run time.
pub(crate) fn failed(function: &str, reason: impl Display) -> DataFusionError {
    DataFusionError::Execution(format!("{function}: {reason}"))
}

/// An error that is known before any row is read.
pub(crate) fn unplanned(function: &str, reason: impl Display) -> DataFusionError {
    DataFusionError::Plan(format!("{function}: {reason}"))
}
