//! `ElmParams::auto` on real tables, beside scikit-learn's methods.

pub mod data;
pub mod peers;
pub mod report;

use elm::{Dataset, ElmParams, Tuner};
use ndarray::Array2;

use crate::timing::processor_seconds;
use data::Split;
use peers::Figure;

/// Ours, by the names in the tables.
pub const OURS: [&str; 2] = ["auto", "quick"];

/// Ours on a split of a table.
#[derive(Debug, Clone)]
pub struct Own {
    /// As for the others.
    pub figure: Figure,
    /// Test error over the leave-one-out error of the fit, where that is known.
    pub over_left_out: Option<f64>,
    /// Neurons.
    pub neurons: usize,
    /// What the search chose, in words.
    pub chosen: String,
    /// How far predictions of test rows lie outside the range of the training targets, in units of it, when
    /// one input is moved 10 or 1e6 deviations away.
    pub outside: f64,
}

/// The search of this name.
#[must_use]
pub fn tuner(name: &str, seed: u64) -> Tuner<f64> {
    let tuner = ElmParams::auto().with_seed(seed);
    if name == "quick" {
        tuner.quick()
    } else {
        tuner
    }
}

/// Fits and judges one of [`OURS`].
///
/// # Errors
/// What cannot be fitted.
pub fn own(name: &str, table: &str, number: u64, split: &Split) -> Result<Own, String> {
    let ((x, t), (x_test, t_test)) = (split.fitted(), split.judged());
    let said = |error: elm::Error| format!("{table}: {error}");
    let before = processor_seconds();
    let data = Dataset::new(&x, &t).map_err(said)?;
    let tuned = tuner(name, number).tune(&data).map_err(said)?;
    let seconds = processor_seconds() - before;
    let predicted = tuned.model.predict(&x_test).map_err(said)?;
    let rmse = elm::metrics::rmse(&predicted, &t_test).map_err(said)?;
    let left_out = tuned.model.diagnosis().leave_one_out.as_ref();
    let (mut outside, deviations) = (0.0_f64, x.std_axis(ndarray::Axis(0), 0.0));
    let (least, greatest) = (
        t.iter().copied().fold(f64::MAX, f64::min),
        t.iter().copied().fold(f64::MIN, f64::max),
    );
    let some: Array2<f64> = x_test
        .slice(ndarray::s![..20.min(x_test.nrows()), ..])
        .to_owned();
    for (input, deviation) in deviations.iter().enumerate() {
        for far in [10.0, -10.0, 1e6, -1e6] {
            let mut moved = some.clone();
            moved
                .column_mut(input)
                .mapv_inplace(|x| x + far * deviation);
            for y in &tuned.model.predict(&moved).map_err(said)? {
                let beyond = (y - greatest).max(least - y);
                outside = outside.max(beyond / (greatest - least));
            }
        }
    }
    Ok(Own {
        over_left_out: left_out.map(|left_out| rmse / left_out[0]),
        neurons: tuned.model.hidden().neurons(),
        chosen: described(&tuned.params),
        outside,
        figure: Figure {
            table: table.to_owned(),
            split: number,
            method: name.to_owned(),
            rmse: rmse / t_test.std(0.0),
            seconds,
        },
    })
}

fn described(params: &ElmParams<f64>) -> String {
    let ramps = match params.embedding() {
        elm::Embedding::Inputs => "inputs",
        _ => "ramps",
    };
    let learned = params
        .input_scales()
        .windows(2)
        .any(|pair| pair[0] != pair[1]);
    format!("{ramps}{}", if learned { ", slopes" } else { "" })
}
