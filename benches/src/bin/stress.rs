//! Every solver on least-squares problems that break linear algebra: the tables and the curve of
//! `docs/reports/stability.md`.
//!
//! `cargo run --release -p elm-benches --bin stress -- --out docs/reports/stability.md`; for OpenBLAS with
//! `--no-default-features --features openblas-system` before the `--`.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::PathBuf;
use std::{fs, io};

use clap::{Parser, ValueEnum};
use elm_benches::stress::cases::CASES;
use elm_benches::stress::{Method, Precision, Record, Settings, curve, report, run};

/// Hard least-squares problems: every solver against an oracle and a double-double reference.
#[derive(Debug, Parser)]
struct Arguments {
    /// What to write.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
    /// Where to: JSON becomes the file, tables become a section of it, one per back end. Without
    /// it everything goes to standard output.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Also draw the curve of error against condition number, as SVG.
    #[arg(long, value_name = "FILE")]
    curve: Option<PathBuf>,
    /// Seeds per case.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Table,
    Json,
}

fn main() -> Result<(), Box<dyn Error>> {
    elm_benches::timing::use_threads(1);
    let arguments = Arguments::parse();
    let settings = Settings {
        seeds: arguments.seeds,
        methods: Method::ALL.to_vec(),
        reference: true,
    };
    let records: Vec<Record> = [Precision::F64, Precision::F32]
        .into_iter()
        .flat_map(|precision| run(CASES, precision, &settings))
        .collect();
    let text = match arguments.format {
        Format::Json => report::json(&records)?,
        Format::Table => report::markdown(&records, arguments.seeds),
    };
    match (&arguments.out, arguments.format) {
        (None, _) => print!("{text}"),
        (Some(path), Format::Json) => fs::write(path, text)?,
        (Some(path), Format::Table) => {
            let document = match fs::read_to_string(path) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
                other => other?,
            };
            fs::write(
                path,
                report::replace_section(&document, elm::backend(), &text),
            )?;
        }
    }
    if let Some(path) = &arguments.curve {
        fs::write(path, curve::svg(&curve::curves(5))?)?;
    }
    Ok(())
}
