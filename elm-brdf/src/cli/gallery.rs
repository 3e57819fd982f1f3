//! `elm-brdf gallery`: a page that shows learnt materials.

use std::path::{Path, PathBuf};

use clap::Args;
use elm_datasets::Invalid;

use super::common::{DataFolder, hint, progress};
use super::data::Source;
use super::{Failure, overwrite, print, say};
use crate::error::Error;
use crate::export::ExportError;
use crate::gallery::{self, GalleryItem};
use crate::model::BrdfModel;
use crate::protocol::{Folds, cross_validate};
use crate::recipes;
use crate::scene_materials::{MaterialTable, SceneMaterialLoader};

/// Write a page that shows learnt materials: spheres, lobes, errors, sizes, and a sphere to play
/// with, shaded by the networks in the browser.
///
/// The materials are those of the files named, or CUReT's, whose measurements are looked for as
/// 'reproduce' looks for them.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Files of materials: saved models, or measurements as 'fit' takes them (in radians unless the file says
    /// otherwise), to which a network is fitted.
    #[arg(value_name = "FILE", conflicts_with_all = ["materials", "data"])]
    files: Vec<PathBuf>,
    /// Folder for the page: index.html and a picture of each material.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    folder: DataFolder,
    /// 'paper', 'all', or a list of numbers and names, such as '1,39,orange peel'.
    #[arg(long, value_name = "LIST", default_value = "paper")]
    materials: String,
    /// Neurons of each network; chosen by the number of measurements if not given.
    #[arg(long, value_name = "N")]
    neurons: Option<usize>,
}

/// Folds of the cross-validation, and its seed.
const FOLDS: (usize, u64) = (10, 1);

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let items = if arguments.files.is_empty() {
        curet(arguments)?
    } else {
        check_outputs(arguments, arguments.files.len(), &arguments.files)?;
        let items = arguments.files.iter().map(|path| of_file(path, arguments));
        items.collect::<Result<_, _>>()?
    };
    let progress = progress("material");
    progress.set_length(items.len() as u64);
    let count = |done| progress.set_position(done as u64);
    gallery::write(&arguments.out, &items, gallery::PICTURE_SIZE, count)?;
    progress.finish_and_clear();
    print(&format!("{}\n", arguments.out.join("index.html").display()))
}

/// Refuses results over what is read.
fn check_outputs(arguments: &Arguments, count: usize, inputs: &[PathBuf]) -> Result<(), Failure> {
    let pictures = (1..=count).map(|number| format!("sphere-{number:02}.png"));
    let mut names: Vec<String> = pictures.collect();
    names.push("index.html".to_owned());
    overwrite::refuse_folder(&arguments.out, &names, inputs)
}

/// The material in a file.
fn of_file(path: &Path, arguments: &Arguments) -> Result<GalleryItem, Failure> {
    let table = match MaterialTable::of_file(path)? {
        // The page evaluates networks alone.
        MaterialTable {
            table: Some(file), ..
        } => MaterialTable {
            csv: Some(file),
            ..MaterialTable::default()
        },
        other => other,
    };
    let table = MaterialTable {
        neurons: table.csv.as_ref().and(arguments.neurons),
        ..table
    };
    let fitted = SceneMaterialLoader::new(None).model(&table, Path::new(""))?;
    for note in &fitted.notes {
        say(&format!("note: {}: {note}", path.display()));
    }
    let model = BrdfModel::of(&*fitted.model).ok_or(Error::Export(ExportError::NoNetwork))?;
    Ok(GalleryItem {
        name: path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        origin: fitted.origin,
        model: model.clone(),
        held_out: model.provenance().held_out.map(|errors| errors.rmse),
    })
}

/// Materials of CUReT, their errors by cross-validation.
fn curet(arguments: &Arguments) -> Result<Vec<GalleryItem>, Failure> {
    let source = Source::find(arguments.folder.data.as_deref())?;
    let materials = source.select(&arguments.materials)?;
    check_outputs(arguments, materials.len(), &source.files())?;
    let data = source.load(&materials, Invalid::Clamp)?;
    hint(&source);
    let network = recipes::network(arguments.neurons);
    let folds = Folds::new(data.directions.len(), FOLDS.0, FOLDS.1)?;
    let scores = cross_validate(&*network, &data, &folds, |_, _| {})?;
    let origin = format!("ELM fitted to {}", source.caption());
    let mut items = Vec::with_capacity(materials.len());
    for (index, (score, material)) in scores.iter().zip(&data.materials).enumerate() {
        let Some(samples) = data.samples(index) else {
            continue;
        };
        let brdf = network.fit(&samples.directions, samples.values.view())?;
        let model = BrdfModel::of(&*brdf).ok_or(Error::Export(ExportError::NoNetwork))?;
        let squares = score.channels.iter().map(|c| c.held_out.rmse.powi(2));
        items.push(GalleryItem {
            name: format!("{} {}", material.id, material.name),
            origin: origin.clone(),
            model: model.clone(),
            held_out: Some((squares.sum::<f64>() / score.channels.len() as f64).sqrt()),
        });
    }
    Ok(items)
}
