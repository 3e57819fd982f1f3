//! `elm-brdf eval`: errors of a saved model on measurements.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::samples::{Material, Reading};
use super::{Failure, print};
use crate::error::Error;
use crate::file;
use crate::metrics::Metrics;
use crate::model::BrdfModel;
use elm_datasets::{Brdf, channel};

/// Judge a saved model by measurements.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A file that 'fit' has written.
    model: PathBuf,
    /// A file (.csv or another table, MERL .binary, RGL .bsdf, pbrt-v2 .brdf), - for standard input,
    /// or 'curet:NAME'.
    samples: String,
    /// Form of the output.
    #[arg(long, value_enum, value_name = "FORM", default_value_t = Format::Table)]
    format: Format,
    #[command(flatten)]
    reading: Reading,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Table,
    Json,
    Csv,
}

/// The JSON form, field for field.
#[derive(Debug, Serialize)]
struct Evaluation {
    rows: usize,
    channels: Vec<String>,
    stored_floats: usize,
    neurons: usize,
    metrics: Metrics,
    /// Values of the file that were negative.
    negative: usize,
    /// Values of the file that were missing.
    missing: usize,
    /// Measurements of the file left out for their values.
    left_out: usize,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let model: BrdfModel = file::load(&arguments.model)?;
    let material = arguments.reading.read(&arguments.samples)?;
    let counts = material.counts(arguments.reading.invalid);
    let Material {
        samples,
        source,
        invalid,
        missing,
        left_out,
        ..
    } = material;
    let samples = model.matched(samples)?;
    let pairs = &samples.directions;
    let predicted = model.eval(pairs).map_err(Error::from)?;
    let evaluation = Evaluation {
        rows: pairs.len(),
        metrics: Metrics::of(pairs, predicted.view(), samples.values.view())?,
        channels: samples.channels,
        stored_floats: model.stored_floats(),
        neurons: model.network().hidden().neurons(),
        negative: invalid,
        missing,
        left_out,
    };
    print(&evaluation.render(arguments.format, &source, &counts)?)
}

impl Evaluation {
    fn measures(&self) -> [(&'static str, Option<f64>); 6] {
        let m = &self.metrics;
        [
            ("rmse", Some(m.rmse)),
            ("mae", Some(m.mae)),
            ("correlation", m.correlation),
            ("relative_rmse", m.relative_rmse),
            ("log_cosine_mae", Some(m.log_cosine_mae)),
            ("cube_root_rmse", Some(m.cube_root_rmse)),
        ]
    }

    fn render(&self, format: Format, source: &str, counts: &str) -> Result<String, Failure> {
        let number = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v}"));
        Ok(match format {
            Format::Json => {
                let text = serde_json::to_string_pretty(self).map_err(|reason| {
                    Failure::Failed(Error::Write {
                        path: "standard output".into(),
                        reason: reason.into(),
                    })
                })?;
                format!("{text}\n")
            }
            Format::Csv => {
                let names = self.measures().map(|(name, _)| name).join(",");
                let values = self.measures().map(|(_, value)| number(value)).join(",");
                format!(
                    "rows,stored_floats,neurons,{names}\n{},{},{},{values}\n",
                    self.rows, self.stored_floats, self.neurons
                )
            }
            Format::Table => {
                let mut text = format!(
                    "{} rows of {source}, channels {}\n{counts}\n{} neurons, {} stored numbers\n",
                    self.rows,
                    channel::described(&self.channels),
                    self.neurons,
                    self.stored_floats
                );
                for (name, value) in self.measures() {
                    let value = value.map_or_else(|| "-".to_owned(), |v| format!("{v:.5}"));
                    text.push_str(&format!("{name:<16}{value:>10}\n"));
                }
                text
            }
        })
    }
}
