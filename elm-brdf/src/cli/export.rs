//! `elm-brdf export`: a model as source for other programs, or as a table.

use std::path::{Path, PathBuf};

use clap::Args;

use super::Failure;
use super::common::{library, one_of, usage};
use crate::error::Error;
use crate::export::{ExportError, Format, merl, source};
use crate::file;
use crate::render::{Supply, scene};

/// Write a model as source code or as a table, for other programs.
///
/// The source is one function of two directions in the surface's frame, NAME_eval, with the network
/// inside, in single precision: GLSL, WGSL, HLSL or C. The table is a MERL .binary file.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A saved model, or 'curet:NAME' or 'csv:FILE' for one that is fitted now.
    model: String,
    /// The file: .glsl, .wgsl, .hlsl, .c or .binary, unless --format says what it is.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Form of the file.
    #[arg(long, value_name = "FORM", value_parser = one_of::<Format>(Format::ALL.map(Format::name)))]
    format: Option<Format>,
    /// What the names of the source's functions begin with.
    #[arg(long, default_value = "elm")]
    name: String,
    /// Folder of CUReT files, for 'curet:NAME'.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let format = match arguments.format {
        Some(format) => format,
        None => Format::of(&arguments.output).map_err(usage)?,
    };
    let asked = asked(&arguments.model);
    let library = library(arguments.data.as_deref())?;
    let brdf = library.supply(&asked, Path::new(""))?.brdf;
    match format {
        Format::Merl => merl(&*brdf)?.write(&arguments.output)?,
        Format::Source(language) => {
            let network = brdf
                .as_network()
                .ok_or(Error::Export(ExportError::NoNetwork))?;
            let text = source(network, language, &arguments.name)?;
            file::replace(&arguments.output, text.as_bytes())?;
        }
    }
    Ok(())
}

/// The material that a scene would call so.
fn asked(model: &str) -> scene::Material {
    let none = scene::Material::default();
    match model.split_once(':') {
        Some(("curet", name)) => scene::Material {
            curet: Some(name.to_owned()),
            ..none
        },
        Some(("csv", file)) => scene::Material {
            csv: Some(file.into()),
            ..none
        },
        _ => scene::Material {
            model: Some(model.into()),
            ..none
        },
    }
}
