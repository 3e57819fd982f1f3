//! What must hold before a commit (`check`) and before a change lands (`all`).

use std::time::Instant;

use crate::Result;
use crate::package::Packaging;
use crate::python::python;
use crate::run::{command, linted, root, run, say, test};
use crate::tiers::{Tiers, has_data};

/// Formatting, clippy and unit tests.
pub(crate) fn check() -> Result {
    run(command("cargo fmt --all --check"))?;
    run(command(
        "cargo clippy --workspace --all-targets --locked -- -D warnings",
    ))?;
    let counts = test(command("cargo test --workspace --lib --bins --locked"))?;
    say(&format!("{} unit tests passed", counts.passed));
    Ok(())
}

/// Runs a tool that a machine may lack, and says so if it does.
fn run_if_installed(program: &str, line: &str) -> Result {
    let version = command(&format!("{program} --version")).output();
    if version.is_ok_and(|output| output.status.success()) {
        run(command(line))
    } else {
        say(&format!("skipped: {program} is not installed"));
        Ok(())
    }
}

/// Spelling, what dependencies may be and whether all are used, combinations of features, and the
/// oldest compiler.
fn tools() -> Result {
    run_if_installed("typos", "typos")?;
    run_if_installed("cargo-deny", "cargo-deny check bans licenses sources")?;
    run_if_installed("cargo-machete", "cargo-machete")?;
    for features in [
        "-p elm-learn --features onnx",
        "-p elm-learn --no-default-features --features faer",
        "-p elm-brdf --no-default-features --features faer",
    ] {
        run(command(&format!(
            "cargo clippy {features} --locked -- -D warnings"
        )))?;
    }
    let oldest = env!("CARGO_PKG_RUST_VERSION");
    let toolchain = format!("rustup run {oldest}.0 cargo");
    run_if_installed(
        &toolchain,
        &format!("{toolchain} check -p elm-brdf --locked --target-dir target/oldest"),
    )
}

/// Everything: all tests that can run here, documentation, both linear algebra back ends, fuzz
/// targets, packages, and the README's first command.
pub(crate) fn all() -> Result {
    let start = Instant::now();
    let step = |title: &str| say(&format!("\n== {title} ({} s)", start.elapsed().as_secs()));
    let has_data = has_data();

    step("formatting");
    for workspace in ["", "elm-datafusion", "elm-python", "fuzz"] {
        let mut format = command("cargo fmt --all --check");
        format.current_dir(root().join(workspace));
        run(format)?;
    }

    // Before the tests, which take most of the time: these are what is forgotten most easily.
    step("rules for text and for imports; from here on clippy's warnings are errors");
    run(linted(command(
        "cargo test --workspace --test style --test imports --locked",
    )))?;

    step("tests, as the README runs them, and those that need something from outside");
    let tiers = if has_data {
        Tiers::everything()
    } else {
        say("skipped: tests on real measurements");
        Tiers::without_data()
    };
    tiers.linted().run()?;
    // Benchmarks are no tests, and are built by none of the above.
    run(linted(command(
        "cargo test --workspace --benches --no-run --locked",
    )))?;
    // Not among the default features; without data one of them says 'skipped'. Of the whole workspace, so
    // that dependencies have the features of the builds above and are not built again.
    run(linted(command(
        "cargo test --workspace --features elm-brdf/fetch --test all --locked \
         -- --include-ignored fetch:: help::",
    )))?;

    step("documentation, warnings are errors");
    let mut doc = command("cargo doc --workspace --no-deps --locked");
    doc.env("RUSTDOCFLAGS", "-D warnings");
    run(doc)?;

    step("the OpenBLAS back end");
    for line in [
        "cargo clippy -p elm-learn --all-targets --no-default-features \
         --features openblas-system,persist --locked -- -D warnings",
        "cargo test -p elm-learn --no-default-features --features openblas-system,persist --locked",
        "cargo test -p elm-tests --no-default-features --features openblas-system --locked \
         --test closed_form --test paper --test stability",
    ] {
        run(command(line))?;
    }

    step("the fuzz targets, three seconds each");
    // Optimized for few inputs, not for billions.
    let mut fuzz = linted(command("fuzz/run -s 3"));
    fuzz.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "1");
    run(fuzz)?;

    step("spelling, dependencies, features, the oldest compiler");
    tools()?;

    step("the Python package: wheel, fresh environment, tests");
    python()?;

    step("SQL: the package elm-datafusion");
    let mut own = linted(command("cargo test --locked"));
    own.current_dir(root().join("elm-datafusion"));
    run(own)?;

    step("packages");
    Packaging::contents().run()?;

    step("the README's command, on synthetic data and on real measurements where they are");
    run(command(
        "cargo run --release --locked -p elm-brdf -- reproduce",
    ))?;
    match elm_test_support::curet() {
        Some(dir) => {
            let mut reproduce = command("cargo run --release --locked -p elm-brdf -- reproduce");
            reproduce.arg("--data").arg(dir);
            run(reproduce)?;
        }
        None => say("skipped: the README's command on real measurements"),
    }

    step("done");
    Ok(())
}
