//! Why a model cannot be exported.

use std::path::PathBuf;

use thiserror::Error;

/// Why a model cannot be exported.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A neuron's function that has no source, such as one of the user's own.
    #[error("cannot export the activation '{name}'")]
    Activation {
        /// What it is called.
        name: String,
    },
    /// A network input that has no source.
    #[error("cannot export the input '{name}'")]
    Input {
        /// What it is called.
        name: String,
    },
    /// A number beyond single precision.
    #[error("cannot export {what}: {value} is beyond single precision")]
    Single {
        /// Which.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// A name that Mitsuba uses itself.
    #[error("Mitsuba 3 has a material called '{name}' itself: choose another with --name")]
    Taken {
        /// The name.
        name: String,
    },
    /// A name that no language takes for its functions.
    #[error("'{name}' cannot begin the name of a function (expected letters, digits and _)")]
    Name {
        /// The name that was given.
        name: String,
    },
    /// The file's extension says nothing of how to write it.
    #[error(
        "cannot tell the format of {} (expected .glsl, .wgsl, .hlsl, .c, .binary, .bsdf, .py or .onnx, or a format)",
        path.display()
    )]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// A model that single precision would spoil.
    #[error(
        "single precision would move its values by {found:.2e} 1/sr, more than {}: fit it anew, with \
         fewer neurons (fit --neurons N), or export a table, which is made in double precision \
         (--format merl)",
        allowed(*limit, *held_out)
    )]
    Precision {
        /// Root mean square of what it would move values by, in 1/sr.
        found: f64,
        /// The most that it may, in 1/sr.
        limit: f64,
        /// The model's own held-out RMSE, in 1/sr, where it is known.
        held_out: Option<f64>,
    },
    /// A model with a grain, for a table that has no place for one.
    #[error(
        "a MERL table holds isotropic materials only, and this one has a grain: export source code (--format \
         glsl, wgsl, hlsl or c), or fit it without (fit --features highlight)"
    )]
    Anisotropic,
    /// Channels that are neither colours nor a spectrum, or a spectrum for a file of colours.
    #[error(
        "expected channels that are red, green and blue by name{}, found {channels}",
        spectra(*channels)
    )]
    Colours {
        /// How many channels there are.
        channels: usize,
    },
    /// A model that is no network.
    #[error("only a network can be exported in this form, and a table (--exact) is none")]
    NoNetwork,
}

/// What else would do, in words.
fn spectra(channels: usize) -> &'static str {
    match channels {
        1..=3 => "",
        _ => ", or wavelengths such as '550 nm' and a file of spectra (--spectral)",
    }
}

/// What may be moved, in words.
fn allowed(limit: f64, held_out: Option<f64>) -> String {
    match held_out {
        Some(error) => format!("{limit:.2e}, a quarter of its own held-out error {error:.2e}"),
        None => format!("{limit:.2e}, a hundredth of the values themselves"),
    }
}
