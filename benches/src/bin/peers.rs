//! This project beside everything a user would pick instead, in one run:
//! `cargo run --release -p elm-benches --bin peers`.
//!
//! Sets up a Python environment of its own (under the target folder, by pip) on the first run. One
//! thread, processor time, ours and theirs in turn; the ratios are medians over pairs.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use elm_benches::peers::{Environment, Format, Plan, Rival, SIZES, Size, compare, fit_once, print};
use elm_benches::timing;

/// Fitting and predicting, ours and the peers' in turn on the same data.
///
/// Exit codes: 0 done, 1 a peer or the worker failed, 2 wrong arguments, 3 no Python, pip or
/// packages.
#[derive(Debug, Parser)]
#[command(name = "peers")]
struct Arguments {
    /// Sizes, by name or number of rows, separated by commas; all unless given
    #[arg(long, value_delimiter = ',')]
    sizes: Vec<Size>,
    /// Peers by name, separated by commas; all unless given
    #[arg(long, value_delimiter = ',')]
    peers: Vec<Rival>,
    /// How results are printed
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
    /// Seconds for the pairs of each comparison
    #[arg(long, default_value_t = 6.0)]
    seconds: f64,
    /// Threads of all; with several, times are by the clock
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// The Python to make the environment with; python3 or python unless given
    #[arg(long)]
    python: Option<String>,
    /// The environment's folder; beside the program's unless given
    #[arg(long)]
    environment: Option<PathBuf>,
    #[arg(long, hide = true)]
    memory_of: Option<String>,
    #[arg(long, hide = true, default_value_t = 1.0)]
    scale: f64,
    #[arg(long, hide = true, default_value_t = 1e-6)]
    lambda: f64,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    timing::use_threads(arguments.threads);
    let sizes = if arguments.sizes.is_empty() {
        SIZES.to_vec()
    } else {
        arguments.sizes.clone()
    };
    if let (Some(of), Some(&size)) = (&arguments.memory_of, sizes.first()) {
        return match fit_once(size, of == "crate", arguments.scale, arguments.lambda) {
            Ok(bytes) => {
                println!("{}", bytes.map_or_else(String::new, |b| b.to_string()));
                ExitCode::SUCCESS
            }
            Err(error) => fail(1, &error),
        };
    }
    let folder = arguments.environment.clone().or_else(beside_the_program);
    let Some(folder) = folder else {
        return fail(
            3,
            "no folder for the environment; name one with --environment",
        );
    };
    eprintln!("Python environment: {}", folder.display());
    let environment = match Environment::set_up(&folder, arguments.python.as_deref()) {
        Ok(environment) => environment,
        Err(trouble) => return fail(3, &trouble.to_string()),
    };
    for package in &environment.left_out {
        eprintln!("not installed, left out: {package}");
    }
    let plan = Plan {
        sizes,
        rivals: if arguments.peers.is_empty() {
            Rival::ALL.to_vec()
        } else {
            arguments.peers
        },
        seconds: arguments.seconds,
    };
    let printed =
        compare(&plan, &environment, |next| eprintln!("{next}")).and_then(|(records, about)| {
            print(&records, &about, arguments.format).map_err(|error| error.to_string())
        });
    match printed {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => fail(1, &error),
    }
}

/// `target/peers-env` for `target/release/peers`.
fn beside_the_program() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    Some(program.parent()?.parent()?.join("peers-env"))
}

fn fail(code: u8, error: &str) -> ExitCode {
    eprintln!("peers: {error}");
    ExitCode::from(code)
}
