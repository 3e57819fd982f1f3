//! Files that are there whole or not at all.

use std::io::{self, Write};
use std::path::Path;

use elm::persist;

use crate::error::{Error, Result};

/// Writes beside the file and renames, so that an interruption leaves the old one.
///
/// # Errors
/// [`Error::Write`] naming the file.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    put(path, bytes).map_err(|reason| Error::Write {
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

fn put(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let dir = path.parent().filter(|dir| !dir.as_os_str().is_empty());
    let mut file = tempfile::NamedTempFile::new_in(dir.unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    // Temporary files are private to their owner; a result is not.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.as_file()
            .set_permissions(std::fs::Permissions::from_mode(0o644))?;
    }
    file.persist(path)?;
    Ok(())
}
