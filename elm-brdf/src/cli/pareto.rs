//! `elm-brdf pareto`: run time against error.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::common::{hint, one_of, progress, usage};
use super::data::Source;
use super::samples::Reading;
use super::{Failure, overwrite, print};
use crate::baselines::Nbrdf;
use crate::error::Error;
use crate::file;
use crate::metrics::Metric;
use crate::pareto::{self, CostPoint, PretrainedModel, TrainTestSplit};
use crate::protocol::Folds;
use crate::registry::{self, Candidate};
use crate::report::plot;

/// Weigh run time against error: for every model that can be fitted, the held-out error, the time to
/// fit, the time of an evaluation, and the numbers stored; and which models no other beats.
///
/// Writes pareto.csv, pareto.json, pareto.svg and pareto.png to the folder. Without --samples
/// materials of CUReT are judged, each by folds; measurements are looked for as 'reproduce' looks
/// for them. An evaluation is one pair of directions with all channels, in a batch on one thread.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Samples of one material: a file (CSV, MERL .binary, RGL .bsdf, pbrt-v2 .brdf), curet:NAME or
    /// synthetic:paint. May be given several times: each material then gets its own folder. A file
    /// NAME_train.csv is tested on NAME_test.csv if that exists; otherwise a random fifth of the
    /// rows, drawn by the seed, is held out.
    #[arg(long, value_name = "SAMPLES", conflicts_with = "materials")]
    samples: Vec<String>,
    /// File of samples that judge; once for each --samples.
    #[arg(long, value_name = "SAMPLES", requires = "samples")]
    test: Vec<String>,
    /// Weights of NBRDF, 675 little-endian f32; or a folder that has NAME.f32 for samples NAME or
    /// NAME_train.
    #[arg(long, value_name = "FILE", requires = "samples")]
    nbrdf: Option<PathBuf>,
    /// 'paper', 'all', or a list of numbers and names, such as '1,39,orange peel'.
    #[arg(long, value_name = "LIST", default_value = "paper")]
    materials: String,
    /// The held-out error: rmse unless given, and log-cosine with --samples.
    #[arg(long, value_name = "NAME",
          value_parser = one_of::<Metric>(Metric::ALL.map(Metric::name)))]
    metric: Option<Metric>,
    /// Only models whose names contain one of these, with commas between, such as
    /// 'elm squared-relu,ggx'.
    #[arg(long, value_name = "LIST")]
    models: Option<String>,
    /// Folds for materials of CUReT, at least 2.
    #[arg(long, value_name = "N", default_value_t = 3)]
    folds: usize,
    /// Seed of folds, rows held out, and random layers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder for the results; made if need be.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    reading: Reading,
}

/// What models are weighed on.
struct Subject {
    /// Of a folder, where there are several.
    name: String,
    /// Where the measurements come from, and how they are held out.
    about: String,
    problems: Vec<TrainTestSplit>,
    given: Vec<PretrainedModel>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if !arguments.test.is_empty() && arguments.test.len() != arguments.samples.len() {
        return Err(usage(format!(
            "{} --test for {} --samples: expected one for each, or none",
            arguments.test.len(),
            arguments.samples.len()
        )));
    }
    let metric = arguments.metric.unwrap_or(if arguments.samples.is_empty() {
        Metric::Rmse
    } else {
        Metric::LogCosine
    });
    let candidates = candidates(arguments, metric)?;
    refuse_inputs(arguments)?;
    let mut subjects = Vec::new();
    for (index, name) in arguments.samples.iter().enumerate() {
        let test = arguments.test.get(index).map(String::as_str);
        subjects.push(of_samples(arguments, name, test)?);
    }
    if subjects.is_empty() {
        subjects.push(of_materials(arguments)?);
    }

    let progress = progress("model");
    progress.set_length((candidates.len() * subjects.len()) as u64);
    let several = subjects.len() > 1;
    let mut text = String::new();
    for (number, subject) in subjects.into_iter().enumerate() {
        let dir = if several {
            // Two files of one name in two folders are two materials.
            let same = |other: &&String| stem(other) == subject.name;
            let before = arguments.samples[..number].iter().filter(same).count();
            arguments.out.join(match before {
                0 => subject.name.clone(),
                before => format!("{}-{}", subject.name, before + 1),
            })
        } else {
            arguments.out.clone()
        };
        let first = number * candidates.len();
        let points = pareto::run(
            &candidates,
            subject.given,
            &subject.problems,
            metric,
            |done| progress.set_position((first + done) as u64),
        )?;
        let title = format!("{}; {metric}, held out", subject.about);
        write(&dir, &title, metric, &points)?;
        text.push_str(&describe(&title, &dir, &points));
    }
    progress.finish_and_clear();
    print(&text)
}

/// Refuses a folder for results in which one of them is an input.
fn refuse_inputs(arguments: &Arguments) -> Result<(), Failure> {
    let reading = &arguments.reading;
    let mut inputs = arguments.nbrdf.clone().into_iter().collect::<Vec<_>>();
    for name in arguments.samples.iter().chain(&arguments.test) {
        inputs.extend(reading.inputs(name));
        inputs.extend(test_beside(name).map(Into::into));
    }
    if arguments.samples.is_empty() {
        inputs.extend(Source::find(reading.folder.data.as_deref())?.files());
    }
    let names = overwrite::names(&["pareto"], &["csv", "json", "svg", "png"]);
    overwrite::refuse_folder(&arguments.out, &names, &inputs)?;
    for name in &arguments.samples {
        overwrite::refuse_folder(&arguments.out.join(stem(name)), &names, &inputs)?;
    }
    Ok(())
}

fn candidates(arguments: &Arguments, metric: Metric) -> Result<Vec<Candidate>, Failure> {
    let mut all = registry::candidates(metric, arguments.seed);
    if let Some(list) = &arguments.models {
        let parts: Vec<&str> = list.split(',').map(str::trim).collect();
        let is_unknown =
            |part: &&&str| !all.iter().any(|candidate| candidate.name.contains(**part));
        if let Some(unknown) = parts.iter().find(is_unknown) {
            let names: Vec<&str> = all
                .iter()
                .map(|candidate| candidate.name.as_str())
                .collect();
            return Err(usage(Error::UnknownName {
                what: "model",
                name: (*unknown).to_owned(),
                expected: names.join(", "),
            }));
        }
        all.retain(|candidate| parts.iter().any(|part| candidate.name.contains(part)));
    }
    Ok(all)
}

/// The name of samples without folder, extension, and what says that they are to be fitted.
fn stem(samples: &str) -> String {
    let stem = Path::new(samples)
        .file_stem()
        .map_or_else(|| samples.to_owned(), |s| s.to_string_lossy().into_owned());
    let stem = stem.strip_suffix("_train").unwrap_or(&stem);
    // Of 'curet:39' too a folder can be made.
    stem.replace(':', "-")
}

/// The file NAME_test beside a file NAME_train, where there is one.
fn test_beside(samples: &str) -> Option<String> {
    let path = Path::new(samples);
    let name = path.file_stem()?.to_str()?.strip_suffix("_train")?;
    let mut test = path.with_file_name(format!("{name}_test"));
    if let Some(extension) = path.extension() {
        test.set_extension(extension);
    }
    test.is_file().then(|| test.to_string_lossy().into_owned())
}

fn of_samples(arguments: &Arguments, name: &str, test: Option<&str>) -> Result<Subject, Failure> {
    let mut material = arguments.reading.read(name)?;
    // As published weights have them.
    material.samples = material.samples.in_rgb_order();
    let (all, values) = (&material.samples.directions, material.samples.values.view());
    let test = test.map(str::to_owned).or_else(|| test_beside(name));
    let (problem, how) = match &test {
        Some(test) => {
            let judges = arguments.reading.read(test)?;
            let judges = judges
                .samples
                .matched(&material.samples.channels)
                .ok_or_else(|| Error::ChannelNames {
                    model: material.samples.channels.join(", "),
                    samples: judges.samples.channels.join(", "),
                })?;
            let problem = TrainTestSplit {
                train: all.clone(),
                train_values: values.to_owned(),
                test: judges.directions,
                test_values: judges.values,
            };
            (problem, format!("judged on {test}"))
        }
        None => {
            let folds = Folds::new(all.len(), 5, arguments.seed).map_err(usage)?;
            let problem = TrainTestSplit::split(all, values, |row| folds.of_row(row) == 0);
            (problem, "judged on a fifth of its rows".to_owned())
        }
    };
    let mut given = Vec::new();
    if let Some(path) = &arguments.nbrdf {
        let path = if path.is_dir() {
            path.join(format!("{}.f32", stem(name)))
        } else {
            path.clone()
        };
        let start = Instant::now();
        let model = Nbrdf::read(&path)?;
        if problem.train_values.ncols() != 3 {
            return Err(usage(format!(
                "--nbrdf has 3 channels, {name} has {}",
                problem.train_values.ncols()
            )));
        }
        given.push(PretrainedModel {
            name: NBRDF.to_owned(),
            model: Box::new(model),
            seconds: start.elapsed().as_secs_f64(),
        });
    }
    Ok(Subject {
        name: stem(name),
        about: format!(
            "{}, {} rows fitted to, {how}, {} rows",
            material.source,
            problem.train.len(),
            problem.test.len()
        ),
        problems: vec![problem],
        given,
    })
}

/// The name of NBRDF's published weights in results.
const NBRDF: &str = "nbrdf (published)";

fn of_materials(arguments: &Arguments) -> Result<Subject, Failure> {
    let source = Source::find(arguments.reading.folder.data.as_deref())?;
    let materials = source.select(&arguments.materials)?;
    let data = source.load(&materials, arguments.reading.invalid)?;
    hint(&source);
    let mut problems = Vec::new();
    for index in 0..data.materials.len() {
        let Some(samples) = data.samples(index) else {
            continue;
        };
        let pairs = &samples.directions;
        let folds = Folds::new(pairs.len(), arguments.folds, arguments.seed).map_err(usage)?;
        problems.extend((0..arguments.folds).map(|fold| {
            TrainTestSplit::split(pairs, samples.values.view(), |row| {
                folds.of_row(row) == fold
            })
        }));
    }
    Ok(Subject {
        name: "materials".to_owned(),
        about: format!(
            "{}, {} materials in {} folds",
            source.describe(),
            data.materials.len(),
            arguments.folds
        ),
        problems,
        given: Vec::new(),
    })
}

fn write(dir: &Path, title: &str, metric: Metric, points: &[CostPoint]) -> Result<(), Failure> {
    file::folder(dir)?;
    let failed = |path: &Path, reason: std::io::Error| Error::Write {
        path: path.to_owned(),
        reason,
    };
    let path = dir.join("pareto.json");
    let mut json =
        serde_json::to_vec_pretty(points).map_err(|error| failed(&path, error.into()))?;
    json.push(b'\n');
    file::replace(&path, &json)?;
    let path = dir.join("pareto.csv");
    let mut writer = csv::Writer::from_writer(Vec::new());
    for point in points {
        writer
            .serialize(point)
            .map_err(|error| failed(&path, error.into()))?;
    }
    let bytes = writer
        .into_inner()
        .map_err(|error| failed(&path, error.into_error()))?;
    file::replace(&path, &bytes)?;
    plot::write_front(dir, title, &format!("held-out error, {metric}"), points)?;
    Ok(())
}

fn describe(title: &str, dir: &Path, points: &[CostPoint]) -> String {
    let mut text = format!("{title}\n{} models; on the front:\n", points.len());
    let longest = points.iter().map(|point| point.model.len()).max();
    let width = longest.unwrap_or(0).max(5);
    text.push_str(&format!(
        "{:width$}  {:>10}  {:>14}  {:>8}  {:>7}\n",
        "model", "error", "ns/evaluation", "fit in s", "floats"
    ));
    for point in points.iter().filter(|point| point.on_front) {
        text.push_str(&line(point, width));
    }
    if let Some(published) = points.iter().find(|point| point.model == NBRDF) {
        if !published.on_front {
            text.push_str("not on it:\n");
            text.push_str(&line(published, width));
        }
        match pareto::cheapest_as_exact(points, NBRDF) {
            Some((fastest, share)) => text.push_str(&format!(
                "as exact as NBRDF or more, the fastest: {}, {share:.2} of its time, {:.2} of its \
                 error\n",
                fastest.model,
                fastest.error / published.error
            )),
            None => text.push_str("no model is as exact as NBRDF\n"),
        }
    }
    text.push_str(&format!(
        "written to {}: pareto.csv, .json, .svg, .png\n",
        dir.display()
    ));
    text
}

fn line(point: &CostPoint, width: usize) -> String {
    format!(
        "{:width$}  {:>10.3e}  {:>14.2}  {:>8.4}  {:>7}\n",
        point.model, point.error, point.nanoseconds_per_evaluation, point.fit_seconds, point.floats
    )
}
