//! Training rows, those of weight 0 left out.

use ndarray::{Array, Array2, ArrayView1, ArrayView2, Axis, CowArray, Ix1, Ix2};

use super::{Dataset, TargetDim};
use crate::check::{check_some, check_some_weight, present};
use crate::error::Result;
use crate::scalar::Scalar;

/// Rows without weights, each as often as it weighed.
///
/// What leaves rows out one by one then leaves out one of several equal rows, as it does where they stand in
/// the data several times.
pub(crate) struct RepeatedRows<A: Scalar, D: TargetDim> {
    inputs: Array2<A>,
    targets: Array<A, D>,
    groups: Option<Vec<usize>>,
}

impl<A: Scalar, D: TargetDim> RepeatedRows<A, D> {
    /// Nothing unless weights are [counts] of which some are above 1, and of at most `most` rows in all.
    pub(crate) fn new(data: &Dataset<'_, A, D>, most: usize) -> Option<Self> {
        let weights = data.weights()?;
        let counts = counts(weights.iter().map(|weight| weight.as_f64()))?;
        let rows = counts.iter().sum::<f64>();
        if rows > most as f64 || counts.iter().all(|count| *count <= 1.0) {
            return None;
        }
        let repeat = |(row, count): (usize, &f64)| std::iter::repeat_n(row, *count as usize);
        let rows: Vec<usize> = counts.iter().enumerate().flat_map(repeat).collect();
        let of_group = |groups: &[usize]| rows.iter().map(|&row| groups[row]).collect();
        Some(Self {
            inputs: data.inputs().select(Axis(0), &rows),
            targets: D::of_matrix(data.target_matrix().select(Axis(0), &rows)),
            groups: data.groups().map(of_group),
        })
    }

    pub(crate) fn data(&self) -> Dataset<'_, A, D> {
        Dataset {
            groups: self.groups.as_deref(),
            ..Dataset::of_views(self.inputs.view(), self.targets.view())
        }
    }
}

/// How many rows each stands for, where weights can be such counts: whole multiples, of at most 20, of the
/// smallest that is not 0. (Weights that undo different noise are far apart, or no multiples.) 0 for a row
/// of weight 0.
pub(crate) fn counts(weights: impl Iterator<Item = f64> + Clone) -> Option<Vec<f64>> {
    const MOST: f64 = 20.0;
    let positive = weights.clone().filter(|weight| *weight > 0.0);
    let least = positive.fold(f64::INFINITY, f64::min);
    let count = |weight: f64| {
        if weight == 0.0 {
            return Some(0.0);
        }
        let count = weight / least;
        let whole = count.round().max(1.0);
        let close = (count / whole - 1.0).abs() < 1e-6;
        (close && whole <= MOST).then_some(whole)
    };
    weights.map(count).collect()
}

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
