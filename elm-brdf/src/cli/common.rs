//! Arguments and helpers that several commands share.

use std::fmt::Display;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use indicatif::{ProgressBar, ProgressStyle};

use super::data::{self, Source};
use super::{Failure, say};
use crate::error::Error;
use crate::scene_materials::SceneMaterialLoader;

/// Where CUReT's files are.
#[derive(Debug, Args)]
pub(super) struct DataFolder {
    /// Folder of CUReT files: table.txt with abrdf.dat, or with rbrdf.dat, gbrdf.dat and
    /// bbrdf.dat.
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
}

/// How models are cross-validated.
#[derive(Debug, Args)]
pub(super) struct Protocol {
    /// Number of folds, at least 2.
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = 10
    )]
    pub(super) folds: usize,
    /// Seed of the folds and of random layers.
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = 1
    )]
    pub(super) seed: u64,
    /// Number of seeds, at least 1: figures are means over this one and those that follow.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) seeds: u16,
}

/// Reads one of `names`, and lists them in the help and in the error.
pub(super) fn one_of<T>(
    names: impl IntoIterator<Item = &'static str>,
) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err: std::error::Error + Send + Sync + 'static> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(names).try_map(|name| name.parse())
}

/// An error that what was typed is to blame for.
pub(super) fn usage(error: impl Display) -> Failure {
    Failure::Usage(error.to_string())
}

/// Where a scene's materials come from.
pub(super) fn library(named: Option<&Path>) -> Result<SceneMaterialLoader, Failure> {
    let curet = match Source::find(named)? {
        Source::Curet(dir) => Some(dir),
        Source::Synthetic => None,
    };
    Ok(SceneMaterialLoader::new(curet))
}

/// Tells whoever sits at a terminal how to get measurements in place of the synthetic data.
pub(super) fn hint(source: &Source) {
    if *source != Source::Synthetic || !io::stderr().is_terminal() {
        return;
    }
    let cache = data::cache().map_or_else(String::new, |dir| {
        format!(", or put them in {}", dir.display())
    });
    let fetch = if cfg!(feature = "fetch") {
        ", or fetch them with 'elm-brdf fetch curet'"
    } else {
        ""
    };
    say(&format!(
        "note: no CUReT files; name their folder with --data or {}{cache}{fetch}",
        data::VARIABLE
    ));
}

/// A bar on standard error that counts such things.
pub(super) fn progress(what: &str) -> ProgressBar {
    // indicatif draws on standard error, and not at all where that is no terminal.
    let bar = ProgressBar::new(0);
    let style =
        ProgressStyle::with_template(&format!("{{bar:40}} {what} {{pos}}/{{len}}, {{eta}} left"));
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

impl From<elm::Error> for Failure {
    fn from(error: elm::Error) -> Self {
        Self::Failed(Error::from(error))
    }
}
