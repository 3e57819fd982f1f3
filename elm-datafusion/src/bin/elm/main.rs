//! The program `elm`: fits networks to tables, applies them, and runs SQL.

mod evaluate;
mod failure;
mod files;
mod fit;
mod info;
mod models;
mod output;
mod query;

use std::num::NonZeroUsize;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use datafusion::prelude::{SessionConfig, SessionContext};

use crate::failure::Failure;

/// Parts that rows are dealt to: the same on every machine, so that models are the same.
const PARTITIONS: usize = 8;

/// Fits extreme learning machines to tables and applies them. Files are CSV, Parquet, JSON lines or Arrow
/// IPC by their names: .csv, .parquet, .json, .jsonl, .ndjson, .arrow, .ipc, .feather.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Threads to use; all cores unless given
    #[arg(long, global = true)]
    threads: Option<NonZeroUsize>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Fit a network, or one for each group
    Fit(fit::Fit),
    /// Add a column of predictions to a table
    Predict(evaluate::Predict),
    /// Report the errors of predictions
    Eval(evaluate::Eval),
    /// Describe a model's file
    Info(info::Info),
    /// Run SQL with elm_fit, elm_sample, elm_predict and elm_predict_all
    Sql(query::Sql),
}

/// Files of rows.
#[derive(Debug, Args)]
struct Inputs {
    /// Files, or patterns such as 'data/*.parquet', all of one kind
    #[arg(required = true)]
    files: Vec<String>,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("elm: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> Result<(), Failure> {
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let threads = cli.threads.map_or(cores, NonZeroUsize::get);
    let refused = |reason: &dyn std::fmt::Display| {
        Failure::new(format!("cannot start {threads} threads: {reason}"))
    };
    // Those that fits and predictions share work among.
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|reason| refused(&reason))?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(threads)
        .enable_all()
        .build()
        .map_err(|reason| refused(&reason))?;
    let config = SessionConfig::new()
        .with_target_partitions(PARTITIONS)
        .with_information_schema(true);
    let context = SessionContext::new_with_config(config).enable_url_table();
    elm_datafusion::register(&context)?;
    runtime.block_on(async {
        match cli.command {
            Command::Fit(command) => command.run(&context).await,
            Command::Predict(command) => command.run(&context).await,
            Command::Eval(command) => command.run(&context).await,
            Command::Info(command) => command.run(),
            Command::Sql(command) => command.run(&context).await,
        }
    })
}
