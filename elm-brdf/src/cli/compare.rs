//! `elm-brdf compare`: every model by the same folds, in one table.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use elm::solve::{PseudoInverse, Ridge};
use elm::{Activation, ElmParams};
use elm_datasets::{Invalid, Measurements};

use super::common::{hint, one_of, progress, usage};
use super::data::Source;
use super::{Failure, print};
use crate::error::Error;
use crate::features::Features;
use crate::geometry::pairs;
use crate::link::Link;
use crate::model::BrdfParams;
use crate::protocol::{Folds, cross_validate};
use crate::reference::{self, Reference};
use crate::report::{Comparison, Entry, Format};

/// Cross-validate every model on the same folds: analytic models, the database's own basis,
/// interpolators, Gaussian processes, and extreme learning machines.
///
/// Measurements are looked for as 'reproduce' looks for them.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder of CUReT files: table.txt with abrdf.dat, or with rbrdf.dat, gbrdf.dat and
    /// bbrdf.dat.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// 'paper', 'all', or a list of numbers and names, such as '1,39,orange peel'.
    #[arg(long, value_name = "LIST", default_value = "all")]
    materials: String,
    /// 'all', or a list of models, such as 'gaussian-process,ggx+lambert,elm (paper)'.
    #[arg(long, value_name = "LIST", default_value = "all")]
    models: String,
    /// Number of folds, at least 2.
    #[arg(long, value_name = "N", default_value_t = 10)]
    folds: usize,
    /// Seed of the folds and of random layers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Form of the output.
    #[arg(long, value_name = "FORM", default_value = "table",
          value_parser = one_of::<Format>(Format::ALL.map(Format::name)))]
    format: Format,
    /// What to do with negative BRDF values: set them to 0, keep them, or drop the measurement.
    #[arg(long, value_name = "WAY", default_value = "clamp",
          value_parser = one_of::<Invalid>(Invalid::ALL.map(Invalid::name)))]
    invalid: Invalid,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let start = Instant::now();
    let models = select(&arguments.models, arguments.seed)?;
    let source = Source::find(arguments.data.as_deref())?;
    let materials = source.select(&arguments.materials)?;
    let data = source.load(&materials, arguments.invalid)?;
    let folds =
        Folds::new(data.directions.len(), arguments.folds, arguments.seed).map_err(usage)?;
    hint(&source);

    let progress = progress("model");
    progress.set_length(models.len() as u64);
    let mut entries = Vec::new();
    for model in &models {
        entries.push(entry(model, &data, &folds)?);
        progress.inc(1);
    }
    progress.finish_and_clear();

    let comparison = Comparison::new(
        source.describe(),
        &data,
        folds.count(),
        arguments.seed,
        entries,
        start.elapsed().as_secs_f64(),
    );
    print(&comparison.render(arguments.format)?)
}

/// The models of these names, on all the inputs and targets that they come with.
fn select(list: &str, seed: u64) -> Result<Vec<Reference>, Failure> {
    let mut models: Vec<Reference> = reference::all().into_iter().chain(networks(seed)).collect();
    if list.trim() == "all" {
        return Ok(models);
    }
    let names: Vec<&str> = list.split(',').map(str::trim).collect();
    if let Some(&unknown) = names
        .iter()
        .find(|&&name| models.iter().all(|model| model.name != name))
    {
        let mut known: Vec<String> = models.into_iter().map(|model| model.name).collect();
        known.sort_unstable();
        known.dedup();
        return Err(usage(Error::UnknownName {
            what: "model",
            name: unknown.to_owned(),
            expected: known.join(", "),
        }));
    }
    models.retain(|model| names.contains(&model.name.as_str()));
    Ok(models)
}

/// The paper's network, and the same idea with inputs, target and ridge that suit the task.
fn networks(seed: u64) -> [Reference; 2] {
    let network = |neurons: usize| ElmParams::new(neurons).seed(seed);
    let reference = |name: &str, params: BrdfParams| Reference {
        name: name.to_owned(),
        features: Some(params.features),
        link: Some(params.link),
        growth: reference::Growth::Linear,
        method: Box::new(params),
    };
    [
        reference(
            "elm (paper)",
            BrdfParams {
                features: Features::Paper,
                link: Link::Identity,
                // As 'reproduce' has it: eq. 7 and 11.
                network: network(50)
                    .activation(Activation::Sigmoid)
                    .solver(PseudoInverse::default())
                    .intercept(false),
            },
        ),
        reference(
            "elm (200 sine, ridge)",
            BrdfParams {
                features: Features::Cosines,
                link: Link::default_log(),
                network: network(200)
                    .activation(Activation::Sine)
                    .solver(Ridge::leave_one_out()),
            },
        ),
    ]
}

fn entry(model: &Reference, data: &Measurements, folds: &Folds) -> Result<Entry, Failure> {
    let start = Instant::now();
    let scores = cross_validate(model.method.as_ref(), data, folds, |_, _| {})?;
    let seconds = start.elapsed().as_secs_f64();
    let floats = match data.samples(0) {
        Some(samples) => model
            .method
            .fit(&pairs(&samples.directions), samples.values.view())?
            .floats_per_channel(),
        None => 0,
    };
    Ok(Entry {
        floats_per_channel: floats,
        seconds,
        ..Entry::new(
            model.name.clone(),
            model.features.map(|features| features.name().to_owned()),
            model.link.map(|link| link.name().to_owned()),
            data,
            &scores,
        )
    })
}
