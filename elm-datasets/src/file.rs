//! Reads whole files with a limit on their size, and writes files that are complete or absent.

use std::fs;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;

use crate::error::{Error, MAX_FILE_BYTES};

/// The path that means standard input.
pub const STANDARD_INPUT: &str = "-";

/// What every file compressed by gzip begins with.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// The whole file, unless it is larger than any of these formats gets; of a file compressed by gzip
/// what it holds, and of `-` standard input.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Error> {
    let failed = |reason| Error::Read {
        path: path.to_owned(),
        reason,
    };
    let too_large = |found| Error::TooLarge {
        path: path.to_owned(),
        found,
    };
    let whole = |stream: &mut dyn Read| {
        let mut bytes = Vec::new();
        // A pipe has no length to look at.
        let mut limited = stream.take(MAX_FILE_BYTES + 1);
        limited.read_to_end(&mut bytes).map_err(failed)?;
        let found = bytes.len() as u64;
        if found > MAX_FILE_BYTES {
            return Err(too_large(found));
        }
        Ok(bytes)
    };
    let bytes = if path == Path::new(STANDARD_INPUT) {
        whole(&mut io::stdin().lock())?
    } else {
        let mut file = fs::File::open(path).map_err(failed)?;
        let found = file.metadata().map_err(failed)?.len();
        if found > MAX_FILE_BYTES {
            return Err(too_large(found));
        }
        whole(&mut file)?
    };
    if bytes.starts_with(&GZIP) {
        whole(&mut MultiGzDecoder::new(bytes.as_slice()))
    } else {
        Ok(bytes)
    }
}

/// The first bytes of a file, at most `count`; of a file compressed by gzip those of what it holds.
pub(crate) fn start(path: &Path, count: u64) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    fs::File::open(path)?.take(count).read_to_end(&mut start)?;
    if start.starts_with(&GZIP) {
        let mut inside = Vec::new();
        // What is cut off is no fault here.
        let _ = MultiGzDecoder::new(start.as_slice())
            .take(count)
            .read_to_end(&mut inside);
        return Ok(inside);
    }
    Ok(start)
}

/// Puts the whole file in place in one step, or leaves what was there. The folder is made if it is
/// not there.
///
/// As `elm::persist::replace` does, which this crate does not depend on: a link is followed, what is
/// there keeps its access rights, a new file has those that the umask allows, a pipe or a device is
/// written to, and the bytes are on the disk before the file has its name.
pub(crate) fn replace(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    attempt(path, write).map_err(|reason| Error::Write {
        path: path.to_owned(),
        reason,
    })
}

fn attempt(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let path = &followed(path)?;
    let dir = match path.parent() {
        Some(dir) if !dir.as_os_str().is_empty() => dir,
        _ => Path::new("."),
    };
    fs::create_dir_all(dir)?;
    let old = fs::metadata(path).ok();
    if old.as_ref().is_some_and(|old| !old.is_file()) {
        let mut out = BufWriter::new(fs::OpenOptions::new().write(true).open(path)?);
        write(&mut out)?;
        return out.flush();
    }
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        // What is there may be private.
        let mode = if old.is_some() { 0o600 } else { 0o666 };
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
    }
    let mut out = BufWriter::new(builder.tempfile_in(dir)?);
    write(&mut out)?;
    let file = out.into_inner().map_err(io::IntoInnerError::into_error)?;
    if let Some(old) = old {
        file.as_file().set_permissions(old.permissions())?;
    }
    file.as_file().sync_all()?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// The file that a link points to, however many links there are on the way, whether or not it exists.
fn followed(path: &Path) -> io::Result<PathBuf> {
    // As many as Linux follows.
    const MAX_LINKS: usize = 40;
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&path) {
            Ok(to) => path = path.parent().unwrap_or(Path::new("")).join(to),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many links, one pointing to the next"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(path: &Path, bytes: &[u8]) -> Result<(), Error> {
        replace(path, |out| out.write_all(bytes))
    }

    #[test]
    fn a_failed_write_leaves_what_was_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/a.csv");
        put(&path, b"old").unwrap();
        let failed = replace(&path, |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("stopped"))
        });
        assert!(matches!(failed, Err(Error::Write { .. })));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn access_rights_and_links_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str| folder.path().join(name);
        let mode = |name: &str| fs::metadata(of(name)).unwrap().permissions().mode() & 0o777;
        fs::write(of("private"), "old").unwrap();
        fs::set_permissions(of("private"), fs::Permissions::from_mode(0o600)).unwrap();
        symlink("private", of("link")).unwrap();
        symlink("loop", of("loop")).unwrap();
        put(&of("link"), b"new").unwrap();
        assert!(fs::symlink_metadata(of("link")).unwrap().is_symlink());
        assert_eq!(fs::read(of("private")).unwrap(), b"new");
        assert_eq!(mode("private"), 0o600);
        fs::write(of("ordinary"), "").unwrap();
        put(&of("made"), b"").unwrap();
        assert_eq!(mode("made"), mode("ordinary"));
        assert!(put(&of("loop"), b"").is_err());
        put(Path::new("/dev/null"), b"nothing").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
