//! The program `elm`: fits networks to tables, applies them, and runs SQL.

mod cluster;
mod evaluate;
mod failure;
mod files;
mod fit;
mod info;
mod models;
mod output;
mod query;
mod stores;

use std::num::NonZeroUsize;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Args, Parser, Subcommand};
use datafusion::execution::runtime_env::{RuntimeEnv, RuntimeEnvBuilder};
use datafusion::prelude::{SessionConfig, SessionContext};

use crate::failure::Failure;
use crate::stores::Stores;

/// Parts that rows are dealt to: the same on every machine, so that models are the same.
const PARTITIONS: usize = 8;

/// Fits extreme learning machines to tables and applies them. Files are CSV, Parquet, JSON lines or Arrow
/// IPC by their names: .csv, .parquet, .json, .jsonl, .ndjson, .arrow, .ipc, .feather; on this machine, or
/// at URLs: s3://, gs://, az://, abfs://, http://, https://. Access to a store is set by its provider's own
/// variables of the environment, such as AWS_ACCESS_KEY_ID.
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
    /// Start the scheduler of a Ballista cluster (experimental)
    Scheduler(cluster::Scheduler),
    /// Start an executor of a Ballista cluster (experimental)
    Executor(cluster::Executor),
}

/// Files of rows.
#[derive(Debug, Args)]
struct Inputs {
    /// Files, or patterns such as 'data/*.parquet' or 's3://bucket/*.parquet', all of one kind
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
    let cores = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let threads = cli.threads.unwrap_or(cores);
    let refused = |reason: &dyn std::fmt::Display| {
        Failure::new(format!("cannot start {threads} threads: {reason}"))
    };
    // Those that fits and predictions share work among.
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build_global()
        .map_err(|reason| refused(&reason))?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(threads.get())
        .enable_all()
        .build()
        .map_err(|reason| refused(&reason))?;
    let config = SessionConfig::new().with_information_schema(true);
    let config = elm_datafusion::with_fixed_partitions(config, PARTITIONS);
    let context = SessionContext::new_with_config_rt(config, environment()?).enable_url_table();
    elm_datafusion::register(&context)?;
    runtime.block_on(async {
        match cli.command {
            Command::Fit(command) => command.run(&context).await,
            Command::Predict(command) => command.run(&context).await,
            Command::Eval(command) => command.run(&context).await,
            Command::Info(command) => command.run(),
            Command::Sql(command) => command.run(&context).await,
            Command::Scheduler(command) => command.run().await,
            Command::Executor(command) => command.run(threads).await,
        }
    })
}

/// What all sessions share: stores of objects by URL.
fn environment() -> datafusion::error::Result<Arc<RuntimeEnv>> {
    RuntimeEnvBuilder::new()
        .with_object_store_registry(Arc::new(Stores::default()))
        .build_arc()
}
