//! A scene as a TOML file describes it.
//!
//! ```toml
//! [image]
//! width = 640
//! height = 360
//!
//! [camera]
//! position = [0, 1, 6]
//! target = [0, 0, 0]
//! fov = 30
//!
//! [material.felt]
//! curet = "Felt"
//!
//! [[sphere]]
//! center = [0, 0, 0]
//! radius = 1
//! material = "felt"
//!
//! [[directional]]
//! towards = [-1, 1, 1]
//! irradiance = [3, 3, 3]
//! ```
//!
//! Lengths are in any one unit, angles in degrees, light in linear sRGB. `y` is up unless the
//! camera says otherwise. Files are found relative to the scene's own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;

use crate::error::{Error, Place, Result};

/// A point, direction or colour as written in a file.
pub type Triple = [f64; 3];

const WHITE: Triple = [1.0; 3];

/// A scene: what one TOML file holds, with a table `M` for each material, which a
/// [`MaterialLoader`](crate::MaterialLoader) understands.
///
/// ```
/// type Scene = elm_brdf_render::Scene<toml::Table>;
/// let text = "
///     [image]
///     width = 4
///     height = 4
///     [camera]
///     position = [0, 0, 5]
///     target = [0, 0, 0]
///     [material.grey]
///     analytic = 'lambert'
///     albedo = 0.5
///     [[sphere]]
///     center = [0, 0, 0]
///     radius = 1
///     material = 'grey'
///     [environment]
///     radiance = [1, 1, 1]
/// ";
/// let scene = Scene::parse(text, "example.toml".as_ref())?;
/// assert_eq!(scene.image.width, 4);
/// let error = Scene::parse("[image]\nwidht = 4", "example.toml".as_ref()).unwrap_err();
/// assert!(error.to_string().starts_with("example.toml, line 2: unknown field `widht`"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, bound(deserialize = "M: Deserialize<'de>"))]
pub struct Scene<M> {
    /// Size and quality of the picture.
    pub image: Image,
    /// The viewer.
    pub camera: Camera,
    /// Materials by the names that shapes use.
    #[serde(default)]
    pub material: BTreeMap<String, Spanned<M>>,
    /// Light from infinitely far away.
    #[serde(default)]
    pub directional: Vec<Spanned<Directional>>,
    /// Light from a point.
    #[serde(default)]
    pub point: Vec<Spanned<Point>>,
    /// Light from a rectangle, which is visible.
    #[serde(default)]
    pub area: Vec<Spanned<Area>>,
    /// Light from everywhere, which is the background.
    pub environment: Option<Spanned<Environment>>,
    /// Spheres.
    #[serde(default)]
    pub sphere: Vec<Spanned<Sphere>>,
    /// Infinite planes.
    #[serde(default)]
    pub plane: Vec<Spanned<Plane>>,
    /// Rectangles (parallelograms).
    #[serde(default)]
    pub rectangle: Vec<Spanned<Rectangle>>,
    /// Triangle meshes.
    #[serde(default)]
    pub mesh: Vec<Spanned<Mesh>>,
    /// Where the text came from.
    #[serde(skip)]
    source: Source,
}

/// The text of a scene, to name lines in errors.
#[derive(Debug, Clone, Default)]
struct Source {
    file: PathBuf,
    /// Where each line ends.
    line_ends: Vec<usize>,
}

/// Size and quality of the picture.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples per pixel, at most [`Scene::MAX_SAMPLES`]; a single one is taken at the centre.
    #[serde(default = "default_samples")]
    pub samples: u32,
    /// Stops by which the PNG is made brighter; the EXR is as computed.
    #[serde(default)]
    pub exposure: f64,
    /// Surfaces that light may meet on its way: 1 is direct light only.
    #[serde(default = "default_depth")]
    pub depth: u32,
    /// Seed of the samples.
    #[serde(default)]
    pub seed: u32,
    /// Words at the foot of the picture. `{data}` stands for where the materials come from.
    #[serde(default)]
    pub caption: String,
}

fn default_samples() -> u32 {
    16
}

fn default_depth() -> u32 {
    1
}

/// The viewer. With `height` the projection is orthographic, else perspective.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// The eye.
    pub position: Triple,
    /// The point in the middle of the picture.
    pub target: Triple,
    /// The direction that points up in the picture.
    #[serde(default = "default_up")]
    pub up: Triple,
    /// Angle of view from the bottom to the top, in degrees.
    pub fov: Option<f64>,
    /// Height of the view of an orthographic camera.
    pub height: Option<f64>,
}

fn default_up() -> Triple {
    [0.0, 1.0, 0.0]
}

/// Light from infinitely far away.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Directional {
    /// Direction towards the light.
    pub towards: Triple,
    /// Irradiance on a surface that faces the light.
    #[serde(default = "white")]
    pub irradiance: Triple,
}

/// Light from a point.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Where.
    pub position: Triple,
    /// Radiant intensity: irradiance at distance 1.
    #[serde(default = "white")]
    pub intensity: Triple,
}

/// Light from one side of a rectangle, the side that `edge_u` x `edge_v` points to.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Area {
    /// A corner.
    pub corner: Triple,
    /// From the corner to the next.
    pub edge_u: Triple,
    /// From the corner to the one before.
    pub edge_v: Triple,
    /// Radiance.
    #[serde(default = "white")]
    pub radiance: Triple,
}

/// Light from everywhere: constant, or a picture in latitude and longitude whose middle column
/// lies towards -z, to the right +x.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Environment {
    /// Radiance, or factor on the picture.
    #[serde(default = "white")]
    pub radiance: Triple,
    /// OpenEXR or Radiance HDR.
    pub file: Option<PathBuf>,
    /// A built-in picture instead of a file: `studio`.
    pub builtin: Option<String>,
    /// Turn about the vertical in degrees.
    #[serde(default)]
    pub rotation: f64,
    /// Whether the camera sees it.
    #[serde(default = "yes")]
    pub visible: bool,
}

fn white() -> Triple {
    WHITE
}

fn yes() -> bool {
    true
}

/// A sphere.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Its centre.
    #[serde(alias = "centre")]
    pub center: Triple,
    /// Its radius.
    pub radius: f64,
    /// Name of its material.
    pub material: Spanned<String>,
    /// Words below it.
    pub label: Option<String>,
}

/// An infinite plane.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point on it.
    pub point: Triple,
    /// Its normal.
    pub normal: Triple,
    /// Name of its material.
    pub material: Spanned<String>,
}

/// A rectangle, seen from both sides.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    /// A corner.
    pub corner: Triple,
    /// From the corner to the next.
    pub edge_u: Triple,
    /// From the corner to the one before.
    pub edge_v: Triple,
    /// Name of its material.
    pub material: Spanned<String>,
}

/// A triangle mesh, seen from both sides.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// OBJ file.
    pub file: Option<PathBuf>,
    /// A built-in mesh instead of a file: `torus-knot`.
    pub builtin: Option<String>,
    /// Name of its material.
    pub material: Spanned<String>,
    /// Factor on its size.
    #[serde(default = "one")]
    pub scale: f64,
    /// Turns about x, y and z, in this order, in degrees.
    #[serde(default)]
    pub rotate: Triple,
    /// Where its origin goes.
    #[serde(default)]
    pub translate: Triple,
}

fn one() -> f64 {
    1.0
}

impl<M> Scene<M> {
    /// Most samples per pixel.
    pub const MAX_SAMPLES: u32 = 1 << 16;

    /// Where the bytes of `entry` stand.
    pub(crate) fn place<T>(&self, entry: &Spanned<T>) -> Place {
        Place {
            file: self.source.file.clone(),
            line: Some(self.source.line(entry.span().start)),
        }
    }

    /// The file as a whole.
    pub(crate) fn whole(&self) -> Place {
        Place {
            file: self.source.file.clone(),
            line: None,
        }
    }

    /// A file named in this one.
    pub(crate) fn beside(&self, file: &Path) -> PathBuf {
        match self.source.file.parent() {
            Some(dir) => dir.join(file),
            None => file.to_owned(),
        }
    }
}

impl<M: DeserializeOwned> Scene<M> {
    /// Reads a scene from a file.
    ///
    /// # Errors
    /// [`Error::Read`], and as [`parse`](Self::parse).
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|reason| Error::Read {
            path: path.to_owned(),
            reason,
        })?;
        Self::parse(&text, path)
    }

    /// Reads a scene from a text; `file` is what errors call it, and relative to which other
    /// files are found.
    ///
    /// # Errors
    /// [`Error::Syntax`] with the line, for a text that is no TOML, and for a field that is
    /// missing, unknown or of another kind.
    pub fn parse(text: &str, file: &Path) -> Result<Self> {
        let source = Source {
            file: file.to_owned(),
            line_ends: text.match_indices('\n').map(|(at, _)| at).collect(),
        };
        match toml::from_str::<Self>(text) {
            Ok(scene) => Ok(Self { source, ..scene }),
            Err(error) => Err(Error::Syntax {
                place: Place {
                    line: error.span().map(|span| source.line(span.start)),
                    file: source.file,
                },
                message: error.message().lines().collect::<Vec<_>>().join(" "),
            }),
        }
    }
}

impl Source {
    fn line(&self, offset: usize) -> usize {
        1 + self.line_ends.partition_point(|&end| end < offset)
    }
}
