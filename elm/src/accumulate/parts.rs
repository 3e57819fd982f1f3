//! The parts of a saved accumulator, before they are checked against each other.

use std::marker::PhantomData;

use ndarray::{Array1, Array2, Axis};
use serde::Deserialize;

use super::{Accumulator, OVERFLOW, block};
use crate::bounds::Bounds;
use crate::check::{check_length, check_matrix};
use crate::dataset::{TargetDim, check_outputs};
use crate::error::{Error, Result};
use crate::feature_map::FeatureMap;
use crate::scalar::Scalar;
use crate::solve::Solver;

/// The fields of [`Accumulator`].
#[derive(Deserialize)]
#[serde(bound = "")]
pub(super) struct Parts<A: Scalar> {
    map: FeatureMap<A>,
    solver: Solver,
    intercept: bool,
    inputs: usize,
    outputs: usize,
    rows: u64,
    weighted_rows: u64,
    far: Vec<u64>,
    unlike_rows: bool,
    #[serde(with = "super::upper")]
    kept: Array2<A>,
    scales: Array1<A>,
    shift: Option<Array1<A>>,
    pending: Vec<A>,
    bounded: bool,
    bounds: Option<Bounds<A>>,
}

impl<A: Scalar, D: TargetDim> TryFrom<Parts<A>> for Accumulator<A, D> {
    type Error = Error;

    fn try_from(parts: Parts<A>) -> Result<Self> {
        check_outputs::<D>(parts.outputs)?;
        check_length("inputs", parts.inputs, parts.map.inputs())?;
        parts.solver.check()?;
        if let Some(bounds) = &parts.bounds {
            bounds.check(parts.inputs, parts.outputs)?;
        }
        check_matrix("kept", parts.kept.view())?;
        let own = usize::from(parts.intercept) + parts.map.features();
        let columns = parts.kept.ncols();
        // Subtracted, as the sum might overflow.
        check_length("outputs", columns.saturating_sub(own), parts.outputs)?;
        check_length("rows of what is kept", parts.kept.nrows(), columns)?;
        check_length("scales", parts.scales.len(), columns)?;
        check_length("counts of inputs", parts.far.len(), parts.inputs)?;
        if parts.weighted_rows > parts.rows {
            return Err(Error::Shape {
                what: "rows of positive weight",
                expected: usize::try_from(parts.rows).unwrap_or(usize::MAX),
                found: usize::try_from(parts.weighted_rows).unwrap_or(usize::MAX),
            });
        }
        if parts.outputs == 0 || parts.pending.len() >= block::<A>(parts.solver, columns) * columns
        {
            return Err(Error::Shape {
                what: "pending rows",
                expected: 0,
                found: parts.pending.len() / columns,
            });
        }
        check_length("values in a pending row", parts.pending.len() % columns, 0)?;
        if let Some(shift) = &parts.shift {
            check_length("shifts", shift.len(), columns - 1)?;
            check_matrix("shifts", shift.view().insert_axis(Axis(0)))?;
        }
        let good = |scale: &A| scale.is_finite() && *scale > A::zero();
        if !(parts.scales.iter().all(good) && parts.pending.iter().all(|v| v.is_finite())) {
            return Err(OVERFLOW);
        }
        let Parts {
            map,
            solver,
            intercept,
            inputs,
            outputs,
            rows,
            weighted_rows,
            far,
            unlike_rows,
            kept,
            scales,
            shift,
            pending,
            bounded,
            bounds,
        } = parts;
        Ok(Self {
            map,
            solver,
            intercept,
            inputs,
            outputs,
            rows,
            weighted_rows,
            far,
            unlike_rows,
            kept,
            scales,
            shift,
            pending,
            bounded,
            bounds,
            dimension: PhantomData,
        })
    }
}
