//! `elm-brdf fit`: fits a model to measurements and saves it.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::common::{one_of, usage};
use super::samples::{Material, Reading};
use super::{Failure, overwrite, print};
use crate::albedo;
use crate::error::Error;
use crate::features::Features;
use crate::file;
use crate::metrics::Metric;
use crate::model::{BrdfModel, Tuned, changes_after_half_turn};
use crate::prior::Prior;
use crate::quality;
use elm_datasets::channel;
use elm_datasets::geometry::DirectionPair;

/// Fit a network to measurements and save it as one file.
///
/// What is not given is chosen: inputs by the evidence of few measurements, or by the errors at
/// measurements left out of many, reciprocal ones where they tie; and before any other a network that
/// returns no more light than it receives. Printed are the errors at measurements
/// left out, a fifth at a time, and the directional albedo. The file holds the output weights and what
/// draws the random layer again, with where the model comes from and how good it is.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A file (.csv or another table, MERL .binary, RGL .bsdf, pbrt-v2 .brdf), - for standard input,
    /// or 'curet:NAME'.
    samples: String,
    /// The model's file: JSON for a name ending in .json, else binary.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Hidden neurons; chosen by the number of measurements if not given.
    #[arg(long, value_name = "N", conflicts_with = "prior")]
    neurons: Option<usize>,
    /// The most numbers that the model may store.
    #[arg(long, value_name = "N", conflicts_with = "prior")]
    max_floats: Option<usize>,
    /// Inputs of the network; chosen if not given.
    #[arg(long, value_name = "NAME", conflicts_with = "prior",
          value_parser = one_of::<Features>(Features::ALL.map(Features::name)))]
    features: Option<Features>,
    /// Choose among inputs that do not tell light from viewer: the model is then reciprocal.
    #[arg(long, conflicts_with_all = ["features", "prior"])]
    reciprocal: bool,
    /// The held-out error that is made small. With --prior it is the error of the logarithm,
    /// whatever is said here.
    #[arg(long, value_name = "NAME", default_value = "rmse",
          value_parser = one_of::<Metric>(Metric::ALL.map(Metric::name)))]
    metric: Metric,
    /// What other materials teach: a file that 'prior build' has written.
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// Seed of random layers and of rows drawn.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    reading: Reading,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.neurons == Some(0) {
        return Err(usage("--neurons is 0, expected at least 1"));
    }
    let mut inputs = arguments.reading.inputs(&arguments.samples);
    inputs.extend(arguments.prior.clone());
    overwrite::refuse([arguments.output.as_path()], &inputs)?;
    let material = arguments.reading.read(&arguments.samples)?;
    let counts = material.counts(arguments.reading.invalid);
    let Material {
        samples, source, ..
    } = material;
    let prior: Option<Prior> = match &arguments.prior {
        Some(path) => Some(file::load(path)?),
        None => None,
    };
    let start = Instant::now();
    let pairs = &samples.directions;
    let values = samples.values.view();
    let model = match prior {
        Some(prior) => prior.fit_model(pairs, values)?,
        None => Tuned {
            features: arguments.features,
            reciprocal: arguments.reciprocal,
            metric: arguments.metric,
            neurons: arguments.neurons,
            max_floats: arguments.max_floats,
            seed: arguments.seed,
        }
        .fit_model(pairs, values)?,
    };
    let seconds = start.elapsed().as_secs_f64();
    let mut about = model.provenance().clone();
    about.data = source;
    about.channels = samples.channels;
    let model = model.with_provenance(about);
    model.save(&arguments.output).map_err(Error::from)?;
    let mut text = describe(&model, &counts, seconds);
    if !model.features().is_isotropic() {
        text.push_str(GRAIN_NOTICE);
    }
    if changes_after_half_turn(pairs, values)? {
        text.push_str(ONE_SIDED);
    }
    text.push_str(&what_is_missing(pairs));
    text.push_str(&albedo_of(&model)?);
    text.push_str(&format!("written to {}\n", arguments.output.display()));
    print(&text)
}

/// What a user of a surface that is not isotropic must know.
const GRAIN_NOTICE: &str = "\
the surface has a grain: it looks different when it is turned about its normal, and the model turns with it; \
azimuths count from the x axis of the measurements\n";

/// What a user of a surface without the symmetry of a grain must know.
const ONE_SIDED: &str = "\
warning: the surface looks different after half a turn about its normal, which no model here can tell: it is \
fitted as if it looked the same\n";

/// What a user with measurements in the plane of incidence must know.
const ONE_PLANE: &str = "\
warning: all measurements lie in one plane: they cannot tell how the surface looks from beside it, where the \
model goes by half and difference angles; errors held out are those in the plane\n";

/// Fewer measurements than this say little of any surface.
const FEW: usize = 20;
/// The angle in degrees above which surfaces look most different from what they do below.
const STEEP: f64 = 60.0;

/// A line for each thing that these measurements cannot tell.
fn what_is_missing(pairs: &[DirectionPair]) -> String {
    let mut text = String::new();
    if pairs.len() < FEW {
        text.push_str(&format!(
            "warning: {} measurements are few: between and beyond them the model is a guess\n",
            pairs.len()
        ));
    }
    // Half a degree for angles that were rounded.
    let steep = (STEEP + 0.5).to_radians().cos();
    let seen = |cosine: fn(&DirectionPair) -> f64| pairs.iter().any(|pair| cosine(pair) < steep);
    let missing = match (seen(|pair| pair.incident[2]), seen(|pair| pair.outgoing[2])) {
        (true, true) => None,
        (false, true) => Some("light"),
        (true, false) => Some("viewer"),
        (false, false) => Some("light or viewer"),
    };
    if let Some(missing) = missing {
        text.push_str(&format!(
            "warning: no measurement has the {missing} above {STEEP} degrees from the normal: there the model is a \
             guess\n"
        ));
    }
    if quality::in_one_plane(pairs) {
        text.push_str(ONE_PLANE);
    }
    text
}

/// The albedo at the stated angles, the largest of the channels, with a warning above 1.
fn albedo_of(model: &BrdfModel) -> Result<String, Error> {
    let mut most = (0.0, 0.0);
    let mut by_angle = Vec::new();
    for degrees in albedo::ANGLES {
        let channels = albedo::directional(model, degrees.to_radians())?;
        let largest = channels.into_iter().fold(0.0, f64::max);
        if largest > most.0 {
            most = (largest, degrees);
        }
        by_angle.push(if largest >= 0.01 {
            format!("{largest:.3}")
        } else {
            format!("{largest:.2e}")
        });
    }
    let angles = albedo::ANGLES.map(|degrees| format!("{degrees}"));
    let mut text = format!(
        "directional albedo for light from {} degrees: {}\n",
        angles.join(", "),
        by_angle.join(", ")
    );
    let (largest, degrees) = most;
    if largest > 1.0 {
        text.push_str(&format!(
            "warning: at {degrees} degrees the model returns {largest:.3} times the light that it \
             receives, as its measurements do\n"
        ));
    }
    Ok(text)
}

/// Five decimals, or three digits of what is smaller.
fn number(value: f64) -> String {
    if value == 0.0 || value >= 1e-3 {
        format!("{value:.5}")
    } else {
        format!("{value:.2e}")
    }
}

fn describe(model: &BrdfModel, counts: &str, seconds: f64) -> String {
    let about = model.provenance();
    let neurons = model.network().hidden().neurons();
    let mut text = format!(
        "{} measurements of {}, channels {}\n\
         {counts}\n\
         {neurons} {} on '{}'{}, {} stored numbers, fitted in {seconds:.3} s\n",
        about.rows,
        about.data,
        channel::described(&about.channels),
        if neurons == 1 { "neuron" } else { "neurons" },
        model.features(),
        match model.network().outputs() {
            outputs if outputs < about.channels.len() => format!(", {outputs} outputs"),
            _ => String::new(),
        },
        model.stored_floats(),
    );
    if let Some(prior) = &about.prior {
        text.push_str(&format!("prior: {prior}\n"));
    }
    if let Some(errors) = &about.held_out {
        text.push_str(&format!(
            "held out, a fifth of the measurements at a time: RMSE {}, MAE {}, log-cosine {}, \
             cube root {}\n",
            number(errors.rmse),
            number(errors.mae),
            number(errors.log_cosine_mae),
            number(errors.cube_root_rmse)
        ));
    }
    if let Some(floor) = about.noise_floor {
        text.push_str(&format!(
            "noise of the measurements: {} 1/sr\n",
            number(floor)
        ));
    }
    text
}
