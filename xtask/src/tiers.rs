//! Tests by what they need from outside the project, which each names in its `#[ignore]`.

use std::fs;
use std::path::Path;
use std::process::Command;

use clap::Args;

use crate::Result;
use crate::run::{Counts, command, linted, root, say, test};

/// Which tests to run.
#[derive(Args, Clone, Copy)]
pub(crate) struct Tiers {
    /// Also the tests on real measurements, in ELM_BRDF_DATA or ../shared; fails without them.
    #[arg(long)]
    data: bool,
    /// Also the tests that need Chromium, glslangValidator, a C compiler or Mitsuba; fails without them.
    #[arg(long)]
    browser: bool,
    /// Only the tests that the other options add.
    #[arg(long)]
    only: bool,
    /// Built by clippy, warnings as errors.
    #[arg(skip)]
    linted: bool,
}

/// A test that runs only when it is asked for.
#[derive(Debug, PartialEq, Eq)]
struct Ignored {
    name: String,
    reason: String,
}

impl Tiers {
    pub(crate) fn everything() -> Self {
        Self {
            data: true,
            browser: true,
            only: false,
            linted: false,
        }
    }

    pub(crate) fn without_data() -> Self {
        Self {
            data: false,
            ..Self::everything()
        }
    }

    pub(crate) fn linted(mut self) -> Self {
        self.linted = true;
        self
    }

    fn cargo(self, line: &str) -> Command {
        if self.linted {
            linted(command(line))
        } else {
            command(line)
        }
    }

    pub(crate) fn run(self) -> Result {
        if self.data && !has_data() {
            return Err("no real measurements in ELM_BRDF_DATA or ../shared".to_owned());
        }
        let mut counts = Vec::new();
        if !self.only {
            counts.push(("without anything from outside", self.plain()?));
        }
        let ignored = ignored(&root())?;
        for (asked, title, prefix) in [
            (self.data, "on real measurements", "needs data"),
            (self.browser, "with other programs", "needs "),
        ] {
            let names: Vec<&str> = ignored
                .iter()
                .filter(|test| test.reason.starts_with(prefix))
                .filter(|test| prefix == "needs data" || !test.reason.starts_with("needs data"))
                .map(|test| test.name.as_str())
                .collect();
            if asked {
                counts.push((title, self.only(&names)?));
            }
        }
        for (title, counts) in counts {
            say(&format!("{} tests passed {title}", counts.passed));
        }
        Ok(())
    }

    fn plain(self) -> Result<Counts> {
        let counts = test(self.cargo("cargo test --workspace --locked"))?;
        let asked = if self.data && self.browser {
            "run below"
        } else {
            "not run, or run below"
        };
        say(&format!(
            "{} passed, {} ignored ({asked})",
            counts.passed, counts.ignored
        ));
        Ok(counts)
    }

    /// Runs ignored tests of these names, and fails unless every one of them ran to its end.
    fn only(self, names: &[&str]) -> Result<Counts> {
        let mut cargo =
            self.cargo("cargo test --workspace --locked --lib --bins --tests -- --ignored");
        cargo.args(names);
        let counts = test(cargo)?;
        if let Some(first) = counts.skipped.first() {
            return Err(format!(
                "{} tests did not run: {first}",
                counts.skipped.len()
            ));
        }
        if counts.passed != names.len() {
            return Err(format!("{} tests ran of {}", counts.passed, names.len()));
        }
        Ok(counts)
    }
}

/// Whether all folders that tests look for are there; says which is not.
pub(crate) fn has_data() -> bool {
    let curet = elm_test_support::curet();
    let folders = ["rgl", "nbrdf"].map(elm_test_support::folder);
    curet.is_some() && folders.iter().all(Option::is_some)
}

/// The tests with `#[ignore = "..."]` in all packages, by their functions' names. A reason that does not
/// begin with 'needs' keeps a test out of the tiers: one that is built only with a feature that is not a
/// default.
fn ignored(dir: &Path) -> Result<Vec<Ignored>> {
    let mut found = Vec::new();
    let error = |error: std::io::Error| format!("{}: {error}", dir.display());
    for entry in fs::read_dir(dir).map_err(error)? {
        let path = entry.map_err(error)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() && name != "target" && name != "xtask" && !name.starts_with('.') {
            found.extend(ignored(&path)?);
        } else if name.ends_with(".rs") {
            found.extend(ignored_in(&fs::read_to_string(&path).map_err(error)?));
        }
    }
    Ok(found)
}

fn ignored_in(text: &str) -> Vec<Ignored> {
    let mut found = Vec::new();
    let mut reason = None;
    for line in text.lines().map(str::trim) {
        if let Some(rest) = line.strip_prefix("#[ignore = \"") {
            reason = rest.strip_suffix("\"]").map(str::to_owned);
        } else if let Some(rest) = line.strip_prefix("fn ")
            && let Some(reason) = reason.take()
        {
            let name = rest.split('(').next().unwrap_or_default().to_owned();
            found.push(Ignored { name, reason });
        }
    }
    found
}

#[test]
fn ignored_tests_are_found_with_their_reasons() {
    let text =
        "#[test]\n#[ignore = \"needs data: rgl\"]\n#[allow(x)]\nfn a() {}\n#[test]\nfn b() {}\n";
    let (name, reason) = ("a".to_owned(), "needs data: rgl".to_owned());
    assert_eq!(ignored_in(text), [Ignored { name, reason }]);
}
