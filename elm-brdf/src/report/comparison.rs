//! What `compare` found: every model on the same folds.

use serde::{Deserialize, Serialize};

use comfy_table::CellAlignment;
use elm_datasets::Measurements;

use super::tables::{Style, push, styled, trim};
use super::{Data, Format, json, mean, paper};
use crate::error::{Error, Result};
use crate::protocol::MaterialScores;

/// Models cross-validated on the same folds, the smallest held-out error first. Its JSON form is
/// this structure, field for field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// What was fitted.
    pub data: Data,
    /// Number of folds.
    pub folds: usize,
    /// Seed of the folds, and of random layers.
    pub seed: u64,
    /// One entry per model.
    pub models: Vec<Entry>,
    /// Wall-clock time of everything, in seconds.
    pub seconds: f64,
}

/// The figures of one model: means over all materials and channels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The model's name.
    pub model: String,
    /// The set of inputs; `None` for a model of the directions themselves.
    pub features: Option<String>,
    /// The regression target; `None` where it can only be the reflectance.
    pub target: Option<String>,
    /// Root mean squared error on training rows, in 1/sr.
    pub train_rmse: f64,
    /// Root mean squared error of all held-out rows of a channel together, in 1/sr.
    pub rmse: f64,
    /// Mean absolute error of the same, in 1/sr.
    pub mae: f64,
    /// Correlation of the same, over the channels where it exists.
    pub correlation: Option<f64>,
    /// Geometric mean of held-out RMSE over the paper's, for the materials that it prints.
    pub rmse_ratio_to_paper: Option<f64>,
    /// Numbers stored for a channel, fitted to all rows.
    pub floats_per_channel: usize,
    /// Wall-clock time of fitting and evaluating all folds, in seconds.
    pub seconds: f64,
}

impl Entry {
    /// Means of these scores.
    #[must_use]
    pub fn new(
        model: String,
        features: Option<String>,
        target: Option<String>,
        data: &Measurements,
        scores: &[MaterialScores],
    ) -> Self {
        let measured = data.origin == elm_datasets::Origin::Curet;
        let channels = || scores.iter().flat_map(|material| &material.channels);
        let ratios = scores.iter().flat_map(|material| {
            let channels = material.channels.iter().zip(&data.channels);
            channels.filter_map(|(scores, channel)| {
                let paper = paper(material.id?, channel, measured)?;
                Some((scores.held_out.rmse / paper.rmse).ln())
            })
        });
        Self {
            model,
            features,
            target,
            train_rmse: mean(channels().map(|c| c.train.rmse)).unwrap_or(0.0),
            rmse: mean(channels().map(|c| c.held_out.rmse)).unwrap_or(0.0),
            mae: mean(channels().map(|c| c.held_out.mae)).unwrap_or(0.0),
            correlation: mean(channels().filter_map(|c| c.held_out.correlation)),
            rmse_ratio_to_paper: mean(ratios).map(f64::exp),
            floats_per_channel: 0,
            seconds: 0.0,
        }
    }
}

impl Comparison {
    /// Sorts the entries.
    #[must_use]
    pub fn new(
        source: String,
        data: &Measurements,
        folds: usize,
        seed: u64,
        mut models: Vec<Entry>,
        seconds: f64,
    ) -> Self {
        models.sort_by(|a, b| a.rmse.total_cmp(&b.rmse));
        Self {
            data: Data::of(source, data, &[]),
            folds,
            seed,
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
                format_args!(
                    "{item}SYNTHETIC stand-in data, not measurements: no CUReT files were found.\n"
                ),
            );
        }
        push(&mut out, format_args!("{item}Data: {}\n", data.source));
        push(
            &mut out,
            format_args!(
                "{item}{} materials x {} directions, channels: {}; {}-fold cross-validation, seed {}\n\n",
                data.materials,
                data.measurements,
                data.channels.join(", "),
                self.folds,
                self.seed,
            ),
        );
        push(
            &mut out,
            format_args!("{}\n\n", trim(&self.rows(style).to_string())),
        );
        push(
            &mut out,
            format_args!(
                "{item}RMSE, MAE (1/sr) and correlation: held out, each channel's rows together, mean \
                 over materials and channels; 'train' is the RMSE on training rows.\n"
            ),
        );
        if self.models.iter().any(|m| m.rmse_ratio_to_paper.is_some()) {
            push(
                &mut out,
                format_args!(
                    "{item}'/ paper': held-out RMSE over the paper's printed RMSE, geometric mean over \
                     the materials that it prints.\n"
                ),
            );
        }
        push(
            &mut out,
            format_args!(
                "{item}'floats': numbers stored for a channel, those that a seed regenerates not \
                 counted. Seconds in all: {:.1}\n",
                self.seconds
            ),
        );
        out
    }

    fn rows(&self, style: Style) -> comfy_table::Table {
        let mut table = styled(style);
        table.set_header([
            "model", "inputs", "target", "train", "RMSE", "/ paper", "MAE", "correl.", "floats",
            "seconds",
        ]);
        for column in table.column_iter_mut().skip(3) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let text = |value: &Option<String>| value.clone().unwrap_or_else(|| "-".to_owned());
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        for entry in &self.models {
            table.add_row([
                entry.model.clone(),
                text(&entry.features),
                text(&entry.target),
                number(Some(entry.train_rmse), 4),
                number(Some(entry.rmse), 4),
                number(entry.rmse_ratio_to_paper, 2),
                number(Some(entry.mae), 4),
                number(entry.correlation, 4),
                entry.floats_per_channel.to_string(),
                number(Some(entry.seconds), 2),
            ]);
        }
        table
    }

    fn csv(&self) -> Result<String> {
        let failed = |reason: std::io::Error| Error::Write {
            path: "comparison.csv".into(),
            reason,
        };
        let mut writer = csv::Writer::from_writer(Vec::new());
        for entry in &self.models {
            // The header is the fields' names.
            writer
                .serialize(entry)
                .map_err(|error| failed(error.into()))?;
        }
        let bytes = writer
            .into_inner()
            .map_err(|error| failed(error.into_error()))?;
        String::from_utf8(bytes).map_err(|error| failed(std::io::Error::other(error)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Folds, cross_validate};
    use crate::reference::Analytic;
    use elm_datasets::{Invalid, MaterialId, synthetic};

    fn comparison() -> Comparison {
        let ids = [1, 39].map(|n| MaterialId::new(n).unwrap());
        let data = synthetic::measurements(1, &ids, Invalid::Clamp);
        let folds = Folds::new(data.directions.len(), 5, 1).unwrap();
        let entries = [Analytic::Lambert, Analytic::GgxOrenNayar].map(|model| {
            let scores = cross_validate(&model, &data, &folds, |_, _| {}).unwrap();
            Entry::new(model.name().to_owned(), None, None, &data, &scores)
        });
        Comparison::new("stand-in".to_owned(), &data, 5, 1, entries.to_vec(), 0.5)
    }

    #[test]
    fn the_model_with_the_smaller_error_comes_first_in_every_form() {
        let comparison = comparison();
        // The stand-in has highlights, which a constant misses.
        assert_eq!(comparison.models[0].model, "ggx+oren-nayar");
        for format in Format::ALL {
            let text = comparison.render(format).unwrap();
            let place = |name: &str| text.find(name).unwrap();
            assert!(place("ggx+oren-nayar") < place("lambert"), "{text}");
            assert!(text.ends_with('\n'));
        }
    }

    #[test]
    fn json_is_read_back() {
        let comparison = comparison();
        let text = comparison.render(Format::Json).unwrap();
        assert_eq!(
            serde_json::from_str::<Comparison>(&text).unwrap(),
            comparison
        );
    }

    #[test]
    fn the_stand_in_is_never_compared_with_the_paper() {
        let comparison = comparison();
        assert!(
            comparison
                .models
                .iter()
                .all(|m| m.rmse_ratio_to_paper.is_none())
        );
        let text = comparison.render(Format::Table).unwrap();
        assert!(
            text.contains("SYNTHETIC") && !text.contains("printed"),
            "{text}"
        );
    }
}
