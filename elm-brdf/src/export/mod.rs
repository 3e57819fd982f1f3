//! Models for other programs: shader and C source with the network inside, plug-ins of Mitsuba 3, ONNX
//! graphs, and tables of the MERL and RGL databases.
//!
//! [`source`] writes one self-contained function that takes two directions in the surface's frame
//! (unit vectors, the normal along $+z$, towards the light and towards the viewer) and returns the
//! BRDF in 1/sr as linear red, green and blue. It is black below either horizon, never negative,
//! and never above the model's own ceiling. All its arithmetic is in single precision:
//! standardisation is folded into the weights beforehand, in double precision. Sine, tangens
//! hyperbolicus and arc tangent are its own, since shader languages leave the accuracy of theirs
//! open, and output weights magnify what activations lose. Beside it stand functions that draw a direction
//! for a path tracer, and give the density of one: the [mixture of lobes](elm_datasets::mixture) that the
//! renderer samples by.
//!
//! [`merl`] tabulates any model in the format of the MERL database, [`bsdf()`] as the tensor file that
//! Mitsuba 3 and pbrt-v4 render; [`plugin`] writes a network as a plug-in of Mitsuba 3, [`onnx()`] as a
//! graph.
//!
//! ```
//! use elm::{Activation, ElmParams, solve::Ridge};
//! use elm_brdf::export::{Language, source};
//! use elm_brdf::{features::Features, target_transform::TargetTransform, model::BrdfParams};
//! use elm_datasets::{Invalid, MaterialId, synthetic};
//!
//! let data = synthetic::measurements(1, &[MaterialId::new(39)?], Invalid::Clamp);
//! let samples = data.samples(0).ok_or("no such material")?;
//! let params = BrdfParams {
//!     features: Features::ReciprocalCosines,
//!     transform: TargetTransform::default_log(),
//!     network: ElmParams::new(40).with_activation(Activation::Sine).with_solver(Ridge::leave_one_out()),
//! };
//! let model = params.fit_model(&samples.directions, samples.values.view())?;
//! let shader = source(&model, Language::Glsl, "felt")?;
//! assert!(shader.contains("vec3 felt_eval(vec3 light, vec3 viewer)"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod activations;
mod bsdf;
mod dialect;
pub(crate) mod error;
mod expression;
mod inputs;
mod mitsuba;
mod network;
mod onnx;
mod preamble;
mod precision;
mod sampler;
mod spectrum;
mod values;
mod write;

use std::path::Path;
use std::str::FromStr;

use elm_datasets::merl::Merl;

pub use bsdf::bsdf;
pub use dialect::Language;
pub use elm::onnx::Precision as OnnxPrecision;
pub use error::ExportError;
pub use mitsuba::plugin;
pub use onnx::onnx;
pub use precision::{SinglePrecision, check_precision};
pub use spectrum::PRIMARIES;
pub use write::{header, source};

/// Source of `NAME_eval` alone, for what samples no directions.
#[cfg(feature = "render")]
pub(crate) fn evaluator(model: &BrdfModel, language: Language, name: &str) -> Result<String> {
    write::evaluator(model, language, name, false)
}

use crate::error::{Error, Result};
use crate::model::BrdfModel;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;

/// What a model can be exported to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// Source code.
    Source(Language),
    /// A table in the format of the MERL database.
    Merl,
    /// A tensor file of the RGL database, for Mitsuba 3 and pbrt-v4.
    Bsdf,
    /// A plug-in of Mitsuba 3, in Python.
    Mitsuba,
    /// An ONNX graph.
    Onnx,
}

impl Format {
    /// Every format there is.
    pub const ALL: [Self; 8] = [
        Self::Source(Language::Glsl),
        Self::Source(Language::Wgsl),
        Self::Source(Language::Hlsl),
        Self::Source(Language::C),
        Self::Merl,
        Self::Bsdf,
        Self::Mitsuba,
        Self::Onnx,
    ];

    /// The format's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Source(language) => language.name(),
            Self::Merl => "merl",
            Self::Bsdf => "bsdf",
            Self::Mitsuba => "mitsuba",
            Self::Onnx => "onnx",
        }
    }

    /// The format that a file's extension asks for: its name, or `frag`, `vert`, `h`, `binary`, `py`.
    ///
    /// # Errors
    /// [`ExportError::Format`] for another extension.
    pub fn of(path: &Path) -> Result<Self, ExportError> {
        let unknown = || ExportError::Format {
            path: path.to_owned(),
        };
        let extension = path.extension().and_then(|e| e.to_str());
        match extension.ok_or_else(unknown)? {
            "frag" | "vert" => Ok(Self::Source(Language::Glsl)),
            "h" => Ok(Self::Source(Language::C)),
            "binary" => Ok(Self::Merl),
            "py" => Ok(Self::Mitsuba),
            name => name.parse().map_err(|_| unknown()),
        }
    }
}

impl FromStr for Format {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Error::find("format", name, Self::ALL, Self::name)
    }
}

/// The model in the format of the MERL database; one channel stands for all three. Negative
/// values become 0, and what lies below the horizon has no value.
///
/// A cell of such a table is at once a pair of directions and the same with light and viewer
/// exchanged, for it knows the azimuth of the difference angle from 0 to 180 degrees only. A model
/// that tells the two apart is put in as the mean of both.
///
/// # Errors
/// [`Error::Channels`] for a model of another number of channels than 1 or 3,
/// [`ExportError::Anisotropic`]; whatever the model's own evaluation reports.
pub fn merl(brdf: &dyn Brdf) -> Result<Merl> {
    Ok(merl_table(brdf)?.0)
}

/// As [`merl`], with how far the model is from reciprocity over the cells of the table: the root
/// mean square of the difference that exchanging light and viewer makes, as a part of that of the
/// values. 0 for a model that is reciprocal.
///
/// # Errors
/// As for [`merl`].
pub fn merl_table(brdf: &dyn Brdf) -> Result<(Merl, f64)> {
    /// Pairs at a time.
    const BLOCK: usize = 1 << 15;
    let reordered = BrdfModel::of(brdf).map(BrdfModel::in_color).transpose()?;
    let brdf = match &reordered {
        Some(network) => network as &dyn Brdf,
        None => brdf,
    };
    let channels = brdf.channels();
    if channels != 1 && channels != 3 {
        return Err(Error::Channels { channels });
    }
    if !brdf.is_isotropic() {
        return Err(ExportError::Anisotropic.into());
    }
    // The table asks for one pair at a time, and a network answers many at once far faster: the
    // first pass takes the questions down, the second gives the answers in the same order.
    let mut asked: Vec<DirectionPair> = Vec::new();
    Merl::from_fn(|directions| {
        asked.push(*directions);
        [0.0; 3]
    });
    let known = BrdfModel::of(brdf).is_some_and(|m| m.features().is_reciprocal());
    let mut answers = Vec::with_capacity(asked.len());
    let (mut differences, mut squares) = (0.0, 0.0);
    for pairs in asked.chunks(BLOCK) {
        let values = brdf.eval(pairs)?;
        let exchanged = if known {
            None
        } else {
            let swapped: Vec<DirectionPair> = pairs.iter().map(|pair| pair.swapped()).collect();
            Some(brdf.eval(&swapped)?)
        };
        for row in 0..pairs.len() {
            answers.push([0, 1, 2].map(|channel: usize| {
                let place = (row, channel.min(channels - 1));
                let value = values[place].max(0.0);
                let Some(exchanged) = &exchanged else {
                    return value;
                };
                let other = exchanged[place].max(0.0);
                let mean = 0.5 * value + 0.5 * other;
                differences += (value - other) * (value - other);
                squares += mean * mean;
                mean
            }));
        }
    }
    let mut answers = answers.into_iter();
    // Both passes ask alike, so there is an answer for every question.
    let table = Merl::from_fn(|_| answers.next().unwrap_or([f64::NAN; 3]));
    let apart = if differences > 0.0 {
        (differences / f64::max(squares, f64::MIN_POSITIVE)).sqrt()
    } else {
        0.0
    };
    Ok((table, apart))
}
