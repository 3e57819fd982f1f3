//! The constants that are subtracted from columns before they enter what is kept.
//!
//! Centering a column by the column of ones costs as many digits as its mean has over its deviation.
//! Columns are therefore taken less a value near their mean, which is known from the first rows. What
//! that leaves of a constant is its rounding and no more, however many rows there are. Without an
//! intercept there is no column of ones to put back what was taken off, and nothing is.

use ndarray::{Array1, ArrayRef2, ArrayViewMut2, s};

use super::Accumulator;
use crate::dataset::TargetDim;
use crate::scalar::Scalar;
use crate::stats;

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// What each column of weighted rows, which are as they were pushed, is taken less of, in units of the
    /// first column, which is left as it is; the first rows say what that is.
    pub(super) fn shift_for(&mut self, rows: &ArrayRef2<A>) -> Array1<A> {
        let mut all = Array1::zeros(rows.ncols());
        if self.intercept {
            let shift = self.shift.get_or_insert_with(|| near_means(rows));
            all.slice_mut(s![1..]).assign(shift);
        }
        all
    }

    /// Rows from which `other` has taken its own, as rows from which this has.
    pub(super) fn take_over(&mut self, other: &Self, mut rows: ArrayViewMut2<'_, A>) {
        let Some(theirs) = &other.shift else {
            return;
        };
        let Some(ours) = &self.shift else {
            self.shift = Some(theirs.clone());
            return;
        };
        let apart = theirs - ours;
        for mut row in rows.rows_mut() {
            let root = row[0];
            row.slice_mut(s![1..]).scaled_add(root, &apart);
        }
    }
}

/// The weighted mean of each column but the first, of the roots of the weights; of a constant its
/// value to within a rounding or two.
pub(super) fn near_means<A: Scalar>(rows: &ArrayRef2<A>) -> Array1<A> {
    // In shares of their sum, so that no sum leaves the range.
    let roots = A::widen(rows.column(0));
    let total = stats::sum(roots.iter().copied());
    let shares = roots.mapv(|root| root / total);
    let squares = stats::sum(shares.iter().map(|share| share * share));
    let sums = stats::means(rows.slice(s![.., 1..]), shares.view());
    let means = sums.into_iter().map(|sum| sum / total / squares);
    means.map(A::from_f64).collect()
}
