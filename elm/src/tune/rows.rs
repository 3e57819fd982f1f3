//! The rows that a search looks at: which, in which folds, and how far their targets vary.

use ndarray::{Array2, ArrayView1, Axis};
use rand::seq::index;

use super::{Criterion, Tuner};
use crate::check::present;
use crate::dataset::{Dataset, TargetDim, assign_folds};
use crate::error::{Error, Result};
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

/// The folds that the criterion asks for; nothing for leave-one-out.
pub(super) fn folds<A: Scalar>(
    tuner: &Tuner<A>,
    x: &Array2<A>,
    t: &Array2<A>,
    groups: Option<Vec<usize>>,
) -> Result<Option<Vec<usize>>> {
    match (tuner.criterion, groups) {
        (Criterion::LeaveOneOut, None) => Ok(None),
        (Criterion::LeaveOneOut, Some(groups)) => {
            if groups.iter().all(|&group| group == groups[0]) {
                return Err(Error::Parameter {
                    name: "groups",
                    value: 1.0,
                    expected: "at least 2",
                });
            }
            Ok(Some(groups))
        }
        (Criterion::KFold(folds), None) => {
            assign_folds(x.nrows(), folds, tuner.base.seed()).map(Some)
        }
        (Criterion::KFold(folds), Some(groups)) => {
            let data = Dataset::new(x, t)?.with_groups(&groups)?;
            data.folds(folds, tuner.base.seed()).map(Some)
        }
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
