//! The project's own commands, run as `cargo xtask COMMAND`: checks, tests by tier, the tables of
//! the documentation, packages.

// A program for developers: what it prints is its result.
#![allow(clippy::print_stdout)]

mod ci;
mod package;
mod python;
mod run;
mod tables;
mod tiers;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// What every command returns: nothing, or one line that says what failed.
type Result<T = ()> = std::result::Result<T, String>;

#[derive(Parser)]
#[command(name = "cargo xtask", about, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// Commands for developers of this workspace.
#[derive(Subcommand)]
enum Command {
    /// Formatting, clippy and unit tests: before every commit.
    Check,
    /// All tests that need nothing from outside; options add those that do.
    Test(tiers::Tiers),
    /// Everything that must hold before a change lands; `.ci/run` installs what it needs first.
    Ci,
    /// The Python package: its wheel, installed into a fresh environment, and its tests.
    Python,
    /// Lists the commands that write the tables of docs/reports/, or runs some of them.
    Tables(tables::Selection),
    /// The packages as they would be published, in publishing order, each built from its package.
    Package(package::Packaging),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Check => ci::check(),
        Command::Test(tiers) => tiers.run(),
        Command::Ci => ci::all(),
        Command::Python => python::python(),
        Command::Tables(selection) => selection.run(),
        Command::Package(packaging) => packaging.run(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            run::say(&format!("error: {reason}"));
            ExitCode::FAILURE
        }
    }
}
