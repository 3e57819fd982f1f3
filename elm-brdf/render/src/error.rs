//! What can be wrong with a scene: each error is one line that names the file, the line and what
//! was expected.

use std::path::PathBuf;

/// A place in a scene file: its name and, where known, the line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file, or the name of a built-in scene.
    pub file: PathBuf,
    /// Counted from 1.
    pub line: Option<usize>,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}, line {line}", self.file.display()),
            None => write!(f, "{}", self.file.display()),
        }
    }
}

/// Result of everything in this crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a scene could not be read or rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened or read.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        reason: std::io::Error,
    },
    /// The file is not TOML, or has a field that means nothing here.
    #[error("{place}: {message}")]
    Syntax {
        /// Where.
        place: Place,
        /// What the TOML parser expected.
        message: String,
    },
    /// A shape asks for a material that the scene does not define.
    #[error("{place}: unknown material '{name}' (expected one of: {known})")]
    UnknownMaterial {
        /// Where.
        place: Place,
        /// The name that was given.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A value that is not possible.
    #[error("{place}: {what} is {found}, expected {expected}")]
    Value {
        /// Where.
        place: Place,
        /// The field.
        what: &'static str,
        /// Its value.
        found: String,
        /// What it may be.
        expected: &'static str,
    },
    /// More of something than this renderer takes on.
    #[error("{place}: {found} {what}, expected at most {limit}")]
    TooMany {
        /// Where.
        place: Place,
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: u64,
        /// How many there may be.
        limit: u64,
    },
    /// There is no built-in scene of that name.
    #[error("unknown built-in scene '{name}' (expected one of: {known})")]
    UnknownBuiltin {
        /// The name that was given.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A sheet whose panels do not fit together.
    #[error(
        "panel {panel} of the sheet: expected the size of the first, and a difference of panels before it"
    )]
    Sheet {
        /// The panel, counted from 0.
        panel: usize,
    },
    /// A mesh that cannot be used.
    #[error("{}: {problem}", path.display())]
    Mesh {
        /// The OBJ file.
        path: PathBuf,
        /// What is wrong with it.
        problem: MeshProblem,
    },
    /// A picture that cannot be read.
    #[error("cannot read the picture {}: {reason}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        reason: String,
    },
    /// The file's extension says nothing of how to write it.
    #[error("cannot tell the picture format of {} (expected .png or .exr)", path.display())]
    PictureFormat {
        /// The file.
        path: PathBuf,
    },
    /// A material that cannot be made.
    #[error("{place}: material '{name}': {reason}")]
    Material {
        /// Where it is defined.
        place: Place,
        /// Its name.
        name: String,
        /// Why not.
        reason: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A model with a number of channels that is no colour.
    #[error("a model of {channels} channels cannot be rendered: expected 1 or 3")]
    Channels {
        /// Its channels.
        channels: usize,
    },
    /// A colour to multiply a material by that is none.
    #[error("tint is {found:?}, expected three numbers from 0 to 1e6")]
    Tint {
        /// What was found.
        found: [f64; 3],
    },
    /// A reflectance could not be evaluated.
    #[error(transparent)]
    Evaluation(#[from] elm_datasets::brdf::EvalError),
    /// A picture could not be encoded.
    #[error("cannot encode the picture: {reason}")]
    Encode {
        /// What the encoder said.
        reason: String,
    },
    /// A worker thread pool could not be started.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the operating system said.
        reason: String,
    },
}

/// What is wrong with a mesh.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshProblem {
    /// Not an OBJ file.
    #[error("not a readable OBJ file ({0})")]
    Format(String),
    /// A vertex is not a point.
    #[error("vertex {0} is not finite")]
    Vertex(usize),
    /// Every triangle has zero area, or there is none.
    #[error("no triangle with an area")]
    Empty,
    /// More triangles than fit.
    #[error("{found} triangles, expected at most {limit}")]
    TooLarge {
        /// How many there are.
        found: usize,
        /// How many there may be.
        limit: usize,
    },
}
