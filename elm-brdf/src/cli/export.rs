//! `elm-brdf export`: a model as source for other programs, or as a table.

use std::path::{Path, PathBuf};

use clap::Args;
use elm_datasets::{Brdf, STANDARD_INPUT};

use super::common::{one_of, usage};
use super::samples::Reading;
use super::{Failure, overwrite, say};
use crate::error::Error;
use crate::export::{
    ExportError, Format, Language, OnnxPrecision, bsdf, header, merl_table, onnx, plugin, source,
};
use crate::file;
use crate::model::BrdfModel;
use crate::recipes;
use crate::scene_materials::measured_table;

/// Write a model for other programs: as source code, as a file for a renderer, or as a table.
///
/// Source (.glsl, .wgsl, .hlsl, .c) has three functions of directions in the surface's frame, in single
/// precision: NAME_eval with the network inside, NAME_sample, which draws a direction for a path tracer, and
/// NAME_pdf, its density. It is refused where single precision would move the values by more than a quarter
/// of the model's own held-out error.
///
/// Mitsuba 3 takes .bsdf files by its plug-in 'measured': colours in RGB variants, spectra (--spectral) in
/// spectral variants. pbrt-v4's material 'measured' takes spectra. A .py file is a plug-in of Mitsuba's with
/// the network inside, for all variants.
///
/// An .onnx file is a graph with inputs 'light' and 'viewer' and the output 'values', BRDF in 1/sr of each
/// channel, computed in double precision.
///
/// A MERL .binary file knows no difference between light and viewer: of a model that tells them apart it
/// holds the mean.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A saved model; or whatever 'fit' takes, to which a network is fitted now: a file (.csv or another
    /// table, MERL .binary, RGL .bsdf, pbrt-v2 .brdf), - for standard input, or 'curet:NAME'.
    model: String,
    /// The file: .glsl, .wgsl, .hlsl, .c, .h (guarded, functions static), .bsdf, .py, .onnx or .binary,
    /// unless --format says what it is.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Form of the file.
    #[arg(long, value_name = "FORM", value_parser = one_of::<Format>(Format::ALL.map(Format::name)))]
    format: Option<Format>,
    /// What the names of the source's functions begin with, and what Mitsuba calls the plug-in.
    #[arg(long, default_value = "elm")]
    name: String,
    /// Resample a measured table (MERL .binary, RGL .bsdf) itself, not a network fitted to it.
    #[arg(long)]
    exact: bool,
    /// Spectra in a .bsdf file, for pbrt-v4 and Mitsuba's spectral variants; red, green and blue become
    /// spectra of these colours. Without it the file has colours, for Mitsuba's RGB variants.
    #[arg(long)]
    spectral: bool,
    /// Points along each side of a .bsdf file's tables, 4 to 256: as many as an error of 0.001 takes
    /// (log-cosine, over all directions) if not given.
    #[arg(long, value_name = "N")]
    resolution: Option<usize>,
    /// Inputs and outputs of an .onnx file as f64, in place of f32.
    #[arg(long)]
    double: bool,
    #[command(flatten)]
    reading: Reading,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let format = match arguments.format {
        Some(format) => format,
        None => Format::of(&arguments.output).map_err(usage)?,
    };
    if format != Format::Bsdf && (arguments.spectral || arguments.resolution.is_some()) {
        return Err(usage("--spectral and --resolution are for .bsdf files"));
    }
    if format != Format::Onnx && arguments.double {
        return Err(usage("--double is for .onnx files"));
    }
    let reading = &arguments.reading;
    let inputs = match arguments.model.strip_prefix("csv:") {
        Some(file) => reading.inputs(file),
        None => reading.inputs(&arguments.model),
    };
    overwrite::refuse([arguments.output.as_path()], &inputs)?;
    let exported = arguments.material(format)?;
    let brdf = &*exported.brdf;
    let network = || BrdfModel::of(brdf).ok_or(Error::Export(ExportError::NoNetwork));
    match format {
        Format::Bsdf => write_bsdf(arguments, exported)?,
        Format::Mitsuba => {
            let module = arguments.output.file_stem().unwrap_or_default();
            let text = plugin(network()?, &module.to_string_lossy(), &arguments.name)?;
            file::replace(&arguments.output, text.as_bytes())?;
        }
        Format::Onnx => {
            let precision = match arguments.double {
                true => OnnxPrecision::Double,
                false => OnnxPrecision::Single,
            };
            file::replace(&arguments.output, &onnx(network()?, precision)?)?;
        }
        Format::Merl => {
            let (table, apart) = merl_table(brdf)?;
            table.write(&arguments.output)?;
            if apart > 0.0 {
                say(&format!(
                    "note: the model tells light from viewer, and a MERL table cannot: it holds the \
                     mean of both orders, which differ by {:.2} % (root mean square)",
                    100.0 * apart
                ));
            }
        }
        Format::Source(language) => {
            let mut text = source(network()?, language, &arguments.name)?;
            if arguments.output.extension().is_some_and(|e| e == "h") && language == Language::C {
                text = header(&text, &arguments.name);
            }
            file::replace(&arguments.output, text.as_bytes())?;
        }
    }
    Ok(())
}

impl Arguments {
    /// The name of the measurements, if it is such a name.
    fn samples(&self) -> Result<Option<&str>, Failure> {
        let name = self.model.as_str();
        if let Some(file) = name.strip_prefix("csv:") {
            return Ok(Some(file));
        }
        if name.starts_with("curet:") || name.starts_with("synthetic:") || name == STANDARD_INPUT {
            return Ok(Some(name));
        }
        Ok(match elm_datasets::Format::of(name) {
            Ok(_) => Some(name),
            // What no reader of measurements knows is a model's file.
            Err(elm_datasets::Error::UnknownFormat { .. }) => None,
            Err(error) => return Err(error.into()),
        })
    }

    /// Whether a spectrum stays one, or becomes its color.
    fn keeps_spectra(&self, format: Format) -> bool {
        matches!(format, Format::Mitsuba | Format::Onnx) || format == Format::Bsdf && self.spectral
    }

    /// What is exported as `format`.
    fn material(&self, format: Format) -> Result<Exported, Failure> {
        if self.exact {
            let name = self.model.as_str();
            if name.starts_with("curet:") || name.starts_with("synthetic:") {
                return Err(no_table(name));
            }
            let table = measured_table(Path::new(name), !self.keeps_spectra(format));
            let (brdf, channels) = table.map_err(|error| match error {
                Error::UnknownName { .. }
                | Error::Data(elm_datasets::Error::UnknownFormat { .. }) => no_table(name),
                error => error.into(),
            })?;
            return Ok(Exported {
                brdf,
                channels,
                about: format!("{name}, resampled by elm-brdf"),
            });
        }
        let model = match self.samples()? {
            None => file::load::<BrdfModel>(Path::new(&self.model))?,
            Some(samples) => self.fitted(samples)?,
        };
        let model = if self.keeps_spectra(format) {
            model.in_rgb_order()?
        } else {
            model.in_color()?
        };
        let about = model.provenance();
        Ok(Exported {
            channels: about.channels.clone(),
            about: if about.data.is_empty() {
                "a material, learnt by elm-brdf".to_owned()
            } else {
                format!("{}, learnt by elm-brdf", about.data)
            },
            brdf: Box::new(model),
        })
    }

    /// The network of measurements.
    fn fitted(&self, samples: &str) -> Result<BrdfModel, Failure> {
        let material = self.reading.read(samples)?;
        let (pairs, values) = (&material.samples.directions, &material.samples.values);
        let fitted = recipes::network(None).fit(pairs, values.view())?;
        let model = BrdfModel::of(&*fitted).ok_or(Error::Export(ExportError::NoNetwork))?;
        let mut about = model.provenance().clone();
        about.data = material.source;
        about.channels = material.samples.channels;
        Ok(model.clone().with_provenance(about))
    }
}

fn no_table(name: &str) -> Failure {
    usage(format!(
        "--exact resamples a table, and {name} is none: expected a MERL .binary or an RGL .bsdf file"
    ))
}

/// What is exported: values in 1/sr, the names of their channels, and where they come from.
struct Exported {
    brdf: Box<dyn Brdf>,
    channels: Vec<String>,
    about: String,
}

fn write_bsdf(arguments: &Arguments, exported: Exported) -> Result<(), Failure> {
    let Exported {
        brdf,
        channels,
        about,
    } = exported;
    let (spectral, resolution) = (arguments.spectral, arguments.resolution);
    let found = bsdf(brdf, &channels, &about, spectral, resolution)?;
    file::replace(&arguments.output, &found.bytes)?;
    say(&format!(
        "{}: tables of {n} x {n}, {:.1} MB, log-cosine error {:.5} against the model",
        arguments.output.display(),
        found.bytes.len() as f64 / 1e6,
        found.log_cosine_error,
        n = found.resolution,
    ));
    Ok(())
}
