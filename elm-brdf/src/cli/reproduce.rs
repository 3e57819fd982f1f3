//! `elm-brdf reproduce`: the paper's Tables I to III, recomputed.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use elm::Activation;
use elm::solve::{PseudoInverse, Solver};
use elm_datasets::{Invalid, Measurements};

use super::common::{DataFolder, Protocol, hint, one_of, progress, usage};
use super::data::Source;
use super::{Failure, models, overwrite, print};
use crate::fit::{AnyFit, boxed};
use crate::model::{BrdfParams, GlobalScaling};
use crate::protocol::{Folds, MaterialScores, cross_validate};
use crate::registry;
use crate::report::plot::{self, PredictionPlot};
use crate::report::{self, Format, Report, Seconds};

/// Recompute the paper's Tables I to III by cross-validation, beside what the paper printed.
///
/// Measurements are looked for in --data, then in the folder that ELM_BRDF_DATA names, then in
/// this program's folder in the user's cache; with none of them the built-in synthetic data
/// is used, and the output says so.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    folder: DataFolder,
    /// 'paper', 'all', or a list of numbers and names, such as '1,39,orange peel'.
    #[arg(long, value_name = "LIST", default_value = "paper")]
    materials: String,
    /// 'paper': the network of the paper. 'best': the best that is known, 'elm (prior)', each
    /// material with a prior from all others. Or any model that 'compare' knows. All but 'paper'
    /// choose their settings in each fold by its training rows alone.
    #[arg(long, value_name = "NAME", default_value = "paper")]
    model: String,
    #[command(flatten)]
    protocol: Protocol,
    /// Hidden neurons of the paper's network, at least 1 [default: 50].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    neurons: Option<usize>,
    /// Activation function of the paper's network [default: sigmoid].
    #[arg(long, value_name = "NAME",
          value_parser = one_of::<Activation<f64>>(Activation::<f64>::NAMES.split(", ")))]
    activation: Option<Activation<f64>>,
    /// Solver of the output weights of the paper's network: eq. 10 (needs as many neurons as
    /// training rows), eq. 11, or ridge with its strength chosen by leave-one-out on the training
    /// rows [default: pseudo-inverse].
    #[arg(long, value_name = "NAME",
          value_parser = one_of::<Solver>(Solver::NAMES.split(", ")))]
    solver: Option<Solver>,
    /// Which rows the inputs of the paper's network are scaled by: the training rows of each fold,
    /// or once all rows, which takes a single factorisation for all folds (with the pseudo-inverse
    /// only). Held-out directions then enter the scale; held-out values never do [default: fold].
    #[arg(long, value_enum, value_name = "WHEN")]
    scaling: Option<Scaling>,
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

impl Arguments {
    fn activation(&self) -> Activation<f64> {
        self.activation.clone().unwrap_or(Activation::Sigmoid)
    }

    fn solver(&self) -> Solver {
        self.solver.unwrap_or(PseudoInverse::default().into())
    }
}

/// What is cross-validated.
enum Model {
    /// The paper's network, the same but for its seed, and whether it is scaled once.
    Paper(Box<BrdfParams>, bool),
    /// A model that chooses its own settings.
    Named(String),
    /// [`registry::POOLED`].
    WithPrior,
}

impl Model {
    fn new(arguments: &Arguments) -> Result<Self, Failure> {
        if arguments.model == "paper" {
            return Self::paper(arguments);
        }
        let given = [
            ("--neurons", arguments.neurons.is_some()),
            ("--activation", arguments.activation.is_some()),
            ("--solver", arguments.solver.is_some()),
            ("--scaling", arguments.scaling.is_some()),
        ];
        if let Some((name, _)) = given.into_iter().find(|(_, given)| *given) {
            return Err(usage(format_args!(
                "{name} is a setting of the paper's network, found --model '{}'",
                arguments.model
            )));
        }
        if arguments.model == "best" {
            return Ok(Self::WithPrior);
        }
        let model = models::named(&arguments.model, arguments.protocol.seed)?;
        Ok(if model.name == registry::POOLED {
            Self::WithPrior
        } else {
            Self::Named(model.full_name())
        })
    }

    fn paper(arguments: &Arguments) -> Result<Self, Failure> {
        let solver = arguments.solver();
        let once = arguments.scaling == Some(Scaling::Once);
        if once && !matches!(solver, Solver::PseudoInverse(_)) {
            // Ridge's strength would be chosen on the held-out values too.
            return Err(usage(format_args!(
                "--scaling once needs --solver pseudo-inverse, found --solver {solver}"
            )));
        }
        let mut params = BrdfParams::paper(arguments.neurons.unwrap_or(50));
        params.network = params
            .network
            .with_activation(arguments.activation())
            .with_solver(solver)
            .with_seed(arguments.protocol.seed);
        params.network.check().map_err(usage)?;
        Ok(Self::Paper(Box::new(params), once))
    }

    fn protocol(&self, arguments: &Arguments) -> Result<report::Protocol, Failure> {
        let mut protocol = report::Protocol {
            model: arguments.model.clone(),
            features: None,
            target: None,
            neurons: None,
            activation: None,
            solver: None,
            scaling: None,
            folds: arguments.protocol.folds,
            seed: arguments.protocol.seed,
            seeds: arguments.protocol.seeds.into(),
        };
        match self {
            Self::Paper(params, once) => {
                let scaling = if *once { "once" } else { "fold" };
                protocol.features = Some(params.features.name().to_owned());
                protocol.target = Some(params.transform.name().to_owned());
                protocol.neurons = Some(params.network.neurons());
                protocol.activation = Some(arguments.activation().name().to_owned());
                protocol.solver = Some(arguments.solver().name().to_owned());
                protocol.scaling = Some(scaling.to_owned());
            }
            Self::Named(_) | Self::WithPrior => {
                let name = match self {
                    Self::Named(name) => name,
                    _ => registry::POOLED,
                };
                let model = models::named(name, arguments.protocol.seed)?;
                protocol.features = model.features.map(|features| features.name().to_owned());
                protocol.target = model.transform.map(|transform| transform.name().to_owned());
                protocol.model = model.name;
            }
        }
        Ok(protocol)
    }

    /// The method of one seed; `None` where each material has its own.
    fn method(&self, seed: u64) -> Result<Option<Box<AnyFit>>, Failure> {
        Ok(match self {
            Self::Paper(params, once) => {
                let params = (**params).clone().seed(seed);
                Some(if *once {
                    boxed(GlobalScaling::new(params)?)
                } else {
                    boxed(params)
                })
            }
            Self::Named(name) => Some(models::named(name, seed)?.method),
            Self::WithPrior => None,
        })
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let start = Instant::now();
    let model = Model::new(arguments)?;
    let protocol = model.protocol(arguments)?;

    let source = Source::find(arguments.folder.data.as_deref())?;
    let files = source.files();
    if let Some(dir) = &arguments.out {
        let names = overwrite::names(&["reproduce"], &["txt", "md", "csv", "json"]);
        overwrite::refuse_folder(dir, &names, &files)?;
    }
    if let Some(dir) = &arguments.plot {
        overwrite::refuse_folder(
            dir,
            &overwrite::names(&plot::NAMES, &["svg", "png"]),
            &files,
        )?;
    }
    let materials = source.select(&arguments.materials)?;
    let data = source.load(&materials, arguments.invalid)?;
    let load = start.elapsed().as_secs_f64();

    let rows = data.directions.len();
    Folds::new(rows, arguments.protocol.folds, arguments.protocol.seed).map_err(usage)?;
    let seeds: Vec<u64> = (arguments.protocol.seed..)
        .take(arguments.protocol.seeds.into())
        .collect();
    hint(&source);
    let progress = progress(match model {
        Model::WithPrior => "material",
        _ => "fold",
    });
    let mut runs = Vec::new();
    for (index, &seed) in seeds.iter().enumerate() {
        let folds = Folds::new(rows, arguments.protocol.folds, seed).map_err(usage)?;
        let done = |done, all| {
            progress.set_length((all * seeds.len()) as u64);
            progress.set_position((all * index + done) as u64);
        };
        runs.push(match model.method(seed)? {
            Some(method) => cross_validate(&*method, &data, &folds, done)?,
            None => models::cross_validate_with_prior(
                &source,
                &data,
                arguments.invalid,
                seed,
                &folds,
                done,
            )?,
        });
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
        let method = model.method(arguments.protocol.seed)?;
        draw(dir, &report, &data, scores, method.as_deref())?;
    }
    if let Some(dir) = &arguments.out {
        report.write(dir)?;
    }
    print(&report.render(arguments.format)?)
}

/// Pictures of the first seed's predictions, and lobes of a model of all measurements where one
/// method serves all materials.
fn draw(
    dir: &Path,
    report: &Report,
    data: &Measurements,
    scores: &[MaterialScores],
    method: Option<&AnyFit>,
) -> Result<(), Failure> {
    let protocol = &report.protocol;
    let title = format!(
        "{}; {}, seed {}",
        report.data.source,
        protocol.describe(),
        protocol.seed,
    );
    plot::write(dir, &title, &PredictionPlot::of(data, scores))?;
    if let Some(method) = method {
        let title = format!("{title}, fitted to all measurements");
        plot::write_fitted_lobes(dir, &title, data, method)?;
    }
    Ok(())
}
