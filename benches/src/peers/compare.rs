//! The comparison: ours, theirs, ours, theirs; the median of the ratios.

use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

use super::data::{Problem, Size};
use super::environment::Environment;
use super::report::{Record, Task};
use super::rivals::{CrateElm, Ours, Rival, Setting};
use super::sweep;
use super::worker::Worker;
use crate::timing::{median, processor_seconds_per_call};

/// What to compare.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The sizes.
    pub sizes: Vec<Size>,
    /// The peers.
    pub rivals: Vec<Rival>,
    /// Seconds for the pairs of one comparison; it has three pairs at least, but where a fit takes
    /// longer than this, one.
    pub seconds: f64,
}

/// The most pairs of one comparison.
const PAIRS: usize = 31;
/// Processor time of a single timing: many calls of what is shorter.
const LEAST: f64 = 0.02;
/// Of the networks of one size: weights of this scale, and this regularisation. The peers are given
/// the same random layer and the same absolute regularisation where they take one.
const SCALE: f64 = 0.4;
const LAMBDA: f64 = 1e-6;

/// Runs the plan. `progress` is told what comes next.
///
/// # Errors
/// What went wrong, as text: a peer that fails, or the Python process.
pub fn compare(
    plan: &Plan,
    environment: &Environment,
    mut progress: impl FnMut(&str),
) -> Result<(Vec<Record>, String), String> {
    let mut worker = Worker::start(&environment.python)?;
    let about = worker.about()?;
    let left_out = |rival: &Rival| {
        let name = rival.name();
        environment
            .left_out
            .iter()
            .any(|package| package.starts_with(name))
    };
    let rivals: Vec<Rival> = plan
        .rivals
        .iter()
        .filter(|r| !left_out(r))
        .copied()
        .collect();
    let mut records = Vec::new();
    for &size in &plan.sizes {
        let problem = Problem::new(size);
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let layer = of_size(size).fit(&problem.x, &problem.t)?;
        let written = problem.write(folder.path(), layer.hidden());
        written.map_err(|error| error.to_string())?;
        worker.load(folder.path(), size, &problem)?;
        let mut comparison = OfSize {
            size,
            lists: CrateElm::new(&problem),
            problem,
            worker: &mut worker,
            seconds: plan.seconds,
            python: environment.python.clone(),
            folder: folder.path().to_owned(),
        };
        for &rival in rivals.iter().filter(|rival| rival.can_fit(size)) {
            progress(&format!("{}: {}", size.name, rival.name()));
            comparison.same_size(rival, &mut records)?;
        }
        progress(&format!("{}: f32", size.name));
        records.push(comparison.single_precision()?);
        for &rival in rivals.iter().filter(|rival| rival.is_elm()) {
            progress(&format!(
                "{}: time to the error of {}",
                size.name,
                rival.name()
            ));
            records.extend(comparison.time_to_error(rival)?);
        }
    }
    Ok((records, about))
}

/// Our network of this size.
fn of_size(size: Size) -> Ours {
    Ours {
        neurons: size.neurons,
        scale: SCALE,
        lambda: LAMBDA,
        seed: 1,
    }
}

struct OfSize<'a> {
    size: Size,
    problem: Problem,
    lists: CrateElm,
    worker: &'a mut Worker,
    seconds: f64,
    python: PathBuf,
    folder: PathBuf,
}

impl OfSize<'_> {
    fn record(&self, rival: &str, task: Task, ratios: Vec<f64>, errors: (f64, f64)) -> Record {
        Record {
            size: self.size.name,
            peer: rival.to_owned(),
            task,
            ours_over_peer: median(ratios).unwrap_or(0.0),
            rmse_ours: errors.0,
            rmse_peer: errors.1,
            peak_memory_ours_over_peer: None,
        }
    }

    /// Ratios of pairs, ours first in every second one.
    fn pairs(
        &mut self,
        mut ours: impl FnMut(&mut Self) -> Result<f64, String>,
        mut theirs: impl FnMut(&mut Self) -> Result<f64, String>,
    ) -> Result<Vec<f64>, String> {
        let start = Instant::now();
        let mut ratios = Vec::new();
        loop {
            let (a, b) = if ratios.len() % 2 == 0 {
                let a = ours(self)?;
                (a, theirs(self)?)
            } else {
                let b = theirs(self)?;
                (ours(self)?, b)
            };
            ratios.push(a / b);
            let passed = start.elapsed().as_secs_f64();
            let enough =
                passed > self.seconds && (ratios.len() >= 3 || passed > 3.0 * self.seconds);
            if ratios.len() >= PAIRS || enough {
                return Ok(ratios);
            }
        }
    }

    /// The same network size, the same weight distribution, the same regularisation.
    fn same_size(&mut self, rival: Rival, records: &mut Vec<Record>) -> Result<(), String> {
        let ours = of_size(self.size);
        let (model, our_error) = ours.score(&self.problem)?;
        let alpha = LAMBDA * model.diagnosis().largest_singular_value.powi(2);
        let setting = Setting {
            rival,
            neurons: self.size.neurons,
            our_layer: true,
            alpha,
            seed: 1,
        };
        let mut their_error = f64::NAN;
        let fits = self.pairs(
            |this| time_ours(&ours, &this.problem),
            |this| {
                let (seconds, error) = this.time_theirs(&setting)?;
                their_error = error;
                Ok(seconds)
            },
        )?;
        let errors = (our_error, their_error);
        let mut fit = self.record(rival.name(), Task::Fit, fits, errors);
        fit.peak_memory_ours_over_peer = self.memory(&setting)?;
        records.push(fit);

        let of_crate = (rival == Rival::CrateElm).then(|| self.lists.fit(self.size.neurons));
        let predictor = model.predictor();
        let mut scratch = predictor.scratch();
        for one in [false, true] {
            let task = if one {
                Task::PredictOne
            } else {
                Task::PredictBatch
            };
            let rows = if one { 1 } else { self.problem.test_x.nrows() };
            let x = self
                .problem
                .test_x
                .slice(ndarray::s![..rows, ..])
                .to_owned();
            let mut y = ndarray::Array2::zeros((rows, self.size.outputs));
            let ratios = self.pairs(
                |_| {
                    Ok(processor_seconds_per_call(LEAST, || {
                        let x = std::hint::black_box(&x);
                        let _ = predictor.predict_into(x, &mut y, &mut scratch);
                    }))
                },
                |this| match &of_crate {
                    Some(model) => Ok(processor_seconds_per_call(LEAST, || {
                        std::hint::black_box(this.lists.predict(model, rows));
                    })),
                    None => this.worker.predict(one, LEAST),
                },
            )?;
            records.push(self.record(rival.name(), task, ratios, errors));
        }
        Ok(())
    }

    /// Prediction in f64 over the same in f32: how many times faster that is.
    fn single_precision(&mut self) -> Result<Record, String> {
        let ours = of_size(self.size);
        let single = Ours {
            // The weakest that f32 solves fast.
            lambda: 2e-4,
            ..ours
        };
        let narrow = |a: &ndarray::Array2<f64>| a.mapv(|v| v as f32);
        let (model, error) = ours.score(&self.problem)?;
        let (x, t) = (narrow(&self.problem.x), narrow(&self.problem.t));
        let single = single.fit(&x, &t)?;
        let (test, test_single) = (self.problem.test_x.clone(), narrow(&self.problem.test_x));
        let predicted = single.predict(&test_single).map_err(|e| e.to_string())?;
        let single_error = super::rivals::rmse(&predicted.mapv(f64::from), &self.problem.test_t);
        let (double, single) = (model.predictor(), single.predictor());
        let (mut scratch, mut scratch_single) = (double.scratch(), single.scratch());
        let mut y = ndarray::Array2::zeros((test.nrows(), self.size.outputs));
        let mut y_single = ndarray::Array2::zeros(y.dim());
        let ratios = self.pairs(
            |_| {
                Ok(processor_seconds_per_call(LEAST, || {
                    let _ = double.predict_into(&test, &mut y, &mut scratch);
                }))
            },
            |_| {
                Ok(processor_seconds_per_call(LEAST, || {
                    let _ = single.predict_into(&test_single, &mut y_single, &mut scratch_single);
                }))
            },
        )?;
        let errors = (error, single_error);
        Ok(self.record("ours in f32", Task::PredictBatch, ratios, errors))
    }

    fn time_to_error(&mut self, rival: Rival) -> Result<Option<Record>, String> {
        let best = sweep::best_of(rival, self.size, self.worker, &self.lists)?;
        let Some((ours, error)) = sweep::cheapest(best.rmse, self.size, &self.problem)? else {
            // Not reached: said as such.
            let never = vec![f64::INFINITY];
            let record = self.record(
                rival.name(),
                Task::TimeToError,
                never,
                (f64::NAN, best.rmse),
            );
            return Ok(Some(record));
        };
        let ratios = self.pairs(
            |this| time_ours(&ours, &this.problem),
            |this| Ok(this.time_theirs(&best.setting)?.0),
        )?;
        let errors = (error, best.rmse);
        Ok(Some(self.record(
            rival.name(),
            Task::TimeToError,
            ratios,
            errors,
        )))
    }

    fn time_theirs(&mut self, setting: &Setting) -> Result<(f64, f64), String> {
        if setting.rival != Rival::CrateElm {
            return self.worker.fit(setting, LEAST);
        }
        let mut model = None;
        let seconds = processor_seconds_per_call(LEAST, || {
            model = Some(self.lists.fit(setting.neurons));
        });
        let error = model.map_or(f64::NAN, |model| self.lists.error(&model));
        Ok((seconds, error))
    }

    /// Peak memory of one fit, ours over theirs, each in a process of its own.
    fn memory(&self, setting: &Setting) -> Result<Option<f64>, String> {
        let ours = child_memory(self.size, false)?;
        let theirs = if setting.rival == Rival::CrateElm {
            child_memory(self.size, true)?
        } else {
            let mut worker = Worker::start(&self.python)?;
            worker.load(&self.folder, self.size, &self.problem)?;
            worker.memory(setting)?
        };
        let usable = |bytes: &f64| *bytes > 0.0;
        Ok(ours
            .zip(theirs.filter(usable))
            .map(|(ours, theirs)| ours / theirs))
    }
}

fn time_ours(ours: &Ours, problem: &Problem) -> Result<f64, String> {
    let mut failure = None;
    let seconds = processor_seconds_per_call(LEAST, || match ours.fit(&problem.x, &problem.t) {
        Ok(model) => drop(std::hint::black_box(model)),
        Err(error) => failure = Some(error),
    });
    failure.map_or(Ok(seconds), Err)
}

/// This program again, for one fit: [`fit_once`](super::fit_once).
fn child_memory(size: Size, of_crate: bool) -> Result<Option<f64>, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let done = Command::new(program)
        .args(["--sizes", size.name, "--memory-of"])
        .arg(if of_crate { "crate" } else { "ours" })
        .args([
            "--scale",
            &SCALE.to_string(),
            "--lambda",
            &LAMBDA.to_string(),
        ])
        .output()
        .map_err(|error| error.to_string())?;
    Ok(String::from_utf8_lossy(&done.stdout).trim().parse().ok())
}
