//! Regression on a CSV table from the command line:
//!
//! `cargo run --release -p elm-learn --example csv -- TRAIN.csv TEST.csv --target COLUMN`
//!
//! Both tables have a line of names, then numbers; all columns of the first but the target are
//! inputs, and are found in the second by their names. Chooses everything on the training rows, and
//! prints one JSON object with the error on the test rows beside what was chosen.

#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;
use std::process::ExitCode;

use elm::{Dataset, ElmParams, metrics};
use elm_datasets::csv::Table;
use ndarray::{Array2, Axis};

const USAGE: &str = "usage: csv TRAIN.csv TEST.csv --target COLUMN";

fn main() -> ExitCode {
    match run(std::env::args().skip(1)) {
        Ok(report) => {
            println!("{report}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

pub(crate) fn run(arguments: impl Iterator<Item = String>) -> Result<String, Box<dyn Error>> {
    let (train, test, target) = parse(arguments)?;
    let table = Table::read(&train)?;
    let (x, t) = table.split_target(&[&target])?;
    let t = t.remove_axis(Axis(1));
    let inputs: Vec<&str> = table.columns.iter().map(String::as_str).collect();
    let inputs: Vec<&str> = inputs.into_iter().filter(|name| *name != target).collect();
    let table = Table::read(&test)?;
    let (x_test, t_test) = (
        columns(&table, &test, &inputs)?,
        columns(&table, &test, &[&target])?.remove_axis(Axis(1)),
    );

    let tuned = ElmParams::auto().tune(&Dataset::new(&x, &t)?)?;
    let predicted = tuned.model.predict(&x_test)?;
    let diagnosis = tuned.model.diagnosis();
    let report = serde_json::json!({
        "test_rmse": metrics::rmse(&predicted, &t_test)?,
        "neurons": tuned.best.neurons,
        "scale": tuned.best.scale,
        "lambda": diagnosis.lambda.first(),
        "loo_rmse": diagnosis.leave_one_out.as_ref().and_then(|rmse| rmse.first()),
    });
    Ok(report.to_string())
}

/// The two files and the target's name, wherever the flag stands.
fn parse(
    mut arguments: impl Iterator<Item = String>,
) -> Result<(String, String, String), Box<dyn Error>> {
    let (mut files, mut target) = (Vec::new(), None);
    while let Some(argument) = arguments.next() {
        if argument == "--target" {
            target = Some(
                arguments
                    .next()
                    .ok_or("--target needs the name of a column")?,
            );
        } else if let Some(name) = argument.strip_prefix("--target=") {
            target = Some(name.to_owned());
        } else if argument.starts_with("--") {
            return Err(format!("unknown flag {argument}; {USAGE}").into());
        } else {
            files.push(argument);
        }
    }
    match (<[String; 2]>::try_from(files), target) {
        (Ok([train, test]), Some(target)) => Ok((train, test, target)),
        _ => Err(USAGE.into()),
    }
}

/// The columns of these names, in this order.
fn columns(table: &Table, file: &str, names: &[&str]) -> Result<Array2<f64>, Box<dyn Error>> {
    let place = |name: &&str| {
        let place = table.columns.iter().position(|column| column == name);
        place.ok_or_else(|| format!("{file}: there is no column {name:?}"))
    };
    let places = names.iter().map(place).collect::<Result<Vec<_>, _>>()?;
    Ok(table.values.select(Axis(1), &places))
}
