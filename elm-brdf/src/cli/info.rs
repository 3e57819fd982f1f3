//! `elm-brdf info`: what a model's file holds.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use elm_datasets::Brdf;
use serde::Serialize;

use super::{Failure, print};
use crate::albedo;
use crate::error::Error;
use crate::file;
use crate::metrics::Metrics;
use crate::model::BrdfModel;

/// Say what a saved model holds.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A file that 'fit' has written.
    model: PathBuf,
    /// Form of the output.
    #[arg(long, value_enum, value_name = "FORM", default_value_t = Format::Table)]
    format: Format,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Table,
    Json,
}

/// Angles of the light in degrees at which the albedo is shown.
const ANGLES: [f64; 4] = [0.0, 30.0, 60.0, 80.0];

/// The JSON form, field for field.
#[derive(Debug, Serialize)]
struct Info {
    /// What was fitted.
    data: String,
    /// Number of measurements.
    rows: usize,
    channels: Vec<String>,
    /// Names of the network's inputs.
    inputs: Vec<&'static str>,
    neurons: usize,
    activations: Vec<String>,
    isotropic: bool,
    /// The largest polar angles measured in degrees, of the light and of the viewer; null where the file
    /// does not say.
    measured_to_degrees: Option<[f64; 2]>,
    seed: u64,
    /// Errors on measurements held out.
    held_out: Option<Metrics>,
    /// Standard deviation of the measurements' noise in 1/sr.
    noise_floor: Option<f64>,
    prior: Option<String>,
    stored_floats: usize,
    file_bytes: u64,
    /// Angles of the light in degrees, and the directional albedo there, the largest of the channels.
    albedo: Vec<[f64; 2]>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let path = &arguments.model;
    let model: BrdfModel = file::load(path)?;
    let info = Info::of(
        &model,
        std::fs::metadata(path).map_or(0, |about| about.len()),
    )?;
    print(&match arguments.format {
        Format::Json => {
            let text = serde_json::to_string_pretty(&info).map_err(|reason| Error::Write {
                path: "standard output".into(),
                reason: reason.into(),
            })?;
            format!("{text}\n")
        }
        Format::Table => info.table(),
    })
}

impl Info {
    fn of(model: &BrdfModel, file_bytes: u64) -> Result<Self, Error> {
        let about = model.provenance();
        let albedo = ANGLES.map(|degrees| {
            let channels = albedo::directional(model, f64::to_radians(degrees))?;
            Ok([degrees, channels.into_iter().fold(0.0, f64::max)])
        });
        let hidden = model.network().hidden();
        let mut activations: Vec<&str> = Vec::new();
        for group in hidden.groups() {
            let name = group.activation().name();
            if !activations.contains(&name) {
                activations.push(name);
            }
        }
        Ok(Self {
            data: about.data.clone(),
            rows: about.rows,
            channels: model.channel_names(),
            inputs: model.features().inputs().to_vec(),
            neurons: hidden.neurons(),
            activations: activations.into_iter().map(str::to_owned).collect(),
            isotropic: model.is_isotropic(),
            measured_to_degrees: about.measured_to.map(|angles| angles.map(f64::to_degrees)),
            seed: about.seed,
            held_out: about.held_out,
            noise_floor: about.noise_floor,
            prior: about.prior.clone(),
            stored_floats: model.stored_floats(),
            file_bytes,
            albedo: albedo.into_iter().collect::<Result<_, Error>>()?,
        })
    }

    fn table(&self) -> String {
        let mut lines = vec![
            (
                "fitted to",
                format!("{} measurements of {}", self.rows, self.data),
            ),
            ("channels", self.channels.join(", ")),
            ("inputs", self.inputs.join(", ")),
            (
                "network",
                format!(
                    "{} neurons ({}), seed {}",
                    self.neurons,
                    self.activations.join(", "),
                    self.seed
                ),
            ),
            (
                "surface",
                if self.isotropic {
                    "isotropic".to_owned()
                } else {
                    "anisotropic: azimuths count from the x axis of the measurements".to_owned()
                },
            ),
            (
                "size",
                format!(
                    "{} stored numbers, {} bytes",
                    self.stored_floats, self.file_bytes
                ),
            ),
        ];
        if let Some([light, viewer]) = self.measured_to_degrees {
            lines.push((
                "measured",
                format!("light to {light:.1}, viewer to {viewer:.1} degrees from the normal"),
            ));
        }
        if let Some(errors) = &self.held_out {
            lines.push((
                "held out",
                format!(
                    "RMSE {:.3e}, MAE {:.3e}, log-cosine {:.3e}",
                    errors.rmse, errors.mae, errors.log_cosine_mae
                ),
            ));
        }
        if let Some(floor) = self.noise_floor {
            lines.push(("noise", format!("{floor:.3e} 1/sr")));
        }
        if let Some(prior) = &self.prior {
            lines.push(("prior", prior.clone()));
        }
        let albedo = self.albedo.iter();
        let albedo = albedo.map(|[angle, value]| format!("{value:.3e} at {angle}"));
        lines.push((
            "albedo",
            format!("{} degrees", albedo.collect::<Vec<_>>().join(", ")),
        ));
        let lines = lines
            .iter()
            .map(|(name, text)| format!("{name:<10} {text}\n"));
        lines.collect()
    }
}
