//! The Python process that runs the peers.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};

use super::Size;
use super::data::Problem;
use super::rivals::Setting;
use crate::timing;

const SCRIPT: &str = include_str!("../../peers/worker.py");

/// A running Python script that answers requests; it ends when this is dropped.
pub struct Worker {
    child: Child,
    requests: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Worker {
    pub(super) fn start(python: &Path) -> Result<Self, String> {
        Self::of_script(python, SCRIPT)
    }

    /// Starts a script, on as many threads as ours have.
    ///
    /// # Errors
    /// Where the interpreter does not start.
    pub fn of_script(python: &Path, script: &str) -> Result<Self, String> {
        let mut command = Command::new(python);
        command.args(["-c", script]);
        for variable in [
            "OMP_NUM_THREADS",
            "OPENBLAS_NUM_THREADS",
            "MKL_NUM_THREADS",
            "NUMEXPR_NUM_THREADS",
            "VECLIB_MAXIMUM_THREADS",
        ] {
            command.env(variable, timing::threads().to_string());
        }
        // Whatever the surroundings chose for some other build, numpy's OpenBLAS chooses itself.
        command.env_remove("OPENBLAS_CORETYPE");
        command.env_remove("OPENBLAS_L2_SIZE");
        let started = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = started.map_err(|error| format!("{}: {error}", python.display()))?;
        let (Some(requests), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err("the worker has no pipes".to_owned());
        };
        Ok(Self {
            child,
            requests: Some(requests),
            answers: BufReader::new(answers),
        })
    }

    pub(super) fn load(
        &mut self,
        folder: &Path,
        size: Size,
        problem: &Problem,
    ) -> Result<(), String> {
        self.ask(json!({
            "do": "load",
            "folder": folder,
            "rows": size.rows,
            "test_rows": problem.test_x.nrows(),
            "inputs": size.inputs,
            "outputs": size.outputs,
            "neurons": size.neurons,
        }))?;
        Ok(())
    }

    /// Fits: (seconds, test error).
    pub(super) fn fit(&mut self, setting: &Setting, least: f64) -> Result<(f64, f64), String> {
        let answer = self.ask(request("fit", setting, least))?;
        Ok((number(&answer, "seconds")?, number(&answer, "rmse")?))
    }

    /// Predicts with what was fitted last, a batch or one row: seconds.
    pub(super) fn predict(&mut self, one: bool, least: f64) -> Result<f64, String> {
        let what = if one { "predict_one" } else { "predict_batch" };
        let answer = self.ask(json!({"do": what, "least_seconds": least}))?;
        number(&answer, "seconds")
    }

    /// Bytes that a fit needs at its peak, where the system can say.
    pub(super) fn memory(&mut self, setting: &Setting) -> Result<Option<f64>, String> {
        let answer = self.ask(request("memory", setting, 0.0))?;
        Ok(answer["bytes"].as_f64())
    }

    pub(super) fn about(&mut self) -> Result<String, String> {
        let answer = self.ask(json!({"do": "about"}))?;
        Ok(answer["text"].as_str().unwrap_or_default().to_owned())
    }

    /// One request and its answer.
    ///
    /// # Errors
    /// What the script says went wrong, or that it has ended.
    pub fn ask(&mut self, request: Value) -> Result<Value, String> {
        let gone = |error: std::io::Error| format!("the Python worker is gone: {error}");
        if let Some(requests) = &mut self.requests {
            writeln!(requests, "{request}").map_err(gone)?;
            requests.flush().map_err(gone)?;
        }
        let mut line = String::new();
        self.answers.read_line(&mut line).map_err(gone)?;
        let answer: Value = serde_json::from_str(&line)
            .map_err(|_| "the Python worker ended without an answer".to_owned())?;
        match answer["error"].as_str() {
            Some(error) => Err(error.to_owned()),
            None => Ok(answer),
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // Without input it ends by itself.
        self.requests = None;
        let _ = self.child.wait();
    }
}

fn request(what: &str, setting: &Setting, least: f64) -> Value {
    json!({
        "do": what,
        "peer": setting.rival.name(),
        "neurons": setting.neurons,
        "our_layer": setting.our_layer,
        "alpha": setting.alpha,
        "seed": setting.seed,
        "least_seconds": least,
    })
}

fn number(answer: &Value, key: &str) -> Result<f64, String> {
    answer[key]
        .as_f64()
        .ok_or_else(|| format!("the Python worker gave no {key}"))
}
