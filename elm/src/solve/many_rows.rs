//! The search for a strength of ridge with many more rows than neurons, which pass by a tile at a time.

use std::ops::AddAssign;

use ndarray::{Array2, ArrayView1, Axis, s};

use super::design_svd::DesignSvd;
use super::gcv::{gcv_scores, serves};
use super::lambda_grid::{FLAT, all_distinguishable_lambdas, distinguishable_lambdas, last_within};
use super::norms::norm;
use super::ridge::{Ridge, ridge_solution};
use super::tiles::{Tiles, squares};
use super::{Lambda, Reason, Solution, gram, left_out_tiles};
use crate::error::Result;
use crate::linalg::Backend;
use crate::scalar::Scalar;
use crate::threads;

impl Ridge {
    /// As [`search`](Self::search), for many rows: by sums of products, or nothing where these are not good
    /// enough, unless the `triangle` may be made.
    pub(super) fn search_many<A: Scalar>(
        self,
        tiles: &mut Tiles<'_, '_, A>,
        triangle: bool,
        roundoff: f64,
    ) -> Result<Option<Solution<f64>>> {
        if let Some(spectrum) = tiles.spectrum_of_products()?
            && serves(&spectrum, roundoff)
            && let Some(solution) = self.search_tiles(tiles, &spectrum, roundoff)?
        {
            return Ok(Some(solution));
        }
        if !triangle {
            return Ok(None);
        }
        let Some(spectrum) = tiles.spectrum_of_triangle()? else {
            return Ok(None);
        };
        self.search_tiles(tiles, &spectrum, roundoff)
    }

    /// As [`search`](Self::search), for many rows of this spectrum; or nothing where it does not serve these.
    fn search_tiles<A: Scalar>(
        self,
        tiles: &mut Tiles<'_, '_, A>,
        spectrum: &DesignSvd<f64>,
        roundoff: f64,
    ) -> Result<Option<Solution<f64>>> {
        let (lambda, errors) = if self.lambda() == Lambda::Gcv {
            (self.by_gcv(spectrum, roundoff), None)
        } else {
            let candidates = distinguishable_lambdas(spectrum);
            let (candidates, scores) = if spectrum.frame.weights_differ() {
                let mut lambda = self.by_gcv(spectrum, roundoff);
                lambda.sort_by(f64::total_cmp);
                lambda.dedup();
                let scores = left_out_tiles::scores_of_tiles(tiles, spectrum, &lambda, roundoff)?;
                (lambda, scores)
            } else {
                let scores = self.worthwhile_scores(tiles, spectrum, &candidates, roundoff)?;
                (candidates, scores)
            };
            let Some(scores) = scores else {
                return Ok(None);
            };
            let (lambda, errors) =
                self.lambda_and_errors(spectrum, &candidates, &scores, (roundoff, true));
            (lambda, Some(errors))
        };
        let mut solution = ridge_solution(spectrum, Reason::LambdaSearch, &lambda, errors);
        let weak = |lambda: &f64| *lambda < gram::weakest();
        if spectrum.weakest.is_some() && lambda.iter().any(weak) {
            tiles.refine(spectrum, &mut solution)?;
        }
        Ok(Some(solution))
    }

    /// Leave-one-out scores of the candidates that may be chosen, by generalized cross-validation. Stronger
    /// ones have their squared residuals: scores are not below those, so that it is known afterwards
    /// whether one of them might have been chosen. Of a spectrum that does not serve all strengths weaker
    /// ones have no score at first, as they leave rows least freedom; then all are scored. Nothing where
    /// one that is not served may be the best.
    fn worthwhile_scores<A: Scalar>(
        self,
        tiles: &mut Tiles<'_, '_, A>,
        spectrum: &DesignSvd<f64>,
        candidates: &[f64],
        roundoff: f64,
    ) -> Result<Option<Array2<f64>>> {
        /// What generalized cross-validation may be off by, in the score and in the strength.
        const MARGIN: f64 = 1.05;
        const WEAKER: f64 = 1e-2;
        let rows = spectrum.frame.weighted_rows as f64;
        let expected = gcv_scores(spectrum, candidates, roundoff) * (rows * rows);
        let mut scores = left_out_tiles::squared_residuals(spectrum, candidates);
        let least = expected.fold_axis(Axis(0), f64::INFINITY, |least, score| least.min(*score));
        let bound = least * MARGIN;
        let may_be = |row: ArrayView1<'_, f64>| row.iter().zip(&bound).any(|(r, b)| r <= b);
        // Squared residuals rise with the strength.
        let count = scores.axis_iter(Axis(0)).rposition(may_be);
        let count = count.map_or(0, |last| last + 1);
        let best = |scores: ArrayView1<'_, f64>| last_within(scores, 0.0);
        let best = expected.columns().into_iter().map(best).min();
        let weakest = best.map_or(0.0, |best| WEAKER * candidates[best]);
        let mut first = match spectrum.weakest {
            Some(_) => candidates.partition_point(|strength| *strength < weakest),
            None => 0,
        };
        let unserved = all_distinguishable_lambdas(spectrum).len() > candidates.len();
        // So many cost little beside the rows' coordinates.
        let mut count = count
            .max(first + spectrum.s.len() / 8)
            .min(candidates.len());
        loop {
            if first < count {
                let some = &candidates[first..count];
                let Some(some) = left_out_tiles::scores_of_tiles(tiles, spectrum, some, roundoff)?
                else {
                    return Ok(None);
                };
                scores.slice_mut(s![..first, ..]).fill(f64::INFINITY);
                scores.slice_mut(s![first..count, ..]).assign(&some);
                let mut columns = scores.columns().into_iter();
                if (first > 0 || unserved) && columns.any(|scores| falls(scores, first)) {
                    // Towards weaker strengths, of which one may be the best.
                    if first == 0 {
                        return Ok(None);
                    }
                    first = 0;
                } else if self.choose(spectrum, &scores).iter().all(|&c| c < count) {
                    return Ok(Some(scores));
                }
            }
            count = candidates.len();
        }
    }
}

/// Whether the first of these scores is the least of them, and the next one is larger.
fn falls(scores: ArrayView1<'_, f64>, first: usize) -> bool {
    let least = scores.iter().copied().fold(f64::INFINITY, f64::min);
    let next = scores.get(first + 1);
    scores[first] <= least && next.is_none_or(|next| scores[first] * (1.0 + FLAT) < *next)
}

impl<A: Scalar> Tiles<'_, '_, A> {
    /// One step of iterative refinement of a solution from sums of products. These are off by $\epsilon
    /// s_1^2$, so that output weights are by $\epsilon / \lambda$ of themselves; with residuals of the rows
    /// themselves they are off by the square of that (Björck, Stability analysis of the method of
    /// seminormal equations, 1987).
    ///
    /// # Errors
    /// Those of making the rows.
    fn refine(&self, spectrum: &DesignSvd<f64>, solution: &mut Solution<f64>) -> Result<()> {
        let (neurons, outputs) = (self.neurons(), self.outputs());
        let DesignSvd { s, vt, frame, .. } = spectrum;
        let mean = spectrum.means();
        // Powers of two: nothing is rounded.
        let units = frame.target_scale.mapv(|scale| scale / frame.hidden_scale);
        let mut beta = &solution.beta / &units;
        let zeros = || Array2::zeros((neurons + 1, outputs));
        let sums = threads::sum(
            self.parts(),
            zeros,
            || self.memory(),
            |memory, part, sums| {
                for range in self.ranges(part) {
                    let tile = self.tile(range, &mean, memory)?;
                    let (hidden, rest) = tile.split_at(Axis(1), neurons);
                    let (targets, _) = rest.split_at(Axis(1), outputs);
                    let left = &targets - &f64::product(hidden, beta.view());
                    let (mut slopes, mut total) = sums.view_mut().split_at(Axis(0), neurons);
                    slopes += &f64::product(hidden.t(), left.view());
                    total += &squares(left.view());
                }
                Ok(())
            },
        )?;
        let sums = sums.unwrap_or_else(zeros);
        let (slopes, total) = sums.view().split_at(Axis(0), neurons);
        let mut norms = Vec::with_capacity(outputs);
        for (output, lambda) in solution.diagnosis.lambda.iter().enumerate() {
            let lambda = lambda * s[0] * s[0];
            let slopes = slopes.column(output);
            let left = &slopes - &(lambda * &beta.column(output));
            // Directions that are not known are held back as if they were of no length.
            let known = vt.dot(&left);
            let step = &known / &s.mapv(|s| s * s + lambda);
            let step = vt.t().dot(&(step - &known / lambda)) + left / lambda;
            let along = vt.dot(&step) * s;
            norms.push(
                (total[[0, output]] - 2.0 * step.dot(&slopes) + along.dot(&along))
                    .max(0.0)
                    .sqrt(),
            );
            beta.column_mut(output).add_assign(&step);
        }
        solution.beta = frame.unscale(beta);
        solution.intercept = frame.constant(&solution.beta);
        let norms = norms.into_iter();
        solution.diagnosis.residual_norm = frame.residual_norms_in_original_units(norms);
        solution.diagnosis.beta_norm = solution.beta.columns().into_iter().map(norm).collect();
        Ok(())
    }
}
