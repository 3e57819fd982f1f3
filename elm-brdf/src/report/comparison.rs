//! What `compare` found: every model on the same folds.

use serde::{Deserialize, Serialize};

use comfy_table::CellAlignment;

use super::tables::{Style, push, seeds, styled, trim};
use super::{Data, Format, json, paper};
use crate::error::{Error, Result};
use crate::metrics::Metrics;
use crate::protocol::{MaterialScores, Scores};
use crate::registry::full_name;
use crate::statistics::{deviation, mean};

/// Models cross-validated on the same folds, the smallest held-out error first. Its JSON form is
/// this structure, field for field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// What was fitted.
    pub data: Data,
    /// Number of folds.
    pub folds: usize,
    /// Seed of the folds, and of random layers; the first where there are several.
    pub seed: u64,
    /// Number of seeds: this one and those that follow it. Figures are means over them.
    pub seeds: usize,
    /// One entry per model.
    pub models: Vec<Entry>,
    /// Wall-clock time of everything, in seconds.
    pub seconds: f64,
}

/// The figures of one model: means over all materials and channels, and over seeds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The model's name.
    pub model: String,
    /// The set of inputs; `None` for a model of the directions themselves.
    pub features: Option<String>,
    /// The regression target; `None` where it can only be the reflectance.
    pub target: Option<String>,
    /// Whether it is one of this project's networks rather than a reference.
    pub network: bool,
    /// How many measurements each fit was given at most: fewer than there are for a method whose
    /// cost grows too fast.
    pub rows: usize,
    /// Root mean squared error on training rows, in 1/sr.
    pub train_rmse: f64,
    /// Measures of all held-out rows of a channel together.
    #[serde(flatten)]
    pub held_out: Metrics,
    /// The standard deviation over the seeds of the mean held-out RMSE; `None` for a single seed.
    pub rmse_deviation: Option<f64>,
    /// Held-out RMSE without the measurements that look saturated, in 1/sr.
    pub rmse_unsaturated: f64,
    /// Geometric mean of held-out RMSE over the paper's, for the materials that it prints.
    pub rmse_ratio_to_paper: Option<f64>,
    /// For how many materials and channels no other model has a smaller held-out RMSE.
    pub wins: usize,
    /// Numbers stored for a channel, fitted to all rows.
    pub floats_per_channel: usize,
    /// Wall-clock time of fitting and evaluating all folds, in seconds.
    pub seconds: f64,
    /// Each material and channel by itself.
    pub materials: Vec<MaterialScore>,
}

/// The error of one model on one channel of one material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaterialScore {
    /// CUReT's number; `None` for samples from a user's file.
    pub id: Option<usize>,
    /// The material's name.
    pub name: String,
    /// The channel's name.
    pub channel: String,
    /// Held-out RMSE in 1/sr, mean over seeds.
    pub rmse: f64,
}

/// What a table says of a model besides its scores.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelLabel {
    /// As in [`Entry`].
    pub model: String,
    /// As in [`Entry`].
    pub features: Option<String>,
    /// As in [`Entry`].
    pub target: Option<String>,
    /// As in [`Entry`].
    pub network: bool,
}

impl Entry {
    /// Means of these scores, one list of materials for each seed. `measured` says that the
    /// materials are CUReT's, whose figures the paper prints.
    #[must_use]
    pub fn new(
        words: ModelLabel,
        channels: &[String],
        measured: bool,
        runs: &[Vec<MaterialScores>],
    ) -> Self {
        let scores = || {
            let materials = runs.iter().flatten();
            materials.flat_map(|material| &material.channels)
        };
        let average = |value: fn(&Scores) -> f64| mean(scores().map(value)).unwrap_or(0.0);
        let first = runs.first().map_or(&[][..], Vec::as_slice);
        let of_material = |m: usize, c: usize, channel: &String| {
            let material = first.get(m)?;
            let of_seeds = runs.iter().filter_map(|run| run.get(m)?.channels.get(c));
            Some(MaterialScore {
                id: material.id.map(elm_datasets::MaterialId::number),
                name: material.name.clone(),
                channel: channel.clone(),
                rmse: mean(of_seeds.map(|scores| scores.held_out.rmse))?,
            })
        };
        let materials: Vec<MaterialScore> = (0..first.len())
            .flat_map(|m| {
                let channels = channels.iter().enumerate();
                channels.filter_map(move |(c, channel)| of_material(m, c, channel))
            })
            .collect();
        let ids = first.iter().flat_map(|material| {
            channels
                .iter()
                .map(|channel| paper(material.id?, channel, measured))
        });
        let ratios = materials.iter().zip(ids);
        let ratios = ratios.filter_map(|(of, paper)| Some((of.rmse / paper?.rmse).ln()));
        let of_seeds: Vec<f64> = runs
            .iter()
            .filter_map(|run| {
                let channels = run.iter().flat_map(|material| &material.channels);
                mean(channels.map(|scores| scores.held_out.rmse))
            })
            .collect();
        let held_out: Vec<Metrics> = scores().map(|scores| scores.held_out).collect();
        Self {
            model: words.model,
            features: words.features,
            target: words.target,
            network: words.network,
            rows: 0,
            train_rmse: average(|scores| scores.train.rmse),
            held_out: Metrics::mean(&held_out).unwrap_or(Metrics::NONE),
            rmse_deviation: deviation(&of_seeds),
            rmse_unsaturated: average(|scores| scores.held_out_unsaturated.rmse),
            rmse_ratio_to_paper: mean(ratios).map(f64::exp),
            wins: 0,
            floats_per_channel: 0,
            seconds: 0.0,
            materials,
        }
    }

    /// The model with its inputs and target.
    fn full_name(&self) -> String {
        full_name(
            &self.model,
            self.features.as_deref(),
            self.target.as_deref(),
        )
    }
}

impl Comparison {
    /// Sorts the entries and counts who wins.
    #[must_use]
    pub fn new(
        data: Data,
        folds: usize,
        seed: u64,
        seeds: usize,
        mut models: Vec<Entry>,
        seconds: f64,
    ) -> Self {
        models.sort_by(|a, b| a.held_out.rmse.total_cmp(&b.held_out.rmse));
        for m in 0..models.first().map_or(0, |entry| entry.materials.len()) {
            let errors = models.iter().enumerate();
            let errors = errors.filter_map(|(i, entry)| Some((i, entry.materials.get(m)?.rmse)));
            if let Some((winner, _)) = errors.min_by(|a, b| a.1.total_cmp(&b.1)) {
                models[winner].wins += 1;
            }
        }
        Self {
            data,
            folds,
            seed,
            seeds,
            models,
            seconds,
        }
    }

    /// The comparison in this form, ending with a line end.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be encoded.
    pub fn render(&self, format: Format) -> Result<String> {
        match format {
            Format::Table => Ok(self.table(Style::Text)),
            Format::Markdown => Ok(self.table(Style::Markdown)),
            Format::Csv => self.csv(),
            Format::Json => json(self),
        }
    }

    fn table(&self, style: Style) -> String {
        let (data, mut out) = (&self.data, String::new());
        let item = if style == Style::Markdown {
            out.push_str("## Reflectance models on the same folds\n\n");
            "- "
        } else {
            ""
        };
        if data.synthetic {
            push(
                &mut out,
                format_args!("{item}SYNTHETIC data from formulas, not measurements.\n"),
            );
        }
        push(&mut out, format_args!("{item}Data: {}\n", data.source));
        push(
            &mut out,
            format_args!(
                "{item}{} materials x {} directions, channels: {}; {}-fold cross-validation, {}\n\n",
                data.materials,
                data.measurements,
                data.channels.join(", "),
                self.folds,
                seeds(self.seed, self.seeds),
            ),
        );
        push(
            &mut out,
            format_args!("{}\n\n", trim(&self.rows(style).to_string())),
        );
        self.legend(&mut out, item);
        out
    }

    fn legend(&self, out: &mut String, item: &str) {
        push(
            out,
            format_args!(
                "{item}RMSE, MAE (1/sr), log-cosine error and correlation: held out, each channel's \
                 rows together, mean over materials and channels; 'train' is the RMSE on training \
                 rows, 'wins' for how many materials and channels no other model has a smaller \
                 held-out RMSE.\n"
            ),
        );
        if self.seeds > 1 {
            push(
                out,
                format_args!("{item}'+/-': standard deviation of the RMSE over the seeds.\n"),
            );
        }
        if self.models.iter().any(|m| m.rmse_ratio_to_paper.is_some()) {
            push(
                out,
                format_args!(
                    "{item}'/ paper': held-out RMSE over the paper's printed RMSE, geometric mean over \
                     the materials that it prints.\n"
                ),
            );
        }
        let data = &self.data;
        if let Some(floor) = data.noise_floor {
            push(
                out,
                format_args!(
                    "{item}Noise of one measurement by reciprocal pairs, median: {floor:.4}\n"
                ),
            );
        }
        if data.saturated > 0 {
            push(
                out,
                format_args!(
                    "{item}{} of {} values look saturated; 'without' is the RMSE without them.\n",
                    data.saturated, data.values
                ),
            );
        }
        if self
            .models
            .iter()
            .any(|entry| entry.rows < self.most_rows())
        {
            push(
                out,
                format_args!(
                    "{item}'rows': measurements that a fit is given; a random subset of at most so \
                     many where the cost of the method grows fast.\n"
                ),
            );
        }
        self.references(out, item);
        push(
            out,
            format_args!(
                "{item}'floats': numbers stored for a channel, those that a seed regenerates not \
                 counted. Seconds in all: {:.1}\n",
                self.seconds
            ),
        );
    }

    fn most_rows(&self) -> usize {
        self.models
            .iter()
            .map(|entry| entry.rows)
            .max()
            .unwrap_or(0)
    }

    /// Where references beat the best network, in words.
    fn references(&self, out: &mut String, item: &str) {
        let Some(network) = self.models.iter().find(|entry| entry.network) else {
            return;
        };
        let mut lines: Vec<(String, Vec<String>)> = Vec::new();
        let mut lost = 0;
        for (m, ours) in network.materials.iter().enumerate() {
            let references = self.models.iter().filter(|entry| !entry.network);
            let best = references
                .filter_map(|entry| Some((entry, entry.materials.get(m)?.rmse)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((reference, rmse)) = best.filter(|best| best.1 < ours.rmse) else {
                continue;
            };
            lost += 1;
            let of = ours
                .id
                .map_or_else(|| ours.name.clone(), |id| id.to_string());
            let channel = if self.data.channels.len() > 1 {
                format!(" {}", ours.channel)
            } else {
                String::new()
            };
            let said = format!("{of}{channel} ({:.2} x)", rmse / ours.rmse);
            let name = reference.full_name();
            match lines.iter_mut().find(|(known, _)| *known == name) {
                Some((_, places)) => places.push(said),
                None => lines.push((name, vec![said])),
            }
        }
        push(
            out,
            format_args!(
                "{item}Against the best network, {}, some reference has a smaller RMSE for {lost} of {}\
                 {}\n",
                network.full_name(),
                network.materials.len(),
                if lost > 0 { ":" } else { "." }
            ),
        );
        for (name, places) in lines {
            push(out, format_args!("  {item}{name}: {}\n", places.join(", ")));
        }
    }

    fn rows(&self, style: Style) -> comfy_table::Table {
        let mut table = styled(style);
        let (several, thinned) = (
            self.seeds > 1,
            self.models
                .iter()
                .any(|entry| entry.rows < self.most_rows()),
        );
        let mut header = vec!["model", "inputs", "target", "train", "RMSE"];
        header.extend(several.then_some("+/-"));
        header.extend((self.data.saturated > 0).then_some("without"));
        header.extend(["/ paper", "MAE", "log-cos", "correl.", "wins", "floats"]);
        header.extend(thinned.then_some("rows"));
        header.push("seconds");
        table.set_header(header);
        for column in table.column_iter_mut().skip(3) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let text = |value: &Option<String>| value.clone().unwrap_or_else(|| "-".to_owned());
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        for entry in &self.models {
            let held_out = &entry.held_out;
            let mut row = vec![
                entry.model.clone(),
                text(&entry.features),
                text(&entry.target),
                number(Some(entry.train_rmse), 4),
                number(Some(held_out.rmse), 4),
            ];
            row.extend(several.then(|| number(entry.rmse_deviation, 4)));
            let without = number(Some(entry.rmse_unsaturated), 4);
            row.extend((self.data.saturated > 0).then_some(without));
            row.extend([
                number(entry.rmse_ratio_to_paper, 2),
                number(Some(held_out.mae), 4),
                number(Some(held_out.log_cosine_mae), 4),
                number(held_out.correlation, 4),
                entry.wins.to_string(),
                entry.floats_per_channel.to_string(),
            ]);
            row.extend(thinned.then(|| entry.rows.to_string()));
            row.push(number(Some(entry.seconds), 2));
            table.add_row(row);
        }
        table
    }

    /// One line per model.
    fn csv(&self) -> Result<String> {
        let failed = |reason: std::io::Error| Error::Write {
            path: "comparison.csv".into(),
            reason,
        };
        let mut writer = csv::Writer::from_writer(Vec::new());
        let header = [
            "model",
            "features",
            "target",
            "network",
            "rows",
            "train_rmse",
            "rmse",
            "rmse_deviation",
            "rmse_unsaturated",
            "mae",
            "correlation",
            "relative_rmse",
            "log_cosine_mae",
            "cube_root_rmse",
            "rmse_ratio_to_paper",
            "wins",
            "floats_per_channel",
            "seconds",
        ];
        writer
            .write_record(header)
            .map_err(|error| failed(error.into()))?;
        let number = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
        for entry in &self.models {
            let held_out = &entry.held_out;
            let record = [
                entry.model.clone(),
                entry.features.clone().unwrap_or_default(),
                entry.target.clone().unwrap_or_default(),
                entry.network.to_string(),
                entry.rows.to_string(),
                entry.train_rmse.to_string(),
                held_out.rmse.to_string(),
                number(entry.rmse_deviation),
                entry.rmse_unsaturated.to_string(),
                held_out.mae.to_string(),
                number(held_out.correlation),
                number(held_out.relative_rmse),
                held_out.log_cosine_mae.to_string(),
                held_out.cube_root_rmse.to_string(),
                number(entry.rmse_ratio_to_paper),
                entry.wins.to_string(),
                entry.floats_per_channel.to_string(),
                entry.seconds.to_string(),
            ];
            writer
                .write_record(&record)
                .map_err(|error| failed(error.into()))?;
        }
        let bytes = writer
            .into_inner()
            .map_err(|error| failed(error.into_error()))?;
        String::from_utf8(bytes).map_err(|error| failed(std::io::Error::other(error)))
    }
}

#[cfg(test)]
mod tests;
