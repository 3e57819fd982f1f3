//! Files that are there whole or not at all.

use std::fs::{self, File, Metadata};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// What the names of our temporary files end in.
const SUFFIX: &str = ".elm-tmp";

/// Writes a file so that whoever reads it, or finds it after an interruption, has the old contents or
/// the new ones, whole.
///
/// A link is followed, and the file that it points to replaced. What is there keeps its access rights;
/// a new file has those that the user's umask allows. Where the system has unnamed files (Linux)
/// nothing else is in the folder while the bytes are written; elsewhere, and for the moment in
/// which an old file is replaced, there is a file `.NAME.*.elm-tmp`. Such files that an interruption
/// left behind are removed by the next call for the same name.
///
/// ```
/// # fn main() -> std::io::Result<()> {
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("numbers.txt");
/// elm::persist::replace(&path, b"1 2 3\n")?;
/// assert_eq!(std::fs::read(&path)?, b"1 2 3\n");
/// let nowhere = folder.path().join("no/such/numbers.txt");
/// let error = elm::persist::replace(&nowhere, b"").unwrap_err();
/// assert!(error.to_string().ends_with("no does not exist"));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// What the operating system says; of a folder that is missing its name.
pub fn replace(path: impl AsRef<Path>, bytes: &[u8]) -> io::Result<()> {
    let path = followed(path.as_ref())?;
    let dir = match path.parent() {
        Some(dir) if !dir.as_os_str().is_empty() => dir,
        _ => Path::new("."),
    };
    if let Some(missing) = missing_folder(dir) {
        let message = format!("the folder {} does not exist", missing.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, message));
    }
    let old = fs::metadata(&path).ok();
    if old.as_ref().is_some_and(|old| !old.is_file()) {
        // A pipe or a device is written to, not replaced; a folder refuses.
        return fs::write(&path, bytes);
    }
    let target = Target {
        dir,
        path: &path,
        prefix: prefix(&path),
        old,
    };
    target.remove_leftovers();
    #[cfg(target_os = "linux")]
    if let Some(file) = target.unnamed()? {
        target.fill(&file, bytes)?;
        if target.link(&file)? {
            return Ok(());
        }
    }
    target.rename_into_place(bytes)
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

/// The outermost folder on this way that does not exist.
fn missing_folder(dir: &Path) -> Option<&Path> {
    let absent = |dir: &&Path| {
        let looked = fs::metadata(dir);
        looked.is_err_and(|error| error.kind() == io::ErrorKind::NotFound)
    };
    let named = |dir: &&Path| !dir.as_os_str().is_empty();
    dir.ancestors().filter(named).take_while(absent).last()
}

/// What the names of a file's temporary files begin with.
fn prefix(path: &Path) -> std::ffi::OsString {
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(path.file_name().unwrap_or_default());
    prefix.push(".");
    prefix
}

/// A file that is to have new contents.
struct Target<'a> {
    dir: &'a Path,
    path: &'a Path,
    prefix: std::ffi::OsString,
    /// What is there.
    old: Option<Metadata>,
}

impl Target<'_> {
    /// Removes temporary files of this name whose writers are gone. A writer holds a lock on its
    /// file, which ends with it. What cannot be read or removed is left alone.
    fn remove_leftovers(&self) {
        let Ok(entries) = fs::read_dir(self.dir) else {
            return;
        };
        for entry in entries.flatten() {
            let name = entry.file_name();
            let bytes = name.as_encoded_bytes();
            let own = bytes.starts_with(self.prefix.as_encoded_bytes())
                && bytes.ends_with(SUFFIX.as_bytes())
                && entry.file_type().is_ok_and(|kind| kind.is_file());
            if !own {
                continue;
            }
            let path = entry.path();
            if File::open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
                let _ = fs::remove_file(path);
            }
        }
    }

    /// Access rights before there is anything to read. What is there may be private.
    #[cfg(unix)]
    fn first_mode(&self) -> u32 {
        if self.old.is_some() { 0o600 } else { 0o666 }
    }

    /// Writes the bytes, to the disk, and gives the file the access rights of the old one.
    fn fill(&self, mut file: &File, bytes: &[u8]) -> io::Result<()> {
        file.write_all(bytes)?;
        if let Some(old) = &self.old {
            // Of the owner, as far as that is allowed, which comes first as it takes rights away.
            #[cfg(unix)]
            {
                use std::os::unix::fs::{MetadataExt, fchown};
                let _ = fchown(file, Some(old.uid()), Some(old.gid()));
            }
            file.set_permissions(old.permissions())?;
        }
        file.sync_all()
    }

    /// A file without a name; nothing where the system or the file system has none.
    #[cfg(target_os = "linux")]
    fn unnamed(&self) -> io::Result<Option<File>> {
        use rustix::fs::{Mode, OFlags};
        use rustix::io::Errno;
        let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
        match rustix::fs::open(self.dir, flags, Mode::from_raw_mode(self.first_mode())) {
            Ok(file) => Ok(Some(file.into())),
            Err(Errno::OPNOTSUPP | Errno::ISDIR | Errno::NOENT | Errno::INVAL) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Gives an unnamed file the target's name; false where the system refuses that.
    #[cfg(target_os = "linux")]
    fn link(&self, file: &File) -> io::Result<bool> {
        use rustix::fs::{AtFlags, CWD};
        use std::os::fd::AsRawFd;
        let own = format!("/proc/self/fd/{}", file.as_raw_fd());
        let link = |to: &Path| {
            rustix::fs::linkat(CWD, own.as_str(), CWD, to, AtFlags::SYMLINK_FOLLOW)
                .map_err(io::Error::from)
        };
        if self.old.is_none() {
            match link(self.path) {
                Ok(()) => return Ok(true),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(_) => return Ok(false),
            }
        }
        // A link does not take the place of a file, a name does.
        file.lock()?;
        match self.builder().make_in(self.dir, link) {
            Ok(named) => {
                named.persist(self.path)?;
                Ok(true)
            }
            Err(_) => Ok(false),
        }
    }

    fn builder(&self) -> tempfile::Builder<'_, 'static> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(&self.prefix).suffix(SUFFIX);
        builder
    }

    /// Writes beside the target and renames.
    fn rename_into_place(&self, bytes: &[u8]) -> io::Result<()> {
        let mut builder = self.builder();
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(
            self.first_mode(),
        ));
        let named = builder.tempfile_in(self.dir).map_err(plain)?;
        // Not every file system has locks; then nobody else gets one either.
        let _ = named.as_file().lock();
        self.fill(named.as_file(), bytes)?;
        named.persist(self.path).map_err(|error| error.error)?;
        Ok(())
    }
}

/// The error of the operating system, without the name of a temporary file.
fn plain(error: io::Error) -> io::Error {
    match error.raw_os_error() {
        Some(code) => io::Error::from_raw_os_error(code),
        // The crate tempfile wraps its errors.
        None => io::Error::from(error.kind()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(dir)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn the_way_without_unnamed_files_writes_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        for contents in [b"old", b"new"] {
            let target = Target {
                dir: folder.path(),
                path: &path,
                prefix: prefix(&path),
                old: fs::metadata(&path).ok(),
            };
            target.rename_into_place(contents).unwrap();
            assert_eq!(fs::read(&path).unwrap(), contents);
            assert_eq!(names(folder.path()), ["a.txt"]);
        }
    }

    #[test]
    fn what_an_interruption_left_is_removed_and_what_is_being_written_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let of = |name: &str| folder.path().join(name);
        fs::write(of(".a.txt.Xyz.elm-tmp"), "half").unwrap();
        fs::write(of(".b.txt.Xyz.elm-tmp"), "of another file").unwrap();
        fs::write(of(".tmpXyz"), "of another program").unwrap();
        let other = File::create(of(".a.txt.other.elm-tmp")).unwrap();
        other.lock().unwrap();
        replace(&path, b"whole").unwrap();
        let left = [
            ".a.txt.other.elm-tmp",
            ".b.txt.Xyz.elm-tmp",
            ".tmpXyz",
            "a.txt",
        ];
        assert_eq!(names(folder.path()), left);
        drop(other);
        replace(&path, b"again").unwrap();
        assert_eq!(names(folder.path()), left[1..]);
    }

    #[cfg(unix)]
    #[test]
    fn access_rights_and_links_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str| folder.path().join(name);
        let mode = |name: &str| fs::metadata(of(name)).unwrap().permissions().mode() & 0o777;
        fs::create_dir(of("elsewhere")).unwrap();
        fs::write(of("elsewhere/private"), "old").unwrap();
        fs::set_permissions(of("elsewhere/private"), fs::Permissions::from_mode(0o600)).unwrap();
        symlink("elsewhere/private", of("link")).unwrap();
        symlink("elsewhere/not-yet", of("dangling")).unwrap();
        symlink("loop", of("loop")).unwrap();

        replace(of("link"), b"new").unwrap();
        assert!(fs::symlink_metadata(of("link")).unwrap().is_symlink());
        assert_eq!(fs::read(of("elsewhere/private")).unwrap(), b"new");
        assert_eq!(mode("elsewhere/private"), 0o600);

        replace(of("dangling"), b"made").unwrap();
        assert_eq!(fs::read(of("elsewhere/not-yet")).unwrap(), b"made");

        fs::write(of("ordinary"), "").unwrap();
        replace(of("new"), b"").unwrap();
        assert_eq!(mode("new"), mode("ordinary"));

        assert!(replace(of("loop"), b"").is_err());
        replace("/dev/null", b"nothing").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
