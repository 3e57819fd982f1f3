//! The rows that a search looks at: which, in which folds, and how far their targets vary.

use ndarray::{ArrayView1, Axis};
use rand::seq::index;

use super::{Criterion, Tuner};
use crate::check::present;
use crate::cross_validation::check_several;
use crate::dataset::{Dataset, TargetDim, assign_blocks};
use crate::error::Result;
use crate::scalar::Scalar;
use crate::stats::Moments;
use crate::stream::Stream;

/// The rows that the search looks at, rising; nothing where these are all.
pub(super) fn chosen_rows<A: Scalar, D: TargetDim>(
    tuner: &Tuner<A>,
    data: &Dataset<'_, A, D>,
) -> Option<Vec<usize>> {
    let weighted = data.weights().and_then(present);
    let rows = weighted.as_ref().map_or(data.rows(), Vec::len);
    if tuner.search_rows >= rows {
        return weighted;
    }
    let mut random = Stream::SearchRows.of(tuner.base.seed());
    let mut chosen = index::sample(&mut random, rows, tuner.search_rows).into_vec();
    chosen.sort_unstable();
    Some(match weighted {
        Some(weighted) => chosen.into_iter().map(|place| weighted[place]).collect(),
        None => chosen,
    })
}

/// The folds that the criterion asks for, a label for each row; nothing for leave-one-out.
pub(super) fn folds<A: Scalar, D: TargetDim>(
    tuner: &Tuner<A>,
    data: &Dataset<'_, A, D>,
) -> Result<Option<Vec<usize>>> {
    if let Some(groups) = data.groups() {
        check_several("groups", groups)?;
    }
    match tuner.criterion {
        Criterion::LeaveOneOut => Ok(data.groups().map(<[usize]>::to_vec)),
        Criterion::KFold(folds) => data.folds(folds, tuner.base.seed()).map(Some),
        Criterion::Blocks(blocks) => assign_blocks(data.rows(), blocks).map(Some),
    }
}

/// The standard deviation, or 1 for a constant.
pub(super) fn deviation<A: Scalar>(
    column: ArrayView1<'_, A>,
    weights: Option<ArrayView1<'_, A>>,
) -> f64 {
    let moments = Moments::of(column.insert_axis(Axis(1)), weights);
    let deviation = moments.deviations().next();
    deviation.filter(|d| *d > 0.0).unwrap_or(1.0)
}
