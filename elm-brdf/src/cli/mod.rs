//! The command line: what was typed, checked, carried out and printed. Nothing else in this crate
//! prints.

mod common;
mod compare;
mod data;
mod eval;
mod export;
#[cfg(feature = "fetch")]
mod fetch;
mod fit;
mod gallery;
mod info;
mod models;
mod overwrite;
mod pareto;
mod predict;
mod prior;
mod render;
mod reproduce;
mod samples;

use std::io::{self, Write};
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

use crate::error::Error;

/// Extreme learning machines for measured reflectance.
#[derive(Debug, Parser)]
#[command(name = "elm-brdf", version, about, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Threads; no digit of a result depends on them. 0: as many as the machine has.
    #[arg(
        long,
        global = true,
        value_name = "N",
        default_value_t = 0,
        display_order = 900
    )]
    threads: usize,
}

#[derive(Debug, Subcommand)]
enum Command {
    Reproduce(reproduce::Arguments),
    Compare(compare::Arguments),
    Pareto(pareto::Arguments),
    Fit(fit::Arguments),
    Eval(eval::Arguments),
    Predict(predict::Arguments),
    Info(info::Arguments),
    Prior(prior::Arguments),
    #[cfg(feature = "fetch")]
    Fetch(fetch::Arguments),
    Render(render::Arguments),
    Export(export::Arguments),
    Gallery(gallery::Arguments),
}

/// Why a command ended without doing its work.
#[derive(Debug, thiserror::Error)]
enum Failure {
    /// What was typed makes no sense: exit code 2.
    #[error("{0}")]
    Usage(String),
    /// It made sense, and failed: exit code 1.
    #[error(transparent)]
    Failed(#[from] Error),
    /// It made sense, and another argument would let it through: exit code 1.
    #[cfg(feature = "fetch")]
    #[error("{0}")]
    Refused(String),
    /// Whoever reads the output stopped reading, as `head` does: success.
    #[error("broken pipe")]
    BrokenPipe,
}

impl From<elm_datasets::Error> for Failure {
    fn from(error: elm_datasets::Error) -> Self {
        Self::Failed(error.into())
    }
}

/// Runs the program with the arguments of the process.
#[must_use]
pub fn run() -> ExitCode {
    let outcome = match Arguments::try_parse() {
        Ok(Arguments { command, threads }) => {
            let work = || dispatch(command, threads);
            match threads {
                0 => work(),
                threads => elm::on_threads(threads, work)
                    .unwrap_or_else(|error| Err(Failure::Usage(error.to_string()))),
            }
        }
        Err(error) => explain(&error),
    };
    match outcome {
        Ok(()) | Err(Failure::BrokenPipe) => ExitCode::SUCCESS,
        Err(failure) => {
            say(&format!("error: {failure}"));
            ExitCode::from(if matches!(failure, Failure::Usage(_)) {
                2
            } else {
                1
            })
        }
    }
}

fn dispatch(command: Command, threads: usize) -> Result<(), Failure> {
    match command {
        Command::Reproduce(arguments) => reproduce::run(&arguments),
        Command::Fit(arguments) => fit::run(&arguments),
        Command::Eval(arguments) => eval::run(&arguments),
        Command::Predict(arguments) => predict::run(&arguments),
        Command::Info(arguments) => info::run(&arguments),
        Command::Prior(arguments) => prior::run(&arguments),
        Command::Render(arguments) => render::run(&arguments, threads),
        Command::Export(arguments) => export::run(&arguments),
        Command::Gallery(arguments) => gallery::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Pareto(arguments) => pareto::run(&arguments),
        #[cfg(feature = "fetch")]
        Command::Fetch(arguments) => fetch::run(&arguments),
    }
}

/// Help and version are results; anything else that clap has to say becomes one line.
fn explain(error: &clap::Error) -> Result<(), Failure> {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => print(&error.to_string()),
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => Err(Failure::Usage(
            "a command is missing (try 'elm-brdf --help')".to_owned(),
        )),
        _ => {
            let text = error.to_string();
            let message = text.strip_prefix("error: ").unwrap_or(&text);
            // The usage and the pointer to --help follow after an empty line.
            let first = message.split("\n\n").next().unwrap_or(message);
            let line = first.split_whitespace().collect::<Vec<_>>().join(" ");
            Err(Failure::Usage(format!("{line} (try 'elm-brdf --help')")))
        }
    }
}

/// Prints a result.
fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Err(Failure::BrokenPipe),
        Err(reason) => Err(Failure::Failed(Error::Write {
            path: "standard output".into(),
            reason,
        })),
    }
}

/// Says something that is not a result.
fn say(line: &str) {
    // With standard error closed there is nobody left to tell.
    let _ = writeln!(io::stderr().lock(), "{line}");
}
