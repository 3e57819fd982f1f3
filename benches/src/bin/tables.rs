//! `ElmParams::auto` on real tables, beside scikit-learn's methods on the same splits:
//! `cargo run --release -p elm-benches --bin tables -- --data DIR`.
//!
//! The folder has a pair NAME_train.csv and NAME_test.csv for each table, the target named y; splits are made
//! of both files' rows. Sets up a Python environment of its own (under the target folder, by pip) on the
//! first run.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use elm_benches::peers::Environment;
use elm_benches::tables::peers::{METHODS, Peers};
use elm_benches::tables::report::Figures;
use elm_benches::tables::{OURS, data, own};

/// Ours and scikit-learn's on real tables.
#[derive(Debug, Parser)]
#[command(name = "tables")]
struct Arguments {
    /// The folder of the tables
    #[arg(long)]
    data: PathBuf,
    /// Splits of each table
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..))]
    splits: u64,
    /// Only tables whose names contain this
    #[arg(long, default_value = "")]
    only: String,
    /// Of ours only this, auto or quick
    #[arg(long)]
    ours: Option<String>,
    /// Where the page is written; printed unless given
    #[arg(long)]
    out: Option<PathBuf>,
    /// A file that keeps the peers' figures from run to run
    #[arg(long)]
    cache: Option<PathBuf>,
    /// Peers' figures are taken from the cache alone
    #[arg(long)]
    no_peers: bool,
    /// The Python to make the environment with; python3 or python unless given
    #[arg(long)]
    python: Option<String>,
    /// The environment's folder; beside the program's unless given
    #[arg(long)]
    environment: Option<PathBuf>,
}

fn main() -> ExitCode {
    elm_benches::timing::use_threads(1);
    match run(&Arguments::parse()) {
        Ok(page) => {
            if let Some(page) = page {
                println!("{page}");
            }
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("tables: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<Option<String>, String> {
    let tables = data::tables(&arguments.data, &arguments.only)?;
    let python = if arguments.no_peers {
        None
    } else {
        let folder = arguments.environment.clone().or_else(beside_the_program);
        let folder = folder.ok_or("no folder for the environment; name one with --environment")?;
        let environment = Environment::set_up(&folder, arguments.python.as_deref());
        Some(environment.map_err(|trouble| trouble.to_string())?.python)
    };
    let mut peers = Peers::new(arguments.cache.clone(), python)?;
    let mut figures = Figures::default();
    for table in &tables {
        for number in 1..=arguments.splits {
            let split = table.split(number);
            for method in METHODS {
                let figure = peers.figure(&table.name, number, method, &split)?;
                figures.all.extend(figure);
            }
            for name in OURS {
                if arguments.ours.as_deref().is_some_and(|only| only != name) {
                    continue;
                }
                let own = own(name, &table.name, number, &split)?;
                eprintln!(
                    "{} {number} {name}: {:.4} in {:.2} s, {} neurons, {}, {:.2} of left out",
                    table.name,
                    own.figure.rmse,
                    own.figure.seconds,
                    own.neurons,
                    own.chosen,
                    own.over_left_out.unwrap_or(f64::NAN),
                );
                figures.all.push(own.figure.clone());
                figures.own.push(own);
            }
        }
    }
    let sized: Vec<_> = tables.iter().map(|t| (t.name.clone(), t.size())).collect();
    let command = "cargo run --release -p elm-benches --bin tables -- --data DIR";
    let page = figures.page(&sized, arguments.splits, command);
    match &arguments.out {
        None => Ok(Some(page)),
        Some(path) => std::fs::write(path, page)
            .map(|()| None)
            .map_err(|error| format!("{}: {error}", path.display())),
    }
}

/// `target/peers-env` for `target/release/tables`.
fn beside_the_program() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    Some(program.parent()?.parent()?.join("peers-env"))
}
