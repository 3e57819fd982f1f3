//! Writes files that are complete or absent, never partial.

use std::path::Path;

use elm::persist;

use crate::error::{Error, Result};

/// Writes the file so that an interruption leaves the old one; see [`persist::replace`].
///
/// # Errors
/// [`Error::Write`] naming the file.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    persist::replace(path, bytes).map_err(|reason| Error::Write {
        path: path.to_owned(),
        reason,
    })
}

/// Reads a model, or what else was saved.
///
/// # Errors
/// [`Error::File`].
pub(crate) fn load<T: persist::Persist>(path: &Path) -> Result<T> {
    Ok(persist::load(path)?)
}
