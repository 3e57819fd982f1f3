//! `elm-brdf reproduce`: the paper's Tables I to III, recomputed.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use elm::solve::Solver;
use elm::{Activation, ElmParams};
use elm_datasets::{Invalid, Measurements};

use super::common::{hint, one_of, progress, usage};
use super::data::Source;
use super::{Failure, print};
use crate::brdf::Fit;
use crate::features::Features;
use crate::link::Link;
use crate::model::{BrdfParams, ScaledOnce};
use crate::protocol::{Folds, MaterialScores, cross_validate};
use crate::report::plot::{self, Shown};
use crate::report::{Format, Protocol, Report, Seconds};

/// Recompute the paper's Tables I to III by cross-validation, beside what the paper printed.
///
/// Measurements are looked for in --data, then in the folder that ELM_BRDF_DATA names, then in
/// this program's folder in the user's cache; with none of them the built-in synthetic stand-in
/// is used, and the output says so.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder of CUReT files: table.txt with abrdf.dat, or with rbrdf.dat, gbrdf.dat and
    /// bbrdf.dat.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// 'paper', 'all', or a list of numbers and names, such as '1,39,orange peel'.
    #[arg(long, value_name = "LIST", default_value = "paper")]
    materials: String,
    /// Number of folds, at least 2.
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = 10
    )]
    folds: usize,
    /// Seed of the random layer and of the folds.
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = 1
    )]
    seed: u64,
    /// Number of seeds, at least 1: figures are means over this one and those that follow.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u16).range(1..))]
    seeds: u16,
    /// Hidden neurons, at least 1.
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = 50
    )]
    neurons: usize,
    /// Activation function of the hidden neurons.
    #[arg(long, value_name = "NAME", default_value = "sigmoid",
          value_parser = one_of::<Activation<f64>>(Activation::<f64>::NAMES.split(", ")))]
    activation: Activation<f64>,
    /// Solver of the output weights: eq. 10 (needs as many neurons as training rows), eq. 11, or
    /// ridge with its strength chosen by leave-one-out on the training rows.
    #[arg(long, value_name = "NAME", default_value = "pseudo-inverse",
          value_parser = one_of::<Solver>(Solver::NAMES.split(", ")))]
    solver: Solver,
    /// Which rows the inputs are scaled by: the training rows of each fold, or once all rows,
    /// which takes a single factorisation for all folds (with the pseudo-inverse only). Held-out
    /// directions then enter the scale; held-out values never do.
    #[arg(long, value_enum, value_name = "WHEN", default_value_t = Scaling::Fold)]
    scaling: Scaling,
    /// Form of the output.
    #[arg(long, value_name = "FORM", default_value = "table",
          value_parser = one_of::<Format>(Format::ALL.map(Format::name)))]
    format: Format,
    /// Also write every form to this folder, as reproduce.txt, .md, .csv and .json.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also draw pictures into this folder, as SVG and PNG: predicted against measured, error by
    /// angle, error by material, and lobes in the plane of incidence of the first 15 materials.
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
    /// What to do with negative BRDF values: set them to 0, keep them, or drop the measurement.
    #[arg(long, value_name = "WAY", default_value = "clamp",
          value_parser = one_of::<Invalid>(Invalid::ALL.map(Invalid::name)))]
    invalid: Invalid,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Scaling {
    Fold,
    Once,
}

impl Scaling {
    /// The name in reports.
    fn name(self) -> &'static str {
        match self {
            Self::Fold => "fold",
            Self::Once => "once",
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let start = Instant::now();
    let params = |seed| BrdfParams {
        features: Features::Paper,
        link: Link::Identity,
        network: ElmParams::new(arguments.neurons)
            .activation(arguments.activation.clone())
            .solver(arguments.solver)
            // Equation 7 has no constant term.
            .intercept(false)
            .seed(seed),
    };
    let first = params(arguments.seed);
    first.network.clone().check().map_err(usage)?;
    let once = arguments.scaling == Scaling::Once;
    if once && !matches!(arguments.solver, Solver::PseudoInverse(_)) {
        // Ridge's strength would be chosen on the held-out values too.
        return Err(usage(format_args!(
            "--scaling once needs --solver pseudo-inverse, found --solver {}",
            arguments.solver
        )));
    }

    let source = Source::find(arguments.data.as_deref())?;
    let materials = source.select(&arguments.materials)?;
    let data = source.load(&materials, arguments.invalid)?;
    let load = start.elapsed().as_secs_f64();

    let rows = data.directions.len();
    Folds::new(rows, arguments.folds, arguments.seed).map_err(usage)?;
    let seeds: Vec<u64> = (arguments.seed..).take(arguments.seeds.into()).collect();
    let protocol = Protocol {
        model: "paper".to_owned(),
        features: first.features.name().to_owned(),
        target: first.link.name().to_owned(),
        neurons: arguments.neurons,
        activation: arguments.activation.name().to_owned(),
        solver: arguments.solver.name().to_owned(),
        scaling: arguments.scaling.name().to_owned(),
        folds: arguments.folds,
        seed: arguments.seed,
        seeds: seeds.len(),
    };
    hint(&source);
    let progress = progress("fold");
    let mut runs = Vec::new();
    for (index, &seed) in seeds.iter().enumerate() {
        let folds = Folds::new(rows, arguments.folds, seed).map_err(usage)?;
        let method: Box<dyn Fit> = if once {
            Box::new(ScaledOnce::new(params(seed))?)
        } else {
            Box::new(params(seed))
        };
        runs.push(cross_validate(&*method, &data, &folds, |done, all| {
            progress.set_length((all * seeds.len()) as u64);
            progress.set_position((all * index + done) as u64);
        })?);
    }
    progress.finish_and_clear();

    let total = start.elapsed().as_secs_f64();
    let seconds = Seconds {
        load,
        fit: total - load,
        total,
    };
    let report = Report::new(source.describe(), &data, protocol, &runs, seconds);
    if let (Some(dir), Some(scores)) = (&arguments.plot, runs.first()) {
        draw(dir, &report, &data, scores, &first)?;
    }
    if let Some(dir) = &arguments.out {
        report.write(dir)?;
    }
    print(&report.render(arguments.format)?)
}

/// Pictures of the first seed's predictions, and lobes of a model of all measurements.
fn draw(
    dir: &Path,
    report: &Report,
    data: &Measurements,
    scores: &[MaterialScores],
    method: &dyn Fit,
) -> Result<(), Failure> {
    let protocol = &report.protocol;
    let title = format!(
        "{}; {} model, {} {} neurons, {}, seed {}",
        report.data.source,
        protocol.model,
        protocol.neurons,
        protocol.activation,
        protocol.solver,
        protocol.seed,
    );
    plot::write(dir, &title, &Shown::of(data, scores))?;
    let title = format!("{title}, fitted to all measurements");
    plot::write_fitted_lobes(dir, &title, data, method)?;
    Ok(())
}
