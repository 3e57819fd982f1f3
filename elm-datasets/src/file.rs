//! Reads whole files with a limit on their size, and writes files that are complete or absent.

use std::fs;
use std::io::{Read as _, Write as _};
use std::path::Path;

use crate::error::{Error, LARGEST_FILE};

/// The whole file, unless it is larger than any of these formats gets.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Error> {
    let failed = |reason| Error::Read {
        path: path.to_owned(),
        reason,
    };
    let file = fs::File::open(path).map_err(failed)?;
    let found = file.metadata().map_err(failed)?.len();
    if found > LARGEST_FILE {
        let path = path.to_owned();
        return Err(Error::TooLarge { path, found });
    }
    let mut bytes = Vec::new();
    // A pipe has no length to look at.
    file.take(LARGEST_FILE)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    Ok(bytes)
}

/// Puts the whole file in place in one step, or leaves what was there. The folder is made if it is
/// not there.
pub(crate) fn replace(
    path: &Path,
    write: impl FnOnce(&mut dyn std::io::Write) -> std::io::Result<()>,
) -> Result<(), Error> {
    let attempt = || {
        let dir = match path.parent() {
            Some(dir) if !dir.as_os_str().is_empty() => dir,
            _ => Path::new("."),
        };
        fs::create_dir_all(dir)?;
        let mut out = std::io::BufWriter::new(beside(dir)?);
        write(&mut out)?;
        out.flush()?;
        let file = out
            .into_inner()
            .map_err(std::io::IntoInnerError::into_error)?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    };
    attempt().map_err(|reason| Error::Write {
        path: path.to_owned(),
        reason,
    })
}

/// A temporary file in `dir`, with the access rights of an ordinary one.
fn beside(dir: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(dir)
}
