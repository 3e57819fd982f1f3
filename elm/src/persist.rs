//! Files: a fitted network (or anything else here that is worth keeping) as readable JSON or as
//! compact binary.
//!
//! Both forms name what they hold, the version of the layout, and the scalar type, and are
//! checked against all three before their contents are believed; the binary form also carries its
//! length and a CRC-32. A damaged, truncated, foreign or future file is an [`Error`], never a
//! panic, and no length in a file is trusted with an allocation. A file that [`save`]
//! writes is whole or absent (see [`replace`]).
//!
//! ```
//! use elm::{Elm, ElmParams, persist};
//! use ndarray::{Ix1, array};
//!
//! let (x, t) = (array![[0.0], [1.0], [2.0], [3.0]], array![0.0, 1.0, 4.0, 9.0]);
//! let model = ElmParams::new(10).fit(&x, &t)?;
//! let bytes = persist::to_bytes(&model)?;
//! let again: Elm<f64, Ix1> = persist::from_bytes(&bytes)?;
//! assert_eq!(again, model);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Binary layout
//! Little-endian: 8 bytes `b"elmfile\n"`, `u32` version, `u8` length and bytes of the kind, `u8`
//! length and bytes of the scalar type, `u64` length of the payload, `u32` CRC-32 (IEEE) of the
//! payload, and the payload in the postcard encoding.

mod whole;

use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::accumulate::Accumulator;
use crate::activation::Activation;
use crate::dataset::TargetDim;
use crate::feature_map::{HiddenLayer, NeuronBlock};
use crate::network::Elm;
use crate::scalar::Scalar;

pub use whole::replace;

const MAGIC: &[u8; 8] = b"elmfile\n";
/// The byte order mark of UTF-8.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Why a file was not written or not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file system refused.
    #[error("cannot {action} {}: {reason}", path.display())]
    Io {
        /// `"read"` or `"write"`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        reason: io::Error,
    },
    /// It does not begin as such a file does.
    #[error("not an elm file: expected it to begin with 'elmfile' or, as JSON, with '{{'")]
    Foreign,
    /// It is from a later version of this crate.
    #[error("the file has version {found} of the layout; this build reads up to {supported}")]
    Future {
        /// The file's version.
        found: u32,
        /// The latest version that is understood.
        supported: u32,
    },
    /// It is from an earlier version of this crate, whose layout is no longer read.
    #[error(
        "the file has version {found} of the layout, which this build no longer reads; it reads version {supported}: fit and save again"
    )]
    Past {
        /// The file's version.
        found: u32,
        /// The version that is understood.
        supported: u32,
    },
    /// It holds something else.
    #[error("the file holds '{}', expected '{expected}'", brief(found))]
    Kind {
        /// What it holds.
        found: String,
        /// What was asked for.
        expected: &'static str,
    },
    /// Its numbers are of another type.
    #[error("the file's numbers are {}, expected {expected}", brief(found))]
    ScalarType {
        /// The file's type.
        found: String,
        /// The type asked for.
        expected: &'static str,
    },
    /// What is wrong with the contents of this file.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Any other variant but [`Io`](Self::Io), which names its file itself.
        reason: Box<Error>,
    },
    /// It ends too early, or goes on too long.
    #[error("{}: {found} bytes after byte {at}, expected {expected}", misfit(*found, *expected))]
    Length {
        /// Where the counting begins.
        at: usize,
        /// Bytes there are.
        found: u64,
        /// Bytes there should be.
        expected: u64,
    },
    /// Its contents are not those that were written.
    #[error("the file is damaged: its checksum is {found:08x}, expected {expected:08x}")]
    Checksum {
        /// Of the contents.
        found: u32,
        /// As recorded in the file.
        expected: u32,
    },
    /// Its contents make no sense.
    #[error("the file holds no sound {kind}: {reason}")]
    Contents {
        /// What was expected.
        kind: &'static str,
        /// What the decoder or the check said.
        reason: String,
    },
    /// It cannot be written: a custom activation is code, which no file holds.
    #[error("the activation '{name}' is custom and cannot be written to a file")]
    CustomActivation {
        /// The activation's name.
        name: String,
    },
}

/// What can be kept in a file: what is here, and what others build on it.
///
/// Whatever is read has passed `Deserialize` alone, so that must refuse contents that make no
/// sense (`#[serde(try_from = "...")]` is the usual way).
pub trait Persist: Serialize + DeserializeOwned {
    /// What the file says it holds, at most 255 bytes.
    const KIND: &'static str;
    /// The scalar type that the file names, at most 255 bytes.
    const SCALAR: &'static str;
    /// The version of this kind's layout that is written and read: one more with every change of what
    /// is serialized.
    const VERSION: u32;

    /// Whether a file can hold all of it.
    ///
    /// # Errors
    /// [`Error::CustomActivation`].
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }
}

impl<A: Scalar, D: TargetDim> Persist for Elm<A, D> {
    const KIND: &'static str = "elm model";
    const SCALAR: &'static str = A::NAME;
    const VERSION: u32 = 4;

    fn check(&self) -> Result<(), Error> {
        not_custom(self.hidden())
    }
}

impl<A: Scalar, D: TargetDim> Persist for Accumulator<A, D> {
    const KIND: &'static str = "elm accumulator";
    const SCALAR: &'static str = A::NAME;
    const VERSION: u32 = 6;

    fn check(&self) -> Result<(), Error> {
        not_custom(self.hidden())
    }
}

fn not_custom<A: Scalar>(hidden: &HiddenLayer<A>) -> Result<(), Error> {
    let functions = hidden.groups().iter().map(NeuronBlock::activation);
    match functions
        .into_iter()
        .find(|f| matches!(f, Activation::Custom(_)))
    {
        Some(custom) => Err(Error::CustomActivation {
            name: custom.name().to_owned(),
        }),
        None => Ok(()),
    }
}

/// The form of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// Readable, and exact to the last bit all the same.
    Json,
    /// Compact and checksummed.
    #[default]
    Binary,
}

impl Form {
    /// JSON for a name ending in `.json`, else binary.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        let json = path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
        if json { Self::Json } else { Self::Binary }
    }
}

/// Writes to a file in the form that its name asks for (see [`Form::of`]).
///
/// # Errors
/// [`Error::Io`] naming the file; [`Error::CustomActivation`].
pub fn save<T: Persist>(value: &T, path: impl AsRef<Path>) -> Result<(), Error> {
    let path = path.as_ref();
    let bytes = match Form::of(path) {
        Form::Json => to_json(value)?.into_bytes(),
        Form::Binary => to_bytes(value)?,
    };
    replace(path, &bytes).map_err(|reason| Error::Io {
        action: "write",
        path: path.to_owned(),
        reason,
    })
}

/// Reads a file of either form, whatever its name.
///
/// # Errors
/// [`Error::Io`]; [`Error::File`] with the path and what [`from_bytes`] says.
pub fn load<T: Persist>(path: impl AsRef<Path>) -> Result<T, Error> {
    let path = path.as_ref();
    let mut bytes = Vec::new();
    fs::File::open(path)
        .and_then(|mut file| file.read_to_end(&mut bytes))
        .map_err(|reason| Error::Io {
            action: "read",
            path: path.to_owned(),
            reason,
        })?;
    from_bytes(&bytes).map_err(|reason| Error::File {
        path: path.to_owned(),
        reason: Box::new(reason),
    })
}

/// Readable JSON, ending with a line end.
///
/// # Errors
/// [`Error::CustomActivation`].
pub fn to_json<T: Persist>(value: &T) -> Result<String, Error> {
    value.check()?;
    let envelope = Envelope {
        format: T::KIND.to_owned(),
        version: T::VERSION,
        scalar: T::SCALAR.to_owned(),
        contents: value,
    };
    let mut text = serde_json::to_string_pretty(&envelope).map_err(contents::<T>)?;
    text.push('\n');
    Ok(text)
}

/// Compact binary; see the [module](self) for its layout.
///
/// # Errors
/// [`Error::CustomActivation`].
pub fn to_bytes<T: Persist>(value: &T) -> Result<Vec<u8>, Error> {
    value.check()?;
    let payload = postcard::to_stdvec(value).map_err(contents::<T>)?;
    let mut bytes = Vec::with_capacity(payload.len() + 64);
    bytes.extend(MAGIC);
    bytes.extend(T::VERSION.to_le_bytes());
    for name in [T::KIND, T::SCALAR] {
        bytes.push(u8::try_from(name.len()).unwrap_or(u8::MAX));
        bytes.extend(name.as_bytes());
    }
    bytes.extend((payload.len() as u64).to_le_bytes());
    bytes.extend(crc32fast::hash(&payload).to_le_bytes());
    bytes.extend(payload);
    Ok(bytes)
}

/// Reads what [`to_bytes`] or [`to_json`] wrote, JSON also with a byte order mark or white space before
/// it, as editors leave it.
///
/// # Errors
/// Every variant of [`Error`] but [`Error::Io`], [`Error::File`] and [`Error::CustomActivation`].
pub fn from_bytes<T: Persist>(bytes: &[u8]) -> Result<T, Error> {
    let text = bytes.strip_prefix(MARK).unwrap_or(bytes);
    match text.trim_ascii_start() {
        [b'{', ..] => from_json(text),
        _ => from_binary(bytes),
    }
}

/// What a JSON file holds around its contents.
#[derive(Serialize, Deserialize)]
struct Envelope<T> {
    format: String,
    version: u32,
    scalar: String,
    contents: T,
}

fn from_json<T: Persist>(text: &[u8]) -> Result<T, Error> {
    // The head first: a future layout must not fail as nonsense in the present one.
    let head: Envelope<serde::de::IgnoredAny> =
        serde_json::from_slice(text).map_err(contents::<T>)?;
    check_head::<T>(head.version, &head.format, &head.scalar)?;
    let envelope: Envelope<T> = serde_json::from_slice(text).map_err(contents::<T>)?;
    Ok(envelope.contents)
}

fn from_binary<T: Persist>(bytes: &[u8]) -> Result<T, Error> {
    let mut reader = Reader { bytes, at: 0 };
    // A file of nothing, or of the beginning, is cut short.
    if !bytes.starts_with(MAGIC) && !MAGIC.starts_with(bytes) {
        return Err(Error::Foreign);
    }
    reader.take(MAGIC.len())?;
    let version = u32::from_le_bytes(reader.array()?);
    let mut name = || -> Result<String, Error> {
        let [length] = reader.array()?;
        Ok(String::from_utf8_lossy(reader.take(length.into())?).into_owned())
    };
    let (kind, scalar) = (name()?, name()?);
    check_head::<T>(version, &kind, &scalar)?;
    let expected_length = u64::from_le_bytes(reader.array()?);
    let expected = u32::from_le_bytes(reader.array()?);
    let payload = &bytes[reader.at..];
    if payload.len() as u64 != expected_length {
        return Err(Error::Length {
            at: reader.at,
            found: payload.len() as u64,
            expected: expected_length,
        });
    }
    let found = crc32fast::hash(payload);
    if found != expected {
        return Err(Error::Checksum { found, expected });
    }
    let (value, rest) = postcard::take_from_bytes(payload).map_err(contents::<T>)?;
    if !rest.is_empty() {
        let at = bytes.len() - rest.len();
        return Err(Error::Length {
            at,
            found: rest.len() as u64,
            expected: 0,
        });
    }
    Ok(value)
}

fn check_head<T: Persist>(version: u32, kind: &str, scalar: &str) -> Result<(), Error> {
    if kind != T::KIND {
        return Err(Error::Kind {
            found: kind.to_owned(),
            expected: T::KIND,
        });
    }
    if scalar != T::SCALAR {
        return Err(Error::ScalarType {
            found: scalar.to_owned(),
            expected: T::SCALAR,
        });
    }
    if version > T::VERSION {
        return Err(Error::Future {
            found: version,
            supported: T::VERSION,
        });
    }
    if version < T::VERSION {
        return Err(Error::Past {
            found: version,
            supported: T::VERSION,
        });
    }
    Ok(())
}

fn misfit(found: u64, expected: u64) -> &'static str {
    if found < expected {
        "the file is cut short"
    } else {
        "the file goes on after its end"
    }
}

fn contents<T: Persist>(reason: impl std::fmt::Display) -> Error {
    Error::Contents {
        kind: T::KIND,
        reason: brief(&reason.to_string()),
    }
}

/// What a file says, made fit for an error: one line, and not a long one.
fn brief(text: &str) -> String {
    const MAX_LENGTH: usize = 200;
    let printable = |c: char| if c.is_control() { ' ' } else { c };
    let mut brief: String = text.chars().take(MAX_LENGTH).map(printable).collect();
    if brief.len() < text.len() {
        brief.push_str("...");
    }
    brief
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let rest = &self.bytes[self.at..];
        let Some(taken) = rest.get(..count) else {
            let (found, expected) = (rest.len() as u64, count as u64);
            return Err(Error::Length {
                at: self.at,
                found,
                expected,
            });
        };
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }
}
