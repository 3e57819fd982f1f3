//! `elm-brdf render`: a picture of a scene, and the account of the work.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use elm_datasets::Format;
use indicatif::{ProgressBar, ProgressStyle};

use super::common::{DataFolder, library};
use super::data::Source;
use super::{Failure, overwrite, print, say};
use crate::error::Error;
use crate::file;
use crate::render::scene::Image;
use crate::render::{Optimizations, Options, RenderStats, Rendering};
use crate::scene_materials::{MaterialTable, Scene, Sheet};
use crate::scenes::builtin;

/// Render a scene with learnt materials.
///
/// SCENE is a TOML file, a built-in scene (builtin:materials, builtin:contact-sheet,
/// builtin:comparison or builtin:mesh), or a file of one's own, which builtin:mesh then shows: a saved
/// model, measurements, or a measured table (MERL, RGL). Measurements of CUReT are looked for as by
/// 'reproduce'; without CUReT's files its materials come from the built-in synthetic data, and the caption
/// says so.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// TOML file, builtin:NAME, or a material's file.
    scene: String,
    /// The picture: .png (sRGB, with captions) or .exr (linear radiance).
    #[arg(short, long, value_name = "IMAGE")]
    output: PathBuf,
    #[command(flatten)]
    folder: DataFolder,
    /// For a built-in scene, the material: a file, or CUReT's number or name.
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Pixels across and down, such as 640x360, instead of the scene's.
    #[arg(long, value_name = "SIZE", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Samples per pixel instead of the scene's.
    #[arg(long, value_name = "N")]
    samples: Option<u32>,
    /// Stops by which to brighten the PNG instead of the scene's.
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true)]
    exposure: Option<f64>,
    /// Surfaces that light may meet on its way instead of the scene's: 1 is direct light.
    #[arg(long, value_name = "N")]
    depth: Option<u32>,
    /// Seed of the samples instead of the scene's.
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    /// Write what was done and what was skipped to FILE as JSON, and print it.
    #[arg(long, value_name = "FILE")]
    account: Option<PathBuf>,
    /// Brute force: skip nothing.
    #[arg(long, conflicts_with = "without")]
    no_skip: bool,
    /// Savings not to make, with commas between.
    #[arg(long, value_name = "LIST", value_delimiter = ',',
          value_parser = PossibleValuesParser::new(Optimizations::NAMES))]
    without: Vec<String>,
}

/// The built-in scene that shows the material of a file.
const PREVIEW: &str = "mesh";

/// Whether a file of this name holds a material: a model, measurements or a table. Any other is a scene.
fn is_material(path: &Path) -> bool {
    let measured = Format::ALL.iter().flat_map(|format| format.extensions());
    let mut known = measured.chain(&["elm", "json", "gz"]);
    path.extension()
        .is_some_and(|end| known.any(|name| end.eq_ignore_ascii_case(name)))
}

/// Reads WIDTHxHEIGHT.
fn size(text: &str) -> Result<(u32, u32), String> {
    let parts = text
        .split_once('x')
        .and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    parts.ok_or_else(|| "expected WIDTHxHEIGHT, such as 640x360".to_owned())
}

pub(super) fn run(arguments: &Arguments, threads: usize) -> Result<(), Failure> {
    let format =
        Rendering::format(&arguments.output).map_err(|error| Failure::Usage(error.to_string()))?;
    let mut sheet = match arguments.scene.strip_prefix("builtin:") {
        Some(name) => {
            let material = arguments.material.as_deref().map(material).transpose()?;
            builtin(name, material.as_ref()).map_err(|e| Failure::Usage(e.to_string()))?
        }
        None => arguments.scene_file()?,
    };
    arguments.amend(&mut sheet);
    let mut inputs = Vec::new();
    for scene in sheet.scenes() {
        inputs.extend(overwrite::of_scene(Path::new(&arguments.scene), scene));
    }
    inputs.extend(Source::find(arguments.folder.data.as_deref())?.files());
    let outputs = std::iter::once(&arguments.output).chain(&arguments.account);
    overwrite::refuse(outputs.map(PathBuf::as_path), &inputs)?;
    let library = library(arguments.folder.data.as_deref())?;
    let options = Options {
        savings: arguments.savings(),
        threads,
    };
    let progress = progress();
    let rendering = sheet.render(&library, options, &|done, all| {
        progress.set_length(all);
        progress.set_position(done);
    });
    progress.finish_and_clear();
    let rendering = rendering.map_err(Error::from)?;
    for note in &rendering.account.notes {
        say(&format!("note: {note}"));
    }
    let picture = rendering.encode(format).map_err(Error::from)?;
    file::replace(&arguments.output, &picture)?;
    match &arguments.account {
        Some(path) => account(path, &rendering.account),
        None => Ok(()),
    }
}

/// The material that an option names.
fn material(name: &str) -> Result<MaterialTable, Failure> {
    let path = Path::new(name);
    if path.is_file() {
        return Ok(MaterialTable::of_file(path)?);
    }
    Ok(MaterialTable {
        curet: Some(name.to_owned()),
        ..MaterialTable::default()
    })
}

impl Arguments {
    /// A scene's file, or the built-in scene that shows the material of a file.
    fn scene_file(&self) -> Result<Sheet, Failure> {
        let path = Path::new(&self.scene);
        if !is_material(path) || !path.is_file() {
            return Ok(Scene::read(path).map_err(Error::from)?.into());
        }
        if self.material.is_some() {
            return Err(Failure::Usage(
                "--material is for built-in scenes: expected a scene before it".to_owned(),
            ));
        }
        let material = MaterialTable::of_file(path)?;
        Ok(builtin(PREVIEW, Some(&material)).map_err(Error::from)?)
    }

    /// Puts what was typed in place of what the scene says.
    fn amend(&self, sheet: &mut Sheet) {
        if let Some((width, height)) = self.size {
            sheet.resize(width, height);
        }
        for scene in sheet.scenes() {
            self.amend_image(&mut scene.image);
        }
    }

    fn amend_image(&self, image: &mut Image) {
        image.samples = self.samples.unwrap_or(image.samples);
        image.exposure = self.exposure.unwrap_or(image.exposure);
        image.depth = self.depth.unwrap_or(image.depth);
        image.seed = self.seed.unwrap_or(image.seed);
    }

    fn savings(&self) -> Optimizations {
        if self.no_skip {
            return Optimizations::NONE;
        }
        // clap lets no other name through.
        let without =
            |savings: Optimizations, name: &String| savings.without(name).unwrap_or(savings);
        self.without.iter().fold(Optimizations::ALL, without)
    }
}

/// Prints the account and writes it as JSON.
fn account(path: &Path, account: &RenderStats) -> Result<(), Failure> {
    print(&account.to_string())?;
    let mut json = serde_json::to_string_pretty(account).map_err(|error| Error::Write {
        path: path.to_owned(),
        reason: error.into(),
    })?;
    json.push('\n');
    Ok(file::replace(path, json.as_bytes())?)
}

fn progress() -> ProgressBar {
    // indicatif draws on standard error, and not at all where that is no terminal.
    let bar = ProgressBar::new(0);
    let style = ProgressStyle::with_template("{bar:40} {percent}% of the samples, {eta} left");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
