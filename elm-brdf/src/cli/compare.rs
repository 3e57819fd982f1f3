//! `elm-brdf compare`: cross-validates every model on the same folds, in one table.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use elm_datasets::{Invalid, Measurements, Origin};
use ndarray::{ArrayView2, Axis};

use super::common::{Protocol, hint, one_of, progress, usage};
use super::data::Source;
use super::samples::{Material, Reading};
use super::{Failure, models, overwrite, print};
use crate::fit::AnyFit;
use crate::protocol::{Folds, MaterialScores, cross_validate, cross_validate_samples};
use crate::registry::{self, ModelEntry};
use crate::report::plot::{self, PredictionPlot};
use crate::report::{Comparison, Data, Entry, Format, ModelLabel};
use elm_datasets::geometry::DirectionPair;

/// Cross-validate every model on the same folds: analytic models, the database's own basis,
/// interpolators, Gaussian processes, and extreme learning machines.
///
/// Without SAMPLES many materials of CUReT are compared; measurements are looked for as
/// 'reproduce' looks for them.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Samples of one material: a file (CSV, MERL .binary, RGL .bsdf, pbrt-v2 .brdf), curet:NAME,
    /// or synthetic:paint.
    #[arg(value_name = "SAMPLES", conflicts_with = "materials")]
    samples: Option<String>,
    #[command(flatten)]
    reading: Reading,
    /// 'paper', 'all', or a list of numbers and names, such as '1,39,orange peel'.
    #[arg(long, value_name = "LIST", default_value = "all")]
    materials: String,
    /// 'all', or a list of models, such as 'gaussian-process,ggx+lambert,elm (paper)': names as the
    /// table prints them, or without what is in brackets at their end, for all of that name.
    #[arg(long, value_name = "LIST", default_value = "all")]
    models: String,
    #[command(flatten)]
    protocol: Protocol,
    /// Form of the output.
    #[arg(long, value_name = "FORM", default_value = "table",
          value_parser = one_of::<Format>(Format::ALL.map(Format::name)))]
    format: Format,
    /// Also draw the best model's pictures into this folder, as SVG and PNG.
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
}

/// What is compared on.
enum Subject {
    /// Many materials at the same directions.
    Materials(Source, Measurements),
    /// One material.
    Samples(Material),
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let start = Instant::now();
    let seeds: Vec<u64> = (arguments.protocol.seed..)
        .take(arguments.protocol.seeds.into())
        .collect();
    let names = models::select(&arguments.models, arguments.protocol.seed)?;
    let inputs = match &arguments.samples {
        Some(name) => arguments.reading.inputs(name),
        None => Source::find(arguments.reading.folder.data.as_deref())?.files(),
    };
    if let Some(dir) = &arguments.plot {
        overwrite::refuse_folder(
            dir,
            &overwrite::names(&plot::NAMES, &["svg", "png"]),
            &inputs,
        )?;
    }
    let subject = match &arguments.samples {
        Some(name) => Subject::Samples(arguments.reading.read(name)?),
        None => {
            let source = Source::find(arguments.reading.folder.data.as_deref())?;
            let materials = source.select(&arguments.materials)?;
            let data = source.load(&materials, arguments.reading.invalid)?;
            hint(&source);
            Subject::Materials(source, data)
        }
    };
    // Before the first fit.
    Folds::new(
        subject.rows(),
        arguments.protocol.folds,
        arguments.protocol.seed,
    )
    .map_err(usage)?;

    let (entries, best) = fit_all(arguments, &subject, &names, &seeds)?;
    let scores = best.as_ref().map_or(&[][..], |best| best.2.as_slice());
    let data = subject.data(scores);
    if let (Some(dir), Some((_, model, scores))) = (&arguments.plot, &best) {
        let title = format!("{}; {model}, seed {}", data.source, arguments.protocol.seed);
        plot::write(dir, &title, &subject.shown(scores))?;
    }
    let comparison = Comparison::new(
        data,
        arguments.protocol.folds,
        arguments.protocol.seed,
        seeds.len(),
        entries,
        start.elapsed().as_secs_f64(),
    );
    print(&comparison.render(arguments.format)?)
}

/// A model's error, name, and scores of the first seed.
type Best = (f64, String, Vec<MaterialScores>);

/// Cross-validates by model, then by seed; the best is kept for its pictures.
fn fit_all(
    arguments: &Arguments,
    subject: &Subject,
    names: &[ModelEntry],
    seeds: &[u64],
) -> Result<(Vec<Entry>, Option<Best>), Failure> {
    let progress = progress("model");
    progress.set_length((names.len() * seeds.len()) as u64);
    let mut entries = Vec::new();
    let mut best: Option<Best> = None;
    for (index, named) in names.iter().enumerate() {
        if named.name == registry::POOLED && matches!(subject, Subject::Samples(_)) {
            // One material has no others.
            progress.inc(seeds.len() as u64);
            continue;
        }
        let mut runs = Vec::new();
        let fitting = Instant::now();
        for &seed in seeds {
            let model = models::select(&arguments.models, seed)?
                .swap_remove(index)
                .with_row_limit(seed);
            let folds =
                Folds::new(subject.rows(), arguments.protocol.folds, seed).map_err(usage)?;
            runs.push(if model.name == registry::POOLED {
                subject.pooled(seed, arguments.reading.invalid, &folds)?
            } else {
                subject.cross_validate(model.method.as_ref(), &folds)?
            });
            progress.inc(1);
        }
        let entry = subject.entry(named, fitting, arguments.protocol.folds, &runs)?;
        let error = entry.held_out.rmse;
        if best.as_ref().is_none_or(|best| error < best.0) {
            best = Some((error, entry.model.clone(), runs.swap_remove(0)));
        }
        entries.push(entry);
    }
    progress.finish_and_clear();
    Ok((entries, best))
}

impl Subject {
    fn rows(&self) -> usize {
        match self {
            Self::Materials(_, data) => data.directions.len(),
            Self::Samples(material) => material.samples.directions.len(),
        }
    }

    fn cross_validate(
        &self,
        method: &AnyFit,
        folds: &Folds,
    ) -> Result<Vec<MaterialScores>, Failure> {
        Ok(match self {
            Self::Materials(_, data) => cross_validate(method, data, folds, |_, _| {})?,
            Self::Samples(material) => {
                let (name, samples) = (&material.name, &material.samples);
                let mut scores = cross_validate_samples(method, name, samples, folds, |_, _| {})?;
                scores.id = material.id;
                vec![scores]
            }
        })
    }

    /// Each material with a prior from all others that its source has.
    fn pooled(
        &self,
        seed: u64,
        invalid: Invalid,
        folds: &Folds,
    ) -> Result<Vec<MaterialScores>, Failure> {
        let Self::Materials(source, data) = self else {
            return Ok(Vec::new());
        };
        models::cross_validate_with_prior(source, data, invalid, seed, folds, |_, _| {})
    }

    fn data(&self, scores: &[MaterialScores]) -> Data {
        match self {
            Self::Materials(source, data) => Data::of(source.describe(), data, scores),
            Self::Samples(material) => Data::of_samples(
                material.source.clone(),
                material.synthetic,
                &material.samples,
                material.invalid,
                scores,
            ),
        }
    }

    /// The directions of the first material, and its values.
    fn first(&self) -> Option<(Vec<DirectionPair>, ArrayView2<'_, f64>)> {
        match self {
            Self::Materials(_, data) => {
                let material = data.materials.first()?;
                let all = &data.directions;
                let rows = material.rows.iter().map(|&row| all.get(row).copied());
                Some((rows.collect::<Option<_>>()?, material.values.view()))
            }
            Self::Samples(material) => Some((
                material.samples.directions.clone(),
                material.samples.values.view(),
            )),
        }
    }

    fn entry(
        &self,
        model: &ModelEntry,
        fitting: Instant,
        folds: usize,
        runs: &[Vec<MaterialScores>],
    ) -> Result<Entry, Failure> {
        let seconds = fitting.elapsed().as_secs_f64();
        let (channels, measured) = match self {
            Self::Materials(_, data) => (&data.channels, data.origin == Origin::Curet),
            Self::Samples(material) => (&material.samples.channels, material.id.is_some()),
        };
        let words = ModelLabel {
            model: model.name.clone(),
            features: model.features.map(|features| features.name().to_owned()),
            target: model.transform.map(|transform| transform.name().to_owned()),
            network: model.network,
        };
        let train = self.rows() - self.rows() / folds;
        let most = model.cost.max_rows().unwrap_or(train);
        let floats = match self.first() {
            // Fitted to no more than a cross-validation fits it to, at little cost.
            Some((pairs, values)) => {
                let rows = pairs.len().min(most);
                let values = values.slice_axis(Axis(0), ndarray::Slice::from(..rows));
                let model = model.method.fit(&pairs[..rows], values)?;
                model.floats_per_channel()
            }
            None => 0,
        };
        Ok(Entry {
            rows: train.min(most),
            floats_per_channel: floats,
            seconds,
            ..Entry::new(words, channels, measured, runs)
        })
    }

    fn shown<'a>(&'a self, scores: &'a [MaterialScores]) -> Vec<PredictionPlot<'a>> {
        match self {
            Self::Materials(_, data) => PredictionPlot::of(data, scores),
            Self::Samples(material) => scores
                .iter()
                .map(|scores| {
                    PredictionPlot::new(
                        material.name.clone(),
                        &material.samples.directions,
                        material.samples.values.view(),
                        scores,
                    )
                })
                .collect(),
        }
    }
}
