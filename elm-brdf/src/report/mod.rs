//! What `reproduce` found, as one value, and its forms: text, Markdown, CSV and JSON.

mod comparison;
mod csv;
mod tables;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use elm_datasets::{MaterialId, Measurements, Origin};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::protocol::{MaterialScores, Metrics};
use crate::published;

pub use comparison::{Comparison, Entry};

/// Everything that `reproduce` prints. Its JSON form is this structure, field for field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// What was fitted.
    pub data: Data,
    /// How.
    pub protocol: Protocol,
    /// One entry per material, in the order asked for.
    pub materials: Vec<Material>,
    /// All materials together.
    pub summary: Summary,
    /// How long it took.
    pub seconds: Seconds,
}

/// The measurements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Data {
    /// Where they come from.
    pub source: String,
    /// Whether they are the built-in stand-in rather than measurements.
    pub synthetic: bool,
    /// Channel names.
    pub channels: Vec<String>,
    /// How many materials.
    pub materials: usize,
    /// How many pairs of directions.
    pub measurements: usize,
    /// Negative values met in these materials.
    pub invalid: usize,
}

/// The settings of a cross-validation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Protocol {
    /// The model's name.
    pub model: String,
    /// The set of network inputs.
    pub features: String,
    /// The regression target.
    pub target: String,
    /// Hidden neurons.
    pub neurons: usize,
    /// Activation function.
    pub activation: String,
    /// Solver of the output weights.
    pub solver: String,
    /// Number of folds.
    pub folds: usize,
    /// Seed of the random layer and of the folds.
    pub seed: u64,
}

/// The figures of one material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// CUReT's number (or the stand-in's own).
    pub id: usize,
    /// Its name.
    pub name: String,
    /// One entry per channel.
    pub channels: Vec<Channel>,
}

/// The figures of one channel of one material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// The channel's name.
    pub channel: String,
    /// On the rows that each fold trained on.
    pub train: Metrics,
    /// On the rows held out, all folds together.
    pub held_out: Metrics,
    /// On the rows held out, mean over folds.
    pub held_out_fold_mean: Metrics,
    /// What the paper printed; `None` for other materials and for the stand-in.
    pub paper: Option<Paper>,
}

/// The paper's figures as printed, or for the average channel the mean of its three channels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Paper {
    /// Table I.
    pub rmse: f64,
    /// Table II; missing in print for two materials.
    pub mae: Option<f64>,
    /// Table III; missing in print for two materials.
    pub correlation: Option<f64>,
    /// Whether the printed MAE exceeds the printed RMSE, which is impossible: a misprint.
    #[serde(skip)]
    pub impossible_mae: bool,
}

/// All materials together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Geometric mean over the paper's materials and the channels present of held-out RMSE over
    /// printed RMSE.
    pub rmse_ratio_to_paper: Option<f64>,
    /// Mean held-out RMSE over all materials and channels, in 1/sr.
    pub mean_held_out_rmse: f64,
    /// The largest ratio of held-out RMSE to printed RMSE.
    pub worst_ratio_to_paper: Option<f64>,
}

/// Wall-clock times in seconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    /// Reading or making the data.
    pub load: f64,
    /// Fitting and evaluating all folds.
    pub fit: f64,
    /// Everything up to the report.
    pub total: f64,
}

impl Report {
    /// Puts the scores of a cross-validation beside what the paper printed.
    #[must_use]
    pub fn new(
        source: String,
        data: &Measurements,
        protocol: Protocol,
        scores: Vec<MaterialScores>,
        seconds: Seconds,
    ) -> Self {
        let synthetic = data.origin != Origin::Curet;
        let materials: Vec<Material> = scores
            .into_iter()
            .map(|material| Material {
                id: material.id.number(),
                channels: material
                    .channels
                    .iter()
                    .zip(&data.channels)
                    .map(|(scores, channel)| Channel {
                        channel: channel.clone(),
                        train: scores.train,
                        held_out: scores.held_out,
                        held_out_fold_mean: scores.held_out_fold_mean,
                        paper: paper(material.id, channel, synthetic),
                    })
                    .collect(),
                name: material.name,
            })
            .collect();
        Self {
            data: Data::of(source, data),
            protocol,
            summary: Summary::of(&materials),
            materials,
            seconds,
        }
    }

    /// The report in this form, ending with a line end.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be encoded.
    pub fn render(&self, format: Format) -> Result<String> {
        match format {
            Format::Table => Ok(tables::render(self, tables::Style::Text)),
            Format::Markdown => Ok(tables::render(self, tables::Style::Markdown)),
            Format::Csv => csv::render(self),
            Format::Json => json(self),
        }
    }

    /// Writes every form to `dir`, which is made if need be, as `reproduce.txt`, `.md`, `.csv`
    /// and `.json`; returns their paths. Each file appears whole or not at all.
    ///
    /// # Errors
    /// [`Error::Write`] naming the file or folder.
    pub fn write(&self, dir: &Path) -> Result<Vec<PathBuf>> {
        fs::create_dir_all(dir).map_err(|reason| Error::Write {
            path: dir.to_owned(),
            reason,
        })?;
        Format::ALL
            .into_iter()
            .map(|format| {
                let path = dir.join("reproduce").with_extension(format.extension());
                replace(&path, self.render(format)?.as_bytes()).map_err(|reason| Error::Write {
                    path: path.clone(),
                    reason,
                })?;
                Ok(path)
            })
            .collect()
    }
}

impl Data {
    fn of(source: String, data: &Measurements) -> Self {
        Self {
            source,
            synthetic: data.origin != Origin::Curet,
            channels: data.channels.clone(),
            materials: data.materials.len(),
            measurements: data.directions.len(),
            invalid: data.invalid,
        }
    }
}

fn json(report: &impl Serialize) -> Result<String> {
    let mut text = serde_json::to_string_pretty(report).map_err(|error| Error::Write {
        path: "report.json".into(),
        reason: error.into(),
    })?;
    text.push('\n');
    Ok(text)
}

/// Writes beside the file and renames, so that an interruption leaves the old one.
fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let dir = path.parent().unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(dir)?;
    file.write_all(bytes)?;
    // Temporary files are private to their owner; a report is not.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.as_file()
            .set_permissions(fs::Permissions::from_mode(0o644))?;
    }
    file.persist(path)?;
    Ok(())
}

fn paper(id: MaterialId, channel: &str, synthetic: bool) -> Option<Paper> {
    if synthetic {
        return None;
    }
    published::figures(id, channel).map(|figures| Paper {
        rmse: figures.rmse,
        mae: figures.mae,
        correlation: figures.correlation,
        impossible_mae: figures.impossible_mae,
    })
}

impl Summary {
    fn of(materials: &[Material]) -> Self {
        let channels = || materials.iter().flat_map(|material| &material.channels);
        let ratios: Vec<f64> = channels()
            .filter_map(|channel| Some(channel.held_out.rmse / channel.paper?.rmse))
            .collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let values: Vec<f64> = values.collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        Self {
            rmse_ratio_to_paper: mean(&mut ratios.iter().map(|ratio| ratio.ln())).map(f64::exp),
            mean_held_out_rmse: mean(&mut channels().map(|channel| channel.held_out.rmse))
                .unwrap_or(0.0),
            worst_ratio_to_paper: ratios.into_iter().reduce(f64::max),
        }
    }
}

/// A form of a [`Report`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Format {
    /// Tables for a terminal.
    #[default]
    Table,
    /// One JSON object.
    Json,
    /// One line per material, channel and measure.
    Csv,
    /// Tables for a document.
    Markdown,
}

impl Format {
    /// Every form there is.
    pub const ALL: [Self; 4] = [Self::Table, Self::Json, Self::Csv, Self::Markdown];

    /// The form's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Json => "json",
            Self::Csv => "csv",
            Self::Markdown => "markdown",
        }
    }

    fn extension(self) -> &'static str {
        match self {
            Self::Table => "txt",
            Self::Json => "json",
            Self::Csv => "csv",
            Self::Markdown => "md",
        }
    }
}

impl FromStr for Format {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL
            .into_iter()
            .find(|format| format.name() == name)
            .ok_or_else(|| Error::UnknownName {
                what: "format",
                name: name.to_owned(),
                expected: Self::ALL.map(Self::name).join(", "),
            })
    }
}
