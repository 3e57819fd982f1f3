//! What scikit-learn makes of the tables, remembered from one run to the next.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::data::Split;
use crate::peers::Worker;

const SCRIPT: &str = include_str!("../../peers/tables.py");

/// Whose figures stand beside ours.
pub const METHODS: [&str; 4] = ["linear", "HistGB", "MLP", "KRR"];

/// A method on a split of a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// The table.
    pub table: String,
    /// The number of the split.
    pub split: u64,
    /// The method.
    pub method: String,
    /// Test RMSE over the deviation of the test targets.
    pub rmse: f64,
    /// Processor seconds of choosing and fitting.
    pub seconds: f64,
}

/// Figures that are known, and who finds the others.
pub struct Peers {
    known: Vec<Figure>,
    cache: Option<PathBuf>,
    worker: Option<Worker>,
    python: Option<PathBuf>,
}

impl Peers {
    /// `cache` is a file of figures, one JSON object a line, read here and added to; without a Python only
    /// these are known.
    ///
    /// # Errors
    /// A line that is no figure.
    pub fn new(cache: Option<PathBuf>, python: Option<PathBuf>) -> Result<Self, String> {
        let mut known = Vec::new();
        if let Some(path) = &cache
            && let Ok(text) = fs::read_to_string(path)
        {
            for line in text.lines() {
                let figure = serde_json::from_str(line);
                known.push(figure.map_err(|error| format!("{}: {error}", path.display()))?);
            }
        }
        Ok(Self {
            known,
            cache,
            worker: None,
            python,
        })
    }

    /// The figure of a method, known or found; nothing where it is neither.
    ///
    /// # Errors
    /// What the worker says went wrong.
    pub fn figure(
        &mut self,
        table: &str,
        number: u64,
        method: &str,
        split: &Split,
    ) -> Result<Option<Figure>, String> {
        let same = |f: &&Figure| f.table == table && f.split == number && f.method == method;
        if let Some(known) = self.known.iter().find(same) {
            return Ok(Some(known.clone()));
        }
        let Some(python) = &self.python else {
            return Ok(None);
        };
        let worker = match &mut self.worker {
            Some(worker) => worker,
            none => none.insert(Worker::of_script(python, SCRIPT)?),
        };
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let (train, test) = (folder.path().join("train"), folder.path().join("test"));
        write(&train, split.train.iter())?;
        write(&test, split.test.iter())?;
        let answer = worker.ask(json!({
            "do": "fit",
            "method": method,
            "train": train,
            "test": test,
            "columns": split.train.ncols(),
            "seed": number,
        }))?;
        let value = |key: &str| {
            let value = answer[key].as_f64();
            value.ok_or_else(|| format!("the Python worker gave no {key}"))
        };
        let figure = Figure {
            table: table.to_owned(),
            split: number,
            method: method.to_owned(),
            rmse: value("rmse")? / split.judged().1.std(0.0),
            seconds: value("seconds")?,
        };
        self.remember(&figure)?;
        self.known.push(figure.clone());
        Ok(Some(figure))
    }

    fn remember(&self, figure: &Figure) -> Result<(), String> {
        let Some(path) = &self.cache else {
            return Ok(());
        };
        let at = |error: std::io::Error| format!("{}: {error}", path.display());
        let line = serde_json::to_string(figure).map_err(|error| error.to_string())?;
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(path)
            .map_err(at)?;
        writeln!(file, "{line}").map_err(at)
    }
}

fn write<'a>(path: &Path, values: impl Iterator<Item = &'a f64>) -> Result<(), String> {
    let bytes: Vec<u8> = values.flat_map(|value| value.to_ne_bytes()).collect();
    fs::write(path, bytes).map_err(|error| format!("{}: {error}", path.display()))
}
