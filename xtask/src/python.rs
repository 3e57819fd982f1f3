//! The Python package: its wheel, built without warnings and installed away from the checkout, and its tests.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::Result;
use crate::run::{command, root, run, say};

/// Where all of it lies.
const FOLDER: &str = "target/python";

/// Builds the wheel, installs it, and runs the tests against it; says so where Python is missing.
pub(crate) fn python() -> Result {
    let folder = root().join(FOLDER);
    for old in ["tools", "installed", "wheels", "tests"] {
        let old = folder.join(old);
        if old.exists() {
            fs::remove_dir_all(&old).map_err(|error| at(&old, &error))?;
        }
    }
    fs::create_dir_all(&folder).map_err(|error| at(&folder, &error))?;
    let fresh = command(&format!("python3 -m venv {FOLDER}/tools")).output();
    if !fresh.is_ok_and(|output| output.status.success()) {
        say("skipped: the Python package, as python3 with venv is not installed");
        return Ok(());
    }
    let install = format!("{FOLDER}/tools/bin/pip install --quiet maturin");
    if run(command(&install)).is_err() {
        say("skipped: the Python package, as maturin cannot be installed");
        return Ok(());
    }
    // In the workspace's own target folder, for the dependencies that both have.
    let mut wheel = command(&format!(
        "{FOLDER}/tools/bin/maturin build --release --locked --manifest-path elm-python/Cargo.toml \
         --target-dir target --out {FOLDER}/wheels -- -D warnings"
    ));
    // Warnings of this package alone: flags for all would build shared dependencies again.
    wheel.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver");
    run(wheel)?;

    run(command(&format!("python3 -m venv {FOLDER}/installed")))?;
    let mut install = command(&format!(
        "{FOLDER}/installed/bin/pip install --quiet pytest joblib pandas polars onnxruntime pyarrow pyspark \
         dask[distributed]"
    ));
    install.args(files(&folder.join("wheels"), "whl")?);
    run(install)?;
    let tests = folder.join("tests");
    fs::create_dir_all(&tests).map_err(|error| at(&tests, &error))?;
    for from in ["elm-python/tests", "elm-python/examples"] {
        for file in files(&root().join(from), "py")? {
            let to = tests.join(file.file_name().unwrap_or_default());
            fs::copy(&file, to).map_err(|error| at(&file, &error))?;
        }
    }
    // Isolated: neither the working directory nor the environment adds to the path.
    run(command(&format!(
        "{FOLDER}/installed/bin/python -I -m pytest -q -p no:cacheprovider --import-mode=importlib \
         {FOLDER}/tests"
    )))
}

/// The files of a folder with this extension.
fn files(folder: &Path, extension: &str) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|error| at(folder, &error))?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let all: Vec<PathBuf> = paths
        .collect::<io::Result<_>>()
        .map_err(|error| at(folder, &error))?;
    let wanted = |path: &PathBuf| path.extension().is_some_and(|found| found == extension);
    Ok(all.into_iter().filter(wanted).collect())
}

fn at(path: &Path, error: &io::Error) -> String {
    format!("{}: {error}", path.display())
}
