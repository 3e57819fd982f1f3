//! Leave-one-out scores of many strengths at once.

use std::ops::Range;

use ndarray::{Array2, ArrayView1, ArrayView2, Axis, Zip, s};

use super::design_svd::{DesignSvd, DesignSvdWithRows};
use super::normal_equations::runs;
use crate::scalar::Scalar;
use crate::threads;

/// The share of a score that rounding errors must have for them to be looked at closely.
pub(super) const NEGLIGIBLE: f64 = 1e-6;

/// Rows whose leave-one-out residuals are computed together, for all candidates.
const SCORED_ROWS: usize = 256;

/// Sums of squared leave-one-out residuals, under way.
///
/// Rows pass by once, a block of them for all candidates: products of matrices, where a candidate
/// by itself would read all rows for a product with a vector.
#[derive(Clone)]
pub(super) struct Scores<'p, A: Scalar> {
    pub(super) spectrum: &'p DesignSvd<A>,
    /// What each candidate holds back of each direction, shape (directions, candidates).
    pub(super) complements: Array2<A>,
    /// Shape (candidates, outputs), in units of the scaled targets.
    pub(super) sums: Array2<f64>,
    /// Whether only what leave-one-out adds to squared residuals is counted.
    excess: bool,
}

impl<'p, A: Scalar> Scores<'p, A> {
    pub(super) fn new(spectrum: &'p DesignSvd<A>, candidates: &[f64], excess: bool) -> Self {
        let mut complements = Array2::zeros((spectrum.s.len(), candidates.len()));
        for (mut column, &lambda) in complements.columns_mut().into_iter().zip(candidates) {
            column.assign(&spectrum.filter_complements(A::from_f64(lambda)));
        }
        Self {
            spectrum,
            complements,
            sums: Array2::zeros((candidates.len(), spectrum.c.ncols())),
            excess,
        }
    }

    /// Adds rows, given what [`DesignSvdWithRows`] knows of them.
    pub(super) fn add(
        &mut self,
        u: ArrayView2<'_, A>,
        residual: ArrayView2<'_, A>,
        one_minus_leverage: ArrayView1<'_, A>,
    ) {
        self.add_counted(u, residual, one_minus_leverage, None);
    }

    /// As [`add`](Self::add); of a row that stands for several one is left out.
    fn add_counted(
        &mut self,
        u: ArrayView2<'_, A>,
        residual: ArrayView2<'_, A>,
        one_minus_leverage: ArrayView1<'_, A>,
        counts: Option<ArrayView1<'_, A>>,
    ) {
        let squared = u.mapv(|u| u * u);
        let mut denominators = A::product(squared.view(), self.complements.view());
        denominators += &one_minus_leverage.insert_axis(Axis(1));
        if let Some(counts) = counts {
            // 1 - h / k for 1 - h.
            for (mut row, &count) in denominators.rows_mut().into_iter().zip(counts) {
                row.mapv_inplace(|free| (free + (count - A::one())) / count);
            }
        }
        let c = self.spectrum.c.view();
        for (output, mut score) in self.sums.columns_mut().into_iter().enumerate() {
            let held = &self.complements * &c.slice(s![.., output..=output]);
            let mut residuals = A::product(u, held.view());
            residuals += &residual.slice(s![.., output..=output]);
            if self.excess {
                for row in residuals.rows() {
                    Zip::from(&mut score)
                        .and(row)
                        .for_each(|score, e| *score -= e.as_f64().powi(2));
                }
            }
            residuals /= &denominators;
            for row in residuals.rows() {
                Zip::from(&mut score)
                    .and(row)
                    .for_each(|score, e| *score += e.as_f64().powi(2));
            }
        }
    }

    /// Adds what rounding may make of the residuals of doubtful rows, from the `first` row on.
    pub(super) fn doubt(&mut self, rows: &DesignSvdWithRows<A>, first: usize) {
        let counted = |(row, _): &&(usize, _)| *row >= first;
        for (row, rounding) in rows.doubtful.iter().filter(counted) {
            let squared = rows.u.row(*row).mapv(|u| u * u);
            let free = squared.dot(&self.complements) + rows.one_minus_leverage[*row];
            for (mut score, rounding) in self.sums.columns_mut().into_iter().zip(rounding) {
                Zip::from(&mut score)
                    .and(&free)
                    .for_each(|score, free| *score += (*rounding / *free).as_f64().powi(2));
            }
        }
    }

    /// The scores, with what rounding is to add to them.
    pub(super) fn finish(self, candidates: &[f64], roundoff: f64) -> Array2<f64> {
        let mut sums = self.sums;
        for (mut score, &lambda) in sums.rows_mut().into_iter().zip(candidates) {
            let kept = self.spectrum.filter_factors(A::from_f64(lambda));
            let negligible = |o: usize| NEGLIGIBLE * score[o];
            let rounding = self.spectrum.rounding_squares(&kept, roundoff, negligible);
            for (score, rounding) in score.iter_mut().zip(rounding) {
                *score += rounding;
            }
        }
        sums
    }
}

/// The sum of squared leave-one-out residuals, and of what rounding is to add to them, for each
/// candidate and output, shape (candidates, outputs), in units of the scaled targets.
pub(super) fn scores<A: Scalar>(
    rows: &DesignSvdWithRows<A>,
    candidates: &[f64],
    roundoff: f64,
) -> Array2<f64> {
    let mut scores = Scores::new(&rows.spectrum, candidates, false);
    let frame = &rows.spectrum.frame;
    let counts = frame.weights_differ().then(|| frame.counts()).flatten();
    let add = |scores: &mut Scores<'_, A>, block: Range<usize>| {
        scores.add_counted(
            rows.u.slice(s![block.clone(), ..]),
            rows.residual.slice(s![block.clone(), ..]),
            rows.one_minus_leverage.slice(s![block.clone()]),
            counts.as_ref().map(|counts| counts.slice(s![block])),
        );
    };
    let blocks: Vec<_> = runs(0..rows.u.nrows(), SCORED_ROWS).collect();
    let work = rows.u.len().saturating_mul(candidates.len());
    if work < threads::WORTHWHILE {
        for block in blocks {
            add(&mut scores, block);
        }
    } else {
        let empty = &scores;
        let sums_of = |block| {
            let mut own = empty.clone();
            add(&mut own, block);
            own.sums
        };
        let parts = threads::map(blocks, sums_of);
        parts.iter().for_each(|part| scores.sums += part);
    }
    scores.doubt(rows, 0);
    scores.finish(candidates, roundoff)
}
