//! `elm-brdf predict`: values of a saved model at directions of one's own.

use std::path::PathBuf;

use clap::Args;
use elm_datasets::Brdf;
use elm_datasets::scattered::{Columns, DirectionTable, Options};

use super::samples::AngleReading;
use super::{Failure, overwrite, print, say};
use crate::error::Error;
use crate::file;
use crate::model::BrdfModel;

/// Evaluate a saved model at directions of one's own.
///
/// Writes the columns of directions as they were given and a column for each channel: BRDF in 1/sr, without
/// the cosine, in the order of the rows. All other columns are passed over.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A file that 'fit' has written.
    model: PathBuf,
    /// A table of directions, with the columns that 'fit' reads: theta_i, phi_i, theta_o, phi_o, or unit
    /// vectors; - for standard input.
    directions: String,
    /// The table of values, CSV; standard output if not given.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    angles: AngleReading,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let inputs = [
        arguments.model.clone(),
        PathBuf::from(&arguments.directions),
    ];
    let outputs = arguments.output.iter().map(PathBuf::as_path);
    overwrite::refuse(outputs, &inputs)?;
    let model: BrdfModel = file::load(&arguments.model)?;
    let options = Options {
        unit: arguments.angles.unit(),
        ..Options::default()
    };
    let columns = Columns {
        angles: arguments.angles.constants()?,
        ..Columns::default()
    };
    let table = DirectionTable::read(&arguments.directions, &options, &columns)?;
    for note in &table.notes {
        say(&format!("note: {}: {note}", arguments.directions));
    }
    let values = model.eval(&table.pairs).map_err(Error::from)?;
    let mut text = Vec::new();
    let path = || {
        arguments
            .output
            .clone()
            .unwrap_or_else(|| "standard output".into())
    };
    table
        .write(&mut text, &model.channel_names(), values.view())
        .map_err(|reason| Error::Write {
            path: path(),
            reason,
        })?;
    match &arguments.output {
        Some(path) => Ok(file::replace(path, &text)?),
        None => print(&String::from_utf8_lossy(&text)),
    }
}
