//! Training rows, those of weight 0 left out.

use ndarray::{ArrayView1, ArrayView2, Axis, CowArray, Ix1, Ix2};

use super::{Dataset, TargetDim};
use crate::check::{check_some, check_some_weight, present};
use crate::error::Result;
use crate::scalar::Scalar;

/// Checked training rows and their weights, all of them positive. A row of weight 0 is no row: what
/// is measured on inputs, drawn from them or fitted to them does not see it.
pub(crate) struct Rows<'a, A: Scalar> {
    x: CowArray<'a, A, Ix2>,
    t: CowArray<'a, A, Ix2>,
    weights: Option<CowArray<'a, A, Ix1>>,
}

impl<'a, A: Scalar> Rows<'a, A> {
    /// Copies rows only where some have weight 0.
    ///
    /// # Errors
    /// [`Error`](crate::Error) for data without rows or columns, and for weights that are all 0.
    pub(crate) fn new<D: TargetDim>(data: &'a Dataset<'_, A, D>) -> Result<Self> {
        let (x, t) = (data.inputs(), data.target_matrix());
        check_some("inputs", x)?;
        check_some("targets", t)?;
        let Some(weights) = data.weights() else {
            let (x, t) = (x.into(), t.into());
            let weights = None;
            return Ok(Self { x, t, weights });
        };
        check_some_weight(weights, x.nrows())?;
        Ok(match present(weights) {
            None => Self {
                x: x.into(),
                t: t.into(),
                weights: Some(weights.into()),
            },
            Some(rows) => Self {
                x: x.select(Axis(0), &rows).into(),
                t: t.select(Axis(0), &rows).into(),
                weights: Some(weights.select(Axis(0), &rows).into()),
            },
        })
    }

    /// The inputs, shape (rows, inputs).
    pub(crate) fn x(&self) -> ArrayView2<'_, A> {
        self.x.view()
    }

    /// The targets, shape (rows, outputs).
    pub(crate) fn t(&self) -> ArrayView2<'_, A> {
        self.t.view()
    }

    /// The weights, where rows have any.
    pub(crate) fn weights(&self) -> Option<ArrayView1<'_, A>> {
        self.weights.as_ref().map(|weights| weights.view())
    }
}
