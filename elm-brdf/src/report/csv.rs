//! The report as CSV: one line per material, channel and measure.

use super::Report;
use super::tables::Measure;
use crate::error::{Error, Result};

pub(super) fn render(report: &Report) -> Result<String> {
    let failed = |reason: std::io::Error| Error::Write {
        path: "report.csv".into(),
        reason,
    };
    let mut writer = csv::Writer::from_writer(Vec::new());
    let header = [
        "data",
        "id",
        "material",
        "channel",
        "measure",
        "train",
        "held_out",
        "held_out_fold_mean",
        "held_out_unsaturated",
        "held_out_deviation",
        "noise_floor",
        "saturated",
        "paper",
        "ratio",
    ];
    writer
        .write_record(header)
        .map_err(|error| failed(error.into()))?;
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    for measure in Measure::ALL {
        for material in &report.materials {
            for channel in &material.channels {
                let record = [
                    if report.data.synthetic {
                        "synthetic"
                    } else {
                        "measured"
                    }
                    .to_owned(),
                    material.id.to_string(),
                    material.name.clone(),
                    channel.channel.clone(),
                    measure.name().to_owned(),
                    number(measure.of(&channel.train)),
                    number(measure.of(&channel.held_out)),
                    number(measure.of(&channel.held_out_fold_mean)),
                    number(measure.of(&channel.held_out_unsaturated)),
                    number(channel.held_out_deviation.and_then(|d| measure.of(&d))),
                    number(channel.noise_floor.map(|floor| floor.sigma)),
                    channel.saturated.to_string(),
                    number(channel.paper.and_then(|paper| measure.printed(&paper))),
                    number(measure.ratio(channel)),
                ];
                writer
                    .write_record(&record)
                    .map_err(|error| failed(error.into()))?;
            }
        }
    }
    let bytes = writer
        .into_inner()
        .map_err(|error| failed(error.into_error()))?;
    String::from_utf8(bytes).map_err(|error| failed(std::io::Error::other(error)))
}
