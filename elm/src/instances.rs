//! What is generic, compiled once, in double precision.
//!
//! A crate that is not optimized beyond level 1, as in development, links to the instances of generic
//! functions that crates below have compiled, and compiles only those that are missing. Without this module
//! each program, example and test compiles a fit anew (decision 23).

use ndarray::{Array1, Array2, Ix1};

use crate::{Accumulator, Dataset, Elm, ElmParams, Result, TargetDim};

/// A use of each verb. Nobody calls it.
pub fn instances(
    x: &Array2<f64>,
    one: &Array1<f64>,
    several: &Array2<f64>,
) -> Result<Elm<f64, Ix1>> {
    let params = ElmParams::new(1);
    verbs(&params, &Dataset::new(x, several)?)?;
    verbs(&params, &Dataset::new(x, one)?)
}

fn verbs<D: TargetDim>(params: &ElmParams<f64>, data: &Dataset<'_, f64, D>) -> Result<Elm<f64, D>> {
    let tuned = ElmParams::auto().tune(data)?;
    tuned.params.cross_val_predict(data, &[])?;
    let _ = tuned.params.fit_uncertain(data)?.compact();
    let mut rows = Accumulator::from_sample(params, &data.inputs(), 1)?;
    rows.push_dataset(data)?;
    rows.merge(&rows.clone())?;
    rows.fit()?;
    let model = params.fit_dataset(data)?;
    model.predict(&data.inputs())?;
    model.predictor().predict(&data.inputs())?;
    Ok(model)
}
