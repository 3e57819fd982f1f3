//! `elm-brdf fetch`: measurements from the web into the user's cache.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};

use super::{Failure, data, print, say};
use crate::fetch::{self, CURET_PAGE, Changed, Error};

/// Fetch measurements from the web.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    data: Data,
}

#[derive(Debug, Subcommand)]
enum Data {
    Curet(Curet),
}

/// Fetch the CUReT database: the table of directions and four files of values.
///
/// The database is free for research; cite Dana, van Ginneken, Nayar, Koenderink, ACM Transactions
/// on Graphics 18(1), 1999. Its page is read for links to the files; they are checked, and put
/// where 'reproduce' looks for them.
#[derive(Debug, Args)]
struct Curet {
    /// Address of the page with the links.
    #[arg(long, value_name = "URL", default_value = CURET_PAGE)]
    from: String,
    /// Folder for the files; by default this program's folder in the user's cache.
    #[arg(long, value_name = "DIR")]
    to: Option<PathBuf>,
    /// Accept complete files whose checksums differ from those used for the published results.
    #[arg(long)]
    accept_changed: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Data::Curet(curet) = &arguments.data;
    let Some(dir) = curet.to.clone().or_else(data::cache) else {
        return Err(Failure::Usage(
            "there is no cache folder for this user: name a folder with --to".to_owned(),
        ));
    };
    let changed = if curet.accept_changed {
        Changed::Accept
    } else {
        Changed::Refuse
    };
    let bar = progress();
    let fetched = fetch::curet(&curet.from, &dir, changed, |progress| {
        bar.set_length(progress.all as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(format!("{}, {} kB", progress.file, progress.bytes / 1000));
    });
    bar.finish_and_clear();
    let fetched = fetched.map_err(|error| match error {
        Error::Address { .. } => Failure::Usage(format!("--from: {error}")),
        Error::Changed { .. } => Failure::Refused(format!(
            "{error}; nothing was written (--accept-changed takes it as it is)"
        )),
        other => Failure::Failed(other.into()),
    })?;
    let mut text = String::new();
    for file in &fetched {
        let sum = match file.as_known {
            Some(true) => ", the sum known",
            Some(false) => ", another sum than the one known",
            None => "",
        };
        text.push_str(&format!(
            "{:<9}  {:>6} bytes  sha256 {}{sum}\n",
            file.file, file.bytes, file.sha256
        ));
        if file.as_known == Some(false) {
            say(&format!("warning: {} has changed at its source", file.file));
        }
    }
    print(&format!("{text}written to {}\n", dir.display()))
}

fn progress() -> ProgressBar {
    // indicatif draws on standard error, and not at all where that is no terminal.
    let bar = ProgressBar::new(0);
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
