//! How near `ElmParams::auto` comes to the best of a dense grid, problem by problem.
//!
//! `cargo run --release -p elm-benches --bin auto -- [--seeds N] [--only NAME] [--outside]
//! [--format table|json]`

#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;

use clap::{Parser, ValueEnum};
use elm_benches::auto::problems::PROBLEMS;
use elm_benches::auto::{Record, Subject, outside, run};

/// Test error of the chosen settings over that of the best on a grid chosen with the test rows in
/// sight.
#[derive(Debug, Parser)]
struct Arguments {
    /// What to write.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
    /// Seeds per problem.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
    /// Only problems whose names contain this.
    #[arg(long, default_value = "")]
    only: String,
    /// Only with settings chosen by `auto`, not with 200 neurons given.
    #[arg(long)]
    auto_only: bool,
    /// How far off predictions and intervals are outside the training rows instead.
    #[arg(long)]
    outside: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Table,
    Json,
}

fn main() -> Result<(), Box<dyn Error>> {
    elm_benches::timing::use_threads(1);
    let arguments = Arguments::parse();
    if arguments.outside {
        return outside(&arguments);
    }
    let subjects: &[Subject] = if arguments.auto_only {
        &[Subject::Auto]
    } else {
        &[Subject::Auto, Subject::Quick, Subject::Given]
    };
    let mut records = Vec::new();
    if arguments.format == Format::Table {
        println!(
            "| problem | rows x inputs | settings | ratio, median (worst) of {} | without noise \
             | test RMSE | neurons | seconds |\n|---|---|---|---|---|---|---|---|",
            arguments.seeds
        );
    }
    for problem in PROBLEMS.iter().filter(|p| p.name.contains(&arguments.only)) {
        for &subject in subjects {
            let runs: Vec<Record> = (1..=arguments.seeds)
                .filter_map(|seed| run(problem, subject, seed))
                .collect();
            if runs.len() as u64 != arguments.seeds {
                return Err(format!("{}: a seed could not be fitted", problem.name).into());
            }
            if arguments.format == Format::Table {
                let inputs = problem.train(1).map_or(0, |(x, _)| x.ncols());
                println!("{}", line(&runs, problem.rows, inputs));
            }
            records.extend(runs);
        }
    }
    if arguments.format == Format::Json {
        println!("{}", serde_json::to_string_pretty(&records)?);
    }
    Ok(())
}

fn outside(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut records = Vec::new();
    for problem in PROBLEMS.iter().filter(|p| p.name.contains(&arguments.only)) {
        for seed in 1..=arguments.seeds {
            let run = outside::run(problem, seed);
            records.push(run.ok_or_else(|| format!("{}: cannot be fitted", problem.name))?);
        }
    }
    if arguments.format == Format::Json {
        println!("{}", serde_json::to_string_pretty(&records)?);
        return Ok(());
    }
    println!(
        "| problem | rows outside at 1.2 | RMSE at 1, 1.2 | unbounded | coverage of 0.9 at 1, 1.2 | farthest at 3 |\n         |---|---|---|---|---|---|"
    );
    let runs = records.chunks(usize::try_from(arguments.seeds)?);
    for runs in runs {
        let mean = |of: &dyn Fn(&outside::Outside) -> f64| {
            runs.iter().map(of).sum::<f64>() / runs.len() as f64
        };
        println!(
            "| {} | {:.2} | {:.3}, {:.3} | {:.3}, {:.3} | {:.3}, {:.3} | {:.2} |",
            runs[0].problem,
            mean(&|r| r.outside),
            mean(&|r| r.rmse[0]),
            mean(&|r| r.rmse[1]),
            mean(&|r| r.unbounded[0]),
            mean(&|r| r.unbounded[1]),
            mean(&|r| r.coverage[0]),
            mean(&|r| r.coverage[1]),
            runs.iter().fold(0.0, |m: f64, r| m.max(r.excess)),
        );
    }
    let mean = records.iter().map(|r| r.coverage[1]).sum::<f64>() / records.len() as f64;
    println!("\nMean coverage at 1.2 times the extent: {mean:.3}");
    Ok(())
}

fn line(runs: &[Record], rows: usize, inputs: usize) -> String {
    let sorted = |of: fn(&Record) -> f64| {
        let mut values: Vec<f64> = runs.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let median = |of: fn(&Record) -> f64| {
        let values = sorted(of);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let worst = |of: fn(&Record) -> f64| sorted(of).last().copied().unwrap_or(f64::NAN);
    let (problem, subject) = runs.first().map_or(("", ""), |r| (r.problem, r.subject));
    format!(
        "| {problem} | {rows} x {inputs} | {subject} | {:.2} ({:.2}) | {:.2} ({:.2}) | {:.3e} | {:.0} | {:.2} |",
        median(|r| r.ratio),
        worst(|r| r.ratio),
        median(|r| r.ratio_exact),
        worst(|r| r.ratio_exact),
        median(|r| r.rmse),
        median(|r| r.neurons as f64),
        median(|r| r.seconds),
    )
}
