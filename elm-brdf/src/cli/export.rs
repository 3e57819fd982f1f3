//! `elm-brdf export`: a model as source for other programs, or as a table.

use std::path::{Path, PathBuf};

use clap::Args;

use super::common::{library, one_of, usage};
use super::samples::Reading;
use super::{Failure, overwrite, say};
use crate::error::Error;
use crate::export::{ExportError, Format, Language, header, merl_table, source};
use crate::file;
use crate::model::BrdfModel;
use crate::recipes;
use crate::scene_materials::MaterialTable;

/// Write a model as source code or as a table, for other programs.
///
/// The source is one function of two directions in the surface's frame, NAME_eval, with the network
/// inside, in single precision: GLSL, WGSL, HLSL or C. It is refused where single precision would
/// move the values by more than a quarter of the model's own held-out error. The table is a MERL
/// .binary file, in which light and viewer are one: of a model that tells them apart it holds the
/// mean.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A saved model, or 'curet:NAME' or 'csv:FILE' for one that is fitted now.
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
    let brdf = match arguments.model.strip_prefix("csv:") {
        Some(file) => {
            let samples = reading.read(file)?.samples.in_rgb_order();
            let pairs = &samples.directions;
            recipes::network(None).fit(pairs, samples.values.view())?
        }
        None => {
            let library = library(reading.folder.data.as_deref())?;
            library
                .model(&asked(&arguments.model), Path::new(""))?
                .model
        }
    };
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

/// The material that a scene would call so.
fn asked(model: &str) -> MaterialTable {
    let none = MaterialTable::default();
    match model.split_once(':') {
        Some(("curet", name)) => MaterialTable {
            curet: Some(name.to_owned()),
            ..none
        },
        _ => MaterialTable {
            model: Some(model.into()),
            ..none
        },
    }
}
