//! What `reproduce` found, as one value, and its forms: text, Markdown, CSV and JSON.

mod comparison;
mod csv;
mod format;
pub mod plot;
mod tables;

use std::path::{Path, PathBuf};

use elm_datasets::{MaterialId, Measurements, Origin, Samples};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::file;
use crate::metrics::Metrics;
use crate::protocol::{MaterialScores, Scores};
use crate::published;
use crate::quality::NoiseFloor;
use crate::statistics::{mean, median};
use tables::Measure;

pub use comparison::{Comparison, Entry, MaterialScore, ModelLabel};
pub use format::Format;

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
    /// Whether they are the built-in synthetic data rather than measurements.
    pub synthetic: bool,
    /// Channel names.
    pub channels: Vec<String>,
    /// How many materials.
    pub materials: usize,
    /// How many pairs of directions.
    pub measurements: usize,
    /// Negative values met in these materials.
    pub invalid: usize,
    /// How many values there are.
    pub values: usize,
    /// How many of them look saturated.
    pub saturated: usize,
    /// The median over materials and channels of the noise floor that reciprocal pairs show, in
    /// 1/sr; `None` without such pairs.
    pub noise_floor: Option<f64>,
}

/// The settings of a cross-validation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Protocol {
    /// The model's name.
    pub model: String,
    /// The set of inputs; `None` for a model of the directions themselves.
    pub features: Option<String>,
    /// The regression target; `None` where there is no choice.
    pub target: Option<String>,
    /// Hidden neurons; like what follows only for the paper's network, as other models choose for
    /// themselves.
    pub neurons: Option<usize>,
    /// Activation function.
    pub activation: Option<String>,
    /// Solver of the output weights.
    pub solver: Option<String>,
    /// Which rows the network's inputs are scaled by: `fold`, the training rows of each fold, or
    /// `once`, all of them.
    pub scaling: Option<String>,
    /// Number of folds.
    pub folds: usize,
    /// Seed of the random layer and of the folds; the first where there are several.
    pub seed: u64,
    /// Number of seeds: this one and those that follow it. Figures are means over them.
    pub seeds: usize,
}

impl Protocol {
    /// The model in a few words.
    #[must_use]
    pub fn describe(&self) -> String {
        let mut parts = Vec::new();
        if let Some(features) = &self.features {
            parts.push(format!("{features} inputs"));
        }
        if let Some(target) = &self.target {
            parts.push(format!("{target} target"));
        }
        let mut text = self.model.clone();
        if !parts.is_empty() {
            text.push_str(&format!(" ({})", parts.join(", ")));
        }
        if let (Some(neurons), Some(activation)) = (self.neurons, &self.activation) {
            text.push_str(&format!(", {neurons} {activation} neurons"));
        }
        if let Some(solver) = &self.solver {
            text.push_str(&format!(", {solver}"));
        }
        match self.scaling.as_deref() {
            Some("once") => text.push_str("; inputs scaled once, by all rows"),
            Some(_) => text.push_str("; inputs scaled in each fold"),
            None => {}
        }
        text
    }
}

/// The figures of one material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// CUReT's number (or the synthetic data's own).
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
    /// On the rows held out, but for those that look saturated.
    pub held_out_unsaturated: Metrics,
    /// The standard deviation of `held_out` over the seeds; `None` for a single one.
    pub held_out_deviation: Option<Metrics>,
    /// How many values look saturated.
    pub saturated: usize,
    /// What reciprocal pairs show of the noise; `None` without such pairs.
    pub noise_floor: Option<NoiseFloor>,
    /// What the paper printed; `None` for other materials and for the synthetic data.
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Geometric mean over the paper's materials and the channels present of held-out RMSE over
    /// printed RMSE.
    pub rmse_ratio_to_paper: Option<f64>,
    /// Mean held-out RMSE over all materials and channels, in 1/sr.
    pub mean_held_out_rmse: f64,
    /// The largest ratio of held-out RMSE to printed RMSE.
    pub worst_ratio_to_paper: Option<f64>,
    /// Mean held-out RMSE without the measurements that look saturated, in 1/sr.
    pub mean_held_out_rmse_unsaturated: f64,
    /// How many materials and channels are better than printed; `None` where nothing is printed.
    pub better_than_paper: Option<Better>,
    /// The same three figures of each seed by itself; one entry for a single seed.
    pub seeds: Vec<SeedScore>,
}

/// How many materials and channels are held out better than the paper printed them, of those that
/// have a possible figure in print.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Better {
    /// By root mean squared error: better, and compared.
    pub rmse: (usize, usize),
    /// By mean absolute error.
    pub mae: (usize, usize),
    /// By correlation.
    pub correlation: (usize, usize),
}

/// The summary of one seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SeedScore {
    /// The seed.
    pub seed: u64,
    /// As in [`Summary`].
    pub rmse_ratio_to_paper: Option<f64>,
    /// As in [`Summary`].
    pub mean_held_out_rmse: f64,
    /// As in [`Summary`].
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
    /// Puts the scores of cross-validations, one for each seed from the protocol's on, beside what
    /// the paper printed.
    #[must_use]
    pub fn new(
        source: String,
        data: &Measurements,
        protocol: Protocol,
        runs: &[Vec<MaterialScores>],
        seconds: Seconds,
    ) -> Self {
        let measured = data.origin == Origin::Curet;
        let materials: Vec<Material> = data
            .materials
            .iter()
            .enumerate()
            .map(|(m, material)| Material {
                id: material.id.number(),
                name: material.name.clone(),
                channels: data
                    .channels
                    .iter()
                    .enumerate()
                    .filter_map(|(c, channel)| {
                        let of_seeds: Vec<&Scores> = runs
                            .iter()
                            .filter_map(|run| run.get(m)?.channels.get(c))
                            .collect();
                        Channel::new(channel, &of_seeds, paper(material.id, channel, measured))
                    })
                    .collect(),
            })
            .collect();
        let scores = runs.first().map_or(&[][..], Vec::as_slice);
        Self {
            data: Data::of(source, data, scores),
            summary: Summary::of(&materials, protocol.seed, runs),
            protocol,
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
        file::folder(dir)?;
        Format::ALL
            .into_iter()
            .map(|format| {
                let path = dir.join("reproduce").with_extension(format.extension());
                file::replace(&path, self.render(format)?.as_bytes())?;
                Ok(path)
            })
            .collect()
    }
}

impl Channel {
    /// Means over seeds; `None` without any.
    fn new(channel: &str, of_seeds: &[&Scores], paper: Option<Paper>) -> Option<Self> {
        let all = |metrics: fn(&Scores) -> Metrics| -> Vec<Metrics> {
            of_seeds.iter().map(|scores| metrics(scores)).collect()
        };
        let held_out = all(|scores| scores.held_out);
        let first = of_seeds.first()?;
        Some(Self {
            channel: channel.to_owned(),
            train: Metrics::mean(&all(|scores| scores.train))?,
            held_out: Metrics::mean(&held_out)?,
            held_out_fold_mean: Metrics::mean(&all(|scores| scores.held_out_fold_mean))?,
            held_out_unsaturated: Metrics::mean(&all(|scores| scores.held_out_unsaturated))?,
            held_out_deviation: Metrics::deviation(&held_out),
            saturated: first.saturated.len(),
            noise_floor: first.noise_floor,
            paper,
        })
    }
}

impl Data {
    /// Samples of a single material, with the scores of any model on them.
    #[must_use]
    pub fn of_samples(
        source: String,
        synthetic: bool,
        samples: &Samples,
        invalid: usize,
        scores: &[MaterialScores],
    ) -> Self {
        let (saturated, noise_floor) = quality(scores);
        Self {
            source,
            synthetic,
            channels: samples.channels.clone(),
            materials: 1,
            measurements: samples.directions.len(),
            invalid,
            values: samples.values.len(),
            saturated,
            noise_floor,
        }
    }

    /// Measurements of many materials, with the scores of any model on them.
    #[must_use]
    pub fn of(source: String, data: &Measurements, scores: &[MaterialScores]) -> Self {
        let (saturated, noise_floor) = quality(scores);
        Self {
            source,
            synthetic: matches!(data.origin, Origin::Synthetic { .. }),
            channels: data.channels.clone(),
            materials: data.materials.len(),
            measurements: data.directions.len(),
            invalid: data.invalid,
            values: data.materials.iter().map(|m| m.values.len()).sum(),
            saturated,
            noise_floor,
        }
    }
}

/// How many values look saturated, and the median noise floor.
fn quality(scores: &[MaterialScores]) -> (usize, Option<f64>) {
    let channels = || scores.iter().flat_map(|material| &material.channels);
    let floors = channels().filter_map(|channel| channel.noise_floor);
    (
        channels().map(|channel| channel.saturated.len()).sum(),
        median(floors.map(|floor| floor.sigma).collect()),
    )
}

fn json(report: &impl Serialize) -> Result<String> {
    let mut text = serde_json::to_string_pretty(report).map_err(|error| Error::Write {
        path: "report.json".into(),
        reason: error.into(),
    })?;
    text.push('\n');
    Ok(text)
}

fn paper(id: MaterialId, channel: &str, measured: bool) -> Option<Paper> {
    if !measured {
        return None;
    }
    published::figures(id, channel).map(|figures| Paper {
        rmse: figures.rmse,
        mae: figures.mae,
        correlation: figures.correlation,
        impossible_mae: figures.impossible_mae,
    })
}

/// Of held-out RMSE over printed RMSE: the geometric mean, and the largest.
fn ratios(pairs: impl Iterator<Item = (f64, Option<Paper>)>) -> (Option<f64>, Option<f64>) {
    let ratios: Vec<f64> = pairs
        .filter_map(|(rmse, paper)| Some(rmse / paper?.rmse))
        .collect();
    let logarithm = mean(ratios.iter().map(|ratio| ratio.ln()));
    (logarithm.map(f64::exp), ratios.into_iter().reduce(f64::max))
}

impl Summary {
    fn of(materials: &[Material], seed: u64, runs: &[Vec<MaterialScores>]) -> Self {
        let channels = || materials.iter().flat_map(|material| &material.channels);
        let (rmse_ratio_to_paper, worst_ratio_to_paper) =
            ratios(channels().map(|channel| (channel.held_out.rmse, channel.paper)));
        let of_seed = |(run, seed): (&Vec<MaterialScores>, u64)| {
            let rmse = || {
                let channels = run.iter().flat_map(|material| &material.channels);
                channels.map(|scores| scores.held_out.rmse)
            };
            let (rmse_ratio_to_paper, worst_ratio_to_paper) =
                ratios(rmse().zip(channels().map(|channel| channel.paper)));
            SeedScore {
                seed,
                rmse_ratio_to_paper,
                mean_held_out_rmse: mean(rmse()).unwrap_or(0.0),
                worst_ratio_to_paper,
            }
        };
        Self {
            rmse_ratio_to_paper,
            mean_held_out_rmse: mean(channels().map(|c| c.held_out.rmse)).unwrap_or(0.0),
            worst_ratio_to_paper,
            mean_held_out_rmse_unsaturated: mean(channels().map(|c| c.held_out_unsaturated.rmse))
                .unwrap_or(0.0),
            better_than_paper: Better::of(materials),
            seeds: runs.iter().zip(seed..).map(of_seed).collect(),
        }
    }
}

impl Better {
    fn of(materials: &[Material]) -> Option<Self> {
        let channels = || materials.iter().flat_map(|material| &material.channels);
        channels().any(|channel| channel.paper.is_some()).then(|| {
            let count = |measure: Measure| {
                let better = channels().filter_map(|channel| measure.is_better(channel));
                better.fold((0, 0), |(better, all), is| {
                    (better + usize::from(is), all + 1)
                })
            };
            Self {
                rmse: count(Measure::Rmse),
                mae: count(Measure::Mae),
                correlation: count(Measure::Correlation),
            }
        })
    }
}
