//! Checks of arguments: shapes, finite entries, row weights.

use ndarray::{ArrayView1, ArrayView2};

use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// Not empty, and finite everywhere.
pub(crate) fn check_matrix<A: Scalar>(what: &'static str, a: ArrayView2<'_, A>) -> Result<()> {
    check_some(what, a)?;
    check_finite(what, a)
}

/// Not empty.
pub(crate) fn check_some<A: Scalar>(what: &'static str, a: ArrayView2<'_, A>) -> Result<()> {
    let (rows, columns) = a.dim();
    if a.is_empty() {
        return Err(Error::Empty {
            what,
            rows,
            columns,
        });
    }
    Ok(())
}

/// Finite everywhere.
pub(crate) fn check_finite<A: Scalar>(what: &'static str, a: ArrayView2<'_, A>) -> Result<()> {
    // A question without places is answered several values at a time.
    if a.iter().fold(true, |all, value| all & value.is_finite()) {
        return Ok(());
    }
    match a.indexed_iter().find(|(_, value)| !value.is_finite()) {
        Some(((row, column), _)) => Err(Error::NotFinite { what, row, column }),
        None => Ok(()),
    }
}

pub(crate) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected {
        Ok(())
    } else {
        Err(Error::Shape {
            what,
            expected,
            found,
        })
    }
}

/// One for each row, finite and not negative.
pub(crate) fn check_weights<A: Scalar>(weights: ArrayView1<'_, A>, rows: usize) -> Result<()> {
    check_length("row weights", weights.len(), rows)?;
    let fits = |w: &&A| **w >= A::zero() && w.is_finite();
    match weights.iter().find(|w| !fits(w)) {
        Some(bad) => Err(weight_error(bad.as_f64())),
        None => Ok(()),
    }
}

/// As [`check_weights`], and not all zero.
pub(crate) fn check_some_weight<A: Scalar>(weights: ArrayView1<'_, A>, rows: usize) -> Result<()> {
    check_weights(weights, rows)?;
    if weights.iter().all(|w| *w == A::zero()) {
        return Err(weight_error(0.0));
    }
    Ok(())
}

/// The rows of positive weight; nothing where that is all rows.
pub(crate) fn present<A: Scalar>(weights: ArrayView1<'_, A>) -> Option<Vec<usize>> {
    let counts = |row: &usize| weights[*row] > A::zero();
    let rows: Vec<usize> = (0..weights.len()).filter(counts).collect();
    (rows.len() < weights.len()).then_some(rows)
}

fn weight_error(value: f64) -> Error {
    Error::Parameter {
        name: "row weight",
        value,
        expected: "finite, not negative, not all zero",
    }
}
