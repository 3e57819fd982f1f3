//! `elm-brdf prior`: learns a prior from other materials and saves it.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use elm::persist;
use elm_datasets::{Invalid, MaterialId};
use ndarray::{Axis, concatenate};

use super::common::{DataFolder, hint, usage};
use super::data::Source;
use super::{Failure, overwrite, print};
use crate::error::Error;
use crate::prior::PriorParams;

/// What other materials teach about a new one.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Build(Build),
}

/// Learn from the materials of the database, for 'fit --prior'.
///
/// Measurements are looked for as 'reproduce' looks for them. Every channel of every material
/// counts as a material.
#[derive(Debug, Args)]
struct Build {
    #[command(flatten)]
    folder: DataFolder,
    /// Materials to learn from: 'paper', 'all', or a list of numbers and names.
    #[arg(long, value_name = "LIST", default_value = "all")]
    materials: String,
    /// Materials to leave out, with all measurements of the same specimen: numbers and names.
    #[arg(long, value_name = "LIST")]
    without: Option<String>,
    /// The prior's file: JSON for a name ending in .json, else binary.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Hidden neurons of all networks fitted with it.
    #[arg(long, value_name = "N", default_value_t = PriorParams::default().neurons)]
    neurons: usize,
    /// Seed of the random layer.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Command::Build(build) = &arguments.command;
    if build.neurons == 0 {
        return Err(usage("--neurons is 0, expected at least 1"));
    }
    let source = Source::find(build.folder.data.as_deref())?;
    overwrite::refuse([build.output.as_path()], &source.files())?;
    hint(&source);
    let mut materials = source.select(&build.materials)?;
    let mut left_out = Vec::new();
    if let Some(list) = &build.without {
        left_out = source.select(list)?;
        let specimens: Vec<MaterialId> = left_out.iter().map(|id| id.specimen()).collect();
        materials.retain(|id| !specimens.contains(&id.specimen()));
    }
    let data = source.load(&materials, Invalid::Clamp)?;
    let values: Vec<_> = data.materials.iter().map(|m| m.values.view()).collect();
    let values = concatenate(Axis(1), &values).map_err(|_| {
        usage(Error::Empty {
            what: "materials of a prior",
            rows: data.directions.len(),
            columns: 0,
        })
    })?;
    let params = PriorParams {
        neurons: build.neurons,
        seed: build.seed,
        ..PriorParams::default()
    };
    let mut about = format!(
        "{} material{} of {}",
        data.materials.len(),
        if data.materials.len() == 1 { "" } else { "s" },
        source.describe()
    );
    if !left_out.is_empty() {
        let names: Vec<String> = left_out.iter().map(ToString::to_string).collect();
        about.push_str(&format!(", without {}", names.join(", ")));
    }
    let prior = params
        .build(&data.directions, values.view())?
        .with_source(about);
    persist::save(&prior, &build.output).map_err(Error::from)?;
    print(&format!(
        "{}\n{} neurons; written to {}\n",
        prior.source(),
        build.neurons,
        build.output.display()
    ))
}
