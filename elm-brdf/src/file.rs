//! Writes files that are complete or absent, never partial.

use std::fs;
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

/// Makes a folder, and those above it, unless it is there.
///
/// # Errors
/// [`Error::Write`] naming the folder.
pub(crate) fn folder(dir: &Path) -> Result<()> {
    fs::create_dir_all(dir).map_err(|reason| Error::Write {
        path: dir.to_owned(),
        reason,
    })
}

/// Reads a model, or what else was saved.
///
/// # Errors
/// [`Error::File`].
#[cfg(feature = "render")]
pub(crate) fn load<T: persist::Persist>(path: &Path) -> Result<T> {
    Ok(persist::load(path)?)
}
