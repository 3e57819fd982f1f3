//! Regression on a CSV table from the command line:
//!
//! `cargo run --release -p elm-learn --example csv -- TRAIN.csv TEST.csv --target COLUMN`
//!
//! Chooses everything on the training rows, and prints one JSON object with the error on the test
//! rows beside what was chosen.

#![allow(clippy::print_stdout)]

use std::error::Error;

use elm::{ElmParams, metrics};
use elm_datasets::csv::Table;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [train, test, flag, target] = arguments.as_slice() else {
        return Err("usage: csv TRAIN.csv TEST.csv --target COLUMN".into());
    };
    if flag != "--target" {
        return Err(format!("expected --target, found {flag}").into());
    }
    let (x, t) = Table::read(train)?.split_target(&[target])?;
    let (x_test, t_test) = Table::read(test)?.split_target(&[target])?;

    let tuned = ElmParams::auto().tune(&x, &t)?;
    let predicted = tuned.model.predict(&x_test)?;
    let diagnosis = tuned.model.diagnosis();
    let report = serde_json::json!({
        "test_rmse": metrics::rmse(&predicted.column(0), &t_test.column(0))?,
        "neurons": tuned.best.neurons,
        "scale": tuned.best.scale,
        "lambda": diagnosis.lambda[0],
        "loo_rmse": diagnosis.leave_one_out.as_ref().map(|rmse| rmse[0]),
    });
    println!("{report}");
    Ok(())
}
