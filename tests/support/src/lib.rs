//! Finds what tests need from outside the project: real measurements and programs.
//!
//! A test that needs either carries `#[ignore = "needs ..."]`, so that `cargo test` lists it as
//! ignored instead of passing it without running; `cargo xtask test --data --browser` runs them.
//! Every function here returns `None` when nothing is found, and then prints `skipped: ...`
//! straight to standard error, which the test harness does not capture.

use std::io::Write;
use std::path::{Path, PathBuf};

/// The environment variable that names the folder of real measurements.
pub const VARIABLE: &str = "ELM_BRDF_DATA";

/// Prints `skipped: TEST needs WHAT`, past the test harness's capture.
pub fn skip(what: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    // Nothing can be done about a closed standard error.
    let _ = writeln!(std::io::stderr(), "skipped: {test} needs {what}");
}

/// Folders that may hold the data: the one that [`VARIABLE`] names and the one around it (so that
/// the variable may name the CUReT folder itself), or `shared` beside the project.
fn roots() -> Vec<PathBuf> {
    match std::env::var_os(VARIABLE).map(PathBuf::from) {
        Some(named) => {
            let around = named.parent().map(Path::to_path_buf);
            [named].into_iter().chain(around).collect()
        }
        None => vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared")],
    }
}

/// The folder of CUReT's files: `table.txt` and at least `abrdf.dat`.
#[must_use]
pub fn curet() -> Option<PathBuf> {
    let found = roots()
        .into_iter()
        .flat_map(|root| [root.join("curet"), root])
        .find(|dir| dir.join("table.txt").is_file() && dir.join("abrdf.dat").is_file());
    if found.is_none() {
        skip("CUReT's files, in ELM_BRDF_DATA or ../shared/curet");
    }
    found
}

/// A folder of the shared data by name: `rgl` or `nbrdf`.
#[must_use]
pub fn folder(name: &str) -> Option<PathBuf> {
    let mut folders = roots().into_iter().map(|root| root.join(name));
    let found = folders.find(|dir| dir.is_dir());
    if found.is_none() {
        skip(&format!(
            "the folder '{name}', in ELM_BRDF_DATA or ../shared"
        ));
    }
    found
}

/// A program in PATH.
#[must_use]
pub fn program(name: &str) -> Option<PathBuf> {
    let found = in_path(name);
    if found.is_none() {
        skip(name);
    }
    found
}

/// A Chromium in PATH, under any of its names.
#[must_use]
pub fn chromium() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = names.into_iter().find_map(in_path);
    if found.is_none() {
        skip("Chromium");
    }
    found
}

fn in_path(name: &str) -> Option<PathBuf> {
    std::env::split_paths(&std::env::var_os("PATH")?)
        .map(|dir| dir.join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
        .find(|path| path.is_file())
}

/// A Python with Mitsuba 3: the one that `ELM_BRDF_MITSUBA` names, or `python3`.
#[must_use]
pub fn mitsuba() -> Option<PathBuf> {
    let named = std::env::var_os("ELM_BRDF_MITSUBA").map(PathBuf::from);
    let python = named.unwrap_or_else(|| PathBuf::from("python3"));
    let mut program = std::process::Command::new(&python);
    program.args([
        "-c",
        "import numpy, mitsuba; mitsuba.set_variant('llvm_ad_rgb'); print(mitsuba.Float(0) + 1)",
    ]);
    let runs = program.output().is_ok_and(|found| found.status.success());
    if !runs {
        skip("a Python with Mitsuba 3 and LLVM, in ELM_BRDF_MITSUBA");
    }
    runs.then_some(python)
}
