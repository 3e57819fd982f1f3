//! Leave-one-out scores of many strengths at once: from the rows of a factorization, or from rows
//! that pass by a tile at a time.

use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, Zip, s};

use super::Route;
use super::design_svd::{DesignSvd, DesignSvdWithRows};
use super::normal_equations::runs;
use super::tiles::Tiles;
use crate::error::Result;
use crate::linalg::{Backend, QrFactor};
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
struct Scores<'p, A: Scalar> {
    spectrum: &'p DesignSvd<A>,
    /// What each candidate holds back of each direction, shape (directions, candidates).
    complements: Array2<A>,
    /// Shape (candidates, outputs), in units of the scaled targets.
    sums: Array2<f64>,
    /// Whether only what leave-one-out adds to squared residuals is counted.
    excess: bool,
}

impl<'p, A: Scalar> Scores<'p, A> {
    fn new(spectrum: &'p DesignSvd<A>, candidates: &[f64], excess: bool) -> Self {
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
    fn add(
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

    /// The scores, with what rounding is to add to them.
    fn finish(self, candidates: &[f64], roundoff: f64) -> Array2<f64> {
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
    scores.finish(candidates, roundoff)
}

/// As [`scores`], from one more pass over the rows of `spectrum`.
///
/// A row has the coordinates $u = \\tilde h V / s$ in the singular vectors. Where it all but determines its
/// own fit, $1 - \\sum_j u_j^2$ has no digits left: there are no more such rows than neurons, and these are
/// scored from a problem in which the triangle of the other rows stands for them. Nothing where the spectrum
/// does not serve all strengths: what such rows call for may be one of the others.
///
/// # Errors
/// Those of making the rows and of the factorizations.
pub(super) fn scores_of_tiles<A: Scalar>(
    tiles: &mut Tiles<'_, '_, A>,
    spectrum: &DesignSvd<f64>,
    candidates: &[f64],
    roundoff: f64,
) -> Result<Option<Array2<f64>>> {
    let mean = means(spectrum);
    let condition = match (spectrum.s.first(), spectrum.s.last()) {
        (Some(first), Some(last)) => first / last,
        _ => 1.0,
    };
    let lightest = Light::limit(condition);
    // Where half of the rows would be done again, the first time is lost.
    let leverage = spectrum.s.len() as f64 / spectrum.frame.weighted_rows as f64;
    let single = spectrum.route == Route::GramSvd && leverage < 0.7 * lightest;
    let pass = Pass {
        to_u: Arc::new(&spectrum.vt.t() / &spectrum.s),
        scores: Scores::new(spectrum, candidates, single),
        close: Vec::new(),
    };
    let light = single.then(|| Light::new(spectrum, candidates, lightest));
    let weak = spectrum.weakest.is_some();
    let seen = &*tiles;
    let score = |part: Range<usize>| {
        let (mut pass, mut memory) = (pass.clone(), seen.memory());
        for range in seen.ranges(part) {
            if weak && !pass.close.is_empty() {
                break;
            }
            let first = range.start;
            let tile = seen.tile(range.clone(), &mean, &mut memory)?;
            let Some(light) = &light else {
                pass.add(tile, &range.collect::<Vec<_>>());
                continue;
            };
            let heavy = light.add(tile, &mut pass.scores.sums);
            if !heavy.is_empty() {
                let rows: Vec<usize> = heavy.iter().map(|row| first + row).collect();
                pass.add(tile.select(Axis(0), &heavy).view(), &rows);
            }
        }
        Ok(pass)
    };
    let passed = threads::reduce(seen.parts(), score, |all, part| {
        all.scores.sums += &part.scores.sums;
        all.close.extend(part.close);
    })?;
    let mut pass = passed.unwrap_or(pass);
    if single {
        pass.scores.sums += &squared_residuals(spectrum, candidates);
    }
    if !pass.close.is_empty() {
        if weak {
            return Ok(None);
        }
        let close = &pass.close;
        pass.scores.sums +=
            &scores_of_close_rows(tiles, spectrum, &mean, close, candidates, single)?;
    }
    Ok(Some(pass.scores.finish(candidates, roundoff)))
}

/// The squared residuals of each candidate and output, which the spectrum knows: the least that scores
/// can be. Shape (candidates, outputs).
pub(super) fn squared_residuals(spectrum: &DesignSvd<f64>, candidates: &[f64]) -> Array2<f64> {
    let mut sums = Array2::zeros((candidates.len(), spectrum.c.ncols()));
    for (mut row, &lambda) in sums.rows_mut().into_iter().zip(candidates) {
        let held = spectrum.filter_complements(lambda);
        let left = (&spectrum.c * &held.insert_axis(Axis(1))).mapv_into(|c| c * c);
        row.assign(&(left.sum_axis(Axis(0)) + &spectrum.residual_ss));
    }
    sums
}

/// A pass over rows in `f64`.
#[derive(Clone)]
struct Pass<'p> {
    /// What takes a row to its coordinates in the left singular vectors.
    to_u: Arc<Array2<f64>>,
    scores: Scores<'p, f64>,
    /// Rows that all but determine their own fit.
    close: Vec<usize>,
}

impl Pass<'_> {
    /// Scores the rows of a tile, of these numbers, or notes that they are close.
    fn add(&mut self, tile: ArrayView2<'_, f64>, rows: &[usize]) {
        /// Freedom below which a difference from 1 is not relied on.
        const CLOSE: f64 = 1e-4;
        let spectrum = self.scores.spectrum;
        let (hidden, rest) = tile.split_at(Axis(1), self.to_u.nrows());
        let (targets, ones) = rest.split_at(Axis(1), spectrum.c.ncols());
        let u = f64::product(hidden, self.to_u.view());
        let residual = &targets - &f64::product(u.view(), spectrum.c.view());
        let squared = u.mapv(|u| u * u);
        let mut one_minus_leverage = squared.map_axis(Axis(1), |row| 1.0 - row.sum());
        if let Some(roots) = ones.columns().into_iter().next() {
            let total = spectrum.frame.total_weight;
            Zip::from(&mut one_minus_leverage)
                .and(roots)
                .for_each(|one_minus_leverage, root| *one_minus_leverage -= root * root / total);
        }
        // What the weakest strength leaves of them; the others leave more.
        let mut free = squared.dot(&self.scores.complements.column(0));
        free += &one_minus_leverage;
        if free.iter().all(|free| *free >= CLOSE) {
            self.scores
                .add(u.view(), residual.view(), one_minus_leverage.view());
            return;
        }
        let (far, near): (Vec<usize>, Vec<usize>) =
            (0..free.len()).partition(|&row| free[row] >= CLOSE);
        self.scores.add(
            u.select(Axis(0), &far).view(),
            residual.select(Axis(0), &far).view(),
            one_minus_leverage.select(Axis(0), &far).view(),
        );
        self.close.extend(near.iter().map(|&row| rows[row]));
    }
}

/// A pass over rows in `f32`, for those that have little leverage.
///
/// Leave-one-out adds $e_i^2 ((1 - h_i)^{-2} - 1)$ to a squared residual, which an error of $\delta$ in
/// $h_i$ changes by $2 \delta (1 - h_i)^{-3}$ of that. The leverage $h_i$ is off by as much of itself as the
/// condition $\kappa$ multiplies the rounding of single precision by. Where
/// $\kappa h_i (1 - h_i)^{-3}$ is at most 21, as it is for leverages of 0.02 and a condition of 1000, the sum
/// over rows is off by 3e-6 of itself at most, and as the errors of rows have nothing to do with each other
/// by far less.
struct Light {
    /// The leverage up to which rows are light.
    limit: f32,
    to_u: Array2<f32>,
    /// What each candidate keeps of each direction, shape (directions, candidates).
    kept: Array2<f32>,
    /// Of each output the output weights of all candidates, shape (neurons, candidates).
    beta: Vec<Array2<f32>>,
    total_weight: f32,
}

impl Light {
    /// The leverage up to which rows of a problem of this condition are light; nothing above 1000.
    fn limit(condition: f64) -> f64 {
        let ratio = 21.0 / condition;
        // Satisfies h / (1 - h)^3 <= ratio, and leaves the differences from 1 their digits.
        let limit = (ratio / (1.0 + 3.0 * ratio)).min(0.25);
        if condition <= 1e3 { limit } else { 0.0 }
    }

    fn new(spectrum: &DesignSvd<f64>, candidates: &[f64], limit: f64) -> Self {
        let narrow = |values: &Array2<f64>| values.mapv(f32::from_f64);
        let mut kept = Array2::zeros((spectrum.s.len(), candidates.len()));
        for (mut column, &lambda) in kept.columns_mut().into_iter().zip(candidates) {
            column.assign(&spectrum.filter_factors(lambda));
        }
        let gain = &kept / &spectrum.s.view().insert_axis(Axis(1));
        let beta = |c: ArrayView1<'_, f64>| {
            let along = &gain * &c.insert_axis(Axis(1));
            narrow(&f64::product(spectrum.vt.t(), along.view()))
        };
        Self {
            limit: f32::from_f64(limit),
            to_u: narrow(&(&spectrum.vt.t() / &spectrum.s)),
            beta: spectrum.c.columns().into_iter().map(beta).collect(),
            kept: narrow(&kept),
            total_weight: f32::from_f64(spectrum.frame.total_weight),
        }
    }

    /// Adds what leave-one-out adds for the rows of a tile to `sums`, shape (candidates, outputs); returns
    /// those that have too much leverage, and have not been added.
    fn add(&self, tile: ArrayView2<'_, f64>, sums: &mut Array2<f64>) -> Vec<usize> {
        let neurons = self.to_u.nrows();
        let (hidden, rest) = tile.split_at(Axis(1), neurons);
        let (targets, ones) = rest.split_at(Axis(1), self.beta.len());
        let hidden = hidden.mapv(f32::from_f64);
        let mut squared = f32::product(hidden.view(), self.to_u.view());
        squared.mapv_inplace(|u| u * u);
        let mut leverages = f32::product(squared.view(), self.kept.view());
        let mut most = squared.sum_axis(Axis(1));
        if let Some(roots) = ones.columns().into_iter().next() {
            let own = roots.mapv(|root| f32::from_f64(root * root) / self.total_weight);
            most += &own;
            leverages += &own.insert_axis(Axis(1));
        }
        leverages.mapv_inplace(|h| h * (2.0 - h) / ((1.0 - h) * (1.0 - h)));
        // What is not a number is heavy, too.
        let heavy: Vec<usize> = (0..most.len())
            .filter(|&row| !(0.0..=self.limit).contains(&most[row]))
            .collect();
        for &row in &heavy {
            leverages.row_mut(row).fill(0.0);
        }
        let outputs = targets.columns().into_iter().zip(&self.beta);
        for ((targets, beta), mut sums) in outputs.zip(sums.columns_mut()) {
            let fitted = f32::product(hidden.view(), beta.view());
            for ((fitted, added), &target) in
                fitted.rows().into_iter().zip(leverages.rows()).zip(targets)
            {
                Zip::from(&mut sums)
                    .and(fitted)
                    .and(added)
                    .for_each(|sum, &fitted, &added| {
                        if added > 0.0 {
                            *sum += (target - f64::from(fitted)).powi(2) * f64::from(added);
                        }
                    });
            }
        }
        heavy
    }
}

/// Of hidden values and targets, in units of their scale.
fn means(spectrum: &DesignSvd<f64>) -> Vec<f64> {
    let frame = &spectrum.frame;
    let hidden = &frame.hidden_mean / frame.hidden_scale;
    let targets = &frame.target_mean / &frame.target_scale;
    hidden.iter().chain(&targets).copied().collect()
}

/// The squared leave-one-out residuals of rows that all but determine their own fit.
///
/// Rows are interchangeable with any others that have the same sums of products: for those that are
/// not `close` their triangle stands, of which the row of the ones is what an intercept makes of them.
fn scores_of_close_rows<A: Scalar>(
    tiles: &mut Tiles<'_, '_, A>,
    spectrum: &DesignSvd<f64>,
    mean: &[f64],
    close: &[usize],
    candidates: &[f64],
    excess: bool,
) -> Result<Array2<f64>> {
    let neurons = tiles.neurons();
    let outputs = tiles.outputs();
    let intercept = spectrum.frame.intercept;
    let QrFactor { r, qtb, .. } = tiles.triangle_without(close, mean)?;
    let extra = usize::from(intercept);
    let (ones, others) = r.view().split_at(Axis(1), extra);
    let mut own = Array2::zeros((close.len(), neurons + outputs + extra));
    let mut memory = tiles.memory();
    for (mut to, &row) in own.rows_mut().into_iter().zip(close) {
        to.assign(&tiles.tile(row..row + 1, mean, &mut memory)?.row(0));
    }
    let (own_hidden, rest) = own.view().split_at(Axis(1), neurons);
    let (own_targets, own_ones) = rest.split_at(Axis(1), outputs);
    let stack = |a: ArrayView2<'_, f64>, b: ArrayView2<'_, f64>| {
        let mut both = Array2::zeros((a.nrows() + b.nrows(), a.ncols()));
        let (mut top, mut bottom) = both.view_mut().split_at(Axis(0), a.nrows());
        top.assign(&a);
        bottom.assign(&b);
        both
    };
    let hidden = stack(others, own_hidden);
    let targets = stack(qtb.view(), own_targets);
    let constant = stack(ones, own_ones)
        .columns()
        .into_iter()
        .next()
        .map_or(Array1::zeros(hidden.nrows()), |ones| {
            &ones / spectrum.frame.total_weight.sqrt()
        });
    let none = Array1::zeros(hidden.nrows());
    let rows = DesignSvdWithRows::of_rows(hidden, targets, constant, none, spectrum.frame.clone())?;
    let mut scores = Scores::new(&rows.spectrum, candidates, excess);
    let from = rows.u.nrows() - close.len();
    scores.add(
        rows.u.slice(s![from.., ..]),
        rows.residual.slice(s![from.., ..]),
        rows.one_minus_leverage.slice(s![from..]),
    );
    Ok(scores.sums)
}
