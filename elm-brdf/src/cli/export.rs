//! `elm-brdf export`: a model as source for other programs, or as a table.

use std::path::{Path, PathBuf};

use clap::Args;
use elm_datasets::{Brdf, STANDARD_INPUT};

use super::common::{one_of, usage};
use super::samples::Reading;
use super::{Failure, overwrite, say};
use crate::error::Error;
use crate::export::{ExportError, Format, Language, header, merl_table, source};
use crate::file;
use crate::model::BrdfModel;
use crate::recipes;
use crate::scene_materials::measured_table;

/// Write a model as source code or as a table, for other programs.
///
/// The source is one function of two directions in the surface's frame, NAME_eval, with the network
/// inside, in single precision: GLSL, WGSL, HLSL or C. It is refused where single precision would
/// move the values by more than a quarter of the model's own held-out error. The table is a MERL
/// .binary file, in which light and viewer are one: of a model that tells them apart it holds the
/// mean.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A saved model; or whatever 'fit' takes, to which a network is fitted now: a file (.csv or another
    /// table, MERL .binary, RGL .bsdf, pbrt-v2 .brdf), - for standard input, or 'curet:NAME'.
    model: String,
    /// The file: .glsl, .wgsl, .hlsl, .c, .h (guarded, functions static) or .binary, unless
    /// --format says what it is.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Form of the file.
    #[arg(long, value_name = "FORM", value_parser = one_of::<Format>(Format::ALL.map(Format::name)))]
    format: Option<Format>,
    /// What the names of the source's functions begin with.
    #[arg(long, default_value = "elm")]
    name: String,
    /// Resample a measured table (MERL .binary, RGL .bsdf) itself, not a network fitted to it.
    #[arg(long)]
    exact: bool,
    #[command(flatten)]
    reading: Reading,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let format = match arguments.format {
        Some(format) => format,
        None => Format::of(&arguments.output).map_err(usage)?,
    };
    let reading = &arguments.reading;
    let inputs = match arguments.model.strip_prefix("csv:") {
        Some(file) => reading.inputs(file),
        None => reading.inputs(&arguments.model),
    };
    overwrite::refuse([arguments.output.as_path()], &inputs)?;
    let brdf = arguments.material()?;
    match format {
        Format::Merl => {
            let (table, apart) = merl_table(&*brdf)?;
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
            let network = BrdfModel::of(&*brdf).ok_or(Error::Export(ExportError::NoNetwork))?;
            let mut text = source(network, language, &arguments.name)?;
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

    /// What is exported.
    fn material(&self) -> Result<Box<dyn Brdf>, Failure> {
        let samples = self.samples()?;
        if self.exact {
            let name = samples.unwrap_or(&self.model);
            return measured_table(Path::new(name)).map_err(|error| match error {
                Error::UnknownName { .. }
                | Error::Data(elm_datasets::Error::UnknownFormat { .. }) => usage(format!(
                    "--exact resamples a table, and {name} is none: expected a MERL .binary or an \
                         RGL .bsdf file"
                )),
                error => error.into(),
            });
        }
        let Some(samples) = samples else {
            let model: BrdfModel = file::load(Path::new(&self.model))?;
            return Ok(Box::new(model.in_color()?));
        };
        let material = self.reading.read(samples)?;
        let (source, samples) = (material.source, material.samples.in_rgb_order());
        let pairs = &samples.directions;
        let fitted = recipes::network(None).fit(pairs, samples.values.view())?;
        let Some(model) = BrdfModel::of(&*fitted) else {
            return Ok(fitted);
        };
        let mut about = model.provenance().clone();
        about.data = source;
        about.channels = samples.channels;
        Ok(Box::new(model.clone().with_provenance(about).in_color()?))
    }
}
